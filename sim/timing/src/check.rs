//! A check of a fast level by `stepped`: both time the same few slices of the stream of packets.
//!
//! Sampled simulation (Wunderlich et al. 2003, SMARTS) estimates the time of a program from detailed simulation
//! of short parts of it. Here the parts estimate the error of a faster level. Packets differ in length, so parts
//! are chosen at even distances of time, by `packet` (systematic sampling with unequal probabilities, Madow
//! 1949). At any level a slice begins on an empty machine.

use activity::{LineAccess, Packet, PacketBuffer};
use warnings::{Code, Warning};

use crate::{FrameClock, Level, Machine, Recorder, TimingError};

/// Most packets of a slice.
const SLICE_PACKETS: usize = 256;
/// Most lines of a slice.
const SLICE_LINES: usize = 16 * SLICE_PACKETS;
/// Most slices that are kept.
const MAX_SLICES: usize = 32;
/// Points in the time of the frame at which a slice is chosen.
const POINTS: usize = 8;
/// All chosen slices together take at most this part of the cycles of the frame, unless that is very little or
/// very much: then one slice is cut to the first or to the second number of cycles.
const CYCLE_SHARE: u64 = 8;
const LIMIT_CYCLES: [u64; 2] = [1 << 14, 1 << 20];
/// Frames that take more cycles are not checked.
const MAX_FRAME_CYCLES: u64 = crate::packet::MAX_CYCLES / 4;

/// What a check of a frame found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Checked {
    /// Packets that both levels timed.
    pub packets: usize,
    /// Packets of the frame.
    pub of: usize,
    /// Estimated error of the cycles of the fast level, relative to `stepped`.
    pub error: f64,
}

impl Checked {
    /// The warning about a level that is far off.
    pub const CODE: Code = Code::TimingInaccurate;
    /// Least error of a check that is worth it.
    pub const FAR: f64 = 0.08;

    /// Whether the level is so far off that a run warns.
    pub fn is_far(self) -> bool {
        self.error.abs() >= Self::FAR
    }

    /// Warning about frame `frame` at a level that the user requested, or that was `chosen` with this relative
    /// error on a probe.
    pub fn warning(self, frame: u32, level: Level, chosen: Option<f64>) -> Warning {
        let Self { packets, of, error } = self;
        let name = level.name();
        let better = if level == Level::Bound { Level::Packet } else { Level::Stepped }.name();
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

/// Core cycles of the first `most` packets of a slice.
fn cycles(slice: &PacketBuffer, most: usize, level: Level, machine: Machine<'_>) -> Result<u64, TimingError> {
    // The recorder is not read.
    let mut clock = FrameClock::new(level, machine, Recorder::new(1 << 40, 2));
    slice.iter().take(most).for_each(|(packet, lines)| clock.push(packet, lines));
    Ok(clock.finish()?.cycles)
}

/// Evenly spread slices of a stream of unknown length, each of packets that follow each other. Once there are too
/// many, every other one is dropped.
#[derive(Clone, Debug)]
pub struct Slices {
    kept: Vec<PacketBuffer>,
    /// Packets from the beginning of a slice to the next.
    every: usize,
    packets: usize,
}

impl Default for Slices {
    fn default() -> Self {
        Self { kept: Vec::new(), every: SLICE_PACKETS, packets: 0 }
    }
}

impl Slices {
    /// Add the next packet of the stream with its lines.
    pub fn push(&mut self, packet: &Packet, lines: &[LineAccess]) {
        if self.packets == MAX_SLICES * self.every {
            self.kept = self.kept.drain(..).step_by(2).collect();
            self.every *= 2;
        }
        if self.packets.is_multiple_of(self.every) {
            self.kept.push(PacketBuffer::default());
        }
        let is_open =
            |slice: &&mut PacketBuffer| slice.len() < SLICE_PACKETS && slice.line_count() < SLICE_LINES;
        if let Some(slice) = self.kept.last_mut().filter(is_open) {
            slice.push(packet, lines);
        }
        self.packets += 1;
    }

    /// The error of `level`, by which the frame takes `of_frame` cycles. `None` without packets, for the
    /// reference, and for frames that are too long for `packet`.
    ///
    /// # Errors
    /// Those of [`FrameClock::finish`].
    pub fn check(
        &self,
        level: Level,
        machine: Machine<'_>,
        of_frame: u64,
    ) -> Result<Option<Checked>, TimingError> {
        if level == Level::Stepped || of_frame > MAX_FRAME_CYCLES {
            return Ok(None);
        }
        match self.estimate(level, machine, of_frame) {
            Err(TimingError::TooLong) => Ok(None),
            found => found,
        }
    }

    fn estimate(
        &self,
        level: Level,
        machine: Machine<'_>,
        of_frame: u64,
    ) -> Result<Option<Checked>, TimingError> {
        let limit = (of_frame / (CYCLE_SHARE * POINTS as u64)).clamp(LIMIT_CYCLES[0], LIMIT_CYCLES[1]);
        let (mut packets, mut fast, mut exact) = (0, 0.0, 0.0);
        for (slice, points) in self.choose(machine)? {
            let mut most = slice.len();
            let mut timed = cycles(slice, most, level, machine)?;
            if timed > limit {
                most = (most as u64 * limit / timed).max(1) as usize;
                timed = cycles(slice, most, level, machine)?;
            }
            let length = cycles(slice, most, Level::Packet, machine)?.max(1);
            let weight = points as f64 / length as f64;
            packets += most;
            fast += weight * timed.max(1) as f64;
            exact += weight * cycles(slice, most, Level::Stepped, machine)? as f64;
        }
        Ok((exact > 0.0).then(|| Checked { packets, of: self.packets, error: fast / exact - 1.0 }))
    }

    /// Slices that are chosen, and how often each is. The part of the frame that a slice stands for is as long
    /// as its packets take at `packet`.
    fn choose(&self, machine: Machine<'_>) -> Result<Vec<(&PacketBuffer, usize)>, TimingError> {
        let mut lengths = Vec::with_capacity(self.kept.len());
        for (slice, number) in self.kept.iter().zip(0..) {
            let stands_for = self.every.min(self.packets - number * self.every) as f64 / slice.len() as f64;
            let length = cycles(slice, slice.len(), Level::Packet, machine)?.max(1) as f64;
            lengths.push(length * stands_for);
        }
        let chosen = self.kept.iter().zip(systematic(&lengths));
        Ok(chosen.filter(|(_, points)| *points > 0).collect())
    }
}

/// How many of [`POINTS`] points, evenly spread over all parts, lie in each.
fn systematic(lengths: &[f64]) -> impl Iterator<Item = usize> {
    let all: f64 = lengths.iter().sum();
    let (mut sum, mut before) = (0.0, 0);
    lengths.iter().map(move |length| {
        sum += length;
        // Points are at odd multiples of half a step.
        let points = (sum / all * POINTS as f64 + 0.5) as usize;
        points - std::mem::replace(&mut before, points)
    })
}

#[cfg(test)]
mod tests {
    use activity::{LineKind, Unit};

    use super::*;

    fn packet() -> Packet {
        crate::streams::rates()[0].packets[0].0
    }

    /// A stream of packets, each with its number as the number of its triangle.
    fn slices(packets: u32) -> Slices {
        let (mut packet, mut slices) = (packet(), Slices::default());
        for triangle in 0..packets {
            packet.triangle = triangle;
            slices.push(&packet, &[]);
        }
        slices
    }

    #[test]
    fn slices_are_evenly_spread_whatever_the_length_of_the_stream() {
        let of = |packets| -> Vec<(u32, usize)> {
            let first = |slice: &PacketBuffer| slice.iter().next().unwrap().0.triangle;
            slices(packets).kept.iter().map(|slice| (first(slice), slice.len())).collect()
        };
        assert!(of(0).is_empty());
        assert_eq!(of(100), [(0, 100)]);
        assert_eq!(of(300), [(0, 256), (256, 44)]);
        assert_eq!(of(32 * 256).len(), 32);
        let every = |step: u32, count: u32| -> Vec<_> {
            (0..count).map(|slice| (slice * step, SLICE_PACKETS)).collect()
        };
        assert_eq!(of(32 * 256 + 512), every(512, 17));
        assert_eq!(of(100 * 1024), every(4096, 25));
    }

    fn machine(units: &crate::MachineSpec) -> Machine<'_> {
        Machine { units, clocks: crate::Clocks::new(1e9, 1e9).unwrap() }
    }

    #[test]
    fn the_check_of_a_frame_of_one_slice_is_its_error() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../run/gpus/reference.ron");
        #[derive(serde::Deserialize)]
        struct Gpu {
            units: crate::MachineSpec,
        }
        let Gpu { units } = activity::spec::load(path.as_ref()).unwrap();
        let case = crate::streams::failures(&units, 512).into_iter().find(|case| case.packets.len() < 256);
        let mut slices = Slices::default();
        let mut all = PacketBuffer::default();
        for (packet, lines) in &case.unwrap().packets {
            slices.push(packet, lines);
            all.push(packet, lines);
        }
        let [exact, fast] = [Level::Stepped, Level::Bound]
            .map(|level| cycles(&all, all.len(), level, machine(&units)).unwrap() as f64);
        let found = slices.check(Level::Bound, machine(&units), fast as u64).unwrap().unwrap();
        assert_eq!((found.packets, found.of), (all.len(), all.len()));
        assert!((found.error - (fast / exact - 1.0)).abs() < 1e-12 && exact != fast, "{found:?}");
        assert_eq!(slices.check(Level::Stepped, machine(&units), 0).unwrap(), None);
        assert_eq!(Slices::default().check(Level::Bound, machine(&units), 0).unwrap(), None);
    }

    #[test]
    fn parts_are_chosen_as_often_as_they_are_long() {
        let of = |lengths: &[f64]| systematic(lengths).collect::<Vec<_>>();
        assert_eq!(of(&[7.0]), [8]);
        assert_eq!(of(&[1.0; 8]), [1; 8]);
        assert_eq!(of(&[1.0; 24]), [0, 1, 0].repeat(8));
        assert_eq!(of(&[1.0, 98.0, 1.0]), [0, 8, 0]);
        assert!(of(&[]).is_empty());
    }

    #[test]
    fn a_slice_ends_with_its_lines() {
        let mut slices = Slices::default();
        let lines = vec![LineAccess::new(Unit::Texture, 0, LineKind::Fetch); SLICE_LINES / 2];
        (0..9).for_each(|_| slices.push(&packet(), &lines));
        assert_eq!((slices.kept[0].len(), slices.kept[0].line_count()), (2, SLICE_LINES));
    }

    #[test]
    fn a_warning_says_how_far_off_and_what_to_do() {
        let checked = Checked { packets: 512, of: 9000, error: -0.125 };
        assert!(checked.is_far() && !Checked { error: 0.079, ..checked }.is_far());
        let message = |level, chosen| checked.warning(3, level, chosen).message;
        assert_eq!(
            message(Level::Bound, None),
            "`bound` is about 12.5 % too short, by 512 of 9000 packets of frame 3 that `stepped` timed, too: times and energies \
             may be as far off; use --timing packet, or let --accuracy choose"
        );
        let chosen = message(Level::Packet, Some(0.012));
        let remedy = "`packet` was chosen with an error of 1.20 % on a probe; give a smaller --accuracy, or --timing stepped";
        assert!(chosen.ends_with(remedy), "{chosen}");
    }
}
