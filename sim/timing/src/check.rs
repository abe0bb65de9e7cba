//! A check of a fast level by `stepped`: both time the same few slices of the stream of packets.
//!
//! Sampled simulation (Wunderlich et al. 2003, SMARTS) estimates the time of a program from detailed simulation
//! of short parts of it. Here the parts estimate the error of a faster level. Packets differ in length, so the
//! parts are drawn with a probability that is proportional to their time, roughly, by `bound` (Hansen and
//! Hurwitz 1943). At any level a slice begins on an empty machine.

use activity::{LineAccess, Packet, PacketBuffer};
use warnings::{Code, Warning};

use crate::{FrameClock, Level, Machine, Recorder, TimingError};

/// Most packets of a slice.
const SLICE: usize = 256;
/// Most lines of a slice.
const SLICE_LINES: usize = 16 * SLICE;
/// Most slices that are kept, and how often one of them is drawn.
const KEPT: usize = 32;
const DRAWS: usize = 4;
/// All draws take one core cycle of the frame of so many, or each takes this many cycles if that is more.
const CYCLE_SHARE: u64 = 8;
const MIN_CYCLES: u64 = 1 << 14;

/// What a check of a frame found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Checked {
    /// Packets that both levels timed.
    pub packets: usize,
    /// Packets of the frame.
    pub of: usize,
    /// Error of the cycles of the fast level, relative to `stepped`.
    pub error: f64,
}

impl Checked {
    /// Least error of a check that is worth a warning.
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
            Code::TimingInaccurate,
            format!(
                "`{name}` is {:.1} % too {than} for {packets} of {of} packets of frame {frame}, by `stepped`: times and energies may \
                 be as far off; {remedy}",
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

/// Evenly spread slices of a stream of unknown length: once there are too many, every other one is dropped.
#[derive(Clone, Debug)]
pub(crate) struct Slices {
    kept: Vec<PacketBuffer>,
    /// Packets from the beginning of a slice to the next.
    every: usize,
    packets: usize,
}

impl Slices {
    pub fn new() -> Self {
        Self { kept: Vec::new(), every: SLICE, packets: 0 }
    }

    pub fn push(&mut self, packet: &Packet, lines: &[LineAccess]) {
        if self.packets == KEPT * self.every {
            self.kept = self.kept.drain(..).step_by(2).collect();
            self.every *= 2;
        }
        if self.packets.is_multiple_of(self.every) {
            self.kept.push(PacketBuffer::default());
        }
        let is_open = |slice: &&mut PacketBuffer| slice.len() < SLICE && slice.line_count() < SLICE_LINES;
        if let Some(slice) = self.kept.last_mut().filter(is_open) {
            slice.push(packet, lines);
        }
        self.packets += 1;
    }

    /// The error of `level`, by which the frame takes `of_frame` cycles; `None` without packets.
    ///
    /// # Errors
    /// Those of [`FrameClock::finish`].
    pub fn check(
        &self,
        level: Level,
        machine: Machine<'_>,
        of_frame: u64,
    ) -> Result<Option<Checked>, TimingError> {
        let limit = MIN_CYCLES.max(of_frame / (CYCLE_SHARE * DRAWS as u64));
        let (mut packets, mut fast, mut exact) = (0, 0.0, 0.0);
        for (slice, draws) in self.draw(machine)? {
            let mut most = slice.len();
            let mut timed = cycles(slice, most, level, machine)?;
            if timed > limit {
                most = (most as u64 * limit / timed).max(1) as usize;
                timed = cycles(slice, most, level, machine)?;
            }
            let weight = draws as f64 / cycles(slice, most, Level::Bound, machine)?.max(1) as f64;
            packets += most;
            fast += weight * timed as f64;
            exact += weight * cycles(slice, most, Level::Stepped, machine)? as f64;
        }
        Ok((exact > 0.0).then(|| Checked { packets, of: self.packets, error: fast / exact - 1.0 }))
    }

    /// Slices that are drawn, and how often each is: the part of the frame that each slice stands for is as
    /// long as its packets take at `bound`.
    fn draw(&self, machine: Machine<'_>) -> Result<Vec<(&PacketBuffer, usize)>, TimingError> {
        let mut lengths = Vec::with_capacity(self.kept.len());
        for (slice, number) in self.kept.iter().zip(0..) {
            let stands_for = self.every.min(self.packets - number * self.every) as f64 / slice.len() as f64;
            let length = cycles(slice, slice.len(), Level::Bound, machine)?.max(1) as f64;
            lengths.push(length * stands_for);
        }
        let drawn = self.kept.iter().zip(systematic(&lengths));
        Ok(drawn.filter(|(_, draws)| *draws > 0).collect())
    }
}

/// How often each part is drawn if [`DRAWS`] points lie evenly in all of them.
fn systematic(lengths: &[f64]) -> impl Iterator<Item = usize> {
    let all: f64 = lengths.iter().sum();
    let (mut sum, mut before) = (0.0, 0);
    lengths.iter().map(move |length| {
        sum += length;
        // Points are at odd multiples of half a step.
        let points = (sum / all * DRAWS as f64 + 0.5) as usize;
        points - std::mem::replace(&mut before, points)
    })
}

#[cfg(test)]
mod tests {
    use activity::{LineKind, PacketKind, Unit};

    use super::*;

    /// A stream of packets, each with its number as the number of its triangle.
    fn slices(packets: u32) -> Slices {
        let mut slices = Slices::new();
        for triangle in 0..packets {
            slices.push(&Packet { triangle, ..Packet::new(PacketKind::Tile, 0) }, &[]);
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
        let every =
            |step: u32, count: u32| -> Vec<_> { (0..count).map(|slice| (slice * step, SLICE)).collect() };
        assert_eq!(of(32 * 256 + 512), every(512, 17));
        assert_eq!(of(100 * 1024), every(4096, 25));
    }

    #[test]
    fn parts_are_drawn_as_often_as_they_are_long() {
        let of = |lengths: &[f64]| systematic(lengths).collect::<Vec<_>>();
        assert_eq!(of(&[7.0]), [4]);
        assert_eq!(of(&[1.0; 4]), [1; 4]);
        assert_eq!(of(&[1.0; 12]), [0, 1, 0].repeat(4));
        assert_eq!(of(&[1.0, 98.0, 1.0]), [0, 4, 0]);
        assert!(of(&[]).is_empty());
    }

    #[test]
    fn a_slice_ends_with_its_lines() {
        let mut slices = Slices::new();
        let lines = vec![LineAccess::new(Unit::Texture, 0, LineKind::Fetch); SLICE_LINES / 2];
        (0..9).for_each(|_| slices.push(&Packet::new(PacketKind::Tile, 0), &lines));
        assert_eq!((slices.kept[0].len(), slices.kept[0].line_count()), (2, SLICE_LINES));
    }

    #[test]
    fn a_warning_says_how_far_off_and_what_to_do() {
        let checked = Checked { packets: 512, of: 9000, error: -0.125 };
        assert!(checked.is_far() && !Checked { error: 0.079, ..checked }.is_far());
        let message = |level, chosen| checked.warning(3, level, chosen).message;
        assert_eq!(
            message(Level::Bound, None),
            "`bound` is 12.5 % too short for 512 of 9000 packets of frame 3, by `stepped`: times and energies may be as far off; \
             use --timing packet, or let --accuracy choose"
        );
        let chosen = message(Level::Packet, Some(0.012));
        let remedy = "`packet` was chosen with an error of 1.20 % on a probe; give a smaller --accuracy, or --timing stepped";
        assert!(chosen.ends_with(remedy), "{chosen}");
    }
}
