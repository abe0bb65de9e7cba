//! Conservative mode against dense sampling: no touched tile is missed, and no touch is outside the
//! intervals.

use std::collections::{HashMap, HashSet};

use crate::common::touch;
use pipeline::conservative::{Grid, MovingTriangle, Rasterizer, Rect, Region, Touch, View};
use pipeline::random::SplitMix;

/// Uniform, on a coarse binary grid, or an end.
fn odd(r: &mut SplitMix, [lo, hi]: [f64; 2]) -> f64 {
    match r.next_word() % 4 {
        0 => lo,
        1 => hi,
        2 => lo + (hi - lo) * (r.next_word() % 9) as f64 / 8.0,
        _ => r.within(lo, hi),
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum TriangleKind {
    Ordinary,
    Tiny,
    Huge,
    Sliver,
    Segment,
    Point,
    /// Vertices on the borders of tiles and in numbers of few bits, so that touching is decided exactly.
    Grid,
    /// Vertices behind the camera.
    Behind,
}

const KINDS: [TriangleKind; 8] = [
    TriangleKind::Ordinary,
    TriangleKind::Tiny,
    TriangleKind::Huge,
    TriangleKind::Sliver,
    TriangleKind::Segment,
    TriangleKind::Point,
    TriangleKind::Grid,
    TriangleKind::Behind,
];

const VIEWS: [View; 6] = [
    View::Orthographic { s: [0.0; 2], a: [0.0; 2], near: f64::NEG_INFINITY },
    View::Orthographic { s: [2.0, -2.0], a: [0.5, -0.5], near: 0.25 },
    View::Orthographic { s: [3.0, -1.0], a: [2.0, -0.25], near: -1.0 },
    View::Perspective { s: [0.0; 2], a: [0.0; 2], near: 0.25 },
    View::Perspective { s: [2.0, -2.0], a: [0.5, -0.5], near: 0.25 },
    View::Perspective { s: [3.0, -1.0], a: [2.0, -0.25], near: 0.0 },
];

const GRID: Grid = Grid { origin: [-8.0, -8.0], tile: [1.0; 2], columns: 16, rows: 16 };

fn triangle(kind: TriangleKind, view: &View, r: &mut SplitMix) -> [[[f64; 3]; 3]; 2] {
    let middle = [r.within(-6.0, 6.0), r.within(-6.0, 6.0), r.within(1.0, 8.0)];
    let radius = match kind {
        TriangleKind::Tiny => 1e-6,
        TriangleKind::Huge => 1e6,
        _ => r.within(0.2, 4.0),
    };
    let still = r.next_word().is_multiple_of(4);
    let mut end = |drift: f64| {
        let mut p = [0, 1, 2].map(|_| {
            let mut p = middle.map(|c| c + drift * r.within(-1.0, 1.0) + radius * r.within(-1.0, 1.0));
            if kind != TriangleKind::Behind {
                p[2] = p[2].abs().max(0.3);
            } else if r.next_word().is_multiple_of(3) {
                p[2] = r.within(-4.0, 1.0);
            }
            if kind == TriangleKind::Grid {
                p = p.map(|c| (4.0 * c).round() / 4.0);
                p[2] = [0.5, 1.0, 2.0, 4.0][r.next_word() as usize % 4];
                p[0] = p[0].round();
            }
            if let View::Perspective { .. } = view { [p[0] * p[2], p[1] * p[2], p[2]] } else { p }
        });
        match kind {
            TriangleKind::Point => p = [p[0]; 3],
            TriangleKind::Segment => p[2] = p[1],
            TriangleKind::Sliver => {
                p[2] = [0, 1, 2].map(|i| 0.5 * (p[0][i] + p[1][i]) + 1e-9 * r.within(-1.0, 1.0))
            }
            _ => {}
        }
        p
    };
    let drift = if kind == TriangleKind::Tiny { 1e-5 } else { 1.0 };
    let open = end(drift);
    [open, if still { open } else { end(drift) }]
}

/// Shear of the lens.
fn lens(view: &View) -> [[f64; 2]; 2] {
    let (View::Perspective { s, a, .. } | View::Orthographic { s, a, .. }) = view;
    [*s, *a]
}

/// Factor of an image coordinate for a point at this depth.
fn weight(view: &View, depth: f64) -> f64 {
    if let View::Orthographic { .. } = view { 1.0 } else { depth }
}

/// A point of the triangle at a time and lens position: its image position and depth.
struct Point {
    u: f64,
    v: f64,
    t: f64,
    x: f64,
    y: f64,
    w: f64,
    z: f64,
}

fn point(ends: &[[[f64; 3]; 3]; 2], view: &View, within: &Region, r: &mut SplitMix) -> Point {
    let (u, v) = (odd(r, within.u), odd(r, within.v));
    let t = odd(r, within.t);
    let first = odd(r, [0.0, 1.0]);
    let second = odd(r, [0.0, 1.0]) * (1.0 - first);
    point_at(ends, view, [u, v, t], [first, second, 1.0 - first - second])
}

fn point_at(ends: &[[[f64; 3]; 3]; 2], view: &View, [u, v, t]: [f64; 3], weights: [f64; 3]) -> Point {
    let p: [f64; 3] = [0, 1, 2].map(|axis| {
        (0..3).map(|k| weights[k] * (ends[0][k][axis] + t * (ends[1][k][axis] - ends[0][k][axis]))).sum()
    });
    let ([s, a], w) = (lens(view), weight(view, p[2]));
    let shear = |axis: usize, place: f64| p[axis] + place * (a[axis] * p[2] - s[axis]);
    Point { u, v, t, x: shear(0, u), y: shear(1, v), w, z: p[2] }
}

/// The point of the triangle seen in the middle part of a random tile, at a random time and lens position, if
/// it exists and is well inside.
fn aimed(
    ends: &[[[f64; 3]; 3]; 2],
    view: &View,
    within: &Region,
    grid: &Grid,
    r: &mut SplitMix,
) -> Option<Point> {
    let (u, v) = (odd(r, within.u), odd(r, within.v));
    let t = odd(r, within.t);
    let mut place = |axis: usize, count: u32| {
        grid.origin[axis]
            + grid.tile[axis] * ((r.next_word() % u64::from(count)) as f64 + r.within(0.01, 0.99))
    };
    let at = [place(0, grid.columns), place(1, grid.rows)];
    let [s, a] = lens(view);
    let seen = [0, 1, 2].map(|k| {
        let p = [0, 1, 2].map(|axis| ends[0][k][axis] + t * (ends[1][k][axis] - ends[0][k][axis]));
        let w = weight(view, p[2]);
        [0, 1]
            .map(|axis| p[axis] + [u, v][axis] * (a[axis] * p[2] - s[axis]) - at[axis] * w)
            .into_iter()
            .chain([w, p[2]])
            .collect::<Vec<_>>()
    });
    let e = [(1, 2), (2, 0), (0, 1)].map(|(i, j)| seen[i][0] * seen[j][1] - seen[j][0] * seen[i][1]);
    let sum: f64 = e.iter().sum();
    let weights = e.map(|e| e / sum);
    let mean = |part: usize| (0..3).map(|k| weights[k] * seen[k][part]).sum::<f64>();
    let (w, z) = (mean(2), mean(3));
    let inside = weights.iter().all(|&weight| weight > 1e-3) && w > 1e-3;
    inside.then_some(Point { u, v, t, x: at[0] * w, y: at[1] * w, w, z })
}

/// The tiles, at most four, that contain an image position; borders count.
fn tiles(grid: &Grid, point: &Point) -> impl Iterator<Item = [u32; 2]> + use<> {
    let along = |at: f64, w: f64, axis: usize, count: u32| {
        let (tile, origin) = (grid.tile[axis], grid.origin[axis]);
        let place = ((at / w - origin) / tile).floor();
        [-1.0, 0.0, 1.0].map(|step| {
            let index = place + step;
            let [lo, hi] = [origin + index * tile, origin + (index + 1.0) * tile];
            let holds = lo * w <= at && at <= hi * w && (0.0..f64::from(count)).contains(&index);
            holds.then_some(index as u32)
        })
    };
    let columns = along(point.x, point.w, 0, grid.columns);
    let rows = along(point.y, point.w, 1, grid.rows);
    columns.into_iter().flatten().flat_map(move |x| rows.into_iter().flatten().map(move |y| [x, y]))
}

fn near(view: &View) -> f64 {
    match view {
        View::Orthographic { near, .. } => *near,
        View::Perspective { near, .. } => near.max(1e-3),
    }
}

fn holds(touch: &Touch, p: &Point, lens: bool, off: f64) -> bool {
    let inside = |[lo, hi]: [f64; 2], c: f64| (lo..=hi).contains(&c);
    let depth = inside([touch.z[0] - off, touch.z[1] + off], p.z);
    inside(touch.t, p.t) && depth && (!lens || inside(touch.u, p.u) && inside(touch.v, p.v))
}

#[derive(Debug, Default)]
struct Found {
    points: u64,
    missed: u64,
    outside: u64,
    reported: u64,
    touched: u64,
}

#[allow(clippy::too_many_arguments, reason = "one for each choice")]
fn check(
    found: &mut Found,
    rasterizer: &Rasterizer,
    view: &View,
    clip: &Region,
    grid: &Grid,
    ends: &[[[f64; 3]; 3]; 2],
    points: u32,
    r: &mut SplitMix,
) {
    let moving = MovingTriangle::new(ends[0], ends[1]).unwrap();
    let mut reported = HashMap::new();
    rasterizer.rasterize(&moving, grid, |tile, touch| assert!(reported.insert(tile, *touch).is_none()));
    let mut touched = HashSet::new();
    let size = ends.iter().flatten().map(|p| p[2].abs()).fold(0.0, f64::max);
    for index in 0..points {
        // The depth of an aimed point is known up to rounding only; a point of given weights is exact.
        let (p, off) = if index % 4 == 3 {
            (aimed(ends, view, clip, grid, r), 1e-11 * size)
        } else {
            (Some(point(ends, view, clip, r)), 0.0)
        };
        let Some(p) = p.filter(|p| p.z >= near(view)) else { continue };
        for tile in tiles(grid, &p) {
            found.points += 1;
            touched.insert(tile);
            match reported.get(&tile) {
                None => found.missed += 1,
                Some(touch) => found.outside += u64::from(!holds(touch, &p, view.has_lens(), off)),
            }
        }
    }
    found.reported += reported.len() as u64;
    found.touched += touched.len() as u64;
}

#[test]
fn no_tile_is_missed_and_nothing_lies_outside() {
    for view in VIEWS {
        for kind in KINDS {
            let (mut found, mut r) = (Found::default(), SplitMix::new(7));
            for round in 0..150_u32 {
                let clip = if round % 3 == 0 {
                    Region { u: [-0.5, 0.25], v: [0.0, 0.0], t: [0.25, 0.75] }
                } else {
                    Region::WHOLE
                };
                let rasterizer = Rasterizer::new(view).clipped(clip).halving(round % 4);
                let rasterizer = if round / 4 % 2 == 0 { rasterizer } else { rasterizer.in_doubles() };
                let grid = match round % 5 {
                    0 => Grid { tile: [0.25; 2], columns: 64, rows: 33, ..GRID },
                    1 => Grid { tile: [5.0; 2], columns: 3, rows: 4, ..GRID },
                    _ => GRID,
                };
                let ends = triangle(kind, &view, &mut r);
                check(&mut found, &rasterizer, &view, &clip, &grid, &ends, 1500, &mut r);
            }
            println!("{kind:?} {view:?} {found:?}");
            assert_eq!([found.missed, found.outside], [0, 0], "{kind:?} {view:?} {found:?}");
            assert!(found.points > 1000, "{kind:?} {view:?} {found:?}");
        }
    }
}

/// Worst case of rounding: far from the origin, a thin triangle passes, at one time and from one lens
/// position, through the corner of four tiles within `f64` precision. The tiles in which it is found have to
/// be reported.
#[test]
fn a_corner_cut_off_by_a_rounding_is_reported() {
    let grid = Grid { origin: [1e6, -1e6], ..GRID };
    for view in VIEWS {
        let (mut r, mut checked, mut missed) = (SplitMix::new(5), 0, 0);
        for round in 0..3000_u32 {
            let (u, v, t) = (odd(&mut r, [-1.0, 1.0]), odd(&mut r, [-1.0, 1.0]), odd(&mut r, [0.0, 1.0]));
            let corner = [0, 1].map(|axis| grid.origin[axis] + (1 + r.next_word() % 15) as f64);
            let way = [r.within(-1.0, 1.0), r.within(-1.0, 1.0)];
            let speed = r.within(0.0, 1e3);
            let mut ends = [[[0.0; 3]; 3]; 2];
            for (k, along) in [-r.within(0.1, 2.0), r.within(0.1, 2.0), 0.0].into_iter().enumerate() {
                let depth = r.within(1.0, 4.0);
                let ([s, a], w) = (lens(&view), weight(&view, depth));
                let at = [0, 1].map(|axis| {
                    (corner[axis] + along * way[axis]) * w - [u, v][axis] * (a[axis] * depth - s[axis])
                });
                for axis in [0, 1] {
                    let velocity = if round % 2 == 0 { 0.0 } else { speed * r.within(-1.0, 1.0) };
                    ends[0][k][axis] = at[axis] - t * velocity;
                    ends[1][k][axis] = at[axis] + (1.0 - t) * velocity;
                }
                (ends[0][k][2], ends[1][k][2]) = (depth, depth);
            }
            let p = point_at(&ends, &view, [u, v, t], [0.0, 0.0, 1.0]);
            let moving = MovingTriangle::new(ends[0], ends[1]).unwrap();
            for rasterizer in [Rasterizer::new(view), Rasterizer::new(view).in_doubles()] {
                let mut reported = HashSet::new();
                rasterizer.rasterize(&moving, &grid, |tile, _| assert!(reported.insert(tile)));
                for tile in tiles(&grid, &p) {
                    checked += 1;
                    missed += u32::from(!reported.contains(&tile));
                }
            }
        }
        assert_eq!(missed, 0, "{missed} of {checked} {view:?}");
        assert!(checked > 6000, "{checked} {view:?}");
    }
}

/// Reported tiles over those that dense sampling finds touched; with fewer points the ratio grows.
#[test]
fn the_false_positive_rate_of_tiles_is_low() {
    for (kind, most) in
        [(TriangleKind::Ordinary, 1.05), (TriangleKind::Sliver, 1.05), (TriangleKind::Behind, 1.6)]
    {
        for view in VIEWS {
            let ratios = [0, 2, 4].map(|halvings| {
                let (mut found, mut r) = (Found::default(), SplitMix::new(11));
                for _ in 0..16 {
                    let ends = triangle(kind, &view, &mut r);
                    let rasterizer = Rasterizer::new(view).halving(halvings);
                    check(&mut found, &rasterizer, &view, &Region::WHOLE, &GRID, &ends, 100_000, &mut r);
                }
                assert_eq!([found.missed, found.outside], [0, 0]);
                found.reported as f64 / found.touched as f64
            });
            println!("{kind:?} {view:?}: {ratios:.3?} reported for one touched, halved 0, 2, 4 times");
            assert!(ratios[2] < most, "{kind:?} {view:?} {ratios:?}");
        }
    }
}

/// A custom hierarchy of tiles, from coarse to fine, finds no more than the grid does.
#[test]
fn tiles_can_be_walked_by_hand() {
    let mut r = SplitMix::new(3);
    let rasterizer = Rasterizer::new(VIEWS[3]);
    let ends = triangle(TriangleKind::Ordinary, &VIEWS[3], &mut r);
    let moving = MovingTriangle::new(ends[0], ends[1]).unwrap();
    let mut reported = HashMap::new();
    rasterizer.rasterize(&moving, &GRID, |tile, touch| {
        reported.insert(tile, *touch);
    });
    let whole = Rect { x: [-8.0, 8.0], y: [-8.0, 8.0] };
    let coarse = touch(&rasterizer, &moving, &whole, &Region::WHOLE).unwrap();
    for ([column, row], part) in &reported {
        let rect = GRID.rect(&(*column..column + 1), &(*row..row + 1));
        let within = Region { u: coarse.u, v: coarse.v, t: coarse.t };
        assert!(touch(&rasterizer, &moving, &rect, &within).is_some());
        assert!(coarse.t[0] <= part.t[0] && part.t[1] <= coarse.t[1], "{coarse:?} {part:?}");
    }
}
