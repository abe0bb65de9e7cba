//! Bins: coarse tiles, each rasterized by one worker, triangle by triangle through its fine tiles.

use super::judge::Judge;
use super::pass::Pass;
use crate::depth::DepthTile;

/// A coarse tile of the image and what its samples see.
pub(super) struct Bin {
    /// Its first pixel.
    pub origin: [u32; 2],
    /// Its fine tiles, row by row; those outside the image are there and stay untouched.
    pub tiles: Vec<Option<DepthTile>>,
    /// What `auto` has learnt about its tests.
    pub judge: Judge,
}

impl Bin {
    /// The cleared bins of an image, row by row.
    pub fn all(pass: &Pass<'_>) -> Vec<Self> {
        let (viewport, coarse) = (pass.settings.viewport, pass.settings.spec.coarse_tile_px);
        let tiles = Self::tiles_across(pass).pow(2) as usize;
        let [across, down] = [viewport.width(), viewport.height()].map(|side| side.div_ceil(coarse));
        (0..across * down)
            .map(|bin| Self {
                origin: [bin % across * coarse, bin / across * coarse],
                tiles: vec![None; tiles],
                judge: Judge::new(),
            })
            .collect()
    }

    pub fn tiles_across(pass: &Pass<'_>) -> u32 {
        pass.settings.spec.coarse_tile_px / pass.settings.spec.tile_px
    }

    /// The first pixel of fine tile `place` of the bin.
    pub fn tile_origin(&self, pass: &Pass<'_>, place: usize) -> [u32; 2] {
        let (across, side) = (Self::tiles_across(pass), pass.settings.spec.tile_px);
        [self.origin[0] + place as u32 % across * side, self.origin[1] + place as u32 / across * side]
    }

    /// The number of the fine tile at `origin` in the whole image.
    pub fn tile_number(pass: &Pass<'_>, origin: [u32; 2]) -> u32 {
        let side = pass.settings.spec.tile_px;
        origin[1] / side * pass.tiles_across() + origin[0] / side
    }

    /// The tiles that lie in the image: number, place in the bin, pixels that do, and whether any triangle came near.
    pub fn inside(&self, pass: &Pass<'_>) -> impl Iterator<Item = (u32, usize, u64, bool)> {
        let (viewport, side) = (pass.settings.viewport, pass.settings.spec.tile_px);
        self.tiles.iter().enumerate().filter_map(move |(place, tile)| {
            let [x, y] = self.tile_origin(pass, place);
            let [columns, rows] = [viewport.width().saturating_sub(x), viewport.height().saturating_sub(y)];
            let [columns, rows] = [columns.min(side), rows.min(side)];
            let row = (1_u64 << columns) - 1;
            let pixels = (0..rows).fold(0_u64, |mask, r| mask | row << (r * side));
            (pixels != 0).then(|| (Self::tile_number(pass, [x, y]), place, pixels, tile.is_some()))
        })
    }
}
