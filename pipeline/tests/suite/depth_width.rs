//! Widths of depth intervals: each method compared with that of the vertices and with the true one, by dense
//! sampling. `cargo test --release -p pipeline --test suite -- depth_width --nocapture` prints the numbers of
//! the book.

use crate::common::{Uniform, touch};
use pipeline::conservative::{MovingTriangle, Rasterizer, Rect, Region, View};
use pipeline::depth::{Bounder, DepthBound};
use pipeline::setup::{SetupResult, Triangle, set_up};
use pipeline::traversal::{Box5, TileRect, narrow};
use pipeline::*;

const NEAR: f32 = 0.25;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Motion {
    /// Independent positions of each vertex at both ends: triangles turn over in front of most tiles.
    Independent,
    /// The triangle drifts and deforms slightly.
    Coherent,
    Still,
}

fn random(motion: Motion, r: &mut Uniform) -> [MovingVertex; 3] {
    let mut end = || [r.within(-40.0, 40.0), r.within(-40.0, 40.0), r.within(1.0, 8.0)];
    let (open, close) = ([(); 3].map(|()| end()), [(); 3].map(|()| end()));
    let drift = [r.within(-30.0, 30.0), r.within(-30.0, 30.0), r.within(-0.5, 0.5)];
    let place = |[x, y, w]: [f32; 3]| [x * w, y * w, w];
    [0, 1, 2].map(|k| {
        let moved =
            [0, 1, 2].map(|axis| open[k][axis] + drift[axis] + 0.05 * (close[k][axis] - open[k][axis]));
        let last = match motion {
            Motion::Independent => close[k],
            Motion::Coherent => moved,
            Motion::Still => open[k],
        };
        MovingVertex { open: place(open[k]), close: place(last) }
    })
}

/// Range of true depths over a tile and a box by dense sampling, and the number of hits.
fn truth(
    triangle: &Triangle,
    shear: &Shear,
    tile: &TileRect,
    within: &Box5,
    r: &mut Uniform,
) -> ([f64; 2], u32) {
    let (mut range, mut hits) = ([f64::INFINITY, f64::NEG_INFINITY], 0);
    for _ in 0..6000 {
        let mut pick = |[lo, hi]: [f32; 2]| f64::from(lo + (hi - lo) * r.next());
        let ([x, y], [u, v], t) =
            ([pick(tile.x), pick(tile.y)], [pick(within.u), pick(within.v)], pick(within.t));
        let [u, v] = if within.lens { [u, v] } else { [0.0; 2] };
        let seen = triangle.corners.map(|corner| {
            let p: [f64; 3] =
                std::array::from_fn(|i| f64::from(corner.open[i]) + t * f64::from(corner.delta[i]));
            let [s, a] = [shear.s, shear.a].map(|part| part.map(f64::from));
            [p[0] - u * s[0] + (u * a[0] - x) * p[2], p[1] - v * s[1] + (v * a[1] - y) * p[2], p[2]]
        });
        let e = [(1, 2), (2, 0), (0, 1)].map(|(i, j)| seen[i][0] * seen[j][1] - seen[j][0] * seen[i][1]);
        if e.iter().all(|&e| e > 0.0) || e.iter().all(|&e| e < 0.0) {
            let sum: f64 = e.iter().sum();
            let w = (0..3).map(|k| e[k] / sum * seen[k][2]).sum::<f64>();
            if w > f64::from(NEAR) {
                range = [range[0].min(w), range[1].max(w)];
                hits += 1;
            }
        }
    }
    (range, hits)
}

/// The bound without the rounding of the sample test, from the conservative mode.
fn exact(triangle: &[MovingVertex; 3], shear: &Shear, tile: &TileRect, within: &Box5) -> f64 {
    let wide = |range: [f32; 2]| range.map(f64::from);
    let ends = [triangle.map(|v| v.open.map(f64::from)), triangle.map(|v| v.close.map(f64::from))];
    let rasterizer = Rasterizer::new(View::of(shear, NEAR)).halving(0);
    let moving = MovingTriangle::new(ends[0], ends[1]).unwrap();
    let rect = Rect { x: wide(tile.x), y: wide(tile.y) };
    let region = Region { u: wide(within.u), v: wide(within.v), t: wide(within.t) };
    touch(&rasterizer, &moving, &rect, &region).map_or(0.0, |touch| touch.z[1] - touch.z[0])
}

/// Mean widths over that of the vertices in the whole shutter: the four methods, the last one without
/// rounding, the true one.
fn mean_widths(motion: Motion, lens: bool, count: u32) -> [f64; 6] {
    let mut r = Uniform::new(5);
    let viewport = Viewport::new(80, 80).unwrap();
    let shear = if lens { Shear::new([6.0, -6.0], [1.5, -1.5]) } else { Shear::default() };
    let (mut sums, mut tiles) = ([0.0; 6], 0);
    while tiles < count {
        let v = random(motion, &mut r);
        let SetupResult::Ready(triangle) =
            set_up(0, [&v[0], &v[1], &v[2]], Cull::None, &shear, NEAR, [40.0; 2])
        else {
            continue;
        };
        let tile = TileRect::new(viewport, [0, 1].map(|_| r.within(0.0, 10.0) as u32 * 8), 8);
        let Some(within) = narrow(&triangle, &shear, &tile, &Box5::whole(lens)) else { continue };
        let (true_range, hits) = truth(&triangle, &shear, &tile, &within, &mut r);
        if hits < 30 {
            continue;
        }
        let bounds = DepthBound::ALL.map(|bound| Bounder::new(&triangle, &shear, bound).over(&tile, &within));
        for [lo, hi] in bounds {
            assert!(f64::from(lo) <= true_range[0] && true_range[1] <= f64::from(hi));
        }
        let widths = bounds.map(|[lo, hi]| f64::from(hi - lo));
        let exact = exact(&v, &shear, &tile, &within);
        let all = [widths[0], widths[1], widths[2], widths[3], exact, true_range[1] - true_range[0]];
        all.iter().zip(&mut sums).for_each(|(width, sum)| *sum += width / widths[0]);
        tiles += 1;
    }
    sums.map(|sum| sum / f64::from(count))
}

#[test]
fn planes_are_tighter_than_vertices_and_not_tighter_than_the_truth() {
    for motion in [Motion::Independent, Motion::Coherent, Motion::Still] {
        for lens in [false, true] {
            let means = mean_widths(motion, lens, 1000);
            println!(
                "{motion:?}, lens {lens}: vertices 1, in time {:.3}, planes {:.3}, local planes {:.3}, these without rounding \
                 {:.3}, true {:.3}",
                means[1], means[2], means[3], means[4], means[5]
            );
            assert!(means[..4].is_sorted_by(|a, b| a >= b), "{means:?}");
            assert!(means[2] < 0.95 * means[0] && means[5] < means[4], "{means:?}");
        }
    }
}
