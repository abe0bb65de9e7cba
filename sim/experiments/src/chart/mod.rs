//! Charts of the book, one module for each; each is a [`Study`](crate::study::Study).
//!
//! - [`anchors`]: rates beside those that others measured on parts.
//! - [`caustics`]: shader executions of caustics, by how beams are bounded.
//! - [`ccd`]: false positives of collision detection.
//! - [`compute`]: cost of programs of groups, by group size, layout and contention.
//! - [`deferred`]: deferred against forward rendering over lights, overdraw, formats and samples.
//! - [`frames`]: how well frame starts are found, by method, over rate, noise, resolution and host time.
//! - [`glossy`]: glossy reflection and refraction against brute force and accumulation.
//! - [`growth`]: time of the visibility engine over triangles, samples and blur.
//! - [`memory`]: traffic and energy over the size of the levels below the L2.
//! - [`multiview`]: stereo and multi-view in one pass against view by view and accumulation.
//! - [`occlusion`]: what occlusion queries find, and what they cost.
//! - [`points`]: quality of points over points a second.
//! - [`sampled`]: frames predicted from few against all of them.
//! - [`sampling`]: image error over samples per pixel and over host time.
//! - [`soft_shadows`]: soft shadows in one pass against accumulation buffering.
//! - [`stated_errors`]: errors of timing levels on GPUs drawn at random, and how often the stated ones hold.
//! - [`tile_tests`]: what each combination of tile tests gains over what it costs.
//! - [`timing`]: every level of timing against the reference.
//!
//! What they share is here: exponents of power laws (least squares on logarithms), quantiles, errors of
//! images, and the shader of images in which only edges matter.

pub mod anchors;
pub mod caustics;
pub mod ccd;
pub mod compute;
pub mod deferred;
pub mod frames;
pub mod glossy;
pub mod growth;
pub mod memory;
pub mod multiview;
pub mod occlusion;
pub mod points;
pub mod sampled;
pub mod sampling;
pub mod soft_shadows;
pub mod stated_errors;
pub mod tile_tests;
pub mod timing;

use glam::{Vec3, Vec4};
use pipeline::{Lane, Shader, ShadingPoint};

/// The exponent `p` of `y = c x^p` that fits the points best in the logarithms of both, or `None` where fewer
/// than two points above zero differ in `x`.
pub fn exponent(points: impl IntoIterator<Item = (f64, f64)>) -> Option<f64> {
    let positive = points.into_iter().filter(|(x, y)| *x > 0.0 && *y > 0.0 && x.is_finite() && y.is_finite());
    let logs: Vec<(f64, f64)> = positive.map(|(x, y)| (libm::log(x), libm::log(y))).collect();
    let count = logs.len() as f64;
    let mean = |of: fn(&(f64, f64)) -> f64| logs.iter().map(of).sum::<f64>() / count;
    let (x_mean, y_mean) = (mean(|p| p.0), mean(|p| p.1));
    let spread: f64 = logs.iter().map(|(x, _)| (x - x_mean) * (x - x_mean)).sum();
    let joint: f64 = logs.iter().map(|(x, y)| (x - x_mean) * (y - y_mean)).sum();
    (logs.len() > 1 && spread > 0.0).then(|| joint / spread)
}

/// Where the upper half of a range begins on a logarithmic axis, ends above zero: at the root of their product.
pub fn upper_half(low: f64, high: f64) -> f64 {
    libm::sqrt(low) * libm::sqrt(high)
}

/// The quantiles of some values, linear between ranks, so that the median of an even number of values is the
/// mean of the two in the middle; 0 where there are none.
fn quantiles(values: impl Iterator<Item = f64>) -> impl Fn(f64) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    move |quantile| {
        let rank = quantile * values.len().saturating_sub(1) as f64;
        let at = |rank: f64| values.get(rank as usize).copied().unwrap_or(0.0);
        let (below, above) = (at(rank.floor()), at(rank.ceil()));
        // Equal neighbours may be infinite.
        if below == above { below } else { below + rank.fract() * (above - below) }
    }
}

/// White all over, at no cost.
struct White;

impl Shader for White {
    fn shade(&self, _lane: &Lane, _at: &ShadingPoint, _texel: Vec4) -> Vec4 {
        Vec4::ONE
    }
}

/// The differences of two images, channel by channel.
fn errors(image: &[Vec3], reference: &[Vec3]) -> Vec<f64> {
    let pixels = image.iter().zip(reference);
    pixels.flat_map(|(a, b)| (*a - *b).to_array()).map(f64::from).collect()
}

/// The mean of the squares.
fn mean_square(errors: &[f64]) -> f64 {
    errors.iter().map(|error| error * error).sum::<f64>() / errors.len().max(1) as f64
}

/// The correlation of the errors of pixels side by side, in rows of `width` pixels of three channels.
fn neighbours(errors: &[f64], width: usize) -> f64 {
    let products =
        errors.chunks_exact(3 * width).flat_map(|row| row.iter().zip(&row[3..]).map(|(a, b)| a * b));
    let (sum, count) = products.fold((0.0, 0_u32), |(sum, count), product| (sum + product, count + 1));
    let squares = mean_square(errors);
    if count == 0 || squares == 0.0 { 0.0 } else { sum / f64::from(count) / squares }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn costs_of_other_work_over_another_reference_are_not_in_one_panel() {
        assert_ne!(timing::HOST_TIME, sampled::HOST_TIME);
    }

    #[test]
    fn a_power_law_gives_its_exponent() {
        for p in [-1.5, -0.5, 0.0, 2.0] {
            let points = [1.0_f64, 2.0, 7.0, 64.0].map(|x| (x, 3.0 * x.powf(p)));
            assert!((exponent(points).unwrap() - p).abs() < 1e-12);
        }
    }

    #[test]
    fn the_upper_half_leaves_a_floor_out() {
        let from = upper_half(1.0, 256.0);
        assert_eq!(from, 16.0);
        let curve = [1.0, 4.0, 16.0, 64.0, 256.0].map(|x: f64| (x, 2.0 * x.powf(0.75).max(8.0)));
        let upper = curve.into_iter().filter(|(x, _)| *x >= from);
        assert!((exponent(upper).unwrap() - 0.75).abs() < 1e-12);
        assert!(exponent(curve).unwrap() < 0.7, "the floor would flatten the fit");
    }

    #[test]
    fn too_little_to_fit_gives_none() {
        assert_eq!(exponent([]), None);
        assert_eq!(exponent([(4.0, 1.0)]), None);
        assert_eq!(exponent([(4.0, 1.0), (4.0, 2.0)]), None);
        assert_eq!(exponent([(4.0, 1.0), (8.0, 0.0), (16.0, f64::NAN)]), None);
    }

    #[test]
    fn linear_between_ranks() {
        let of = quantiles([3.0, 1.0, 2.0, 4.0].into_iter());
        assert_eq!([0.0, 0.25, 0.5, 1.0].map(of), [1.0, 1.75, 2.5, 4.0]);
        let of = quantiles([1.0, 5.0, 2.0].into_iter());
        assert_eq!([0.0, 0.25, 0.5, 0.75, 1.0].map(of), [1.0, 1.5, 2.0, 3.5, 5.0]);
        assert_eq!(quantiles([7.0].into_iter())(0.95), 7.0);
        assert_eq!(quantiles(std::iter::empty())(0.5), 0.0);
    }

    /// Six animations at level `packet`: the upper of the two in the middle is 0.126.
    #[test]
    fn the_median_of_six_is_the_mean_of_the_third_and_the_fourth() {
        let of = quantiles([0.002, 0.006, 0.021, 0.126, 0.243, 0.753].into_iter());
        assert!((of(0.5) - 0.0735).abs() < 1e-12);
    }
}
