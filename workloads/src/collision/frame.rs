//! A frame of reference that moves with one of two objects.
//!
//! Whether and when two objects touch does not change when both are moved alike. Seen from the larger one, which then hardly moves,
//! tiles hold what they should for all of the time instead of what sweeps through them.

use super::bounds::Bounds;
use super::object::Object;
use super::pass::Part;
use super::search::Verdict;

/// Moving by less than this share of what both objects share is not worth a copy, and by less than the larger one not that of many
/// triangles.
const LEAST: f64 = 1.0 / 64.0;
const LEAST_OF_MANY: f64 = 0.25;
const MANY: usize = 4096;

/// Parts of two objects seen from a frame of reference.
pub(super) struct Seen {
    pub objects: [Object; 2],
    /// How far the frame goes from time 0 to time 1.
    way: [f64; 3],
}

/// Coordinates beyond this stay where they are, so that none leaves the range that the rasterizer takes.
const FARTHEST: f64 = 1e59;

impl Seen {
    /// From the larger one of two objects, unless it hardly moves beside the window of what both share.
    pub fn new(parts: [Part<'_>; 2], window: &Bounds) -> Option<Self> {
        let [a, b] = parts.map(|part| part.object);
        let ways = [a, b].map(Object::way);
        let way = if size(a, &ways[0]) >= size(b, &ways[1]) { ways[0] } else { ways[1] };
        let triangles: usize = parts.iter().map(|part| part.list.len()).sum();
        let least = if triangles < MANY { LEAST } else { LEAST_OF_MANY };
        let extent = |axis: usize| window.space[axis][1] - window.space[axis][0];
        let worth = a.largest().max(b.largest()) <= FARTHEST
            && (0..3).any(|axis| way[axis].abs() > least * extent(axis));
        worth.then(|| Self { objects: parts.map(|part| part.object.less(part.list, way)), way })
    }

    /// A verdict on the objects as seen, for where they are.
    pub fn told(&self, verdict: Verdict) -> Verdict {
        let Verdict::Maybe { mut bounds, tiles, seen } = verdict else { return verdict };
        for (range, way) in bounds.space.iter_mut().zip(self.way) {
            let [from, to] = bounds.time.map(|t| t * way);
            let size = range[0].abs().max(range[1].abs()) + way.abs();
            let margin = if way == 0.0 { 0.0 } else { 4.0 * f64::EPSILON * size };
            *range = [range[0] + from.min(to) - margin, range[1] + from.max(to) + margin];
        }
        Verdict::Maybe { bounds, tiles, seen }
    }
}

/// The longest side of an object, its way taken off the box that it sweeps.
fn size(object: &Object, way: &[f64; 3]) -> f64 {
    let sides = object.bounds.space.iter().zip(way).map(|([low, high], way)| high - low - way.abs());
    sides.fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen_from(objects: [&Object; 2]) -> Option<Seen> {
        let window = objects[0].bounds.meet(&objects[1].bounds)?;
        Seen::new(objects.map(|object| Part { object, list: &[0] }), &window)
    }

    #[test]
    fn the_larger_one_stands_still_and_places_are_told_as_they_are() {
        let square = |x: f64, size: f64| [[x, 0.0, 0.0], [x + size, 0.0, 0.0], [x, size, 0.0]];
        let large = Object::from_ends(vec![[square(0.0, 4.0), square(8.0, 4.0)]], 0.0).unwrap();
        let small = Object::from_ends(vec![[square(1.0, 1.0), square(1.5, 1.0)]], 0.0).unwrap();
        let seen = seen_from([&small, &large]).unwrap();
        assert_eq!(seen.objects[1].triangles[0][0], seen.objects[1].triangles[0][1]);
        assert_eq!(seen.objects[0].triangles[0][1], square(-6.5, 1.0));
        let bounds = Bounds { space: [[1.0, 2.0], [0.0, 1.0], [0.0, 0.0]], time: [0.25, 0.5] };
        let Verdict::Maybe { bounds: told, .. } = seen.told(Verdict::Maybe { bounds, tiles: 1, seen: false })
        else {
            panic!("a pair that may collide")
        };
        assert!((told.space[0][0] - 3.0).abs() < 1e-12 && (told.space[0][1] - 6.0).abs() < 1e-12);
        assert_eq!(told.space[1..], bounds.space[1..]);
        let still = Object::from_ends(vec![[square(0.0, 4.0); 2]], 0.0).unwrap();
        assert!(seen_from([&small, &still]).is_none());
    }
}
