//! What every sample sees, found without any tile, box or bin: all triangles against all samples.

use pipeline::geometry::Projection;
use pipeline::sample_test::{Hits, Target, test_run};
use pipeline::sampling::{SampleSource, TileSamples};
use pipeline::setup::{Outcome, Triangle, set_up};
use pipeline::traversal::{Box5, TileRect};
use pipeline::{Camera, Draw, Viewport};

/// The triangles of `draws` that set-up lets pass, numbered through all draws.
pub fn set_up_all(camera: &Camera, draws: &[Draw<'_>], viewport: Viewport) -> Vec<Triangle> {
    let projection = Projection::new(camera, viewport);
    let half_px = [viewport.width(), viewport.height()].map(|side| 0.5 * side as f32);
    let mut ready = Vec::new();
    let mut first = 0;
    for draw in draws {
        let geometry = &draw.geometry;
        for (id, corners) in (first..).zip(geometry.triangles()) {
            let vertices = corners.map(|v| {
                let v = v as usize;
                projection.vertex(geometry.open()[v], geometry.close()[v])
            });
            let vertices = [&vertices[0], &vertices[1], &vertices[2]];
            let outcome = set_up(id, vertices, draw.cull, &projection.shear, projection.near, half_px);
            if let Outcome::Ready(triangle) = outcome {
                ready.push(triangle);
            }
        }
        first += geometry.triangles().len() as u32;
    }
    ready
}

/// The triangle each sample sees and the bits of its depth, as [`visibility`](pipeline::frame::visibility) gives them, from
/// all triangles against all samples with no dimension dropped.
pub fn brute_force(
    camera: &Camera,
    draws: &[Draw<'_>],
    viewport: Viewport,
    source: &dyn SampleSource,
) -> Vec<(u32, u32)> {
    within_bounds(camera, draws, viewport, source, |_, _| Some(Box5::whole(true)))
}

/// The same where `bound` says for each triangle and tile of 8x8 pixels in which part of lens and time to test samples.
pub fn within_bounds(
    camera: &Camera,
    draws: &[Draw<'_>],
    viewport: Viewport,
    source: &dyn SampleSource,
    bound: impl Fn(&Triangle, &TileRect) -> Option<Box5>,
) -> Vec<(u32, u32)> {
    const SIDE_PX: u32 = 8;
    let projection = Projection::new(camera, viewport);
    let mut triangles = set_up_all(camera, draws, viewport);
    triangles.iter_mut().for_each(|triangle| triangle.moving = true);
    let per_pixel = source.per_pixel();
    let mut seen = vec![(u32::MAX, f32::INFINITY.to_bits()); viewport.pixels() * per_pixel as usize];
    let (mut samples, mut hits) = (TileSamples::default(), Hits::default());
    for tile in 0..viewport.width().div_ceil(SIDE_PX) * viewport.height().div_ceil(SIDE_PX) {
        let across = viewport.width().div_ceil(SIDE_PX);
        let origin = [tile % across * SIDE_PX, tile / across * SIDE_PX];
        let rect = TileRect::new(viewport, origin, SIDE_PX);
        samples.fill(source, viewport, &projection.shear, origin, SIDE_PX);
        let (mut depth, mut owner) = (vec![f32::INFINITY; samples.len], vec![u32::MAX; samples.len]);
        let mut target = Target { depth: &mut depth, triangle: &mut owner };
        for triangle in &triangles {
            let Some(within) = bound(triangle, &rect) else { continue };
            hits.clear();
            test_run(triangle, &samples, &within, projection.near, &mut target, &mut hits);
        }
        for slot in 0..samples.len {
            let place = samples.in_image(slot, origin, SIDE_PX, viewport, per_pixel);
            seen[place] = (owner[slot], depth[slot].to_bits());
        }
    }
    seen
}
