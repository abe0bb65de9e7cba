//! A glance at a pair at a few instants: does anything cross, or share a corner? Never trusted to say no; where it says yes, nothing
//! closer is needed.

use std::ops::RangeInclusive;

use super::bounds::Bounds;
use super::crossing::cross;
use super::pass::Part;

/// Instants looked at, in parts of the window's time. What is simulated is often free of crossings at both ends.
const INSTANTS: [f64; 3] = [0.5, 1.0, 0.25];
/// Tiles across, at most.
const FINEST: u32 = 128;
/// Tiles filled with a part in an instant, for each of its triangles, before it is let be.
const TILES_EACH: usize = 16;
/// Pairs of triangles tried in an instant, and one more for each so many triangles.
const MOST_TRIED: usize = 256;
const TRIANGLES_A_TRY: usize = 4;
/// Triangles are tried this far apart, so that those tried are from everywhere.
const STRIDE: usize = 16;

/// A triangle at an instant, in its box.
#[derive(Clone, Copy)]
struct Here {
    triangle: u32,
    space: [[f64; 2]; 3],
}

/// Whether two triangles of the parts are seen to cross within `window`.
pub(super) fn crosses(parts: [Part<'_>; 2], window: &Bounds) -> bool {
    let [first, last] = window.time;
    INSTANTS.into_iter().any(|share| cross_at(parts, window, (first + share * (last - first)).min(last)))
}

/// Whether triangles in the same tile are seen to cross at an instant.
fn cross_at(mut parts: [Part<'_>; 2], window: &Bounds, t: f64) -> bool {
    parts.sort_by_key(|part| part.list.len());
    let few = here(parts[0], window, t);
    let reach = few.iter().fold(Bounds::NOTHING.space, |all, one| hull(&all, &one.space));
    let many = here(parts[1], &Bounds { space: reach, ..*window }, t);
    let tiles = Tiles::new(&reach, &few);
    let mut left = MOST_TRIED + (few.len() + many.len()) / TRIANGLES_A_TRY;
    for one in (0..STRIDE).flat_map(|first| many.iter().skip(first).step_by(STRIDE)) {
        for place in tiles.places(&one.space) {
            for near in tiles.at(place).iter().map(|&near| &few[near as usize]) {
                if left == 0 {
                    return false;
                }
                if touch(&one.space, &near.space) {
                    let [few, many] = parts.map(|part| &part.object.triangles);
                    if cross(&few[near.triangle as usize], &many[one.triangle as usize], t) {
                        return true;
                    }
                    left -= 1;
                }
            }
        }
    }
    false
}

/// The triangles of a part that are in the window at an instant, as far as rounding can tell.
fn here(part: Part<'_>, window: &Bounds, t: f64) -> Vec<Here> {
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
            found.push(Here { triangle, space });
        }
    }
    found
}

fn touch(a: &[[f64; 2]; 3], b: &[[f64; 2]; 3]) -> bool {
    (0..3).all(|axis| a[axis][0] <= b[axis][1] && b[axis][0] <= a[axis][1])
}

fn hull(a: &[[f64; 2]; 3], b: &[[f64; 2]; 3]) -> [[f64; 2]; 3] {
    [0, 1, 2].map(|axis| super::bounds::hull(a[axis], b[axis]))
}

/// Triangles by the tiles that their boxes touch, seen along the axis that is shortest.
struct Tiles {
    axes: [usize; 2],
    origin: [f64; 2],
    /// Tiles in a unit of length.
    scale: [f64; 2],
    across: u32,
    /// Where the triangles of each tile begin in `here`, and of one tile more.
    first: Vec<u32>,
    here: Vec<u32>,
}

impl Tiles {
    /// Sorts by counting.
    fn new(space: &[[f64; 2]; 3], boxes: &[Here]) -> Self {
        let axes = longest(space);
        // About a triangle in a tile.
        let across = ((boxes.len() as f64).sqrt() as u32).clamp(4, FINEST);
        let origin = axes.map(|axis| space[axis][0]);
        let scale = axes.map(|axis| f64::from(across) / (space[axis][1] - space[axis][0]));
        let count = (across * across) as usize;
        let mut tiles = Self { axes, origin, scale, across, first: vec![0; count + 1], here: Vec::new() };
        let mut filled = Vec::new();
        for (number, one) in (0..).zip(boxes) {
            filled.extend(tiles.places(&one.space).map(|place| (place, number)));
            if filled.len() > TILES_EACH * boxes.len() {
                break;
            }
        }
        filled.iter().for_each(|&(place, _)| tiles.first[place as usize + 1] += 1);
        for place in 0..count {
            tiles.first[place + 1] += tiles.first[place];
        }
        let mut next = tiles.first.clone();
        tiles.here = vec![0; filled.len()];
        for (place, number) in filled {
            tiles.here[next[place as usize] as usize] = number;
            next[place as usize] += 1;
        }
        tiles
    }

    /// The tiles that a box touches.
    fn places(&self, space: &[[f64; 2]; 3]) -> impl Iterator<Item = u32> + use<> {
        let [columns, rows] = [0, 1].map(|across| self.range(across, space[self.axes[across]]));
        let across = self.across;
        rows.flat_map(move |row| columns.clone().map(move |column| row * across + column))
    }

    fn range(&self, across: usize, [low, high]: [f64; 2]) -> RangeInclusive<u32> {
        // What lies outside saturates, as does what is no number.
        let tile = |at: f64| (((at - self.origin[across]) * self.scale[across]) as u32).min(self.across - 1);
        tile(low)..=tile(high)
    }

    fn at(&self, place: u32) -> &[u32] {
        let place = place as usize;
        &self.here[self.first[place] as usize..self.first[place + 1] as usize]
    }
}

/// The two axes along which a box is longest: the image across the third tells most apart.
fn longest(space: &[[f64; 2]; 3]) -> [usize; 2] {
    let length = |axis: usize| space[axis][1] - space[axis][0];
    let shortest = (0..3).min_by(|&a, &b| length(a).total_cmp(&length(b))).unwrap_or(0);
    [(shortest + 1) % 3, (shortest + 2) % 3]
}
