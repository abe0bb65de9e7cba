//! Warning about points whose coordinates have too little precision.

use warnings::{Code, Warning};

/// Thin uncovered regions per point above which a warning is given.
pub const MAX_THIN_PER_POINT: f64 = 0.01;

/// Warns if dart throwing left many uncovered regions without a representable point.
pub fn thin_regions_warning(points: usize, thin_regions: u64) -> Option<Warning> {
    let per_point = thin_regions as f64 / points.max(1) as f64;
    (per_point > MAX_THIN_PER_POINT).then(|| {
        Warning::new(
            Code::PointsThinVoids,
            format!(
                "{thin_regions} voids beside {points} points have no number in them (a warning from one for {:.0} points on): no other point can be \
                 written, but places are farther than r from all points; coordinates in double precision or a larger r help",
                1.0 / MAX_THIN_PER_POINT
            ),
        )
    })
}

#[cfg(test)]
mod tests {
    use super::super::poisson::{Domain, PoissonSpec, Spacing, poisson_disk};
    use super::*;

    #[test]
    fn coarse_coordinates_are_warned_about_and_fine_ones_are_not() {
        let warned = |bits| {
            let spec =
                PoissonSpec { radius: 0.03, domain: Domain::Torus, seed: 1, spacing: Spacing::Bits(bits) };
            let found = poisson_disk::<2>(&spec).unwrap();
            thin_regions_warning(found.points.len(), found.thin_regions).is_some()
        };
        assert!(warned(12) && !warned(24) && !warned(52));
        assert!(thin_regions_warning(0, 0).is_none());
    }
}
