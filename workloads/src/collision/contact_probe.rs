//! Contact probe: a quick search for triangles that cross or share a corner at a few instants.
//! A contact that it finds is certain, and refinement is not needed. It may miss contacts.

use std::ops::RangeInclusive;

use glam::DVec3;

use super::pass::Part;
use super::{Bounds, Ends};

/// Instants to test, as shares of the window's time. Simulations are often free of crossings at both ends.
const INSTANTS: [f64; 3] = [0.5, 1.0, 0.25];
/// Most tiles across.
const MAX_TILES: u32 = 128;
/// Most tiles filled per triangle of a part at an instant.
const MAX_TILES_PER_TRIANGLE: usize = 16;
/// Pairs of triangles tested at an instant.
const TESTED_PAIRS: usize = 256;
/// Triangles per additional tested pair.
const TRIANGLES_PER_TEST: usize = 4;
/// Stride between tested triangles, so that they come from all of the part.
const STRIDE: usize = 16;

/// A triangle's bounding box at an instant.
#[derive(Clone, Copy)]
struct TriangleBox {
    triangle: u32,
    space: [[f64; 2]; 3],
}

/// Whether two triangles of the parts cross within `window`, as far as the probe finds.
pub(super) fn finds_contact(parts: [Part<'_>; 2], window: &Bounds) -> bool {
    let [first, last] = window.time;
    INSTANTS.into_iter().any(|share| cross_at(parts, window, (first + share * (last - first)).min(last)))
}

/// Whether triangles in the same tile cross at an instant.
fn cross_at(mut parts: [Part<'_>; 2], window: &Bounds, t: f64) -> bool {
    parts.sort_by_key(|part| part.list.len());
    let few = boxes_at(parts[0], window, t);
    let reach = few.iter().fold(Bounds::NOTHING.space, |all, one| hull(&all, &one.space));
    let many = boxes_at(parts[1], &Bounds { space: reach, ..*window }, t);
    let tiles = Tiles::new(&reach, &few);
    let mut remaining_tests = TESTED_PAIRS + (few.len() + many.len()) / TRIANGLES_PER_TEST;
    for one in (0..STRIDE).flat_map(|first| many.iter().skip(first).step_by(STRIDE)) {
        for place in tiles.places(&one.space) {
            for near in tiles.at(place).iter().map(|&near| &few[near as usize]) {
                if remaining_tests == 0 {
                    return false;
                }
                if touch(&one.space, &near.space) {
                    let [few, many] = parts.map(|part| &part.object.triangles);
                    if cross(&few[near.triangle as usize], &many[one.triangle as usize], t) {
                        return true;
                    }
                    remaining_tests -= 1;
                }
            }
        }
    }
    false
}

/// Triangles of a part that are in the window at an instant, up to rounding.
fn boxes_at(part: Part<'_>, window: &Bounds, t: f64) -> Vec<TriangleBox> {
    let mut found = Vec::new();
    for &triangle in part.list {
        let [open, close] = &part.object.triangles[triangle as usize];
        let mut space = Bounds::NOTHING.space;
        for (from, to) in open.iter().zip(close) {
            for axis in 0..3 {
                let at = from[axis] + t * (to[axis] - from[axis]);
                space[axis] = [space[axis][0].min(at), space[axis][1].max(at)];
            }
        }
        if touch(&space, &window.space) {
            found.push(TriangleBox { triangle, space });
        }
    }
    found
}

fn touch(a: &[[f64; 2]; 3], b: &[[f64; 2]; 3]) -> bool {
    (0..3).all(|axis| a[axis][0] <= b[axis][1] && b[axis][0] <= a[axis][1])
}

fn hull(a: &[[f64; 2]; 3], b: &[[f64; 2]; 3]) -> [[f64; 2]; 3] {
    [0, 1, 2].map(|axis| super::hull(a[axis], b[axis]))
}

/// Triangles sorted by the tiles that their boxes touch, seen along the shortest axis.
struct Tiles {
    axes: [usize; 2],
    origin: [f64; 2],
    /// Tiles per unit of length.
    scale: [f64; 2],
    across: u32,
    /// Start of each tile's triangles in `boxes`; one more entry ends the last.
    first: Vec<u32>,
    boxes: Vec<u32>,
}

impl Tiles {
    /// Sorts boxes into tiles with a counting sort.
    fn new(space: &[[f64; 2]; 3], boxes: &[TriangleBox]) -> Self {
        let axes = longest(space);
        // One triangle per tile on average.
        let across = ((boxes.len() as f64).sqrt() as u32).clamp(4, MAX_TILES);
        let origin = axes.map(|axis| space[axis][0]);
        let scale = axes.map(|axis| f64::from(across) / (space[axis][1] - space[axis][0]));
        let count = (across * across) as usize;
        let mut tiles = Self { axes, origin, scale, across, first: vec![0; count + 1], boxes: Vec::new() };
        let mut filled = Vec::new();

        for (number, one) in (0..).zip(boxes) {
            filled.extend(tiles.places(&one.space).map(|place| (place, number)));
            if filled.len() > MAX_TILES_PER_TRIANGLE * boxes.len() {
                break;
            }
        }
        filled.iter().for_each(|&(place, _)| tiles.first[place as usize + 1] += 1);
        for place in 0..count {
            tiles.first[place + 1] += tiles.first[place];
        }
        let mut next = tiles.first.clone();
        tiles.boxes = vec![0; filled.len()];
        for (place, number) in filled {
            tiles.boxes[next[place as usize] as usize] = number;
            next[place as usize] += 1;
        }
        tiles
    }

    /// Indices of the tiles that a box touches.
    fn places(&self, space: &[[f64; 2]; 3]) -> impl Iterator<Item = u32> + use<> {
        let [columns, rows] = [0, 1].map(|across| self.range(across, space[self.axes[across]]));
        let across = self.across;
        rows.flat_map(move |row| columns.clone().map(move |column| row * across + column))
    }

    fn range(&self, across: usize, [low, high]: [f64; 2]) -> RangeInclusive<u32> {
        // Values outside saturate, and NaN becomes 0.
        let tile = |at: f64| (((at - self.origin[across]) * self.scale[across]) as u32).min(self.across - 1);
        tile(low)..=tile(high)
    }

    fn at(&self, place: u32) -> &[u32] {
        let place = place as usize;
        &self.boxes[self.first[place] as usize..self.first[place + 1] as usize]
    }
}

/// The two longest axes of a box. A view across the third separates most triangles.
fn longest(space: &[[f64; 2]; 3]) -> [usize; 2] {
    let length = |axis: usize| space[axis][1] - space[axis][0];
    let shortest = (0..3).min_by(|&a, &b| length(a).total_cmp(&length(b))).unwrap_or(0);
    [(shortest + 1) % 3, (shortest + 2) % 3]
}

/// Corners of a triangle at time `t`.
fn at(ends: &Ends, t: f64) -> [DVec3; 3] {
    [0, 1, 2].map(|corner| DVec3::from(ends[0][corner]).lerp(DVec3::from(ends[1][corner]), t))
}

/// Whether an edge of one triangle passes through the other at time `t`, or both share a corner, beyond
/// rounding errors.
pub(super) fn cross(a: &Ends, b: &Ends, t: f64) -> bool {
    let (a, b) = (at(a, t), at(b, t));
    if a.iter().any(|corner| b.contains(corner)) {
        return true;
    }
    // Fast rejection: most triangles lie on one side of the other's plane.
    if !on_both_sides(&a, &b) || !on_both_sides(&b, &a) {
        return false;
    }
    let edges = |p: [DVec3; 3]| [[p[0], p[1]], [p[1], p[2]], [p[2], p[0]]];
    edges(a).iter().any(|edge| pierces(edge, &b)) || edges(b).iter().any(|edge| pierces(edge, &a))
}

/// Whether `points` lie on both sides of a triangle's plane, as computed.
fn on_both_sides([a, b, c]: &[DVec3; 3], points: &[DVec3; 3]) -> bool {
    let normal = (b - a).cross(c - a);
    let sides = points.map(|point| normal.dot(point - a));
    sides.iter().any(|&side| side > 0.0) && sides.iter().any(|&side| side < 0.0)
}

/// Whether a segment passes through a triangle by more than the rounding errors.
fn pierces(segment: &[DVec3; 2], triangle: &[DVec3; 3]) -> bool {
    let volume = |d: DVec3, e: DVec3, f: DVec3| d.cross(e).dot(f);
    // Fast rejection without error bounds. Few candidates need the second, exact test.
    passes(segment, triangle, volume) && {
        let [p, q] = segment;
        let corners = [p, q].into_iter().chain(triangle);
        let size = corners.fold(0.0, |size: f64, p| size.max(p.abs().max_element()));
        // Rounding error of an interpolated corner, and of the difference of two.
        let rounding = 8.0 * f64::EPSILON * size;
        passes(segment, triangle, |d, e, f| {
            let computed = volume(d, e, f);
            let [d, e, f] = [d, e, f].map(|side| side.abs().element_sum());
            let margin = rounding * (d * e + e * f + f * d) + 8.0 * f64::EPSILON * d * e * f;
            if computed.abs() > 2.0 * margin { computed } else { 0.0 }
        })
    }
}

/// Whether the segment's ends lie on both sides of the plane, and the triangle around the segment, by signed
/// volumes.
fn passes(
    &[p, q]: &[DVec3; 2],
    &[a, b, c]: &[DVec3; 3],
    volume: impl Fn(DVec3, DVec3, DVec3) -> f64,
) -> bool {
    let side = |point: DVec3| volume(b - a, c - a, point - a);
    let (one, other) = (side(p), side(q));
    if !(one > 0.0 && other < 0.0 || one < 0.0 && other > 0.0) {
        return false;
    }
    let around = [(a, b), (b, c), (c, a)].map(|(d, e)| volume(q - p, d - p, e - p));
    around.iter().all(|&turn| turn > 0.0) || around.iter().all(|&turn| turn < 0.0)
}

#[cfg(test)]
mod tests {
    use glam::DQuat;

    use super::*;

    #[test]
    fn triangles_cross_only_while_one_passes_through_the_other() {
        let floor = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]];
        let blade = |z: f64| [[0.0, 0.0, z], [0.1, 0.0, z + 0.5], [-0.1, 0.0, z + 0.5]];
        let (still, falling) = ([floor; 2], [blade(1.0), blade(-1.0)]);
        assert!(
            !cross(&still, &falling, 0.25) && cross(&still, &falling, 0.6) && !cross(&still, &falling, 0.9)
        );
        assert!(cross(&falling, &still, 0.6));
    }

    #[test]
    fn touching_and_coplanar_triangles_do_not_cross() {
        let turn = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), 0.7);
        let wall = |x: f64| [[0.5, x, 0.0], [0.5, x + 1.0, 0.2], [0.5, x, 1.0]];
        let posed = |ends: [[f64; 3]; 3]| ends.map(|p| (turn * DVec3::from(p)).to_array());
        for n in 1..100 {
            let x = f64::from(n) * 0.01;
            let (one, other) = ([posed(wall(0.0)); 2], [posed(wall(x - 0.5)), posed(wall(x + 0.5))]);
            assert!(!cross(&one, &other, 0.5), "{x}");
        }
    }

    #[test]
    fn a_shared_corner_is_a_contact_at_its_instant() {
        let one = [[0.25, 0.5, 0.75], [1.25, 0.5, 0.75], [0.25, 1.5, 0.75]];
        let other = |y: f64| [[-0.75, y, 0.5], [0.25, y, 0.75], [-0.75, y, 1.0]];
        let passing = [other(1.5), other(-0.5)];
        assert!(cross(&[one; 2], &passing, 0.5) && !cross(&[one; 2], &passing, 0.25));
        assert!(cross(&[one; 2], &[one; 2], 0.3), "in one plane, too");
    }
}
