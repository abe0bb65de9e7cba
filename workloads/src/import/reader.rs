//! Opening files that may be gzipped, with a limit on what a small file can unpack to.

use std::fs::File;
use std::io::{BufRead, BufReader, ErrorKind, Read};
use std::path::Path;

use flate2::read::MultiGzDecoder;

use crate::error::{LoadError, Source};

/// Most bytes a gzipped file may hold.
const MOST_UNPACKED: u64 = 2 << 30;

/// The contents of `path`, unpacked where the name ends in `.gz`.
pub(super) fn open(path: &Path) -> Result<Box<dyn BufRead>, LoadError> {
    let source = Source { path };
    let file = File::open(path).map_err(|error| source.unreadable(error))?;
    // Opening a folder succeeds on Unix; only reading it fails.
    if file.metadata().is_ok_and(|data| data.is_dir()) {
        return Err(source.unreadable(ErrorKind::IsADirectory.into()));
    }
    let zipped = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("gz"));
    Ok(if zipped {
        Box::new(BufReader::new(MultiGzDecoder::new(BufReader::new(file)).take(MOST_UNPACKED)))
    } else {
        Box::new(BufReader::new(file))
    })
}
