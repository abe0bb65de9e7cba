//! From what each sample sees to the image.

use std::collections::HashMap;

use glam::Vec3;
use rayon::prelude::*;

use super::bin::Bin;
use super::pass::Pass;
use super::surface::{Grid, Surface};
use crate::depth::DepthTile;
use crate::sampling::TileSamples;
use crate::setup::Corner;

/// The image: each pixel the mean of its samples.
pub(super) fn resolve(pass: &Pass<'_>, bins: &[Bin]) -> Vec<Vec3> {
    let viewport = pass.settings.viewport;
    let tiles: Vec<_> = bins.par_iter().map(|bin| resolve_bin(pass, bin)).collect();
    let mut image = vec![pass.settings.background; viewport.pixels()];
    for (origin, pixels) in tiles.into_iter().flatten() {
        let side = pass.settings.spec.tile_px;
        for (pixel, colour) in (0..).zip(pixels) {
            let [x, y] = [origin[0] + pixel % side, origin[1] + pixel / side];
            if x < viewport.width() && y < viewport.height() {
                image[y as usize * viewport.width() as usize + x as usize] = colour;
            }
        }
    }
    image
}

/// The triangle each sample sees and the bits of its depth, tile by tile in rows.
pub(super) fn visible(pass: &Pass<'_>, bins: &[Bin]) -> Vec<(u32, u32)> {
    let per_pixel = pass.settings.samples.per_pixel();
    let mut tiles: Vec<_> =
        bins.iter().flat_map(|bin| bin.inside(pass).zip(std::iter::repeat(bin))).collect();
    tiles.sort_by_key(|((number, ..), _)| *number);
    let mut seen = Vec::new();
    for ((_, place, pixels, _), bin) in tiles {
        match &bin.tiles[place] {
            Some(tile) => {
                seen.extend(tile.triangle.iter().copied().zip(tile.depth.iter().map(|d| d.to_bits())))
            }
            None => {
                let samples = (pixels.count_ones() * per_pixel) as usize;
                seen.extend(std::iter::repeat_n((u32::MAX, f32::INFINITY.to_bits()), samples));
            }
        }
    }
    seen
}

/// The touched tiles of a bin: the first pixel of each and its pixels, row by row.
fn resolve_bin(pass: &Pass<'_>, bin: &Bin) -> Vec<([u32; 2], Vec<Vec3>)> {
    let mut samples = TileSamples::default();
    let mut memo = HashMap::new();
    let mut resolved = Vec::new();
    for (place, tile) in bin.tiles.iter().enumerate() {
        let Some(tile) = tile else { continue };
        let origin = bin.tile_origin(pass, place);
        let settings = pass.settings;
        samples.fill(
            settings.samples,
            settings.viewport,
            &pass.projection.shear,
            origin,
            settings.spec.tile_px,
        );
        resolved.push((origin, resolve_tile(pass, tile, &samples, origin, &mut memo)));
        // Cells at the border of a tile are shaded again by its neighbour; memory stays small.
        memo.clear();
    }
    resolved
}

fn resolve_tile(
    pass: &Pass<'_>,
    tile: &DepthTile,
    samples: &TileSamples,
    origin: [u32; 2],
    memo: &mut HashMap<(u32, [i32; 2]), Vec3>,
) -> Vec<Vec3> {
    let side = pass.settings.spec.tile_px;
    let mut sums = vec![Vec3::ZERO; (side * side) as usize];
    for slot in 0..samples.len {
        let pixel = samples.pixel[slot] as usize;
        sums[pixel] += if tile.depth[slot] == f32::INFINITY {
            pass.settings.background
        } else {
            let triangle = tile.triangle[slot];
            let corners = pass.images(triangle).map(Corner::new);
            let moving = pass.images(triangle).iter().any(|vertex| !vertex.is_still());
            let cell = Grid::new(pass, &corners, moving).cell(samples, slot, origin, side);
            *memo.entry((triangle, cell)).or_insert_with(|| Surface::new(pass, triangle).shade(cell))
        };
    }
    let per_pixel = pass.settings.samples.per_pixel() as f32;
    sums.into_iter().map(|sum| sum / per_pixel).collect()
}
