//! Test cases with known ground truth, from easy to hopeless. False positives are counted over them.
//!
//! A case has two objects or many. In each family about half of the pairs that come near each other collide.
//! Gaps go down to 1e-7 of the objects' size.

mod reference;

use core::f64::consts::TAU;

use glam::{DMat3, DQuat, DVec3};
use pipeline::random::{mix, unit};

use super::Bounds;
use crate::collision::Object;
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
    ("tunnelling", tunnelling),
    ("near miss", near_miss),
    ("sliding", sliding),
    ("contact at the end", landing),
    ("exchanged places", exchange),
    ("slivers", slivers),
    ("same place, other time", dodge),
    ("chain links", links),
    ("flock", flock),
    ("swarm", swarm),
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

/// A small ball, faster than its size, through a hole or into the plate around it.
fn tunnelling(rng: &mut Rng) -> Option<Case> {
    let (hit, hole) = (rng.coin(), 0.2);
    let side = |at: DVec3, size: glam::Vec3| Moving::translating(&shapes::cuboid(size, 0), at, at);
    let (long, wide) = (glam::Vec3::new(2.0, 0.8, 0.02), glam::Vec3::new(0.8, 0.4, 0.02));
    let plate = [DVec3::Y, DVec3::NEG_Y].map(|y| side(0.6 * y, long));
    let plate = plate.into_iter().chain([DVec3::X, DVec3::NEG_X].map(|x| side(0.6 * x, wide)));
    let plate = plate.reduce(Moving::and)?;
    let off = if hit { 0.6 } else { rng.within(0.0, hole - 0.06) };
    let lane = DVec3::new(off, rng.within(-0.1, 0.1), 0.0);
    let far = DVec3::Z * rng.within(1.0, 6.0);
    rng.pair([plate, Moving::translating(&ball(0.05), lane - far, lane + far)], hit)
}

/// A cube that passes another with a tiny gap.
fn near_miss(rng: &mut Rng) -> Option<Case> {
    let hit = rng.coin();
    let lane = DVec3::new(0.0, 1.0 + rng.gap(hit), rng.within(-0.4, 0.4));
    let far = DVec3::X * rng.within(0.5, 4.0);
    let still = Moving::translating(&cube(1.0), DVec3::ZERO, DVec3::ZERO);
    rng.pair([still, Moving::translating(&cube(1.0), lane - far, lane + far)], hit)
}

/// A plate that slides along another: near everywhere.
fn sliding(rng: &mut Rng) -> Option<Case> {
    let hit = rng.within(0.0, 1.0) < 0.3;
    let gap = if hit { 0.0 } else { 10_f64.powf(rng.within(-7.0, -1.5)) };
    let case = plates(rng, gap)?;
    // Touching plates stay in one plane only up to rounding.
    let touching = case.objects.iter().map(|object| object.loosened(1e-12)).collect();
    Some(if hit { Case { objects: touching, collide: vec![(0, 1)], ..case } } else { case })
}

/// Two plates of length one, `gap` apart; one slides along the other.
fn plates(rng: &mut Rng, gap: f64) -> Option<Case> {
    let plate = shapes::plane(1.0, 6, 1.0, 0);
    let motion = DVec3::new(rng.within(-0.5, 0.5), 0.0, rng.within(-0.5, 0.5));
    let above = DVec3::Y * gap;
    let still = Moving::translating(&plate, DVec3::ZERO, DVec3::ZERO);
    rng.pair([still, Moving::translating(&plate, above, above + motion)], false)
}

/// Two plates that slide along each other, `gap` of their length apart: near everywhere, and apart at all
/// times.
pub fn slide(seed: u64, gap: f64) -> Vec<Object> {
    plates(&mut Rng::new(seed), gap).map_or(Vec::new(), |case| case.objects)
}

/// A cube that comes to rest on another at the last instant, or slightly above it.
fn landing(rng: &mut Rng) -> Option<Case> {
    let hit = rng.coin();
    let end = DVec3::new(rng.within(-0.4, 0.4), 1.0 + rng.gap(hit), rng.within(-0.4, 0.4));
    let start = end + DVec3::Y * rng.within(0.5, 3.0);
    let still = Moving::translating(&cube(1.0), DVec3::ZERO, DVec3::ZERO);
    rng.pair([still, Moving::translating(&cube(1.0), start, end)], hit)
}

/// Two balls that exchange positions on parallel lanes.
fn exchange(rng: &mut Rng) -> Option<Case> {
    let hit = rng.coin();
    let apart = if hit { rng.within(0.0, 0.6) } else { rng.within(1.02, 1.3) };
    let (far, lane) = (DVec3::X * rng.within(0.8, 4.0), DVec3::Y * apart);
    let ball = ball(0.5);
    rng.pair([Moving::translating(&ball, -far, far), Moving::translating(&ball, far + lane, lane - far)], hit)
}

/// Two blades like scissors, one above the other.
fn slivers(rng: &mut Rng) -> Option<Case> {
    let hit = rng.coin();
    let apart = DVec3::Z * if hit { 0.0 } else { 10_f64.powf(rng.within(-5.0, -1.0)) };
    let width = 10_f64.powf(rng.within(-6.0, -2.0));
    let blade = |angle: f64| {
        let along = DVec3::new(angle.cos(), angle.sin(), 0.0);
        [-0.3 * along, along, DVec3::new(along.y, -along.x, 0.0) * width]
    };
    let (from, to) = (rng.within(0.2, 1.2), rng.within(-1.2, -0.2));
    let open = Moving(vec![[blade(from), blade(to)]]);
    let close = Moving(vec![[blade(-from).map(|p| p + apart), blade(-to).map(|p| p + apart)]]);
    let case = rng.pair([open, close], hit)?;
    let touching = case.objects.iter().map(|object| object.loosened(1e-12)).collect();
    Some(if hit { Case { objects: touching, ..case } } else { case })
}

/// Two balls whose lanes cross, at the same time or at different times (thesis, Paper VI, Fig. 6).
fn dodge(rng: &mut Rng) -> Option<Case> {
    let hit = rng.coin();
    let ball = ball(0.5);
    let far = rng.within(2.0, 6.0);
    // Delay of the second ball, as a length on its lane.
    let late = if hit { rng.within(0.0, 0.3) } else { rng.within(1.5, 1.9) };
    let lift = DVec3::Z * rng.within(-0.2, 0.2);
    let first = Moving::translating(&ball, DVec3::X * -far, DVec3::X * far);
    let (from, to) = (DVec3::Y * (-far - late), DVec3::Y * (far - late));
    rng.pair([first, Moving::translating(&ball, from + lift, to + lift)], hit)
}

/// Two rings, one through the other, that move together.
fn links(rng: &mut Rng) -> Option<Case> {
    let hit = rng.coin();
    let ring = shapes::torus(1.0, 0.2, 24, 0);
    let off = if hit { rng.within(0.05, 0.3) } else { rng.within(0.8, 1.2) };
    let motion = rng.vector() * rng.within(0.5, 5.0);
    let other = |p: DVec3| DVec3::new(p.x + off, p.z, p.y);
    let second = Moving::new(&ring, other, |p| other(p) + motion);
    rng.pair([Moving::translating(&ring, DVec3::ZERO, motion), second], hit)
}

/// Cubes that move in formation, one of them hit from above.
fn flock(rng: &mut Rng) -> Option<Case> {
    let motion = rng.vector() * rng.within(1.0, 8.0);
    let spacing = 1.0 + 10_f64.powf(rng.within(-3.0, -0.5));
    let place = |n: usize| DVec3::new((n % 4) as f64, 0.0, (n / 4) as f64) * spacing;
    let mut moving: Vec<Moving> =
        (0..12).map(|n| Moving::translating(&cube(1.0), place(n), place(n) + motion)).collect();
    let rammed = (rng.within(0.0, 12.0) as usize).min(11);
    let above = place(rammed) + DVec3::Y * 3.0;
    moving.push(Moving::translating(&cube(0.5), above, place(rammed) + motion + DVec3::Y * 0.5));
    rng.case(moving, vec![(rammed, 12)])
}

/// Balls that move at random. `None` if a pair comes so near that the facets of the balls decide.
fn swarm(rng: &mut Rng) -> Option<Case> {
    const BALLS: usize = 12;
    let lanes = lanes(rng, BALLS);
    let mut collide = Vec::new();
    for (a, b) in (0..BALLS).flat_map(|a| (a + 1..BALLS).map(move |b| (a, b))) {
        let nearest = nearest(lanes[a], lanes[b]) / BALL_RADIUS;
        if nearest < 1.5 {
            collide.push((a, b));
        } else if nearest <= 2.0 {
            return None;
        }
    }
    let moving = lanes.iter().map(|[from, to]| Moving::translating(&ball(BALL_RADIUS), *from, *to)).collect();
    rng.case(moving, collide)
}

/// `balls` balls that move at random.
pub fn swarm_of(balls: u32, seed: u64) -> Vec<Object> {
    let mut rng = Rng::new(seed ^ 0x05EE_D0FB);
    let balls = lanes(&mut rng, balls as usize).into_iter();
    balls
        .filter_map(|[from, to]| Moving::translating(&ball(BALL_RADIUS), from, to).posed(&DMat3::IDENTITY))
        .collect()
}

/// Start and end positions of the balls of a swarm.
fn lanes(rng: &mut Rng, balls: usize) -> Vec<[DVec3; 2]> {
    (0..balls).map(|_| [rng.vector() * 2.0, rng.vector() * 2.0]).collect()
}

/// Radius of a ball of a swarm.
const BALL_RADIUS: f64 = 0.3;

/// Least distance of two points in linear motion.
fn nearest(a: [DVec3; 2], b: [DVec3; 2]) -> f64 {
    let (from, motion) = (b[0] - a[0], (b[1] - a[1]) - (b[0] - a[0]));
    let t = if motion == DVec3::ZERO {
        0.0
    } else {
        (-from.dot(motion) / motion.length_squared()).clamp(0.0, 1.0)
    };
    (from + t * motion).length()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::collision::{CollisionMethod, PairSearch, detect};

    #[test]
    fn every_collision_of_every_family_is_found() {
        for zoom in [false, true] {
            let search = PairSearch { resolution: 16, bins: 4, method: CollisionMethod::FragmentBox, zoom };
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
