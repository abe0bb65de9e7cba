//! Other ways to points that keep their distance, to be held against [`super::poisson`].
//!
//! - [`plain_darts`]: dart throwing until too many miss in a row (Cook 1986); never maximal, ever slower.
//! - [`bridson`]: candidates around points that are there (Bridson 2007, "Fast Poisson Disk Sampling in Arbitrary Dimensions"; scipy's engine);
//!   fast, not maximal, and not the distribution of dart throwing.

mod bridson;
mod cells;
mod plain;

pub use bridson::bridson;
pub use plain::plain_darts;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::points::poisson::{Domain, PoissonSpec, Spacing, ball};
    use crate::points::quality::{closer_than, free_share, largest_hole};

    const SPEC: PoissonSpec =
        PoissonSpec { radius: 0.03, domain: Domain::Torus, seed: 1, spacing: Spacing::Double };

    #[test]
    fn both_keep_the_distance_and_leave_holes() {
        let density = |n: usize| n as f64 * ball(2) * 0.03 * 0.03;
        let plain = plain_darts::<2>(&SPEC, 300).unwrap();
        let near = bridson::<2>(&SPEC, 30).unwrap();
        for points in [&plain, &near] {
            assert_eq!(closer_than(points, 0.03, Domain::Torus), 0);
            assert!(largest_hole(points, Domain::Torus).radius > 0.03 * 1.0001);
        }
        assert!(density(plain.len()) < 0.547, "{}", density(plain.len()));
        assert!(free_share(&plain, 0.03, Domain::Torus, 20_000) > 0.0);
        let volume = bridson::<3>(&PoissonSpec { radius: 0.12, domain: Domain::Box, ..SPEC }, 30).unwrap();
        assert!(volume.len() > 200 && closer_than(&volume, 0.12, Domain::Box) == 0);
    }
}
