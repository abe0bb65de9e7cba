//! A check of a fast level by the next more exact one, up to `stepped`: both time the same few slices of the stream
//! of packets, and all of it if they differ there.
//!
//! Sampled simulation (Wunderlich et al. 2003, SMARTS) estimates the time of a program from detailed simulation
//! of short parts of it. Here the parts estimate the error of a faster level. Packets differ in length, so parts
//! are chosen at even distances of weight, which is about the work of timing them (systematic sampling with
//! unequal probabilities, Madow 1949). At any level a slice begins on an empty machine.
//!
//! The front end works on a batch while tiles of the one before are drawn, so a slice has packets of both.

use std::collections::VecDeque;

use activity::{LineAccess, Packet, PacketBuffer, PacketKind};
use warnings::{Code, Warning};

use crate::{FrameClock, Level, Machine, Recorder, Timed, TimingError};

/// Weight of a packet beside its lines, each of weight 1.
const PACKET_WEIGHT: usize = 8;
/// Packets of the front end take several times as long for their weight as tiles do: 3 to 8 times for ToyCar on the
/// built-in GPUs.
const FRONT_END_FACTOR: usize = 4;
/// Weight of a part of the stream that is kept, and most parts that are.
const PART_WEIGHT: usize = 1 << 16;
const MAX_PARTS: usize = 8;
/// Slices, and the weight of each, unless that is about more than so many cycles.
const SLICES: usize = 4;
const SLICE_WEIGHT: usize = 1 << 11;
const SLICE_CYCLES: f64 = (1u64 << 17) as f64;
/// Error of the slices from which on all kept packets are timed.
const LARGE_ERROR: f64 = 0.02;
/// Frames that take more cycles are not checked.
const MAX_FRAME_CYCLES: u64 = crate::packet::MAX_CYCLES / 4;

/// Size of an error from the logarithm of a ratio: 0.05 for 1.05 and for 1/1.05.
pub fn error_size(log: f64) -> f64 {
    libm::expm1(log.abs())
}

/// What a check of a frame found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Checked {
    /// Packets that `stepped` timed, too.
    pub packets: usize,
    /// Packets of the frame.
    pub of: usize,
    /// Estimated error of the cycles, relative to `stepped`.
    pub error: f64,
    /// The fastest level among the more exact ones that is not far off.
    pub better: Level,
}

impl Checked {
    /// The warning about a level that is far off.
    pub const CODE: Code = Code::TimingInaccurate;
    /// Least size of an error that is worth it.
    pub const FAR: f64 = 0.08;

    /// Size of the error; see [`error_size`].
    pub fn size(self) -> f64 {
        error_size(libm::log1p(self.error))
    }

    /// Whether the level is so far off that a run warns.
    pub fn is_far(self) -> bool {
        self.size() >= Self::FAR
    }

    /// Warning about frame `frame` at a level that the user requested, or that was `chosen` with this relative
    /// error on a probe.
    pub fn warning(self, frame: u32, level: Level, chosen: Option<f64>) -> Warning {
        let Self { packets, of, error, better } = self;
        let (name, better) = (level.name(), better.name());
        let remedy = match chosen {
            None => format!("use --timing {better}, or let --accuracy choose"),
            Some(error) => format!(
                "`{name}` was chosen with an error of {:.2} % on a probe; give a smaller --accuracy, or --timing {better}",
                1e2 * error
            ),
        };
        let than = if error < 0.0 { "short" } else { "long" };
        Warning::new(
            Self::CODE,
            format!(
                "`{name}` is about {:.1} % too {than}, by {packets} of {of} packets of frame {frame} that `stepped` timed, too: times \
                 and energies may be as far off; {remedy}",
                1e2 * error.abs()
            ),
        )
    }
}

/// A clock of a frame that checks its level.
pub struct CheckedClock<'a> {
    clock: FrameClock<'a>,
    /// `None` at the reference.
    slices: Option<SliceWriter>,
}

impl<'a> CheckedClock<'a> {
    /// A clock at time 0.
    pub fn new(level: Level, machine: Machine<'a>, recorder: Recorder) -> Self {
        let slices = (level != Level::Stepped).then(SliceWriter::default);
        Self { clock: FrameClock::new(level, machine, recorder), slices }
    }

    /// Add the next packet of the stream and the lines it requests from the L2.
    pub fn push(&mut self, packet: &Packet, lines: &[LineAccess]) {
        self.clock.push(packet, lines);
        if let Some(slices) = &mut self.slices {
            slices.push(packet, lines);
        }
    }

    /// See [`FrameClock::is_too_long`].
    pub fn is_too_long(&self) -> bool {
        self.clock.is_too_long()
    }

    /// Timing of the frame, with [`Timed::checked`].
    ///
    /// # Errors
    /// See [`FrameClock::finish`].
    pub fn finish(self) -> Result<Timed, TimingError> {
        match self.slices {
            Some(slices) => self.clock.finish_checked(&slices.finish()),
            None => self.clock.finish(),
        }
    }
}

/// The next more exact level, and most cycles that it may take for all kept packets.
const fn judge(level: Level) -> Option<(Level, f64)> {
    match level {
        Level::Bound => Some((Level::Packet, (1u64 << 23) as f64)),
        Level::Packet => Some((Level::Stepped, (1u64 << 20) as f64)),
        Level::Stepped => None,
    }
}

/// Core cycles of packets that follow each other.
fn cycles<'a>(
    packets: impl Iterator<Item = (&'a Packet, &'a [LineAccess])>,
    level: Level,
    machine: Machine<'_>,
) -> Result<u64, TimingError> {
    // The recorder is not read.
    let mut clock = FrameClock::new(level, machine, Recorder::new(1 << 40, 2));
    packets.for_each(|(packet, lines)| clock.push(packet, lines));
    Ok(clock.finish()?.cycles)
}

fn weight((_, lines): (&Packet, &[LineAccess])) -> usize {
    PACKET_WEIGHT + lines.len()
}

/// Packets of one part that follow each other.
#[derive(Clone, Copy, Debug)]
struct Slice<'a> {
    part: &'a PacketBuffer,
    from: usize,
    packets: usize,
}

impl<'a> Slice<'a> {
    /// The packets of `part` of which some weight lies in `from..to`.
    fn new(part: &'a PacketBuffer, [from, to]: [usize; 2]) -> Self {
        let mut sum = 0;
        let ends = part.iter().map(|packet| {
            sum += weight(packet);
            sum
        });
        let (mut first, mut packets) = (0, 0);
        for end in ends {
            first += usize::from(end <= from);
            packets += usize::from(end > from);
            if end >= to {
                break;
            }
        }
        Self { part, from: first, packets }
    }

    /// What of it comes after another slice; a heavy packet may be in both.
    fn after(self, other: Option<Self>) -> Option<Self> {
        let other = other.filter(|other| std::ptr::eq(other.part, self.part));
        let from = other.map_or(0, |other| other.from + other.packets).max(self.from);
        let packets = (self.from + self.packets).saturating_sub(from);
        (packets > 0).then_some(Self { from, packets, ..self })
    }

    fn iter(self) -> impl Iterator<Item = (&'a Packet, &'a [LineAccess])> {
        self.part.iter().skip(self.from).take(self.packets)
    }
}

/// Writer of [`Slices`].
///
/// The front end of a batch comes in the stream before all tiles of the batch before, of its pass or of the pass before,
/// and works at the same time. So its packets are put between these tiles, by the time that they take.
#[derive(Clone, Debug, Default)]
pub struct SliceWriter {
    slices: Slices,
    /// Packets of the front end that wait for tiles beside them, and the weight of these tiles so far.
    ahead: VecDeque<(Packet, Vec<LineAccess>)>,
    beside: usize,
}

impl SliceWriter {
    /// Add the next packet of the stream with its lines.
    pub fn push(&mut self, packet: &Packet, lines: &[LineAccess]) {
        if packet.kind.is_of_front_end() {
            self.ahead.push_back((*packet, lines.to_vec()));
            return;
        }
        self.beside += weight((packet, lines));
        while let Some((front, fetched)) = self.ahead.front() {
            let own = FRONT_END_FACTOR * weight((front, fetched));
            let is_needed = (front.pass, front.batch) <= (packet.pass, packet.batch)
                || matches!(packet.kind, PacketKind::Barrier(_));
            if !is_needed && own > self.beside {
                break;
            }
            if !is_needed {
                self.beside -= own;
                self.slices.batches_overlap = true;
            }
            self.next_of_front_end();
        }
        self.beside = if self.ahead.is_empty() { 0 } else { self.beside };
        self.slices.push(packet, lines);
    }

    fn next_of_front_end(&mut self) {
        if let Some((packet, lines)) = self.ahead.pop_front() {
            self.slices.push(&packet, &lines);
        }
    }

    /// The slices of all packets.
    pub fn finish(mut self) -> Slices {
        (0..self.ahead.len()).for_each(|_| self.next_of_front_end());
        self.slices
    }
}

/// Evenly spread parts of a stream of unknown length, each of packets that follow each other. Once there are too
/// many, every other one is dropped.
#[derive(Clone, Debug)]
pub struct Slices {
    parts: Vec<PacketBuffer>,
    /// One part of so many is kept.
    every: usize,
    /// Parts so far, and the weight of the last.
    begun: usize,
    weight: usize,
    packets: usize,
    /// Whether the front end works on a batch beside tiles of the one before.
    batches_overlap: bool,
}

impl Default for Slices {
    fn default() -> Self {
        Self {
            parts: Vec::new(),
            every: 1,
            begun: 0,
            weight: PART_WEIGHT,
            packets: 0,
            batches_overlap: false,
        }
    }
}

impl Slices {
    fn push(&mut self, packet: &Packet, lines: &[LineAccess]) {
        if self.weight >= PART_WEIGHT {
            self.begin();
        }
        self.packets += 1;
        self.weight += weight((packet, lines));
        let is_kept = (self.begun - 1).is_multiple_of(self.every);
        if let Some(part) = self.parts.last_mut().filter(|_| is_kept) {
            part.push(packet, lines);
        }
    }

    /// Begin the next part.
    fn begin(&mut self) {
        if self.begun == MAX_PARTS * self.every {
            self.parts = self.parts.drain(..).step_by(2).collect();
            self.every *= 2;
        }
        if self.begun.is_multiple_of(self.every) {
            self.parts.push(PacketBuffer::default());
        }
        (self.begun, self.weight) = (self.begun + 1, 0);
    }

    /// The error of `level`, by which the frame takes `of_frame` cycles. `None` for the reference, for
    /// frames that are too long for `packet`, and if a level cannot time a slice.
    pub fn check(&self, level: Level, machine: Machine<'_>, of_frame: u64) -> Option<Checked> {
        let (better, most) = judge(level)?;
        if of_frame > MAX_FRAME_CYCLES {
            return None;
        }
        let compare = |runs: &[Vec<Slice<'_>>]| self.compare([level, better], machine, runs).ok();
        let kept: usize = self.parts.iter().map(PacketBuffer::len).sum();
        let cycles = of_frame as f64 * kept as f64 / self.packets.max(1) as f64;
        let mut found = compare(&self.slices(cycles))?;
        // Slices are too short to fill the queues in which overlapping batches wait for each other.
        let may_be_off = self.batches_overlap || found.error.abs() >= LARGE_ERROR;
        if found.packets < kept && may_be_off && cycles <= most {
            found = compare(&self.all())?;
        }
        if judge(better).is_none() {
            return Some(found);
        }
        let of_better = self.check(better, machine, of_frame)?;
        Some(Checked {
            error: (1.0 + found.error) * (1.0 + of_better.error) - 1.0,
            better: if of_better.is_far() { of_better.better } else { better },
            ..of_better
        })
    }

    /// Compare two levels by packets that follow each other in each of `runs`.
    fn compare(
        &self,
        levels: [Level; 2],
        machine: Machine<'_>,
        runs: &[Vec<Slice<'_>>],
    ) -> Result<Checked, TimingError> {
        let mut sums = [0, 0];
        for (sum, level) in sums.iter_mut().zip(levels) {
            for run in runs {
                *sum += cycles(run.iter().flat_map(|slice| slice.iter()), level, machine)?;
            }
        }
        let [fast, exact] = sums.map(|cycles| cycles.max(1) as f64);
        let packets = runs.iter().flatten().map(|slice| slice.packets).sum();
        Ok(Checked { packets, of: self.packets, error: fast / exact - 1.0, better: levels[1] })
    }

    /// All that is kept. Parts follow each other if none was dropped.
    fn all(&self) -> Vec<Vec<Slice<'_>>> {
        let parts = self.parts.iter().map(|part| Slice { part, from: 0, packets: part.len() });
        if self.every == 1 { vec![parts.collect()] } else { parts.map(|part| vec![part]).collect() }
    }

    /// Slices of what is kept, which takes about `cycles`, around points at even distances; none is in two parts. All of
    /// it if it is little more.
    fn slices(&self, cycles: f64) -> Vec<Vec<Slice<'_>>> {
        let weights: Vec<usize> = self.parts.iter().map(|part| part.iter().map(weight).sum()).collect();
        let all: usize = weights.iter().sum();
        let length = SLICE_WEIGHT.min((SLICE_CYCLES * all as f64 / cycles) as usize);
        if all <= SLICES * length {
            return self.all();
        }
        let mut slices: Vec<Vec<Slice<'_>>> = Vec::new();
        for point in (0..SLICES).map(|slice| all * (2 * slice + 1) / (2 * SLICES)) {
            let (mut at, mut point) = (0, point);
            while weights[at] <= point {
                point -= weights[at];
                at += 1;
            }
            let [from, to] = [point.saturating_sub(length / 2), point + (length / 2).max(1)];
            let slice = Slice::new(&self.parts[at], [from, to]).after(slices.last().map(|last| last[0]));
            slices.extend(slice.map(|slice| vec![slice]));
        }
        slices
    }
}

#[cfg(test)]
mod tests {
    use activity::{LineKind, Unit, Waits};

    use super::*;

    fn packet() -> Packet {
        crate::streams::rates()[0].packets[0].0
    }

    /// A stream of packets, each with its number as the number of its triangle, and with so many lines.
    fn slices(packets: u32, lines: impl Fn(u32) -> usize) -> Slices {
        let (mut packet, mut slices) = (packet(), SliceWriter::default());
        for triangle in 0..packets {
            packet.triangle = triangle;
            let line = LineAccess::new(Unit::Texture, 0, LineKind::Fetch);
            slices.push(&packet, &vec![line; lines(triangle)]);
        }
        slices.finish()
    }

    /// First packets of slices, and how many there are.
    fn of(runs: &[Vec<Slice<'_>>]) -> Vec<(u32, usize)> {
        let of = |slice: &Slice<'_>| (slice.iter().next().unwrap().0.triangle, slice.iter().count());
        runs.iter().flatten().map(of).collect()
    }

    /// Packets without lines of one part.
    const PART: u32 = (PART_WEIGHT / PACKET_WEIGHT) as u32;

    #[test]
    fn parts_are_evenly_spread_whatever_the_length_of_the_stream() {
        let of = |packets| of(&slices(packets, |_| 0).all());
        assert!(of(0).is_empty());
        assert_eq!(of(100), [(0, 100)]);
        assert_eq!(of(PART + 44), [(0, PART as usize), (PART, 44)]);
        let every = |step: u32, count: u32| -> Vec<_> {
            (0..count).map(|part| (part * step * PART, PART as usize)).collect()
        };
        assert_eq!(of(8 * PART), every(1, 8));
        assert_eq!(of(9 * PART), every(2, 5));
        assert_eq!(of(22 * PART), every(4, 6));
        assert_eq!(slices(8 * PART, |_| 0).all().len(), 1);
        assert_eq!(slices(9 * PART, |_| 0).all().len(), 5);
    }

    #[test]
    fn the_front_end_of_a_batch_is_beside_tiles_of_the_one_before() {
        let packet = |kind, batch| Packet { kind, batch, ..packet() };
        let batches =
            [0, 1, 2].map(|batch| [PacketKind::Vertices, PacketKind::Tile].map(|kind| packet(kind, batch)));
        let [[v0, t0], [v1, t1], [v2, t2]] = batches;
        let line = LineAccess::new(Unit::Texture, 0, LineKind::Fetch);
        let mut slices = SliceWriter::default();
        let tile = vec![line; PACKET_WEIGHT];
        // In the order of the stream. A packet of vertices without lines takes as long as two tiles.
        for packet in [v0, v1, v1, t0, t0, t0, t0, t0, v2, t1, t1, v2, t2, v2] {
            let lines = if packet.kind == PacketKind::Tile { &tile[..] } else { &[] };
            slices.push(&packet, lines);
        }
        let order: Vec<_> = slices.finish().parts[0].iter().map(|(packet, _)| *packet).collect();
        assert_eq!(order, [v0, t0, v1, t0, t0, v1, t0, t0, t1, v2, t1, v2, t2, v2]);
        // A batch without tiles comes before the barrier that follows it.
        let barrier = packet(PacketKind::Barrier(Waits::All), 0);
        let mut slices = SliceWriter::default();
        [v0, t0, v1, barrier].iter().for_each(|packet| slices.push(packet, &[]));
        assert_eq!(
            slices.finish().parts[0].iter().map(|(packet, _)| *packet).collect::<Vec<_>>(),
            [v0, t0, v1, barrier]
        );
    }

    #[test]
    fn batches_side_by_side_are_timed_by_all_packets() {
        let units = crate::MachineSpec::reference();
        let (_, all) = broken(&units, "one giant triangle");
        let checked = |batch| {
            let mut slices = SliceWriter::default();
            slices.push(&Packet { kind: PacketKind::Vertices, batch, ..packet() }, &[]);
            all.iter().for_each(|(packet, lines)| slices.push(packet, lines));
            let found = slices.finish().check(Level::Packet, machine(&units), 1000).unwrap();
            found.packets == found.of
        };
        assert_eq!([0, 1].map(checked), [false, true]);
    }

    #[test]
    fn slices_are_at_even_distances_of_weight() {
        let sliced = |packets, lines: fn(u32) -> usize| of(&slices(packets, lines).slices(1e3));
        // An eighth on either side of the first and the last.
        assert_eq!(sliced(6400, |_| 0), [672, 2272, 3872, 5472].map(|first| (first, 256)));
        // A packet of each that takes longer than a slice should.
        assert_eq!(of(&slices(6400, |_| 0).slices(1e10)), [800, 2400, 4000, 5600].map(|first| (first, 1)));
        // Little more than four slices.
        assert_eq!(sliced(1024, |_| 0), [(0, 1024)]);
        // A packet with nearly all lines is in one slice.
        assert_eq!(sliced(400, |packet| if packet == 200 { 90_000 } else { 0 }), [(200, 1)]);
        // The last packets have nearly all lines.
        let late = |packet| if packet < 1000 { 0 } else { 10_000 };
        let first: Vec<_> = sliced(1010, late).into_iter().map(|(first, _)| first).collect();
        assert_eq!(first, [1000, 1003, 1005, 1008]);
    }

    fn machine(units: &crate::MachineSpec) -> Machine<'_> {
        Machine { units, clocks: crate::Clocks::new(1e9, 1e9).unwrap() }
    }

    /// The slices and all packets of a stream that breaks levels.
    fn broken(units: &crate::MachineSpec, name: &str) -> (Slices, PacketBuffer) {
        let case = crate::streams::failures(units, 512).into_iter().find(|case| case.name == name).unwrap();
        let (mut slices, mut all) = (SliceWriter::default(), PacketBuffer::default());
        for (packet, lines) in &case.packets {
            slices.push(packet, lines);
            all.push(packet, lines);
        }
        (slices.finish(), all)
    }

    #[test]
    fn a_level_that_differs_is_checked_by_all_packets() {
        let units = crate::MachineSpec::reference();
        let (slices, all) = broken(&units, "passes in a chain");
        let [packet, bound] = [Level::Packet, Level::Bound]
            .map(|level| cycles(all.iter(), level, machine(&units)).unwrap() as f64);
        let check = |level, cycles| slices.check(level, machine(&units), cycles).unwrap();
        let of_packet = check(Level::Packet, packet as u64);
        assert!(of_packet.packets < all.len() && of_packet.error.abs() < LARGE_ERROR, "{of_packet:?}");
        let found = check(Level::Bound, bound as u64);
        let error = bound / packet * (1.0 + of_packet.error) - 1.0;
        assert!((found.error - error).abs() < 1e-12 && error.abs() > LARGE_ERROR, "{found:?}");
        assert_eq!((found.packets, found.of, found.better), (of_packet.packets, all.len(), Level::Packet));
        // Too long for that.
        let sliced = check(Level::Bound, 1 << 24);
        assert!((sliced.error - error).abs() > 1e-3, "{sliced:?}");
    }

    #[test]
    fn the_reference_is_not_checked_and_frames_without_packets_are_exact() {
        let units = crate::MachineSpec::reference();
        assert_eq!(slices(9, |_| 1).check(Level::Stepped, machine(&units), 100), None);
        let empty = SliceWriter::default().finish().check(Level::Bound, machine(&units), 0).unwrap();
        assert_eq!((empty.of, empty.error), (0, 0.0));
        let exact = slices(9, |_| 1).check(Level::Packet, machine(&units), 100).unwrap();
        assert!(exact.of == 9 && exact.error.abs() < LARGE_ERROR, "{exact:?}");
    }

    #[test]
    fn a_warning_says_how_far_off_and_what_to_do() {
        let checked = Checked { packets: 512, of: 9000, error: -0.125, better: Level::Packet };
        assert!(checked.is_far() && !Checked { error: 0.079, ..checked }.is_far());
        // The larger number is 8.1 % larger.
        assert!(Checked { error: -0.075, ..checked }.is_far());
        let message = |checked: Checked, level, chosen| checked.warning(3, level, chosen).message;
        assert_eq!(
            message(checked, Level::Bound, None),
            "`bound` is about 12.5 % too short, by 512 of 9000 packets of frame 3 that `stepped` timed, too: times and energies \
             may be as far off; use --timing packet, or let --accuracy choose"
        );
        let chosen = message(Checked { better: Level::Stepped, ..checked }, Level::Packet, Some(0.012));
        let remedy = "`packet` was chosen with an error of 1.20 % on a probe; give a smaller --accuracy, or --timing stepped";
        assert!(chosen.ends_with(remedy), "{chosen}");
    }
}
