//! Families of many objects.

use glam::{DMat3, DVec3};

use super::Case;
use super::draws::{Draws, Moving, ball, cube};
use crate::collision::Object;

/// Cubes that fly in formation, one of them rammed from above.
pub(super) fn flock(draws: &mut Draws) -> Option<Case> {
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
pub(super) fn swarm(draws: &mut Draws) -> Option<Case> {
    const BALLS: usize = 12;
    let lanes = lanes(draws, BALLS);
    let mut collide = Vec::new();
    for (a, b) in (0..BALLS).flat_map(|a| (a + 1..BALLS).map(move |b| (a, b))) {
        let nearest = nearest(lanes[a], lanes[b]) / RADIUS;
        if nearest < 1.5 {
            collide.push((a, b));
        } else if nearest <= 2.0 {
            return None;
        }
    }
    let moving = lanes.iter().map(|[from, to]| Moving::going(&ball(RADIUS), *from, *to)).collect();
    draws.case(moving, collide)
}

/// `balls` balls that fly about.
pub fn swarm_of(balls: u32, seed: u64) -> Vec<Object> {
    let mut draws = Draws::new(seed ^ 0x05EE_D0FB);
    let balls = lanes(&mut draws, balls as usize).into_iter();
    balls.filter_map(|[from, to]| Moving::going(&ball(RADIUS), from, to).posed(&DMat3::IDENTITY)).collect()
}

/// Where balls of a swarm start and end.
fn lanes(draws: &mut Draws, balls: usize) -> Vec<[DVec3; 2]> {
    (0..balls).map(|_| [draws.vector() * 2.0, draws.vector() * 2.0]).collect()
}

/// Of a ball of a swarm.
const RADIUS: f64 = 0.3;

/// The least distance of two points that go straight.
fn nearest(a: [DVec3; 2], b: [DVec3; 2]) -> f64 {
    let (from, way) = (b[0] - a[0], (b[1] - a[1]) - (b[0] - a[0]));
    let t = if way == DVec3::ZERO { 0.0 } else { (-from.dot(way) / way.length_squared()).clamp(0.0, 1.0) };
    (from + t * way).length()
}
