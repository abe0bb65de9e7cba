//! The method compared with: depths alone (Govindaraju et al. 2003, "CULLIDE: interactive collision detection between complex models
//! in large environments using graphics hardware", section 4), its queries made conservative over all of the time.
//!
//! One object is drawn, then the other with the depth test reversed: where no fragment of the second is in front of the first's
//! farthest, seen from a direction, the two are apart. Three axes from both sides are six passes.

use super::Bounds;
use super::compare::{Comparison, Scratch, Watch};
use super::pass::{Effort, Fit, Part, Pass};

/// Tiles, of so many and not narrower `across`, that keep the two together in the pass with the fewest, none where one of the six
/// sets them apart. `None` where that takes more than `effort`.
pub(super) fn tiles(
    parts: [Part<'_>; 2],
    window: &Bounds,
    across: (u32, f64),
    effort: &mut Effort,
    scratch: &mut Scratch,
    watch: &mut impl Watch,
) -> Option<u64> {
    let mut fewest = u64::MAX;
    for axis in 0..3 {
        let pass = Pass::new(axis, window, across, Fit::Edges);
        let comparison = Comparison { pass: &pass, parts, bins: &[Some(*window)] };
        let [in_front, behind] = comparison.depths(scratch, effort, watch)?;
        fewest = fewest.min(in_front).min(behind);
    }
    Some(fewest)
}
