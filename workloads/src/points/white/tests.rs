use super::*;
use crate::points::quality::{ChiSquare, chi_square};

fn spec(count: usize, seed: u64) -> WhiteSpec {
    WhiteSpec { count, seed, across: 16, numbers: Numbers::Independent }
}

fn fit<const D: usize>(density: &dyn Density<D>, spec: &WhiteSpec, cells: u64) -> ChiSquare {
    let points = white_noise(density, spec).unwrap().points;
    chi_square(&counts(&points, cells), &shares(density, cells, 8))
}

#[test]
fn bounds_are_conservative_in_every_dimension() {
    fn holds<const D: usize>() {
        let stream = Stream::new(1, D as u64);
        for (name, density) in Named::ALL {
            for number in 0..2000 {
                let at = |k: usize| stream.unit(number * 12 + k as u64);
                let low: [f64; D] = std::array::from_fn(|k| 0.9 * at(k));
                let side = 0.4 * at(4);
                let high = low.map(|low| (low + side).min(1.0));
                let point = std::array::from_fn(|k| low[k] + (high[k] - low[k]) * at(5 + k));
                assert!(
                    Density::<D>::at(&density, &point) <= density.upper_bound(&low, &high),
                    "{name} {point:?}"
                );
            }
        }
    }
    holds::<1>();
    holds::<2>();
    holds::<3>();
    holds::<4>();
}

#[test]
fn points_follow_every_density_in_one_to_four_dimensions() {
    for (name, density) in Named::ALL {
        let fits = [
            fit::<1>(&density, &spec(20_000, 1), 50),
            fit::<2>(&density, &spec(20_000, 1), 20),
            fit::<3>(&density, &spec(20_000, 1), 8),
            fit::<4>(&density, &WhiteSpec { across: 6, ..spec(20_000, 1) }, 4),
        ];
        for (dimensions, fit) in (1..).zip(fits) {
            assert!(fit.p > 0.001 && fit.p < 0.999, "{name} {dimensions}D: {fit:?}");
        }
    }
}

#[test]
fn another_density_is_rejected() {
    let points = white_noise::<2>(&Named::Ramp, &spec(20_000, 1)).unwrap().points;
    let wrong = chi_square(&counts(&points, 20), &shares::<2>(&Named::Constant, 20, 4));
    assert!(wrong.p < 1e-9, "{wrong:?}");
}

#[test]
fn low_discrepancy_fits_too_well() {
    let even = WhiteSpec { numbers: Numbers::LowDiscrepancy, across: 1, ..spec(20_000, 1) };
    assert!(fit::<1>(&Named::Constant, &even, 50).p > 0.999);
    assert!(fit::<2>(&Named::Constant, &even, 20).p > 0.999);
}

#[test]
fn columns_save_candidates() {
    let plain = white_noise::<2>(&Named::Gauss, &WhiteSpec { across: 1, ..spec(5000, 1) }).unwrap();
    let bounded = white_noise::<2>(&Named::Gauss, &WhiteSpec { across: 64, ..spec(5000, 1) }).unwrap();
    // Without columns the share of accepted candidates is 2 pi 0.15^2; with them nearly all are accepted.
    let share = 5000.0 / plain.candidates as f64;
    assert!((share - 0.1413).abs() < 0.01, "{share}");
    assert!(bounded.candidates < 6000, "{}", bounded.candidates);
}

#[test]
fn the_result_does_not_depend_on_threads() {
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| white_noise::<3>(&Named::Waves, &spec(30_000, 5)).unwrap())
    };
    assert_eq!(with(1), with(3));
}

#[test]
fn invalid_densities_are_refused() {
    assert_eq!(ImageDensity::new(2, 1, vec![0.0, 0.0]), None);
    assert_eq!(ImageDensity::new(2, 2, vec![1.0]), None);
    let half = ImageDensity::new(2, 1, vec![0.0, 1.0]).unwrap();
    let points = white_noise::<2>(&half, &spec(1000, 1)).unwrap().points;
    assert!(points.iter().all(|[x, _]| *x >= 0.5));
    let wide = WhiteSpec { across: 4097, ..spec(1, 1) };
    assert_eq!(white_noise::<2>(&Named::Ramp, &wide), Err(WhiteError::Columns(4097)));
}
