//! Collision detection: public queries, an oracle, and the ways a pair can be missed. No collision may be, ever.
#![allow(clippy::unwrap_used)]

mod common;

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};

use flate2::read::GzDecoder;
use pipeline::sampling::{mix, unit};
use proptest::prelude::*;
use workloads::collision::{Method, Object, Search, components, detect};
use workloads::visibility::load_mts;

type Ends = [[[f64; 3]; 3]; 2];

/// Searches from the simplest to the closest; none may miss anything.
const SEARCHES: [Search; 7] = [
    Search { resolution: 1, bins: 1, method: Method::FragmentBox, zoom: false },
    Search { resolution: 8, bins: 1, method: Method::BoxBox, zoom: false },
    Search { resolution: 8, bins: 4, method: Method::FragmentBox, zoom: false },
    Search { resolution: 32, bins: 16, method: Method::BoxBox, zoom: false },
    Search { resolution: 16, bins: 1, method: Method::DepthOnly, zoom: false },
    Search { resolution: 32, bins: 8, method: Method::BoxBox, zoom: true },
    Search { resolution: 64, bins: 16, method: Method::FragmentBox, zoom: true },
];

fn may_collide(a: Ends, b: Ends, search: &Search) -> bool {
    let objects = [a, b].map(|ends| Object::from_ends(vec![ends], 0.0).unwrap());
    detect(&objects, search).first().is_some_and(|answer| answer.verdict.may_collide())
}

fn public() -> Option<PathBuf> {
    let folder = common::real_scenes()?.parent()?.join("ccd");
    folder.is_dir().then_some(folder)
}

fn files_below(folder: &Path, into: &mut Vec<PathBuf>) {
    let mut entries: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() {
            files_below(&path, into);
        } else if path.extension().is_some_and(|kind| kind == "gz") {
            into.push(path);
        }
    }
}

/// The rows of a query file: a point and whether the truth of its query is a collision.
fn rows(path: &Path) -> Vec<([f64; 3], bool)> {
    let file = BufReader::new(GzDecoder::new(std::fs::File::open(path).unwrap()));
    let row = |line: String| {
        let n: Vec<f64> = line.split(',').map(|cell| cell.trim().parse().unwrap()).collect();
        ([n[0] / n[1], n[2] / n[3], n[4] / n[5]], n[6] != 0.0)
    };
    file.lines().map(|line| line.unwrap()).filter(|line| !line.is_empty()).map(row).collect()
}

#[test]
fn no_public_query_is_missed() {
    let Some(folder) = public() else { return };
    let mut files = Vec::new();
    files_below(&folder.join("queries"), &mut files);
    assert_eq!(files.len(), 42);
    let (mut collide, mut apart, mut reported) = (0, 0, [0; SEARCHES.len()]);
    for path in files {
        let vertex_face = path.parent().unwrap().ends_with("vertex-face");
        for (number, query) in rows(&path).chunks(8).enumerate() {
            let [from, to] = [0, 4].map(|end| [0, 1, 2, 3].map(|corner| query[end + corner].0));
            let pair = if vertex_face {
                [[from, to].map(|p| [p[0]; 3]), [from, to].map(|p| [p[1], p[2], p[3]])]
            } else {
                [[from, to].map(|p| [p[0], p[1], p[1]]), [from, to].map(|p| [p[2], p[3], p[3]])]
            };
            for (search, reported) in SEARCHES.iter().zip(&mut reported) {
                // Each query by the plainest, and by another one in turn.
                if *search != SEARCHES[0] && *search != SEARCHES[number % SEARCHES.len()] {
                    continue;
                }
                let found = may_collide(pair[0], pair[1], search);
                assert!(found || !query[0].1, "{}: {pair:?} missed by {search:?}", path.display());
                *reported += u32::from(found && !query[0].1);
            }
            if query[0].1 { collide += 1 } else { apart += 1 }
        }
    }
    println!("{collide} collide, {apart} do not; reported in vain by search: {reported:?}");
    assert!(collide > 0 && apart > 0 && reported[6] < reported[0]);
}

/// The pairs of `shared/ccd/README.md` that truly collide: how many there are, and how many of all pairs.
#[test]
fn public_scenes_keep_every_pair_that_collides() {
    let Some(folder) = public() else { return };
    let search = Search { resolution: 32, bins: 4, ..Search::default() };
    for (name, objects, colliding) in [
        ("cloth-ball", 2, 0),
        ("cloth-funnel", 4, 0),
        ("armadillo-rollers", 7, 2),
        ("n-body", 305, 125),
        ("rod-twist", 4, 6),
    ] {
        let meshes = load_mts(&folder.join(format!("{name}.mts.gz"))).unwrap();
        assert_eq!(meshes.len(), objects, "{name}");
        let all: Vec<_> = meshes.iter().map(|mesh| Object::new(mesh, 0.0).unwrap()).collect();
        let start = std::time::Instant::now();
        let answers = detect(&all, &search);
        let found = answers.iter().filter(|answer| answer.verdict.may_collide()).count();
        println!(
            "{name}: {} candidates, {found} may collide, {colliding} do; {:.0} ms",
            answers.len(),
            start.elapsed().as_secs_f64() * 1e3
        );
        assert!(found >= colliding, "{name}: {found} of {colliding}");
        assert_eq!(components(&meshes[0]).len(), 1, "{name}");
    }
}

/// A corner in a hash's unit cube.
fn random(seed: u64, n: u64) -> f64 {
    unit(mix(seed.wrapping_mul(1000) + n))
}

/// Two triangles made to share a point at one time: weights, time and everything else at random, then scaled and moved. The third
/// corner of the second is moved so that it does; rounding of that is within a few units of the largest coordinate, so that much is
/// given to one of them.
/// Two triangles that touch at some time, and how far rounding may have put them apart: of all sizes and places, `size` times as
/// large as the space they are in.
fn contact(seed: u64, size: f64) -> ([Ends; 2], f64) {
    let (scale, offset) = space(seed);
    let corner = |n: u64| [0, 1, 2].map(|axis| offset + scale * size * (random(seed, 3 * n + axis) - 0.5));
    let thin = |p: [f64; 3], q: [f64; 3]| [0, 1, 2].map(|axis| p[axis] + 1e-9 * (q[axis] - p[axis]));
    let mut a: Ends = [[corner(0), corner(1), corner(2)], [corner(3), corner(4), corner(5)]];
    let mut b: Ends = [[corner(6), corner(7), corner(8)], [corner(9), corner(10), corner(11)]];
    match seed % 5 {
        1 => a = a.map(|[p, q, _]| [p, thin(p, q), q]),
        2 => b = b.map(|[p, _, _]| [p; 3]),
        3 => a = [a[0]; 2],
        _ => {}
    }
    let t = [0.0, 1.0, random(seed, 90)][(seed % 7).min(2) as usize];
    let weights = match seed % 4 {
        0 => [1.0, 0.0, 0.0],
        1 => [0.5, 0.5, 0.0],
        _ => [0.25, 0.5, 0.25],
    };
    let at = |ends: &Ends, axis: usize| -> f64 {
        (0..3).map(|k| weights[k] * ((1.0 - t) * ends[0][k][axis] + t * ends[1][k][axis])).sum()
    };
    let mut largest = 0.0_f64;
    for axis in 0..3 {
        let shift = at(&a, axis) - at(&b, axis);
        b.iter_mut().flatten().for_each(|corner| corner[axis] += shift);
        largest =
            a.as_flattened().iter().chain(b.as_flattened()).map(|p| p[axis].abs()).fold(largest, f64::max);
    }
    ([a, b], 16.0 * f64::EPSILON * largest)
}

/// The size of a space, and where it is.
fn space(seed: u64) -> (f64, f64) {
    (10_f64.powi((mix(seed) % 13) as i32 - 6), if seed.is_multiple_of(3) { 1e6 } else { 0.0 })
}

#[test]
fn no_contact_made_on_purpose_is_missed() {
    for seed in 0..90_u64 {
        let ([a, b], unsure) = contact(seed, 1.0);
        let objects = [Object::from_ends(vec![a], unsure).unwrap(), Object::from_ends(vec![b], 0.0).unwrap()];
        for search in &SEARCHES {
            let found = detect(&objects, search);
            assert!(found.first().is_some_and(|f| f.verdict.may_collide()), "{seed} {search:?} {a:?} {b:?}");
        }
    }
}

/// Products of such coordinates are not numbers that there are.
#[test]
fn contacts_of_the_smallest_numbers_are_not_missed() {
    for exponent in (-1060..=-60).step_by(20) {
        let scale = 2_f64.powi(exponent / 2) * 2_f64.powi(exponent - exponent / 2);
        let at = |p: [i32; 3]| p.map(|c| f64::from(c) * scale);
        let bar = |a, b| [at(a), at(b), at(b)];
        let a: Ends = [bar([-8, 0, 0], [8, 0, 0]); 2];
        // Edge against edge at a quarter of the time.
        let b: Ends = [bar([0, -8, 2], [0, 8, 2]), bar([0, -8, -6], [0, 8, -6])];
        for search in &SEARCHES {
            assert!(may_collide(a, b, search), "2^{exponent} {search:?}");
        }
    }
}

/// Small triangles on a lattice of 5x5x5, every second one of `which`; none of one comes near one of the other.
fn crowd(seed: u64, which: u64) -> impl Iterator<Item = Ends> {
    let (scale, offset) = space(seed);
    (0..125_u64).filter(move |n| n % 2 == which && *n != 62).map(move |n| {
        let at = [n % 5, n / 5 % 5, n / 25].map(|k| offset + scale * 0.2 * (k as f64 - 2.0));
        let corner = |k: u64| {
            [0, 1, 2].map(|axis| {
                at[axis] + scale * 0.08 * (random(seed, 100 + 20 * n + 3 * k + axis as u64) - 0.5)
            })
        };
        [[corner(0), corner(1), corner(2)], [corner(3), corner(4), corner(5)]]
    })
}

#[test]
fn a_contact_in_a_crowd_is_not_missed_by_boxes() {
    let search = Search { resolution: 64, bins: 16, method: Method::FragmentBox, zoom: true };
    let mut apart = 0;
    for seed in 0..120_u64 {
        let ([a, b], unsure) = contact(seed, 0.1);
        let objects = |contact: bool| {
            let of = |which, one| crowd(seed, which).chain(contact.then_some(one)).collect();
            [Object::from_ends(of(0, a), unsure).unwrap(), Object::from_ends(of(1, b), 0.0).unwrap()]
        };
        let may = |objects: &[Object], search: &Search| {
            detect(objects, search).first().is_some_and(|found| found.verdict.may_collide())
        };
        for method in [Method::FragmentBox, Method::BoxBox] {
            assert!(may(&objects(true), &Search { method, ..search }), "{seed} {method:?}");
        }
        apart += u32::from(!may(&objects(false), &search));
    }
    // Where it all is a million sizes away from the origin, the spacing of numbers is not far below the lattice's.
    assert!(apart > 80, "the crowd alone is told apart in {apart} of 120");
}

#[test]
fn exact_contacts_of_every_kind_are_reported() {
    let floor = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let moved = |p: [[f64; 3]; 3], by: [f64; 3]| p.map(|c| [c[0] + by[0], c[1] + by[1], c[2] + by[2]]);
    let cases: [(&str, Ends, Ends); 8] = [
        ("a corner lands at the end", [floor; 2], [[[0.25, 0.25, 1.0]; 3], [[0.25, 0.25, 0.0]; 3]]),
        ("tunnelling", [floor; 2], [[[0.25, 0.25, 1024.0]; 3], [[0.25, 0.25, -1024.0]; 3]]),
        ("touching at the start only", [floor; 2], [[[1.0, 0.0, 0.0]; 3], [[2.0, 0.0, 5.0]; 3]]),
        ("coplanar sliding", [floor; 2], [moved(floor, [2.0, 0.0, 0.0]), moved(floor, [-2.0, 0.0, 0.0])]),
        ("exchanging places", [floor, moved(floor, [0.0, 0.0, 1.0])], [moved(floor, [0.0, 0.0, 1.0]), floor]),
        ("one shared corner at rest", [floor; 2], [moved(floor, [1.0, 0.0, 0.0]); 2]),
        ("the same triangle", [floor; 2], [floor; 2]),
        (
            "two segments cross at one instant",
            [[[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [1.0, 1.0, 0.0]]; 2],
            [
                [[1.0, 0.0, 0.5], [0.0, 1.0, 0.5], [0.0, 1.0, 0.5]],
                [[1.0, 0.0, -0.5], [0.0, 1.0, -0.5], [0.0, 1.0, -0.5]],
            ],
        ),
    ];
    for (name, a, b) in cases {
        for factor in [1.0, 2.0_f64.powi(-20), 2.0_f64.powi(20)] {
            let scaled = |ends: Ends| ends.map(|end| end.map(|p| p.map(|at| factor * at)));
            for search in &SEARCHES {
                assert!(may_collide(scaled(a), scaled(b), search), "{name} at {factor} by {search:?}");
                assert!(
                    may_collide(scaled(b), scaled(a), search),
                    "{name} at {factor} by {search:?}, swapped"
                );
            }
        }
    }
}

/// The toaster that dodges the ball (Fig. 6): paths that cross in space, not in time.
#[test]
fn paths_that_cross_at_different_times_are_told_apart_by_time_alone() {
    let square = |x: f64, y: f64| [[x, y, 0.0], [x + 0.2, y, 0.1], [x, y + 0.2, 0.2]];
    let a = [square(-2.0, 0.0), square(2.0, 0.0)];
    let b = [square(0.0, -1.0), square(0.0, 3.0)];
    let plain = Search { resolution: 128, bins: 1, method: Method::FragmentBox, zoom: false };
    assert!(!may_collide(a, b, &plain));
    assert!(may_collide(a, b, &Search { method: Method::DepthOnly, ..plain }));
}

/// A tip that comes near a face, stops short of it by a gap and turns aside.
#[test]
fn near_misses_are_told_apart_by_looking_closer() {
    for gap in [1e-3, 1e-5, 1e-7] {
        let face = [[[-1.0, -1.0, -0.4], [1.0, -1.0, 0.2], [0.0, 1.0, 0.3]]; 2];
        let foot = -0.4 * 0.25 + 0.2 * 0.25 + 0.3 * 0.5;
        let tip = |z: f64| [[0.0, 0.0, z], [0.1, 0.0, z + 1.0], [0.0, 0.1, z + 1.0]];
        let falling = [tip(2.0), tip(foot + gap)];
        assert!(!may_collide(face, falling, &Search::default()), "{gap}");
        assert!(may_collide(face, [tip(2.0), tip(foot - gap)], &Search::default()), "{gap}");
    }
}

/// Where the method fails: tilted planes that slide along each other closer than a tile is wide. No looking closer helps, as they are near
/// everywhere.
#[test]
fn sliding_planes_nearer_than_a_tile_are_not_told_apart() {
    let a: Ends = [[[0.0, 0.0, 0.0], [1.0, 0.0, 0.3], [0.0, 1.0, 0.6]]; 2];
    let apart = |gap: f64| {
        let slid = |by: f64| a[0].map(|[x, y, z]| [x + by, y, z + 0.3 * by + gap]);
        !may_collide(a, [slid(0.0), slid(0.5)], &Search::default())
    };
    assert!(apart(0.1) && !apart(1e-5));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]
    /// Points of one triangle found in the other by dense looking.
    #[test]
    fn what_crosses_at_a_looked_at_instant_is_reported(seed in 0_u64..1 << 40) {
        let corner = |n: u64| [0, 1, 2].map(|axis| random(seed, 3 * n + axis));
        let a: Ends = [[corner(0), corner(1), corner(2)], [corner(3), corner(4), corner(5)]];
        let b: Ends = [[corner(6), corner(7), corner(8)], [corner(9), corner(10), corner(11)]];
        let mut crossing = false;
        for step in 0..=64 {
            let t = f64::from(step) / 64.0;
            let at = |ends: &Ends| [0, 1, 2].map(|k| glam::DVec3::from(ends[0][k]).lerp(glam::DVec3::from(ends[1][k]), t));
            let (p, q) = (at(&a), at(&b));
            crossing |= pierced(&p, &q) || pierced(&q, &p);
        }
        prop_assume!(crossing);
        for search in &SEARCHES {
            prop_assert!(may_collide(a, b, search), "{search:?}");
        }
    }
}

/// Whether an edge of `p` passes well inside `q`.
fn pierced(p: &[glam::DVec3; 3], q: &[glam::DVec3; 3]) -> bool {
    let normal = (q[1] - q[0]).cross(q[2] - q[0]);
    (0..3).any(|k| {
        let (from, to) = (p[k], p[(k + 1) % 3]);
        let (d0, d1) = (normal.dot(from - q[0]), normal.dot(to - q[0]));
        if d0 * d1 >= 0.0 {
            return false;
        }
        let point = from + (to - from) * (d0 / (d0 - d1));
        (0..3).all(|e| (q[(e + 1) % 3] - q[e]).cross(point - q[e]).dot(normal) > 1e-9)
    })
}
