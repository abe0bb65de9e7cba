//! Depth intervals contain every depth of the sample test in a tile and a box of lens and time, and every
//! depth of the exact triangle.

use crate::common::case::{Case, Setting, setting};
use crate::common::*;
use pipeline::depth::{Bounder, DepthBound};
use pipeline::setup::{SetupResult, Triangle};
use pipeline::traversal::{Box5, TileRect};
use pipeline::*;

/// A random part of lens and time, or all of it.
fn part(r: &mut Uniform, lens: bool) -> Box5 {
    if r.next() < 0.25 {
        return Box5::whole(lens);
    }
    let mut range = |lo: f32, hi: f32| {
        let (a, b) = (r.within(lo, hi), r.within(lo, hi));
        [a.min(b), a.max(b)]
    };
    Box5 { u: range(-1.0, 1.0), v: range(-1.0, 1.0), t: range(0.0, 1.0), lens }
}

/// Result of the tests: samples tested, depths outside, and cases in which planes are tighter than vertices.
#[derive(Debug, Default)]
struct Found {
    depths: u64,
    outside: u64,
    boxes: u64,
    tighter: u64,
}

fn hold(found: &mut Found, triangle: &Triangle, probe: &Probe, tile: &TileRect, within: &Box5) {
    let (seen, _) = probe.test(triangle, within);
    // A still triangle is tested at all times.
    let bounds = DepthBound::ALL.map(|bound| Bounder::new(triangle, &probe.shear, bound).over(tile, within));
    let width = |[lo, hi]: [f32; 2]| hi - lo;
    found.boxes += 1;
    found.tighter += u64::from(width(bounds[3]) < width(bounds[1]));
    for depth in seen.into_iter().flatten() {
        found.depths += 1;
        found.outside += bounds.iter().filter(|[lo, hi]| !(*lo..=*hi).contains(&depth)).count() as u64;
    }
}

fn tile(far: bool) -> TileRect {
    let (viewport, origin) = if far {
        (Viewport::new(Viewport::MAX_PX, Viewport::MAX_PX).unwrap(), [0, Viewport::MAX_PX - 8])
    } else {
        (Viewport::new(8, 8).unwrap(), [0, 0])
    };
    TileRect::new(viewport, origin, 8)
}

/// Samples on the edges of triangles of every kind, including slivers, with a third of the vertices behind
/// the camera.
#[test]
fn no_depth_of_the_sample_test_is_outside() {
    for flags in 0..64_u32 {
        let on = |bit: u32| flags & (1 << bit) != 0;
        let mut found = Found::default();
        for seed in 0..500_u64 {
            let scale = [0, -20, 19][seed as usize % 3];
            let (moving, lens, parallel) = (on(0), on(1), on(5));
            let case = Case { moving, lens, parallel, behind: on(2), far: on(3), sliver: on(4), scale };
            let setting = setting(case, seed * 64 + u64::from(flags));
            let SetupResult::Ready(triangle) = setting.probe.set_up(setting.triangle, Cull::None) else {
                continue;
            };
            let mut r = Uniform::new(seed);
            for _ in 0..3 {
                let within = part(&mut r, case.lens);
                hold(&mut found, &triangle, &setting.probe, &tile(case.far), &within);
            }
        }
        println!("{flags:06b} {found:?}");
        assert_eq!(found.outside, 0, "{flags:06b} {found:?}");
        assert!(found.depths > 3_000, "{flags:06b} {found:?}");
    }
}

/// The same triangle seen through a pinhole, nearly parallel to the image. There the rounding of the depth
/// exceeds that of the position.
fn flattened(triangle: [MovingVertex; 3]) -> [MovingVertex; 3] {
    let depth = triangle[0].open[2];
    let flat = |[x, y, w]: [f32; 3]| {
        let scale = depth * (1.0 + 1e-3 * (w / depth).sin()) / w;
        [x * scale, y * scale, w * scale]
    };
    triangle.map(|vertex| MovingVertex { open: flat(vertex.open), close: flat(vertex.close) })
}

/// The same triangle with its third vertex close to the line through the others, at the samples. Its area as
/// seen is close to the rounding error.
fn thinned(triangle: [MovingVertex; 3], r: &mut Uniform) -> [MovingVertex; 3] {
    let (along, off) = (r.within(-0.2, 1.2), (-14.0 * r.next()).exp2() * 1e-2);
    let [a, b, c] = triangle;
    let thin = |a: [f32; 3], b: [f32; 3], c: [f32; 3]| {
        std::array::from_fn(|axis| a[axis] + along * (b[axis] - a[axis]) + off * (c[axis] - a[axis]))
    };
    [a, b, MovingVertex { open: thin(a.open, b.open, c.open), close: thin(a.close, b.close, c.close) }]
}

/// Tightest cases: a tile of one sample and a box of its lens position and time, or a short time around that.
/// The rest of the interval is rounding, so too small a margin shows.
#[test]
fn no_depth_is_outside_the_interval_of_its_own_sample() {
    let (mut depths, mut plain, mut bounded, mut outside) = (0_u64, 0_u64, 0_u64, 0_u64);
    for flags in 0..64_u32 {
        let on = |bit: u32| flags & (1 << bit) != 0;
        for seed in 0..360_u64 {
            let (scale, shape) = ([0, -20, 19][seed as usize % 3], seed / 3 % 3);
            let (moving, lens, parallel) = (on(0), on(1), on(5));
            let case = Case { moving, lens, parallel, behind: on(2), far: on(3), sliver: on(4), scale };
            let Setting { triangle, probe } = setting(case, seed * 64 + u64::from(flags) + 1_000_000);
            let mut r = Uniform::new(seed);
            let triangle = match shape {
                0 => triangle,
                1 => flattened(triangle),
                _ => thinned(triangle, &mut r),
            };
            let SetupResult::Ready(triangle) = probe.set_up(triangle, Cull::None) else { continue };
            let bounders = DepthBound::ALL.map(|bound| Bounder::new(&triangle, &probe.shear, bound));
            let (seen, _) = probe.test(&triangle, &probe.whole());
            for (slot, depth) in seen.into_iter().enumerate() {
                let (Some(depth), s) = (depth, &probe.samples) else { continue };
                let point = |value: f32| [value; 2];
                let tile = TileRect { x: point(s.x[slot]), y: point(s.y[slot]) };
                let within =
                    Box5 { u: point(s.u[slot]), v: point(s.v[slot]), t: point(s.t[slot]), lens: case.lens };
                let span = (-20.0 * r.next()).exp2();
                let while_around =
                    [(s.t[slot] - span * r.next()).max(0.0), (s.t[slot] + span * r.next()).min(1.0)];
                for within in [within, Box5 { t: while_around, ..within }] {
                    let bounds = bounders.map(|bounder| bounder.over(&tile, &within));
                    outside += bounds.iter().filter(|[lo, hi]| !(*lo..=*hi).contains(&depth)).count() as u64;
                    // A thousandth of the range of a flattened one would be rounding.
                    let width = |[lo, hi]: [f32; 2]| hi - lo;
                    depths += 1;
                    plain += u64::from(shape == 0 && within.t == while_around);
                    bounded += u64::from(
                        shape == 0 && within.t == while_around && width(bounds[3]) < 0.1 * width(bounds[1]),
                    );
                }
            }
        }
    }
    println!(
        "{depths} depths, {bounded} of {plain} known to a tenth of the vertices' range, {outside} outside"
    );
    assert_eq!(outside, 0);
    assert!(bounded > plain / 2, "{bounded} of {plain}");
}

/// A triangle that turns over exactly at the time of a sample on its first edge. It is wide at the ends of
/// the shutter, so planes through it there are accurate, but only rounding remains at the sample.
#[test]
fn no_depth_is_outside_where_the_triangle_turns_over() {
    let (mut depths, mut outside) = (0_u64, 0_u64);
    for flags in 0..16_u32 {
        let on = |bit: u32| flags & (1 << bit) != 0;
        for seed in 0..200_u64 {
            let (moving, lens, parallel) = (true, on(0), on(3));
            let case = Case { moving, lens, parallel, behind: on(1), far: on(2), sliver: false, scale: 0 };
            let Setting { triangle: [a, b, _], probe } = setting(case, seed + 5_000_000);
            let mut r = Uniform::new(seed);
            for slot in 0..probe.samples.len {
                let t = probe.samples.t[slot];
                let turning = turning_over_at(t, [a, b], &mut r);
                let SetupResult::Ready(triangle) = probe.set_up(turning, Cull::None) else { continue };
                let s = &probe.samples;
                let point = |value: f32| [value; 2];
                let tile = TileRect { x: point(s.x[slot]), y: point(s.y[slot]) };
                let span = if slot % 2 == 0 { 1.0 } else { (-20.0 * r.next()).exp2() };
                let times = [(t - span * r.next()).max(0.0), (t + span * r.next()).min(1.0)];
                let within = Box5 { u: point(s.u[slot]), v: point(s.v[slot]), t: times, lens: case.lens };
                let Some(depth) = probe.test(&triangle, &Box5 { t: point(t), ..within }).0[slot] else {
                    continue;
                };
                for bound in DepthBound::ALL {
                    let bounder = Bounder::new(&triangle, &probe.shear, bound);
                    for within in [within, Box5 { t: point(t), ..within }] {
                        let [lo, hi] = bounder.over(&tile, &within);
                        outside += u64::from(!(lo..=hi).contains(&depth));
                    }
                }
                depths += 1;
            }
        }
    }
    println!("{depths} depths, {outside} outside");
    assert_eq!(outside, 0);
    assert!(depths > 5000, "{depths}");
}

/// A triangle on the edge from `a` to `b` whose third vertex nearly reaches that edge at `t`.
fn turning_over_at(t: f32, [a, b]: [MovingVertex; 2], r: &mut Uniform) -> [MovingVertex; 3] {
    let (along, off) = (r.within(-0.2, 1.2), (-24.0 * r.next()).exp2());
    let velocity = [0, 1, 2].map(|axis| if axis < 2 { r.within(-40.0, 40.0) } else { 0.0 });
    let hair = [0, 1].map(|_| off * r.within(-1.0, 1.0));
    let at =
        |vertex: &MovingVertex, axis: usize| vertex.open[axis] + t * (vertex.close[axis] - vertex.open[axis]);
    let end = |time: f32| {
        std::array::from_fn(|axis| {
            let on_edge = at(&a, axis) + along * (at(&b, axis) - at(&a, axis));
            on_edge + hair.get(axis).copied().unwrap_or(0.0) + (time - t) * velocity[axis]
        })
    };
    [a, b, MovingVertex { open: end(0.0), close: end(1.0) }]
}
