//! The method compared with: depths alone (Govindaraju et al. 2003, "CULLIDE: interactive collision detection between complex models
//! in large environments using graphics hardware", section 4), its queries made conservative over all of the time.
//!
//! One object is drawn, then the other with the depth test reversed: where no fragment of the second is in front of the first's
//! farthest, seen from a direction, the two are apart. Three axes from both sides are six passes.

use super::Bounds;
use super::buffer::TzBuffer;
use super::pass::{Part, Pass};

/// Tiles that keep the two together in the pass with the fewest, or `None` where one of the six sets them apart.
pub(super) fn tiles(
    parts: [Part<'_>; 2],
    window: &Bounds,
    resolution: u32,
    buffers: &mut [TzBuffer; 2],
) -> Option<u64> {
    let mut fewest = u64::MAX;
    for axis in 0..3 {
        let pass = Pass::new(axis, window, resolution);
        let whole = [Some(*window)];
        for (part, depths) in parts.into_iter().zip(&mut *buffers) {
            depths.clear(pass.tiles());
            pass.draw(part, &whole, |fragment| depths.add(pass.place(fragment.tile, 0), &fragment.inside));
        }
        let [first, second] = &*buffers;
        let both = || {
            let shared = first.used().map(|(place, one)| (one.z, second.at(place).z));
            shared.filter(|(_, other)| other[0] <= other[1])
        };
        let in_front = both().filter(|(one, other)| other[0] <= one[1]).count() as u64;
        let behind = both().filter(|(one, other)| other[1] >= one[0]).count() as u64;
        fewest = fewest.min(in_front).min(behind);
    }
    (fewest > 0).then_some(fewest)
}
