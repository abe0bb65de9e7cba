//! Families of two objects.

use glam::DVec3;

use super::Case;
use super::draws::{Draws, Moving, ball, cube};
use crate::collision::Object;
use crate::shapes;

/// A small ball, faster than its size, through a hole or into the plate around it.
pub(super) fn tunnelling(draws: &mut Draws) -> Option<Case> {
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
pub(super) fn near_miss(draws: &mut Draws) -> Option<Case> {
    let hit = draws.coin();
    let lane = DVec3::new(0.0, 1.0 + draws.gap(hit), draws.within(-0.4, 0.4));
    let far = DVec3::X * draws.within(0.5, 4.0);
    let still = Moving::going(&cube(1.0), DVec3::ZERO, DVec3::ZERO);
    draws.pair([still, Moving::going(&cube(1.0), lane - far, lane + far)], hit)
}

/// A plate along another: near everywhere.
pub(super) fn sliding(draws: &mut Draws) -> Option<Case> {
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
    plates(&mut Draws::new(seed), gap).map_or(Vec::new(), |case| case.objects)
}

/// A cube that comes to rest on another at the last instant, or a hair above.
pub(super) fn landing(draws: &mut Draws) -> Option<Case> {
    let hit = draws.coin();
    let end = DVec3::new(draws.within(-0.4, 0.4), 1.0 + draws.gap(hit), draws.within(-0.4, 0.4));
    let start = end + DVec3::Y * draws.within(0.5, 3.0);
    let still = Moving::going(&cube(1.0), DVec3::ZERO, DVec3::ZERO);
    draws.pair([still, Moving::going(&cube(1.0), start, end)], hit)
}

/// Two balls that change places on lanes side by side.
pub(super) fn exchange(draws: &mut Draws) -> Option<Case> {
    let hit = draws.coin();
    let apart = if hit { draws.within(0.0, 0.6) } else { draws.within(1.02, 1.3) };
    let (far, lane) = (DVec3::X * draws.within(0.8, 4.0), DVec3::Y * apart);
    let ball = ball(0.5);
    draws.pair([Moving::going(&ball, -far, far), Moving::going(&ball, far + lane, lane - far)], hit)
}

/// Two blades like scissors, one above the other.
pub(super) fn slivers(draws: &mut Draws) -> Option<Case> {
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
pub(super) fn dodge(draws: &mut Draws) -> Option<Case> {
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
pub(super) fn links(draws: &mut Draws) -> Option<Case> {
    let hit = draws.coin();
    let ring = shapes::torus(1.0, 0.2, 24, 0);
    let off = if hit { draws.within(0.05, 0.3) } else { draws.within(0.8, 1.2) };
    let way = draws.vector() * draws.within(0.5, 5.0);
    let other = |p: DVec3| DVec3::new(p.x + off, p.z, p.y);
    let second = Moving::new(&ring, other, |p| other(p) + way);
    draws.pair([Moving::going(&ring, DVec3::ZERO, way), second], hit)
}
