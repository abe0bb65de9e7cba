//! Whether an OBJ file names materials, seen while it is read.

use std::io::{Read, Result};

/// Statements that name materials, and room for the longest of them.
const NAMING: [&[u8]; 2] = [b"mtllib", b"usemtl"];
const LONGEST: usize = 6;

/// Passes an OBJ file on and watches the first word of each line. The loader is given no materials, so what
/// it returns does not tell whether the file asked for any.
pub(super) struct Statements<R> {
    inner: R,
    /// The first word of this line so far, cut one byte after the longest that counts.
    word: Vec<u8>,
    /// Whether the first word is over.
    past_word: bool,
    names_materials: bool,
}

impl<R> Statements<R> {
    pub fn new(inner: R) -> Self {
        Self { inner, word: Vec::with_capacity(LONGEST + 1), past_word: false, names_materials: false }
    }

    /// Whether what has been read names materials.
    pub fn names_materials(&self) -> bool {
        self.names_materials || self.is_naming()
    }

    fn is_naming(&self) -> bool {
        NAMING.contains(&self.word.as_slice())
    }

    fn watch(&mut self, byte: u8) {
        if byte.is_ascii_whitespace() {
            self.names_materials |= self.is_naming();
            self.past_word |= !self.word.is_empty();
            self.word.clear();
            // Spaces before the first word do not end it; the end of a line begins the next one's.
            self.past_word &= byte != b'\n';
        } else if !self.past_word && self.word.len() <= LONGEST {
            self.word.push(byte);
        }
    }
}

impl<R: Read> Read for Statements<R> {
    fn read(&mut self, into: &mut [u8]) -> Result<usize> {
        let count = self.inner.read(into)?;
        into.iter().take(count).for_each(|byte| self.watch(*byte));
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One byte at a time, so that words cross the ends of reads.
    struct Slow<'a>(&'a [u8]);

    impl Read for Slow<'_> {
        fn read(&mut self, into: &mut [u8]) -> Result<usize> {
            let end = into.len().min(1);
            self.0.read(&mut into[..end])
        }
    }

    fn names(text: &str) -> bool {
        let mut statements = Statements::new(Slow(text.as_bytes()));
        let mut read = Vec::new();
        statements.read_to_end(&mut read).unwrap();
        assert_eq!(read, text.as_bytes());
        statements.names_materials()
    }

    #[test]
    fn only_the_first_word_of_a_line_is_a_statement() {
        for text in
            ["mtllib a.mtl", "v 0 0 0\nusemtl red\n", "\r\n\t mtllib\ta", "usemtl", "g a\r\nusemtl a\r\n"]
        {
            assert!(names(text), "{text:?}");
        }
        for text in
            ["", "# mtllib a.mtl\n", "g usemtl\n", "usemtls a\n", "usemt\nl a\n", "o x mtllib\n  # usemtl"]
        {
            assert!(!names(text), "{text:?}");
        }
    }
}
