//! Reader of packed little-endian files, with checked lengths.

use std::path::Path;

use crate::error::{LoadError, Source};

/// A file and the current read position.
pub(super) struct Bytes<'a> {
    source: Source<'a>,
    data: &'a [u8],
    at: usize,
}

impl<'a> Bytes<'a> {
    /// Starts reading a file that begins with `magic`.
    pub fn new<const N: usize>(path: &'a Path, data: &'a [u8], magic: &[u8; N]) -> Result<Self, LoadError> {
        let mut bytes = Self { source: Source { path }, data, at: 0 };
        if bytes.take::<N>()? != *magic {
            let name = String::from_utf8_lossy(magic).trim_end_matches('\0').to_owned();
            return Err(bytes.wrong(format!("it does not start with `{name}`; is it another kind of file?")));
        }
        Ok(bytes)
    }

    /// The next `N` bytes.
    pub fn take<const N: usize>(&mut self) -> Result<[u8; N], LoadError> {
        let found = self.data.get(self.at..).and_then(|rest| rest.first_chunk());
        let found = found.ok_or_else(|| {
            self.wrong("the file ends here; it is truncated: get the file again".to_owned())
        })?;
        self.at += N;
        Ok(*found)
    }

    pub fn u32(&mut self) -> Result<u32, LoadError> {
        self.take().map(u32::from_le_bytes)
    }

    pub fn u64(&mut self) -> Result<u64, LoadError> {
        self.take().map(u64::from_le_bytes)
    }

    pub fn f64(&mut self) -> Result<f64, LoadError> {
        self.take().map(f64::from_le_bytes)
    }

    /// The next number, which must be finite.
    pub fn f32(&mut self) -> Result<f32, LoadError> {
        let value = self.take().map(f32::from_le_bytes)?;
        if value.is_finite() { Ok(value) } else { Err(self.wrong(format!("{value} is not a finite number"))) }
    }

    /// Number of remaining bytes.
    pub fn remaining(&self) -> u64 {
        (self.data.len() - self.at) as u64
    }

    /// Checks that exactly `count` records of `size` bytes remain.
    pub fn expect_records(&self, count: u64, size: u64) -> Result<(), LoadError> {
        let remaining = self.remaining();
        match count.checked_mul(size) {
            Some(needed) if needed == remaining => Ok(()),
            _ => Err(self.wrong(format!(
                "{count} records of {size} bytes are announced, but {remaining} bytes follow"
            ))),
        }
    }

    /// An error at the current position.
    pub fn wrong(&self, message: String) -> LoadError {
        self.wrong_in(format!("byte {}", self.at), message)
    }

    /// An error in a named part.
    pub fn wrong_in(&self, place: impl Into<String>, message: String) -> LoadError {
        self.source.broken(place, message)
    }
}
