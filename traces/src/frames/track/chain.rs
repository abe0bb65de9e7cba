//! The best sequence of starts, by dynamic programming over pairs of neighbours (Bellman 1957). Past a place
//! where it may have slipped to another phase of the frame, confidence is lower.

use super::Candidate;
use super::evidence::Templates;
use crate::frames::SLIPPED_CONFIDENCE;

/// Least and greatest distance of neighbours, in periods. A greater distance begins a new segment.
const GAP_LIMITS: [f64; 2] = [0.45, 2.3];
/// Evidence for a gap as long as the one before, in nats per period.
const EVEN_GAIN: f64 = 3.0;
/// Change of a gap, in logarithm, that costs a nat.
const GAP_CHANGE_PER_NAT: f64 = 0.04;
/// Evidence of a jump of the gap, in nats, however far: clock steps, missed ticks.
const MIN_GAP_EVIDENCE: f64 = -3.5;
/// Additional cost of returning to the period after one odd gap, in nats: it would be another phase of the
/// same frames.
const SLIP_COST: f64 = 4.0;
/// Cost of a new segment, in nats.
const BREAK_COST: f64 = 12.0;
/// Least and greatest evidence of the similarity of neighbours, in nats: strong against, hardly any for, as
/// any phase of the frame is similar to itself.
const SIMILARITY_LIMITS: [f64; 2] = [-4.0, 0.5];
/// Candidates of at least this weight show how similar neighbours are.
const MIN_SURE_WEIGHT: f64 = 2.0;
/// Stands for no predecessor.
const NONE: usize = usize::MAX;

/// A sequence of candidates.
#[derive(Clone, Debug, Default)]
pub(super) struct Chain {
    /// Indices of candidates, in order.
    pub nodes: Vec<usize>,
    /// The evidence for each, nats.
    pub support: Vec<f64>,
}

/// All pairs of candidates that may be neighbours, grouped by the later one.
pub(super) struct Graph<'a> {
    candidates: &'a [Candidate],
    least: usize,
    /// The median distance of starts so far.
    period: f64,
    /// The earliest that may come before each.
    before: Vec<usize>,
    /// First pair of each candidate; one more than there are candidates.
    first: Vec<usize>,
    /// Evidence of the similarity of each pair, nats.
    similarity: Vec<f64>,
}

/// Best scores.
struct Solution {
    /// Best score of the sequences that end in each pair.
    score: Vec<f64>,
    /// The pair before it, or none where a segment begins.
    back: Vec<usize>,
    /// The candidate that each pair begins with.
    begin: Vec<usize>,
    /// The last pair of the segment before the one that begins with each candidate.
    entry: Vec<usize>,
    last: usize,
}

/// The longest period by which marks that are neighbours, in order, are in reach of each other.
pub(super) fn longest(marks: &[usize]) -> usize {
    let mut marks = marks.to_vec();
    marks.sort_unstable();
    let gaps = marks.windows(2).map(|two| two[1] - two[0]);
    gaps.filter(|gap| *gap > 0).min().map_or(usize::MAX, |gap| (gap as f64 / GAP_LIMITS[0]) as usize)
}

impl<'a> Graph<'a> {
    pub fn new(templates: &Templates, candidates: &'a [Candidate], period: usize) -> Self {
        let [least, most] = GAP_LIMITS.map(|share| (share * period as f64) as usize);
        let least = least.max(1);
        let (mut first, mut before) = (vec![0], Vec::with_capacity(candidates.len()));
        let (mut from, mut to) = (0, 0);
        for candidate in candidates {
            while candidates[from].offset + most < candidate.offset {
                from += 1;
            }
            while candidates[to].offset + least <= candidate.offset {
                to += 1;
            }
            before.push(from);
            first.push(first[first.len() - 1] + to.saturating_sub(from));
        }
        let mut graph =
            Self { candidates, least, period: period as f64, before, first, similarity: Vec::new() };
        graph.similarity = graph.similarities(templates);
        graph
    }

    /// The pairs that end in a candidate, each with the candidate it begins with.
    fn pairs(&self, end: usize) -> impl Iterator<Item = (usize, usize)> + '_ {
        (self.first[end]..self.first[end + 1]).zip(self.before[end]..)
    }

    fn gap(&self, begin: usize, end: usize) -> f64 {
        (self.candidates[end].offset - self.candidates[begin].offset) as f64
    }

    /// The evidence of similarity: how that of a pair compares with that of two sure starts and of a sure
    /// start with anything else.
    fn similarities(&self, templates: &Templates) -> Vec<f64> {
        let (mut logs, mut sums) = (vec![0.0; self.first[self.candidates.len()]], [[0.0_f64; 3]; 2]);
        for (end, candidate) in self.candidates.iter().enumerate() {
            for (pair, begin) in self.pairs(end) {
                let other = &self.candidates[begin];
                let log = libm::log((1.0 - templates.similarity(other.offset, candidate.offset)).max(1e-4));
                logs[pair] = log;
                if other.weight > MIN_SURE_WEIGHT {
                    let sum = &mut sums[usize::from(candidate.weight > MIN_SURE_WEIGHT)];
                    *sum = [sum[0] + 1.0, sum[1] + log, sum[2] + log * log];
                }
            }
        }
        let moments = |[count, sum, squares]: [f64; 3]| {
            let mean = sum / count.max(1.0);
            (mean, (squares / count.max(1.0) - mean * mean).max(0.01))
        };
        let [(rest, rest_variance), (starts, variance)] = sums.map(moments);
        let slope = (2.0 * (starts - rest) / (variance + rest_variance)).min(0.0);
        let evidence = |log: f64| {
            (slope * (log - 0.5 * (starts + rest))).clamp(SIMILARITY_LIMITS[0], SIMILARITY_LIMITS[1])
        };
        logs.into_iter().map(evidence).collect()
    }

    /// The sequence with the most evidence.
    pub fn best(&self) -> Chain {
        let solution = self.solve();
        let mut nodes = Vec::new();
        let mut support: Vec<f64> = Vec::new();
        let mut pair = solution.last;
        let mut behind = None;
        while pair != NONE {
            // The end of a pair: the pairs of each candidate follow those of the one before.
            let end = self.first.partition_point(|&first| first <= pair) - 1;
            let begin = self.before[end] + pair - self.first[end];
            nodes.push(end);
            support.push(self.candidates[end].weight + self.similarity[pair] + behind.unwrap_or(0.0));
            behind = Some(self.similarity[pair]);
            if solution.back[pair] == NONE {
                nodes.push(begin);
                support.push(self.candidates[begin].weight + self.similarity[pair]);
                (pair, behind) = (solution.entry[begin], None);
            } else {
                pair = solution.back[pair];
            }
        }
        nodes.reverse();
        support.reverse();
        self.or_alone(Chain { nodes, support })
    }

    /// If no candidate follows another, the candidates of overwhelming weight.
    fn or_alone(&self, chain: Chain) -> Chain {
        if !chain.nodes.is_empty() {
            return chain;
        }
        let alone = (0..self.candidates.len()).filter(|&node| self.candidates[node].weight > 100.0);
        let nodes: Vec<usize> = alone.collect();
        Chain { support: nodes.iter().map(|&node| self.candidates[node].weight).collect(), nodes }
    }

    fn solve(&self) -> Solution {
        let total = self.similarity.len();
        let mut solution = Solution {
            score: vec![0.0; total],
            back: vec![NONE; total],
            begin: vec![0; total],
            entry: Vec::new(),
            last: NONE,
        };
        // The best of all sequences that end before each candidate.
        let mut ended = vec![(0.0, NONE)];
        let mut until = 0;
        for (end, candidate) in self.candidates.iter().enumerate() {
            while self.candidates[until].offset + self.least <= candidate.offset {
                until += 1;
            }
            let begins =
                Some(ended[until]).filter(|(score, _)| *score > BREAK_COST).unwrap_or((BREAK_COST, NONE));
            solution.entry.push(begins.1);
            let mut best = ended[end];
            for (pair, begin) in self.pairs(end) {
                solution.begin[pair] = begin;
                let (value, from) = self.extend(&solution, begin, end);
                solution.score[pair] = value + self.similarity[pair] + candidate.weight;
                solution.back[pair] = from;
                if solution.score[pair] > best.0 {
                    best = (solution.score[pair], pair);
                }
            }
            ended.push(best);
        }
        solution.last = ended[self.candidates.len()].1;
        solution
    }

    /// The best score of what comes before the pair `(begin, end)`, with `begin`, and the pair that ends in
    /// it.
    fn extend(&self, solution: &Solution, begin: usize, end: usize) -> (f64, usize) {
        let before = solution.score.get(solution.entry[begin]).map_or(0.0, |score| score - BREAK_COST);
        let mut best = (self.candidates[begin].weight + before, NONE);
        let gap = self.gap(begin, end);
        for (pair, earlier) in self.pairs(begin) {
            let between = self.gap(earlier, begin);
            let back = solution.back[pair];
            let slipped = back != NONE && slip(self.gap(solution.begin[back], earlier), between, gap);
            let value = solution.score[pair] + period_evidence(between, gap, self.period)
                - if slipped { SLIP_COST } else { 0.0 };
            if value > best.0 {
                best = (value, pair);
            }
        }
        best
    }
}

/// How many samples lie between neighbours that are no farther apart than those of one segment.
pub(super) fn covered(offsets: &[usize], period: usize) -> usize {
    let most = GAP_LIMITS[1] * period as f64;
    offsets.windows(2).map(|pair| pair[1] - pair[0]).filter(|gap| *gap as f64 <= most).sum()
}

/// Evidence of a gap after the one before it, nats. An even period counts by the time it covers, up to a
/// period, so that split frames are not worth twice as much as whole ones.
fn period_evidence(before: f64, after: f64, period: f64) -> f64 {
    (EVEN_GAIN * (after / period).min(1.0) - libm::log(after / before).abs() / GAP_CHANGE_PER_NAT)
        .max(MIN_GAP_EVIDENCE)
}

/// Ratios of gaps of the same period.
const SAME_RATIOS: [f64; 2] = [0.92, 1.085];
/// Ratios of gaps beyond which the later one is odd.
const ODD_RATIOS: [f64; 2] = [0.887, 1.13];
/// Two gaps in one (a missed start) are no phase slip if they are as long as two, within this share.
const MAX_DOUBLE_DEVIATION: f64 = 0.1;

/// Whether the period goes on as before after one odd gap that is not two periods. A clock step would change
/// it for longer.
fn slip(before: f64, between: f64, after: f64) -> bool {
    let ratio = between / before;
    !within(ratio, ODD_RATIOS)
        && (ratio - 2.0).abs() > MAX_DOUBLE_DEVIATION
        && within(after / before, SAME_RATIOS)
}

/// Confidence factors of starts: lower by each slip between a start and the nearest `known` place, and if
/// that place is itself off the period of its neighbours, or was corrected beyond a slip from the nearest of
/// `marks`. A slip does not show which of its sides is in the right phase, so it counts on this side, too,
/// back to where the clock stepped, as the phase may have been lost there. Without marks all factors are 1.
pub(super) fn confidence_factors(offsets: &[usize], marks: &[usize], known: &[usize]) -> Vec<f64> {
    let sequence = GapSequence::new(offsets);
    let among = |places: &[usize]| -> Vec<usize> {
        places.iter().filter_map(|place| offsets.binary_search(place).ok()).collect()
    };
    let (marks, known) = (among(marks), among(known));
    let nearest = |places: &[usize], start: usize| places.iter().copied().min_by_key(|p| p.abs_diff(start));
    let uncertainty = |place: usize| {
        let beyond = nearest(&marks, place).is_some_and(|mark| {
            sequence.slips_between(place, mark) > 0 || sequence.may_have_been_lost(place, mark)
        });
        usize::from(off_period(&sequence.gaps, place)) + usize::from(beyond)
    };
    let of_start = |start: usize| {
        nearest(&known, start).map_or(1.0, |place| {
            let slips = sequence.slips_between(start, place) + uncertainty(place);
            let lost = slips == 0 && sequence.may_have_been_lost(start, place);
            libm::pow(SLIPPED_CONFIDENCE, (slips + usize::from(lost)) as f64)
        })
    };
    (0..offsets.len()).map(of_start).collect()
}

/// The gaps between starts, and the breaks of their period.
struct GapSequence {
    gaps: Vec<f64>,
    /// How many slips, and how many clock steps, lie before each start.
    slips: Vec<usize>,
    steps: Vec<usize>,
    /// Whether a slip lies between each two steps.
    slipped: Vec<bool>,
}

impl GapSequence {
    fn new(offsets: &[usize]) -> Self {
        let gaps: Vec<f64> = offsets.windows(2).map(|two| (two[1] - two[0]) as f64).collect();
        let count = |breaks: &dyn Fn(&[f64]) -> bool| -> Vec<usize> {
            let count = |count: &mut usize, index: usize| {
                *count += usize::from(gaps.get(..=index).is_some_and(breaks));
                Some(*count)
            };
            (0..offsets.len()).scan(0, count).collect()
        };
        let slips = count(&|gaps| slipped(gaps) || step_slipped(gaps));
        let steps = count(&|gaps| step(gaps).is_some());
        let mut slipped = vec![false; steps.last().map_or(0, |last| last + 1)];
        for start in 1..slips.len() {
            if slips[start] > slips[start - 1] {
                slipped[steps[start - 1]] = true;
                slipped[steps[start]] = true;
            }
        }
        Self { gaps, slips, steps, slipped }
    }

    fn slips_between(&self, a: usize, b: usize) -> usize {
        self.slips[a].abs_diff(self.slips[b])
    }

    /// Whether the clock stepped between a start and a place, and the sequence around the start slips.
    fn may_have_been_lost(&self, start: usize, place: usize) -> bool {
        self.steps[start] != self.steps[place] && self.slipped[self.steps[start]]
    }
}

/// The periods before and after the third last of these gaps, if the clock steps in it.
fn step(gaps: &[f64]) -> Option<[f64; 2]> {
    let same = |a: f64, b: f64| within(b / a, SAME_RATIOS);
    match *gaps {
        [.., a, b, _, c, d] if same(a, b) && same(c, d) && !same(b, c) && !whole(c / b) => Some([b, c]),
        _ => None,
    }
}

/// Whether the frame in which the clock steps is too short or too long for one frame of either period, and
/// for two.
fn step_slipped(gaps: &[f64]) -> bool {
    let Some([before, after]) = step(gaps) else { return false };
    let between = gaps[gaps.len() - 3];
    let (least, most) = (before.min(after), before.max(after));
    let outside =
        |frames: f64| !(ODD_RATIOS[0] * frames * least..ODD_RATIOS[1] * frames * most).contains(&between);
    outside(1.0) && outside(2.0)
}

/// Whether the last of these gaps resumes the period from before one odd gap, or two, in another phase.
fn slipped(gaps: &[f64]) -> bool {
    match *gaps {
        [.., before, between, after] if slip(before, between, after) => true,
        [.., before, one, two, after] => {
            let odd = |gap: f64| !within(gap / before, ODD_RATIOS);
            odd(one) && odd(two) && within(after / before, SAME_RATIOS) && !whole((one + two) / before)
        }
        _ => false,
    }
}

/// Whether a start lies between two starts of the same phase, but off the period: then either it or all
/// others are wrong.
fn off_period(gaps: &[f64], start: usize) -> bool {
    let Some(&[before, one, two, after]) = start.checked_sub(2).and_then(|from| gaps.get(from..from + 4))
    else {
        return false;
    };
    let odd = |gap: f64| !within(gap / before, ODD_RATIOS) && !whole(gap / before);
    within(after / before, SAME_RATIOS) && odd(one) && odd(two)
}

fn within(ratio: f64, [low, high]: [f64; 2]) -> bool {
    ratio > low && ratio < high
}

/// Whether a number of periods is whole.
fn whole(periods: f64) -> bool {
    (periods - libm::round(periods)).abs() < MAX_DOUBLE_DEVIATION
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_even_beat_of_halves_is_worth_no_more_than_one_of_wholes() {
        assert_eq!(period_evidence(100.0, 100.0, 100.0), EVEN_GAIN);
        assert_eq!(2.0 * period_evidence(50.0, 50.0, 100.0), EVEN_GAIN);
        assert_eq!(period_evidence(200.0, 200.0, 100.0), EVEN_GAIN);
        assert_eq!(period_evidence(100.0, 150.0, 100.0), MIN_GAP_EVIDENCE);
    }

    #[test]
    fn neighbouring_marks_are_in_reach_of_each_other() {
        assert_eq!((longest(&[]), longest(&[7]), longest(&[7, 7])), (usize::MAX, usize::MAX, usize::MAX));
        let period = longest(&[900, 100, 1400]);
        assert!((GAP_LIMITS[0] * period as f64) as usize <= 500 && period > 1100, "{period}");
    }

    #[test]
    fn pauses_are_not_covered() {
        assert_eq!(covered(&[0, 100, 200, 900, 1000], 100), 300);
        assert_eq!((covered(&[], 100), covered(&[5], 100)), (0, 0));
    }

    #[test]
    fn an_odd_gap_in_an_even_beat_is_a_slip_and_a_missed_start_or_a_clock_step_is_none() {
        assert!(slip(100.0, 140.0, 101.0) && slip(100.0, 60.0, 100.0));
        assert!(!slip(100.0, 200.0, 100.0) && !slip(100.0, 104.0, 100.0) && !slip(100.0, 120.0, 140.0));
    }

    #[test]
    fn a_frame_in_which_the_clock_steps_lasts_between_the_beats_or_is_a_slip() {
        let slipped =
            |before: f64, between: f64, after: f64| step_slipped(&[before, before, between, after, after]);
        assert!(slipped(144.0, 107.0, 187.0) && slipped(187.0, 240.0, 144.0));
        assert!(!slipped(144.0, 160.0, 187.0) && !slipped(187.0, 150.0, 144.0));
        // A start was missed where the clock stepped; a steady period is no slip, nor is a single start off
        // the period.
        assert!(!slipped(144.0, 330.0, 187.0) && !slipped(100.0, 60.0, 100.0));
        assert!(!step_slipped(&[100.0, 130.0, 70.0, 100.0, 100.0]));
        assert_eq!(
            confidence_factors(&[0, 144, 288, 395, 582, 769], &[0], &[0]),
            [1.0, 1.0, 1.0, 1.0, SLIPPED_CONFIDENCE, SLIPPED_CONFIDENCE]
        );
    }

    #[test]
    fn confidence_is_low_on_the_far_side_of_the_slip() {
        let offsets = [0, 100, 200, 300, 450, 550, 650];
        assert_eq!(
            confidence_factors(&offsets, &[100], &[100]),
            [1.0, 1.0, 1.0, 1.0, SLIPPED_CONFIDENCE, SLIPPED_CONFIDENCE, SLIPPED_CONFIDENCE]
        );
        assert_eq!(
            confidence_factors(&offsets, &[650], &[650]),
            [SLIPPED_CONFIDENCE, SLIPPED_CONFIDENCE, SLIPPED_CONFIDENCE, SLIPPED_CONFIDENCE, 1.0, 1.0, 1.0]
        );
        assert_eq!(confidence_factors(&offsets, &[], &[]), [1.0; 7]);
    }

    #[test]
    fn what_was_put_right_beyond_a_slip_is_no_surer_than_what_lies_there() {
        let offsets = [0, 100, 200, 300, 450, 550, 650];
        assert_eq!(confidence_factors(&offsets, &[100], &[100, 550])[5], SLIPPED_CONFIDENCE);
        assert_eq!(confidence_factors(&offsets, &[100], &[100, 300])[3], 1.0);
    }

    #[test]
    fn a_slip_lowers_confidence_on_this_side_of_it_back_to_the_last_clock_step() {
        // Periods of 100 at the mark, of 150 from 300 on, and a slip at 750.
        let offsets = [0, 100, 200, 300, 450, 600, 750, 830, 980, 1130];
        let left = confidence_factors(&offsets, &[0], &[0]);
        assert_eq!(left[..3], [1.0; 3]);
        assert!(left[5..].iter().all(|left| *left <= SLIPPED_CONFIDENCE), "{left:?}");
    }

    #[test]
    fn two_odd_gaps_that_change_the_phase_are_a_slip_and_a_misplaced_start_is_none() {
        assert!(slipped(&[100.0, 140.0, 130.0, 101.0]));
        assert!(!slipped(&[100.0, 130.0, 70.0, 100.0]) && !slipped(&[100.0, 120.0, 140.0, 140.0]));
    }

    #[test]
    fn a_mark_off_the_period_of_all_others_lowers_their_confidence() {
        let offsets = [0, 100, 200, 330, 400, 500, 600];
        assert!(confidence_factors(&offsets, &[330], &[330]).iter().all(|left| *left <= SLIPPED_CONFIDENCE));
        assert_eq!(confidence_factors(&offsets, &[200], &[200]), [1.0; 7]);
        let missed = [0, 100, 200, 400, 600, 700, 800];
        assert_eq!(confidence_factors(&missed, &[400], &[400]), [1.0; 7]);
    }
}
