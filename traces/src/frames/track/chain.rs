//! The best sequence of starts, by dynamic programming over pairs of neighbours (Bellman 1957).

use super::Candidate;
use super::phase_slip::slip;
use super::templates::Templates;

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
}
