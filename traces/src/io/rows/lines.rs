//! A limit on the length of a line, so that a file without line ends is not taken into memory whole.

use std::io::{Error, Read, Result};

/// The longest line that is read, bytes.
pub(super) const LONGEST_LINE: usize = 1 << 20;

/// A reader that fails where a line is longer than [`LONGEST_LINE`].
pub(super) struct LineLimit<R> {
    inner: R,
    since_end: usize,
}

impl<R> LineLimit<R> {
    pub fn new(inner: R) -> Self {
        Self { inner, since_end: 0 }
    }
}

impl<R: Read> Read for LineLimit<R> {
    fn read(&mut self, into: &mut [u8]) -> Result<usize> {
        let read = self.inner.read(into)?;
        self.since_end = match into[..read].iter().rposition(|&byte| byte == b'\n') {
            Some(last) => read - last - 1,
            None => self.since_end + read,
        };
        if self.since_end > LONGEST_LINE {
            return Err(Error::other("a line is longer than 1 MiB"));
        }
        Ok(read)
    }
}
