//! Conservative mode against integers: whether a triangle touches a tile at a time and from a lens position
//! is decided exactly, where its numbers have few bits. Every touch has to be reported in both precisions,
//! those of a single point included.

use std::collections::HashMap;

use pipeline::conservative::{Grid, MovingTriangle, Rasterizer, Touch, View};
use pipeline::random::SplitMix;

/// Coordinates are multiples of 1 / 256, times of 1 / 16, lens positions of 1 / 8, tiles and `a` of 1 / 4.
const UNIT: i128 = 256;
const TIMES: i128 = 16;

struct Integers(SplitMix);

impl Integers {
    fn within(&mut self, lo: i128, hi: i128) -> i128 {
        lo + i128::from(self.0.next_word() >> 1) % (hi - lo + 1)
    }
}

/// A triangle and a view in units.
#[derive(Debug)]
struct Case {
    ends: [[[i128; 3]; 3]; 2],
    s: [i128; 2],
    /// In quarters.
    a: [i128; 2],
    perspective: bool,
    /// The first tile's corner, in tiles of a quarter.
    origin: [i128; 2],
}

const TILES: i128 = 12;

impl Case {
    fn new(seed: u64) -> Self {
        let mut r = Integers(SplitMix::new(seed));
        let [perspective, lens, moving, far, thin] = [0; 5].map(|_| r.within(0, 1) == 1);
        let [s, a] = if lens { [0; 2].map(|_| [0; 2].map(|_| r.within(-8, 8))) } else { [[0; 2]; 2] };
        let s = s.map(|s| s * 16);
        let origin = [0; 2].map(|_| if far { r.within(-1 << 22, 1 << 22) } else { r.within(-8, 0) });
        let aligned = r.within(0, 2) == 0;
        let mut point = || {
            let z = if aligned { UNIT << r.within(0, 2) } else { r.within(UNIT / 2, 4 * UNIT) };
            let [x, y] = [0, 1].map(|axis| {
                // In units; aligned ones are on borders.
                let quarter = UNIT / 4;
                let at = r.within(-quarter, (TILES + 1) * quarter);
                let at = origin[axis] * quarter + if aligned { at / quarter * quarter } else { at };
                if perspective { at * z / UNIT } else { at }
            });
            [x, y, z]
        };
        let mut end = || {
            let mut p = [point(), point(), point()];
            match (thin, seed % 3) {
                (true, 0) => p = [p[0]; 3],
                (true, 1) => p[2] = p[1],
                (true, _) => p[2] = [0, 1, 2].map(|axis| (p[0][axis] + p[1][axis]) / 2),
                _ => {}
            }
            p
        };
        let open = end();
        Self { ends: [open, if moving { end() } else { open }], s, a, perspective, origin }
    }

    fn triangle(&self) -> MovingTriangle {
        let [open, close] = self.ends.map(|end| end.map(|p| p.map(|c| c as f64 / UNIT as f64)));
        MovingTriangle::new(open, close).unwrap()
    }

    fn view(&self) -> View {
        let (s, a) = (self.s.map(|s| s as f64 / UNIT as f64), self.a.map(|a| a as f64 / 4.0));
        if self.perspective {
            View::Perspective { s, a, near: 0.25 }
        } else {
            View::Orthographic { s, a, near: f64::NEG_INFINITY }
        }
    }

    fn grid(&self) -> Grid {
        let origin = self.origin.map(|at| at as f64 / 4.0);
        Grid { origin, tile: [0.25; 2], columns: TILES as u32, rows: TILES as u32 }
    }

    /// Homogeneous vertices at time `t / 16` from the lens position `lens / 8`, four times those of the image.
    fn seen(&self, t: i128, lens: [i128; 2]) -> [[i128; 3]; 3] {
        [0, 1, 2].map(|k| {
            let p = [0, 1, 2].map(|axis| {
                let [open, close] = [0, 1].map(|end| self.ends[end][k][axis]);
                TIMES * open + t * (close - open)
            });
            let w = if self.perspective { p[2] } else { TIMES * UNIT };
            let at = |axis: usize| {
                let shift = self.a[axis] * p[2] - 4 * TIMES * self.s[axis];
                4 * (32 * p[axis] + lens[axis] * shift)
            };
            [at(0), at(1), 32 * w]
        })
    }

    /// Whether the closed triangle and a tile have a point in common: no line along a side of either is between them.
    fn touches(&self, seen: &[[i128; 3]; 3], tile: [i128; 2]) -> bool {
        let ranges = [0, 1].map(|axis| [self.origin[axis] + tile[axis], self.origin[axis] + tile[axis] + 1]);
        for axis in [0, 1] {
            let beyond = |side: i128, sign: i128| seen.iter().all(|p| sign * (p[axis] - side * p[2]) > 0);
            if beyond(ranges[axis][0], -1) || beyond(ranges[axis][1], 1) {
                return false;
            }
        }
        let edge = |i: usize, j: usize, [x, y]: [i128; 2]| {
            let [p, q] = [seen[i], seen[j]].map(|p| [p[0] - x * p[2], p[1] - y * p[2]]);
            p[0] * q[1] - p[1] * q[0]
        };
        let corners = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(i, j)| [ranges[0][i], ranges[1][j]]);
        let signs = [(1, 2), (2, 0), (0, 1)].map(|(i, j)| corners.map(|corner| edge(i, j, corner).signum()));
        // The weights of all vertices at a corner add up to the area, whose sign is that of the inside.
        let area = [(1, 2), (2, 0), (0, 1)]
            .iter()
            .zip([0, 1, 2])
            .fold(0, |sum, (&(i, j), k)| sum + edge(i, j, corners[0]) * seen[k][2]);
        let inside = area.signum();
        !signs.iter().any(|edge| {
            let outside = |sign: i128| edge.iter().all(|&at| at == sign);
            if inside == 0 { outside(1) || outside(-1) } else { outside(-inside) }
        })
    }
}

/// The tile of every touch is reported, and its time and lens position are in the intervals.
#[test]
fn every_touch_that_integers_show_is_reported() {
    let (mut touches, mut corners, mut reported_tiles, mut touched_tiles) = (0_u64, 0_u64, 0, 0);
    for seed in 0..6000 {
        let case = Case::new(seed);
        let rasterizer = Rasterizer::new(case.view()).halving((seed / 2 % 3) as u32);
        let rasterizer = if seed % 2 == 0 { rasterizer } else { rasterizer.in_doubles() };
        let mut reported: HashMap<[u32; 2], Touch> = HashMap::new();
        rasterizer.rasterize(&case.triangle(), &case.grid(), |tile, touch| {
            reported.insert(tile, *touch);
        });
        let mut r = Integers(SplitMix::new(seed + 77));
        let mut touched = std::collections::HashSet::new();
        for t in 0..=TIMES {
            let lens = [0; 2].map(|_| r.within(-8, 8));
            let seen = case.seen(t, lens);
            for tile in (0..TILES * TILES).map(|n| [n % TILES, n / TILES]) {
                if !case.touches(&seen, tile) {
                    continue;
                }
                touches += 1;
                corners += u64::from(seen.iter().any(|p| (0..2).all(|axis| p[axis] % p[2] == 0)));
                let key = tile.map(|at| at as u32);
                touched.insert(key);
                let at = t as f64 / TIMES as f64;
                let touch = reported
                    .get(&key)
                    .unwrap_or_else(|| panic!("{seed}: {tile:?} at {at} {lens:?} of {case:?}"));
                let holds = |[lo, hi]: [f64; 2], value: f64| lo <= value && value <= hi;
                let lens = lens.map(|at| at as f64 / 8.0);
                assert!(holds(touch.t, at), "{seed}: {at} {touch:?}");
                let view = case.view();
                assert!(
                    !view.has_lens() || holds(touch.u, lens[0]) && holds(touch.v, lens[1]),
                    "{lens:?} {touch:?}"
                );
            }
        }
        reported_tiles += reported.len();
        touched_tiles += touched.len();
    }
    println!(
        "{touches} touches, {corners} with a vertex on a corner of tiles, {touched_tiles} tiles, {reported_tiles} reported"
    );
    assert!(touches > 600_000 && corners > 20_000, "{touches} {corners}");
}
