//! Recorded time stamps put onto the time of a curve: by two anchors, or by the best fit to the starts found in it.

mod gaps;

use serde::Serialize;
use thiserror::Error;

/// Fewer pairs than this fit anything.
const LEAST_PAIRS: usize = 4;
/// A second fit no worse than this many times the best leaves it open which is right.
const RIVAL: f64 = 2.0;

/// A fit that leaves more than this share of the median gap of the starts is none.
const LEFT: f64 = 0.1;

/// What is left by less than this is rounding, s.
const EXACT_S: f64 = 1e-9;

/// Why stamps cannot be aligned.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum AlignError {
    /// Two anchors at the same stamp, or not finite.
    #[error("anchors {a:?} and {b:?} (stamp, time): two finite, different stamps and times are needed")]
    Anchors {
        /// The first.
        a: (f64, f64),
        /// The second.
        b: (f64, f64),
    },
    /// Too few stamps or starts for a fit.
    #[error("{stamps} stamps and {starts} starts: a fit needs at least 4 of each; give two anchors instead")]
    Few {
        /// Stamps given.
        stamps: usize,
        /// Starts found.
        starts: usize,
    },
    /// No place where stamps and starts fit.
    #[error(
        "stamps fit the starts nowhere: the best pairing leaves {left_s:.3e} s of {gap_s:.3e} s between starts; look at the frames \
         found, or give two anchors instead"
    )]
    Unlike {
        /// Root mean square of what is left, s.
        left_s: f64,
        /// Median gap of the starts, s.
        gap_s: f64,
    },
    /// Stamps that do not tell times apart.
    #[error("too many of the {stamps} stamps are the same for a fit; give two anchors instead")]
    Equal {
        /// Stamps given.
        stamps: usize,
    },
}

/// `time = offset + scale x stamp`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Alignment {
    /// Seconds of the trace for a second of the stamps.
    pub scale: f64,
    /// Time of stamp 0, s.
    pub offset_s: f64,
    /// Root mean square of what is left, s; 0 by anchors.
    pub residual_s: f64,
    /// How many pairs it rests on.
    pub pairs: usize,
    /// Whether another pairing fits about as well: even frame times fit at any shift.
    pub ambiguous: bool,
}

impl Alignment {
    /// A stamp's time in the trace, s.
    pub fn time_s(&self, stamp_s: f64) -> f64 {
        self.offset_s + self.scale * stamp_s
    }

    /// Through two pairs of (stamp, time), s.
    ///
    /// # Errors
    /// [`AlignError::Anchors`] unless both are finite and differ.
    pub fn by_anchors(a: (f64, f64), b: (f64, f64)) -> Result<Self, AlignError> {
        let scale = (b.1 - a.1) / (b.0 - a.0);
        if !(scale.is_finite() && scale > 0.0) {
            return Err(AlignError::Anchors { a, b });
        }
        Ok(Self { scale, offset_s: a.1 - scale * a.0, residual_s: 0.0, pairs: 2, ambiguous: false })
    }

    /// The pairing of stamps with starts that leaves least: one after another from some shift on or, if that does not fit, with gaps
    /// in either. Both sorted, s.
    ///
    /// # Errors
    /// [`AlignError::Few`] for fewer than four of either, [`AlignError::Equal`] for stamps of which too many are the same,
    /// [`AlignError::Unlike`] where nothing fits.
    pub fn by_fit(stamps_s: &[f64], starts_s: &[f64]) -> Result<Self, AlignError> {
        let in_step = Self::in_step(stamps_s, starts_s)?;
        let gap_s = gaps::usual_gap(starts_s).unwrap_or(0.0);
        if in_step.residual_s <= EXACT_S.max(LEFT * LEFT * gap_s) {
            return Ok(in_step);
        }
        let least = (stamps_s.len().min(starts_s.len()) / 2).max(LEAST_PAIRS);
        let with_gaps =
            gaps::paired(stamps_s, starts_s, least).filter(|fit| fit.residual_s < in_step.residual_s);
        let best = with_gaps.unwrap_or(in_step);
        if best.residual_s > LEFT * gap_s {
            return Err(AlignError::Unlike { left_s: best.residual_s, gap_s });
        }
        Ok(best)
    }

    /// The shift by which one after another leaves least.
    fn in_step(stamps_s: &[f64], starts_s: &[f64]) -> Result<Self, AlignError> {
        let fewer = stamps_s.len().min(starts_s.len());
        if fewer < LEAST_PAIRS {
            return Err(AlignError::Few { stamps: stamps_s.len(), starts: starts_s.len() });
        }
        let overlap = (fewer / 2).max(LEAST_PAIRS);
        // Stamps before `skip` lie before the first start, starts before `skip` before the first stamp.
        let later_starts = (0..=starts_s.len() - overlap).map(|skip| fit(stamps_s, &starts_s[skip..]));
        let later_stamps = (1..=stamps_s.len() - overlap).map(|skip| fit(&stamps_s[skip..], starts_s));
        let mut fits: Vec<Self> = later_starts.chain(later_stamps).filter(|fit| fit.scale > 0.0).collect();
        if fits.is_empty() {
            return Err(AlignError::Equal { stamps: stamps_s.len() });
        }
        fits.sort_by(|a, b| a.residual_s.total_cmp(&b.residual_s));
        // Of all that fit about as well, the one that pairs most.
        let limit_s = RIVAL * fits[0].residual_s.max(EXACT_S);
        fits.retain(|fit| fit.residual_s <= limit_s);
        let ambiguous = fits.len() > 1;
        fits.sort_by_key(|fit| core::cmp::Reverse(fit.pairs));
        Ok(Self { ambiguous, ..fits[0] })
    }
}

/// Least squares of the first stamp with the first start, the second with the second, and so on.
fn fit(stamps_s: &[f64], starts_s: &[f64]) -> Alignment {
    let pairs = stamps_s.len().min(starts_s.len());
    let mean = |values: &[f64]| values[..pairs].iter().sum::<f64>() / pairs as f64;
    let (x, y) = (mean(stamps_s), mean(starts_s));
    let both = || stamps_s.iter().zip(starts_s).map(|(&a, &b)| (a - x, b - y));
    let (xy, xx) = both().fold((0.0, 0.0), |(xy, xx), (a, b)| (xy + a * b, xx + a * a));
    let scale = xy / xx;
    let left: f64 = both().map(|(a, b)| (b - scale * a) * (b - scale * a)).sum();
    let residual_s = libm::sqrt(left / pairs as f64);
    Alignment { scale, offset_s: y - scale * x, residual_s, pairs, ambiguous: false }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn uneven() -> Vec<f64> {
        (0..40)
            .scan(3.0, |t, i| {
                *t += 0.01 + 0.003 * f64::from(i * i * 7 % 31) / 8.0;
                Some(*t)
            })
            .collect()
    }

    #[test]
    fn anchors_and_fit_recover_a_shift_and_a_fast_clock() {
        let starts = uneven();
        let stamp = |time: f64| (time - 1.5) / 1.0001;
        let anchors = Alignment::by_anchors((stamp(3.0), 3.0), (stamp(9.0), 9.0)).unwrap();
        assert!((anchors.time_s(stamp(5.0)) - 5.0).abs() < 1e-12);
        let stamps: Vec<f64> = starts[7..30].iter().map(|&t| stamp(t)).collect();
        let fit = Alignment::by_fit(&stamps, &starts).unwrap();
        assert!((fit.scale - 1.0001).abs() < 1e-9 && fit.residual_s < 1e-12 && fit.pairs == 23, "{fit:?}");
        assert!(!fit.ambiguous);
    }

    #[test]
    fn stamps_that_are_missing_and_ones_too_many_are_left_out() {
        let starts = uneven();
        let stamp = |time: f64| (time - 1.5) / 1.0001;
        let all: Vec<f64> = starts.iter().map(|&time| stamp(time)).collect();
        let without = |every: usize| -> Vec<f64> {
            all.iter().enumerate().filter(|(i, _)| i % every != every - 1).map(|(_, stamp)| *stamp).collect()
        };
        let mut extra = all.clone();
        extra.insert(20, 0.5 * (all[19] + all[20]));
        for stamps in [without(17), without(5), extra] {
            let fit = Alignment::by_fit(&stamps, &starts).unwrap();
            assert!((fit.scale - 1.0001).abs() < 1e-9 && !fit.ambiguous, "{fit:?}");
            assert_eq!(fit.pairs, stamps.len().min(40));
        }
    }

    #[test]
    fn stamps_of_something_else_are_refused() {
        let others: Vec<f64> =
            (0..40).map(|i| 0.01 * f64::from(i) + 0.009 * f64::from(i * 37 % 11) / 11.0).collect();
        let fit = Alignment::by_fit(&others, &uneven());
        assert!(matches!(fit, Err(AlignError::Unlike { .. })), "{fit:?}");
    }

    #[test]
    fn an_even_beat_is_ambiguous_and_bad_input_refused() {
        let beat: Vec<f64> = (0..20).map(|i| f64::from(i) / 30.0).collect();
        assert!(Alignment::by_fit(&beat[..10], &beat).unwrap().ambiguous);
        assert!(Alignment::by_fit(&beat[..2], &beat).unwrap_err().to_string().contains("2 stamps"));
        assert!(Alignment::by_anchors((1.0, 2.0), (1.0, 3.0)).is_err());
        assert_eq!(Alignment::by_fit(&[5.0; 6], &beat), Err(AlignError::Equal { stamps: 6 }));
    }
}
