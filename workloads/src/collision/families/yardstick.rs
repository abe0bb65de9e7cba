//! Cases of the kinds over which the yardsticks of the book were measured: bodies of few triangles, in any pose, of sizes and at places
//! from 1e-6 to 1e6, that miss each other by 1e-7 to 1e-3 of their size as often as by more.
//!
//! Cubes stay parallel within a case, so that whether they meet is known from three intervals of time; whatever hangs on less than
//! [`MARGIN`] is not used.

use glam::{DMat3, DVec3};

use super::draws::{Draws, Moving, cube};
use super::{Case, Maker};
use crate::collision::bounds::meet;

/// The kinds of two objects.
pub(super) const OF_TWO: [(&str, Maker); 8] = [
    ("tunnelling", tunnelling),
    ("near misses", near_miss),
    ("coplanar sliding", sliding),
    ("one instant", instant),
    ("exchanged places", exchange),
    ("rotating slivers", slivers),
    ("passing by", passing),
    ("resting", resting),
];

/// The kinds of many.
pub(super) const OF_MANY: [(&str, Maker); 3] =
    [("swarm of cubes", swarm), ("crossing lanes", lanes), ("formation", formation)];

/// What may be put down to rounding, in sizes of a body.
const MARGIN: f64 = 1e-9;

/// Where the middle of a cube is, of a side of one, at both ends of the time.
type Way = [DVec3; 2];

/// Whether cubes of a side of one meet; `None` where that hangs on rounding.
fn cubes_meet(a: Way, b: Way) -> Option<bool> {
    let meets = |side: f64| {
        let mut times = [0.0, 1.0];
        for axis in 0..3 {
            let [from, to] = [0, 1].map(|end| b[end][axis] - a[end][axis]);
            let within = within(from, to - from, side);
            match meet(times, within) {
                Some(both) => times = both,
                None => return false,
            }
        }
        true
    };
    let [surely, maybe] = [1.0 - MARGIN, 1.0 + MARGIN].map(meets);
    (surely == maybe).then_some(surely)
}

/// When `|from + t way| <= reach`, an empty range if never.
fn within(from: f64, way: f64, reach: f64) -> [f64; 2] {
    if way == 0.0 {
        return if from.abs() <= reach { [0.0, 1.0] } else { [1.0, 0.0] };
    }
    let [a, b] = [(-reach - from) / way, (reach - from) / way];
    [a.min(b), a.max(b)]
}

/// Cubes, and which of them meet.
fn cubes(draws: &mut Draws, ways: &[Way]) -> Option<Case> {
    let mut collide = Vec::new();
    for (a, b) in (0..ways.len()).flat_map(|a| (a + 1..ways.len()).map(move |b| (a, b))) {
        if cubes_meet(ways[a], ways[b])? {
            collide.push((a, b));
        }
    }
    let going = |[from, to]: &Way| Moving::going(&cube(1.0), *from, *to);
    let moving = ways.iter().map(going).collect();
    placed(draws, moving, collide)
}

/// In a pose: nearly half of the cases lie along the axes, and every second is at the origin.
fn placed(draws: &mut Draws, moving: Vec<Moving>, collide: Vec<(usize, usize)>) -> Option<Case> {
    let (turned, moved) = (draws.within(0.0, 1.0) < 0.55, draws.coin());
    let pose = draws.pose();
    let size = pose.x_axis.length();
    let pose = if turned { pose } else { DMat3::from_diagonal(DVec3::splat(size)) };
    // So far out that gaps are still much larger than the spacing of numbers.
    let far = size * 10_f64.powf(draws.within(-2.0, 4.0));
    let place = if moved { draws.vector() * far } else { DVec3::ZERO };
    let objects = moving.into_iter().map(|moving| moving.placed(&pose, place)).collect::<Option<Vec<_>>>()?;
    Some(Case { family: "", objects, collide })
}

fn pair(draws: &mut Draws, moving: [Moving; 2], hit: bool) -> Option<Case> {
    placed(draws, moving.into(), if hit { vec![(0, 1)] } else { Vec::new() })
}

/// A square of a side of two in the plane z = 0.
fn square() -> Moving {
    rectangle([-1.0, -1.0, 1.0, 1.0])
}

/// A small cube through a frame, or through its hole, or past its border.
fn tunnelling(draws: &mut Draws) -> Option<Case> {
    let (hit, size) = (draws.coin(), 10_f64.powf(draws.within(-2.0, -0.7)));
    let off = match (hit, draws.within(0.0, 1.0) < 0.8) {
        (true, _) => draws.within(HOLE, 1.0),
        (false, true) => draws.within(0.0, HOLE - size),
        (false, false) => 1.0 + 0.5 * size + wide_gap(draws),
    };
    let lane = DVec3::new(off, draws.within(-1.0, 1.0) * (HOLE - size), 0.0);
    let [above, below] = [1.0, -1.0].map(|side| DVec3::Z * side * draws.within(0.5, 8.0));
    let bullet = Moving::going(&cube(size), lane + above, lane + below);
    pair(draws, [frame(), bullet], hit)
}

/// Half a side of the hole of a frame.
const HOLE: f64 = 0.5;

/// A square of a side of two with a hole.
fn frame() -> Moving {
    let bars = [
        [-1.0, HOLE, 1.0, 1.0],
        [-1.0, -1.0, 1.0, -HOLE],
        [-1.0, -HOLE, -HOLE, HOLE],
        [HOLE, -HOLE, 1.0, HOLE],
    ];
    bars.into_iter().map(rectangle).reduce(Moving::and).unwrap_or_default()
}

/// A rectangle in the plane z = 0, from its least to its greatest corner.
fn rectangle([x0, y0, x1, y1]: [f64; 4]) -> Moving {
    let [a, b, c, d] = [[x0, y0], [x1, y0], [x1, y1], [x0, y1]].map(|[x, y]| DVec3::new(x, y, 0.0));
    Moving(vec![[[a, b, c]; 2], [[a, c, d]; 2]])
}

/// A gap from 1e-3 to one.
fn wide_gap(draws: &mut Draws) -> f64 {
    10_f64.powf(draws.within(-3.0, 0.0))
}

/// A cube past another, a hair apart.
fn near_miss(draws: &mut Draws) -> Option<Case> {
    let hit = draws.coin();
    let lane = DVec3::new(0.0, 1.0 + draws.gap(hit), draws.within(-0.8, 0.8));
    let far = DVec3::X * draws.within(0.2, 4.0);
    cubes(draws, &[[DVec3::ZERO; 2], [lane - far, lane + far]])
}

/// A square along another in one plane, or in one that is a hair above it.
fn sliding(draws: &mut Draws) -> Option<Case> {
    let above = draws.coin();
    let gap = draws.gap(false);
    let apart = if above { draws.within(-1.5, 1.5) } else { 2.0 + wide_gap(draws) };
    let lift = if above { gap } else { 0.0 };
    let at = |y: f64| DVec3::new(apart, y, lift);
    let [from, to] = [at(draws.within(-3.0, 0.0)), at(draws.within(0.0, 3.0))];
    let other = square().moved(from, to);
    pair(draws, [square(), other], false)
}

/// Two bars that cross at one instant, or of which one is too short by a hair.
fn instant(draws: &mut Draws) -> Option<Case> {
    let hit = draws.coin();
    let reach = draws.gap(!hit);
    let bar = |a: DVec3, b: DVec3, thick: DVec3| Moving(vec![[[a, b, 0.5 * (a + b) + thick]; 2]]);
    let still = bar(DVec3::NEG_X, DVec3::X * reach, DVec3::NEG_Z * 0.1);
    let half = draws.within(0.1, 1.0);
    let other = bar(DVec3::Y * half, DVec3::NEG_Y * half, DVec3::new(0.1, 0.0, 0.1));
    let [above, below] = [1.0, -1.0].map(|side| DVec3::Z * side * draws.within(0.3, 4.0));
    pair(draws, [still, other.moved(above, below)], hit)
}

/// Two cubes that change places, side by side.
fn exchange(draws: &mut Draws) -> Option<Case> {
    let side = if draws.coin() { draws.within(0.0, 0.9) } else { 1.0 + wide_gap(draws) };
    let (far, lane) = (DVec3::X * draws.within(0.6, 4.0), DVec3::Y * side);
    cubes(draws, &[[-far, far], [lane + far, lane - far]])
}

/// Two blades like scissors, one above the other.
fn slivers(draws: &mut Draws) -> Option<Case> {
    let (hit, gap) = (draws.coin(), draws.gap(false));
    let lift = DVec3::Z * if hit { 0.0 } else { gap };
    let width = 10_f64.powf(draws.within(-5.0, -1.0));
    let blade = |angle: f64, tilt: f64| {
        let along = DVec3::new(angle.cos(), angle.sin(), 0.0);
        [-0.3 * along, along, DVec3::new(along.y, -along.x, tilt) * width]
    };
    let (from, to) = (draws.within(0.2, 1.2), draws.within(-1.2, -0.2));
    // The lower one hangs down, the upper one stands up.
    let lower = Moving(vec![[blade(from, -1.0), blade(to, -1.0)]]);
    let upper = Moving(vec![[blade(-from, 1.0), blade(-to, 1.0)]]).moved(lift, lift);
    let case = pair(draws, [lower, upper], hit)?;
    let touching = case.objects.iter().map(|object| object.loosened(1e-12)).collect();
    Some(if hit { Case { objects: touching, ..case } } else { case })
}

/// Cubes that fly past each other anywhere.
fn passing(draws: &mut Draws) -> Option<Case> {
    let mut way = || [draws.vector() * 2.5, draws.vector() * 2.5];
    let ways = [way(), way()];
    cubes(draws, &ways)
}

/// A cube that comes to rest on another, or a hair above it.
fn resting(draws: &mut Draws) -> Option<Case> {
    let hit = draws.coin();
    let end = DVec3::new(draws.within(-0.9, 0.9), 1.0 + draws.gap(hit), draws.within(-0.9, 0.9));
    let start = end + DVec3::new(0.0, draws.within(0.5, 3.0), draws.within(-1.0, 1.0));
    cubes(draws, &[[DVec3::ZERO; 2], [start, end]])
}

/// Cubes that fly about.
fn swarm(draws: &mut Draws) -> Option<Case> {
    let mut way = |_| {
        let from = draws.vector() * 5.0;
        [from, from + draws.vector() * 3.0]
    };
    let ways: Vec<Way> = (0..16).map(&mut way).collect();
    cubes(draws, &ways)
}

/// Two streams of cubes that cross.
fn lanes(draws: &mut Draws) -> Option<Case> {
    let far = draws.within(0.5, 3.0);
    let mut way = |n: usize| {
        let along = if n < 8 { DVec3::X } else { DVec3::Y };
        let lane = DVec3::new(draws.within(-6.0, 6.0), draws.within(-6.0, 6.0), draws.within(-4.0, 4.0));
        let late = along * draws.within(-2.0, 2.0);
        [lane - along * far + late, lane + along * far + late]
    };
    let ways: Vec<Way> = (0..16).map(&mut way).collect();
    cubes(draws, &ways)
}

/// Cubes that fly side by side, a hair apart, and one against them.
fn formation(draws: &mut Draws) -> Option<Case> {
    let way = draws.vector() * draws.within(0.0, 1.0);
    let spacing = 1.0 + 10_f64.powf(draws.within(-3.0, 1.5));
    let place = |n: usize| DVec3::new((n % 5) as f64, 0.0, (n / 5) as f64) * spacing;
    let mut ways: Vec<Way> = (0..15).map(|n| [place(n), place(n) + way]).collect();
    let end = place(7) + way + DVec3::new(draws.within(-2.0, 2.0), 1.0 + draws.gap(false), 0.0);
    ways.push([end + DVec3::Y * draws.within(1.0, 4.0), end]);
    cubes(draws, &ways)
}
