//! Cases whose truth is known by how they are made, from easy to hopeless: what false positives are counted over.
//!
//! Two objects or many; in each family about half of the pairs that meet do collide. Gaps go down to 1e-7 of the objects' size.

use core::f64::consts::TAU;

use glam::{DMat3, DQuat, DVec3};
use pipeline::sampling::{mix, unit};

use super::{Bounds, Object};
use crate::scene::Mesh;
use crate::shapes;

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

/// Names of the families.
pub fn names() -> [&'static str; FAMILIES.len()] {
    FAMILIES.map(|(name, _)| name)
}

/// `each` cases of every family, the same for the same seed.
pub fn cases(seed: u64, each: usize) -> Vec<Case> {
    let of = |number: usize| {
        let (family, make) = FAMILIES[number];
        let mut draws = Draws { seed: mix(seed ^ mix(number as u64 + 1)), drawn: 0 };
        let mut made = Vec::new();
        while made.len() < each {
            made.extend(make(&mut draws).map(|case| Case { family, ..case }));
        }
        made
    };
    (0..FAMILIES.len()).flat_map(of).collect()
}

/// Random numbers in order.
struct Draws {
    seed: u64,
    drawn: u64,
}

impl Draws {
    fn within(&mut self, low: f64, high: f64) -> f64 {
        self.drawn += 1;
        low + (high - low) * unit(mix(self.seed.wrapping_add(self.drawn)))
    }

    fn coin(&mut self) -> bool {
        self.within(0.0, 1.0) < 0.5
    }

    fn vector(&mut self) -> DVec3 {
        DVec3::new(self.within(-1.0, 1.0), self.within(-1.0, 1.0), self.within(-1.0, 1.0))
    }

    /// A gap of 1e-7 to 1e-3, or as much overlap.
    fn gap(&mut self, overlap: bool) -> f64 {
        let gap = 10_f64.powf(self.within(-7.0, -3.0));
        if overlap { -gap } else { gap }
    }

    /// Any turn and any size, the same for a whole case.
    fn pose(&mut self) -> DMat3 {
        let axis = self.vector().try_normalize().unwrap_or(DVec3::X);
        let turn = DQuat::from_axis_angle(axis, self.within(0.0, TAU));
        DMat3::from_quat(turn) * 10_f64.powf(self.within(-6.0, 6.0))
    }

    /// A case of objects in one pose.
    fn case(&mut self, moving: Vec<Moving>, collide: Vec<(usize, usize)>) -> Option<Case> {
        let pose = self.pose();
        let objects = moving.into_iter().map(|moving| moving.posed(&pose)).collect::<Option<Vec<_>>>()?;
        Some(Case { family: "", objects, collide })
    }

    fn pair(&mut self, moving: [Moving; 2], hit: bool) -> Option<Case> {
        self.case(moving.into(), if hit { vec![(0, 1)] } else { Vec::new() })
    }
}

/// Triangles at both ends of the time.
#[derive(Default)]
struct Moving(Vec<[[DVec3; 3]; 2]>);

impl Moving {
    /// A mesh with each end made of its points.
    fn new(mesh: &Mesh, open: impl Fn(DVec3) -> DVec3, close: impl Fn(DVec3) -> DVec3) -> Self {
        let at = |vertex: u32| mesh.positions[vertex as usize].as_dvec3();
        let ends = |t: &[u32; 3]| [t.map(|v| open(at(v))), t.map(|v| close(at(v)))];
        Self(mesh.triangles.iter().map(ends).collect())
    }

    /// A mesh that goes straight from one place to another.
    fn going(mesh: &Mesh, from: DVec3, to: DVec3) -> Self {
        Self::new(mesh, |p| p + from, |p| p + to)
    }

    fn and(mut self, other: Self) -> Self {
        self.0.extend(other.0);
        self
    }

    fn posed(self, pose: &DMat3) -> Option<Object> {
        let ends = self.0.iter().map(|ends| ends.map(|end| end.map(|p| (*pose * p).to_array()))).collect();
        Object::from_ends(ends, 0.0)
    }
}

fn cube(side: f64) -> Mesh {
    shapes::cuboid(glam::Vec3::splat(side as f32), 0)
}

fn ball(radius: f64) -> Mesh {
    shapes::sphere(radius, 12, 0)
}

/// A small ball, faster than its size, through a hole or into the plate around it.
fn tunnelling(draws: &mut Draws) -> Option<Case> {
    let (hit, hole) = (draws.coin(), 0.2);
    let side = |at: DVec3, size: glam::Vec3| Moving::going(&shapes::cuboid(size, 0), at, at);
    let (long, wide) = (glam::Vec3::new(2.0, 0.8, 0.02), glam::Vec3::new(0.8, 0.4, 0.02));
    let plate = [DVec3::Y, DVec3::NEG_Y].map(|y| side(0.6 * y, long));
    let plate = plate.into_iter().chain([DVec3::X, DVec3::NEG_X].map(|x| side(0.6 * x, wide)));
    let plate = plate.reduce(Moving::and)?;
    let off = if hit { 0.6 } else { draws.within(0.0, hole - 0.06) };
    let lane = DVec3::new(off, draws.within(-0.1, 0.1), 0.0);
    let far = DVec3::Z * draws.within(1.0, 6.0);
    draws.pair([plate, Moving::going(&ball(0.05), lane - far, lane + far)], hit)
}

/// A cube past another, a hair apart.
fn near_miss(draws: &mut Draws) -> Option<Case> {
    let hit = draws.coin();
    let lane = DVec3::new(0.0, 1.0 + draws.gap(hit), draws.within(-0.4, 0.4));
    let far = DVec3::X * draws.within(0.5, 4.0);
    let still = Moving::going(&cube(1.0), DVec3::ZERO, DVec3::ZERO);
    draws.pair([still, Moving::going(&cube(1.0), lane - far, lane + far)], hit)
}

/// A plate along another: near everywhere.
fn sliding(draws: &mut Draws) -> Option<Case> {
    let hit = draws.within(0.0, 1.0) < 0.3;
    let gap = if hit { 0.0 } else { 10_f64.powf(draws.within(-7.0, -1.5)) };
    let case = plates(draws, gap)?;
    // Where they touch they stay in one plane only if nothing is rounded.
    let touching = case.objects.iter().map(|object| object.loosened(1e-12)).collect();
    Some(if hit { Case { objects: touching, collide: vec![(0, 1)], ..case } } else { case })
}

/// Two plates of a length of one, `gap` apart, of which one slides along the other.
fn plates(draws: &mut Draws, gap: f64) -> Option<Case> {
    let plate = shapes::plane(1.0, 6, 1.0, 0);
    let way = DVec3::new(draws.within(-0.5, 0.5), 0.0, draws.within(-0.5, 0.5));
    let above = DVec3::Y * gap;
    let still = Moving::going(&plate, DVec3::ZERO, DVec3::ZERO);
    draws.pair([still, Moving::going(&plate, above, above + way)], false)
}

/// Two plates that slide along each other, `gap` of their length apart: near everywhere, and never together.
pub fn slide(seed: u64, gap: f64) -> Vec<Object> {
    plates(&mut Draws { seed: mix(seed), drawn: 0 }, gap).map_or(Vec::new(), |case| case.objects)
}

/// A cube that comes to rest on another at the last instant, or a hair above.
fn landing(draws: &mut Draws) -> Option<Case> {
    let hit = draws.coin();
    let end = DVec3::new(draws.within(-0.4, 0.4), 1.0 + draws.gap(hit), draws.within(-0.4, 0.4));
    let start = end + DVec3::Y * draws.within(0.5, 3.0);
    let still = Moving::going(&cube(1.0), DVec3::ZERO, DVec3::ZERO);
    draws.pair([still, Moving::going(&cube(1.0), start, end)], hit)
}

/// Two balls that change places on lanes side by side.
fn exchange(draws: &mut Draws) -> Option<Case> {
    let hit = draws.coin();
    let apart = if hit { draws.within(0.0, 0.6) } else { draws.within(1.02, 1.3) };
    let (far, lane) = (DVec3::X * draws.within(0.8, 4.0), DVec3::Y * apart);
    let ball = ball(0.5);
    draws.pair([Moving::going(&ball, -far, far), Moving::going(&ball, far + lane, lane - far)], hit)
}

/// Two blades like scissors, one above the other.
fn slivers(draws: &mut Draws) -> Option<Case> {
    let hit = draws.coin();
    let apart = DVec3::Z * if hit { 0.0 } else { 10_f64.powf(draws.within(-5.0, -1.0)) };
    let width = 10_f64.powf(draws.within(-6.0, -2.0));
    let blade = |angle: f64| {
        let along = DVec3::new(angle.cos(), angle.sin(), 0.0);
        [-0.3 * along, along, DVec3::new(along.y, -along.x, 0.0) * width]
    };
    let (from, to) = (draws.within(0.2, 1.2), draws.within(-1.2, -0.2));
    let open = Moving(vec![[blade(from), blade(to)]]);
    let close = Moving(vec![[blade(-from).map(|p| p + apart), blade(-to).map(|p| p + apart)]]);
    let case = draws.pair([open, close], hit)?;
    let touching = case.objects.iter().map(|object| object.loosened(1e-12)).collect();
    Some(if hit { Case { objects: touching, ..case } } else { case })
}

/// Two balls whose lanes cross: at one time, or at two (thesis, Paper VI, Fig. 6).
fn dodge(draws: &mut Draws) -> Option<Case> {
    let hit = draws.coin();
    let ball = ball(0.5);
    let far = draws.within(2.0, 6.0);
    // The second is late by so much of the way.
    let late = if hit { draws.within(0.0, 0.3) } else { draws.within(1.5, 1.9) };
    let lift = DVec3::Z * draws.within(-0.2, 0.2);
    let first = Moving::going(&ball, DVec3::X * -far, DVec3::X * far);
    let (from, to) = (DVec3::Y * (-far - late), DVec3::Y * (far - late));
    draws.pair([first, Moving::going(&ball, from + lift, to + lift)], hit)
}

/// Two rings, one through the other, that move together.
fn links(draws: &mut Draws) -> Option<Case> {
    let hit = draws.coin();
    let ring = shapes::torus(1.0, 0.2, 24, 0);
    let off = if hit { draws.within(0.05, 0.3) } else { draws.within(0.8, 1.2) };
    let way = draws.vector() * draws.within(0.5, 5.0);
    let other = |p: DVec3| DVec3::new(p.x + off, p.z, p.y);
    let second = Moving::new(&ring, other, |p| other(p) + way);
    draws.pair([Moving::going(&ring, DVec3::ZERO, way), second], hit)
}

/// Cubes that fly in formation, one of them rammed from above.
fn flock(draws: &mut Draws) -> Option<Case> {
    let way = draws.vector() * draws.within(1.0, 8.0);
    let spacing = 1.0 + 10_f64.powf(draws.within(-3.0, -0.5));
    let place = |n: usize| DVec3::new((n % 4) as f64, 0.0, (n / 4) as f64) * spacing;
    let mut moving: Vec<Moving> =
        (0..12).map(|n| Moving::going(&cube(1.0), place(n), place(n) + way)).collect();
    let rammed = (draws.within(0.0, 12.0) as usize).min(11);
    let above = place(rammed) + DVec3::Y * 3.0;
    moving.push(Moving::going(&cube(0.5), above, place(rammed) + way + DVec3::Y * 0.5));
    draws.case(moving, vec![(rammed, 12)])
}

/// Balls that fly about. Where a pair comes so near that the facets of the balls decide, the case is not used.
fn swarm(draws: &mut Draws) -> Option<Case> {
    const BALLS: usize = 12;
    let radius = 0.3;
    let lanes: Vec<[DVec3; 2]> = (0..BALLS).map(|_| [draws.vector() * 2.0, draws.vector() * 2.0]).collect();
    let mut collide = Vec::new();
    for (a, b) in (0..BALLS).flat_map(|a| (a + 1..BALLS).map(move |b| (a, b))) {
        let nearest = nearest(lanes[a], lanes[b]) / radius;
        if nearest < 1.5 {
            collide.push((a, b));
        } else if nearest <= 2.0 {
            return None;
        }
    }
    let moving = lanes.iter().map(|[from, to]| Moving::going(&ball(radius), *from, *to)).collect();
    draws.case(moving, collide)
}

/// `balls` balls that fly about.
pub fn swarm_of(balls: u32, seed: u64) -> Vec<Object> {
    let mut draws = Draws { seed: mix(seed ^ 0x05EE_D0FB), drawn: 0 };
    let lane = |_| [draws.vector() * 2.0, draws.vector() * 2.0];
    let lanes: Vec<[DVec3; 2]> = (0..balls).map(lane).collect();
    lanes
        .iter()
        .filter_map(|[from, to]| Moving::going(&ball(0.3), *from, *to).posed(&DMat3::IDENTITY))
        .collect()
}

/// The least distance of two points that go straight.
fn nearest(a: [DVec3; 2], b: [DVec3; 2]) -> f64 {
    let (from, way) = (b[0] - a[0], (b[1] - a[1]) - (b[0] - a[0]));
    let t = if way == DVec3::ZERO { 0.0 } else { (-from.dot(way) / way.length_squared()).clamp(0.0, 1.0) };
    (from + t * way).length()
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
            for case in cases(7, 4) {
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

    /// What is said to be apart is apart at many instants; what is said to collide is near to it.
    #[test]
    fn oracle_instants_agree_with_the_truth() {
        for case in cases(5, 4) {
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
