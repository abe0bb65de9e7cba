//! Test cases with known ground truth, from easy to hopeless. False positives are counted over them.
//!
//! A case has two objects or many. In each family about half of the pairs that come near each other collide.
//! Gaps go down to 1e-7 of the objects' size.

mod basic;
mod reference;

pub use basic::{slide, swarm_of};

use core::f64::consts::TAU;

use glam::{DMat3, DQuat, DVec3};
use pipeline::random::{mix, unit};

use super::{Bounds, Object};
use crate::scene::Mesh;
use crate::shapes;

/// A case: moving objects, and which of them collide.
#[derive(Clone, Debug)]
pub struct Case {
    /// Name of the family.
    pub family: &'static str,
    /// The objects.
    pub objects: Vec<Object>,
    /// Pairs that collide, the smaller index first.
    pub collide: Vec<(usize, usize)>,
}

type Maker = fn(&mut Rng) -> Option<Case>;

/// The families of two objects, then those of many.
const FAMILIES: [(&str, Maker); 10] = [
    ("tunnelling", basic::tunnelling),
    ("near miss", basic::near_miss),
    ("sliding", basic::sliding),
    ("contact at the end", basic::landing),
    ("exchanged places", basic::exchange),
    ("slivers", basic::slivers),
    ("same place, other time", basic::dodge),
    ("chain links", basic::links),
    ("flock", basic::flock),
    ("swarm", basic::swarm),
];

/// `each` cases of every family, determined by the seed.
pub fn cases(seed: u64, each: usize) -> Vec<Case> {
    made(&FAMILIES, seed, each)
}

/// Cases of the kinds that the reference rates of false positives in the book were measured on: `pairs` of
/// each kind of two objects, `groups` of each kind of many.
pub fn reference_cases(seed: u64, pairs: usize, groups: usize) -> Vec<Case> {
    let mut cases = made(&reference::PAIRS, seed, pairs);
    cases.extend(made(&reference::GROUPS, seed, groups));
    cases
}

fn made(families: &[(&'static str, Maker)], seed: u64, each: usize) -> Vec<Case> {
    let of = |(number, &(family, make)): (u64, &(&'static str, Maker))| {
        let mut rng = Rng::new(seed ^ mix(number));
        let mut made = Vec::new();
        while made.len() < each {
            made.extend(make(&mut rng).map(|case| Case { family, ..case }));
        }
        made
    };
    (1..).zip(families).flat_map(of).collect()
}

/// Whether the swept boxes of any two triangles touch: the best possible broad phase.
pub fn triangles_boxes_touch(a: &Object, b: &Object) -> bool {
    let touch = |one: &Bounds| b.boxes.iter().any(|other| one.meet(other).is_some());
    a.boxes.iter().any(touch)
}

/// Sequence of random numbers.
struct Rng {
    seed: u64,
    drawn: u64,
}

impl Rng {
    pub fn new(seed: u64) -> Self {
        Self { seed: mix(seed), drawn: 0 }
    }

    pub fn within(&mut self, low: f64, high: f64) -> f64 {
        self.drawn += 1;
        low + (high - low) * unit(mix(self.seed.wrapping_add(self.drawn)))
    }

    pub fn coin(&mut self) -> bool {
        self.within(0.0, 1.0) < 0.5
    }

    pub fn vector(&mut self) -> DVec3 {
        DVec3::new(self.within(-1.0, 1.0), self.within(-1.0, 1.0), self.within(-1.0, 1.0))
    }

    /// A gap of 1e-7 to 1e-3, or a negative one if `overlap`.
    pub fn gap(&mut self, overlap: bool) -> f64 {
        let gap = 10_f64.powf(self.within(-7.0, -3.0));
        if overlap { -gap } else { gap }
    }

    /// A random rotation and scale, the same for all objects of a case.
    pub fn pose(&mut self) -> DMat3 {
        let axis = self.vector().try_normalize().unwrap_or(DVec3::X);
        let turn = DQuat::from_axis_angle(axis, self.within(0.0, TAU));
        DMat3::from_quat(turn) * 10_f64.powf(self.within(-6.0, 6.0))
    }

    /// Makes a case of objects in one pose.
    pub fn case(&mut self, moving: Vec<Moving>, collide: Vec<(usize, usize)>) -> Option<Case> {
        let pose = self.pose();
        let objects = moving.into_iter().map(|moving| moving.posed(&pose)).collect::<Option<Vec<_>>>()?;
        Some(Case { family: "", objects, collide })
    }

    pub fn pair(&mut self, moving: [Moving; 2], hit: bool) -> Option<Case> {
        self.case(moving.into(), if hit { vec![(0, 1)] } else { Vec::new() })
    }
}

/// Triangles at time 0 and time 1.
#[derive(Default)]
struct Moving(pub Vec<[[DVec3; 3]; 2]>);

impl Moving {
    /// The triangles of a mesh, transformed by one function at each time.
    pub fn new(mesh: &Mesh, open: impl Fn(DVec3) -> DVec3, close: impl Fn(DVec3) -> DVec3) -> Self {
        let at = |vertex: u32| mesh.positions[vertex as usize].as_dvec3();
        let ends = |t: &[u32; 3]| [t.map(|v| open(at(v))), t.map(|v| close(at(v)))];
        Self(mesh.triangles.iter().map(ends).collect())
    }

    /// A mesh translated from one position to another.
    pub fn translating(mesh: &Mesh, from: DVec3, to: DVec3) -> Self {
        Self::new(mesh, |p| p + from, |p| p + to)
    }

    pub fn and(mut self, other: Self) -> Self {
        self.0.extend(other.0);
        self
    }

    /// The triangles translated at both times.
    pub fn moved(self, open: DVec3, close: DVec3) -> Self {
        let moved = |[from, to]: [[DVec3; 3]; 2]| [from.map(|p| p + open), to.map(|p| p + close)];
        Self(self.0.into_iter().map(moved).collect())
    }

    pub fn posed(self, pose: &DMat3) -> Option<Object> {
        self.placed(pose, DVec3::ZERO)
    }

    /// The object in a pose, with its origin at `place`.
    pub fn placed(self, pose: &DMat3, place: DVec3) -> Option<Object> {
        let at = |p: DVec3| (*pose * p + place).to_array();
        Object::from_ends(self.0.iter().map(|ends| ends.map(|end| end.map(at))).collect(), 0.0)
    }
}

fn cube(side: f64) -> Mesh {
    shapes::cuboid(glam::Vec3::splat(side as f32), 0)
}

fn ball(radius: f64) -> Mesh {
    shapes::sphere(radius, 12, 0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::collision::{Method, Search, detect};

    #[test]
    fn every_collision_of_every_family_is_found() {
        for zoom in [false, true] {
            let search = Search { resolution: 16, bins: 4, method: Method::FragmentBox, zoom };
            for case in cases(7, 4).into_iter().chain(reference_cases(7, 6, 1)) {
                let found = detect(&case.objects, &search);
                for &(a, b) in &case.collide {
                    let answer = found.iter().find(|answer| (answer.a, answer.b) == (a, b));
                    let found = answer.is_some_and(|answer| answer.verdict.may_collide());
                    assert!(found, "{} {a} {b} {zoom}", case.family);
                }
            }
        }
    }

    #[test]
    fn every_family_has_pairs_that_collide_and_pairs_that_do_not() {
        let all = cases(3, 20);
        for (name, _) in FAMILIES {
            let of = || all.iter().filter(|case| case.family == name);
            let collide: usize = of().map(|case| case.collide.len()).sum();
            let pairs: usize = of().map(|case| case.objects.len() * (case.objects.len() - 1) / 2).sum();
            assert!(of().count() == 20 && collide > 2 && collide < pairs - 5, "{name}: {collide} of {pairs}");
        }
    }

    /// Of the cases with reference rates, 0.6 of the pairs of two and 0.1 of those of many have touching
    /// boxes.
    #[test]
    fn reference_cases_have_the_expected_share_of_touching_boxes() {
        let all = reference_cases(1, 60, 12);
        for (many, expected) in [(false, 0.45..0.7), (true, 0.05..0.2)] {
            let of = || all.iter().filter(|case| (case.objects.len() > 2) == many);
            let touch: usize = of()
                .map(|case| {
                    let pairs = crate::collision::candidates(&case.objects);
                    assert!(case.collide.iter().all(|pair| pairs.contains(pair)), "{}", case.family);
                    pairs.len() - case.collide.len()
                })
                .sum();
            let pairs = |case: &Case| case.objects.len() * (case.objects.len() - 1) / 2 - case.collide.len();
            let share = touch as f64 / of().map(pairs).sum::<usize>() as f64;
            assert!(expected.contains(&share), "{share}");
        }
    }

    /// Pairs declared apart are apart at many instants.
    #[test]
    fn many_instants_agree_with_the_ground_truth() {
        for case in cases(5, 4).into_iter().chain(reference_cases(5, 12, 2)) {
            for (a, b) in
                (0..case.objects.len()).flat_map(|a| (a + 1..case.objects.len()).map(move |b| (a, b)))
            {
                let [one, other] = [&case.objects[a], &case.objects[b]];
                let all = || (0..one.len()).flat_map(|i| (0..other.len()).map(move |j| (i, j)));
                let near: Vec<_> =
                    all().filter(|&(i, j)| one.boxes[i].meet(&other.boxes[j]).is_some()).collect();
                let crosses = |t: f64| {
                    near.iter().find(|&&(i, j)| {
                        super::super::contact_probe::cross(&one.triangles[i], &other.triangles[j], t)
                    })
                };
                if case.collide.contains(&(a, b)) {
                    continue;
                }
                for t in (0..=10).map(|n| f64::from(n) / 10.0) {
                    let found = crosses(t);
                    assert!(
                        found.is_none(),
                        "{} {a} {b} at {t}: {:?}",
                        case.family,
                        found.map(|&(i, j)| (one.triangles[i], other.triangles[j]))
                    );
                }
            }
        }
    }
}
