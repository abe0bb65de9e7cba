//! JLS files whose checksums are made right, so that what is behind them is reached: for tests and the fuzz target.

/// CRC-32C bit by bit.
pub fn crc32c(bytes: &[u8]) -> [u8; 4] {
    let crc = bytes.iter().fold(!0_u32, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| (crc >> 1) ^ (0x82f6_3b78 * (crc & 1)))
    });
    (!crc).to_le_bytes()
}

/// A copy with its length and checksums made right, as far as its chunks can be followed.
pub fn sealed(bytes: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    seal(&mut bytes);
    bytes
}

fn seal(bytes: &mut [u8]) {
    let size = bytes.len();
    if size < 32 {
        return;
    }
    bytes[16..24].copy_from_slice(&(size as u64).to_le_bytes());
    let crc = crc32c(&bytes[..28]);
    bytes[28..32].copy_from_slice(&crc);
    let mut at = 32;
    while at + 32 <= size {
        let crc = crc32c(&bytes[at..at + 28]);
        bytes[at + 28..at + 32].copy_from_slice(&crc);
        let length =
            u32::from_le_bytes([bytes[at + 20], bytes[at + 21], bytes[at + 22], bytes[at + 23]]) as usize;
        let end = at + 32 + if length == 0 { 0 } else { (length + 4).next_multiple_of(8) };
        if end > size {
            return;
        }
        if length > 0 {
            let crc = crc32c(&bytes[at + 32..at + 32 + length]);
            bytes[end - 4..end].copy_from_slice(&crc);
        }
        at = end;
    }
}
