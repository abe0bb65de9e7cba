//! Families of two objects and of many.

use glam::{DMat3, DVec3};

use super::{Case, Moving, Rng, ball, cube};
use crate::collision::Object;
use crate::shapes;

/// A small ball, faster than its size, through a hole or into the plate around it.
pub(super) fn tunnelling(rng: &mut Rng) -> Option<Case> {
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
pub(super) fn near_miss(rng: &mut Rng) -> Option<Case> {
    let hit = rng.coin();
    let lane = DVec3::new(0.0, 1.0 + rng.gap(hit), rng.within(-0.4, 0.4));
    let far = DVec3::X * rng.within(0.5, 4.0);
    let still = Moving::translating(&cube(1.0), DVec3::ZERO, DVec3::ZERO);
    rng.pair([still, Moving::translating(&cube(1.0), lane - far, lane + far)], hit)
}

/// A plate that slides along another: near everywhere.
pub(super) fn sliding(rng: &mut Rng) -> Option<Case> {
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
pub(super) fn landing(rng: &mut Rng) -> Option<Case> {
    let hit = rng.coin();
    let end = DVec3::new(rng.within(-0.4, 0.4), 1.0 + rng.gap(hit), rng.within(-0.4, 0.4));
    let start = end + DVec3::Y * rng.within(0.5, 3.0);
    let still = Moving::translating(&cube(1.0), DVec3::ZERO, DVec3::ZERO);
    rng.pair([still, Moving::translating(&cube(1.0), start, end)], hit)
}

/// Two balls that exchange positions on parallel lanes.
pub(super) fn exchange(rng: &mut Rng) -> Option<Case> {
    let hit = rng.coin();
    let apart = if hit { rng.within(0.0, 0.6) } else { rng.within(1.02, 1.3) };
    let (far, lane) = (DVec3::X * rng.within(0.8, 4.0), DVec3::Y * apart);
    let ball = ball(0.5);
    rng.pair([Moving::translating(&ball, -far, far), Moving::translating(&ball, far + lane, lane - far)], hit)
}

/// Two blades like scissors, one above the other.
pub(super) fn slivers(rng: &mut Rng) -> Option<Case> {
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
pub(super) fn dodge(rng: &mut Rng) -> Option<Case> {
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
pub(super) fn links(rng: &mut Rng) -> Option<Case> {
    let hit = rng.coin();
    let ring = shapes::torus(1.0, 0.2, 24, 0);
    let off = if hit { rng.within(0.05, 0.3) } else { rng.within(0.8, 1.2) };
    let motion = rng.vector() * rng.within(0.5, 5.0);
    let other = |p: DVec3| DVec3::new(p.x + off, p.z, p.y);
    let second = Moving::new(&ring, other, |p| other(p) + motion);
    rng.pair([Moving::translating(&ring, DVec3::ZERO, motion), second], hit)
}

/// Cubes that move in formation, one of them hit from above.
pub(super) fn flock(rng: &mut Rng) -> Option<Case> {
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
pub(super) fn swarm(rng: &mut Rng) -> Option<Case> {
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
