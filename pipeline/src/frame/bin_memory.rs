//! Bins in memory: set-up records of triangles, and the list of triangles of each bin. Set-up writes them through the triangle buffer,
//! and the tile loop reads them.
//!
//! As in the parameter buffer of a tile-based GPU (Antochi et al., "Memory bandwidth requirements of tile-based rendering", SAMOS 2004),
//! a batch has its records one after the other, and lists grow by lines. Two batches are in memory at once, in turns.

use std::collections::VecDeque;

use activity::{Event, PacketCounts};

use super::pass::Pass;
use crate::memory::{AddressSpace, LINE_BYTES, MemorySystem};
use crate::setup::{PixelRect, Triangle};

/// Bytes of a vertex position on the image plane at one end of the shutter.
const POSITION_BYTES: u32 = 12;
/// Bytes of the number of a triangle, in its record and in lists.
const NUMBER_BYTES: u64 = 4;
/// Entries of a line of a list.
const LINE_ENTRIES: u32 = (LINE_BYTES / NUMBER_BYTES) as u32;

/// Batches whose triangles are not all drawn.
pub(super) struct BinMemory {
    /// Bins in a row of the image, and in the image.
    across: u32,
    bins: usize,
    batches: VecDeque<BatchBins>,
    /// Which half of the memory the next batch takes.
    odd: bool,
}

/// Records and lists of a batch.
struct BatchBins {
    /// First byte of each record, and the end of the last.
    records: Vec<u64>,
    lists: Vec<List>,
    /// Address of the next line of any list, and of the first.
    next_line: u64,
    first_line: u64,
}

/// Triangles of a bin.
#[derive(Clone, Default)]
struct List {
    entries: u32,
    /// Addresses of its lines.
    lines: Vec<u64>,
}

impl BinMemory {
    /// Memory without batches; `None` if bins take no memory.
    pub fn new(pass: &Pass<'_>) -> Option<Self> {
        let spec = pass.settings.spec;
        spec.memory.bins?;
        let viewport = pass.settings.viewport;
        let [across, down] =
            [viewport.width(), viewport.height()].map(|side| side.div_ceil(spec.coarse_tile_px));
        let bins = across as usize * down as usize;
        Some(Self { across, bins, batches: VecDeque::new(), odd: pass.number % 2 == 1 })
    }

    /// Begin the next batch.
    pub fn begin(&mut self) {
        // A quarter of the upper half of all addresses for each: more than lists and records can fill.
        let quarter = AddressSpace::END / 4;
        let first = AddressSpace::END + if self.odd { quarter } else { 0 };
        self.odd = !self.odd;
        let (lists, first_line) = (vec![List::default(); self.bins], first + 2 * quarter);
        self.batches.push_back(BatchBins { records: vec![first], lists, next_line: first_line, first_line });
    }

    /// Write the record of a triangle of the last batch, and its entry in every bin that it may touch.
    pub fn write(
        &mut self,
        pass: &Pass<'_>,
        (triangle, pixels): (&Triangle, &PixelRect),
        memory: &mut MemorySystem,
        counts: &mut PacketCounts,
    ) {
        let Some(batch) = self.batches.back_mut() else { return };
        let first = batch.records[batch.records.len() - 1];
        let end = first + record_bytes(pass, triangle);
        batch.records.push(end);
        lines_of(first, end).for_each(|line| memory.write_bin(line, counts));
        let bins = pixels.tiles(pass.settings.spec.coarse_tile_px);
        for bin in (bins.y0..bins.y1).flat_map(|row| (bins.x0..bins.x1).map(move |column| (row, column))) {
            counts[Event::BinEntries] += 1;
            memory.write_bin(batch.enter((bin.0 * self.across + bin.1) as usize), counts);
        }
    }

    /// Read the entries `from..to` of the list of a bin of the first batch, which are the triangles `listed`, and their records.
    pub fn read(
        &self,
        (bin, from): (usize, u32),
        listed: &[u32],
        memory: &mut MemorySystem,
        counts: &mut PacketCounts,
    ) {
        let Some(batch) = self.batches.front() else { return };
        for (entry, &triangle) in (from..).zip(listed) {
            if entry.is_multiple_of(LINE_ENTRIES) {
                memory.read_bin(batch.lists[bin].lines[(entry / LINE_ENTRIES) as usize], counts);
            }
            let record = &batch.records[triangle as usize..][..2];
            lines_of(record[0], record[1]).for_each(|line| memory.read_bin(line, counts));
        }
    }

    /// End the first batch, whose triangles are all drawn. Its lines are not written to memory any more.
    pub fn end(&mut self, memory: &mut MemorySystem) {
        let Some(batch) = self.batches.pop_front() else { return };
        let records = lines_of(batch.records[0], batch.records[batch.records.len() - 1]);
        let lists = (batch.first_line..batch.next_line).step_by(LINE_BYTES as usize);
        records.chain(lists).for_each(|line| memory.discard_bin(line));
    }
}

impl BatchBins {
    /// Address of the line of a new entry of a bin.
    fn enter(&mut self, bin: usize) -> u64 {
        let list = &mut self.lists[bin];
        if list.entries.is_multiple_of(LINE_ENTRIES) {
            list.lines.push(self.next_line);
            self.next_line += LINE_BYTES;
        }
        list.entries += 1;
        list.lines[list.lines.len() - 1]
    }
}

/// Bytes of the set-up record of a triangle: three vertices as they are on the image plane, with the attributes that are shaded, and
/// its number.
fn record_bytes(pass: &Pass<'_>, triangle: &Triangle) -> u64 {
    let geometry = &pass.draws[pass.locate(triangle.id).0].geometry;
    let ends = |still: bool| if still { 1 } else { 2 };
    let attributes = geometry.vertex_bytes() - ends(geometry.is_still()) * POSITION_BYTES;
    let shaded = if pass.is_depth_only() { 0 } else { attributes };
    3 * u64::from(ends(!triangle.moving) * POSITION_BYTES + shaded) + NUMBER_BYTES
}

/// Addresses of the lines that hold the bytes from `first` to `end`.
fn lines_of(first: u64, end: u64) -> impl Iterator<Item = u64> {
    (first / LINE_BYTES..end.div_ceil(LINE_BYTES)).map(|line| line * LINE_BYTES)
}
