//! Traces in JLS. The checksums are made right first, so that what is behind them is reached.
#![no_main]

use libfuzzer_sys::fuzz_target;
use quintile_fuzz::on_disk;
use traces::io::ReadOptions;

/// CRC-32C, bit by bit.
fn crc32c(bytes: &[u8]) -> [u8; 4] {
    let crc = bytes.iter().fold(!0_u32, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| (crc >> 1) ^ (0x82f6_3b78 * (crc & 1)))
    });
    (!crc).to_le_bytes()
}

fn sealed(data: &[u8]) -> Vec<u8> {
    let mut bytes = data.to_vec();
    let size = bytes.len();
    if size < 32 {
        return bytes;
    }
    bytes[16..24].copy_from_slice(&(size as u64).to_le_bytes());
    let crc = crc32c(&bytes[..28]);
    bytes[28..32].copy_from_slice(&crc);
    let mut at = 32;
    while at + 32 <= size {
        let crc = crc32c(&bytes[at..at + 28]);
        bytes[at + 28..at + 32].copy_from_slice(&crc);
        let length = [20, 21, 22, 23].map(|byte| bytes[at + byte]);
        let length = u32::from_le_bytes(length) as usize;
        let end = at + 32 + if length == 0 { 0 } else { (length + 4).next_multiple_of(8) };
        if end > size {
            break;
        }
        if length > 0 {
            let crc = crc32c(&bytes[at + 32..at + 32 + length]);
            bytes[end - 4..end].copy_from_slice(&crc);
        }
        at = end;
    }
    bytes
}

fuzz_target!(|data: &[u8]| {
    on_disk("a.jls", &sealed(data), |path| {
        let _ = traces::io::read(path, &ReadOptions { repair: true, ..ReadOptions::default() });
        let _ = traces::stream::clock(path, &ReadOptions::default());
    });
});
