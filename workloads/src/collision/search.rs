//! Parameters and result of the search of a pair.

use serde::{Deserialize, Serialize};

use super::bounds::Bounds;

/// What a pass compares in a tile.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Each fragment of one object with the box of the other (thesis, Paper VI, Fig. 5, right).
    #[default]
    FragmentBox,
    /// The boxes of both objects (Fig. 5, left).
    BoxBox,
    /// Depths alone, in six passes (Govindaraju et al. 2003, "CULLIDE").
    DepthOnly,
}

/// Parameters of the search.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Search {
    /// Tiles across, 1 to 1024.
    pub resolution: u32,
    /// Time bins per tile, 1 to 256.
    pub bins: u32,
    /// What is compared.
    pub method: Method,
    /// Whether to refine: search the remaining space and time again with smaller tiles.
    pub zoom: bool,
}

impl Default for Search {
    fn default() -> Self {
        Self { resolution: 128, bins: 16, method: Method::FragmentBox, zoom: true }
    }
}

/// Result of a search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    /// The objects do not collide.
    Apart,
    /// The objects may collide; every contact lies within `bounds`.
    Maybe {
        /// Space and time that contain every contact.
        bounds: Bounds,
        /// Overlapping tiles of the last pass.
        tiles: u64,
        /// Whether two triangles were found to cross or to share a corner, beyond rounding errors.
        seen: bool,
    },
}

impl Verdict {
    /// Scales the bounds by `factor`.
    pub(super) fn scaled(self, factor: f64) -> Self {
        let Self::Maybe { bounds, tiles, seen } = self else { return self };
        let space = bounds.space.map(|range| range.map(|at| at * factor));
        Self::Maybe { bounds: Bounds { space, ..bounds }, tiles, seen }
    }

    /// Whether the pair stays in the potentially colliding set.
    pub fn may_collide(&self) -> bool {
        *self != Self::Apart
    }

    /// Whether two triangles were found to cross or to share a corner.
    pub fn is_contact(&self) -> bool {
        matches!(self, Self::Maybe { seen: true, .. })
    }
}
