//! Fingerprints: equal when two frames have the same content.

use std::io::{self, BufWriter, Write};

use serde::Serialize;
use twox_hash::xxhash3_128;

/// A 128-bit hash (XXH3) of everything that a value serializes, floats by their bits.
///
/// Values of one type with the same content have the same fingerprint. Values that differ in one bit have
/// different ones, except with probability 2^-128 per pair. Compare fingerprints of one type only: names of
/// types and fields are not hashed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Fingerprint(u128);

impl Fingerprint {
    /// Fingerprint of `value`. Derive `Serialize` on its type, so that no field is missing.
    ///
    /// # Errors
    /// [`FingerprintError`] for types that cannot be serialized, such as a sequence of unknown length.
    pub fn of<T: Serialize>(value: &T) -> Result<Self, FingerprintError> {
        let mut writer = BufWriter::with_capacity(BUFFER_BYTES, HashWriter(xxhash3_128::Hasher::new()));
        postcard::to_io(value, &mut writer).map_err(|error| FingerprintError(error.to_string()))?;
        let hash = writer.into_inner().map_err(|error| FingerprintError(error.to_string()))?;
        Ok(Self(hash.0.finish_128()))
    }
}

/// Reason why a value has no fingerprint.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("internal error, please report it: frames cannot be compared: {0}")]
pub struct FingerprintError(String);

/// Bytes that are buffered before hashing: the serializer writes single numbers.
const BUFFER_BYTES: usize = 1 << 16;

/// A hash as a writer.
struct HashWriter(xxhash3_128::Hasher);

impl Write for HashWriter {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.write(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;

    #[derive(Clone, Serialize)]
    struct Value {
        names: Vec<String>,
        numbers: Arc<[f32]>,
        index: Option<u32>,
    }

    fn value() -> Value {
        Value { names: vec!["a".to_owned(), "bc".to_owned()], numbers: Arc::from([0.0, 1.5]), index: None }
    }

    #[test]
    fn equal_content_has_equal_fingerprints() {
        assert_eq!(Fingerprint::of(&value()), Fingerprint::of(&value()));
    }

    #[test]
    fn every_bit_of_every_field_counts() {
        let others = [
            Value { numbers: Arc::from([-0.0, 1.5]), ..value() },
            Value { numbers: Arc::from([0.0, f32::from_bits(1.5_f32.to_bits() + 1)]), ..value() },
            Value { numbers: Arc::from([0.0]), ..value() },
            Value { names: vec!["ab".to_owned(), "c".to_owned()], ..value() },
            Value { names: vec!["abc".to_owned()], ..value() },
            Value { index: Some(0), ..value() },
        ];
        let all: std::collections::HashSet<_> =
            others.iter().chain([&value()]).map(|value| Fingerprint::of(value).unwrap()).collect();
        assert_eq!(all.len(), others.len() + 1);
    }

    #[test]
    fn content_longer_than_the_buffer_is_hashed_to_its_end() {
        let long = |last: u32| Fingerprint::of(&(0..40_000).chain([last]).collect::<Vec<u32>>());
        assert_ne!(long(1), long(2));
    }
}
