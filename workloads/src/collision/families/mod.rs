//! Cases whose truth is known by how they are made, from easy to hopeless: what false positives are counted over.
//!
//! Two objects or many; in each family about half of the pairs that meet do collide. Gaps go down to 1e-7 of the objects' size.

mod draws;
mod many;
mod two;
mod yardstick;

use pipeline::random::mix;

use super::{Bounds, Object};
use draws::Draws;

pub use many::swarm_of;
pub use two::slide;

/// Objects that move, and which of them collide.
#[derive(Clone, Debug)]
pub struct Case {
    /// What it is like.
    pub family: &'static str,
    /// The objects.
    pub objects: Vec<Object>,
    /// Pairs that collide, the smaller number first.
    pub collide: Vec<(usize, usize)>,
}

type Maker = fn(&mut Draws) -> Option<Case>;

/// The families of two objects, then those of many.
const FAMILIES: [(&str, Maker); 10] = [
    ("tunnelling", two::tunnelling),
    ("near miss", two::near_miss),
    ("sliding", two::sliding),
    ("contact at the end", two::landing),
    ("exchanged places", two::exchange),
    ("slivers", two::slivers),
    ("same place, other time", two::dodge),
    ("chain links", two::links),
    ("flock", many::flock),
    ("swarm", many::swarm),
];

/// Names of the families.
pub fn names() -> [&'static str; FAMILIES.len()] {
    FAMILIES.map(|(name, _)| name)
}

/// `each` cases of every family, the same for the same seed.
pub fn cases(seed: u64, each: usize) -> Vec<Case> {
    made(&FAMILIES, seed, each)
}

/// Cases like those of the yardsticks (`yardstick.rs`): so many of each kind of two objects, and of each of many.
pub fn like_yardsticks(seed: u64, [two, many]: [usize; 2]) -> Vec<Case> {
    let [first, second] = [(&yardstick::OF_TWO[..], two), (&yardstick::OF_MANY[..], many)];
    [first, second].into_iter().flat_map(|(kinds, each)| made(kinds, seed, each)).collect()
}

fn made(families: &[(&'static str, Maker)], seed: u64, each: usize) -> Vec<Case> {
    let of = |(number, &(family, make)): (u64, &(&'static str, Maker))| {
        let mut draws = Draws::new(seed ^ mix(number));
        let mut made = Vec::new();
        while made.len() < each {
            made.extend(make(&mut draws).map(|case| Case { family, ..case }));
        }
        made
    };
    (1..).zip(families).flat_map(of).collect()
}

/// Whether the swept boxes of any two triangles touch: what is left after a broad phase of the best kind.
pub fn triangles_boxes_touch(a: &Object, b: &Object) -> bool {
    let touch = |one: &Bounds| b.boxes.iter().any(|other| one.meet(other).is_some());
    a.boxes.iter().any(touch)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::collision::{Method, Search, detect};

    #[test]
    fn every_collision_of_every_family_is_found() {
        for zoom in [false, true] {
            let search = Search { resolution: 16, bins: 4, method: Method::FragmentBox, zoom };
            for case in cases(7, 4).into_iter().chain(like_yardsticks(7, [6, 1])) {
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
        for name in names() {
            let of = || all.iter().filter(|case| case.family == name);
            let collide: usize = of().map(|case| case.collide.len()).sum();
            let pairs: usize = of().map(|case| case.objects.len() * (case.objects.len() - 1) / 2).sum();
            assert!(of().count() == 20 && collide > 2 && collide < pairs - 5, "{name}: {collide} of {pairs}");
        }
    }

    /// The yardsticks were measured over cases of which 0.6 of the pairs of two and 0.1 of those of many have boxes that touch.
    #[test]
    fn cases_like_those_of_the_yardsticks_are_as_near_to_each_other() {
        let all = like_yardsticks(1, [60, 12]);
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

    /// What is said to be apart is apart at many instants; what is said to collide is near to it.
    #[test]
    fn oracle_instants_agree_with_the_truth() {
        for case in cases(5, 4).into_iter().chain(like_yardsticks(5, [12, 2])) {
            for (a, b) in
                (0..case.objects.len()).flat_map(|a| (a + 1..case.objects.len()).map(move |b| (a, b)))
            {
                let [one, other] = [&case.objects[a], &case.objects[b]];
                let all = || (0..one.len()).flat_map(|i| (0..other.len()).map(move |j| (i, j)));
                let near: Vec<_> =
                    all().filter(|&(i, j)| one.boxes[i].meet(&other.boxes[j]).is_some()).collect();
                let crosses = |t: f64| {
                    near.iter().find(|&&(i, j)| {
                        crate::collision::crossing::cross(&one.triangles[i], &other.triangles[j], t)
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
