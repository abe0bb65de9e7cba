//! Chunks of a JLS file, written and read: a header and a payload, each with a checksum.

use crate::{
    FILE_HEADER_BYTES, HEADER_BYTES, IDENTIFICATION, JlsReadError, MAX_PAYLOAD_BYTES, VERSION, field, on_disk,
};
use crc32c::crc32c;
use std::fs::File;
use std::io::{self, ErrorKind, Read, Seek, SeekFrom, Write};
use std::path::Path;

/// Fewest bytes held back, once there are as many: more than lie between two data chunks of one signal.
const MIN_HELD_BYTES: usize = 1 << 20;

/// The last chunk of a list, and where the first one is.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct List {
    /// 0 where there is none.
    pub first: u64,
    last: u64,
    header: [u8; HEADER_BYTES],
}

/// Writes the chunks of a file, one after the other, and links their lists.
///
/// A chunk holds the place of the next of its list, which is known only when that is written. The last bytes
/// are held back, so that most such places are filled in memory; earlier ones are overwritten in the file.
pub(crate) struct ChunkWriter<W> {
    out: W,
    /// Place of the first byte held back.
    base: u64,
    held: Vec<u8>,
    /// Length of the last payload.
    before: u32,
}

fn seal(header: &mut [u8; HEADER_BYTES]) {
    let crc = crc32c(&header[..28]);
    header[28..].copy_from_slice(&crc.to_le_bytes());
}

fn file_header(length: u64) -> [u8; HEADER_BYTES] {
    let mut header = [0; HEADER_BYTES];
    header[..16].copy_from_slice(IDENTIFICATION);
    header[16..24].copy_from_slice(&length.to_le_bytes());
    header[24..28].copy_from_slice(&VERSION.to_le_bytes());
    seal(&mut header);
    header
}

impl<W: Write + Seek> ChunkWriter<W> {
    /// Begins a file: `out` must be empty.
    pub fn new(out: W) -> Self {
        // The length stays 0 until the end, which marks a file that was not closed.
        Self { out, base: 0, held: file_header(0).to_vec(), before: 0 }
    }

    /// Place of the next chunk.
    pub fn end(&self) -> u64 {
        self.base + self.held.len() as u64
    }

    /// Appends a chunk to the file and to its list, and returns its place. `fill` appends the payload.
    pub fn append(
        &mut self,
        list: &mut List,
        tag: u8,
        mark: u16,
        fill: impl FnOnce(&mut Vec<u8>),
    ) -> io::Result<u64> {
        let (at, from) = (self.end(), self.held.len() + HEADER_BYTES);
        self.held.resize(from, 0);
        fill(&mut self.held);
        let bytes = (self.held.len() - from) as u32;
        let mut header = [0; HEADER_BYTES];
        header[8..16].copy_from_slice(&list.last.to_le_bytes());
        header[16] = tag;
        header[18..20].copy_from_slice(&mark.to_le_bytes());
        header[20..24].copy_from_slice(&bytes.to_le_bytes());
        header[24..28].copy_from_slice(&self.before.to_le_bytes());
        seal(&mut header);
        self.held[from - HEADER_BYTES..from].copy_from_slice(&header);
        if bytes > 0 {
            let crc = crc32c(&self.held[from..]);
            self.held.resize(from + on_disk(bytes) as usize - 4, 0);
            self.held.extend(crc.to_le_bytes());
        }
        self.before = bytes;
        self.link(list, at, header)?;
        self.release()?;
        Ok(at)
    }

    /// Makes a chunk the last of a list.
    fn link(&mut self, list: &mut List, at: u64, header: [u8; HEADER_BYTES]) -> io::Result<()> {
        if list.first == 0 {
            list.first = at;
        } else {
            list.header[..8].copy_from_slice(&at.to_le_bytes());
            seal(&mut list.header);
            self.patch(list.last, &list.header)?;
        }
        (list.last, list.header) = (at, header);
        Ok(())
    }

    /// Overwrites a payload by one of the same length.
    pub fn replace(&mut self, chunk: u64, payload: &[u8]) -> io::Result<()> {
        let mut bytes = payload.to_vec();
        bytes.resize(on_disk(payload.len() as u32) as usize - 4, 0);
        bytes.extend(crc32c(payload).to_le_bytes());
        self.patch(chunk + HEADER_BYTES as u64, &bytes)
    }

    /// Overwrites bytes, in memory as far as they are held back.
    fn patch(&mut self, at: u64, bytes: &[u8]) -> io::Result<()> {
        let written = usize::try_from(self.base.saturating_sub(at)).unwrap_or(usize::MAX).min(bytes.len());
        let (behind, ahead) = bytes.split_at(written);
        if !behind.is_empty() {
            self.out.seek(SeekFrom::Start(at))?;
            self.out.write_all(behind)?;
            self.out.seek(SeekFrom::Start(self.base))?;
        }
        if !ahead.is_empty() {
            let from = (at + written as u64 - self.base) as usize;
            self.held[from..from + ahead.len()].copy_from_slice(ahead);
        }
        Ok(())
    }

    /// Writes all but the last bytes, once there are many.
    fn release(&mut self) -> io::Result<()> {
        if self.held.len() < 2 * MIN_HELD_BYTES {
            return Ok(());
        }
        let count = self.held.len() - MIN_HELD_BYTES;
        self.out.write_all(&self.held[..count])?;
        self.held.drain(..count);
        self.base += count as u64;
        Ok(())
    }

    /// Writes the remaining bytes, and the length of the file into its header.
    pub fn finish(mut self) -> io::Result<()> {
        let header = file_header(self.end());
        self.patch(0, &header)?;
        self.out.write_all(&self.held)?;
        self.out.flush()
    }
}

/// How to repair a recording that was not closed.
const REPAIR: &str = "the Joulescope UI or pyjls repairs a copy of it by opening it";

/// The header of a chunk.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ChunkHeader {
    /// Place of the chunk in the file.
    pub at: u64,
    /// The place of the next chunk of its list.
    pub next: Option<u64>,
    pub tag: u8,
    pub meta: u16,
    /// Length of the payload.
    pub bytes: u32,
}

impl ChunkHeader {
    /// The place of the next chunk of the file.
    pub fn end(&self) -> u64 {
        self.at + HEADER_BYTES as u64 + on_disk(self.bytes)
    }
}

/// A JLS file, read at any place.
#[derive(Debug)]
pub(crate) struct ChunkFile {
    file: File,
    size_bytes: u64,
}

impl ChunkFile {
    pub fn open(path: &Path) -> Result<Self, JlsReadError> {
        let file = File::open(path)?;
        let size_bytes = file.metadata()?.len();
        let mut file = Self { file, size_bytes };
        let header: [u8; FILE_HEADER_BYTES as usize] = file.fixed(0)?;
        if header[..16] != *IDENTIFICATION || crc32c(&header[..28]) != u32::from_le_bytes(field(&header, 28))
        {
            return Err(JlsReadError::damaged(0, "the header of the file is wrong"));
        }
        if header[27] > 1 {
            return Err(JlsReadError::NewerVersion);
        }
        match u64::from_le_bytes(field(&header, 16)) {
            0 => Err(JlsReadError::damaged(size_bytes, &format!("the recording was not closed; {REPAIR}"))),
            length if length != size_bytes => {
                let reason = format!("the file ends here, but was closed with {length} bytes; {REPAIR}");
                Err(JlsReadError::damaged(size_bytes, &reason))
            }
            _ => Ok(file),
        }
    }

    fn exact(&mut self, at: u64, into: &mut [u8]) -> Result<(), JlsReadError> {
        let read = self.file.seek(SeekFrom::Start(at)).and_then(|_| self.file.read_exact(into));
        read.map_err(|error| match error.kind() {
            ErrorKind::UnexpectedEof => {
                JlsReadError::damaged(self.size_bytes, &format!("the file ends here; {REPAIR}"))
            }
            _ => error.into(),
        })
    }

    fn fixed<const N: usize>(&mut self, at: u64) -> Result<[u8; N], JlsReadError> {
        let mut bytes = [0; N];
        self.exact(at, &mut bytes)?;
        Ok(bytes)
    }

    /// The first chunk with one of these tags, from the beginning of the file on.
    pub fn first(&mut self, tag: u8) -> Result<Option<ChunkHeader>, JlsReadError> {
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

    /// The header at a place. A list that points backwards is refused: it might be circular.
    pub fn head(&mut self, at: u64) -> Result<ChunkHeader, JlsReadError> {
        let bytes: [u8; HEADER_BYTES] = self.fixed(at)?;
        if crc32c(&bytes[..28]) != u32::from_le_bytes(field(&bytes, 28)) {
            return Err(JlsReadError::damaged(at, "the checksum of a chunk's header is wrong"));
        }
        let next = Some(u64::from_le_bytes(field(&bytes, 0))).filter(|&next| next != 0);
        let (meta, bytes, tag) =
            (u16::from_le_bytes(field(&bytes, 18)), u32::from_le_bytes(field(&bytes, 20)), bytes[16]);
        let head = ChunkHeader { at, next, tag, meta, bytes };
        if head.end() > self.size_bytes {
            return Err(JlsReadError::damaged(at, "a chunk is longer than the file"));
        }
        match next {
            Some(next) if next <= at => Err(JlsReadError::damaged(at, "a list of chunks leads back")),
            _ => Ok(head),
        }
    }

    /// The next chunk of a list. In a recording that was cut off and repaired, the last chunk of a list may
    /// still point to where the next one was: beyond the end, or into other chunks. The list ends there.
    pub fn follow(&mut self, head: &ChunkHeader) -> Result<Option<ChunkHeader>, JlsReadError> {
        let Some(next) = head.next.filter(|&next| next < self.size_bytes) else { return Ok(None) };
        match self.head(next) {
            Err(_) if !self.begins(next, head)? => Ok(None),
            found => found.map(Some),
        }
    }

    /// Whether a chunk begins at a place, counted from one before.
    fn begins(&mut self, at: u64, before: &ChunkHeader) -> Result<bool, JlsReadError> {
        let mut place = before.end();
        while place < at {
            place = self.head(place)?.end();
        }
        Ok(place == at)
    }

    /// Reads the payload of a chunk over what was in `into`.
    pub fn payload(&mut self, head: &ChunkHeader, into: &mut Vec<u8>) -> Result<(), JlsReadError> {
        into.clear();
        if head.bytes > MAX_PAYLOAD_BYTES {
            return Err(JlsReadError::damaged(head.at, "a chunk of more than 64 MiB"));
        }
        let from = head.at + HEADER_BYTES as u64;
        into.resize((head.end() - from) as usize, 0);
        self.exact(from, into)?;
        let length = head.bytes as usize;
        let stated = into.last_chunk().map(|crc| u32::from_le_bytes(*crc));
        if stated.is_some_and(|stated| stated != crc32c(&into[..length])) {
            return Err(JlsReadError::damaged(head.at, "the checksum of a chunk is wrong"));
        }
        into.truncate(length);
        Ok(())
    }
}
