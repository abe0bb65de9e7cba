//! Pacing of consecutive frames, V-sync or free-running, with idle time between them, and the power curve of the run.

use activity::{PS_PER_S, S_PER_PS};
use traces::Curve;
use warnings::{Code, Warning};

use crate::PacingError;
use crate::model::{Energy, FramePower, Part};
use crate::platform::Platform;
use crate::quantity::Hertz;

/// Rule for the start of the next frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pacing {
    /// At the next tick of the display.
    Vsync {
        /// Ticks per second.
        rate: Hertz,
    },
    /// As soon as the driver has submitted it.
    FreeRunning,
}

impl Pacing {
    /// V-sync at `rate_hz` ticks per second.
    ///
    /// # Errors
    /// [`PacingError::Rate`] outside the range of [`Hertz`], also for NaN.
    pub fn vsync(rate_hz: f64) -> Result<Self, PacingError> {
        Ok(Self::Vsync { rate: Hertz::new(rate_hz)? })
    }
}

/// A frame in a run. Its times are the ground truth for frame finding.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PacedFrame {
    /// Start of its first command, in seconds from the start of the curve.
    pub start_s: f64,
    /// End of its last pixel, in seconds.
    pub busy_end_s: f64,
    /// Start of the next frame in seconds; for the last frame, when the next one would start.
    pub end_s: f64,
    /// Energy from `start_s` to `end_s` in joules; idle time after the work counts as [`Part::Idle`].
    pub energy: Energy,
}

/// A whole run: its power curve, with idle time before and after, and its frames.
#[derive(Clone, Debug, PartialEq)]
pub struct PacedRun {
    /// Power from 0 s, including the recorded idle time before and after the frames.
    pub curve: Curve,
    /// The frames in order; each ends at the start of the next.
    pub frames: Vec<PacedFrame>,
    /// Start of the first frame in seconds.
    pub start_s: f64,
    /// End of the last frame in seconds.
    pub end_s: f64,
    /// Warnings: `missed-vsync`.
    pub warnings: Vec<Warning>,
}

impl PacedRun {
    /// Energy from the start of the first frame to the end of the last one, summed frame by frame, in joules.
    pub fn energy(&self) -> Energy {
        self.frames.iter().fold(Energy::ZERO, |mut sum, frame| {
            sum += &frame.energy;
            sum
        })
    }
}

/// Pace `frames` on `platform`. A frame may be given repeatedly, as for a still animation.
///
/// # Errors
/// [`PacingError::NoFrames`] for an empty list, [`PacingError::Curve`] if the run has length 0, and
/// [`PacingError::TooLong`] if it lasts for months.
pub fn pace(frames: &[&FramePower], platform: &Platform, pacing: Pacing) -> Result<PacedRun, PacingError> {
    if frames.is_empty() {
        return Err(PacingError::NoFrames);
    }
    let schedule = Schedule::new(frames, platform, pacing);
    let mut ledger = Ledger::new();
    spend_idle(&mut ledger, to_ps(platform.lead_in_s.value()), platform)?;
    let start_s = ledger.now_s();
    let mut paced = Vec::with_capacity(frames.len());
    for (frame, &idle_ps) in frames.iter().zip(&schedule.idle_ps) {
        paced.push(spend_frame(&mut ledger, frame, idle_ps, platform)?);
    }
    let end_s = ledger.now_s();
    spend_idle(&mut ledger, to_ps(platform.tail_s.value()), platform)?;
    let warnings = schedule.warning(pacing).into_iter().collect();
    Ok(PacedRun { curve: ledger.close()?, frames: paced, start_s, end_s, warnings })
}

/// Append a frame and the idle time after it.
fn spend_frame(
    ledger: &mut Ledger,
    frame: &FramePower,
    idle_ps: u64,
    platform: &Platform,
) -> Result<PacedFrame, PacingError> {
    let start_s = ledger.now_s();
    for (length_ps, watts) in frame.bins_ps() {
        let total_w: f64 = watts.iter().sum();
        ledger.spend(length_ps, total_w * (length_ps as f64 * S_PER_PS))?;
    }
    let busy_end_s = ledger.now_s();
    let mut energy = *frame.energy();
    energy[Part::Idle] += spend_idle(ledger, idle_ps, platform)?;
    Ok(PacedFrame { start_s, busy_end_s, end_s: ledger.now_s(), energy })
}

/// Append `length_ps` picoseconds of idle time. Returns its energy in joules.
fn spend_idle(ledger: &mut Ledger, length_ps: u64, platform: &Platform) -> Result<f64, PacingError> {
    let joules = platform.idle_w.value() * (length_ps as f64 * S_PER_PS);
    ledger.spend(length_ps, joules)?;
    Ok(joules)
}

/// `seconds` in whole picoseconds; a platform limits them to an hour.
fn to_ps(seconds: f64) -> u64 {
    (seconds * PS_PER_S).round() as u64
}

/// Idle time after each frame, in whole picoseconds, so clocks do not drift.
#[derive(Debug, PartialEq)]
struct Schedule {
    idle_ps: Vec<u64>,
    /// Frames longer than their period.
    late: usize,
    /// Ticks missed because a frame was still being drawn.
    missed: u64,
}

impl Schedule {
    fn new(frames: &[&FramePower], platform: &Platform, pacing: Pacing) -> Self {
        let durations = frames.iter().map(|frame| frame.duration_ps());
        match pacing {
            Pacing::Vsync { rate } => Self::vsync(durations, rate),
            Pacing::FreeRunning => {
                let gap_ps = to_ps(platform.submit_gap_s.value());
                Self { idle_ps: vec![gap_ps; frames.len()], late: 0, missed: 0 }
            }
        }
    }

    /// Frame 0 starts on tick 0. Each other frame starts on the first tick at or after the end of the
    /// previous frame, and at least one tick after its start.
    fn vsync(durations_ps: impl Iterator<Item = u64>, rate: Hertz) -> Self {
        let mut schedule = Self { idle_ps: Vec::new(), late: 0, missed: 0 };
        let mut tick = 0;
        for duration_ps in durations_ps {
            let busy_end_ps = tick_ps(tick, rate).saturating_add(duration_ps);
            let next = first_tick_from(busy_end_ps, tick + 1, rate);
            schedule.idle_ps.push(tick_ps(next, rate).saturating_sub(busy_end_ps));
            schedule.late += usize::from(next > tick + 1);
            schedule.missed += next - tick - 1;
            tick = next;
        }
        schedule
    }

    fn warning(&self, pacing: Pacing) -> Option<Warning> {
        let Pacing::Vsync { rate } = pacing else { return None };
        let (late, frames, missed) = (self.late, self.idle_ps.len(), self.missed);
        let period_ms = 1e3 / rate.value();
        (late > 0).then(|| {
            Warning::new(
                Code::MissedVsync,
                format!(
                    "{late} of {frames} frames took longer than the V-sync period of {period_ms:.3} ms \
                     (ticks missed in all: {missed}): the animation stutters, and its mean frame rate is below the display's"
                ),
            )
        })
    }
}

/// Time of a tick in picoseconds after tick 0.
fn tick_ps(tick: u64, rate: Hertz) -> u64 {
    (tick as f64 * PS_PER_S / rate.value()).round() as u64
}

/// First tick at or after `time_ps`, at least `earliest`.
fn first_tick_from(time_ps: u64, earliest: u64, rate: Hertz) -> u64 {
    let near = (time_ps as f64 * rate.value() / PS_PER_S).floor() as u64;
    let mut tick = near.saturating_sub(1).max(earliest);
    while tick_ps(tick, rate) < time_ps {
        tick += 1;
    }
    tick
}

/// Builder of a power curve from energies spent over whole picoseconds.
///
/// The times of a curve are rounded to f64. The power of a step is its energy over the *rounded* length, so
/// the integral of the curve equals the energy spent. (Exact power over rounded lengths loses 1e-12 of a
/// short frame.)
#[derive(Debug, Default)]
struct Ledger {
    now_ps: u64,
    /// Energy of spans too short to move the rounded time; it goes into the next longer span.
    pending_j: f64,
    edges_s: Vec<f64>,
    watts: Vec<f64>,
}

impl Ledger {
    /// A ledger that begins at 0 s.
    fn new() -> Self {
        Self { edges_s: vec![0.0], ..Self::default() }
    }

    /// Current time, as the curve has it.
    fn now_s(&self) -> f64 {
        self.now_ps as f64 * S_PER_PS
    }

    /// Spend `joules` evenly over the next `length_ps` picoseconds.
    fn spend(&mut self, length_ps: u64, joules: f64) -> Result<(), PacingError> {
        self.now_ps = self.now_ps.checked_add(length_ps).ok_or(PacingError::TooLong)?;
        self.pending_j += joules;
        let (now_s, before_s) = (self.now_s(), self.edges_s.last().copied().unwrap_or(0.0));
        if now_s > before_s {
            self.edges_s.push(now_s);
            self.watts.push(self.pending_j / (now_s - before_s));
            self.pending_j = 0.0;
        }
        Ok(())
    }

    /// The finished curve.
    fn close(mut self) -> Result<Curve, PacingError> {
        if let ([.., before_s, end_s], Some(last_w)) = (self.edges_s.as_slice(), self.watts.last_mut()) {
            *last_w += self.pending_j / (end_s - before_s);
        }
        Ok(Curve::new(self.edges_s, self.watts)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn vsync(durations_ps: &[u64], rate_hz: f64) -> Schedule {
        Schedule::vsync(durations_ps.iter().copied(), Hertz::new(rate_hz).unwrap())
    }

    #[test]
    fn a_frame_that_ends_on_a_tick_is_followed_at_once() {
        let schedule = vsync(&[1_000_000_000, 1_000_000_000], 1000.0);
        assert_eq!(schedule, Schedule { idle_ps: vec![0, 0], late: 0, missed: 0 });
    }

    #[test]
    fn a_frame_one_picosecond_too_long_misses_a_tick() {
        let schedule = vsync(&[1_000_000_001, 400_000_000], 1000.0);
        assert_eq!(schedule, Schedule { idle_ps: vec![999_999_999, 600_000_000], late: 1, missed: 1 });
    }

    #[test]
    fn a_frame_of_no_length_still_takes_its_period() {
        assert_eq!(vsync(&[0, 0], 1000.0).idle_ps, [1_000_000_000, 1_000_000_000]);
    }

    #[test]
    fn ticks_do_not_drift() {
        let rate = Hertz::new(60.0).unwrap();
        assert_eq!(tick_ps(3_600, rate), 60_000_000_000_000);
        for tick in 0..10_000 {
            assert_eq!(first_tick_from(tick_ps(tick, rate), 0, rate), tick);
            assert_eq!(first_tick_from(tick_ps(tick, rate) + 1, 0, rate), tick + 1);
        }
    }

    #[test]
    fn ticks_are_found_at_the_ends_of_the_range_of_rates() {
        for rate_hz in [0.1, 1e5, 59.94, 1e5 / 3.0] {
            let rate = Hertz::new(rate_hz).unwrap();
            for tick in [0, 1, 2, 1_000] {
                assert_eq!(first_tick_from(tick_ps(tick, rate), 0, rate), tick, "{rate_hz} Hz");
            }
        }
    }

    #[test]
    fn joules_are_kept_however_short_their_spans() {
        let mut ledger = Ledger::new();
        // After two hours, a picosecond no longer changes an f64.
        let two_hours_ps = 7_200_000_000_000_000;
        ledger.spend(two_hours_ps, 0.0).unwrap();
        for _ in 0..1000 {
            ledger.spend(1, 1e-12).unwrap();
        }
        ledger.spend(0, 5e-10).unwrap();
        let curve = ledger.close().unwrap();
        let spent_j = curve.energy_j(7200.0, 7201.0);
        assert!((spent_j / 1.5e-9 - 1.0).abs() < 1e-9, "{spent_j}");
    }

    #[test]
    fn a_run_of_centuries_is_an_error() {
        let mut ledger = Ledger::new();
        ledger.spend(u64::MAX, 1.0).unwrap();
        assert_eq!(ledger.spend(1, 1.0), Err(PacingError::TooLong));
    }
}
