//! Chunks of a JLS file in the making, one after the other, with their lists.
//!
//! A chunk says where the next of its list is, which is known only when that is written. What was written last is held
//! back, so that most such places are filled in memory; what is further back is written over in the file.

use super::crc::crc32c;
use super::format::{HEADER_BYTES, IDENTIFICATION, VERSION, on_disk};
use std::io::{self, Seek, SeekFrom, Write};

/// Bytes held back at least, once there are as many: more than lie between two chunks of one signal's data.
const HELD: usize = 1 << 20;

/// The last chunk of a list, and where the first one is.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct List {
    /// 0 where there is none.
    pub first: u64,
    last: u64,
    header: [u8; HEADER_BYTES],
}

/// A file in the making.
pub(super) struct Chunks<W> {
    out: W,
    /// Where what is held back begins.
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

impl<W: Write + Seek> Chunks<W> {
    /// Begins a file: `out` must be empty.
    pub fn new(out: W) -> Self {
        // The length stays 0 until the end, which marks a file that was not closed.
        Self { out, base: 0, held: file_header(0).to_vec(), before: 0 }
    }

    /// Where the next chunk is going to be.
    pub fn end(&self) -> u64 {
        self.base + self.held.len() as u64
    }

    /// Writes a chunk at the end of the file and of its list; where it is. `fill` appends the payload.
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

    /// Writes a payload anew that is as long as before.
    pub fn replace(&mut self, chunk: u64, payload: &[u8]) -> io::Result<()> {
        let mut bytes = payload.to_vec();
        bytes.resize(on_disk(payload.len() as u32) as usize - 4, 0);
        bytes.extend(crc32c(payload).to_le_bytes());
        self.patch(chunk + HEADER_BYTES as u64, &bytes)
    }

    /// Writes over what is at a place, in memory as far as it is held back.
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
        if self.held.len() < 2 * HELD {
            return Ok(());
        }
        let count = self.held.len() - HELD;
        self.out.write_all(&self.held[..count])?;
        self.held.drain(..count);
        self.base += count as u64;
        Ok(())
    }

    /// Writes what is left and says in the file's header how long it is.
    pub fn finish(mut self) -> io::Result<()> {
        let header = file_header(self.end());
        self.patch(0, &header)?;
        self.out.write_all(&self.held)?;
        self.out.flush()
    }
}
