//! A frame of reference that moves with the larger of two objects.
//!
//! Contacts do not depend on the frame of reference. In the frame of the larger object, which then hardly
//! moves, a tile contains few triangles at all times instead of everything that sweeps through it.

use super::bounds::Bounds;
use super::object::Object;
use super::pass::Part;
use super::search::Verdict;

/// Least motion of the frame, as a share of the window's extent, that is worth a copy of the triangles.
const MIN_MOTION: f64 = 1.0 / 64.0;
/// The same for [`MANY_TRIANGLES`] or more, which cost more to copy.
const MIN_MOTION_OF_MANY: f64 = 0.25;
/// Triangles of both parts from which [`MIN_MOTION_OF_MANY`] holds.
const MANY_TRIANGLES: usize = 4096;

/// Parts of two objects, in a moving frame of reference.
pub(super) struct InFrame {
    pub objects: [Object; 2],
    /// Translation of the frame from time 0 to time 1.
    translation: [f64; 3],
}

/// Largest coordinate that is transformed. Differences then stay within the range of the rasterizer.
const MAX_COORDINATE: f64 = 1e59;

impl InFrame {
    /// Copies both parts into the frame of the larger object; `None` if its motion is small compared with the
    /// window.
    pub fn new(parts: [Part<'_>; 2], window: &Bounds) -> Option<Self> {
        let [a, b] = parts.map(|part| part.object);
        let translations = [a, b].map(Object::translation);
        let translation = if size(a, &translations[0]) >= size(b, &translations[1]) {
            translations[0]
        } else {
            translations[1]
        };
        let triangles: usize = parts.iter().map(|part| part.list.len()).sum();
        let least = if triangles < MANY_TRIANGLES { MIN_MOTION } else { MIN_MOTION_OF_MANY };
        let extent = |axis: usize| window.space[axis][1] - window.space[axis][0];
        let worth = a.largest().max(b.largest()) <= MAX_COORDINATE
            && (0..3).any(|axis| translation[axis].abs() > least * extent(axis));
        worth.then(|| Self {
            objects: parts.map(|part| part.object.in_frame(part.list, translation)),
            translation,
        })
    }

    /// Transforms the bounds of a verdict back to world space.
    pub fn to_world(&self, verdict: Verdict) -> Verdict {
        let Verdict::Maybe { mut bounds, tiles, seen } = verdict else { return verdict };
        for (range, translation) in bounds.space.iter_mut().zip(self.translation) {
            let [from, to] = bounds.time.map(|t| t * translation);
            let size = range[0].abs().max(range[1].abs()) + translation.abs();
            let margin = if translation == 0.0 { 0.0 } else { 4.0 * f64::EPSILON * size };
            *range = [range[0] + from.min(to) - margin, range[1] + from.max(to) + margin];
        }
        Verdict::Maybe { bounds, tiles, seen }
    }
}

/// Longest side of an object's swept box, less its translation.
fn size(object: &Object, translation: &[f64; 3]) -> f64 {
    let sides = object
        .bounds
        .space
        .iter()
        .zip(translation)
        .map(|([low, high], translation)| high - low - translation.abs());
    sides.fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn framed(objects: [&Object; 2]) -> Option<InFrame> {
        let window = objects[0].bounds.meet(&objects[1].bounds)?;
        InFrame::new(objects.map(|object| Part { object, list: &[0] }), &window)
    }

    #[test]
    fn the_larger_object_stands_still_and_bounds_are_in_world_space() {
        let square = |x: f64, size: f64| [[x, 0.0, 0.0], [x + size, 0.0, 0.0], [x, size, 0.0]];
        let large = Object::from_ends(vec![[square(0.0, 4.0), square(8.0, 4.0)]], 0.0).unwrap();
        let small = Object::from_ends(vec![[square(1.0, 1.0), square(1.5, 1.0)]], 0.0).unwrap();
        let seen = framed([&small, &large]).unwrap();
        assert_eq!(seen.objects[1].triangles[0][0], seen.objects[1].triangles[0][1]);
        assert_eq!(seen.objects[0].triangles[0][1], square(-6.5, 1.0));
        let bounds = Bounds { space: [[1.0, 2.0], [0.0, 1.0], [0.0, 0.0]], time: [0.25, 0.5] };
        let Verdict::Maybe { bounds: to_world, .. } =
            seen.to_world(Verdict::Maybe { bounds, tiles: 1, seen: false })
        else {
            panic!("a pair that may collide")
        };
        assert!((to_world.space[0][0] - 3.0).abs() < 1e-12 && (to_world.space[0][1] - 6.0).abs() < 1e-12);
        assert_eq!(to_world.space[1..], bounds.space[1..]);
        let still = Object::from_ends(vec![[square(0.0, 4.0); 2]], 0.0).unwrap();
        assert!(framed([&small, &still]).is_none());
    }
}
