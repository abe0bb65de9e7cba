//! Conservative mode on triangles whose tiles, times and depths are known.

use std::collections::HashSet;

use crate::common::touch;
use pipeline::conservative::{Grid, MovingTriangle, Rasterizer, Rect, Region, Touch, View};

const GRID: Grid = Grid { origin: [-8.0, -8.0], tile: [1.0; 2], columns: 16, rows: 16 };

fn all(rasterizer: &Rasterizer, triangle: &MovingTriangle, grid: &Grid) -> Vec<([u32; 2], Touch)> {
    let mut tiles = Vec::new();
    rasterizer.rasterize(triangle, grid, |tile, touch| tiles.push((tile, *touch)));
    tiles
}

fn still(points: [[f64; 3]; 3]) -> MovingTriangle {
    MovingTriangle::new(points, points).unwrap()
}

/// A point on the corner of four tiles touches all of them; a segment along a border touches both rows.
#[test]
fn touching_counts() {
    let rasterizer = Rasterizer::new(View::orthographic());
    let tiles = |points| {
        all(&rasterizer, &still(points), &GRID).into_iter().map(|(tile, _)| tile).collect::<HashSet<_>>()
    };
    assert_eq!(tiles([[3.0, -2.0, 5.0]; 3]), HashSet::from([[10, 5], [11, 5], [10, 6], [11, 6]]));
    let segment = [[0.5, 0.0, 1.0], [1.5, 0.0, 1.0], [1.25, 0.0, 1.0]];
    assert_eq!(tiles(segment), HashSet::from([[8, 7], [9, 7], [8, 8], [9, 8]]));
    assert_eq!(tiles([[0.5, 0.5, 1.0]; 3]), HashSet::from([[8, 8]]));
}

/// A square that moves from left to right at one tile per quarter of the shutter, at depth 1 + t.
#[test]
fn times_and_depths_are_those_of_the_passing() {
    let open = [[-8.0, -8.0, 1.0], [-7.5, -8.0, 1.0], [-8.0, -7.5, 1.0]];
    let close = open.map(|[x, y, _]| [x + 4.0, y, 2.0]);
    let triangle = MovingTriangle::new(open, close).unwrap();
    let touched = all(&Rasterizer::new(View::orthographic()), &triangle, &GRID);
    assert_eq!(touched.len(), 5);
    for (tile, touch) in touched {
        let enters = (f64::from(tile[0]) - 0.5).max(0.0) / 4.0;
        let leaves = (f64::from(tile[0]) + 1.0).min(4.0) / 4.0;
        // Widened by 2^-20 of what makes up a distance: 8 of the tiles, 8 and 4 of a vertex and its motion,
        // which takes that much longer at a speed of 4.
        let off = (8.0 + 12.0) / 4.0 / f64::from(1 << 20);
        let holds = |found: [f64; 2], exact: [f64; 2]| {
            found[0] <= exact[0]
                && exact[1] <= found[1]
                && exact[0] - found[0] + (found[1] - exact[1]) <= 2.0 * off
        };
        assert!(holds(touch.t, [enters, leaves]), "{tile:?} {touch:?}");
        assert!(holds(touch.z, [1.0 + enters, 1.0 + leaves]), "{tile:?} {touch:?}");
    }
}

/// A gap of 2^-30 of the tiles is below the precision of `f32`, one of 2^-19 is not.
#[test]
fn only_doubles_separate_a_gap_of_a_billionth() {
    let touched = |gap: f64, rasterizer: Rasterizer| {
        let triangle = still([[0.5, 0.5, 1.0], [1.0 - gap, 0.5, 1.0], [0.5, 0.75, 1.0]]);
        all(&rasterizer, &triangle, &GRID).len()
    };
    let (single, double) =
        (Rasterizer::new(View::orthographic()), Rasterizer::new(View::orthographic()).in_doubles());
    let gaps = [16.0 / f64::from(1 << 30), 16.0 / f64::from(1 << 19)];
    assert_eq!(gaps.map(|gap| touched(gap, single)), [2, 1]);
    assert_eq!(gaps.map(|gap| touched(gap, double)), [1, 1]);
}

/// Whatever the depth and the distance, a triangle at one depth is there within the rounding of its depth to
/// `f64`, and that of 2^-900 to `f32`.
#[test]
fn a_triangle_at_one_depth_stays_there() {
    for z in [0.0, 1.0, 1e-30, -3.1e7, 1e40] {
        let flat = still([[0.25, 0.25, z], [3.5, 0.25, z], [0.25, 3.5, z]]);
        let touched = all(&Rasterizer::new(View::orthographic()), &flat, &GRID);
        assert!(touched.len() > 6);
        for (_, Touch { z: [lo, hi], .. }) in touched {
            assert!(lo <= z && z <= hi && hi - lo <= 1e-13 * z.abs() + 2_f64.powi(-920), "{lo} {z} {hi}");
        }
    }
}

fn pinhole(near: f64) -> View {
    View::Perspective { s: [0.0; 2], a: [0.0; 2], near }
}

#[test]
fn points_nearer_than_the_near_depth_are_invisible() {
    let behind = still([[0.0, 0.0, -1.0], [1.0, 0.0, -2.0], [0.0, 1.0, 0.125]]);
    assert!(all(&Rasterizer::new(pinhole(0.25)), &behind, &GRID).is_empty());
    assert!(!all(&Rasterizer::new(pinhole(0.0)), &behind, &GRID).is_empty());
}

#[test]
fn a_triangle_that_may_be_off_is_reported_as_far_as_it_may_be() {
    let points = [[0.25, 0.25, 3.0], [0.75, 0.25, 3.0], [0.25, 0.75, 3.0]];
    let unsure = MovingTriangle::uncertain(points, points, [0.5, 0.125, 1.0]).unwrap();
    let touched = all(&Rasterizer::new(View::orthographic()), &unsure, &GRID);
    let tiles: HashSet<_> = touched.iter().map(|(tile, _)| *tile).collect();
    assert!(tiles.is_superset(&HashSet::from([[7, 8], [8, 8], [9, 8]])), "{tiles:?}");
    assert!(touched.iter().all(|(_, touch)| touch.z[0] <= 2.0 && touch.z[1] >= 4.0));
}

/// With an uncertainty on one axis only, the triangle may be shifted along it, including its slanted edge.
#[test]
fn a_slanted_edge_is_widened_by_the_uncertainty_of_each_axis() {
    let points = [[0.25, 0.25, 3.0], [3.5, 0.25, 3.0], [0.25, 3.5, 3.0]];
    let tiles = |triangle: &MovingTriangle| -> HashSet<_> {
        all(&Rasterizer::new(View::orthographic()), triangle, &GRID)
            .into_iter()
            .map(|(tile, _)| tile)
            .collect()
    };
    for axis in [0, 1] {
        let (mut off, mut moved) = ([0.0; 3], points);
        off[axis] = 0.5;
        moved.iter_mut().for_each(|corner| corner[axis] += 0.5);
        let unsure = tiles(&MovingTriangle::uncertain(points, points, off).unwrap());
        let (sure, moved) = (tiles(&still(points)), tiles(&still(moved)));
        assert!(!moved.is_subset(&sure) && moved.is_subset(&unsure), "{axis}: {moved:?} {unsure:?}");
    }
}

/// Seen from the middle of the tile all corners are low, but from its top those far behind are far away. The
/// near corner may reach the tile, and then the edges to it change.
#[test]
fn an_edge_may_be_off_by_more_at_the_border_of_a_tile_than_in_its_middle() {
    let points = [[2000.0, 1.0, 1000.0], [2000.0, -1.0, 1000.0], [1.875, 0.875, 1.0]];
    let mut moved = points;
    moved[2][0] -= 1.0;
    let rasterizer = Rasterizer::new(pinhole(0.25));
    let tile = Rect { x: [-1.0, 1.0], y: [-1.0, 1.0] };
    let turned = |points: [[f64; 3]; 3]| points.map(|[x, y, w]| [y, x, w]);
    for (points, moved, off) in
        [(points, moved, [1.0, 0.0, 0.0]), (turned(points), turned(moved), [0.0, 1.0, 0.0])]
    {
        let unsure = MovingTriangle::uncertain(points, points, off).unwrap();
        let touches =
            |triangle: &MovingTriangle| touch(&rasterizer, triangle, &tile, &Region::WHOLE).is_some();
        assert!(touches(&still(moved)) && touches(&unsure) && !touches(&still(points)));
    }
}

#[test]
fn numbers_that_would_overflow_are_refused() {
    for bad in [f64::NAN, f64::INFINITY, 1e61] {
        assert!(MovingTriangle::new([[0.0, 0.0, bad]; 3], [[0.0; 3]; 3]).is_none());
        assert!(MovingTriangle::uncertain([[0.0; 3]; 3], [[0.0; 3]; 3], [bad; 3]).is_none());
    }
    let large = still([[1e60, -1e60, 1e60], [-1e60, 1e60, 1e60], [1e60, 1e60, -1e60]]);
    let lens = View::Perspective { s: [1e3; 2], a: [1e3; 2], near: 0.0 };
    assert!(!all(&Rasterizer::new(lens), &large, &GRID).is_empty());
}

/// A triangle of integers that contains an integer point, on axes whose units have products that underflow.
#[test]
fn products_that_vanish_miss_nothing() {
    let corners = [[-7_i32, 5, 3], [9, 2, -6], [1, -11, 9]];
    let weights = [2, 1, 1];
    let at = |axis: usize| (0..3).map(|k| weights[k] * corners[k][axis]).sum::<i32>();
    for exponents in (0..40_i32.pow(3)).map(|n| [n % 40, n / 40 % 40, n / 1600].map(|step| -26 * step)) {
        let units = exponents.map(|e| 2_f64.powi(e / 2) * 2_f64.powi(e - e / 2));
        let scaled = |p: [i32; 3]| [0, 1, 2].map(|axis| f64::from(4 * p[axis]) * units[axis]);
        let point = [0, 1, 2].map(|axis| f64::from(at(axis)) * units[axis]);
        let rasterizer = Rasterizer::new(View::orthographic());
        let triangle = still(corners.map(scaled));
        for reach in [0.0, 1.0, 7.0] {
            let side = |axis: usize| [point[axis] - reach * units[axis], point[axis] + reach * units[axis]];
            let tile = Rect { x: side(0), y: side(1) };
            let touch = touch(&rasterizer, &triangle, &tile, &Region::WHOLE);
            let z = touch.unwrap_or_else(|| panic!("units of {units:?} are missed")).z;
            assert!(z[0] <= point[2] && point[2] <= z[1], "{z:?} in units of {units:?}");
        }
    }
}
