//! What starts look like. The templates, and the distance to the nearest of them at every offset; the
//! evidence that it is for a candidate, by the linear discriminant of two normal populations, starts and
//! others (Fisher 1936); and before anything is learnt a first guess of the period and of some starts, from
//! the distances to the marked windows alone.

use super::Candidate;
use crate::frames::periodicity::regularity;
use crate::frames::profile::{Correlator, spaced_minima};
use crate::frames::threshold::{Split, otsu_tree};
use crate::stats::upper_median;
use core::ops::Range;

/// Number of features: logarithms of the distance by shape and by summed squares.
pub(super) const FEATURES: usize = 2;
/// Least and greatest evidence of a single candidate, in nats: content and clock may have changed.
const EVIDENCE_LIMITS: [f64; 2] = [-4.0, 10.0];
/// Least evidence where power levels have changed, in nats: an even period of similar frames weighs as much.
const MIN_CHANGED_EVIDENCE: f64 = -3.0;
/// Weight of a mark, in nats.
const MARK_WEIGHT: f64 = 1e3;
/// Variance added to each feature, as a share of its variance over all candidates; more for the summed
/// squares, which depend on idle power and clock as well.
const SHRINKAGE: [f64; FEATURES] = [0.2, 0.4];

/// The class of an example.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Label {
    Start,
    Rest,
    Neither,
}

/// The discriminant.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Evidence {
    direction: [f64; FEATURES],
    middle: f64,
    /// No candidate weighs less.
    least: f64,
}

impl Evidence {
    /// From examples. A feature by which starts are farther than the rest is left out: nearer is never less
    /// likely. Where power levels have changed, shape alone speaks, and less.
    pub fn learn(candidates: &[Candidate], labels: &[Label], levels_changed: bool) -> Self {
        let of = |label: Label| -> Vec<[f64; FEATURES]> {
            let labelled = candidates.iter().zip(labels).filter(|(_, l)| **l == label);
            labelled.map(|(candidate, _)| candidate.features).collect()
        };
        let (starts, rest) = (of(Label::Start), of(Label::Rest));
        let (m1, m0) = (mean(&starts), mean(&rest));
        let all: Vec<_> = candidates.iter().map(|candidate| candidate.features).collect();
        let total = covariance(&all, mean(&all));
        let (s1, s0) = (covariance(&starts, m1), covariance(&rest, m0));
        let mut pooled = [[0.0; FEATURES]; FEATURES];
        for i in 0..FEATURES {
            for j in 0..FEATURES {
                pooled[i][j] = 0.5 * (s1[i][j] + s0[i][j]);
            }
            pooled[i][i] += 1e-4 + SHRINKAGE[i] * total[i][i];
        }
        let apart = [m1[0] - m0[0], m1[1] - m0[1]];
        let direction = if levels_changed {
            [(apart[0] / pooled[0][0]).min(0.0), 0.0]
        } else {
            discriminant(pooled, apart)
        };
        let least = if levels_changed { MIN_CHANGED_EVIDENCE } else { EVIDENCE_LIMITS[0] };
        let middle = (0..FEATURES).map(|i| direction[i] * 0.5 * (m1[i] + m0[i])).sum();
        Self { direction, middle, least }
    }

    /// The evidence for one candidate, nats.
    pub fn weight(&self, candidate: &Candidate, marks: &[usize]) -> f64 {
        if marks.contains(&candidate.offset) {
            return MARK_WEIGHT;
        }
        let along: f64 = self.direction.iter().zip(&candidate.features).map(|(a, b)| a * b).sum();
        (along - self.middle).clamp(self.least, EVIDENCE_LIMITS[1])
    }
}

/// `S^-1 d`; if that would count a greater distance for a start, the better feature alone.
fn discriminant(s: [[f64; FEATURES]; FEATURES], d: [f64; FEATURES]) -> [f64; FEATURES] {
    let determinant = s[0][0] * s[1][1] - s[0][1] * s[1][0];
    let both =
        [(s[1][1] * d[0] - s[0][1] * d[1]) / determinant, (s[0][0] * d[1] - s[1][0] * d[0]) / determinant];
    if both[0] <= 0.0 && both[1] <= 0.0 {
        return both;
    }
    let alone = [(d[0] / s[0][0]).min(0.0), (d[1] / s[1][1]).min(0.0)];
    if d[1] * alone[1] > d[0] * alone[0] { [0.0, alone[1]] } else { [alone[0], 0.0] }
}

fn mean(set: &[[f64; FEATURES]]) -> [f64; FEATURES] {
    let mut mean = [0.0; FEATURES];
    for features in set {
        for (sum, value) in mean.iter_mut().zip(features) {
            *sum += value / set.len() as f64;
        }
    }
    mean
}

fn covariance(set: &[[f64; FEATURES]], mean: [f64; FEATURES]) -> [[f64; FEATURES]; FEATURES] {
    let mut covariance = [[0.0; FEATURES]; FEATURES];
    for features in set {
        for i in 0..FEATURES {
            for j in 0..FEATURES {
                covariance[i][j] += (features[i] - mean[i]) * (features[j] - mean[j]) / set.len() as f64;
            }
        }
    }
    covariance
}

/// Most templates added in one round.
const MAX_NEW_PER_ROUND: usize = 6;
/// Neighbours of a new template must resemble it by this much more (in correlation) than any template does.
const MIN_SIMILARITY_GAIN: f64 = 0.08;
/// Largest deviation between the gaps before and after a new template, as a share.
const MAX_GAP_DEVIATION: f64 = 0.1;
/// Added to the norm of every window, as a share of the deviation of the whole trace: steady windows then
/// resemble nothing.
const NORM_FLOOR: f64 = 1e-3;

/// Core of a window: this share of its length after the start and a quarter of that before it, where the
/// first frame after a pause differs from all others. Farther away, changes of content or clock move more.
const CORE_SHARE: f64 = 0.1;
/// Weight of a sample of the core beyond the 1 of every sample: with the core an eighth of the window, two
/// fifths of all weight.
const CORE_WEIGHT: f64 = 5.0;

/// The templates' distances to the trace.
pub(super) struct Templates {
    width: usize,
    /// The part of the window about the start, which counts more.
    core: Range<usize>,
    /// Power less its mean over the trace, W.
    signal: Vec<f64>,
    /// Mean of each window.
    mean: Vec<f64>,
    /// Norm of each window about its mean.
    norm: Vec<f64>,
    floor: f64,
    /// One less the weighted correlation coefficient with the nearest template, at every offset.
    pub shape: Vec<f64>,
    /// Weighted summed squared difference to the nearest template, W^2, at every offset.
    pub squares_w2: Vec<f64>,
    /// Starts that templates were made of.
    pub own: Vec<usize>,
}

impl Templates {
    /// The windows at `marks` are the first templates.
    pub fn new(power: &[f64], width: usize, anchor: usize, marks: &[usize]) -> Self {
        let centre = power.iter().sum::<f64>() / power.len() as f64;
        let signal: Vec<f64> = power.iter().map(|watts| watts - centre).collect();
        let half = ((CORE_SHARE * width as f64) as usize).max(1);
        let core = anchor.saturating_sub(half / 4)..(anchor + half).min(width);
        let (mean, norm) = windows(&signal, width, &core);
        let total: f64 = signal.iter().map(|x| x * x).sum();
        let floor = NORM_FLOOR * libm::sqrt(total / signal.len() as f64 * width as f64) + f64::MIN_POSITIVE;
        let (shape, squares_w2) = (vec![2.0; mean.len()], vec![f64::INFINITY; mean.len()]);
        let mut templates =
            Self { width, core, signal, mean, norm, floor, shape, squares_w2, own: Vec::new() };
        for &mark in marks {
            templates.add(&[mark]);
        }
        templates
    }

    /// Adds the mean of the windows at `starts` as a template.
    fn add(&mut self, starts: &[usize]) {
        let width = weight(self.width, &self.core);
        let mut template = vec![0.0; self.width];
        for &start in starts {
            for (sum, value) in template.iter_mut().zip(&self.signal[start..]) {
                *sum += value / starts.len() as f64;
            }
        }
        let weighted =
            |of: &[f64]| of.iter().sum::<f64>() + CORE_WEIGHT * of[self.core.clone()].iter().sum::<f64>();
        let mean = weighted(&template) / width;
        template.iter_mut().for_each(|x| *x -= mean);
        let squares: Vec<f64> = template.iter().map(|x| x * x).collect();
        let norm = libm::sqrt(weighted(&squares)) + f64::MIN_POSITIVE;
        template.iter_mut().for_each(|x| *x /= norm);
        template[self.core.clone()].iter_mut().for_each(|x| *x *= 1.0 + CORE_WEIGHT);
        for (k, c) in Correlator::new(&template).correlate(&self.signal).into_iter().enumerate() {
            let offset = self.mean[k] - mean;
            let squares =
                self.norm[k] * self.norm[k] + norm * norm - 2.0 * c * norm + width * offset * offset;
            self.shape[k] = self.shape[k].min(1.0 - c / (self.norm[k] + self.floor));
            self.squares_w2[k] = self.squares_w2[k].min(squares.max(0.0));
        }
        self.own.extend(starts);
    }

    /// The logarithms of the two distances.
    pub fn features(&self, offset: usize) -> [f64; FEATURES] {
        let least_w2 = 1e3 * self.floor * self.floor;
        [libm::log(self.shape[offset].max(1e-4)), libm::log(self.squares_w2[offset].max(least_w2))]
    }

    /// Weighted correlation coefficient of two windows of the trace.
    pub fn similarity(&self, a: usize, b: usize) -> f64 {
        let (x, y) = (&self.signal[a..a + self.width], &self.signal[b..b + self.width]);
        let inner = dot(x, y) + CORE_WEIGHT * dot(&x[self.core.clone()], &y[self.core.clone()]);
        let about = inner - weight(self.width, &self.core) * self.mean[a] * self.mean[b];
        about / ((self.norm[a] + self.floor) * (self.norm[b] + self.floor))
    }

    /// Adds templates: starts at an even period that their neighbours resemble more than any template does.
    pub fn learn(&mut self, starts: &[usize]) {
        for _ in 0..MAX_NEW_PER_ROUND {
            let novelty = |three: &[usize]| {
                let uneven = libm::log((three[2] - three[1]) as f64 / (three[1] - three[0]) as f64).abs()
                    > MAX_GAP_DEVIATION;
                let similarity =
                    f64::min(self.similarity(three[0], three[1]), self.similarity(three[1], three[2]));
                if uneven { f64::NEG_INFINITY } else { similarity - (1.0 - self.shape[three[1]]) }
            };
            let newest = starts.windows(3).map(|three| (novelty(three), three));
            match newest.max_by(|a, b| a.0.total_cmp(&b.0)) {
                Some((novelty, three)) if novelty > MIN_SIMILARITY_GAIN => self.add(three),
                _ => return,
            }
        }
    }
}

fn dot(x: &[f64], y: &[f64]) -> f64 {
    let mut lanes = [0.0; 8];
    let (x8, y8) = (x.chunks_exact(8), y.chunks_exact(8));
    let rest: f64 = x8.remainder().iter().zip(y8.remainder()).map(|(p, q)| p * q).sum();
    for (p, q) in x8.zip(y8) {
        for (lane, (p, q)) in lanes.iter_mut().zip(p.iter().zip(q)) {
            *lane += p * q;
        }
    }
    lanes.iter().sum::<f64>() + rest
}

/// The sum of all weights of a window.
fn weight(width: usize, core: &Range<usize>) -> f64 {
    width as f64 + CORE_WEIGHT * core.len() as f64
}

/// Weighted mean and norm about the mean of every window, by running sums.
fn windows(signal: &[f64], width: usize, core: &Range<usize>) -> (Vec<f64>, Vec<f64>) {
    let weight = weight(width, core);
    let squares: Vec<f64> = signal.iter().map(|x| x * x).collect();
    let (means, powers) = (boxes(signal, width, core), boxes(&squares, width, core));
    let norms =
        means.iter().zip(&powers).map(|(sum, squares)| libm::sqrt((squares - sum * sum / weight).max(0.0)));
    let norms = norms.collect();
    (means.into_iter().map(|sum| sum / weight).collect(), norms)
}

/// The weighted sum of every window.
fn boxes(of: &[f64], width: usize, core: &Range<usize>) -> Vec<f64> {
    let count = of.len() - width + 1;
    let mut sum = of[..width].iter().sum::<f64>() + CORE_WEIGHT * of[core.clone()].iter().sum::<f64>();
    let mut sums = Vec::with_capacity(count);
    for first in 0..count {
        sums.push(sum);
        if let Some(next) = of.get(first + width) {
            sum += next - of[first] + CORE_WEIGHT * (of[first + core.end] - of[first + core.start]);
        }
    }
    sums
}

/// How far around a mark the first guess looks, in windows.
const REACH_WINDOWS: usize = 200;
/// Minima are evenly spaced by construction; starts must be farther apart by at least this factor.
const MIN_SPARSENESS: f64 = 1.3;
/// Minima below this share of the median minimum may be starts after all: at coarse rates half a sample is
/// much.
const MAX_NEAR_SHARE: f64 = 0.1;
/// Most frames that a gap of the first guess may hold.
const MAX_FRAMES_PER_GAP: usize = 5;
/// Weight of a separation, capped at 5, beside regularity.
const SEPARATION_WEIGHT: f64 = 0.1;

/// The period in samples and the starts by that split of the minima, by either measure, that is most even.
pub(super) fn first(templates: &Templates, spacing: usize, marks: &[usize]) -> (usize, Vec<usize>) {
    let mut best = (f64::NEG_INFINITY, 2 * spacing, marks.to_vec());
    let mut by = &templates.shape;
    for profile in [&templates.shape, &templates.squares_w2] {
        let reach = 2 * spacing * REACH_WINDOWS;
        let mut minima = spaced_minima(profile, spacing);
        minima.retain(|offset| marks.iter().any(|mark| mark.abs_diff(*offset) <= reach));
        let usual = median_gap(&minima).unwrap_or(spacing) as f64;
        let span = minima.last().zip(minima.first()).map_or(0, |(last, first)| last - first);
        let mut among: Vec<f64> = minima.iter().map(|&offset| profile[offset]).collect();
        let least = half_a_sample(profile, marks).min(MAX_NEAR_SHARE * upper_median(&mut among)).max(1e-12);
        let mut logs: Vec<f64> = minima
            .iter()
            .filter(|offset| !marks.contains(offset))
            .map(|&offset| libm::log(profile[offset].max(least)))
            .collect();
        logs.sort_by(f64::total_cmp);
        for split in otsu_tree(&logs, 3) {
            let threshold = libm::exp(0.5 * (logs[split.count - 1] + logs[split.count]));
            let starts: Vec<usize> =
                minima.iter().copied().filter(|&offset| profile[offset] < threshold).collect();
            let Some(gap) = median_gap(&starts) else { continue };
            // As dense as minima are anyway: only if there is nothing else, as where frames are shorter than
            // the window.
            let dense = if (gap as f64) < MIN_SPARSENESS * usual { 10.0 } else { 0.0 };
            let value = regularity(&starts, span) + SEPARATION_WEIGHT * separation(&split).min(5.0) - dense;
            if value > best.0 {
                (best, by) = ((value, gap, starts), profile);
            }
        }
    }
    let (_, period, starts) = best;
    match (2..=MAX_FRAMES_PER_GAP)
        .rev()
        .find_map(|parts| between(by, &starts, [period, spacing], parts, marks))
    {
        Some(starts) => (median_gap(&starts).unwrap_or(period), starts),
        None => (period, starts),
    }
}

/// The starts and those between them, where what divides every gap of a period into so many equal parts
/// resembles the mark as well as half a sample and noise let anything: of V-synchronized frames whose period
/// is no whole number of samples, only some fall on the mark's place between samples, and they have a period
/// of their own.
fn between(
    profile: &[f64],
    starts: &[usize],
    [period, spacing]: [usize; 2],
    parts: usize,
    marks: &[usize],
) -> Option<Vec<usize>> {
    if period / parts <= spacing {
        return None;
    }
    let even = |pair: &&[usize]| (pair[1] - pair[0]).abs_diff(period) <= 1;
    let divided = |pair: &[usize]| -> Vec<usize> {
        let (from, gap) = (pair[0], pair[1] - pair[0]);
        (1..parts).map(|part| lowest_beside(profile, from + (gap * part + parts / 2) / parts)).collect()
    };
    if starts.windows(2).filter(even).count() * 10 < starts.len() * 9 {
        return None;
    }
    let more: Vec<usize> = starts.windows(2).filter(even).flat_map(divided).collect();
    // At edges half a sample leaves half of what a whole one does. Parts of whole samples would fall on the
    // mark's place, too.
    let off = if period.is_multiple_of(parts) { 1.0 } else { 2.0 } * half_a_sample(profile, marks);
    // Noise leaves as much of them as of the starts.
    let usual = |offsets: &[usize]| {
        upper_median(&mut offsets.iter().map(|&offset| profile[offset]).collect::<Vec<_>>())
    };
    if more.is_empty() || usual(&more) > off + usual(starts) {
        return None;
    }
    let mut all = [starts, &more].concat();
    all.sort_unstable();
    Some(all)
}

/// The lowest of an offset and its two neighbours.
fn lowest_beside(profile: &[f64], offset: usize) -> usize {
    let three = offset.saturating_sub(1)..(offset + 2).min(profile.len());
    three.min_by(|a, b| profile[*a].total_cmp(&profile[*b])).unwrap_or(offset)
}

/// Distance of a match half a sample off: a quarter of that of a whole one. Nearer ones count as equal, or
/// else, where a few periods are a whole number of samples, only one in several frames would seem to match.
fn half_a_sample(profile: &[f64], marks: &[usize]) -> f64 {
    let beside = |mark: &usize| [mark.checked_sub(1), Some(mark + 1)];
    let values = marks.iter().flat_map(beside).flatten().filter_map(|offset| profile.get(offset));
    0.25 * values.fold(0.0, |most, &value| f64::max(most, value))
}

fn separation(split: &Split) -> f64 {
    (split.high.mean - split.low.mean) / (split.low.deviation + split.high.deviation).max(1e-3)
}

/// The (upper) median distance of neighbours; `None` for fewer than two.
pub(super) fn median_gap(offsets: &[usize]) -> Option<usize> {
    let mut gaps: Vec<usize> = offsets.windows(2).map(|pair| pair[1] - pair[0]).collect();
    gaps.sort_unstable();
    gaps.get(gaps.len() / 2).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn candidates(features: &[[f64; 2]]) -> Vec<Candidate> {
        let candidate = |(offset, &features): (usize, &[f64; 2])| Candidate { offset, features, weight: 0.0 };
        features.iter().enumerate().map(candidate).collect()
    }

    #[test]
    fn nearer_weighs_more_and_within_bounds() {
        let features: Vec<[f64; 2]> =
            (0..40).map(|i| [f64::from(i % 2) + 0.01 * f64::from(i), 3.0 + f64::from(i % 2)]).collect();
        let labels: Vec<Label> =
            (0..40).map(|i| if i % 2 == 0 { Label::Start } else { Label::Rest }).collect();
        let evidence = Evidence::learn(&candidates(&features), &labels, false);
        let weight = |features| evidence.weight(&candidates(&[features])[0], &[]);
        assert!(weight([0.0, 3.0]) > 1.0 && weight([1.4, 4.0]) < -1.0);
        assert_eq!((weight([-900.0, 3.0]), weight([900.0, 3.0])), (10.0, -4.0));
        assert_eq!(evidence.weight(&candidates(&[[0.0, 0.0]])[0], &[0]), MARK_WEIGHT);
    }

    #[test]
    fn a_feature_that_points_the_wrong_way_is_left_out() {
        let features: Vec<[f64; 2]> = (0..40).map(|i| [f64::from(i % 2), -f64::from(i % 2)]).collect();
        let labels: Vec<Label> =
            (0..40).map(|i| if i % 2 == 0 { Label::Start } else { Label::Rest }).collect();
        let evidence = Evidence::learn(&candidates(&features), &labels, false);
        assert!(evidence.direction[0] < 0.0 && evidence.direction[1] == 0.0, "{evidence:?}");
    }

    #[test]
    fn where_levels_have_changed_squares_say_nothing_and_shape_less_against() {
        let features: Vec<[f64; 2]> = (0..40).map(|i| [f64::from(i % 2), f64::from(i % 2)]).collect();
        let labels: Vec<Label> =
            (0..40).map(|i| if i % 2 == 0 { Label::Start } else { Label::Rest }).collect();
        let evidence = Evidence::learn(&candidates(&features), &labels, true);
        let weight = |features| evidence.weight(&candidates(&[features])[0], &[]);
        assert_eq!(weight([0.2, -5.0]), weight([0.2, 5.0]));
        assert_eq!(weight([900.0, 0.0]), MIN_CHANGED_EVIDENCE);
    }

    #[test]
    fn without_examples_nothing_is_said() {
        let evidence = Evidence::learn(&[], &[], false);
        assert_eq!(evidence.weight(&candidates(&[[1.0, 1.0]])[0], &[]), 0.0);
    }

    #[test]
    fn a_whole_sample_off_is_four_times_half_of_one() {
        let profile = [9.0, 4.0, 0.0, 8.0, 9.0, 0.0];
        assert_eq!(half_a_sample(&profile, &[2]), 2.0);
        assert_eq!((half_a_sample(&profile, &[5]), half_a_sample(&profile, &[])), (2.25, 0.0));
    }

    #[test]
    fn the_median_gap_of_few_is_none() {
        assert_eq!((median_gap(&[]), median_gap(&[5]), median_gap(&[5, 8, 20, 24])), (None, None, Some(4)));
    }

    #[test]
    fn frames_between_those_that_fall_on_the_marks_place_between_samples_are_seen() {
        // A period of 33 1/3 samples: every third start is nearest to the mark, the others a third of a
        // sample off.
        let near = |offset: f64| {
            let phase = (offset / (100.0 / 3.0)).fract();
            let off = phase.min(1.0 - phase) * (100.0 / 3.0);
            (off * off).min(9.0)
        };
        let profile: Vec<f64> = (0..2000).map(|offset| near(f64::from(offset))).collect();
        let thirds: Vec<usize> = (0..19).map(|k| 100 * k).collect();
        let all = between(&profile, &thirds, [100, 10], 3, &[500]).unwrap();
        assert_eq!((all.len(), &all[..4]), (55, &[0, 33, 67, 100][..]));
        assert_eq!(between(&profile, &thirds, [100, 10], 2, &[500]), None);
        assert_eq!(between(&profile, &thirds, [100, 40], 3, &[500]), None);
    }
}
