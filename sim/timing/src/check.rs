//! A check of a fast level by `stepped`: both time the same few slices of the stream of packets.
//!
//! Sampled simulation (Wunderlich et al. 2003, SMARTS) estimates the time of a program from detailed simulation
//! of short, evenly spread parts of it. Here the parts estimate the error of a faster level: its time of all
//! slices over that of the reference, minus one. At either level a slice begins on an empty machine.

use activity::{LineAccess, Packet, PacketBuffer};
use warnings::{Code, Warning};

use crate::{FrameClock, Level, Machine, Recorder, TimingError};

/// Most packets of a slice.
const SLICE: usize = 512;
/// Most slices that are timed, and that are kept until the length of the stream is known.
const SLICES: usize = 4;
const KEPT: usize = 4 * SLICES;
/// The check takes one packet of so many, but at least a slice.
const SHARE: usize = 32;
/// Most lines of a slice.
const SLICE_LINES: usize = 16 * SLICE;
/// A slice takes about one cycle of the frame of so many, or this many cycles if that is more.
const CYCLE_SHARE: u64 = 8;
const MIN_CYCLES: u64 = 1 << 15;

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

    /// The error of `level` on the slices; `None` if they take no time.
    ///
    /// # Errors
    /// Those of [`FrameClock::finish`].
    pub fn check(
        &self,
        level: Level,
        machine: Machine<'_>,
        of_frame: u64,
    ) -> Result<Option<Checked>, TimingError> {
        let limit = MIN_CYCLES.max(of_frame / CYCLE_SHARE);
        let (mut packets, mut fast, mut exact) = (0, 0, 0);
        for slice in self.chosen() {
            let mut most = slice.len();
            let mut timed = cycles(slice, most, level, machine)?;
            if timed > limit {
                most = (most as u64 * limit / timed).max(1) as usize;
                timed = cycles(slice, most, level, machine)?;
            }
            packets += most;
            fast += timed;
            exact += cycles(slice, most, Level::Stepped, machine)?;
        }
        Ok((exact > 0).then(|| Checked {
            packets,
            of: self.packets,
            error: fast as f64 / exact as f64 - 1.0,
        }))
    }

    /// The slices to time, from the middles of equal parts of the stream. A last slice may be short, so it is
    /// not among them if there are others.
    fn chosen(&self) -> impl Iterator<Item = &PacketBuffer> {
        let whole = (self.packets / self.every).clamp(1, self.kept.len().max(1));
        let count = (self.packets / SHARE / SLICE).clamp(1, SLICES);
        (0..count).filter_map(move |number| self.kept.get((2 * number + 1) * whole / (2 * count)))
    }
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
    fn slices_come_from_the_middles_of_equal_parts() {
        let of = |packets| -> Vec<(u32, usize)> {
            let slices = slices(packets);
            assert!(slices.kept.len() <= KEPT);
            let first = |slice: &PacketBuffer| slice.iter().next().unwrap().0.triangle;
            slices.chosen().map(|slice| (first(slice), slice.len())).collect()
        };
        assert_eq!(of(100), [(0, 100)]);
        assert_eq!(of(1100), [(512, 512)]);
        assert_eq!(of(8 * 512 + 1), [(2048, 512)]);
        assert_eq!(of(16 * 512), [(4096, 512)]);
        let middle = |part: u32| (part * 16_384 + 8192, SLICE);
        assert_eq!(of(65_536 + 5), [0, 1, 2, 3].map(middle));
        assert!(of(0).is_empty());
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
