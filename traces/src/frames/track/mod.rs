//! Tracking: following the frames outwards from the mark.
//!
//! The appearance of a frame start changes slowly, so it is learnt where it is known: from the frames around
//! the mark. In rounds the considered part of the trace doubles; in each round
//!
//! 1. candidates are the local minima of the distance to the nearest template, by shape and by summed squares;
//! 2. the weight of a distance is learnt from the starts found so far and from the samples between them ([`evidence`]);
//! 3. the best sequence is found by dynamic programming over pairs of candidates ([`chain`]): near to a template, similar to
//!    the one before, and at an even period that may jump now and then;
//! 4. starts that their neighbours resemble more than any template does become templates ([`evidence`]).

mod chain;
mod clocks;
mod evidence;

use super::marks::Placement;
use super::profile::spaced_minima;
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
            true => clocks::misplaced(power, &tracker.starts(), &known, anchor, placement.samples),
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
