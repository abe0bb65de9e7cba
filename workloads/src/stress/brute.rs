//! Brute-force visibility: all triangles against all samples, without tiles, boxes or bins.

use pipeline::geometry::Projection;
use pipeline::sample_test::{Hits, Target, test_run};
use pipeline::sampling::{SampleSource, TileSamples};
use pipeline::setup::{Outcome, Triangle, set_up};
use pipeline::traversal::{Box5, TileRect};
use pipeline::{Camera, Draw, Viewport};

/// The triangles of `draws` that pass set-up, numbered through all draws.
pub fn set_up_all<'a>(
    camera: &Camera,
    draws: &'a [Draw<'a>],
    viewport: Viewport,
) -> impl Iterator<Item = Triangle> + use<'a> {
    let projection = Projection::new(camera, viewport);
    let triangles = draws.iter().flat_map(|draw| draw.geometry.triangles().iter().map(move |t| (draw, *t)));
    (0..).zip(triangles).filter_map(move |(id, (draw, corners))| {
        let (open, close) = (draw.geometry.open(), draw.geometry.close());
        let [a, b, c] = corners.map(|v| projection.vertex(open[v as usize], close[v as usize]));
        match set_up(id, [&a, &b, &c], draw.cull, &projection.shear, projection.near, viewport.half_px()) {
            Outcome::Ready(triangle) => Some(triangle),
            _ => None,
        }
    })
}

/// Visible triangle of each sample and the bits of its depth, in the form of
/// [`visibility`](pipeline::frame::visibility). All triangles are tested against all samples in all
/// dimensions.
pub fn brute_force(
    camera: &Camera,
    draws: &[Draw<'_>],
    viewport: Viewport,
    source: &dyn SampleSource,
) -> Vec<(u32, u32)> {
    within_bounds(camera, draws, viewport, source, |_, _| Some(Box5::whole(true)))
}

/// The same, but only within the part of lens and time that `bound` returns for each triangle and tile of 8x8
/// pixels.
pub fn within_bounds(
    camera: &Camera,
    draws: &[Draw<'_>],
    viewport: Viewport,
    source: &dyn SampleSource,
    bound: impl Fn(&Triangle, &TileRect) -> Option<Box5>,
) -> Vec<(u32, u32)> {
    const SIDE_PX: u32 = 8;
    let projection = Projection::new(camera, viewport);
    let triangles: Vec<_> =
        set_up_all(camera, draws, viewport).map(|ready| Triangle { moving: true, ..ready }).collect();
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
