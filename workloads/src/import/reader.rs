//! Opening files that may be gzipped, with a limit on what a small file can unpack to.

use std::io::{BufRead, BufReader, ErrorKind, Read};
use std::path::Path;

use activity::inputs;
use flate2::read::MultiGzDecoder;

use crate::error::{LoadError, Source};

/// How gzipped files begin (RFC 1952, 2.3.1).
const GZIP: &[u8] = &[0x1f, 0x8b];

/// How some editors begin text files; it is no part of the text.
const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

/// Most bytes a gzipped file may hold.
const MOST_UNPACKED: u64 = 2 << 30;

/// The contents of `path` after a byte order mark, unpacked where they begin as gzip does, whatever the name.
pub(crate) fn open(path: &Path) -> Result<Box<dyn BufRead>, LoadError> {
    let source = Source { path };
    let file = inputs::open(path).map_err(|error| source.unreadable(error))?;
    // Opening a folder succeeds on Unix; only reading it fails.
    if file.metadata().is_ok_and(|data| data.is_dir()) {
        return Err(source.unreadable(ErrorKind::IsADirectory.into()));
    }
    let mut file = BufReader::new(file);
    let zipped = file.fill_buf().map_err(|error| source.unreadable(error))?.starts_with(GZIP);
    let mut contents: Box<dyn BufRead> = if zipped {
        Box::new(BufReader::new(Limited { inner: MultiGzDecoder::new(file), left: MOST_UNPACKED }))
    } else {
        Box::new(file)
    };
    if contents.fill_buf().is_ok_and(|begin| begin.starts_with(BYTE_ORDER_MARK)) {
        contents.consume(BYTE_ORDER_MARK.len());
    }
    Ok(contents)
}

/// Passes on what is unpacked and fails beyond a limit, so that no file is cut without a word.
struct Limited<R> {
    inner: R,
    left: u64,
}

impl<R: Read> Read for Limited<R> {
    fn read(&mut self, into: &mut [u8]) -> std::io::Result<usize> {
        let count = self.inner.read(into)?;
        self.left = self.left.checked_sub(count as u64).ok_or_else(|| {
            std::io::Error::other("it unpacks to more than 2 GiB: unpack it yourself if it is what it says")
        })?;
        Ok(count)
    }
}

/// All bytes of a file that another file names: of nothing else, as a device may have no end.
pub(super) fn named(path: &Path) -> std::io::Result<Vec<u8>> {
    check_named(path)?;
    inputs::read(path)
}

/// Fails for what is there and no file.
pub(super) fn check_named(path: &Path) -> std::io::Result<()> {
    inputs::note(path);
    if std::fs::metadata(path)?.is_file() { Ok(()) } else { Err(std::io::Error::other("it is no file")) }
}

/// All bytes of `path`, unpacked where they are gzipped.
pub(crate) fn contents(path: &Path) -> Result<Vec<u8>, LoadError> {
    let mut data = Vec::new();
    open(path)?.read_to_end(&mut data).map_err(|error| damaged(path, &error))?;
    Ok(data)
}

/// The first bytes of `path`, unpacked where they are gzipped, `N` of them or as many as there are.
pub(crate) fn head<const N: usize>(path: &Path) -> Result<Vec<u8>, LoadError> {
    let mut data = Vec::with_capacity(N);
    open(path)?.take(N as u64).read_to_end(&mut data).map_err(|error| damaged(path, &error))?;
    Ok(data)
}

pub(super) fn damaged(path: &Path, error: &std::io::Error) -> LoadError {
    Source { path }
        .broken("contents", format!("reading stops here: {error}; the file may be damaged: get it again"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_unpacks_to_more_than_the_limit_is_an_error() {
        let read = |left| {
            let mut data = Vec::new();
            Limited { inner: &[7_u8; 100][..], left }.read_to_end(&mut data).map(|_| data.len())
        };
        assert_eq!(read(100).ok(), Some(100));
        assert!(read(99).is_err_and(|error| error.to_string().contains("2 GiB")));
    }
}
