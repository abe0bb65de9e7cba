//! Caustics, compared with closed forms, photons, energy conservation and brute force.

use std::f64::consts::TAU;

use crate::curved::BallLens;
use glam::{DVec2, DVec3};
use pipeline::random::SplitMix;
use workloads::caustics::generator::{Ocean, Wave};
use workloads::caustics::{
    Beam, BeamMethod, Eye, Floor, LightQuantity, Squares, crossing, draw, error, receivers,
};

const DEPTH: f64 = 4.0;
const FLOOR: Floor = Floor { height_m: -DEPTH };

fn ocean(cells: u32, slope: f64) -> Ocean {
    Ocean { overshoot: 0.02, ..Ocean::new(cells, 8.0, DEPTH, [3.0, slope], 5) }
}

/// A view from above, `across` metres wide and high.
fn above(across: f64, pixels: u32) -> Eye {
    Eye::new([10.0 * DVec3::Y, DVec3::ZERO, DVec3::NEG_Z], 0.5 * across, [pixels; 2]).unwrap()
}

/// A view from the side, slightly above.
fn aside(pixels: [u32; 2]) -> Eye {
    Eye::new([DVec3::new(6.0, 7.0, 20.0), DVec3::new(0.5, -2.0, 0.0), DVec3::Y], 4.0, pixels).unwrap()
}

fn flux_w(beams: &[Beam]) -> f64 {
    beams.iter().map(|beam| beam.flux_w).sum()
}

#[test]
fn every_method_draws_the_same_image_with_moving_triangles_cheapest() {
    for (slope, light) in
        [(0.15, LightQuantity::Volume), (0.3, LightQuantity::Floor(FLOOR)), (0.6, LightQuantity::Volume)]
    {
        let (beams, eye) = (ocean(10, slope).beams(0.0), aside([84, 56]));
        let ours = draw(&beams, &eye, BeamMethod::Moving, Some(light));
        assert!(ours.light.iter().filter(|light| **light > 0.0).count() > 500);
        let mut totals = vec![ours.total_runs()];
        for method in [BeamMethod::Refined, BeamMethod::Hull, BeamMethod::Prism] {
            let theirs = draw(&beams, &eye, method, Some(light));
            assert_eq!(theirs.light, ours.light, "{method:?} at {slope}: the same image bit for bit");
            assert!(theirs.runs.iter().zip(&ours.runs).all(|(theirs, ours)| theirs >= ours), "{method:?}");
            totals.push(theirs.total_runs());
        }
        assert!(totals[1..].iter().all(|total| *total > totals[0]), "{totals:?}");
        assert!(totals[3] > totals[2], "the prism is the largest: {totals:?}");
    }
}

/// Corners offset along the light: sides cross over a tenth of the length. All methods still draw the same
/// image and miss nothing. The floor differs from photons by as much as without the offset. Only the bound
/// without cuts loses light.
#[test]
fn crossed_sides_make_the_uncut_bound_lose_light() {
    let flat = Ocean { overshoot: 0.25, ..Ocean::new(24, 16.0, 8.0, [5.0, 0.3], 1) };
    let pleated = Ocean { pleat: 0.4, ..flat.clone() };
    let (eye, floor, side) = (above(8.0, 128), Floor { height_m: -8.0 }, aside([84, 56]));
    let squares = Squares { eye: &eye, side_px: 8 };
    let known = squares.on_floor(&flat, 0.0, &floor, [600, 1]);
    let difference = |ocean: &Ocean| {
        let image = draw(&ocean.beams(0.0), &eye, BeamMethod::Moving, Some(LightQuantity::Floor(floor)));
        error(&squares.of_image(&image.light), &known)
    };
    let beams = pleated.beams(0.0);
    assert!(crossing(&beams) > 0.05 && crossing(&flat.beams(0.0)) < 0.01, "{}", crossing(&beams));
    let (crossed, straight) = (difference(&pleated), difference(&flat));
    assert!((crossed - straight).abs() < 0.03, "{crossed} {straight}");
    let ours = draw(&beams, &side, BeamMethod::Moving, Some(LightQuantity::Volume));
    for method in [BeamMethod::Refined, BeamMethod::Hull, BeamMethod::Prism] {
        let theirs = draw(&beams, &side, method, Some(LightQuantity::Volume));
        assert_eq!(theirs.light, ours.light, "{method:?}");
    }
    assert_eq!(receivers(&beams, &eye, BeamMethod::Moving, &floor).missed, 0);
    let uncut = draw(&beams, &side, BeamMethod::Uncut, Some(LightQuantity::Volume));
    assert!(uncut.light.iter().sum::<f64>() < (1.0 - 1e-4) * ours.light.iter().sum::<f64>());
}

#[test]
fn drawing_does_not_depend_on_threads() {
    let (beams, eye) = (ocean(10, 0.3).beams(0.2), aside([100, 70]));
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| draw(&beams, &eye, BeamMethod::Refined, Some(LightQuantity::Volume)))
    };
    assert_eq!(with(1), with(3));
}

#[test]
fn no_point_of_the_floor_in_a_beam_is_missed() {
    for (cells, slope) in [(12, 0.2), (8, 0.8)] {
        let (beams, eye) = (ocean(cells, slope).beams(0.0), aside([64, 40]));
        for method in BeamMethod::ALL {
            let found = receivers(&beams, &eye, method, &FLOOR);
            assert_eq!(found.missed, 0, "{method:?}");
            assert!(found.lit > 300 && found.by_hits.iter().sum::<u64>() == found.lit, "{found:?}");
        }
    }
}

/// All light that enters arrives: on the floor, and in the volume as flux times path length.
#[test]
fn energy_is_kept() {
    for slope in [0.05, 0.3] {
        let ocean = ocean(24, slope);
        let beams = ocean.beams(0.0);
        let eye = above(16.0, 480);
        let pixel_m2 = (eye.scale_px() * eye.scale_px()).recip();
        for method in [BeamMethod::Moving, BeamMethod::Prism] {
            let floor = draw(&beams, &eye, method, Some(LightQuantity::Floor(FLOOR)));
            let arrives = floor.light.iter().sum::<f64>() * pixel_m2;
            assert!((arrives / flux_w(&beams) - 1.0).abs() < 0.01, "{slope}: {}", arrives / flux_w(&beams));
        }
        let volume =
            draw(&beams, &eye, BeamMethod::Moving, Some(LightQuantity::Volume)).light.iter().sum::<f64>()
                * pixel_m2;
        let path = |beam: &Beam| beam.flux_w * (0..3).map(|k| beam.path(k).length()).sum::<f64>() / 3.0;
        let known: f64 = beams.iter().map(path).sum();
        assert!((volume / known - 1.0).abs() < 0.01, "{slope}: {}", volume / known);
    }
}

/// Start and end of a photon of a random beam, in proportion to flux.
fn photon(random: &mut SplitMix, beams: &[Beam], until: &[f64]) -> [DVec3; 2] {
    let at = random.next_unit() * until[until.len() - 1];
    let beam = &beams[until.partition_point(|sum| *sum < at)];
    let (mut b, mut c) = (random.next_unit(), random.next_unit());
    if b + c > 1.0 {
        (b, c) = (1.0 - b, 1.0 - c);
    }
    [&beam.open, &beam.close].map(|x| x[0] * (1.0 - b - c) + x[1] * b + x[2] * c)
}

/// Chi-square of counts against expectations, and the number of bins.
fn chi_square(counts: &[f64], expected: &[f64]) -> (f64, f64) {
    let used = counts.iter().zip(expected).filter(|(_, expected)| **expected > 25.0);
    used.fold((0.0, 0.0), |(sum, bins), (count, expected)| {
        (sum + (count - expected).powi(2) / expected, bins + 1.0)
    })
}

/// Photons on the floor follow the image, in bins of 48x48 pixels, by chi-square.
#[test]
fn photons_on_the_floor_follow_the_image() {
    let beams = ocean(24, 0.25).beams(0.0);
    let until: Vec<f64> = beams
        .iter()
        .scan(0.0, |sum, beam| {
            *sum += beam.flux_w;
            Some(*sum)
        })
        .collect();
    let (bins, fine) = (16, 48);
    let eye = above(12.0, bins * fine);
    let image = draw(&beams, &eye, BeamMethod::Moving, Some(LightQuantity::Floor(FLOOR)));
    let photons = 40_000;
    let per_photon = flux_w(&beams) / f64::from(photons);
    let pixel_m2 = (eye.scale_px() * eye.scale_px()).recip();
    let side = (bins * fine) as usize;
    let mut expected = vec![0.0; (bins * bins) as usize];
    for (place, light) in image.light.iter().enumerate() {
        let [x, y] = [place % side, place / side].map(|at| at / fine as usize);
        expected[y * bins as usize + x] += light * pixel_m2 / per_photon;
    }
    let (mut counts, mut random) = (vec![0.0; expected.len()], SplitMix::new(9));
    for _ in 0..photons {
        let [from, to] = photon(&mut random, &beams, &until);
        let at = from + (to - from) * ((FLOOR.height_m - from.y) / (to.y - from.y));
        let place = eye.image(at) + DVec3::splat(0.5 * f64::from(bins * fine));
        let [x, y] = [place.x, place.y].map(|at| (at / f64::from(fine)) as usize);
        counts[y * bins as usize + x] += 1.0;
    }
    let (chi, bins) = chi_square(&counts, &expected);
    // Six standard deviations of chi-square; the image itself has an error near caustics.
    assert!(bins > 80.0 && chi < bins + 6.0 * (2.0 * bins).sqrt(), "{chi} in {bins} bins");
    // The test is sensitive: a uniform image fails.
    let mean = expected.iter().filter(|e| **e > 25.0).sum::<f64>() / bins;
    let even: Vec<f64> = expected.iter().map(|e| if *e > 25.0 { mean } else { 0.0 }).collect();
    assert!(chi_square(&counts, &even).0 > 10.0 * bins);
}

/// Photon paths in the volume follow the image.
#[test]
fn photon_paths_follow_the_image_of_the_volume() {
    let beams = ocean(16, 0.25).beams(0.0);
    let until: Vec<f64> = beams
        .iter()
        .scan(0.0, |sum, beam| {
            *sum += beam.flux_w;
            Some(*sum)
        })
        .collect();
    let (bins, fine) = ([24_u32, 16], 20);
    let eye = aside(bins.map(|bins| bins * fine));
    let image = draw(&beams, &eye, BeamMethod::Moving, Some(LightQuantity::Volume));
    // Random positions on rays, each of which represents a part of the path.
    let places = 200_000;
    let mut random = SplitMix::new(4);
    let (mut counts, mut expected) = (vec![0.0; 24 * 16], vec![0.0; 24 * 16]);
    let mut path = 0.0;
    for _ in 0..places {
        let [from, to] = photon(&mut random, &beams, &until);
        let length = (to - from).length();
        path += length;
        let place = eye.image(from + random.next_unit() * (to - from));
        let [x, y] = [(place.x + 240.0) / 20.0, (place.y + 160.0) / 20.0].map(|at| at.floor() as i64);
        if (0..24).contains(&x) && (0..16).contains(&y) {
            counts[(y * 24 + x) as usize] += length;
        }
    }
    let mean = path / f64::from(places);
    counts.iter_mut().for_each(|count| *count /= mean);
    let unit = flux_w(&beams) * mean / f64::from(places);
    let pixel_m2 = (eye.scale_px() * eye.scale_px()).recip();
    for (place, light) in image.light.iter().enumerate() {
        let [x, y] = [place % 480 / 20, place / 480 / 20];
        expected[y * 24 + x] += light * pixel_m2 / unit;
    }
    let (chi, bins) = chi_square(&counts, &expected);
    assert!(bins > 100.0 && chi < bins + 6.0 * (2.0 * bins).sqrt(), "{chi} in {bins} bins");
}

/// A sinusoidal surface of small slope: `x' = x + Z (1 - 1/n) h'(x)`. Irradiance is the sum of `1 / |dx'/dx|`
/// over the sheets, before and behind the focus.
#[test]
fn one_wave_agrees_with_the_closed_form() {
    let (amplitude_m, number, bend) = (0.001, TAU, 1.0 - 1.0 / 1.33);
    let focus = 1.0 / (bend * amplitude_m * number * number);
    for (depth_m, allowed) in [(0.5 * focus, 0.01), (2.0 * focus, 0.03)] {
        let wave = Wave { amplitude_m, number: DVec2::new(number, 0.0), rate: 0.0, phase: 0.0 };
        let mut water = Ocean { overshoot: 0.01, ..Ocean::new(300, 3.0, depth_m, [1.0, 0.1], 1) };
        (water.waves, water.sun) = (vec![wave], DVec3::NEG_Y);
        let eye = above(1.0, 200);
        let floor = LightQuantity::Floor(Floor { height_m: -depth_m });
        let image = draw(&water.beams(0.0), &eye, BeamMethod::Moving, Some(floor));
        let enters = 1.0 - (0.33_f64 / 2.33).powi(2);
        let (mut difference, mut sum) = (0.0, 0.0);
        for column in 0..200 {
            let at = (f64::from(column) + 0.5) / 200.0 - 0.5;
            let known = 1000.0 * enters * sheets(at, depth_m * bend * amplitude_m * number, number);
            // The closed form diverges near the bright lines.
            if known < 5000.0 {
                let found = (0..200).map(|row| image.light[row * 200 + column as usize]).sum::<f64>() / 200.0;
                difference += (found - known).abs();
                sum += known;
            }
        }
        assert!(difference < allowed * sum, "{depth_m}: {}", difference / sum);
    }
}

/// Sum of `1 / |dx'/dx|` over all `x` of a wave that lead to `at`, with `x' = x - reach sin(k x)`.
fn sheets(at: f64, reach: f64, number: f64) -> f64 {
    let steps = 40_000;
    let x = |n: i32| at - 1.0 + 2.0 * f64::from(n) / f64::from(steps);
    let beside = |n: i32| x(n) - reach * (number * x(n)).sin() - at;
    let crosses = (0..steps).filter(|n| (beside(*n) < 0.0) != (beside(n + 1) < 0.0));
    crosses.map(|n| (1.0 - reach * number * (number * x(n)).cos()).abs().recip()).sum()
}

/// Behind a ball lens, irradiance on a plane across the axis is the sum of `h dh / (rho d rho)` over the
/// sheets.
#[test]
fn a_ball_lens_agrees_with_the_closed_form() {
    let reach_m = 4.0;
    let ball = BallLens {
        radius_m: 1.0,
        index: 1.5,
        aperture: 0.3,
        rings: 60,
        segments: 240,
        reach_m: 1.01 * reach_m,
    };
    // The axis is x; the rotation makes the light go down.
    let turn = |p: DVec3| DVec3::new(p.y, -p.x, p.z);
    let beams: Vec<Beam> = ball
        .beams()
        .into_iter()
        .map(|beam| Beam { open: beam.open.map(turn), close: beam.close.map(turn), ..beam })
        .collect();
    let eye = above(2.0, 240);
    let image =
        draw(&beams, &eye, BeamMethod::Moving, Some(LightQuantity::Floor(Floor { height_m: -reach_m })));
    let lands = |h: f64| {
        let (i, r) = (h.asin(), (h / 1.5).asin());
        let turned = 2.0 * (i - r);
        // The line at distance h from the centre with normal (sin D, cos D).
        (h - reach_m * turned.sin()) / turned.cos()
    };
    for h in [0.05, 0.1, 0.15, 0.2, 0.25] {
        let (rho, step) = (lands(h), 1e-6);
        let spread = (lands(h + step) - rho) / step;
        let known = 0.96 * 0.96 * (h / (rho * spread)).abs();
        let column = ((rho.abs() / 2.0 + 0.5) * 240.0) as usize;
        let found = 0.5 * (image.light[119 * 240 + column] + image.light[120 * 240 + column]);
        assert!((found / known - 1.0).abs() < 0.05, "{h}: {found} {known}");
    }
}
