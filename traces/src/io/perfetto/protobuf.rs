//! Encoder of protocol buffers, limited to the types of a Perfetto trace.
//!
//! The wire format is that of <https://protobuf.dev/programming-guides/encoding/>: a field is its number and
//! wire type as a varint, then a varint, eight bytes, or a length and that many bytes.

/// Wire type of varints.
const VARINT: u64 = 0;
/// Wire type of eight bytes, little endian.
const FIXED64: u64 = 1;
/// Wire type of a length and that many bytes.
const BYTES: u64 = 2;

/// Builder of a message; fields are encoded in the order of the calls.
#[derive(Clone, Debug, Default)]
pub struct Message {
    bytes: Vec<u8>,
}

impl Message {
    /// A message without fields.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds an unsigned integer, a bool or an enum.
    #[must_use]
    pub fn uint(mut self, field: u32, value: u64) -> Self {
        self.key(field, VARINT);
        self.varint(value);
        self
    }

    /// Adds a double.
    #[must_use]
    pub fn double(mut self, field: u32, value: f64) -> Self {
        self.key(field, FIXED64);
        self.bytes.extend_from_slice(&value.to_le_bytes());
        self
    }

    /// Adds a string.
    #[must_use]
    pub fn string(mut self, field: u32, value: &str) -> Self {
        self.length_delimited(field, value.as_bytes());
        self
    }

    /// Adds a message within this one.
    #[must_use]
    pub fn message(mut self, field: u32, value: &Self) -> Self {
        self.length_delimited(field, &value.bytes);
        self
    }

    /// The encoded message.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    fn length_delimited(&mut self, field: u32, value: &[u8]) {
        self.key(field, BYTES);
        self.varint(value.len() as u64);
        self.bytes.extend_from_slice(value);
    }

    fn key(&mut self, field: u32, wire_type: u64) {
        self.varint(u64::from(field) << 3 | wire_type);
    }

    fn varint(&mut self, mut value: u64) {
        while value >= 0x80 {
            self.bytes.push(value as u8 | 0x80);
            value >>= 7;
        }
        self.bytes.push(value as u8);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The examples of the encoding guide: 150 in field 1, "testing" in field 2, the first inside field 3.
    #[test]
    fn the_examples_of_the_encoding_guide() {
        assert_eq!(Message::new().uint(1, 150).bytes(), [0x08, 0x96, 0x01]);
        let testing = [0x12, 0x07, 0x74, 0x65, 0x73, 0x74, 0x69, 0x6e, 0x67];
        assert_eq!(Message::new().string(2, "testing").bytes(), testing);
        let inner = Message::new().uint(1, 150);
        assert_eq!(Message::new().message(3, &inner).bytes(), [0x1a, 0x03, 0x08, 0x96, 0x01]);
    }

    #[test]
    fn the_largest_varint_takes_ten_bytes() {
        let mut expected = vec![0x08];
        expected.extend([0xff; 9]);
        expected.push(0x01);
        assert_eq!(Message::new().uint(1, u64::MAX).bytes(), expected);
    }

    #[test]
    fn a_double_is_eight_bytes_little_endian() {
        assert_eq!(Message::new().double(44, 1.0).bytes(), [0xe1, 0x02, 0, 0, 0, 0, 0, 0, 0xf0, 0x3f]);
    }
}
