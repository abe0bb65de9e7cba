//! A glance at a pair at a few instants: does anything cross? Never trusted to say no; where it says yes, nothing closer is needed.

use super::bounds::{Bounds, meet};
use super::crossing::cross;
use super::pass::{Effort, Fit, Part, Pass};

/// Instants looked at, in parts of the window's time; what moves together is likely to end up crossed.
const INSTANTS: [f64; 3] = [1.0, 0.5, 0.25];
/// Tiles across, at most.
const FINEST: u32 = 128;
/// Fragments drawn of a part in an instant, for each of its triangles, before it is let be.
const FRAGMENTS_EACH: u64 = 16;
/// Pairs of triangles tried in an instant, and more for each triangle.
const MOST_TRIED: usize = 256;

/// A triangle in a tile at an instant.
#[derive(Clone, Copy)]
struct Here {
    triangle: u32,
    z: [f64; 2],
}

/// The triangles of a part by tile.
#[derive(Default)]
struct Tiles {
    /// Where the triangles of each tile begin in `here`, and of one tile more.
    first: Vec<u32>,
    here: Vec<Here>,
}

impl Tiles {
    /// Sorts by counting.
    fn new(tiles: usize, drawn: &[(u32, Here)]) -> Self {
        let mut first = vec![0; tiles + 1];
        drawn.iter().for_each(|(place, _)| first[*place as usize] += 1);
        let mut sum = 0;
        for count in &mut first {
            sum += *count;
            *count = sum;
        }
        // Each tile is filled from its end.
        let mut here = vec![Here { triangle: 0, z: [0.0; 2] }; drawn.len()];
        for (place, one) in drawn.iter().rev() {
            let at = &mut first[*place as usize];
            *at -= 1;
            here[*at as usize] = *one;
        }
        Self { first, here }
    }

    fn at(&self, place: u32) -> &[Here] {
        let place = place as usize;
        &self.here[self.first[place] as usize..self.first[place + 1] as usize]
    }
}

/// The instant at which two triangles of the parts were seen to cross within `window`.
pub(super) fn crossing(parts: [Part<'_>; 2], window: &Bounds) -> Option<f64> {
    let [first, last] = window.time;
    let instant = |share: f64| (first + share * (last - first)).min(last);
    INSTANTS.into_iter().map(instant).find(|&t| cross_at(parts, &Bounds { time: [t, t], ..*window }))
}

/// Whether triangles in the same tile are seen to cross at an instant.
fn cross_at(parts: [Part<'_>; 2], at: &Bounds) -> bool {
    let triangles: usize = parts.iter().map(|part| part.list.len()).sum();
    // A few triangles in a tile.
    let resolution = ((triangles as f64).sqrt() as u32 / 2).clamp(4, FINEST);
    let pass = Pass::new(shortest(at), at, resolution, Fit::Boxes);
    let effort = |part: Part<'_>| Effort::of(part.list.len() as u64 * FRAGMENTS_EACH);
    let mut drawn = Vec::new();
    pass.draw(parts[0], &[Some(*at)], &mut effort(parts[0]), |fragment| {
        let here = Here { triangle: fragment.inside.triangle, z: fragment.inside.z };
        drawn.push((pass.place(fragment.tile, 0), here));
    });
    let tiles = Tiles::new(pass.tiles(), &drawn);
    let [one, other] = parts.map(|part| &part.object.triangles);
    let (mut left, mut seen) = (MOST_TRIED + triangles, false);
    pass.draw(parts[1], &[Some(*at)], &mut effort(parts[1]), |fragment| {
        for here in tiles.at(pass.place(fragment.tile, 0)) {
            if seen || left == 0 || meet(here.z, fragment.inside.z).is_none() {
                continue;
            }
            let second = fragment.inside.triangle;
            seen = cross(&one[here.triangle as usize], &other[second as usize], at.time[0]);
            left -= 1;
        }
    });
    seen
}

/// The axis along which the window is shortest: the image across it tells most apart.
fn shortest(window: &Bounds) -> usize {
    let length = |axis: &usize| window.space[*axis][1] - window.space[*axis][0];
    (0..3).min_by(|a, b| length(a).total_cmp(&length(b))).unwrap_or(0)
}
