//! The threshold that separates starts from other minima, chosen from the minima themselves, with its reason
//! as data.

use crate::stats::{Moments, moments};
use rayon::prelude::*;
use serde::Serialize;

/// Excess distances below this share of the background count as equal: how well a good match matches means
/// nothing.
const MIN_EXCESS_SHARE: f64 = 3e-3;
/// So do those below this share of the noise: windows of a few hundred samples of it differ by about as much.
const MIN_NOISE_SHARE: f64 = 0.3;
/// Least separation of two distinct populations. Halves of one normal population reach 1.3, of a uniform one
/// 1.7.
pub(super) const MIN_SEPARATION: f64 = 2.0;
/// Least regularity of a spacing that supports the starts; idle time before the first and after the last
/// counts against it.
const MIN_REGULARITY: f64 = 0.8;
/// A match leaves less than this share of the background's excess distance.
const MAX_MATCH_SHARE: f64 = 0.5;
/// From this many matches on their spacing means more than their similarity, which clock steps and new
/// content lower.
const MIN_SPACED_MATCHES: usize = 8;
/// Least deviation of logarithms within a population in tests of distinctness.
const MIN_LOG_DEVIATION: f64 = 0.15;
/// How often sides are split again.
const MAX_SPLIT_DEPTH: usize = 3;
/// Regularity that a further split must add to be preferred to the first one.
const MIN_REGULARITY_GAIN: f64 = 0.05;
/// A single population below this share of the background consists of matches.
const MAX_SINGLE_SHARE: f64 = 0.1;
/// Limit in place of [`MAX_MATCH_SHARE`] for few, unevenly spaced matches: a steady part of a frame is nearer
/// to a busy window than idle power is, without being a match.
const MAX_FEW_MATCH_SHARE: f64 = 0.2;

/// How the threshold was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Rule {
    /// The split of the logarithms with the greatest variance between its sides (Otsu 1979).
    Otsu,
    /// Of the splits of these two sides, and of theirs, the one that makes the starts most evenly spaced:
    /// minima can form more than two populations (starts, look-alikes within the frame, idle).
    OtsuRegular,
    /// Of the same splits, the one whose sides are most distinct: with few frames the spacing says little,
    /// and matches among many other minima are too few to sway Otsu's criterion.
    OtsuDistinct,
    /// The minima form one population far below the background: all are frame starts.
    AllMatch,
    /// No minimum is distinctly below the background: only the marks are kept.
    NoneMatch,
    /// There was no minimum besides the marks.
    NoCandidates,
    /// Tracking has none: it takes the sequence of starts that has the most evidence as a whole.
    Sequence,
}

/// One side of the threshold.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Population {
    /// How many minima.
    pub count: usize,
    /// Geometric mean of their excess distances, W^2 (of those above: up to the next split).
    pub mean_w2: f64,
}

/// The threshold and why it lies where it does.
///
/// Noise adds the same to the distance of a match and of anything else, so minima are compared by their **excess**
/// distance, that beyond `noise_w2`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Threshold {
    /// Minima below this summed squared difference (noise included) are frame starts, W^2.
    pub value_w2: f64,
    /// How it was found.
    pub rule: Rule,
    /// The minima below (the marks themselves left out).
    pub matched: Population,
    /// The minima above.
    pub rest: Population,
    /// Median excess distance over all offsets, W^2: what no match at all looks like.
    pub background_w2: f64,
    /// Distance of a perfect match in sensor noise, W^2: `2 m sigma^2`, or the lowest minimum if that is
    /// less.
    pub noise_w2: f64,
    /// Distance of a match half a sample off, W^2: starts fall between samples, and steep edges make it
    /// large.
    pub alignment_w2: f64,
    /// Difference of the populations' mean logarithms over the sum of their standard deviations; above 2 is
    /// clear.
    pub separation: f64,
    /// Share of the trace, from the first to the last minimum, that the starts divide evenly (gaps of 0.6 to
    /// 1.6 median gaps); 0 for fewer than four gaps. Evidence of its own where the separation is weak.
    pub regularity: f64,
}

impl Threshold {
    /// Whether starts and the rest are clearly separated: by distance, or else by the even spacing of the
    /// starts.
    pub(super) fn clarity(&self) -> f64 {
        (self.separation / MIN_SEPARATION).max(self.regularity / MIN_REGULARITY).clamp(0.0, 1.0)
    }

    /// The part of a distance that noise does not explain, W^2; at least the smallest difference that counts.
    pub(super) fn excess_w2(&self, distance_w2: f64) -> f64 {
        let floor_w2 = (MIN_EXCESS_SHARE * self.background_w2).max(MIN_NOISE_SHARE * self.noise_w2);
        let floor_w2 =
            floor_w2.max(self.alignment_w2.min(MAX_SINGLE_SHARE * self.background_w2)).max(f64::MIN_POSITIVE);
        (distance_w2 - self.noise_w2).max(floor_w2)
    }

    /// The threshold that lets nothing in, where there is no candidate.
    pub(crate) fn none() -> Self {
        nothing(&[], 0.0, 0.0)
    }
}

/// Chooses the threshold. `distances` are those of the spaced minima, the marks left out; `background_w2` is
/// the median distance over all offsets, `noise_w2` what the trace's noise is estimated to leave of a perfect
/// match, `alignment_w2` what half a sample of misalignment does, `regularity` how evenly (0 to 1) the starts
/// below a threshold are spaced.
pub(crate) fn choose(
    distances: &[f64],
    background_w2: f64,
    noise_w2: f64,
    alignment_w2: f64,
    regularity: impl Fn(f64) -> f64 + Sync,
) -> Threshold {
    let none = Threshold { alignment_w2, ..nothing(distances, background_w2, noise_w2) };
    let log = |distance_w2: &f64| libm::log(none.excess_w2(*distance_w2));
    let mut logs: Vec<f64> = distances.par_iter().map(log).collect();
    // What is equal by this order is the same to the bit.
    logs.par_sort_unstable_by(f64::total_cmp);
    let between =
        |split: &Split| none.noise_w2 + libm::exp(0.5 * (logs[split.count - 1] + logs[split.count]));
    let splits = otsu_tree(&logs, MAX_SPLIT_DEPTH);
    // Minima are evenly spaced by construction, so a threshold that lets in what is no match would win by
    // that. The first split stands on Otsu's criterion alone and is spared.
    let matching = |split: &Split| between(split) - none.noise_w2 < MAX_MATCH_SHARE * none.background_w2;
    let regular = most_regular(&splits, matching, |split| regularity(between(split)));
    let even = splits.get(regular).is_some_and(|split| {
        split.count >= MIN_SPACED_MATCHES || regularity(between(split)) >= MIN_REGULARITY
    });
    let surely = |split: &Split| libm::exp(split.low.mean) < MAX_FEW_MATCH_SHARE * none.background_w2;
    let best = if even { regular } else { most_distinct(&splits, regular, surely) };
    let chosen = match (splits.get(best), logs.last()) {
        (Some(split), _) if !even && best == regular && !surely(split) => none_similar(&logs, none),
        (Some(split), _) => {
            let rule = match best {
                0 => Rule::Otsu,
                _ if best == regular => Rule::OtsuRegular,
                _ => Rule::OtsuDistinct,
            };
            judge(split, &logs, Threshold { value_w2: between(split), rule, ..none })
        }
        (None, Some(&log)) if libm::exp(log) < MAX_SINGLE_SHARE * none.background_w2 => {
            all_similar(&logs, none)
        }
        (None, Some(_)) => none_similar(&logs, none),
        (None, None) => none,
    };
    Threshold { regularity: regularity(chosen.value_w2), ..chosen }
}

/// The threshold that lets nothing in, with what is known before any minimum is judged.
fn nothing(distances: &[f64], background_w2: f64, noise_w2: f64) -> Threshold {
    let lowest = distances.iter().copied().fold(f64::INFINITY, f64::min);
    let noise_w2 = noise_w2.min(lowest);
    Threshold {
        value_w2: 0.0,
        rule: Rule::NoCandidates,
        matched: Population::default(),
        rest: Population::default(),
        background_w2: (background_w2 - noise_w2).max(0.0),
        noise_w2,
        alignment_w2: 0.0,
        separation: 0.0,
        regularity: 0.0,
    }
}

/// The first split, unless another eligible one makes the spacing distinctly more regular.
fn most_regular(
    splits: &[Split],
    eligible: impl Fn(&Split) -> bool + Sync,
    regularity: impl Fn(&Split) -> f64 + Sync,
) -> usize {
    let judged = |(index, split): (usize, &Split)| (index == 0 || eligible(split)).then(|| regularity(split));
    let regular: Vec<Option<f64>> = splits.par_iter().enumerate().map(judged).collect();
    let mut best = (0, regular.first().copied().flatten().unwrap_or(0.0) + MIN_REGULARITY_GAIN);
    for (index, regular) in regular.into_iter().enumerate().skip(1) {
        if let Some(regular) = regular.filter(|regular| *regular > best.1) {
            best = (index, regular);
        }
    }
    best.0
}

/// The split `otherwise`, unless it is not distinct and another eligible one is, more than any else.
fn most_distinct(splits: &[Split], otherwise: usize, eligible: impl Fn(&Split) -> bool) -> usize {
    let mut best = (otherwise, splits.get(otherwise).map_or(0.0, distinctness).max(MIN_SEPARATION));
    for (index, split) in splits.iter().enumerate().filter(|(_, split)| eligible(split)) {
        if distinctness(split) > best.1 {
            best = (index, distinctness(split));
        }
    }
    best.0
}

/// The separation of two sides whose distances vary by some share at least, so that frames that repeat to the
/// last bit do not come apart by where they fall between samples.
fn distinctness(split: &Split) -> f64 {
    let deviation = |side: &Moments| side.deviation.max(MIN_LOG_DEVIATION);
    ratio(split.high.mean - split.low.mean, deviation(&split.low) + deviation(&split.high))
}

/// Difference of the mean logarithms of the two sides over the sum of their standard deviations.
fn separation(split: &Split) -> f64 {
    ratio(split.high.mean - split.low.mean, split.low.deviation + split.high.deviation)
}

/// Whether a split separates matches from the rest.
fn judge(split: &Split, logs: &[f64], chosen: Threshold) -> Threshold {
    let [matched_w2, rest_w2] = [split.low.mean, split.high.mean].map(libm::exp);
    let separation = separation(split);
    if chosen.rule == Rule::Otsu
        && separation < MIN_SEPARATION
        && rest_w2 < MAX_SINGLE_SHARE * chosen.background_w2
    {
        return all_similar(logs, chosen);
    }
    if matched_w2 > MAX_MATCH_SHARE * chosen.background_w2 {
        return none_similar(logs, chosen);
    }
    Threshold {
        matched: Population { count: split.count, mean_w2: matched_w2 },
        rest: Population { count: logs.len() - split.count, mean_w2: rest_w2 },
        separation,
        ..chosen
    }
}

fn all_similar(logs: &[f64], none: Threshold) -> Threshold {
    let all = moments(logs);
    let highest = logs.last().copied().unwrap_or(0.0);
    let background = libm::log(none.background_w2);
    Threshold {
        value_w2: none.noise_w2 + libm::exp(0.5 * (highest + background)),
        rule: Rule::AllMatch,
        matched: Population { count: logs.len(), mean_w2: libm::exp(all.mean) },
        rest: Population { count: 0, mean_w2: none.background_w2 },
        separation: ratio(background - all.mean, all.deviation),
        ..none
    }
}

fn none_similar(logs: &[f64], none: Threshold) -> Threshold {
    let rest = Population { count: logs.len(), mean_w2: libm::exp(moments(logs).mean) };
    Threshold { value_w2: 0.0, rule: Rule::NoneMatch, rest, ..none }
}

/// A ratio that stays finite, so that it can be written to JSON.
fn ratio(difference: f64, spread: f64) -> f64 {
    f64::min(difference / spread.max(1e-3), 1e3)
}

/// Sorted numbers cut in two.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Split {
    /// How many of all the numbers lie below.
    pub count: usize,
    /// All numbers below.
    pub low: Moments,
    /// The numbers above, up to the next higher split this one was made within.
    pub high: Moments,
}

/// The split of all numbers, then of its two sides, and so on to `depth` levels, level by level. Values must
/// be sorted; where they are all the same there is no split.
pub(super) fn otsu_tree(sorted: &[f64], depth: usize) -> Vec<Split> {
    let mut ranges = vec![(0, sorted.len())];
    let mut splits = Vec::new();
    let split = |&(from, to): &(usize, usize)| {
        let count = from + otsu(&sorted[from..to])?;
        let (low, high) = rayon::join(|| moments(&sorted[..count]), || moments(&sorted[count..to]));
        Some(([(from, count), (count, to)], Split { count, low, high }))
    };
    for _ in 0..depth {
        let (sides, level): (Vec<_>, Vec<Split>) = ranges.par_iter().filter_map(split).unzip();
        splits.extend(level);
        ranges = sides.into_flattened();
    }
    splits
}

/// How many numbers lie below the cut with the greatest variance between its sides (Otsu 1979, eq. 14), tried
/// at every gap; `None` if they are all the same.
fn otsu(sorted: &[f64]) -> Option<usize> {
    let total: f64 = sorted.iter().sum();
    let (mut below, mut best) = (0.0, (0.0, None));
    for (index, pair) in sorted.windows(2).enumerate() {
        below += pair[0];
        let counts = [(index + 1) as f64, (sorted.len() - index - 1) as f64];
        let apart = below / counts[0] - (total - below) / counts[1];
        let between = counts[0] * counts[1] * apart * apart;
        if pair[0] < pair[1] && between > best.0 {
            best = (between, Some(index + 1));
        }
    }
    best.1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_clear_populations_are_split_between_them() {
        let distances: Vec<f64> =
            (0..20).map(|i| 0.5 + 0.01 * f64::from(i)).chain((0..90).map(|i| 50.0 + f64::from(i))).collect();
        let threshold = choose(&distances, 100.0, 0.4, 0.0, |_| 1.0);
        assert_eq!((threshold.rule, threshold.matched.count, threshold.rest.count), (Rule::Otsu, 20, 90));
        assert!(threshold.value_w2 > 0.7 && threshold.value_w2 < 50.0 && threshold.separation > 5.0);
    }

    #[test]
    fn a_few_matches_are_distinguished_from_similar_windows_by_distance() {
        // A run of four equal frames: three matches, segments within frames that resemble the marked window a
        // little, and the rest. A threshold among the look-alikes happens to space the starts a little more
        // evenly.
        let look_alikes =
            [143.4, 143.44, 143.99].into_iter().chain((0..30).map(|i| 144.86 + 0.001 * f64::from(i)));
        let rest = (0..35).map(|i| 700.0 + 20.0 * f64::from(i));
        let distances: Vec<f64> = [6.27, 7.25, 7.28].into_iter().chain(look_alikes).chain(rest).collect();
        let evenness = |value_w2: f64| if (144.0..144.8).contains(&value_w2) { 0.07 } else { 0.0 };
        assert_eq!(choose(&distances, 713.0, 0.003, 5.0, evenness).matched.count, 3);
    }

    #[test]
    fn a_lone_frame_resembles_nothing_else() {
        // One frame in a trace of idle: two segments within it are nearer to its start than idle is.
        let distances: Vec<f64> =
            [121.9, 127.2].into_iter().chain((0..66).map(|i| 342.0 + 0.02 * f64::from(i))).collect();
        assert_eq!(choose(&distances, 343.0, 0.002, 5.0, |_| 0.0).rule, Rule::NoneMatch);
    }

    #[test]
    fn frames_that_repeat_to_the_last_bit_stay_together() {
        // Starts fall on thirds of a sample, so matches come in two groups of equal distances.
        let distances: Vec<f64> =
            [6.27, 7.25, 7.28, 6.27, 7.25].into_iter().chain((0..60).map(|i| 400.0 + f64::from(i))).collect();
        assert_eq!(choose(&distances, 713.0, 0.003, 5.0, |_| 0.1).matched.count, 5);
    }

    #[test]
    fn one_low_population_is_all_frames_and_one_high_population_is_none() {
        let spread = |centre: f64| (0..50).map(move |i| centre * (1.0 + 0.01 * f64::from(i)));
        let low = choose(&spread(1.0).collect::<Vec<_>>(), 100.0, 0.5, 0.0, |_| 1.0);
        assert_eq!((low.rule, low.matched.count), (Rule::AllMatch, 50));
        assert!(low.value_w2 > 1.5);
        let high = choose(&spread(80.0).collect::<Vec<_>>(), 100.0, 0.5, 0.0, |_| 1.0);
        assert_eq!((high.rule, high.value_w2), (Rule::NoneMatch, 0.0));
        assert_eq!(choose(&[], 100.0, 0.5, 0.0, |_| 1.0).rule, Rule::NoCandidates);
        assert_eq!(choose(&[1.0, 1.0], 100.0, 0.5, 0.0, |_| 1.0).rule, Rule::AllMatch);
        assert_eq!(choose(&[99.0, 99.0], 100.0, 0.5, 0.0, |_| 1.0).rule, Rule::NoneMatch);
    }

    #[test]
    fn three_populations_come_apart_in_two_levels() {
        let mut values: Vec<f64> =
            [0.0, 5.0, 6.0].iter().flat_map(|c| (0..10).map(move |i| c + 0.01 * f64::from(i))).collect();
        values.sort_by(f64::total_cmp);
        let counts: Vec<usize> = otsu_tree(&values, 2).iter().map(|split| split.count).collect();
        assert_eq!(counts[0], 10);
        assert!(counts.contains(&20));
        assert!(otsu_tree(&[1.0; 5], 3).is_empty() && otsu_tree(&[], 3).is_empty());
    }
}
