//! Statistics of the energies of frames: summaries, warm-up, outliers, repeated runs, histograms.

use rayon::prelude::*;
use serde::Serialize;
use warnings::{Code, Warning};

use super::{FrameEnergy, Spread};
use crate::frames::{Flag, Flags};
use crate::stats::about_mean;

/// Summary of a table of frames. Averages are over frames; for joules per pixel divide by the pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct FrameSummary {
    /// How many frames.
    pub frames: usize,
    /// Sum of the energies, J.
    pub total_j: f64,
    /// Energy per frame, J.
    pub energy_j: Spread,
    /// Duration of a frame, s.
    pub duration_s: Spread,
    /// Mean power of a frame, W; each frame counts once, however long.
    pub power_w: Spread,
    /// All energy over all time, W.
    pub overall_power_w: f64,
}

impl FrameSummary {
    /// The summary of some frames; `None` for no frames.
    pub fn of(frames: &[FrameEnergy]) -> Option<Self> {
        let spread =
            |value: fn(&FrameEnergy) -> f64| Spread::of(&frames.iter().map(value).collect::<Vec<_>>());
        let total_j: f64 = frames.iter().map(|frame| frame.energy_j).sum();
        let total_s: f64 = frames.iter().map(FrameEnergy::duration_s).sum();
        Some(Self {
            frames: frames.len(),
            total_j,
            overall_power_w: if total_s > 0.0 { total_j / total_s } else { 0.0 },
            energy_j: spread(|frame| frame.energy_j)?,
            duration_s: spread(FrameEnergy::duration_s)?,
            power_w: spread(FrameEnergy::power_w)?,
        })
    }
}

/// The frames without an incomplete last one, which ends with the trace or at an end mark and is much longer
/// or shorter than the others; or, where it `ends_with_trace`, which may be anywhere in it, shorter than
/// their spread allows.
pub fn whole(frames: &[FrameEnergy], ends_with_trace: bool) -> &[FrameEnergy] {
    let odd = |flags: Flags| flags.contains(Flag::Long) || flags.contains(Flag::Short);
    let cut = |last: &FrameEnergy| {
        last.flags.contains(Flag::Last) && (odd(last.flags) || ends_with_trace && is_shorter(frames))
    };
    match frames.split_last() {
        Some((last, others)) if cut(last) && !others.is_empty() => others,
        _ => frames,
    }
}

/// Fewest frames with a usual length: of two, either may be the odd one.
const MIN_FRAMES: usize = 3;

/// Whether the last frame is shorter than those before it by as much as makes an outlier: a whole frame that
/// is left out by mistake shifts the mean by nothing, a part of one that is not does.
fn is_shorter(frames: &[FrameEnergy]) -> bool {
    let lengths_s: Vec<f64> = frames.iter().map(FrameEnergy::duration_s).collect();
    lengths_s.len() >= MIN_FRAMES
        && deviations(&lengths_s, lengths_s.len() - 1).any(|length| length < -OUTLIER_DEVIATIONS[0])
}

/// Several runs, pooled.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Pooled {
    /// How many runs.
    pub runs: usize,
    /// How many values in all.
    pub values: usize,
    /// Mean of all values.
    pub mean: f64,
    /// `sqrt(sum (n_i - 1) s_i^2 / sum (n_i - 1))`: the spread within runs, whatever lies between them.
    pub deviation: f64,
}

/// Mean and pooled standard deviation of runs; `None` where there is no value.
pub fn pooled(runs: &[Vec<f64>]) -> Option<Pooled> {
    let runs: Vec<&Vec<f64>> = runs.iter().filter(|run| !run.is_empty()).collect();
    let values: usize = runs.iter().map(|run| run.len()).sum();
    if values == 0 {
        return None;
    }
    let squares: f64 = runs.iter().map(|run| about_mean(run).1).sum();
    let freedom = values - runs.len();
    let deviation = if freedom > 0 { libm::sqrt(squares / freedom as f64) } else { 0.0 };
    let mean = runs.iter().flat_map(|run| run.iter()).sum::<f64>() / values as f64;
    Some(Pooled { runs: runs.len(), values, mean, deviation })
}

/// Repeated runs, frame by frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Repeats {
    /// Energies of each frame over the runs, as far as all runs reach, J.
    pub energies_j: Vec<Spread>,
    /// Fewest and most frames of a run.
    pub frames: [usize; 2],
}

impl Repeats {
    /// Compares the energies of frames over runs, J; `None` without runs.
    pub fn of(runs: &[Vec<f64>]) -> Option<Self> {
        let lengths = || runs.iter().map(Vec::len);
        let frames = [lengths().min()?, lengths().max()?];
        let of_frame = |index: usize| runs.iter().map(|run| run[index]).collect::<Vec<_>>();
        let energies_j = (0..frames[0]).filter_map(|index| Spread::of(&of_frame(index))).collect();
        Some(Self { energies_j, frames })
    }

    /// Warning about runs of different lengths.
    pub fn warning(&self) -> Option<Warning> {
        let [fewest, most] = self.frames;
        let message = || format!("runs have {fewest} to {most} frames; the first {fewest} are shown");
        (fewest < most).then(|| Warning::new(Code::UnevenRuns, message()))
    }
}

/// Frames on either side that show what is usual.
const NEIGHBOURS: usize = 15;
/// Values that a thread handles at once.
const TASK_VALUES: usize = 4096;
/// Deviations from which a frame is an outlier, and from which one beside an outlier is: a disturbance of
/// several frames covers the outermost ones only in part.
const OUTLIER_DEVIATIONS: [f64; 2] = [5.0, 2.5];
/// Least deviation, as a share of the median: equal frames differ by rounding alone.
const MIN_DEVIATION: f64 = 1e-3;
/// Ratio of the standard deviation of a normal distribution to its median absolute deviation.
const MAD_TO_DEVIATION: f64 = 1.4826;

/// Whether each of `values` is an outlier among its neighbours: off their median by several of their median
/// absolute deviations (Hampel 1974). Fewer than five values have none.
pub fn outliers(values: &[f64]) -> Vec<bool> {
    if values.len() < 5 {
        return vec![false; values.len()];
    }
    let tasks = (0..values.len()).into_par_iter().step_by(TASK_VALUES);
    let deviations: Vec<f64> = tasks.flat_map_iter(|from| deviations(values, from)).collect();
    let mut out: Vec<bool> = deviations.iter().map(|z| z.abs() > OUTLIER_DEVIATIONS[0]).collect();
    let core = out.clone();
    for index in 0..values.len() {
        let beside = [index.checked_sub(1), Some(index + 1)].into_iter().flatten();
        let same_way = |other: usize| deviations.get(other).is_some_and(|z| z * deviations[index] > 0.0);
        out[index] |= deviations[index].abs() > OUTLIER_DEVIATIONS[1]
            && beside.into_iter().any(|other| core.get(other) == Some(&true) && same_way(other));
    }
    out
}

/// Deviation of each value of one task from its neighbours, in their deviations.
fn deviations(values: &[f64], from: usize) -> impl Iterator<Item = f64> + '_ {
    let mut around = Around::new(values, from);
    (from..values.len().min(from + TASK_VALUES)).map(move |index| {
        around.go_to(index);
        let (usual, spread) = around.usual_and_spread();
        (values[index] - usual) / spread
    })
}

/// The neighbours of a value, sorted: moving on by one value exchanges one.
struct Around<'a> {
    values: &'a [f64],
    from: usize,
    sorted: Vec<f64>,
}

impl<'a> Around<'a> {
    fn new(values: &'a [f64], index: usize) -> Self {
        let width = (2 * NEIGHBOURS + 1).min(values.len());
        let from = index.saturating_sub(NEIGHBOURS).min(values.len() - width);
        let mut sorted = values[from..from + width].to_vec();
        sorted.sort_unstable_by(f64::total_cmp);
        Self { values, from, sorted }
    }

    fn go_to(&mut self, index: usize) {
        let width = self.sorted.len();
        while self.from < index.saturating_sub(NEIGHBOURS).min(self.values.len() - width) {
            let [old, new] = [self.values[self.from], self.values[self.from + width]];
            let place = |sorted: &[f64], value: f64| sorted.partition_point(|x| x.total_cmp(&value).is_lt());
            self.sorted.remove(place(&self.sorted, old));
            self.sorted.insert(place(&self.sorted, new), new);
            self.from += 1;
        }
    }

    /// The median, and what the median absolute deviation from it says of the standard deviation.
    fn usual_and_spread(&self) -> (f64, f64) {
        let middle = self.sorted.len() / 2;
        let usual = self.sorted[middle];
        // The nearest half of all, from the middle outwards.
        let (mut below, mut above) = (self.sorted[..middle].iter().rev(), self.sorted[middle + 1..].iter());
        let mut next = [below.next(), above.next()].map(|value| apart(value, usual));
        let mut farthest = 0.0;
        for _ in 0..middle {
            let side = usize::from(next[1] < next[0]);
            farthest = next[side];
            next[side] = apart(if side == 0 { below.next() } else { above.next() }, usual);
        }
        (usual, (MAD_TO_DEVIATION * farthest).max(MIN_DEVIATION * usual.abs()).max(f64::MIN_POSITIVE))
    }
}

/// How far off a value is; beyond all if there is none.
fn apart(value: Option<&f64>, usual: f64) -> f64 {
    value.map_or(f64::INFINITY, |value| (value - usual).abs())
}

/// Least change of the mean that counts, in its standard errors.
const MIN_STANDARD_ERRORS: f64 = 5.0;

/// The end of the warm-up.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct WarmUp {
    /// Frames to discard; 0 where there is no clear change.
    pub frames: usize,
    /// Mean of the frames before the change less that of those after it, J.
    pub excess_j: f64,
    /// The same in standard errors.
    pub clearness: f64,
}

/// The frame at which the mean energy changes, by least squares of two levels (Hinkley 1970, eq. 2.2), looked
/// for in the first half. It is the knee of [`mean_over_discarded`].
pub fn warm_up(energies_j: &[f64]) -> WarmUp {
    let none = WarmUp { frames: 0, excess_j: 0.0, clearness: 0.0 };
    let count = energies_j.len();
    if count < 8 {
        return none;
    }
    let total: f64 = energies_j.iter().sum();
    let (mut before, mut best) = (0.0, (0.0, 0));
    for split in 1..=count / 2 {
        before += energies_j[split - 1];
        let apart = before / split as f64 - (total - before) / (count - split) as f64;
        let between = split as f64 * (count - split) as f64 / count as f64 * apart * apart;
        if between > best.0 {
            best = (between, split);
        }
    }
    let split = best.1;
    if split == 0 {
        return none;
    }
    let (early, late) = energies_j.split_at(split);
    let [(early_j, early_squares), (late_j, late_squares)] = [early, late].map(about_mean);
    let excess_j = early_j - late_j;
    let variance = (early_squares + late_squares) / (count - 2) as f64;
    let error_j = libm::sqrt(variance * (1.0 / split as f64 + 1.0 / (count - split) as f64));
    let clearness = excess_j / error_j.max(1e-12 * late_j.abs()).max(f64::MIN_POSITIVE);
    // A split after one frame is that frame's own oddness.
    WarmUp {
        frames: if clearness > MIN_STANDARD_ERRORS && split > 1 { split } else { 0 },
        excess_j,
        clearness,
    }
}

/// Mean energy of the frames left when the first `d` are discarded, J, for each `d` that leaves one.
pub fn mean_over_discarded(energies_j: &[f64]) -> Vec<f64> {
    let mut sum = 0.0;
    let mut means: Vec<f64> = energies_j
        .iter()
        .rev()
        .enumerate()
        .map(|(index, energy_j)| {
            sum += energy_j;
            sum / (index + 1) as f64
        })
        .collect();
    means.reverse();
    means
}

/// Counts of values in bins of equal width, from the lowest value to the highest.
#[derive(Clone, Debug, PartialEq)]
pub struct Histogram {
    /// Lower edge of the first bin.
    pub low: f64,
    /// Width of a bin; above 0.
    pub width: f64,
    /// Number of values in each bin.
    pub counts: Vec<u32>,
}

/// Least width of a bin, as a share of the highest value: equal values have a bin, too.
const MIN_WIDTH_SHARE: f64 = 1e-12;

impl Histogram {
    /// The distribution of finite values. The number of bins is the square root of that of the values, at
    /// most `max_bins`; no values give one empty bin.
    pub fn of(values: &[f64], max_bins: usize) -> Self {
        let bins = ((values.len() as f64).sqrt() as usize).clamp(1, max_bins.max(1));
        let low = values.iter().copied().reduce(f64::min).unwrap_or(0.0);
        let high = values.iter().copied().reduce(f64::max).unwrap_or(0.0);
        let width = (high - low) / bins as f64;
        let width = width.max(MIN_WIDTH_SHARE * high.abs()).max(f64::MIN_POSITIVE);
        let mut counts = vec![0; bins];
        for value in values {
            counts[(((value - low) / width) as usize).min(bins - 1)] += 1;
        }
        Self { low, width, counts }
    }

    /// Lower edge, upper edge and count of each bin.
    pub fn bins(&self) -> impl Iterator<Item = (f64, f64, u32)> + '_ {
        let edge = |index: usize| self.low + index as f64 * self.width;
        self.counts.iter().enumerate().map(move |(index, &count)| (edge(index), edge(index + 1), count))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::upper_median;

    #[test]
    fn mean_deviation_and_median_of_known_numbers() {
        let spread = Spread::of(&[2.0, 4.0, 4.0, 4.0, 5.0, 5.0, 7.0, 9.0]).unwrap();
        assert_eq!((spread.mean, spread.median), (5.0, 4.5));
        assert!((spread.deviation - (32.0_f64 / 7.0).sqrt()).abs() < 1e-15);
        assert_eq!(Spread::of(&[3.0]), Some(Spread { mean: 3.0, deviation: 0.0, median: 3.0 }));
        assert_eq!(Spread::of(&[]), None);
        assert_eq!(FrameSummary::of(&[]), None);
    }

    #[test]
    fn a_last_frame_cut_by_the_end_of_the_trace_is_left_out_and_one_within_the_spread_is_not() {
        let frames = |lengths_s: &[f64]| -> Vec<FrameEnergy> {
            let mut frames: Vec<FrameEnergy> = lengths_s
                .iter()
                .scan(0.0, |end_s, length_s| {
                    let start_s = *end_s;
                    *end_s += length_s;
                    let flags = Flags::default();
                    Some(FrameEnergy { start_s, end_s: *end_s, energy_j: *length_s, confidence: 1.0, flags })
                })
                .collect();
            frames[lengths_s.len() - 1].flags.insert(Flag::Last);
            frames
        };
        let even = frames(&[0.04, 0.0401, 0.0399, 0.04, 0.0401, 0.0216]);
        assert_eq!((whole(&even, true).len(), whole(&even, false).len()), (5, 6));
        for lengths_s in [&[0.04, 0.03, 0.05, 0.045, 0.035, 0.029][..], &[1.0, 1.0, 1.001], &[1.0, 0.6]] {
            assert_eq!(whole(&frames(lengths_s), true).len(), lengths_s.len(), "{lengths_s:?}");
        }
        assert_eq!(whole(&frames(&[1.0, 1.0, 0.6]), true).len(), 2);
    }

    #[test]
    fn a_difference_between_runs_does_not_widen_the_pool() {
        let pool = pooled(&[vec![1.0, 2.0, 3.0], vec![11.0, 12.0, 13.0], vec![]]).unwrap();
        assert_eq!((pool.runs, pool.values, pool.mean, pool.deviation), (2, 6, 7.0, 1.0));
        assert_eq!(pooled(&[vec![]]), None);
    }

    #[test]
    fn a_million_frames_take_no_longer_than_their_number_says() {
        // Taking the mean anew for each of them once took minutes.
        let run: Vec<f64> = (0..1_000_000).map(|i| f64::from(i % 2)).collect();
        let pool = pooled(&[run]).unwrap();
        assert!(pool.mean == 0.5 && (pool.deviation - 0.5).abs() < 1e-6);
    }

    #[test]
    fn a_disturbance_over_three_frames_is_found_with_its_edges() {
        let mut values: Vec<f64> = (0..100).map(|i| 10.0 + 0.1 * f64::from(i * 37 % 11) / 11.0).collect();
        values[50] += 0.15;
        values[51] += 1.0;
        values[52] += 0.3;
        let found: Vec<usize> =
            outliers(&values).iter().enumerate().filter(|(_, out)| **out).map(|(index, _)| index).collect();
        assert_eq!(found, [50, 51, 52]);
    }

    #[test]
    fn oracle_windows_that_go_along_are_those_taken_anew() {
        for count in [5, 6, 30, 31, 32, 2 * TASK_VALUES + 3] {
            let values: Vec<f64> = (0..count).map(|i| ((i * 7919) % 101) as f64 / 7.0 - 3.0).collect();
            let tasks = (0..count).step_by(TASK_VALUES);
            let found: Vec<f64> = tasks.flat_map(|from| deviations(&values, from)).collect();
            let width = (2 * NEIGHBOURS + 1).min(count);
            for (index, found) in found.into_iter().enumerate() {
                let from = index.saturating_sub(NEIGHBOURS).min(count - width);
                let mut around = values[from..from + width].to_vec();
                let usual = upper_median(&mut around);
                around.iter_mut().for_each(|value| *value = (*value - usual).abs());
                let spread = (MAD_TO_DEVIATION * upper_median(&mut around))
                    .max(MIN_DEVIATION * usual.abs())
                    .max(f64::MIN_POSITIVE);
                assert_eq!(found, (values[index] - usual) / spread, "{index} of {count}");
            }
        }
    }

    #[test]
    fn slow_drift_and_equal_values_have_none() {
        let drift: Vec<f64> = (0..200).map(|i| 5.0 + 0.01 * f64::from(i) + 0.02 * f64::from(i % 3)).collect();
        assert!(outliers(&drift).iter().chain(&outliers(&[1.0; 50])).all(|out| !out));
        assert_eq!(outliers(&[1.0, 9.0]), [false, false]);
    }

    #[test]
    fn the_step_is_found_under_noise_and_none_is_invented() {
        let noise = |i: usize| 0.02 * ((i * 7919 % 101) as f64 / 101.0 - 0.5);
        let frames: Vec<f64> = (0..300).map(|i| 1.0 + if i < 48 { 0.03 } else { 0.0 } + noise(i)).collect();
        assert_eq!(warm_up(&frames).frames, 48);
        let steady: Vec<f64> = (0..300).map(|i| 1.0 + noise(i)).collect();
        assert_eq!(warm_up(&steady).frames, 0);
        assert_eq!(warm_up(&[1.0; 3]).frames, 0);
    }

    #[test]
    fn means_over_what_is_left() {
        let repeats = Repeats::of(&[vec![1.0, 4.0, 9.0], vec![3.0, 4.0]]).unwrap();
        assert_eq!(repeats.energies_j.iter().map(|spread| spread.mean).collect::<Vec<_>>(), [2.0, 4.0]);
        assert_eq!(repeats.frames, [2, 3]);
        assert!(repeats.warning().unwrap().message.starts_with("runs have 2 to 3 frames"));
        assert!(
            Repeats::of(&[vec![1.0], vec![2.0]]).unwrap().warning().is_none() && Repeats::of(&[]).is_none()
        );
        assert_eq!(mean_over_discarded(&[4.0, 2.0, 1.0]), [7.0 / 3.0, 1.5, 1.0]);
    }

    #[test]
    fn every_value_is_in_the_bin_around_it() {
        let values: Vec<f64> = (0..100).map(|i| f64::from(i % 10)).collect();
        let histogram = Histogram::of(&values, 60);
        assert_eq!(histogram.counts, [10; 10]);
        let (from, to, _) = histogram.bins().last().unwrap();
        assert!((from - 8.1).abs() < 1e-12 && (to - 9.0).abs() < 1e-12);
        assert_eq!(Histogram::of(&values, 5).counts, [20; 5]);
    }

    #[test]
    fn equal_values_and_none_have_a_bin() {
        for value in [0.0, 3.0, -3.0] {
            let histogram = Histogram::of(&[value; 9], 60);
            assert_eq!((histogram.counts.iter().sum::<u32>(), histogram.low), (9, value));
            assert!(histogram.width > 0.0);
        }
        assert_eq!(Histogram::of(&[], 60).counts, [0]);
    }
}
