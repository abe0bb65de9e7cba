//! A marked window, and the exact distance of others to it.

use crate::stats::mean;
use multiversion::multiversion;

/// Least norm of a window, as a share of the template's: steady power then resembles nothing.
pub(super) const MIN_NORM_SHARE: f64 = 0.05;

/// The powers about a mark, and how others are compared with them.
pub(super) struct Template {
    pub watts: Vec<f64>,
    pub mean_w: f64,
    /// By the z-normalized distance (Goldin and Kanellakis 1995; Mueen's MASS), `2 |q|^2 (1 - r)` in W^2, with `r` the correlation
    /// coefficient and `|q|` the norm about the mean; else by the summed squared difference.
    pub normalized: bool,
}

impl Template {
    pub fn new(watts: Vec<f64>, normalized: bool) -> Self {
        Self { mean_w: mean(&watts), watts, normalized }
    }

    /// The distance of at least as many powers, W^2.
    pub fn distance_w2(&self, power_w: &[f64]) -> f64 {
        let [sum, squares, inner] = if self.normalized {
            sums(power_w, &self.watts, self.mean_w)
        } else {
            return difference(power_w, &self.watts);
        };
        let own = sums(&self.watts, &self.watts, self.mean_w)[2];
        let norm = libm::sqrt(own);
        let about = libm::sqrt((squares - sum * sum / self.watts.len() as f64).max(0.0));
        let r = inner / (about.max(MIN_NORM_SHARE * norm) * norm).max(f64::MIN_POSITIVE);
        2.0 * own * (1.0 - r).max(0.0)
    }
}

/// Summed squared difference of powers and a template, in eight lanes: always the same order, whatever
/// vectors there are.
#[multiversion(targets("x86_64+avx2"))]
fn difference(power_w: &[f64], template: &[f64]) -> f64 {
    let mut lanes = [0.0; 8];
    let whole = template.len() / 8 * 8;
    for (t, power) in template[..whole].chunks_exact(8).zip(power_w.chunks_exact(8)) {
        for lane in 0..8 {
            let difference = power[lane] - t[lane];
            lanes[lane] += difference * difference;
        }
    }
    let rest = template.iter().zip(power_w).skip(whole).map(|(t, power)| (power - t) * (power - t));
    lanes.iter().sum::<f64>() + rest.sum::<f64>()
}

/// Of powers less a mean: their sum, their squares, and their product with a template less the same mean.
fn sums(power_w: &[f64], template: &[f64], mean_w: f64) -> [f64; 3] {
    template.iter().zip(power_w).fold([0.0; 3], |[sum, squares, inner], (t, power)| {
        let power = power - mean_w;
        [sum + power, squares + power * power, inner + power * (t - mean_w)]
    })
}
