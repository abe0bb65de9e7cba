//! Sample types of JLS files.

/// A sample type that is read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Sample {
    F32,
    F64,
    /// A whole number, to be multiplied by `scale`.
    Whole {
        bytes: usize,
        signed: bool,
        scale: f64,
    },
}

/// The sample types that are read.
pub const SAMPLE_TYPES: &str = "f32, f64 or a whole number of 8, 16 or 32 bits";

const FLOAT: u32 = 4;
const UNSIGNED: u32 = 2;

impl Sample {
    /// From the type of a definition: base type (bits 0 to 3), size in bits (8 to 15), binary digits after
    /// the point (16 to 23). Its name if it cannot be read.
    pub fn of(data_type: u32) -> Result<Self, String> {
        let (base, bits, point) = (data_type & 0xf, (data_type >> 8) & 0xff, (data_type >> 16) as u8 as i8);
        match (base, bits) {
            (FLOAT, 32) => Ok(Self::F32),
            (FLOAT, 64) => Ok(Self::F64),
            (1 | 3, 8 | 16 | 32) => Ok(Self::Whole {
                bytes: bits as usize / 8,
                signed: base & UNSIGNED == 0,
                scale: libm::exp2(-f64::from(point)),
            }),
            (1, bits) => Err(format!("i{bits}")),
            (3, bits) => Err(format!("u{bits}")),
            _ => Err(format!("of an unknown type ({data_type:#x})")),
        }
    }

    pub fn bytes(self) -> usize {
        match self {
            Self::F32 => 4,
            Self::F64 => 8,
            Self::Whole { bytes, .. } => bytes,
        }
    }

    /// Decodes samples and appends them.
    pub fn decode(self, bytes: &[u8], into: &mut Vec<f32>) {
        match self {
            Self::F32 => into.extend(bytes.as_chunks().0.iter().map(|&bytes| f32::from_le_bytes(bytes))),
            Self::F64 => {
                into.extend(bytes.as_chunks().0.iter().map(|&bytes| f64::from_le_bytes(bytes) as f32));
            }
            Self::Whole { bytes: size, signed, scale } => {
                // Moved to the upper end of 32 bits, so that the shift back brings the sign along.
                let shift = 32 - 8 * size as u32;
                into.extend(bytes.chunks_exact(size).map(|bytes| {
                    let raised =
                        bytes.iter().rev().fold(0_u32, |number, &byte| number << 8 | u32::from(byte))
                            << shift;
                    let number =
                        if signed { f64::from(raised as i32 >> shift) } else { f64::from(raised >> shift) };
                    (number * scale) as f32
                }));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decoded(data_type: u32, bytes: &[u8]) -> Vec<f32> {
        let mut into = Vec::new();
        Sample::of(data_type).unwrap().decode(bytes, &mut into);
        into
    }

    #[test]
    fn whole_numbers_keep_sign_and_point() {
        assert_eq!(decoded(0x1001, &[0xff, 0xff, 0x00, 0x80]), [-1.0, -32_768.0]);
        assert_eq!(decoded(0x1003, &[0xff, 0xff, 0x00, 0x80]), [65_535.0, 32_768.0]);
        assert_eq!(decoded(0x0801, &[0x80, 0x7f]), [-128.0, 127.0]);
        assert_eq!(decoded(0x0803, &[0x80, 0x7f]), [128.0, 127.0]);
        assert_eq!(decoded(0x2001, &[0xfe, 0xff, 0xff, 0xff]), [-2.0]);
        assert_eq!(decoded(0x2003, &[0, 0, 0, 0x80]), [2_147_483_648.0]);
        assert_eq!(decoded(0x04_1001, &[0x18, 0x00]), [1.5]);
        assert_eq!(decoded(0x4004, &0.1_f64.to_le_bytes()), [0.1]);
    }

    #[test]
    fn other_types_are_named() {
        assert_eq!(Sample::of(0x0403).unwrap_err(), "u4");
        assert_eq!(Sample::of(0x1801).unwrap_err(), "i24");
        assert!(Sample::of(0x1004).unwrap_err().contains("0x1004"));
    }
}
