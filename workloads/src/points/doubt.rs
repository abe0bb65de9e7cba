//! Regimes in which points are known to be bad.

use warnings::{Code, Warning};

/// So many voids without a number in them for each point.
pub const THIN: f64 = 0.01;

/// What is to be doubted of points that keep their distance, where so many voids thinner than the spacing of numbers are left.
pub fn doubt(points: usize, thin_voids: u64) -> Option<Warning> {
    let each = thin_voids as f64 / points.max(1) as f64;
    (each > THIN).then(|| {
        Warning::new(
            Code::PointsThinVoids,
            format!(
                "{thin_voids} voids beside {points} points have no number in them (a warning from one for {:.0} points on): no other point can be \
                 written, but places are farther than r from all points; coordinates in double precision or a larger r help",
                1.0 / THIN
            ),
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::points::poisson::{Domain, PoissonSpec, Spacing, poisson_disk};

    #[test]
    fn coarse_numbers_are_doubted_and_fine_ones_are_not() {
        let doubted = |bits| {
            let spec =
                PoissonSpec { radius: 0.03, domain: Domain::Torus, seed: 1, spacing: Spacing::Bits(bits) };
            let found = poisson_disk::<2>(&spec).unwrap();
            doubt(found.points.len(), found.thin_voids).is_some()
        };
        assert!(doubted(12) && !doubted(24) && !doubted(52));
        assert!(doubt(0, 0).is_none());
    }
}
