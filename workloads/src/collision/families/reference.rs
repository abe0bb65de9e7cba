//! Cases of the kinds that the reference rates of false positives in the book were measured on. Objects have
//! few triangles and random poses, with sizes and positions from 1e-6 to 1e6. Gaps of 1e-7 to 1e-3 of their
//! size are as frequent as larger ones.
//!
//! The cubes of a case stay parallel, so three intervals of time decide whether they meet. Cases that depend
//! on less than [`MARGIN`] are dropped.

use glam::{DMat3, DVec3};

use super::{Case, Maker, Moving, Rng, cube};
use crate::collision::meet;

/// Kinds with two objects.
pub(super) const PAIRS: [(&str, Maker); 8] = [
    ("tunnelling", tunnelling),
    ("near misses", near_miss),
    ("coplanar sliding", sliding),
    ("one instant", instant),
    ("exchanged places", exchange),
    ("rotating slivers", slivers),
    ("passing by", passing),
    ("resting", resting),
];

/// Kinds with many objects.
pub(super) const GROUPS: [(&str, Maker); 3] =
    [("swarm of cubes", swarm), ("crossing lanes", lanes), ("formation", formation)];

/// Margin for rounding, as a share of an object's size.
const MARGIN: f64 = 1e-9;

/// Centre of a cube of side one, at both times.
type Motion = [DVec3; 2];

/// Whether two cubes of side one meet; `None` if rounding decides.
fn cubes_meet(a: Motion, b: Motion) -> Option<bool> {
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

/// Times at which `|from + t motion| <= reach`; an empty range if never.
fn within(from: f64, motion: f64, reach: f64) -> [f64; 2] {
    if motion == 0.0 {
        return if from.abs() <= reach { [0.0, 1.0] } else { [1.0, 0.0] };
    }
    let [a, b] = [(-reach - from) / motion, (reach - from) / motion];
    [a.min(b), a.max(b)]
}

/// A case of cubes, with the pairs that meet.
fn cubes(rng: &mut Rng, motions: &[Motion]) -> Option<Case> {
    let mut collide = Vec::new();
    for (a, b) in (0..motions.len()).flat_map(|a| (a + 1..motions.len()).map(move |b| (a, b))) {
        if cubes_meet(motions[a], motions[b])? {
            collide.push((a, b));
        }
    }
    let translating = |[from, to]: &Motion| Moving::translating(&cube(1.0), *from, *to);
    let moving = motions.iter().map(translating).collect();
    placed(rng, moving, collide)
}

/// Poses the objects. Nearly half of the cases are aligned with the axes, and half are at the origin.
fn placed(rng: &mut Rng, moving: Vec<Moving>, collide: Vec<(usize, usize)>) -> Option<Case> {
    let (turned, moved) = (rng.within(0.0, 1.0) < 0.55, rng.coin());
    let pose = rng.pose();
    let size = pose.x_axis.length();
    let pose = if turned { pose } else { DMat3::from_diagonal(DVec3::splat(size)) };
    // The distance keeps gaps much larger than an ulp of the coordinates.
    let far = size * 10_f64.powf(rng.within(-2.0, 4.0));
    let place = if moved { rng.vector() * far } else { DVec3::ZERO };
    let objects = moving.into_iter().map(|moving| moving.placed(&pose, place)).collect::<Option<Vec<_>>>()?;
    Some(Case { family: "", objects, collide })
}

fn pair(rng: &mut Rng, moving: [Moving; 2], hit: bool) -> Option<Case> {
    placed(rng, moving.into(), if hit { vec![(0, 1)] } else { Vec::new() })
}

/// A square of side two in the plane z = 0.
fn square() -> Moving {
    rectangle([-1.0, -1.0, 1.0, 1.0])
}

/// A small cube that hits a frame, passes through its hole, or passes beside it.
fn tunnelling(rng: &mut Rng) -> Option<Case> {
    let (hit, size) = (rng.coin(), 10_f64.powf(rng.within(-2.0, -0.7)));
    let off = match (hit, rng.within(0.0, 1.0) < 0.8) {
        (true, _) => rng.within(HOLE, 1.0),
        (false, true) => rng.within(0.0, HOLE - size),
        (false, false) => 1.0 + 0.5 * size + wide_gap(rng),
    };
    let lane = DVec3::new(off, rng.within(-1.0, 1.0) * (HOLE - size), 0.0);
    let [above, below] = [1.0, -1.0].map(|side| DVec3::Z * side * rng.within(0.5, 8.0));
    let bullet = Moving::translating(&cube(size), lane + above, lane + below);
    pair(rng, [frame(), bullet], hit)
}

/// Half the side of the hole of a frame.
const HOLE: f64 = 0.5;

/// A square of side two with a hole.
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
fn wide_gap(rng: &mut Rng) -> f64 {
    10_f64.powf(rng.within(-3.0, 0.0))
}

/// A cube that passes another with a tiny gap.
fn near_miss(rng: &mut Rng) -> Option<Case> {
    let hit = rng.coin();
    let lane = DVec3::new(0.0, 1.0 + rng.gap(hit), rng.within(-0.8, 0.8));
    let far = DVec3::X * rng.within(0.2, 4.0);
    cubes(rng, &[[DVec3::ZERO; 2], [lane - far, lane + far]])
}

/// A square that slides along another, in the same plane or slightly above it.
fn sliding(rng: &mut Rng) -> Option<Case> {
    let above = rng.coin();
    let gap = rng.gap(false);
    let apart = if above { rng.within(-1.5, 1.5) } else { 2.0 + wide_gap(rng) };
    let lift = if above { gap } else { 0.0 };
    let at = |y: f64| DVec3::new(apart, y, lift);
    let [from, to] = [at(rng.within(-3.0, 0.0)), at(rng.within(0.0, 3.0))];
    let other = square().moved(from, to);
    pair(rng, [square(), other], false)
}

/// Two bars that cross at one instant; in half of the cases one is slightly too short.
fn instant(rng: &mut Rng) -> Option<Case> {
    let hit = rng.coin();
    let reach = rng.gap(!hit);
    let bar = |a: DVec3, b: DVec3, thick: DVec3| Moving(vec![[[a, b, 0.5 * (a + b) + thick]; 2]]);
    let still = bar(DVec3::NEG_X, DVec3::X * reach, DVec3::NEG_Z * 0.1);
    let half = rng.within(0.1, 1.0);
    let other = bar(DVec3::Y * half, DVec3::NEG_Y * half, DVec3::new(0.1, 0.0, 0.1));
    let [above, below] = [1.0, -1.0].map(|side| DVec3::Z * side * rng.within(0.3, 4.0));
    pair(rng, [still, other.moved(above, below)], hit)
}

/// Two cubes that exchange positions, side by side.
fn exchange(rng: &mut Rng) -> Option<Case> {
    let side = if rng.coin() { rng.within(0.0, 0.9) } else { 1.0 + wide_gap(rng) };
    let (far, lane) = (DVec3::X * rng.within(0.6, 4.0), DVec3::Y * side);
    cubes(rng, &[[-far, far], [lane + far, lane - far]])
}

/// Two blades like scissors, one above the other.
fn slivers(rng: &mut Rng) -> Option<Case> {
    let (hit, gap) = (rng.coin(), rng.gap(false));
    let lift = DVec3::Z * if hit { 0.0 } else { gap };
    let width = 10_f64.powf(rng.within(-5.0, -1.0));
    let blade = |angle: f64, tilt: f64| {
        let along = DVec3::new(angle.cos(), angle.sin(), 0.0);
        [-0.3 * along, along, DVec3::new(along.y, -along.x, tilt) * width]
    };
    let (from, to) = (rng.within(0.2, 1.2), rng.within(-1.2, -0.2));
    // The lower one hangs down, the upper one stands up.
    let lower = Moving(vec![[blade(from, -1.0), blade(to, -1.0)]]);
    let upper = Moving(vec![[blade(-from, 1.0), blade(-to, 1.0)]]).moved(lift, lift);
    let case = pair(rng, [lower, upper], hit)?;
    let touching = case.objects.iter().map(|object| object.loosened(1e-12)).collect();
    Some(if hit { Case { objects: touching, ..case } } else { case })
}

/// Two cubes that pass each other at random.
fn passing(rng: &mut Rng) -> Option<Case> {
    let mut motion = || [rng.vector() * 2.5, rng.vector() * 2.5];
    let motions = [motion(), motion()];
    cubes(rng, &motions)
}

/// A cube that comes to rest on another, or slightly above it.
fn resting(rng: &mut Rng) -> Option<Case> {
    let hit = rng.coin();
    let end = DVec3::new(rng.within(-0.9, 0.9), 1.0 + rng.gap(hit), rng.within(-0.9, 0.9));
    let start = end + DVec3::new(0.0, rng.within(0.5, 3.0), rng.within(-1.0, 1.0));
    cubes(rng, &[[DVec3::ZERO; 2], [start, end]])
}

/// Cubes that move at random.
fn swarm(rng: &mut Rng) -> Option<Case> {
    let mut motion = |_| {
        let from = rng.vector() * 5.0;
        [from, from + rng.vector() * 3.0]
    };
    let motions: Vec<Motion> = (0..16).map(&mut motion).collect();
    cubes(rng, &motions)
}

/// Two crossing streams of cubes.
fn lanes(rng: &mut Rng) -> Option<Case> {
    let far = rng.within(0.5, 3.0);
    let mut motion = |n: usize| {
        let along = if n < 8 { DVec3::X } else { DVec3::Y };
        let lane = DVec3::new(rng.within(-6.0, 6.0), rng.within(-6.0, 6.0), rng.within(-4.0, 4.0));
        let late = along * rng.within(-2.0, 2.0);
        [lane - along * far + late, lane + along * far + late]
    };
    let motions: Vec<Motion> = (0..16).map(&mut motion).collect();
    cubes(rng, &motions)
}

/// Cubes that move in formation with small gaps, and one that moves against them.
fn formation(rng: &mut Rng) -> Option<Case> {
    let motion = rng.vector() * rng.within(0.0, 1.0);
    let spacing = 1.0 + 10_f64.powf(rng.within(-3.0, 1.5));
    let place = |n: usize| DVec3::new((n % 5) as f64, 0.0, (n / 5) as f64) * spacing;
    let mut motions: Vec<Motion> = (0..15).map(|n| [place(n), place(n) + motion]).collect();
    let end = place(7) + motion + DVec3::new(rng.within(-2.0, 2.0), 1.0 + rng.gap(false), 0.0);
    motions.push([end + DVec3::Y * rng.within(1.0, 4.0), end]);
    cubes(rng, &motions)
}
