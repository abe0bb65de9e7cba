//! Frames at another clock than the mark's, searched again.
//!
//! Templates follow content that changes slowly. At a clock step everything changes at once, and the sequence
//! may go on at the same period in another phase of the frame. So where neighbours differ, frames of both
//! sides are aligned over a whole period, the earlier ones [scaled in time](crate::frames::subsample). Outwards
//! from the mark, each segment between two such changes is compared with the last one known to be right. If
//! it lies elsewhere, one of its frames is corrected and used like a mark.

use crate::frames::subsample::{ScaledFit, ScaledPair};
use crate::stats::upper_median;

/// Neighbours differ if they leave at least this many times the usual unexplained variance, and at least this
/// share.
const UNLIKE_LIMITS: [f64; 2] = [2.0, 0.06];
/// Most changes that are examined: those of the largest difference.
const MAX_CHANGES: usize = 200;
/// Ratios of clocks agree within this share; clocks differ if their ratio is farther from 1.
const MAX_CLOCK_DEVIATION: f64 = 0.09;
/// Least misplacement that is corrected here, as a share: smaller ones are left to finer alignment, and must
/// not add up on the way.
const MIN_MISPLACEMENT: f64 = 0.1;
/// Share of the window before the start that is compared.
const BEFORE_SHARE: f64 = 0.1;
/// Share of the window after the start that a beginning has.
const BEGINNING_SHARE: f64 = 0.6;
/// Largest share of the unexplained variance at the assumed place that a better alignment leaves.
const MAX_IMPROVED_SHARE: f64 = 0.5;

/// How frames of both sides of a step are compared.
struct Comparison {
    /// Which frames are aligned: how many from the step on the known side, and how many on the other.
    pairs: &'static [[usize; 2]],
    /// How many of these have to agree on one place,
    agree: usize,
    /// within this share of the window.
    within: f64,
    /// How much after the start is compared.
    after: After,
    /// An alignment leaves at most this share of the variance.
    max_unexplained: f64,
}

/// How much after a start is compared: a share of the window, or of a period.
enum After {
    Window(f64),
    Period(f64),
}

/// The beginnings of the nearest frames, whose content differs least.
const NEAREST: Comparison = Comparison {
    pairs: &[[1, 1], [1, 2], [2, 1], [2, 2]],
    agree: 3,
    within: 0.03,
    after: After::Window(BEGINNING_SHARE),
    max_unexplained: 0.3,
};
/// Nearly whole frames, for beginnings that resemble another part of the frame (in noise, at a slow clock).
/// The nearest frames are left out, as the clock may have stepped within one.
const WHOLE: Comparison = Comparison {
    pairs: &[[2, 2], [2, 3], [3, 2], [3, 3], [3, 4], [4, 3]],
    agree: 4,
    within: 0.06,
    after: After::Period(0.8),
    max_unexplained: 0.5,
};

/// Offsets of windows of starts, put right, one for each segment of `starts` that lies elsewhere; `anchor` is
/// the place of the start in a window of `width` samples.
pub(super) fn misplaced(
    power: &[f64],
    starts: &[usize],
    marks: &[usize],
    anchor: usize,
    width: usize,
) -> Vec<usize> {
    let window = ClockWindow { power, starts, anchor, width };
    let steps = window.steps();
    let mut found = Vec::new();
    for mark in marks.iter().filter_map(|mark| starts.binary_search(mark).ok()) {
        let (before, after) = steps.split_at(steps.partition_point(|step| *step < mark));
        window.walk(after.iter().map(|step| [*step, *step + 1]), 1, &mut found);
        window.walk(before.iter().rev().map(|step| [*step + 1, *step]), -1, &mut found);
    }
    found.retain(|offset| marks.iter().all(|mark| mark.abs_diff(*offset) > width / 2));
    found.sort_unstable();
    found.dedup_by(|later, earlier| *later - *earlier < width / 2);
    found
}

/// A sequence of starts in a trace.
struct ClockWindow<'a> {
    power: &'a [f64],
    starts: &'a [usize],
    anchor: usize,
    width: usize,
}

impl ClockWindow<'_> {
    /// Starts whose next one is unlike them, in order.
    fn steps(&self) -> Vec<usize> {
        let reach = self.share(0.12);
        let remainder = |index: usize| {
            let fit = self.pair([index, index + 1], 0, reach).unscaled();
            fit.map_or(1.0, |fit| fit.unexplained)
        };
        let unexplained: Vec<f64> = (0..self.starts.len().saturating_sub(1)).map(remainder).collect();
        let usual = upper_median(&mut unexplained.clone());
        let limit = (UNLIKE_LIMITS[0] * usual).max(UNLIKE_LIMITS[1]);
        let mut steps: Vec<usize> =
            (0..unexplained.len()).filter(|&index| unexplained[index] > limit).collect();
        steps.sort_by(|a, b| unexplained[*b].total_cmp(&unexplained[*a]));
        steps.truncate(MAX_CHANGES);
        steps.sort_unstable();
        steps
    }

    /// From step to step away from a mark, each by the starts on this side and on that, as long as every step
    /// can be resolved.
    fn walk(&self, steps: impl Iterator<Item = [usize; 2]>, way: isize, found: &mut Vec<usize>) {
        let mut moved = 0;
        for [here, there] in steps {
            let by = |comparison| self.moved(comparison, [here, there], moved, way);
            let near = by(&NEAREST);
            let Some((at, by)) = near.or_else(|| by(&WHOLE)) else { return };
            let misplaced = by.unsigned_abs() > self.share(MIN_MISPLACEMENT);
            moved = if misplaced { by } else { 0 };
            if misplaced {
                found.extend(self.starts[at].checked_add_signed(by));
                // Where only whole frames decide, the sequence is better tracked again from there.
                if near.is_none() {
                    return;
                }
            }
        }
    }

    /// How far the starts from `there` on, in the way given, lie from where those up to `here`, moved, say
    /// that they should: the start that fits best, and by how many samples. `None` where the two sides do not
    /// agree on one ratio of clocks and one place.
    fn moved(
        &self,
        comparison: &Comparison,
        [here, there]: [usize; 2],
        moved: isize,
        way: isize,
    ) -> Option<(usize, isize)> {
        let fits: Vec<(usize, ScaledFit)> = comparison
            .pairs
            .iter()
            .filter_map(|[back, on]| {
                let from = here.checked_add_signed(-way * (*back as isize - 1))?;
                let to = there.checked_add_signed(way * (*on as isize - 1))?;
                Some((to, self.fit(comparison, from, to, moved)?))
            })
            .collect();
        let shift = upper_median(&mut fits.iter().map(|(_, fit)| fit.shift).collect::<Vec<_>>());
        let ratio = upper_median(&mut fits.iter().map(|(_, fit)| fit.ratio).collect::<Vec<_>>());
        let within = self.share(comparison.within) as f64;
        let near = |(_, fit): &&(usize, ScaledFit)| {
            (fit.shift - shift).abs() <= within && (fit.ratio / ratio - 1.0).abs() < MAX_CLOCK_DEVIATION
        };
        let agreed: Vec<&(usize, ScaledFit)> = fits.iter().filter(near).collect();
        let best = agreed.iter().min_by(|a, b| a.1.unexplained.total_cmp(&b.1.unexplained))?;
        (agreed.len() >= comparison.agree).then(|| (best.0, libm::round(best.1.shift) as isize))
    }

    /// The fit of a start to another over a period, if it is a good one, and either at the assumed place, or
    /// at another clock and much better than there.
    fn fit(&self, comparison: &Comparison, from: usize, to: usize, moved: isize) -> Option<ScaledFit> {
        let period = self.period(to)?;
        let after = match comparison.after {
            After::Window(share) => self.share(share),
            After::Period(share) => (share * period as f64) as usize,
        };
        let best = |reach: usize| ScaledPair { after, ..self.pair([from, to], moved, reach) }.best();
        let fit = best(period / 2)?;
        let in_place = libm::fabs(fit.shift) <= self.share(MIN_MISPLACEMENT) as f64;
        let better = || {
            best(self.share(MIN_MISPLACEMENT))
                .is_none_or(|near| fit.unexplained < MAX_IMPROVED_SHARE * near.unexplained)
        };
        let good = fit.unexplained < comparison.max_unexplained
            && (in_place || (fit.ratio - 1.0).abs() > MAX_CLOCK_DEVIATION && better());
        good.then_some(fit)
    }

    /// The beginnings of two frames.
    fn pair(&self, starts: [usize; 2], moved: isize, reach: usize) -> ScaledPair<'_> {
        let place =
            |start: usize| self.starts.get(start).map_or(usize::MAX / 2, |offset| offset + self.anchor);
        let [before, after] = [BEFORE_SHARE, BEGINNING_SHARE].map(|share| self.share(share));
        let starts = [place(starts[0]).saturating_add_signed(moved), place(starts[1])];
        ScaledPair { power: self.power, starts, before, after, reach }
    }

    /// The shorter of the gaps beside a start.
    fn period(&self, start: usize) -> Option<usize> {
        let gap = |from: usize| Some(self.starts.get(from + 1)? - self.starts.get(from)?);
        start.checked_sub(1).and_then(gap).into_iter().chain(gap(start)).min()
    }

    /// A share of the window, in samples.
    fn share(&self, share: f64) -> usize {
        ((share * self.width as f64) as usize).max(1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    const ANCHOR: usize = 50;
    const WIDTH: usize = 250;

    /// Power of frames of 300 samples at clock 1, of as many of 480 at another: each a rest of 40 samples and
    /// draws that differ.
    fn trace(frames: usize, seed: u32) -> (Vec<f64>, Vec<usize>) {
        let height = |draw: u32| 0.3 + f64::from((draw * 7919 + seed * 104_729) % 97) / 97.0;
        let (mut power, mut starts) = (Vec::new(), Vec::new());
        for frame in 0..2 * frames {
            let (ratio, gain) = if frame < frames { (1.0, 1.0) } else { (1.7, 0.5) };
            power.extend([0.1; 40]);
            starts.push(power.len() - ANCHOR);
            let length = (260.0 * ratio) as usize;
            let draw = |i: usize| libm::pow(i as f64 / ratio, 0.7) as u32;
            power.extend((0..length).map(|i| 0.1 + gain * height(draw(i))));
        }
        power.extend([0.1; 600]);
        (power, starts)
    }

    /// Starts of which those at the other clock are found late, in samples.
    fn late(right: &[usize], by: usize) -> Vec<usize> {
        right.iter().enumerate().map(|(i, start)| if i < 12 { *start } else { start + by }).collect()
    }

    #[test]
    fn frames_whose_beginnings_noise_hides_are_recognized_by_the_whole_of_them() {
        let (mut power, right) = trace(12, 1);
        let noise = Random::new(7, 0);
        for start in right[12..].iter().map(|start| start + ANCHOR) {
            let beginning = (start as u64..).zip(&mut power[start..start + 150]);
            beginning.for_each(|(sample, watts)| *watts += 0.13 * noise.normals(sample).0);
        }
        let found = misplaced(&power, &late(&right, 200), &[right[3]], ANCHOR, WIDTH);
        let off = |found: &usize| right.iter().map(|start| start.abs_diff(*found)).min();
        assert!(
            found.len() == 1 && off(&found[0]) <= Some(15),
            "{found:?} {:?}",
            found.iter().map(off).collect::<Vec<_>>()
        );
        assert!(misplaced(&power, &right, &[right[3]], ANCHOR, WIDTH).is_empty());
    }

    #[test]
    fn frames_at_another_clock_that_were_followed_elsewhere_are_found_again() {
        let (power, right) = trace(12, 1);
        let found = misplaced(&power, &late(&right, 90), &[right[3]], ANCHOR, WIDTH);
        assert_eq!(found.len(), 1, "{found:?}");
        let off = right.iter().map(|start| start.abs_diff(found[0])).min();
        assert!(off <= Some(3), "{found:?}");
        assert!(misplaced(&power, &right, &[right[3]], ANCHOR, WIDTH).is_empty());
    }

    #[test]
    fn a_different_frame_gives_no_evidence() {
        let (mut power, starts) = trace(12, 1);
        let (other, _) = trace(12, 2);
        let from = starts[12] - 20;
        power[from..].copy_from_slice(&other[from..]);
        assert!(misplaced(&power, &late(&starts, 90), &[starts[3]], ANCHOR, WIDTH).is_empty());
    }

    #[test]
    fn few_starts_and_no_mark_among_them_are_taken() {
        let (power, starts) = trace(3, 1);
        assert!(misplaced(&power, &starts[..1], &starts[..1], ANCHOR, WIDTH).is_empty());
        assert!(misplaced(&power, &[], &[], ANCHOR, WIDTH).is_empty());
        assert!(misplaced(&power, &starts, &[1], ANCHOR, WIDTH).is_empty());
    }
}
