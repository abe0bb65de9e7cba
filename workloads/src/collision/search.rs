//! How a pair of objects is searched, and what is found.

use serde::{Deserialize, Serialize};

use super::bounds::Bounds;

/// What is compared in a tile.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Each fragment of one object with the box of the other (Fig. 5, right).
    #[default]
    FragmentBox,
    /// The boxes of both (Fig. 5, left).
    BoxBox,
    /// Depths alone, in six passes (Govindaraju et al. 2003, "CULLIDE").
    DepthOnly,
}

/// How closely a pair is looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Search {
    /// Tiles across, 1 to 1024.
    pub resolution: u32,
    /// Bins of time in a tile, 1 to 256.
    pub bins: u32,
    /// What is compared.
    pub method: Method,
    /// Whether to look again, closer, at what is left of space and time.
    pub zoom: bool,
}

impl Default for Search {
    fn default() -> Self {
        Self { resolution: 128, bins: 16, method: Method::FragmentBox, zoom: true }
    }
}

/// What is known of a pair.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    /// They do not collide.
    Apart,
    /// They may, and if so, then within `bounds`.
    Maybe {
        /// Where and when.
        bounds: Bounds,
        /// Tiles in which they may, in the last pass that was looked at.
        tiles: u64,
        /// Whether two triangles were seen to cross or to share a corner, as far as rounding can tell.
        seen: bool,
    },
}

impl Verdict {
    /// The same `factor` times as large.
    pub(super) fn scaled(self, factor: f64) -> Self {
        let Self::Maybe { bounds, tiles, seen } = self else { return self };
        let space = bounds.space.map(|range| range.map(|at| at * factor));
        Self::Maybe { bounds: Bounds { space, ..bounds }, tiles, seen }
    }

    /// Whether the pair has to stay.
    pub fn may_collide(&self) -> bool {
        *self != Self::Apart
    }

    /// Whether two triangles were seen to cross or to share a corner.
    pub fn is_seen(&self) -> bool {
        matches!(self, Self::Maybe { seen: true, .. })
    }
}
