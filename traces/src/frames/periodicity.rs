//! Periodicity: how regular the gaps between starts are. Wrong starts rarely keep the period.
//!
//! *V-sync snapping*: frames that wait for the display start on the ticks of one clock. Where the beginning
//! of a frame varies, templates are aligned by its most prominent part, up to a millisecond after the start.
//! The sequence then wanders, although the frames do not. If nearly all gaps are whole numbers of one period,
//! the display sets that period. If the starts of such a trace are spread all the same, the mark and the
//! period give their positions.

use super::profile::normalized;
use crate::stats::{moments, upper_median};
use rayon::prelude::*;

/// Gaps on either side that give the usual gap.
const NEIGHBOUR_GAPS: usize = 4;
/// Fewest gaps a thread works on at once.
const MIN_TASK_GAPS: usize = 1024;
/// Largest deviation of an even gap from the usual one, as a share of that.
const MAX_EVEN_DEVIATION: f64 = 0.1;

/// For each gap, the median of its neighbours and their median deviation from it. `None` for fewer than two
/// neighbours.
pub(super) fn usual_gaps(gaps: &[f64]) -> Vec<Option<[f64; 2]>> {
    let one = |index: usize| {
        let around = index.saturating_sub(NEIGHBOUR_GAPS)..gaps.len().min(index + NEIGHBOUR_GAPS + 1);
        let (mut held, mut count) = ([0.0; 2 * NEIGHBOUR_GAPS], 0);
        for other in around.filter(|&other| other != index) {
            held[count] = gaps[other];
            count += 1;
        }
        let around = &mut held[..count];
        if count < 2 {
            return None;
        }
        let usual = upper_median(around);
        around.iter_mut().for_each(|gap| *gap = (*gap - usual).abs());
        Some([usual, upper_median(around)])
    };
    (0..gaps.len()).into_par_iter().with_min_len(MIN_TASK_GAPS).map(one).collect()
}

/// Whether each gap is as long as its neighbours: within a tenth, and within `max_deviation`.
pub(super) fn even_gaps(gaps: &[f64], max_deviation: f64) -> Vec<bool> {
    let fits = |(gap, usual): (&f64, Option<[f64; 2]>)| {
        usual.is_some_and(|[usual, _]| (gap - usual).abs() < (MAX_EVEN_DEVIATION * usual).min(max_deviation))
    };
    gaps.iter().zip(usual_gaps(gaps)).map(fits).collect()
}

/// The sum of the even gaps.
pub(super) fn even_coverage(gaps: &[f64]) -> f64 {
    gaps.iter().zip(even_gaps(gaps, f64::INFINITY)).filter(|(_, even)| *even).map(|(gap, _)| gap).sum()
}

/// Ratios to the median gap between which a gap is regular.
const REGULAR_RATIOS: [f64; 2] = [0.6, 1.6];
/// Fewest gaps whose regularity means anything.
const MIN_GAPS: usize = 4;

/// The share of `span` that lies between neighbours at a regular distance: 1 if all of it is evenly divided,
/// less where starts are missing (their gap is long), false (short), or absent at the ends. 0 if there are
/// too few. Offsets in samples, sorted.
pub(crate) fn regularity(offsets: &[usize], span: usize) -> f64 {
    let gaps: Vec<usize> = offsets.windows(2).map(|pair| pair[1] - pair[0]).collect();
    if gaps.len() < MIN_GAPS || span == 0 {
        return 0.0;
    }
    let mut others = gaps.clone();
    let median = *others.select_nth_unstable(gaps.len() / 2).1 as f64;
    let regular =
        |gap: &&usize| (REGULAR_RATIOS[0] * median..=REGULAR_RATIOS[1] * median).contains(&(**gap as f64));
    gaps.iter().filter(regular).sum::<usize>() as f64 / span as f64
}

/// Greatest lag of a repetition, samples.
const MAX_LAG_SAMPLES: usize = 1 << 15;
/// The first of all peaks at least this share of the highest is the repetition (McLeod and Wyvill 2005, who
/// take 0.8 to 1).
const FIRST_PEAK_SHARE: f64 = 0.9;
/// Least correlation of a repetition: half of the variance.
const MIN_REPETITION: f64 = 0.5;

/// After how many samples power repeats itself in the middle of a trace, whatever frames are: the first high
/// peak of its autocorrelation (McLeod and Wyvill, *A Smarter Way to Find Pitch*, 2005). `None` where none is
/// high.
pub(crate) fn repetition_samples(power: &[f64]) -> Option<usize> {
    let lags = (power.len() / 2).min(MAX_LAG_SAMPLES);
    let from = power.len() / 2 - lags;
    let segment = &power[from..from + 2 * lags];
    let deviation = moments(&segment[..lags]).deviation;
    let most = 2.0 * lags as f64 * deviation * deviation;
    let profile = normalized(segment, &segment[..lags]);
    let similarity = |distance: &f64| 1.0 - distance / most.max(f64::MIN_POSITIVE);
    let correlation: Vec<f64> = profile.iter().map(similarity).collect();
    // A peak is the highest of its positive segment; that around no lag at all does not count.
    let mut lag = correlation.iter().position(|r| *r < 0.0)?;
    let mut peaks: Vec<(usize, f64)> = Vec::new();
    for part in correlation[lag..].chunk_by(|a, b| (*a < 0.0) == (*b < 0.0)) {
        let highest = part.iter().copied().enumerate().max_by(|a, b| a.1.total_cmp(&b.1));
        peaks.extend(highest.map(|(place, r)| (lag + place, r)));
        lag += part.len();
    }
    let highest = peaks.iter().map(|(_, r)| *r).fold(MIN_REPETITION / FIRST_PEAK_SHARE, f64::max);
    peaks.into_iter().find(|(_, r)| *r >= FIRST_PEAK_SHARE * highest).map(|(lag, _)| lag)
}

/// A gap is a whole number of periods if it is off by less than this share of one.
const MAX_PERIOD_RESIDUE: f64 = 2e-3;
/// Least share of such gaps in a trace that waits for the display.
const MIN_WHOLE_SHARE: f64 = 0.5;
/// Least share of starts near a tick, and the largest distance of those, in periods.
const TICK_SHARE_AND_DISTANCE: [f64; 2] = [0.8, 0.1];
/// Starts snap to the ticks only if at least this share of them lies farther from its tick than this share of
/// the window: more than a few by chance.
const SPREAD_SHARE_AND_DISTANCE: [f64; 2] = [0.02, 0.06];
/// Fewest gaps that give a period.
const MIN_TICK_GAPS: usize = 16;
/// Largest distance of scattered starts from their ticks: the first, for each root of their number, or the
/// second, as a ratio to the residues of the gaps. Starts scattered about ticks lie about as far from them as
/// gaps from whole periods, however many there are; starts that drift lie a quarter as far as that for each
/// root of their number.
const SCATTER_LIMITS: [f64; 2] = [0.1, 1.5];
/// Rounds of reweighting.
const MAX_ROUNDS: usize = 60;

/// Starts relative to the ticks of the display.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Snapped {
    /// Positions, samples: on the ticks where the starts were spread about, else as they were.
    pub positions: Vec<f64>,
    /// Whether each lies far from every tick: no frame begins there.
    pub off_tick: Vec<bool>,
}

/// Snaps the starts at `positions` (samples, in order) to the ticks of the display, if they wait for it;
/// `fixed` is the number of an exact one.
pub(super) fn snap_to_ticks(positions: &[f64], fixed: usize, width: usize) -> Option<Snapped> {
    let (off, period) = tick_distances(positions, fixed)?;
    let share =
        |far: &dyn Fn(f64) -> bool| off.iter().filter(|off| far(**off)).count() as f64 / off.len() as f64;
    let near = |off: f64| off.abs() < TICK_SHARE_AND_DISTANCE[1] * period;
    let spread =
        share(&|off| off.abs() > SPREAD_SHARE_AND_DISTANCE[1] * width as f64) > SPREAD_SHARE_AND_DISTANCE[0];
    let put = |(x, off): (&f64, &f64)| if spread && near(*off) { x - off } else { *x };
    (share(&near) > TICK_SHARE_AND_DISTANCE[0]).then(|| Snapped {
        positions: positions.iter().zip(&off).map(put).collect(),
        off_tick: off.iter().map(|off| !near(*off)).collect(),
    })
}

/// How far each start lies from the nearest tick of the period that goes through the `fixed` one, and that
/// period, samples; `None` where gaps are no whole numbers of it.
fn tick_distances(positions: &[f64], fixed: usize) -> Option<(Vec<f64>, f64)> {
    let gaps: Vec<f64> = positions.windows(2).map(|two| two[1] - two[0]).collect();
    if gaps.len() < MIN_TICK_GAPS {
        return None;
    }
    let usual = upper_median(&mut gaps.clone());
    let periods = whole_periods(&gaps, usual);
    let residues: Vec<f64> =
        gaps.iter().zip(&periods).map(|(gap, count)| (gap - count * usual).abs()).collect();
    let whole = |(residues, count): &(&f64, &f64)| **count > 0.0 && **residues < MAX_PERIOD_RESIDUE * usual;
    let mostly =
        residues.iter().zip(&periods).filter(whole).count() as f64 >= MIN_WHOLE_SHARE * gaps.len() as f64;
    let period = slope(positions, &periods);
    let tick = |position: f64| libm::round((position - positions[fixed]) / period);
    let off: Vec<f64> = positions.iter().map(|x| x - positions[fixed] - tick(*x) * period).collect();
    (mostly || scattered(&off, residues)).then_some((off, period))
}

/// Whether starts that lie so far `off` the ticks are scattered about them; gaps lie so far `residues` whole
/// periods.
fn scattered(off: &[f64], mut residues: Vec<f64>) -> bool {
    let middle = upper_median(&mut off.to_vec());
    let mut far: Vec<f64> = off.iter().map(|off| (off - middle).abs()).collect();
    let most = (SCATTER_LIMITS[0] * libm::sqrt(residues.len() as f64)).min(SCATTER_LIMITS[1]);
    upper_median(&mut far) < most * upper_median(&mut residues)
}

/// Each gap in whole periods; the remainder of a start between two ticks counts with the next gap.
fn whole_periods(gaps: &[f64], period: f64) -> Vec<f64> {
    let mut over = 0.0;
    let whole = |gap: &f64| {
        let periods = libm::round((gap + over) / period);
        over += gap - periods * period;
        if over.abs() < TICK_SHARE_AND_DISTANCE[1] * period {
            over = 0.0;
        }
        periods
    };
    gaps.iter().map(whole).collect()
}

/// The period by which the sum of the distances of all positions to ticks is least (iteratively reweighted
/// least squares; Schlossmacher 1973); `periods` lie between each and the next.
fn slope(positions: &[f64], periods: &[f64]) -> f64 {
    let mut ticks = vec![0.0];
    ticks.extend(periods.iter().scan(0.0, |tick, periods| {
        *tick += periods;
        Some(*tick)
    }));
    let mut weights = vec![1.0; ticks.len()];
    let mut period = 0.0;
    for _ in 0..MAX_ROUNDS {
        let total: f64 = weights.iter().sum();
        let mean = |of: &[f64]| of.iter().zip(&weights).map(|(x, w)| x * w).sum::<f64>() / total;
        let (n, x) = (mean(&ticks), mean(positions));
        let (mut inner, mut squares) = (0.0, 0.0);
        for ((tick, position), weight) in ticks.iter().zip(positions).zip(&weights) {
            inner += weight * (tick - n) * (position - x);
            squares += weight * (tick - n) * (tick - n);
        }
        period = inner / squares;
        for ((tick, position), weight) in ticks.iter().zip(positions).zip(&mut weights) {
            *weight = 1.0 / (position - x - (tick - n) * period).abs().max(0.1);
        }
    }
    period
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::Random;

    #[test]
    fn power_repeats_after_a_frame_and_noise_never_does() {
        let random = Random::new(3, 0);
        let frames = |gap: usize| -> Vec<f64> {
            let watts = |i: usize| {
                1.0 + [4.0, 1.0, 3.0, 0.0, 0.0][i % gap * 5 / gap] + 0.2 * random.normals(i as u64).0
            };
            (0..20_000).map(watts).collect()
        };
        for gap in [40, 333, 1000] {
            let found = repetition_samples(&frames(gap)).unwrap();
            assert!(found.abs_diff(gap) <= 1, "{found} for {gap}");
        }
        let noise: Vec<f64> = (0..20_000).map(|i| random.normals(i).0).collect();
        assert_eq!(repetition_samples(&noise), None);
        assert_eq!((repetition_samples(&[]), repetition_samples(&[1.0; 500])), (None, None));
    }

    #[test]
    fn gaps_stay_even_at_a_clock_step_and_those_of_alternating_halves_are_not() {
        let step: Vec<f64> = [vec![10.0; 8], vec![14.0; 8]].concat();
        assert!(even_gaps(&step, f64::INFINITY).iter().filter(|even| !**even).count() <= 2);
        let halves: Vec<f64> = (0..16).map(|i| if i % 2 == 0 { 6.0 } else { 4.0 }).collect();
        assert!(even_gaps(&halves, f64::INFINITY).iter().filter(|even| **even).count() <= 8);
    }

    #[test]
    fn what_is_uneven_does_not_count_as_covered() {
        assert_eq!(even_coverage(&[10.0, 10.5, 20.0, 10.0, 10.0, 9.9]), 50.4);
        assert_eq!((even_coverage(&[]), even_coverage(&[3.0, 3.0])), (0.0, 0.0));
    }

    #[test]
    fn a_bound_in_samples_is_kept() {
        assert_eq!(even_gaps(&[10.0, 10.0, 10.4, 10.0], 0.5), [true; 4]);
        assert_eq!(even_gaps(&[10.0, 10.0, 10.6, 10.0], 0.5), [true, true, false, true]);
    }

    #[test]
    fn missing_and_false_starts_cost_their_time() {
        let even: Vec<usize> = (0..11).map(|i| i * 100).collect();
        assert_eq!(regularity(&even, 1000), 1.0);
        let missing: Vec<usize> = even.iter().copied().filter(|&o| o != 300).collect();
        assert_eq!(regularity(&missing, 1000), 0.8);
        let mut extra = even.clone();
        extra.insert(4, 330);
        assert_eq!(regularity(&extra, 1000), 0.97);
        assert_eq!(regularity(&even[..4], 1000), 0.0);
    }

    /// 200 starts on ticks of 400.25 samples, every seventh tick skipped, moved by `off`.
    fn starts(off: impl Fn(usize) -> f64) -> Vec<f64> {
        (0..200).map(|i| 50.0 + 400.25 * (i + i / 7) as f64 + off(i)).collect()
    }

    #[test]
    fn analytic_starts_that_wander_are_put_back_on_the_ticks_of_the_display() {
        let wander = |i: usize| match i / 20 % 4 {
            _ if i == 60 => 0.0,
            1 => -31.0,
            2 => -22.0,
            3 => 9.0,
            _ => -25.0,
        };
        let found = snap_to_ticks(&starts(wander), 60, 250).unwrap().positions;
        let worst = found.iter().zip(starts(|_| 0.0)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(worst < 8.0, "{worst}");
    }

    #[test]
    fn what_lies_on_ticks_or_does_not_wait_is_left_alone() {
        let even = starts(|i| (i % 3) as f64);
        assert_eq!(
            snap_to_ticks(&even, 60, 250),
            Some(Snapped { positions: even, off_tick: vec![false; 200] })
        );
        let free = |i: usize| 15.0 * libm::sin(i as f64) + 40.0 * libm::sin(0.1 * i as f64);
        assert_eq!(snap_to_ticks(&starts(free), 60, 250), None);
        assert_eq!(snap_to_ticks(&starts(|_| 0.0)[..10], 3, 250), None);
    }

    #[test]
    fn starts_between_ticks_do_not_count_as_ticks_of_their_own() {
        assert_eq!(
            whole_periods(&[100.0, 52.0, 49.0, 201.0, 48.0, 151.0], 100.0),
            [1.0, 1.0, 0.0, 2.0, 0.0, 2.0]
        );
    }

    #[test]
    fn a_start_far_from_every_tick_stays_and_is_reported() {
        let late = |i: usize| {
            if i == 90 {
                150.0
            } else if i % 40 < 10 {
                -30.0
            } else {
                0.0
            }
        };
        let found = snap_to_ticks(&starts(late), 60, 250).unwrap();
        assert_eq!(found.positions[90], starts(late)[90]);
        assert_eq!(found.off_tick.iter().filter(|between| **between).count(), 1);
        assert!(found.off_tick[90]);
    }

    #[test]
    fn starts_that_noise_scatters_about_ticks_are_put_on_them_and_those_that_walk_are_not() {
        let random = Random::new(11, 0);
        let noise = |i: usize| if i == 60 { 0.0 } else { 9.0 * random.normals(i as u64).0 };
        let found = snap_to_ticks(&starts(noise), 60, 250).unwrap().positions;
        let worst = found.iter().zip(starts(|_| 0.0)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(worst < 6.0, "{worst}");
        let walk = |i: usize| (0..i).map(|step| 2.0 * random.normals(step as u64).0).sum::<f64>();
        assert_eq!(snap_to_ticks(&starts(walk), 60, 250), None);
    }
}
