use proptest::prelude::*;

use super::*;
use crate::points::quality::{closer_than, free_share, largest_hole, least_distance};

fn spec(radius: f64, domain: Domain, seed: u64) -> PoissonSpec {
    PoissonSpec { radius, domain, seed, spacing: Spacing::Double }
}

/// Checks all pairs exactly against the radius, and the largest hole.
fn check<const D: usize>(spec: &PoissonSpec) -> PoissonDisk<D> {
    let found = poisson_disk::<D>(spec).unwrap();
    let points = &found.points;
    assert!(points.iter().flatten().all(|x| (0.0..1.0).contains(x)));
    let ticks = spec.spacing.per_unit();
    assert!(points.iter().flatten().all(|x| (x * ticks).fract() == 0.0));
    for (number, a) in points.iter().enumerate() {
        let close = points[..number].iter().find(|b| closer(a, b, spec.radius, spec.domain));
        assert_eq!(close, None, "{spec:?}: {a:?}");
    }
    let hole = largest_hole(points, spec.domain);
    let slack = 4.0 * (D as f64).sqrt() / ticks;
    assert!(hole.radius <= spec.radius * (1.0 + 1e-12) + slack, "{spec:?}: {hole:?}");
    found
}

#[test]
fn points_are_maximal_in_one_to_four_dimensions() {
    for domain in [Domain::Torus, Domain::Box] {
        for seed in 0..2 {
            check::<1>(&spec(0.01, domain, seed));
            check::<2>(&spec(0.04, domain, seed));
            check::<3>(&spec(0.2, domain, seed));
        }
        check::<4>(&spec(0.4, domain, 1));
    }
}

#[test]
fn large_disks_wrap_around_the_border() {
    for radius in [0.5, 0.45, 0.34, 0.3, 0.25, 0.2501] {
        for seed in 0..4 {
            for domain in [Domain::Torus, Domain::Box] {
                check::<1>(&spec(radius, domain, seed));
                check::<2>(&spec(radius, domain, seed));
                check::<3>(&spec(radius.max(0.3), domain, seed));
            }
        }
    }
}

#[test]
fn density_is_that_of_random_sequential_adsorption() {
    // On the torus, 0.547 of the plane and 0.384 of space; the spread of 20,000 points is below 0.002.
    let density = |points: usize, radius: f64, d: usize| points as f64 * ball(d) * radius.powi(d as i32);
    let plane = poisson_disk::<2>(&spec(0.006, Domain::Torus, 3)).unwrap();
    assert!((density(plane.points.len(), 0.006, 2) - 0.547).abs() < 0.002);
    let space = poisson_disk::<3>(&spec(0.035, Domain::Torus, 3)).unwrap();
    assert!((density(space.points.len(), 0.035, 3) - 0.384).abs() < 0.003);
    let line = poisson_disk::<1>(&spec(0.0001, Domain::Torus, 3)).unwrap();
    assert!((density(line.points.len(), 0.0001, 1) - 0.7476).abs() < 0.006);
}

#[test]
fn the_mean_number_on_a_line_follows_renyi() {
    let mean = |count: u64| {
        let points = |seed| poisson_disk::<1>(&spec(0.4, Domain::Box, seed)).unwrap().points.len() as f64;
        (0..count).map(points).sum::<f64>() / count as f64
    };
    let expected = expected_points();
    assert!((mean(4000) - expected).abs() < 0.03, "{} {expected}", mean(4000));
}

/// Mean number of points of [0, 1) at least 0.4 apart: the first one divides the line (Renyi 1958).
fn expected_points() -> f64 {
    // For an interval of length l with free ends: M(l) = 1 + 2/l * integral of M(y - 0.4) over y in [0, l].
    let step = 1e-4;
    let mut mean = vec![0.0; 10_001];
    let mut sums = vec![0.0; 10_001];
    for n in 1..=10_000_usize {
        // The integral of M(y - 0.4) up to n steps is that of M up to n steps less 0.4.
        let inner = if n > 4000 { sums[n - 4000] } else { 0.0 };
        mean[n] = 1.0 + 2.0 * inner / (n as f64 * step);
        sums[n] = sums[n - 1] + step * mean[n];
    }
    mean[10_000]
}

#[test]
fn the_result_does_not_depend_on_threads() {
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let plane = poisson_disk::<2>(&spec(0.01, Domain::Torus, 5)).unwrap();
            (plane, poisson_disk::<3>(&spec(0.08, Domain::Box, 5)).unwrap())
        })
    };
    assert_eq!(with(1), with(3));
}

#[test]
fn single_precision_points_keep_the_distance_exactly() {
    for seed in 0..4 {
        let single = PoissonSpec { spacing: Spacing::Single, ..spec(0.03, Domain::Torus, seed) };
        let found = check::<2>(&single);
        assert!(found.points.iter().flatten().all(|&x| f64::from(x as f32) == x));
        assert!(least_distance(&found.points, Domain::Torus) >= 0.03);
        assert_eq!(closer_than(&found.points, 0.03, Domain::Torus), 0);
        assert_eq!(free_share(&found.points, 0.03 * (1.0 + 1e-5), Domain::Torus, 50_000), 0.0);
    }
}

#[test]
fn regions_without_a_representable_point_are_counted() {
    let thin = |spacing| {
        let spec = PoissonSpec { spacing, ..spec(0.002, Domain::Torus, 1) };
        poisson_disk::<2>(&spec).unwrap().thin_regions
    };
    assert!(thin(Spacing::Single) > 0, "disks are some thousand numbers wide");
    assert_eq!(thin(Spacing::Double), 0);
}

#[test]
fn invalid_radii_are_refused() {
    for radius in [0.0, -1.0, f64::NAN, f64::INFINITY, 0.51, 1e-15] {
        let refused = poisson_disk::<2>(&spec(radius, Domain::Torus, 1)).unwrap_err();
        assert!(matches!(refused, PoissonError::Radius { .. }), "{radius}");
    }
    let refused = poisson_disk::<3>(&spec(1e-4, Domain::Torus, 1)).unwrap_err();
    assert!(refused.to_string().contains("choose a larger r"), "{refused}");
}

#[test]
fn a_requested_number_is_met_on_average_with_borders_and_without() {
    fn mean<const D: usize>(count: f64, domain: Domain) -> f64 {
        let radius = radius_for(count, D, domain);
        let points = |seed| poisson_disk::<D>(&spec(radius, domain, seed)).unwrap().points.len() as f64;
        (1..=8).map(points).sum::<f64>() / 8.0
    }
    for domain in [Domain::Torus, Domain::Box] {
        for (dimensions, mean) in [(2, mean::<2>(200.0, domain)), (3, mean::<3>(200.0, domain))] {
            assert!((mean / 200.0 - 1.0).abs() < 0.05, "{dimensions}D, {domain:?}: {mean}");
        }
    }
}

#[test]
fn too_many_points_are_refused_with_a_radius_that_works() {
    fn least<const D: usize>(radius: f64) -> f64 {
        let PoissonError::TooMany { least, most, .. } = check::<D>(radius).unwrap_err() else {
            panic!("{radius}")
        };
        assert!(
            check::<D>(least).is_ok() && check::<D>(radius_for(most, D, Domain::Torus)).is_ok(),
            "{D} {least} {most}"
        );
        least
    }
    fn check<const D: usize>(radius: f64) -> Result<(), PoissonError> {
        let across = ((D as f64).sqrt() / radius).ceil();
        check_room(radius, D, (across + 6.0).powi(D as i32))
    }
    // The limit of 2^28 cells is reached before that of points in four dimensions.
    assert!(check_room(0.03, 4, 1.1 * MAX_CELLS).is_err() && check_room(0.03, 4, 0.9 * MAX_CELLS).is_ok());
    assert!((1e-8..1e-7).contains(&least::<1>(1e-8)));
    assert!((1e-4..1e-3).contains(&least::<2>(1e-5)));
    assert!((1e-3..1e-2).contains(&least::<3>(1e-4)) && (1e-3..0.1).contains(&least::<4>(1e-3)));
}

#[test]
fn one_point_covers_all_from_half_a_diagonal() {
    for (domain, radius) in [(Domain::Torus, 0.75_f64.sqrt()), (Domain::Box, 3.0_f64.sqrt())] {
        for spacing in [Spacing::Single, Spacing::Double] {
            let spec = PoissonSpec { spacing, ..spec(radius, domain, 1) };
            assert_eq!(check::<3>(&spec).points.len(), 1);
            let less = PoissonSpec { radius: radius - 1e-9, ..spec };
            assert!(poisson_disk::<3>(&less).unwrap_err().to_string().contains("for a single point"));
        }
    }
    assert_ne!(
        check::<2>(&spec(1.0, Domain::Torus, 1)).points,
        check::<2>(&spec(1.0, Domain::Torus, 2)).points
    );
}

#[test]
fn progress_reports_more_and_more_points() {
    let mut reported = Vec::new();
    let spec = spec(0.003, Domain::Torus, 1);
    let found = poisson_disk_with_progress::<2>(&spec, &mut |points| reported.push(points)).unwrap();
    assert!(reported.len() > 5 && reported.is_sorted() && reported[reported.len() / 2] > 0, "{reported:?}");
    assert_eq!(found, poisson_disk::<2>(&spec).unwrap());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]
    #[test]
    fn any_radius_and_seed(radius in 0.05_f64..0.5, seed in any::<u64>(), torus in any::<bool>(), bits in prop_oneof![Just(24_u32), Just(52), 12_u32..24]) {
        let domain = if torus { Domain::Torus } else { Domain::Box };
        let spacing = match bits {
            24 => Spacing::Single,
            52 => Spacing::Double,
            bits => Spacing::Bits(bits),
        };
        check::<2>(&PoissonSpec { radius, domain, seed, spacing });
        check::<3>(&PoissonSpec { radius: radius.max(0.2), domain, seed, spacing });
    }
}

/// The first accepted dart of a level is the one with the earliest time.
#[test]
fn darts_of_a_level_are_accepted_in_order_of_time() {
    const SEEDS: u64 = 2000;
    let first = |seed| {
        let spec = PoissonSpec { radius: 0.2, domain: Domain::Torus, seed, spacing: Spacing::Double };
        let progress: &mut dyn FnMut(usize) = &mut |_| ();
        let mut throwing = Throwing::<2>::new(&spec, progress).unwrap();
        let uncovered = UncoveredCells::all(&throwing.grid);
        throwing.level(&uncovered);
        throwing.grid.points[0]
    };
    let mut mean = [0.0; 2];
    for [x, y] in (0..SEEDS).map(first) {
        mean = [mean[0] + x / SEEDS as f64, mean[1] + y / SEEDS as f64];
    }
    // The standard error of the mean is 0.0065.
    assert!(mean.iter().all(|mean| (mean - 0.5).abs() < 0.026), "{mean:?}");
}

#[test]
fn cells_without_a_free_point_are_counted_and_others_filled() {
    let spec = PoissonSpec { radius: 0.25, domain: Domain::Box, seed: 1, spacing: Spacing::Single };
    let progress: &mut dyn FnMut(usize) = &mut |_| ();
    let mut throwing = Throwing::<2>::new(&spec, progress).unwrap();
    let middle = throwing.grid.dart_at(&[0.5, 0.5]);
    assert!(throwing.keep(&middle) && !throwing.keep(&middle));
    let level = 20;
    let at = |x: f64| (x * throwing.grid.across as f64 * f64::from(1 << level)) as u64;
    let cells = vec![[at(0.51); 2], [at(0.6); 2], [at(0.1); 2]];
    assert_eq!(throwing.test_representable_points(&UncoveredCells { level, cells }), 2);
    assert_eq!(throwing.grid.points.len(), 2);
}
