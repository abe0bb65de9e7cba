//! Marked frame starts and their windows, and the warning about a window without a signal.

use crate::stats::moments;
use crate::trace::Trace;
use thiserror::Error;
use warnings::{Code, Warning};

/// Fewest samples of a window.
const MIN_WINDOW_SAMPLES: usize = 4;

/// A mark or window that cannot be used on this trace.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum MarkError {
    /// No frame start was marked.
    #[error("no frame start is marked: mark one")]
    NoMark,
    /// A time or a length is not finite, or a length is negative.
    #[error("{what} = {value_s} s: it must be finite and not negative")]
    NotFinite {
        /// Which number.
        what: &'static str,
        /// Rejected value, s.
        value_s: f64,
    },
    /// A marked start is outside the trace, or too near its ends for a usable window.
    #[error(
        "the window around the mark at {mark_s} s is not within the trace ({start_s} s to {end_s} s): \
         mark a frame further inside"
    )]
    OutsideTrace {
        /// The mark, s.
        mark_s: f64,
        /// Start of the trace, s.
        start_s: f64,
        /// End of the trace, s.
        end_s: f64,
    },
    /// The end mark is not after every marked start, or outside the trace.
    #[error(
        "the end mark {end_mark_s} s must be after the marked start {mark_s} s and not after the trace's end {end_s} s"
    )]
    End {
        /// The end mark, s.
        end_mark_s: f64,
        /// The last marked start, s.
        mark_s: f64,
        /// End of the trace, s.
        end_s: f64,
    },
    /// The window is too short for the sample rate.
    #[error("a window of {window_s} s holds fewer than 4 samples at {rate_hz} Hz: widen it or record faster")]
    TooShort {
        /// Whole window, s.
        window_s: f64,
        /// Sample rate, Hz.
        rate_hz: f64,
    },
}

/// How much around a marked start is compared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Window {
    /// Before the mark, s.
    pub pre_s: f64,
    /// After the mark, s.
    pub post_s: f64,
}

/// The usual window, 1 ms before to 4 ms after the mark, shrunk so that it is no longer than a frame of
/// `period_hint_s` (one fifth before, four fifths after), but never below one sample before and three after.
pub fn default_window(period_hint_s: f64, rate_hz: f64) -> Window {
    let hint_s = if period_hint_s > 0.0 { period_hint_s } else { f64::INFINITY };
    let pre_s = f64::min(1e-3, 0.2 * hint_s);
    let post_s = f64::min(4e-3, 0.8 * hint_s);
    Window { pre_s: pre_s.max(1.0 / rate_hz), post_s: post_s.max(3.0 / rate_hz) }
}

/// Marked frame starts, the window around them and where the last frame ends.
#[derive(Clone, Debug, PartialEq)]
pub struct Marks {
    /// Marked starts of frames, s; usually one. With several, a segment is as near as its nearest window.
    pub starts_s: Vec<f64>,
    /// The window that is compared around each.
    pub window: Window,
    /// End of the last frame, s: starts from here on are dropped.
    pub end_s: f64,
}

/// The window of one mark in samples of one trace.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Placed {
    /// First sample of the window.
    pub first: usize,
    /// The mark's position relative to `first`, in samples, fractional.
    pub anchor: f64,
    /// The marked time, s.
    pub mark_s: f64,
}

/// All windows of the marks on one trace; they have the same length.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Placement {
    pub marks: Vec<Placed>,
    pub samples: usize,
    /// Whether the trace's ends cut the window.
    pub cut: bool,
}

impl Marks {
    /// One marked start.
    pub fn one(start_s: f64, window: Window, end_s: f64) -> Self {
        Self { starts_s: vec![start_s], window, end_s }
    }

    /// Places the windows on the samples of a trace, cut at its ends.
    pub(super) fn place(&self, trace: &Trace) -> Result<Placement, MarkError> {
        self.place_on(trace.start_s(), trace.rate_hz(), trace.samples() as u64)
    }

    /// As [`Marks::place`], on samples that need not be in memory. An end mark may be infinite: the end of
    /// the samples.
    pub(crate) fn place_on(&self, start_s: f64, rate_hz: f64, samples: u64) -> Result<Placement, MarkError> {
        let room = Room { start_s, rate_hz, samples: samples as f64 };
        self.check(&room)?;
        let wanted = [libm::round(self.window.pre_s * rate_hz), libm::round(self.window.post_s * rate_hz)];
        let centre = |mark_s: f64| libm::round(room.position(mark_s));
        let room_before = self.starts_s.iter().map(|&s| centre(s)).fold(f64::INFINITY, f64::min);
        let room_after = room.samples - self.starts_s.iter().map(|&s| centre(s)).fold(0.0, f64::max);
        let pre = wanted[0].min(room_before);
        let post = wanted[1].min(room_after);
        if pre + post < MIN_WINDOW_SAMPLES as f64 {
            return Err(self.no_room(&room, wanted[0] + wanted[1]));
        }
        let place = |&mark_s: &f64| {
            let first = centre(mark_s) - pre;
            Placed { first: first as usize, anchor: room.position(mark_s) - first, mark_s }
        };
        let cut = pre < wanted[0] || post < wanted[1];
        Ok(Placement {
            marks: self.starts_s.iter().map(place).collect(),
            samples: (pre + post) as usize,
            cut,
        })
    }

    fn no_room(&self, room: &Room, wanted_samples: f64) -> MarkError {
        if wanted_samples < MIN_WINDOW_SAMPLES as f64 {
            let window_s = self.window.pre_s + self.window.post_s;
            return MarkError::TooShort { window_s, rate_hz: room.rate_hz };
        }
        let mark_s = self.starts_s.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        MarkError::OutsideTrace { mark_s, start_s: room.start_s, end_s: room.end_s() }
    }

    fn check(&self, room: &Room) -> Result<(), MarkError> {
        for (what, value_s) in
            [("window before the mark", self.window.pre_s), ("window after the mark", self.window.post_s)]
        {
            if !(value_s.is_finite() && value_s >= 0.0) {
                return Err(MarkError::NotFinite { what, value_s });
            }
        }
        if self.starts_s.is_empty() {
            return Err(MarkError::NoMark);
        }
        let (start_s, end_s) = (room.start_s, room.end_s());
        for &mark_s in &self.starts_s {
            // Written so that NaN fails, too.
            if !(mark_s >= start_s && mark_s <= end_s) {
                return Err(MarkError::OutsideTrace { mark_s, start_s, end_s });
            }
            let within = self.end_s <= end_s + 0.5 / room.rate_hz || self.end_s == f64::INFINITY;
            if !(self.end_s > mark_s && within) {
                return Err(MarkError::End { end_mark_s: self.end_s, mark_s, end_s });
            }
        }
        Ok(())
    }
}

/// The time base of samples.
struct Room {
    start_s: f64,
    rate_hz: f64,
    samples: f64,
}

impl Room {
    fn position(&self, time_s: f64) -> f64 {
        (time_s - self.start_s) * self.rate_hz
    }

    fn end_s(&self) -> f64 {
        self.start_s + self.samples / self.rate_hz
    }
}

/// Standard errors above the deviation of the noise from which a window is more than noise.
const MIN_STANDARD_ERRORS: f64 = 3.0;

/// Whether a window varies by no more than the noise of a sample, `sigma`: the deviation of `n` samples of
/// noise is known to one part in `sqrt(2 n)`.
fn is_flat(window: &[f64], sigma: f64) -> bool {
    let most = sigma * (1.0 + MIN_STANDARD_ERRORS / libm::sqrt(2.0 * window.len() as f64));
    moments(window).deviation <= most
}

/// The warning, where one of some marked windows, each with where its mark is (s), is flat in noise of
/// deviation `sigma`.
pub(crate) fn flat_mark<'a>(
    windows: impl IntoIterator<Item = (f64, &'a [f64])>,
    sigma: f64,
) -> Option<Warning> {
    let (mark_s, _) = windows.into_iter().find(|(_, window)| is_flat(window, sigma))?;
    Some(Warning::new(
        Code::FlatMark,
        format!(
            "around the mark at {mark_s} s power varies by no more than noise, and every flat part of the trace resembles it: the starts \
             found may not be those of frames; mark where a frame begins"
        ),
    ))
}

/// [`flat_mark`] of a trace in memory.
pub(super) fn flat_mark_of(power: &[f64], placement: &Placement, sigma: f64) -> Option<Warning> {
    let windows = placement
        .marks
        .iter()
        .filter_map(|mark| Some((mark.mark_s, power.get(mark.first..mark.first + placement.samples)?)));
    flat_mark(windows, sigma)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frames::matched::noise_variance;
    use crate::stats::Random;
    use crate::trace::Metadata;

    const WINDOW: Window = Window { pre_s: 0.1, post_s: 0.4 };

    fn trace() -> Trace {
        Trace::new(vec![1.0; 100], vec![1.0; 100], 100.0, 2.0, Metadata::default()).unwrap()
    }

    #[test]
    fn the_anchor_keeps_the_fraction_of_the_mark() {
        let placed = Marks::one(2.513, WINDOW, 3.0).place(&trace()).unwrap();
        assert_eq!((placed.samples, placed.marks[0].first, placed.cut), (50, 41, false));
        assert!((placed.marks[0].anchor - 10.3).abs() < 1e-9);
    }

    #[test]
    fn a_window_is_cut_at_the_start_of_the_trace() {
        let placed = Marks::one(2.02, WINDOW, 3.0).place(&trace()).unwrap();
        assert_eq!((placed.samples, placed.marks[0].first, placed.cut), (42, 0, true));
    }

    #[test]
    fn the_default_window_shrinks_with_the_frame_but_not_below_four_samples() {
        assert_eq!(default_window(1.0 / 30.0, 50e3), Window { pre_s: 1e-3, post_s: 4e-3 });
        let short = default_window(1e-3, 50e3);
        assert!((short.pre_s + short.post_s - 1e-3).abs() < 1e-15);
        let slow = default_window(1e-3, 1e3);
        assert_eq!((slow.pre_s, slow.post_s), (1e-3, 3e-3));
    }

    #[test]
    fn each_bad_mark_says_what_and_where() {
        let message = |marks: Marks| marks.place(&trace()).unwrap_err().to_string();
        assert!(message(Marks { starts_s: vec![], window: WINDOW, end_s: 3.0 }).contains("no frame start"));
        assert!(message(Marks::one(9.0, WINDOW, 10.0)).contains("mark at 9 s"));
        assert!(message(Marks::one(f64::NAN, WINDOW, 3.0)).contains("mark at NaN s"));
        assert!(message(Marks::one(2.5, WINDOW, 2.4)).contains("end mark 2.4 s"));
        assert!(message(Marks::one(2.5, WINDOW, 3.5)).contains("end mark 3.5 s"));
        assert!(
            message(Marks::one(2.5, Window { pre_s: -1.0, post_s: 0.4 }, 3.0))
                .contains("window before the mark = -1 s")
        );
        assert!(
            message(Marks::one(2.5, Window { pre_s: 0.0, post_s: 0.02 }, 3.0))
                .contains("fewer than 4 samples")
        );
        assert!(
            message(Marks::one(2.999, Window { pre_s: 0.0, post_s: 0.5 }, 3.0))
                .contains("mark a frame further inside")
        );
    }

    #[test]
    fn noise_is_flat_and_an_edge_in_as_much_noise_is_not() {
        let random = Random::new(5, 0);
        let noise: Vec<f64> = (0..5000).map(|at| random.normals(at).0).collect();
        let sigma = libm::sqrt(noise_variance(&noise));
        let flat = noise.chunks_exact(250).filter(|window| is_flat(window, sigma)).count();
        assert_eq!(flat, 20);
        let warning = flat_mark([(0.5, &noise[..250])], sigma).unwrap();
        assert_eq!(warning.code, Code::FlatMark);
        let edge = |window: &[f64]| -> Vec<f64> {
            window.iter().enumerate().map(|(at, watts)| watts + if at < 50 { 0.0 } else { 3.0 }).collect()
        };
        assert!(noise.chunks_exact(250).all(|window| !is_flat(&edge(window), sigma)));
    }
}
