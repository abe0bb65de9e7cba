//! Tracking: following the frames outwards from the mark.
//!
//! The appearance of a frame start changes slowly, so it is learnt where it is known: from the frames around
//! the mark. In rounds the considered part of the trace doubles; in each round
//!
//! 1. candidates are the local minima of the distance to the nearest template, by shape and by summed squares;
//! 2. the weight of a distance is learnt from the starts found so far and from the samples between them
//!    ([`evidence`]);
//! 3. the best sequence is found by dynamic programming over pairs of candidates ([`chain`]): near to a
//!    template, similar to the one before, and at an even period that may jump now and then;
//! 4. starts that their neighbours resemble more than any template does become templates ([`evidence`]).
//!
//! Frames at another clock than the mark's are searched again. Templates follow content that changes slowly.
//! At a clock step everything changes at once, and the sequence may go on at the same period in another phase
//! of the frame. So where neighbours differ, frames of both sides are aligned over a whole period, the
//! earlier ones [scaled in time](crate::frames::subsample). Outwards from the mark, each segment between two
//! such changes is compared with the last one known to be right. If it lies elsewhere, one of its frames is
//! corrected and used like a mark.

mod chain;
mod evidence;

use super::marks::Placement;
use super::profile::spaced_minima;
use crate::frames::subsample::{ScaledFit, ScaledSearch};
use crate::stats::upper_median;
use chain::{Chain, Graph};
use evidence::{Evidence, FEATURES, Label, Templates};

/// First-guess periods around a mark that the first round searches.
const FIRST_PERIODS: usize = 12;
/// Rounds after the whole trace has been reached.
const LAST_ROUNDS: usize = 3;
/// How often segments in another phase of the frame are corrected.
const MAX_PASSES: usize = 4;
/// Candidates kept per period.
const MAX_PER_PERIOD: usize = 10;
/// Candidates nearer than this, in samples, are one; none is so near to a mark.
const MIN_DISTANCE_SAMPLES: usize = 3;
/// If the sequence covers less than this share of what candidates do, pauses left out, power levels have
/// changed.
const MIN_COVERAGE: f64 = 0.75;

/// The tracked sequence.
#[derive(Debug)]
pub(super) struct Tracked {
    /// Offsets of the windows of the starts, in order.
    pub starts: Vec<Start>,
}

/// One start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Start {
    /// First sample of its window.
    pub offset: usize,
    /// Least weighted difference of the window to a template, W^2.
    pub distance_w2: f64,
    /// Whether the evidence is for it, 0 to 1.
    pub confidence: f64,
    /// Factor of the confidence, 0 to 1, as the sequence may have slipped between it and the mark.
    pub confidence_factor: f64,
}

/// A local minimum of the distance to the templates.
#[derive(Clone, Copy, Debug)]
struct Candidate {
    offset: usize,
    features: [f64; FEATURES],
    weight: f64,
}

/// Finds the sequence of starts that fits the marked ones.
pub(super) fn track(power: &[f64], placement: &Placement, with_clocks: bool) -> Tracked {
    let marks: Vec<usize> = placement.marks.iter().map(|mark| mark.first).collect();
    let anchor = placement.marks.first().map_or(0, |mark| libm::round(mark.anchor) as usize);
    let mut known = marks.clone();
    for _ in 0..MAX_PASSES {
        let tracker = Tracker::new(power, placement.samples, anchor, &known).run();
        let misplaced = match with_clocks {
            true => misplaced(power, &tracker.starts(), &known, anchor, placement.samples),
            false => Vec::new(),
        };
        if misplaced.is_empty() {
            return tracker.conclude(&marks);
        }
        known.extend(misplaced);
        known.sort_unstable();
    }
    Tracker::new(power, placement.samples, anchor, &known).run().conclude(&marks)
}

/// The state between rounds.
struct Tracker {
    templates: Templates,
    marks: Vec<usize>,
    spacing: usize,
    period: usize,
    /// No longer, or neighbouring marks would be too near to each other for a sequence to have both.
    longest: usize,
    reach: usize,
    candidates: Vec<Candidate>,
    evidence: Evidence,
    chain: Chain,
    /// Once power levels have changed, the sum of squares says nothing more, and shape less.
    levels_changed: bool,
}

impl Tracker {
    fn new(power: &[f64], width: usize, anchor: usize, marks: &[usize]) -> Self {
        let templates = Templates::new(power, width, anchor, marks);
        let (period, starts) = evidence::first(&templates, (width / 2).max(1), marks);
        let longest = chain::longest(marks);
        let period = period.min(longest);
        let mut tracker = Self {
            templates,
            marks: marks.to_vec(),
            spacing: (width / 8).max(2),
            period,
            longest,
            reach: FIRST_PERIODS * period,
            candidates: Vec::new(),
            evidence: Evidence::default(),
            chain: Chain::default(),
            levels_changed: false,
        };
        tracker.relearn(&starts);
        tracker
    }

    /// Rounds until the whole trace has been reached, and some more.
    fn run(mut self) -> Self {
        let mut rounds_left = LAST_ROUNDS;
        loop {
            self.solve();
            if self.reach >= self.templates.shape.len() {
                if rounds_left == 0 {
                    return self;
                }
                rounds_left -= 1;
            }
            self.learn();
            self.reach *= 2;
        }
    }

    /// The best sequence within reach.
    fn solve(&mut self) {
        self.candidates = self.collect();
        for candidate in &mut self.candidates {
            candidate.weight = self.evidence.weight(candidate, &self.marks);
        }
        self.prune();
        self.chain = Graph::new(&self.templates, &self.candidates, self.period).best();
        let starts = self.starts();
        self.period = evidence::median_gap(&starts).unwrap_or(self.period).min(self.longest);
        let all: Vec<usize> = self.candidates.iter().map(|candidate| candidate.offset).collect();
        let covered = |offsets: &[usize]| chain::covered(offsets, self.period) as f64;
        self.levels_changed |= covered(&starts) < MIN_COVERAGE * covered(&all);
    }

    /// New templates, and what distances mean, from the sequence found.
    fn learn(&mut self) {
        let starts = self.starts();
        self.templates.learn(&starts);
        self.relearn(&starts);
    }

    fn relearn(&mut self, starts: &[usize]) {
        let candidates = self.collect();
        let labels = self.labels(&candidates, starts);
        self.evidence = Evidence::learn(&candidates, &labels, self.levels_changed);
    }

    fn starts(&self) -> Vec<usize> {
        self.chain.nodes.iter().map(|&node| self.candidates[node].offset).collect()
    }

    /// The minima within reach of a mark, and the marks.
    fn collect(&self) -> Vec<Candidate> {
        let mut offsets = spaced_minima(&self.templates.shape, self.spacing);
        offsets.extend(spaced_minima(&self.templates.squares_w2, self.spacing));
        offsets.retain(|offset| {
            let nearest = self.marks.iter().map(|mark| mark.abs_diff(*offset)).min().unwrap_or(0);
            (self.spacing.max(MIN_DISTANCE_SAMPLES)..=self.reach).contains(&nearest)
        });
        offsets.extend(&self.marks);
        offsets.sort_unstable();
        offsets.dedup_by(|later, earlier| *later - *earlier < MIN_DISTANCE_SAMPLES);
        let candidate = |offset| Candidate { offset, features: self.templates.features(offset), weight: 0.0 };
        offsets.into_iter().map(candidate).collect()
    }

    /// Starts are examples of starts, what is well away from them of the rest. What is beside them, or what a
    /// template was made of, is an example of neither.
    fn labels(&self, candidates: &[Candidate], starts: &[usize]) -> Vec<Label> {
        let mut labels = vec![Label::Rest; candidates.len()];
        for &start in starts {
            let from = candidates.partition_point(|candidate| candidate.offset + 2 * self.spacing <= start);
            let to = candidates.partition_point(|candidate| candidate.offset < start + 2 * self.spacing);
            labels[from..to].fill(Label::Neither);
            let away = |index: &usize| candidates[*index].offset.abs_diff(start);
            let nearest = (from..to).min_by_key(away).filter(|index| away(index) < self.spacing);
            if let Some(index) = nearest.filter(|_| !self.templates.own.contains(&start)) {
                labels[index] = Label::Start;
            }
        }
        labels
    }

    /// Keeps the likeliest candidates of every segment of a period, and the marks, which weigh most.
    fn prune(&mut self) {
        let period = self.period.max(1);
        let mut kept = Vec::with_capacity(self.candidates.len());
        for segment in self.candidates.chunk_by(|a, b| a.offset / period == b.offset / period) {
            let mut segment = segment.to_vec();
            segment.sort_by(|a, b| b.weight.total_cmp(&a.weight));
            segment.truncate(MAX_PER_PERIOD);
            segment.sort_by_key(|candidate| candidate.offset);
            kept.extend(segment);
        }
        self.candidates = kept;
    }

    /// The sequence; of `marks` everything is sure.
    fn conclude(self, marks: &[usize]) -> Tracked {
        let factors = chain::confidence_factors(&self.starts(), marks, &self.marks);
        let start = |((&node, &support), factor): ((&usize, &f64), f64)| {
            let offset = self.candidates[node].offset;
            let marked = marks.contains(&offset);
            let confidence = if marked { 1.0 } else { 1.0 / (1.0 + libm::exp(-support)) };
            let confidence_factor = if marked { 1.0 } else { factor };
            Start { offset, distance_w2: self.templates.squares_w2[offset], confidence, confidence_factor }
        };
        let starts = self.chain.nodes.iter().zip(&self.chain.support).zip(factors).map(start).collect();
        Tracked { starts }
    }
}

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
fn misplaced(power: &[f64], starts: &[usize], marks: &[usize], anchor: usize, width: usize) -> Vec<usize> {
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
        let [before, after] = [BEFORE_SHARE, BEGINNING_SHARE].map(|share| self.share(share));
        let search = ScaledSearch::new(before, after, self.share(0.12));
        let remainder = |index: usize| {
            let fit = search.unscaled(self.power, self.places([index, index + 1], 0));
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
        let (before, places) = (self.share(BEFORE_SHARE), self.places([from, to], moved));
        let best = |reach: usize| ScaledSearch::new(before, after, reach).best(self.power, places);
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

    /// Where the beginnings of two frames are, the first of them moved.
    fn places(&self, starts: [usize; 2], moved: isize) -> [usize; 2] {
        let place =
            |start: usize| self.starts.get(start).map_or(usize::MAX / 2, |offset| offset + self.anchor);
        [place(starts[0]).saturating_add_signed(moved), place(starts[1])]
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
    use crate::stats::Random;

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
