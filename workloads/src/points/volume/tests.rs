use activity::Event;
use glam::DVec3;
use pipeline::sampling::{HashedSamples, LensShape};

use super::*;
use crate::job::testing::hardware;
use crate::points::quality::chi_square;
use crate::points::white::counts;

/// The unit cube as triangles.
fn cube() -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let corners = (0..8).map(|n| DVec3::new(f64::from(n & 1), f64::from(n >> 1 & 1), f64::from(n >> 2)));
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = quads.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    (corners.collect(), triangles)
}

#[test]
fn the_torus_has_the_volume_and_the_moment_of_its_samples() {
    let torus = Torus::default();
    let samples = HashedSamples::new(4, 256, 8, LensShape::Square).unwrap();
    let (found, _) = standard_mode(&torus, 256, &samples, &hardware()).unwrap();
    let (n, all) = (found.points.len() as f64, found.samples as f64);
    let share = torus.volume();
    let deviation = (all * share * (1.0 - share)).sqrt();
    assert!((n - all * share).abs() < 3.0 * deviation, "{n} of {}", all * share);
    let moment = |[x, y, ..]: &SamplePoint| (x - 0.5).powi(2) + (y - 0.5).powi(2);
    let sum: f64 = found.points.iter().map(moment).sum();
    assert!((sum / all / torus.moment() - 1.0).abs() < 0.01, "{}", sum / all);
    assert!(found.covered as f64 > n && (found.covered as f64) < 1.2 * n, "{} covered", found.covered);
}

#[test]
fn no_sample_of_the_torus_is_missed_by_the_moving_triangles() {
    for torus in [Torus::default(), Torus { ring: 0.21, tube: 0.2 }, Torus { ring: 0.45, tube: 0.02 }] {
        let samples = HashedSamples::new(9, 96, 16, LensShape::Square).unwrap();
        let (found, work) = standard_mode(&torus, 96, &samples, &hardware()).unwrap();
        assert_eq!(found.points, every_sample(&torus, 96, &samples), "{torus:?}");
        let counts = work.counts();
        assert!(counts[Event::PixelInvocations] >= counts[Event::SamplesHit]);
        assert!(counts[Event::ShaderOps] > 0 && found.covered >= found.points.len() as u64);
    }
}

#[test]
fn four_and_five_dimensions_have_their_volume_and_no_sample_is_missed() {
    let still = Blurred { blur: 0.0, ..Blurred::FIVE };
    for disk in [Blurred::FOUR, Blurred::FIVE, still] {
        let samples = HashedSamples::new(11, 128, 16, LensShape::Square).unwrap();
        let (found, _) = standard_mode(&disk, 128, &samples, &hardware()).unwrap();
        assert_eq!(found.points, every_sample(&disk, 128, &samples), "{disk:?}");
        let (n, all, share) = (found.points.len() as f64, found.samples as f64, disk.volume());
        let deviation = (all * share * (1.0 - share)).sqrt();
        assert!((n - all * share).abs() < 3.0 * deviation, "{disk:?}: {n} of {}", all * share);
        let lane = Lane::default();
        let sum: f64 = found.points.iter().map(|point| disk.from_axis(&lane, point)).sum();
        assert!((sum / all / disk.moment() - 1.0).abs() < 0.02, "{disk:?}: {}", sum / all);
        assert!(found.covered as f64 > n && (found.covered as f64) < 1.1 * n, "{} covered", found.covered);
    }
}

#[test]
fn bounds_contain_the_torus() {
    let torus = Torus::default();
    for tiles in [1, 7, 32, 128] {
        let bounds = torus.bounds(tiles);
        assert!(bounds.volume() >= torus.volume(), "{tiles}");
        let found = bounds.sample_density(&torus, 200_000.0, 3);
        let n = found.points.len() as f64;
        let share = torus.volume() / bounds.volume();
        let deviation = (found.candidates as f64 * share * (1.0 - share)).sqrt();
        assert!((n - 200_000.0 * torus.volume()).abs() < 3.0 * deviation, "{tiles}: {n}");
    }
    assert!(torus.bounds(128).volume() < 1.25 * torus.volume());
}

#[test]
fn points_of_a_cube_are_uniform_and_inside() {
    let (positions, triangles) = cube();
    let solid = Solid::new(&positions, &triangles, 9).unwrap();
    assert!((solid.volume() - 1.0).abs() < 1e-12);
    let found = solid.bounds().sample(&solid, 20_000, 1);
    assert!(found.points.iter().flatten().all(|x| (0.0..=1.0).contains(x)));
    let fit = chi_square(&counts(&found.points, 8), &[1.0; 512]);
    assert!(fit.p > 0.001 && fit.p < 0.999, "{fit:?}");
    assert!(found.candidates < 20_100, "a cube fills its bounds: {}", found.candidates);
}

#[test]
fn points_of_a_tetrahedron_satisfy_its_inequalities() {
    let corners = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    let faces = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
    let solid = Solid::new(&corners, &faces, 16).unwrap();
    assert!((solid.volume() - 1.0 / 6.0).abs() < 1e-12);
    let stream = Stream::new(5, 5);
    for number in 0..20_000 {
        let point: [f64; 3] = std::array::from_fn(|k| stream.unit(3 * number + k as u64));
        let tile = ((point[1] * 16.0) as usize) * 16 + (point[0] * 16.0) as usize;
        let sum: f64 = point.iter().sum();
        if (sum - 1.0).abs() > 1e-6 {
            assert_eq!(solid.contains(&point, tile), sum < 1.0, "{point:?}");
        }
    }
}

#[test]
fn an_open_or_empty_surface_is_refused() {
    let (positions, mut triangles) = cube();
    assert_eq!(Solid::new(&positions, &[], 4).unwrap_err(), SolidError::NoTriangles);
    triangles[0].swap(0, 1);
    assert_eq!(Solid::new(&positions, &triangles, 4).unwrap_err(), SolidError::Open(6));
    triangles.remove(0);
    assert_eq!(Solid::new(&positions, &triangles, 4).unwrap_err(), SolidError::Open(3));
    let flat = vec![DVec3::ZERO; 8];
    assert_eq!(Solid::new(&flat, &cube().1, 4).unwrap_err(), SolidError::Flat);
    let far: Vec<DVec3> = cube().0.iter().map(|corner| *corner * 1e61).collect();
    assert_eq!(Solid::new(&far, &cube().1, 4).unwrap_err(), SolidError::TooFar);
}
