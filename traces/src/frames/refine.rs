//! Frame starts finer than a sample.

use super::profile::difference;
use core::ops::RangeInclusive;

/// The best alignment near offset `near`, in samples, fractional: the minimum of the summed squared difference within
/// `reach` of it and the vertex of the parabola through it and its two neighbours.
///
/// For a signal smooth on the scale of a sample the difference is a parabola near its minimum, and the result exact;
/// for a single sharp edge it is off by up to a tenth of a sample, alike to both sides (tests show both).
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

/// Where in a range of shifts the residual is least, looked at in steps and then about the best of them.
pub(super) fn nearest(shifts: RangeInclusive<usize>, step: usize, residual: impl Fn(usize) -> f64) -> usize {
    let (first, last) = shifts.into_inner();
    let least = |from: usize, to: usize, step: usize| {
        let judged = (from..=to).step_by(step).map(|shift| (residual(shift), shift));
        judged.min_by(|a, b| a.0.total_cmp(&b.0)).map_or(first, |(_, shift)| shift)
    };
    let rough = least(first, last, step);
    if step == 1 { rough } else { least(first.max(rough.saturating_sub(step)), last.min(rough + step), 1) }
}

/// Where the parabola through three equally spaced values is lowest, relative to the middle one, within half a step.
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
    fn a_flat_stretch_moves_nothing() {
        assert_eq!(align(&[1.0; 50], &[1.0; 10], 20, 2), 20.0);
    }
}
