//! Packets of a frame in few bytes, to be timed again on other machines.
//!
//! Most packets resemble the one before: the same events, the next triangle, a line beside the last. So
//! numbers are stored as differences in variable-length integers (LEB128 of DWARF, zigzag for signs), and
//! sets of events by their place in a list.

use crate::{Event, LEVELS, LevelRequests, LineAccess, LineKind, Packet, PacketKind, Unit, Waits};

/// Packets with their lines, in order. The bytes of each are
///
/// - a byte (bits 0 to 2: draw, vertices, tile, resolve, compute, barrier for tiles, barrier for all; bit 3:
///   it moves to another pass, batch or draw; bit 4: it has lines), then differences to the packet before as
///   zigzag LEB128: if it moves, pass, batch and draw; tile; triangle;
/// - a byte with the place of its set of events among the sets so far, or 255 and a new set of 128 bits; a
///   count for each event, in LEB128;
/// - the number of lines. A line is a byte (bits 0 to 3: client; bits 4 to 6: hit, below, fetch, write,
///   allocate, drain; bit 7: goes on) and the difference to the last line of the client. One that goes on has
///   the number of lines written to memory, their differences to the line, and for each level below the L2
///   four bytes: reads, writes, misses, write-backs. Client 15 begins a run of as many lines as the next
///   number says.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PacketStream {
    bytes: Vec<u8>,
    packets: u64,
}

/// The bytes of a stream are not those of packets.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the packets are damaged at byte {at} of {bytes}")]
pub struct StreamError {
    /// Where reading stopped.
    pub at: usize,
    /// Bytes of the stream.
    pub bytes: usize,
}

impl PacketStream {
    /// The stream with these bytes and so many packets.
    pub const fn new(bytes: Vec<u8>, packets: u64) -> Self {
        Self { bytes, packets }
    }

    /// The packets as bytes.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Number of packets.
    pub const fn packets(&self) -> u64 {
        self.packets
    }

    /// Calls `each` with every packet and its lines, in order.
    ///
    /// # Errors
    /// [`StreamError`] if the bytes do not hold the packets; `each` has then seen those before.
    pub fn replay(&self, mut each: impl FnMut(&Packet, &[LineAccess])) -> Result<(), StreamError> {
        let mut reader = Reader { bytes: &self.bytes, at: 0, last: Last::default(), lines: Vec::new() };
        let damaged = |at| StreamError { at, bytes: self.bytes.len() };
        for _ in 0..self.packets {
            let packet = reader.packet().ok_or(damaged(reader.at))?;
            each(&packet, &reader.lines);
        }
        if reader.at == self.bytes.len() { Ok(()) } else { Err(damaged(reader.at)) }
    }
}

/// Writer of a [`PacketStream`].
#[derive(Clone, Debug, Default)]
pub struct StreamWriter {
    bytes: Vec<u8>,
    packets: u64,
    last: Last,
}

/// What the next packet is compared with.
#[derive(Clone, Debug)]
struct Last {
    place: [u32; 3],
    tile: u32,
    triangle: u32,
    /// Sets of events, a bit for each; at most [`MAX_SETS`].
    sets: Vec<u128>,
    /// Last line of each client.
    lines: [u32; Unit::COUNT],
}

impl Default for Last {
    fn default() -> Self {
        Self { place: [0; 3], tile: 0, triangle: 0, sets: Vec::new(), lines: [0; Unit::COUNT] }
    }
}

/// Number of sets of events that have a place; a set that is found too late is written out.
const MAX_SETS: usize = 255;
/// Place that stands for a set that is written out.
const NEW_SET: u8 = 255;
const _: () = assert!(Event::COUNT <= 128 && Unit::COUNT <= RUN as usize);

/// Most lines of a packet: more than any cache can write back at the end of a frame.
const MAX_LINES: usize = 1 << 23;

/// Kinds of packets by their code, three bits.
const KINDS: [PacketKind; 7] = [
    PacketKind::Draw,
    PacketKind::Vertices,
    PacketKind::Tile,
    PacketKind::Resolve,
    PacketKind::Compute,
    PacketKind::Barrier(Waits::Tiles),
    PacketKind::Barrier(Waits::All),
];
const KIND_BITS: u8 = 7;
/// Pass, batch or draw differ from those of the packet before.
const MOVES: u8 = 1 << 3;
const HAS_LINES: u8 = 1 << 4;

/// Kinds of lines by their code, three bits above those of the client.
const LINE_KINDS: [LineKind; 6] =
    [LineKind::Hit, LineKind::Below, LineKind::Fetch, LineKind::Write, LineKind::Allocate, LineKind::Drain];
const CLIENT_BITS: u32 = 4;
/// A line that writes others to memory, or that levels below the L2 see.
const GOES_ON: u8 = 1 << 7;
/// In place of a client: lines that each [follow](follows) the one before. Their number comes next.
const RUN: u8 = (1 << CLIENT_BITS) - 1;

/// Whether `next` differs from `line` only by the next line in memory, of those read and of those written.
fn follows(line: &LineAccess, next: &LineAccess) -> bool {
    after(line).as_ref() == Some(next)
}

/// The request for the next line that is otherwise like `line`; `None` at the end of memory.
fn after(line: &LineAccess) -> Option<LineAccess> {
    let next = |line: u32| line.checked_add(1).filter(|next| *next != LineAccess::NONE);
    let mut after = LineAccess { line: next(line.line)?, ..*line };
    for (to, from) in after.written.iter_mut().zip(line.written()) {
        *to = next(from)?;
    }
    Some(after)
}

impl StreamWriter {
    /// Adds a packet and its lines.
    pub fn push(&mut self, packet: &Packet, lines: &[LineAccess]) {
        let place = [packet.pass, packet.batch, packet.draw];
        let moves = place != self.last.place;
        let kind = KINDS.iter().position(|kind| *kind == packet.kind).unwrap_or_default() as u8;
        let flag = |set: bool, flag: u8| if set { flag } else { 0 };
        self.bytes.push(kind | flag(moves, MOVES) | flag(!lines.is_empty(), HAS_LINES));
        if moves {
            for (value, last) in place.into_iter().zip(self.last.place) {
                difference(&mut self.bytes, value, last);
            }
        }
        difference(&mut self.bytes, packet.tile, self.last.tile);
        difference(&mut self.bytes, packet.triangle, self.last.triangle);
        (self.last.place, self.last.tile, self.last.triangle) = (place, packet.tile, packet.triangle);
        self.counts(packet);
        if !lines.is_empty() {
            varint(&mut self.bytes, lines.len() as u64);
            lines.chunk_by(follows).for_each(|run| self.run(run));
        }
        self.packets += 1;
    }

    /// The stream of all packets.
    pub fn finish(self) -> PacketStream {
        PacketStream { bytes: self.bytes, packets: self.packets }
    }

    fn counts(&mut self, packet: &Packet) {
        let used = || packet.counts.iter().filter(|(_, count)| *count > 0);
        let set = used().fold(0, |set: u128, (event, _)| set | 1 << event as u32);
        match self.last.sets.iter().position(|known| *known == set) {
            Some(known) => self.bytes.push(known as u8),
            None => {
                self.bytes.push(NEW_SET);
                self.bytes.extend(set.to_le_bytes());
                self.last.learn(set);
            }
        }
        used().for_each(|(_, count)| varint(&mut self.bytes, count.into()));
    }

    fn run(&mut self, lines: &[LineAccess]) {
        let [first, .., last] = lines else { return lines.iter().for_each(|line| self.line(line)) };
        self.line(first);
        self.bytes.push(RUN);
        varint(&mut self.bytes, lines.len() as u64 - 1);
        self.last.lines[last.client as usize] = last.line;
    }

    fn line(&mut self, line: &LineAccess) {
        let kind = LINE_KINDS.iter().position(|kind| *kind == line.kind).unwrap_or_default() as u8;
        let written = line.written().count() as u8;
        let goes_on = written > 0 || line.levels.iter().any(|level| *level != LevelRequests::default());
        self.bytes.push(line.client as u8 | kind << CLIENT_BITS | if goes_on { GOES_ON } else { 0 });
        let last = std::mem::replace(&mut self.last.lines[line.client as usize], line.line);
        difference(&mut self.bytes, line.line, last);
        if goes_on {
            self.bytes.push(written);
            line.written().for_each(|victim| difference(&mut self.bytes, victim, line.line));
            for level in line.levels {
                self.bytes.extend([level.reads, level.writes, level.misses, level.writebacks]);
            }
        }
    }
}

impl Last {
    fn learn(&mut self, set: u128) {
        if self.sets.len() < MAX_SETS {
            self.sets.push(set);
        }
    }
}

/// LEB128: seven bits a byte, the lowest first.
fn varint(bytes: &mut Vec<u8>, mut value: u64) {
    while value >= 1 << 7 {
        bytes.push(value as u8 | 1 << 7);
        value >>= 7;
    }
    bytes.push(value as u8);
}

/// `value - last` as a small number, whichever is larger.
fn difference(bytes: &mut Vec<u8>, value: u32, last: u32) {
    let signed = value.wrapping_sub(last) as i32;
    varint(bytes, u64::from((signed << 1 ^ signed >> 31) as u32));
}

/// Reader of the bytes of a stream. `None` stands for bytes that are not of a stream.
struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
    last: Last,
    lines: Vec<LineAccess>,
}

impl Reader<'_> {
    fn packet(&mut self) -> Option<Packet> {
        let head = self.byte()?;
        let kind = *KINDS.get(usize::from(head & KIND_BITS))?;
        if head & MOVES != 0 {
            for at in 0..self.last.place.len() {
                self.last.place[at] = self.difference(self.last.place[at])?;
            }
        }
        let [pass, batch, draw] = self.last.place;
        let tile = self.difference(self.last.tile)?;
        let triangle = self.difference(self.last.triangle)?;
        (self.last.tile, self.last.triangle) = (tile, triangle);
        let mut packet = Packet { batch, draw, tile, triangle, ..Packet::new(kind, pass) };
        let mut set = self.set()?;
        while set != 0 {
            let event = *Event::ALL.get(set.trailing_zeros() as usize)?;
            packet.counts[event] = self.varint()?.try_into().ok()?;
            set &= set - 1;
        }
        self.lines.clear();
        if head & HAS_LINES != 0 {
            let count = self.varint()?.try_into().ok().filter(|count| *count <= MAX_LINES)?;
            while self.lines.len() < count {
                self.run(count)?;
            }
        }
        Some(packet)
    }

    fn set(&mut self) -> Option<u128> {
        let place = self.byte()?;
        if place != NEW_SET {
            return self.last.sets.get(usize::from(place)).copied();
        }
        let set = u128::from_le_bytes(self.take()?);
        self.last.learn(set);
        Some(set)
    }

    /// Adds a line, or those that follow the last one, to make at most `count`.
    fn run(&mut self, count: usize) -> Option<()> {
        let head = self.byte()?;
        if head != RUN {
            let line = self.line(head)?;
            self.lines.push(line);
            return Some(());
        }
        let end = self.varint()?.checked_add(self.lines.len() as u64).filter(|end| *end <= count as u64)?;
        while (self.lines.len() as u64) < end {
            let line = after(self.lines.last()?)?;
            self.lines.push(line);
        }
        let last = self.lines.last()?;
        self.last.lines[last.client as usize] = last.line;
        Some(())
    }

    fn line(&mut self, head: u8) -> Option<LineAccess> {
        let client = *Unit::ALL.get(usize::from(head & ((1 << CLIENT_BITS) - 1)))?;
        let kind = *LINE_KINDS.get(usize::from(head >> CLIENT_BITS & KIND_BITS))?;
        let line = self.difference(self.last.lines[client as usize])?;
        self.last.lines[client as usize] = line;
        let mut access = LineAccess::new(client, line, kind);
        if head & GOES_ON != 0 {
            for place in 0..usize::from(self.byte()?) {
                *access.written.get_mut(place)? = self.difference(line)?;
            }
            for level in 0..LEVELS.len() {
                let [reads, writes, misses, writebacks] = self.take()?;
                access.levels[level] = LevelRequests { reads, writes, misses, writebacks };
            }
        }
        Some(access)
    }

    fn byte(&mut self) -> Option<u8> {
        let byte = *self.bytes.get(self.at)?;
        self.at += 1;
        Some(byte)
    }

    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let bytes = *self.bytes.get(self.at..)?.first_chunk()?;
        self.at += N;
        Some(bytes)
    }

    fn varint(&mut self) -> Option<u64> {
        let mut value = 0;
        for shift in (0..u64::BITS).step_by(7) {
            let byte = self.byte()?;
            value |= u64::from(byte & !(1 << 7)) << shift;
            if byte < 1 << 7 {
                return Some(value);
            }
        }
        None
    }

    fn difference(&mut self, last: u32) -> Option<u32> {
        let coded: u32 = self.varint()?.try_into().ok()?;
        Some(last.wrapping_add(coded >> 1 ^ (coded & 1).wrapping_neg()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers without pattern, for packets of every kind with all that they may hold.
    fn stream() -> Vec<(Packet, Vec<LineAccess>)> {
        let mut state = 1_u64;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as u32
        };
        let line = |next: &mut dyn FnMut() -> u32| {
            let client = Unit::ALL[next() as usize % Unit::COUNT];
            let mut line =
                LineAccess::new(client, next() << 1, LINE_KINDS[next() as usize % LINE_KINDS.len()]);
            (0..next() % 4).for_each(|_| line.write(next()));
            line.levels[(next() % 2) as usize].misses = next() as u8;
            line
        };
        let run = |next: &mut dyn FnMut() -> u32| {
            let first = line(next);
            std::iter::successors(Some(first), after).take(1 + next() as usize % 3).collect::<Vec<_>>()
        };
        let packet = |number: usize, next: &mut dyn FnMut() -> u32| {
            let mut packet = Packet::new(KINDS[number % KINDS.len()], next() % 3);
            (packet.batch, packet.draw) =
                (next() % 2, if next() > u32::MAX / 4 { Packet::NONE } else { next() });
            (packet.tile, packet.triangle) = (next().wrapping_mul(2), next());
            // More sets of events than have a place.
            (0..next() % 6)
                .for_each(|_| packet.counts[Event::ALL[next() as usize % Event::COUNT]] = next() << 1);
            packet
        };
        let mut one = |number| {
            let packet = packet(number, &mut next);
            let lines = (0..next() % 5).flat_map(|_| run(&mut next)).collect();
            (packet, lines)
        };
        (0..2000).map(&mut one).collect()
    }

    fn written(packets: &[(Packet, Vec<LineAccess>)]) -> PacketStream {
        let mut writer = StreamWriter::default();
        packets.iter().for_each(|(packet, lines)| writer.push(packet, lines));
        writer.finish()
    }

    #[test]
    fn packets_come_back_as_they_were() {
        let packets = stream();
        let stream = written(&packets);
        let mut read = Vec::new();
        stream.replay(|packet, lines| read.push((*packet, lines.to_vec()))).unwrap();
        assert!(read == packets);
        assert_eq!(stream.packets(), 2000);
    }

    #[test]
    fn like_packets_take_few_bytes() {
        let mut packet = Packet::new(PacketKind::Tile, 0);
        packet.counts[Event::SamplesTested] = 64;
        let like = |number| (Packet { tile: number, triangle: 7, ..packet }, Vec::new());
        let packets: Vec<_> = (0..1000).map(like).collect();
        // Head, tile, triangle, set, one count.
        assert!(written(&packets).bytes().len() < 1000 * 5 + 32);
    }

    #[test]
    fn bytes_that_are_cut_or_changed_never_panic_and_cuts_are_errors() {
        let stream = written(&stream()[..40]);
        for length in 0..stream.bytes().len() {
            let cut = PacketStream::new(stream.bytes()[..length].to_vec(), stream.packets());
            assert!(cut.replay(|_, _| {}).is_err(), "{length}");
        }
        for at in 0..stream.bytes().len() {
            let mut bytes = stream.bytes().to_vec();
            bytes[at] ^= 0x5a;
            let _may_be_another_stream = PacketStream::new(bytes, stream.packets()).replay(|_, _| {});
        }
        let longer = PacketStream::new([stream.bytes(), &[0]].concat(), stream.packets());
        assert_eq!(longer.replay(|_, _| {}).unwrap_err().at, stream.bytes().len());
    }
}
