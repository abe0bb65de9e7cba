//! Constructed contacts.

use pipeline::random::mix;
use workloads::collision::{CollisionMethod, Object, PairSearch, detect};

use super::{Ends, SEARCHES, may_collide, random};

/// Two random triangles that share a point at one time, and the uncertainty of their contact. Their size is
/// `size` of the space that they are in. The second is moved until both share a point; its rounding error is
/// a few ulps of the largest coordinate.
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

/// Size and offset of a space.
fn space(seed: u64) -> (f64, f64) {
    (10_f64.powi((mix(seed) % 13) as i32 - 6), if seed.is_multiple_of(3) { 1e6 } else { 0.0 })
}

#[test]
fn no_constructed_contact_is_missed() {
    for seed in 0..90_u64 {
        let ([a, b], uncertainty) = contact(seed, 1.0);
        let objects =
            [Object::from_ends(vec![a], uncertainty).unwrap(), Object::from_ends(vec![b], 0.0).unwrap()];
        for search in &SEARCHES {
            let found = detect(&objects, search);
            assert!(found.first().is_some_and(|f| f.verdict.may_collide()), "{seed} {search:?} {a:?} {b:?}");
        }
    }
}

/// Products of such coordinates underflow.
#[test]
fn contacts_of_tiny_coordinates_are_not_missed() {
    for exponent in (-1060..=-60).step_by(20) {
        let scale = 2_f64.powi(exponent / 2) * 2_f64.powi(exponent - exponent / 2);
        let at = |p: [i32; 3]| p.map(|c| f64::from(c) * scale);
        let bar = |a, b| [at(a), at(b), at(b)];
        let a: Ends = [bar([-8, 0, 0], [8, 0, 0]); 2];
        // The edges cross at a quarter of the time.
        let b: Ends = [bar([0, -8, 2], [0, 8, 2]), bar([0, -8, -6], [0, 8, -6])];
        for search in &SEARCHES {
            assert!(may_collide(a, b, search), "2^{exponent} {search:?}");
        }
    }
}

/// Small triangles on a lattice of 5x5x5, in alternating cells by `which`. Triangles of different cells are
/// apart.
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
    let search = PairSearch { resolution: 64, bins: 16, method: CollisionMethod::FragmentBox, zoom: true };
    let mut apart = 0;
    for seed in 0..120_u64 {
        let ([a, b], uncertainty) = contact(seed, 0.1);
        let objects = |contact: bool| {
            let of = |which, one| crowd(seed, which).chain(contact.then_some(one)).collect();
            [Object::from_ends(of(0, a), uncertainty).unwrap(), Object::from_ends(of(1, b), 0.0).unwrap()]
        };
        let may = |objects: &[Object], search: &PairSearch| {
            detect(objects, search).first().is_some_and(|found| found.verdict.may_collide())
        };
        for method in [CollisionMethod::FragmentBox, CollisionMethod::BoxBox] {
            assert!(may(&objects(true), &PairSearch { method, ..search }), "{seed} {method:?}");
        }
        apart += u32::from(!may(&objects(false), &search));
    }
    // At a million sizes from the origin, an ulp is not far below the spacing of the lattice.
    assert!(apart > 80, "the crowd alone is separated in {apart} of 120");
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
