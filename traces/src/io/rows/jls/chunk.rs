//! Chunks of a JLS file: a header and a payload, each with a checksum.

use crate::io::ReadError;
use crate::io::jls::crc32c;
use crate::io::jls::format::{FILE_HEADER_BYTES, HEADER_BYTES, IDENTIFICATION, LONGEST_BYTES, on_disk};
use std::fs::File;
use std::io::{ErrorKind, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

/// What mends a recording that was not brought to its end.
const MEND: &str = "the Joulescope UI or pyjls mends a copy of it by opening it";

/// The header of a chunk.
#[derive(Clone, Copy, Debug)]
pub(super) struct Head {
    /// Where the chunk begins.
    pub at: u64,
    /// Where the next of its list begins.
    pub next: Option<u64>,
    pub tag: u8,
    pub meta: u16,
    /// Length of the payload.
    pub bytes: u32,
}

impl Head {
    /// Where the next chunk of the file begins.
    pub fn end(&self) -> u64 {
        self.at + HEADER_BYTES as u64 + on_disk(self.bytes)
    }
}

/// A JLS file, read at any place.
pub(super) struct ChunkFile {
    pub path: PathBuf,
    file: File,
    size_bytes: u64,
}

/// The `N` bytes at `from`, zeros where there are none: lengths are checked before.
pub(super) fn field<const N: usize>(bytes: &[u8], from: usize) -> [u8; N] {
    bytes.get(from..).and_then(|rest| rest.first_chunk()).copied().unwrap_or([0; N])
}

impl ChunkFile {
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        let file = File::open(path).map_err(|error| ReadError::io(path, error))?;
        let size_bytes = file.metadata().map_err(|error| ReadError::io(path, error))?.len();
        let mut file = Self { path: path.to_owned(), file, size_bytes };
        let header: [u8; FILE_HEADER_BYTES as usize] = file.fixed(0)?;
        if header[..16] != *IDENTIFICATION || crc32c(&header[..28]) != u32::from_le_bytes(field(&header, 28))
        {
            return Err(file.damaged(0, "the header of the file is wrong"));
        }
        if header[27] > 1 {
            return Err(ReadError::Format {
                path: path.to_owned(),
                found: "a JLS recording of a newer version",
                mend: "export it with pyjls or the Joulescope UI to CSV or Parquet",
            });
        }
        match u64::from_le_bytes(field(&header, 16)) {
            0 => Err(file.damaged(size_bytes, &format!("the recording was not closed; {MEND}"))),
            length if length != size_bytes => {
                let reason = format!("the file ends here, but was closed with {length} bytes; {MEND}");
                Err(file.damaged(size_bytes, &reason))
            }
            _ => Ok(file),
        }
    }

    pub fn damaged(&self, at: u64, reason: &str) -> ReadError {
        let reason = format!("byte {at}: {reason}");
        ReadError::Damaged { path: self.path.clone(), format: "JLS", reason }
    }

    fn exact(&mut self, at: u64, into: &mut [u8]) -> Result<(), ReadError> {
        let read = self.file.seek(SeekFrom::Start(at)).and_then(|_| self.file.read_exact(into));
        read.map_err(|error| match error.kind() {
            ErrorKind::UnexpectedEof => self.damaged(self.size_bytes, &format!("the file ends here; {MEND}")),
            _ => ReadError::io(&self.path, error),
        })
    }

    fn fixed<const N: usize>(&mut self, at: u64) -> Result<[u8; N], ReadError> {
        let mut bytes = [0; N];
        self.exact(at, &mut bytes)?;
        Ok(bytes)
    }

    /// The first chunk with one of these tags, from the beginning of the file on.
    pub fn first(&mut self, tag: u8) -> Result<Option<Head>, ReadError> {
        let mut at = FILE_HEADER_BYTES;
        while at < self.size_bytes {
            let head = self.head(at)?;
            if head.tag == tag {
                return Ok(Some(head));
            }
            at = head.end();
        }
        Ok(None)
    }

    /// The header at a place. Lists only lead on: one that went back could go in circles.
    pub fn head(&mut self, at: u64) -> Result<Head, ReadError> {
        let bytes: [u8; HEADER_BYTES] = self.fixed(at)?;
        if crc32c(&bytes[..28]) != u32::from_le_bytes(field(&bytes, 28)) {
            return Err(self.damaged(at, "the checksum of a chunk's header is wrong"));
        }
        let next = Some(u64::from_le_bytes(field(&bytes, 0))).filter(|&next| next != 0);
        let (meta, bytes, tag) =
            (u16::from_le_bytes(field(&bytes, 18)), u32::from_le_bytes(field(&bytes, 20)), bytes[16]);
        let head = Head { at, next, tag, meta, bytes };
        if head.end() > self.size_bytes {
            return Err(self.damaged(at, "a chunk is longer than the file"));
        }
        match next {
            Some(next) if next <= at => Err(self.damaged(at, "a list of chunks leads back")),
            _ => Ok(head),
        }
    }

    /// The chunk that a list goes on with. In a recording that was cut off and mended, the last chunk of a list still
    /// leads to where the next one was: beyond the end, or into others. There it ends.
    pub fn follow(&mut self, head: &Head) -> Result<Option<Head>, ReadError> {
        let Some(next) = head.next.filter(|&next| next < self.size_bytes) else { return Ok(None) };
        match self.head(next) {
            Err(_) if !self.begins(next, head)? => Ok(None),
            found => found.map(Some),
        }
    }

    /// Whether a chunk begins at a place, counted from one before.
    fn begins(&mut self, at: u64, before: &Head) -> Result<bool, ReadError> {
        let mut place = before.end();
        while place < at {
            place = self.head(place)?.end();
        }
        Ok(place == at)
    }

    /// Reads the payload of a chunk over what was in `into`.
    pub fn payload(&mut self, head: &Head, into: &mut Vec<u8>) -> Result<(), ReadError> {
        into.clear();
        if head.bytes > LONGEST_BYTES {
            return Err(self.damaged(head.at, "a chunk of more than 64 MiB"));
        }
        let from = head.at + HEADER_BYTES as u64;
        into.resize((head.end() - from) as usize, 0);
        self.exact(from, into)?;
        let length = head.bytes as usize;
        let stated = into.last_chunk().map(|crc| u32::from_le_bytes(*crc));
        if stated.is_some_and(|stated| stated != crc32c(&into[..length])) {
            return Err(self.damaged(head.at, "the checksum of a chunk is wrong"));
        }
        into.truncate(length);
        Ok(())
    }
}
