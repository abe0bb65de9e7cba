//! Sample test compared with an evaluation that does not round to f32.
//!
//! The ideal vertex is `p = q + t (r - q)` and the ideal point seen from a sample `x' = (p.x - u s) - (X - u
//! a) p.w`, likewise in y, of the f32 inputs. They are evaluated in f64, whose own error is about 2^-29 of
//! the bands below. The sample test rounds each operation to f32, once, by at most `g = 2^-24` of its result.
//! Counted one by one, its points may be off on each axis by the **band**
//!
//! ```text
//! off p  = g (2 |t (r - q)| + |p|)        where the vertex moves on that axis, else 0; the same for p.x and p.w
//! slope  = X - u a                        off by g (|u a| + |slope|) where there is a lens, else 0
//! band_x = off p.x + g (|u s| + |p.x - u s|)  where there is a lens
//!        + |slope| off p.w + |p.w| off slope + g |slope p.w| + g |x'|
//! ```
//!
//! In an orthographic view the ideal is `x' = p.x - (X + u s) + u a p.w`, and
//!
//! ```text
//! base   = X + u s                        off by g (|u s| + |base|) where there is a lens, else 0
//! band_x = off p.x + off base + g |p.x - base| + |u a| off p.w
//!        + g (2 |u a p.w| + |x'|)         where there is a lens
//! ```
//!
//! and an edge `x_i' y_j' - x_j' y_i'` by
//!
//! ```text
//! band_ij = |x_i| band_yj + |y_j| band_xi + |x_j| band_yi + |y_i| band_xj + band_xi band_yj + band_xj band_yi
//! ```
//!
//! A simpler bound of `band_x` for a whole triangle is 2^-21 (max |x| + |s| + (|X| + |a|) max |w|). The test
//! is exact for the rounded points, so every disagreement must have an edge, or the near depth, within its
//! band.

use crate::common::case::*;
use crate::common::*;
use pipeline::sampling::Sample;
use pipeline::*;
use proptest::prelude::*;

/// One rounding of f32; the last factor covers second-order terms.
const ROUNDING: f64 = (1.0 + 1e-6) / 16_777_216.0;

/// A vertex as a sample sees it, and its f32 error bound on each axis.
#[derive(Clone, Copy, Debug)]
struct Point {
    p: [f64; 3],
    band: [f64; 2],
    /// Error bound of its depth.
    band_w: f64,
}

fn ideal(vertex: &MovingVertex, shear: &Shear, position: &SamplePosition) -> Point {
    let [x, y, w] = position.sheared(vertex, shear);
    let off = |axis: usize| {
        let [q, r] = [vertex.open[axis], vertex.close[axis]].map(f64::from);
        let way = position.t * (r - q);
        if q == r { 0.0 } else { ROUNDING * (2.0 * way.abs() + (q + way).abs()) }
    };
    let band = |axis: usize, sheared: f64, at: f64, lens: f64| {
        let (s, a) = (lens * f64::from(shear.s[axis]), lens * f64::from(shear.a[axis]));
        let lens = |error: f64| if shear.is_none() { 0.0 } else { ROUNDING * error };
        if shear.parallel {
            let (base, slope) = (at + s, a.abs());
            return off(axis)
                + lens(s.abs() + base.abs())
                + ROUNDING * (sheared - a * w - at).abs()
                + slope * off(2)
                + lens(slope * w.abs() + slope * w.abs() + (sheared - at).abs());
        }
        let slope = at - a;
        let (off_slope, less) = (lens(a.abs() + slope.abs()), sheared - a * w);
        off(axis)
            + lens(s.abs() + less.abs())
            + slope.abs() * off(2)
            + w.abs() * off_slope
            + ROUNDING * ((slope * w).abs() + (sheared - at * w).abs())
    };
    Point {
        p: [x - position.x * weight(shear, w), y - position.y * weight(shear, w), w],
        band: [band(0, x, position.x, position.u), band(1, y, position.y, position.v)],
        band_w: off(2),
    }
}

/// An edge function and its band.
#[derive(Clone, Copy, Debug)]
struct Edge {
    value: f64,
    band: f64,
    /// Rounding of its own products, which affects the depth but not the decision.
    own: f64,
}

fn edge(i: &Point, j: &Point) -> Edge {
    let ([xi, yi, _], [xj, yj, _]) = (i.p, j.p);
    let ([bxi, byi], [bxj, byj]) = (i.band, j.band);
    let band = xi.abs() * byj + yj.abs() * bxi + xj.abs() * byi + yi.abs() * bxj + bxi * byj + bxj * byi;
    let own = 2.0 * ROUNDING * ((xi * yj).abs() + (xj * yi).abs());
    Edge { value: xi * yj - xj * yi, band, own }
}

/// Ideal result of one sample and triangle.
struct Verdict {
    inside: bool,
    /// Smallest ratio of an edge to its band for which the decision flips.
    to_turn: f64,
    depth: f64,
    /// Error bound of a depth in f32; infinite if the edges are within their bands.
    depth_band: f64,
}

fn evaluate(points: &[Point; 3]) -> Verdict {
    let edges = [(1, 2), (2, 0), (0, 1)].map(|(i, j)| edge(&points[i], &points[j]));
    let same = |sign: f64| edges.iter().all(|e| e.value * sign > 0.0);
    let inside = same(1.0) || same(-1.0);
    let ratio = |e: &Edge| e.value.abs() / e.band;
    let against = |sign: f64| edges.iter().filter(|e| e.value * sign <= 0.0).map(ratio).fold(0.0, f64::max);
    let to_turn = if inside {
        edges.iter().map(ratio).fold(f64::INFINITY, f64::min)
    } else {
        against(1.0).min(against(-1.0))
    };
    let sum: f64 = edges.iter().map(|e| e.value).sum();
    let depth = edges.iter().zip(points).map(|(e, p)| e.value * p.p[2]).sum::<f64>() / sum;
    let off: f64 = edges.iter().map(|e| e.band + e.own).sum();
    let spread: f64 = edges.iter().zip(points).map(|(e, p)| (e.band + e.own) * (p.p[2] - depth).abs()).sum();
    let carried = edges.iter().zip(points).map(|(e, p)| (e.value * p.p[2]).abs()).sum::<f64>() / sum.abs();
    let band_w = points.iter().map(|p| p.band_w).fold(0.0, f64::max);
    let depth_band = if off < 0.5 * sum.abs() {
        spread / (sum.abs() - off) + band_w + 6.0 * ROUNDING * carried
    } else {
        f64::INFINITY
    };
    Verdict { inside, to_turn, depth, depth_band }
}

/// Results over many samples.
#[derive(Clone, Copy, Debug, Default)]
struct Tally {
    samples: u32,
    hits: u32,
    disagreements: u32,
    depths: u32,
    /// Largest fraction of the band used by a disagreement.
    worst: f64,
    /// Largest fraction of its band used by a depth error.
    worst_depth: f64,
}

impl Tally {
    fn add(&mut self, other: &Self) {
        self.samples += other.samples;
        self.hits += other.hits;
        self.disagreements += other.disagreements;
        self.depths += other.depths;
        self.worst = self.worst.max(other.worst);
        self.worst_depth = self.worst_depth.max(other.worst_depth);
    }
}

fn compare(case: Case, seed: u64) -> Tally {
    let Setting { triangle, probe } = setting(case, seed);
    let near = f64::from(NEAR) * libm::exp2(f64::from(case.scale));
    let seen = probe.see(triangle, Cull::None);
    let mut tally = Tally::default();
    for (slot, seen) in seen.into_iter().enumerate() {
        let position = probe.at(slot);
        let verdict = evaluate(&triangle.map(|vertex| ideal(&vertex, &probe.shear, &position)));
        tally.samples += 1;
        tally.hits += u32::from(seen.is_some());
        if seen.is_some() != (verdict.inside && verdict.depth > near) {
            tally.disagreements += 1;
            let by_depth = (verdict.depth - near).abs() / verdict.depth_band;
            let share = if seen.is_some() == verdict.inside { 0.0 } else { verdict.to_turn };
            let share = if verdict.inside && by_depth.is_finite() { share.min(by_depth) } else { share };
            tally.worst = tally.worst.max(share);
        }
        if let Some(depth) = seen
            && verdict.inside
            && verdict.depth_band.is_finite()
        {
            tally.depths += 1;
            tally.worst_depth =
                tally.worst_depth.max((f64::from(depth) - verdict.depth).abs() / verdict.depth_band);
        }
    }
    tally
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 256, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn every_disagreement_lies_within_the_band(case in cases(), seed: u64) {
        let tally = compare(case, seed);
        prop_assert!(tally.worst <= 1.0, "{tally:?}");
        prop_assert!(tally.worst_depth <= 1.0, "{tally:?}");
    }
}

/// The same over fixed cases, to check that the relevant cases occur; `--nocapture` prints the results.
#[test]
fn the_band_is_measured() {
    let mut all = Tally::default();
    for seed in 0..1200_u64 {
        let bit = |k: u32| seed >> k & 1 == 1;
        let (moving, lens, behind, far, parallel) = (bit(0), bit(1), bit(2), bit(3), bit(4));
        let (sliver, scale) = (seed % 5 == 0, (seed % 7) as i32 - 3);
        let case = Case { moving, lens, parallel, behind, far, sliver, scale };
        all.add(&compare(case, seed));
    }
    println!("{all:#?}");
    assert!(all.hits > 20_000 && all.depths > 20_000, "{all:?}");
    assert!(all.disagreements > 2_000, "too few samples on edges to say anything: {all:?}");
    assert!(all.worst <= 1.0 && all.worst_depth <= 1.0, "{all:?}");
    // The band is used.
    assert!(all.worst > 0.25, "{all:?}");
}

/// Exact arithmetic gives no disagreement: small integers, dyadic times and lens positions.
#[test]
fn exact_arithmetic_gives_no_disagreement() {
    let mut r = Uniform::new(5);
    let (mut hits, mut ties) = (0, 0);
    for _ in 0..300 {
        let mut int = |lo: f32, hi: f32| r.within(lo, hi).round();
        let block: Vec<_> = (0..128)
            .map(|_| Sample {
                x: int(0.0, 3.0) / 4.0,
                y: int(0.0, 3.0) / 4.0,
                u: int(-2.0, 2.0) / 2.0,
                v: int(-2.0, 2.0) / 2.0,
                t: int(0.0, 3.0) / 4.0,
            })
            .collect();
        let mut vertex = || [int(-24.0, 24.0), int(-24.0, 24.0), int(-2.0, 6.0)];
        let triangle = [(); 3].map(|()| MovingVertex { open: vertex(), close: vertex() });
        let shear = Shear::new([int(-8.0, 8.0), int(-8.0, 8.0)], [int(-2.0, 2.0), int(-2.0, 2.0)]);
        let shear = Shear { parallel: int(0.0, 1.0) == 1.0, ..shear };
        let probe = Probe::new(&repeated(2, &block), Viewport::new(8, 8).unwrap(), shear, [0, 0], 0.25);
        for (slot, seen) in probe.see(triangle, Cull::None).into_iter().enumerate() {
            let points = triangle.map(|vertex| ideal(&vertex, &probe.shear, &probe.at(slot)));
            let p = points.map(|point| point.p);
            let e =
                [(1, 2), (2, 0), (0, 1)].map(|(i, j): (usize, usize)| p[i][0] * p[j][1] - p[j][0] * p[i][1]);
            if e.contains(&0.0) {
                ties += 1;
                continue;
            }
            let verdict = evaluate(&points);
            assert_eq!(
                seen.is_some(),
                verdict.inside && verdict.depth > 0.25,
                "{triangle:?} {:?}",
                probe.at(slot)
            );
            if let Some(depth) = seen {
                assert!(
                    (f64::from(depth) / verdict.depth - 1.0).abs() < 1e-5,
                    "{depth} for {}",
                    verdict.depth
                );
                hits += 1;
            }
        }
    }
    assert!(hits > 1000 && ties > 30, "{hits} hits, {ties} ties");
}
