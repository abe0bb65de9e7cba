//! Passes without counts: the visibility engine finds what the samples see, and the shading of the pipeline
//! gives the colours.

use glam::Vec3;

use super::Settings;
use super::pass::{Pass, RasterPass};
use super::resolve::{Scratch, TilePixels, assemble, shade_tile};
use crate::depth::DepthTile;
use crate::geometry::Clip;
use crate::sampling::TileSamples;
use crate::visibility::{SeenBin, bin_by_bin};

/// Result of a pass without counts, as in [`Rendered`](super::Rendered).
pub(super) struct Seen {
    pub images: Vec<Vec<Vec3>>,
    pub visible: Vec<(u32, u32)>,
}

/// Draws a pass without counts, to the same bytes as the modelled hardware. `None` where the engine sees
/// other samples than the hardware, or the result depends on the order of triangles.
pub(super) fn draw(pass: &Pass<'_>, of: &RasterPass<'_>) -> Option<Seen> {
    if !sees_the_same(pass) {
        return None;
    }
    let Settings { viewport, samples, .. } = *pass.settings;
    let has_images = of.image && !pass.views.is_empty();
    let moving = pass.vertices.iter().flatten().any(|vertex| !vertex.is_still());
    let corners = |id| {
        let (draw, corners) = pass.corners(id);
        (corners.map(|vertex| &pass.vertices[draw][vertex]), pass.draws[draw].state.cull)
    };
    let seen = bin_by_bin(
        (of.camera, viewport, samples),
        (of.triangles() as u32, moving),
        corners,
        BinShader::default,
        |worker, seen| {
            let tiles = if has_images { worker.shade(pass, seen) } else { Vec::new() };
            (tiles, of.visible.then(|| seen.clone()))
        },
    )?;
    let (tiles, seen): (Vec<_>, Vec<_>) = seen.into_iter().unzip();
    Some(Seen {
        images: if has_images { assemble(pass, tiles) } else { Vec::new() },
        visible: if of.visible { in_image_order(pass, seen.iter().flatten()) } else { Vec::new() },
    })
}

/// Whether the engine sees what the hardware sees: the nearest triangles of the samples, as they are and unclipped.
fn sees_the_same(pass: &Pass<'_>) -> bool {
    let features = &pass.settings.spec.features;
    let is_exact = features.still_px == 0.0 && features.in_focus_px == 0.0;
    let is_clipped = pass.draws.iter().any(|draw| draw.geometry.clip() != Clip::NONE);
    is_exact && !is_clipped && !pass.is_ordered && pass.clear.depth == f32::INFINITY
}

/// Triangle and depth bits of every sample of the image, pixel by pixel in rows.
fn in_image_order<'s>(pass: &Pass<'_>, bins: impl Iterator<Item = &'s SeenBin>) -> Vec<(u32, u32)> {
    let Settings { viewport, samples, .. } = *pass.settings;
    let per_pixel = samples.per_pixel() as usize;
    let mut image = vec![(DepthTile::NO_TRIANGLE, f32::INFINITY.to_bits()); viewport.pixels() * per_pixel];
    for bin in bins {
        let [x0, y0] = bin.origin;
        let across = bin.side_px.min(viewport.width() - x0) as usize * per_pixel;
        for row in 0..bin.side_px.min(viewport.height() - y0) {
            let first = (row * bin.side_px) as usize * per_pixel;
            let into = ((y0 + row) as usize * viewport.width() as usize + x0 as usize) * per_pixel;
            let seen = bin.triangles[first..].iter().zip(&bin.depths[first..]);
            let row = image[into..into + across].iter_mut().zip(seen);
            row.for_each(|(sample, (&triangle, depth))| *sample = (triangle, depth.to_bits()));
        }
    }
    image
}

/// Memory reused by a worker.
#[derive(Default)]
struct BinShader {
    scratch: Scratch,
    samples: TileSamples,
    /// Triangles of the samples of a tile.
    triangles: Vec<u32>,
    /// Distance in a bin from the first sample of a tile to each, by its place in the tile.
    offsets: Vec<u32>,
}

impl BinShader {
    /// Colours of the tiles of a bin in which any sample sees a triangle.
    fn shade(&mut self, pass: &Pass<'_>, seen: &SeenBin) -> Vec<TilePixels> {
        let Settings { spec, viewport, samples: source, .. } = *pass.settings;
        let (side, per_pixel) = (spec.tile_px, source.per_pixel());
        let across = seen.side_px / side;
        let offset = |pixel: u32| (pixel / side * seen.side_px + pixel % side) * per_pixel;
        self.offsets.clear();
        self.offsets.extend(
            (0..side * side).flat_map(|pixel| (0..per_pixel).map(move |index| offset(pixel) + index)),
        );
        let mut shaded = Vec::new();
        for (column, row) in (0..across).flat_map(|row| (0..across).map(move |column| (column, row))) {
            let [x, y] = [column, row].map(|at| at * side);
            let origin = [seen.origin[0] + x, seen.origin[1] + y];
            if origin[0] >= viewport.width() || origin[1] >= viewport.height() {
                continue;
            }
            let Self { scratch, samples, triangles, offsets } = self;
            let of_tile = &seen.triangles[((y * seen.side_px + x) * per_pixel) as usize..];
            let rows = of_tile.chunks((seen.side_px * per_pixel) as usize).take(side as usize);
            let is_seen = |row: &[u32]| {
                row[..(side * per_pixel) as usize].iter().any(|&triangle| triangle != DepthTile::NO_TRIANGLE)
            };
            if !rows.into_iter().any(is_seen) {
                continue;
            }
            samples.fill(source, viewport, &pass.projection.shear, origin, side);
            triangles.clear();
            let places = samples.places().iter();
            triangles.extend(places.map(|&place| of_tile[offsets[usize::from(place)] as usize]));
            shaded.push((origin, shade_tile(pass, triangles, (samples, origin), scratch)));
        }
        shaded
    }
}
