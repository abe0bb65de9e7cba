//! Alignment finer than a sample, also between two frames at different clocks.
//!
//! After a clock step the same draws take longer or shorter: the power after the start of one frame is that
//! of the other, scaled in time. Compared without scaling, the two fit best up to a sixth of the window away
//! from the start. So the earlier frame is scaled about its start by one ratio after another, and the shift
//! is taken from the best ratio.

use super::profile::{Buffers, OverlapSave, Transforms, difference};
use core::ops::RangeInclusive;
use rustfft::num_complex::Complex;

/// The best alignment near offset `near`, in samples, fractional: the minimum of the summed squared
/// difference within `reach` of it and the vertex of the parabola through it and its two neighbours.
///
/// For a signal smooth on the scale of a sample the difference is a parabola near its minimum, and the result
/// exact; for a single sharp edge it is off by up to a tenth of a sample, to either side (tests show both).
pub(super) fn align(power: &[f64], template: &[f64], near: usize, reach: usize) -> f64 {
    let Some(last) = power.len().checked_sub(template.len()) else { return near as f64 };
    let at = |offset: usize| difference(&power[offset..offset + template.len()], template);
    let mut best = near.min(last);
    let mut lowest = at(best);
    for offset in near.saturating_sub(reach)..=(near + reach).min(last) {
        let value = at(offset);
        if value < lowest {
            (best, lowest) = (offset, value);
        }
    }
    if best == 0 || best >= last {
        return best as f64;
    }
    best as f64 + vertex(at(best - 1), lowest, at(best + 1))
}

/// The shift of the least residual in a range, searched in steps and then around the best of them.
pub(super) fn nearest(shifts: RangeInclusive<usize>, step: usize, residual: impl Fn(usize) -> f64) -> usize {
    let (first, last) = shifts.into_inner();
    let least = |from: usize, to: usize, step: usize| {
        let judged = (from..=to).step_by(step).map(|shift| (residual(shift), shift));
        judged.min_by(|a, b| a.0.total_cmp(&b.0)).map_or(first, |(_, shift)| shift)
    };
    let rough = least(first, last, step);
    if step == 1 { rough } else { least(first.max(rough.saturating_sub(step)), last.min(rough + step), 1) }
}

/// The vertex of the parabola through three equally spaced values, relative to the middle one, within half a
/// step.
pub(crate) fn vertex(before: f64, middle: f64, after: f64) -> f64 {
    let curvature = before - 2.0 * middle + after;
    if curvature > 0.0 { (0.5 * (before - after) / curvature).clamp(-0.5, 0.5) } else { 0.0 }
}

/// Power between two samples, taken to be linear there; `None` outside of the trace.
pub(super) fn between(power: &[f64], place: f64) -> Option<f64> {
    let whole = libm::floor(place);
    let (a, b) = (power.get(whole as usize)?, power.get(whole as usize + 1)?);
    (place >= 0.0).then(|| a + (place - whole) * (b - a))
}

/// Step of the time scales that are tried: powers of this, up and down.
const RATIO_STEP: f64 = 1.06;
/// Largest power: the clocks of a device lie within a factor of two.
const MAX_POWER: i32 = 11;
/// Distance, in samples, of the shifts that are tried first.
const COARSE_STEP_SAMPLES: usize = 3;

/// The best fit of a scaled segment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ScaledFit {
    /// How much longer things take in the later frame.
    pub ratio: f64,
    /// How much later than its place the start of the later frame lies, samples.
    pub shift: f64,
    /// Unexplained share of the variance, at the best gain.
    pub unexplained: f64,
    /// Second difference of that share over the shift, per squared sample.
    pub curvature: f64,
}

/// How the starts of two frames are compared: `before` and `after` samples of the later one, for shifts up to
/// `reach`.
pub(super) struct ScaledSearch {
    before: usize,
    after: usize,
    reach: usize,
    /// Those of the estimates; `None` if a direct search is cheap.
    transforms: Option<Transforms<f64>>,
}

/// The surroundings of the start of the earlier frame, scaled about it, of mean 0.
struct Scaled {
    ratio: f64,
    values: Vec<f64>,
    /// Sum of their squares.
    own: f64,
}

impl ScaledSearch {
    pub fn new(before: usize, after: usize, reach: usize) -> Self {
        let (width, shifts) = (before + after, 2 * reach + 1);
        let block = (width + 2 * reach).next_power_of_two();
        let transforms = (shifts * width >= MIN_PRODUCTS).then(|| Transforms::new(block));
        Self { before, after, reach, transforms }
    }

    /// Samples that are compared at a shift.
    pub fn width(&self) -> usize {
        self.before + self.after
    }

    /// The ratio and the shift that leave least unexplained, from where the starts of two frames are thought to
    /// be; `None` where the trace ends too early or nothing fits best.
    pub fn best(&self, power: &[f64], starts: [usize; 2]) -> Option<ScaledFit> {
        let ratios = (-MAX_POWER..=MAX_POWER).map(|power| libm::pow(RATIO_STEP, f64::from(power)));
        let ratios: Vec<f64> = ratios.collect();
        let fits = self.fits(power, starts, &ratios).into_iter();
        let best = fits.min_by(|a, b| a.unexplained.total_cmp(&b.unexplained))?;
        // What fits best by the greatest ratio would fit better by a greater one.
        let ends = [ratios.first(), ratios.last()];
        (!ends.contains(&Some(&best.ratio))).then_some(best)
    }

    /// The fit of clocks that are the same.
    pub fn unscaled(&self, power: &[f64], starts: [usize; 2]) -> Option<ScaledFit> {
        self.fits(power, starts, &[1.0]).pop()
    }

    /// The best shifts at ratios, where there is one.
    fn fits(&self, power: &[f64], starts: [usize; 2], ratios: &[f64]) -> Vec<ScaledFit> {
        let first = starts[1].checked_sub(self.before + self.reach);
        let segment = first.and_then(|first| power.get(first..starts[1] + self.after + self.reach));
        let Some(segment) = segment else { return Vec::new() };
        let scaled = |&ratio: &f64| self.scaled(power, starts[0], ratio);
        let templates: Vec<Scaled> = ratios.iter().filter_map(scaled).collect();
        let estimates = self.estimates(&templates, segment);
        let fits = templates.iter().enumerate().map(|(at, template)| {
            let estimates = estimates.get(at).map_or(&[][..], Vec::as_slice);
            self.fit(template, segment, estimates)
        });
        fits.flatten().collect()
    }

    fn scaled(&self, power: &[f64], start: usize, ratio: f64) -> Option<Scaled> {
        let value = |index: usize| between(power, start as f64 + (index as f64 - self.before as f64) / ratio);
        let mut values = (0..self.width()).map(value).collect::<Option<Vec<f64>>>()?;
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        values.iter_mut().for_each(|watts| *watts -= mean);
        let own = values.iter().map(|x| x * x).sum();
        Some(Scaled { ratio, values, own })
    }

    /// The best shift of a template. Most shifts are ruled out by an estimate; what is left is compared as it
    /// would be without one.
    fn fit(&self, template: &Scaled, segment: &[f64], estimates: &[f64]) -> Option<ScaledFit> {
        let Scaled { ratio, values, own } = template;
        let unlike = |shift: usize| unexplained(values, *own, &segment[shift..shift + values.len()]);
        let last = (2 * self.reach).checked_sub(1)?;
        let lowest = (1..=last).step_by(COARSE_STEP_SAMPLES).filter_map(|shift| estimates.get(shift));
        let limit = lowest.copied().fold(f64::INFINITY, f64::min) + MAX_ESTIMATE_ERROR;
        let judged = |shift: usize| match estimates.get(shift) {
            Some(&estimate) if estimate > limit => estimate,
            _ => unlike(shift),
        };
        let at = nearest(1..=last, COARSE_STEP_SAMPLES, judged);
        let [left, middle, right] = [at - 1, at, at + 1].map(unlike);
        let curvature = left - 2.0 * middle + right;
        (middle <= left.min(right) && curvature > 0.0).then(|| ScaledFit {
            ratio: *ratio,
            shift: at as f64 - self.reach as f64 + vertex(left, middle, right),
            unexplained: middle,
            curvature,
        })
    }

    /// [`unexplained`] of each template at every shift from 0 on, by correlation; NaN where rounding may be too
    /// large, and none if a direct search is cheap.
    fn estimates(&self, templates: &[Scaled], segment: &[f64]) -> Vec<Vec<f64>> {
        let Some(transforms) = &self.transforms else { return Vec::new() };
        let mean = segment.iter().sum::<f64>() / segment.len() as f64;
        let segment: Vec<f64> = segment.iter().map(|watts| watts - mean).collect();
        let values = templates.iter().map(|template| &template.values[..]);
        let correlator = OverlapSave::with(transforms.clone(), values, 1.0);
        let variances = variances(&segment, self.width());
        let mut estimates = Vec::with_capacity(templates.len());
        correlator.pair(&segment, 0, &mut Buffers::default(), |at, inner| {
            let own = templates[at].own;
            let estimate = |(inner, variance): (&Complex<f64>, &f64)| match inner.re {
                _ if variance.is_nan() || own <= 0.0 => f64::NAN,
                inner if inner > 0.0 => 1.0 - inner * inner / (variance * own),
                _ => 1.0,
            };
            estimates.push(inner.iter().zip(&variances).map(estimate).collect());
        });
        estimates
    }
}

/// Summed squares about the mean of the `width` values from every offset on; NaN where rounding may be too large.
fn variances(values: &[f64], width: usize) -> Vec<f64> {
    let least = MIN_VARIANCE_SHARE * values.iter().map(|x| x * x).sum::<f64>();
    let (mut sum, mut squares) = values[..width].iter().fold((0.0, 0.0), |(a, b), x| (a + x, b + x * x));
    let at = |offset: usize| {
        let variance = squares - sum * sum / width as f64;
        let (gone, next) = (values[offset], values.get(offset + width).copied().unwrap_or(0.0));
        (sum, squares) = (sum + next - gone, squares + next * next - gone * gone);
        if variance >= least { variance } else { f64::NAN }
    };
    (0..=values.len() - width).map(at).collect()
}

/// One less the squared correlation coefficient of a template (of mean 0 and squares `own`) and a segment; 1
/// where they are opposed.
fn unexplained(template: &[f64], own: f64, segment: &[f64]) -> f64 {
    let (mut sum, mut squares, mut inner) = (0.0, 0.0, 0.0);
    for (t, x) in template.iter().zip(segment) {
        sum += x;
        squares += x * x;
        inner += t * x;
    }
    let variance = squares - sum * sum / segment.len() as f64;
    if inner <= 0.0 || variance <= 0.0 || own <= 0.0 { 1.0 } else { 1.0 - inner * inner / (variance * own) }
}

/// Products of a direct search from which estimates are worth their transforms.
const MIN_PRODUCTS: usize = 1 << 15;
/// Least variance of a segment, as a share of the squares of all that is searched, for an estimate: rounding
/// of a transform in f64, about 1e-13 of these, is then below 1e-6 of the share that is left unexplained.
const MIN_VARIANCE_SHARE: f64 = 1e-6;
/// Largest error of an estimate.
const MAX_ESTIMATE_ERROR: f64 = 1e-4;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn oracle_steps_find_the_lowest_of_a_smooth_residual() {
        for lowest in [1, 77, 500, 998] {
            let residual = |shift: usize| (shift as f64 - f64::from(lowest)).abs();
            assert_eq!(nearest(1..=999, 16, residual), lowest as usize);
        }
        assert_eq!(nearest(1..=11, 1, |shift| (shift as f64 - 4.0).abs()), 4);
    }

    /// Box samples of an edge from 0 to 1 at `at`, low-passed by a ramp of `width` samples.
    fn edge(at: f64, width: f64, samples: usize) -> Vec<f64> {
        let integral = |x: f64| {
            let u = (x - at).clamp(0.0, width.max(1e-12));
            u * u / (2.0 * width.max(1e-12)) + (x - at - width).max(0.0)
        };
        (0..samples).map(|i| integral(i as f64 + 1.0) - integral(i as f64)).collect()
    }

    fn errors(width: f64) -> Vec<f64> {
        let mut errors = Vec::new();
        for phase in 0..20 {
            let at = 20.0 + f64::from(phase) / 20.0;
            let template = edge(at, width, 60);
            for shift in 0..40 {
                let shift = 7.0 + f64::from(shift) / 40.0;
                let power = edge(at + shift, width, 100);
                errors.push(align(&power, &template, 7, 2) - shift);
            }
        }
        errors
    }

    #[test]
    fn analytic_a_sharp_edge_is_found_to_a_tenth_of_a_sample_without_bias() {
        let errors = errors(0.0);
        let worst = errors.iter().fold(0.0_f64, |a, b| a.max(b.abs()));
        let mean = errors.iter().sum::<f64>() / errors.len() as f64;
        assert!(worst < 0.13 && mean.abs() < 0.01, "worst {worst}, mean {mean}");
    }

    #[test]
    fn analytic_an_edge_a_few_samples_wide_is_found_to_a_fiftieth() {
        let worst = errors(4.0).iter().fold(0.0_f64, |a, b| a.max(b.abs()));
        assert!(worst < 0.02, "worst {worst}");
    }

    #[test]
    fn a_flat_window_moves_nothing() {
        assert_eq!(align(&[1.0; 50], &[1.0; 10], 20, 2), 20.0);
    }

    /// Draws of many lengths from sample 300 on, every one longer by a ratio, after a rest.
    fn frame(ratio: f64, gain: f64) -> Vec<f64> {
        let edges = [0.0, 7.0, 12.0, 31.0, 40.0, 66.0, 71.0, 95.0, 130.0, 170.0, 400.0];
        let heights = [0.3, 1.0, 0.5, 0.8, 0.4, 0.9, 0.6, 0.7, 0.5, 0.8];
        let power = |at: f64| {
            let draw = edges.windows(2).position(|e| (e[0] * ratio..e[1] * ratio).contains(&at));
            0.2 + gain * draw.map_or(0.0, |draw| heights[draw])
        };
        // Sample 300 is the first of the frame; each is the mean of ten places.
        (0..600)
            .map(|i| (0..10).map(|k| power(f64::from(i) - 300.0 + 0.1 * f64::from(k))).sum::<f64>() / 10.0)
            .collect()
    }

    #[test]
    fn analytic_a_frame_at_another_clock_is_aligned_at_its_start_and_its_ratio_is_found() {
        for (ratio, gain) in [(1.0 / 0.58, 0.4), (0.72, 1.6), (1.0, 1.0)] {
            let power = [frame(1.0, 1.0), frame(ratio, gain)].concat();
            for thought in [880, 900, 925] {
                let fit = ScaledSearch::new(20, 110, 60).best(&power, [300, thought]).unwrap();
                let off = fit.shift - (900.0 - thought as f64);
                assert!((fit.ratio / ratio - 1.0).abs() < 0.05, "{ratio}: {fit:?}");
                assert!(off.abs() < 1.0 && fit.unexplained < 0.1, "{ratio} {thought}: {fit:?}");
            }
        }
    }

    #[test]
    fn oracle_estimates_are_those_of_a_direct_search() {
        let noise = crate::stats::Random::new(5, 0);
        let busy = |i: usize| if (900..1000).contains(&(i % 2500)) { 2.0 } else { 0.0 };
        let power: Vec<f64> = (0..6000).map(|i| 5.0 + busy(i) + 0.01 * noise.normals(i as u64).0).collect();
        let mean = power[700..2200].iter().sum::<f64>() / 1500.0;
        let values: Vec<f64> = power[700..2200].iter().map(|watts| watts - mean).collect();
        let own: f64 = values.iter().map(|x| x * x).sum();
        let template = [Scaled { ratio: 1.0, values: values.clone(), own }];
        let found = &ScaledSearch::new(0, 1500, 2250).estimates(&template, &power)[0];
        assert_eq!(found.len(), 4501);
        let error = |(shift, estimate): (usize, &f64)| {
            (estimate - unexplained(&values, own, &power[shift..shift + 1500])).abs()
        };
        // `max` leaves NaN out.
        let worst = found.iter().enumerate().map(error).fold(0.0, f64::max);
        let known = found.iter().filter(|estimate| estimate.is_finite()).count();
        assert!(worst < 0.01 * MAX_ESTIMATE_ERROR && known > 4000, "{worst} {known}");
        let longer = [vec![5.0; 3000], power].concat();
        let flat = &ScaledSearch::new(0, 1500, 3750).estimates(&template, &longer)[0];
        assert!(flat[..1000].iter().all(|estimate| estimate.is_nan()));
        assert!(ScaledSearch::new(0, 10, 45).estimates(&[], &[1.0; 100]).is_empty());
    }

    #[test]
    fn compared_as_they_are_frames_of_unlike_clocks_are_unlike_or_misplaced() {
        let power = [frame(1.0, 1.0), frame(1.0 / 0.58, 0.4)].concat();
        let (search, starts) = (ScaledSearch::new(20, 110, 60), [300, 900]);
        let (plain, best) = (search.unscaled(&power, starts).unwrap(), search.best(&power, starts).unwrap());
        assert!(plain.unexplained > 3.0 * best.unexplained && plain.shift.abs() > 5.0, "{plain:?} {best:?}");
    }

    #[test]
    fn steady_power_and_the_ends_of_a_trace_have_no_fit() {
        let search = ScaledSearch::new(5, 50, 20);
        for later in [200, 10, 290] {
            assert_eq!(search.best(&[1.0; 300], [100, later]), None);
        }
    }
}
