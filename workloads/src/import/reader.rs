//! Opening files that may be gzipped, with a limit on what a small file can unpack to.

use std::fs::File;
use std::io::{BufRead, BufReader, ErrorKind, Read};
use std::path::Path;

use flate2::read::MultiGzDecoder;

use crate::error::{LoadError, Source};

/// How gzipped files begin (RFC 1952, 2.3.1).
const GZIP: &[u8] = &[0x1f, 0x8b];

/// Most bytes a gzipped file may hold.
const MOST_UNPACKED: u64 = 2 << 30;

/// The contents of `path`, unpacked where they begin as gzip does, whatever the name.
pub(crate) fn open(path: &Path) -> Result<Box<dyn BufRead>, LoadError> {
    let source = Source { path };
    let file = File::open(path).map_err(|error| source.unreadable(error))?;
    // Opening a folder succeeds on Unix; only reading it fails.
    if file.metadata().is_ok_and(|data| data.is_dir()) {
        return Err(source.unreadable(ErrorKind::IsADirectory.into()));
    }
    let mut file = BufReader::new(file);
    let zipped = file.fill_buf().map_err(|error| source.unreadable(error))?.starts_with(GZIP);
    Ok(if zipped {
        Box::new(BufReader::new(MultiGzDecoder::new(file).take(MOST_UNPACKED)))
    } else {
        Box::new(file)
    })
}

/// All bytes of `path`, unpacked where they are gzipped.
pub(crate) fn contents(path: &Path) -> Result<Vec<u8>, LoadError> {
    let mut data = Vec::new();
    open(path)?.read_to_end(&mut data).map_err(|error| damaged(path, &error))?;
    if data.len() as u64 == MOST_UNPACKED {
        let message = "it unpacks to more than 2 GiB: unpack it yourself if it is what it says";
        return Err(Source { path }.broken("gzip", message));
    }
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
