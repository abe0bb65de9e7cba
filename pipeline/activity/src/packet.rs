//! Integer counters, one per event, and how they run over time. Work packets, the unit of work in the timing
//! models, with their counts and the memory lines that they request.

use std::collections::BTreeMap;
use std::ops::{AddAssign, Index, IndexMut};

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::events::EVENTS;
use crate::{Event, S_PER_PS, Unit};

/// Kind of work, which decides the units a packet passes through.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum PacketKind {
    /// Start of a draw or of a dispatch of groups: state is read.
    Draw,
    /// A batch of vertices is fetched and shaded, and its triangles are set up.
    Vertices,
    /// One triangle in one tile, from traversal to colour.
    Tile,
    /// The samples of a tile are resolved into pixels.
    Resolve,
    /// A group of lanes that share memory and barriers.
    Compute,
    /// A barrier between passes: all earlier work ends, written lines move to the L2 and textures are read
    /// anew. Later packets of these kinds wait for it.
    Barrier(Waits),
}

impl PacketKind {
    /// Whether the front end works on it, from the fetch of vertices to set-up.
    pub const fn is_of_front_end(self) -> bool {
        matches!(self, Self::Draw | Self::Vertices)
    }
}

/// Packets that wait at a barrier.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Waits {
    /// Tiles and resolves: a pass reads or overwrites pixels of an earlier one.
    Tiles,
    /// Draws and vertices, too: they read what an earlier pass wrote.
    All,
}

/// Events caused by one packet. 32 bits per event are enough for a packet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PacketCounts([u32; Event::COUNT]);

impl Default for PacketCounts {
    fn default() -> Self {
        Self([0; Event::COUNT])
    }
}

impl PacketCounts {
    /// Every event with its count, in declaration order.
    pub fn iter(&self) -> impl Iterator<Item = (Event, u32)> + '_ {
        Event::ALL.into_iter().zip(self.0.iter().copied())
    }

    /// Whether the packet causes any event in `unit`.
    pub fn uses(&self, unit: Unit) -> bool {
        self.of(unit).iter().any(|&count| count > 0)
    }

    /// Counts of the events of `unit`, in declaration order.
    pub fn of(&self, unit: Unit) -> &[u32] {
        &self.0[EVENTS[unit as usize].0..EVENTS[unit as usize].1]
    }
}

impl Index<Event> for PacketCounts {
    type Output = u32;
    fn index(&self, event: Event) -> &u32 {
        &self.0[event as usize]
    }
}

impl IndexMut<Event> for PacketCounts {
    fn index_mut(&mut self, event: Event) -> &mut u32 {
        &mut self.0[event as usize]
    }
}

impl AddAssign<&Self> for PacketCounts {
    fn add_assign(&mut self, other: &Self) {
        for (sum, count) in self.0.iter_mut().zip(&other.0) {
            *sum += count;
        }
    }
}

/// A piece of work, in the order in which the modelled hardware processes it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Packet {
    /// Kind of work.
    pub kind: PacketKind,
    /// Pass number in the frame, from 0. What is written back when the frame ends has the number after the last.
    pub pass: u32,
    /// Batch of triangles in the pass, from 0. Tiles wait for the vertices of their batch, vertices for the
    /// tiles of the batch before the last.
    pub batch: u32,
    /// Draw number in the pass; [`Self::NONE`] for work of no single draw.
    pub draw: u32,
    /// Tile number, row by row from the top left; [`Self::NONE`] for draws and vertices.
    pub tile: u32,
    /// Triangle number in the pass, for vertices the first one; [`Self::NONE`] for work of no single triangle.
    pub triangle: u32,
    /// Events caused in every unit.
    pub counts: PacketCounts,
}

impl Packet {
    /// Stands for no draw, tile or triangle.
    pub const NONE: u32 = u32::MAX;

    /// A packet without events, in the first batch, of no draw, tile or triangle.
    pub fn new(kind: PacketKind, pass: u32) -> Self {
        let (draw, tile, triangle) = (Self::NONE, Self::NONE, Self::NONE);
        Self { kind, pass, batch: 0, draw, tile, triangle, counts: PacketCounts::default() }
    }
}

/// Outcome of a line request in the L2. Hits and misses are decided in stream order, before the timing is
/// known.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum LineKind {
    /// Read; the line is in the L2.
    Hit,
    /// Read; the line is in a level below the L2, the last one with a read.
    Below,
    /// Read; the line is fetched from memory.
    Fetch,
    /// Written whole; replaces the line in the L2.
    Write,
    /// Written whole; the line was not in the L2.
    Allocate,
    /// Written back at the end of a frame.
    Drain,
}

/// Levels of cache between the L2 and memory, from the L2 on. A GPU may have any of them.
pub const LEVELS: [Unit; 2] = [Unit::Llc, Unit::Edram];

/// Requests that a line request of the L2 causes in a level below it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct LevelRequests {
    /// Lines read, at most 1.
    pub reads: u8,
    /// Lines written back to the level.
    pub writes: u8,
    /// Of both: lines that were not in the level.
    pub misses: u8,
    /// Dirty lines that the level wrote back.
    pub writebacks: u8,
}

impl LevelRequests {
    /// Reads and writes.
    pub fn lines(self) -> u32 {
        u32::from(self.reads) + u32::from(self.writes)
    }

    /// Events of `level`, one of [`LEVELS`], in declaration order.
    pub fn events(self, level: Unit) -> impl Iterator<Item = (Event, u32)> {
        let counts = [self.reads, self.writes, self.misses, self.writebacks];
        let first = EVENTS[level as usize].0;
        counts.into_iter().zip(first..).map(|(count, at)| (Event::ALL[at], u32::from(count)))
    }
}

/// A request for one line. The line number is the address divided by the line size.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct LineAccess {
    /// Line number.
    pub line: u32,
    /// Dirty lines written to memory to make room or to end a frame: first these, then [`LineAccess::NONE`].
    pub written: [u32; Self::MAX_WRITTEN],
    /// Requests to the levels below the L2, in the order of [`LEVELS`].
    pub levels: [LevelRequests; LEVELS.len()],
    /// Requesting unit.
    pub client: Unit,
    /// Outcome of the request.
    pub kind: LineKind,
}

impl LineAccess {
    /// Stands for no line.
    pub const NONE: u32 = u32::MAX;
    /// Largest number of lines that one request writes to memory. The L2 evicts one for the line requested; each
    /// level below evicts one for the line it reads and one for each line written to it.
    pub const MAX_WRITTEN: usize = 1 + LEVELS.len();

    /// A request that no level below the L2 sees and that writes no line to memory.
    pub const fn new(client: Unit, line: u32, kind: LineKind) -> Self {
        let none = LevelRequests { reads: 0, writes: 0, misses: 0, writebacks: 0 };
        Self { line, written: [Self::NONE; Self::MAX_WRITTEN], levels: [none; LEVELS.len()], client, kind }
    }

    /// Add a line written to memory.
    pub fn write(&mut self, line: u32) {
        let free = self.written.iter_mut().find(|written| **written == Self::NONE);
        debug_assert!(free.is_some(), "a request writes at most {} lines", Self::MAX_WRITTEN);
        if let Some(free) = free {
            *free = line;
        }
    }

    /// Whether a line is read.
    pub fn is_read(&self) -> bool {
        matches!(self.kind, LineKind::Hit | LineKind::Below | LineKind::Fetch)
    }

    /// Whether the L2 alone sees the request: no level below it, and no line moves from or to memory.
    pub fn stays_in_l2(&self) -> bool {
        let none = [LevelRequests::default(); LEVELS.len()];
        self.kind != LineKind::Fetch && self.written[0] == Self::NONE && self.levels == none
    }

    /// The line read from memory.
    pub fn fetched(&self) -> Option<u32> {
        (self.kind == LineKind::Fetch).then_some(self.line)
    }

    /// The lines written to memory.
    pub fn written(&self) -> impl Iterator<Item = u32> + Clone {
        self.written.into_iter().take_while(|&line| line != Self::NONE)
    }

    /// The lines moved from or to memory.
    pub fn moved(&self) -> impl Iterator<Item = u32> + Clone {
        self.fetched().into_iter().chain(self.written())
    }
}

impl AddAssign<&PacketCounts> for Counts {
    fn add_assign(&mut self, other: &PacketCounts) {
        for (event, count) in other.iter() {
            self[event] += u64::from(count);
        }
    }
}

/// Count of every event. Each worker has its own counts, which are summed with `+=`. The sum is exact and
/// independent of the order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Counts([u64; Event::COUNT]);

impl Default for Counts {
    fn default() -> Self {
        Self([0; Event::COUNT])
    }
}

impl Counts {
    /// Every event with its count, in declaration order.
    pub fn iter(&self) -> impl Iterator<Item = (Event, u64)> + '_ {
        Event::ALL.into_iter().zip(self.0.iter().copied())
    }

    /// The events of every unit that the GPU has, with their counts. Units that a GPU may lack and that did
    /// nothing are left out.
    pub fn reported(&self) -> impl Iterator<Item = (Event, u64)> + '_ {
        let is_reported = |unit: Unit| !unit.is_optional() || self.uses(unit);
        Unit::ALL
            .into_iter()
            .filter(move |&unit| is_reported(unit))
            .flat_map(|unit| unit.events().map(|at| (Event::ALL[at], self.0[at])))
    }

    /// Whether all counts are 0.
    pub fn is_empty(&self) -> bool {
        self.0.iter().all(|&count| count == 0)
    }

    /// Whether any event of `unit` happened. A unit without events is not modelled.
    pub fn uses(&self, unit: Unit) -> bool {
        self.iter().any(|(event, count)| count > 0 && event.unit() == unit)
    }

    /// Mutable counts of the events of `unit`, in declaration order.
    pub fn of_mut(&mut self, unit: Unit) -> &mut [u64] {
        let (first, end) = EVENTS[unit as usize];
        &mut self.0[first..end]
    }

    /// `numerator / denominator`, or `None` if the denominator's count is 0.
    pub fn ratio(&self, numerator: Event, denominator: Event) -> Option<f64> {
        let total = self[denominator];
        (total > 0).then(|| self[numerator] as f64 / total as f64)
    }

    /// Sample test efficiency: samples hit over samples tested, in [0, 1].
    pub fn sample_test_efficiency(&self) -> Option<f64> {
        self.ratio(Event::SamplesHit, Event::SamplesTested)
    }
}

impl Index<Event> for Counts {
    type Output = u64;
    fn index(&self, event: Event) -> &u64 {
        &self.0[event as usize]
    }
}

impl IndexMut<Event> for Counts {
    fn index_mut(&mut self, event: Event) -> &mut u64 {
        &mut self.0[event as usize]
    }
}

impl AddAssign<&Self> for Counts {
    fn add_assign(&mut self, other: &Self) {
        for (sum, count) in self.0.iter_mut().zip(&other.0) {
            *sum += count;
        }
    }
}

impl Serialize for Counts {
    /// Write a map from event name to count, in declaration order, as [`Counts::reported`].
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.reported().map(|(event, count)| (event.name(), count)))
    }
}

impl<'de> Deserialize<'de> for Counts {
    /// Reads a map from event name to count; events that are left out have a count of 0.
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let mut counts = Self::default();
        for (name, count) in BTreeMap::<String, u64>::deserialize(from)? {
            counts[Event::try_from(name).map_err(serde::de::Error::custom)?] = count;
        }
        Ok(counts)
    }
}

/// Activity during one bin of time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Bin {
    /// Count of every event in the bin.
    pub counts: Counts,
    /// Busy time of every unit in the bin, in picoseconds.
    pub busy_ps: [u64; Unit::COUNT],
}

/// Activity of one frame over time, in equal bins from its start. The last bin may extend past the end of the
/// frame; that part is empty.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Timeline {
    /// Length of a bin in picoseconds, at least 1.
    pub bin_ps: u64,
    /// Length of the frame in picoseconds, from its first command to its last pixel.
    pub duration_ps: u64,
    /// The bins; `bins.len() * bin_ps >= duration_ps`.
    pub bins: Vec<Bin>,
}

impl Timeline {
    /// Length of the frame in seconds.
    pub fn duration_s(&self) -> f64 {
        self.duration_ps as f64 * S_PER_PS
    }

    /// Counts of the whole frame.
    pub fn total(&self) -> Counts {
        self.bins.iter().fold(Counts::default(), |mut total, bin| {
            total += &bin.counts;
            total
        })
    }

    /// Busy time of every unit in the whole frame, in picoseconds.
    pub fn busy_ps(&self) -> [u64; Unit::COUNT] {
        let mut total = [0; Unit::COUNT];
        for bin in &self.bins {
            for (sum, busy) in total.iter_mut().zip(bin.busy_ps) {
                *sum += busy;
            }
        }
        total
    }
}

/// Packets in order with their lines.
#[derive(Clone, Debug, Default)]
pub struct PacketBuffer {
    /// Each packet, and where its lines end.
    packets: Vec<(Packet, usize)>,
    lines: Vec<LineAccess>,
}

impl PacketBuffer {
    /// Add a packet with its lines.
    pub fn push(&mut self, packet: &Packet, lines: &[LineAccess]) {
        self.lines.extend_from_slice(lines);
        self.packets.push((*packet, self.lines.len()));
    }

    /// Number of packets.
    pub fn len(&self) -> usize {
        self.packets.len()
    }

    /// Whether there are no packets.
    pub fn is_empty(&self) -> bool {
        self.packets.is_empty()
    }

    /// Number of lines of all packets.
    pub fn line_count(&self) -> usize {
        self.lines.len()
    }

    /// Each packet with its lines.
    pub fn iter(&self) -> impl Iterator<Item = (&Packet, &[LineAccess])> {
        let mut first = 0;
        self.packets.iter().map(move |(packet, end)| {
            let lines = &self.lines[first..*end];
            first = *end;
            (packet, lines)
        })
    }

    /// Remove all packets.
    pub fn clear(&mut self) {
        self.packets.clear();
        self.lines.clear();
    }
}

impl<'a> FromIterator<(&'a Packet, &'a [LineAccess])> for PacketBuffer {
    fn from_iter<I: IntoIterator<Item = (&'a Packet, &'a [LineAccess])>>(packets: I) -> Self {
        let mut all = Self::default();
        packets.into_iter().for_each(|(packet, lines)| all.push(packet, lines));
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packets_add_up_to_counts() {
        let mut packet = Packet::new(PacketKind::Tile, 0);
        packet.counts[Event::SamplesTested] = 512;
        let mut total = Counts::default();
        total += &packet.counts;
        total += &packet.counts;
        assert_eq!(total[Event::SamplesTested], 1024);
    }

    #[test]
    fn adding_up_is_per_event() {
        let mut total = Counts::default();
        let mut part = Counts::default();
        part[Event::SamplesTested] = 8;
        part[Event::SamplesHit] = 2;
        total += &part;
        total += &part;
        assert_eq!(total[Event::SamplesTested], 16);
        assert_eq!(total.sample_test_efficiency(), Some(0.25));
        assert_eq!(total[Event::Draws], 0);
    }

    #[test]
    fn units_that_a_gpu_lacks_are_not_reported() {
        let mut counts = Counts::default();
        let optional: usize =
            [Unit::Compute, Unit::Llc, Unit::Edram].iter().map(|unit| unit.events().len()).sum();
        assert_eq!(counts.reported().count(), Event::COUNT - optional);
        counts[Event::LlcReads] = 3;
        assert_eq!(counts.reported().filter(|(event, _)| event.unit() == Unit::Llc).count(), 4);
        assert!(counts.reported().is_sorted_by_key(|(event, _)| event), "in declaration order");
    }

    #[test]
    fn a_ratio_with_denominator_0_is_none() {
        assert_eq!(Counts::default().sample_test_efficiency(), None);
    }

    #[test]
    fn a_unit_is_used_when_one_of_its_events_is() {
        let mut counts = Counts::default();
        assert!(!counts.uses(Unit::Texture));
        counts[Event::TextureFetches] = 1;
        assert!(counts.uses(Unit::Texture));
        assert!(!counts.uses(Unit::Dram));
    }
}
