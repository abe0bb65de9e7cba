//! Packets of shading with a shadow map: every sample reads the map through the texture cache.

use activity::{Counts, Event, Packet, PacketKind};
use pipeline::PipelineSpec;
use pipeline::memory::{LINE_BYTES, MemorySystem};
use pipeline::sampling::{Sample, SampleSource};

use super::map::ShadowMap;
use super::shade::World;
use crate::job::{Emit, JobError};

/// Operations per sample: vertices at its time (15), weights of its point (12), the point (9), the normal
/// (15), the point in the light's map (14), the comparison (2), Lambert's law (9).
const OPS: u32 = 76;
/// Bytes of a stored depth and of an image pixel.
const BYTES: u64 = 4;

/// Emits the packets of the pass that shades the visible samples, one per tile, and returns their sum.
///
/// # Errors
/// [`JobError`] if a cache of `spec` cannot be built.
pub fn look_up_packets(
    world: &World<'_>,
    (samples, seen): (&dyn SampleSource, &[(u32, u32)]),
    map: &ShadowMap,
    spec: &PipelineSpec,
    emit: Emit<'_>,
) -> Result<Counts, JobError> {
    let mut memory = MemorySystem::new(&spec.memory)?;
    let image = map.bytes().next_multiple_of(LINE_BYTES);
    let (width, height) = (world.viewport.width(), world.viewport.height());
    let (side, per_pixel) = (spec.tile_px, samples.per_pixel() as usize);
    let mut counts = Counts::default();
    let mut at = vec![Sample::default(); per_pixel];
    let tiles = (0..height)
        .step_by(side as usize)
        .flat_map(|y| (0..width).step_by(side as usize).map(move |x| [x, y]));
    for (number, [x0, y0]) in (0..).zip(tiles) {
        let mut packet = Packet::new(PacketKind::Tile, 0, number, u32::MAX);
        for [px, py] in
            (y0..height.min(y0 + side)).flat_map(|y| (x0..width.min(x0 + side)).map(move |x| [x, y]))
        {
            let pixel = py as usize * width as usize + px as usize;
            samples.pixel_into(px, py, &mut at);
            for (index, (sample, (triangle, _))) in at.iter().zip(&seen[pixel * per_pixel..]).enumerate() {
                let Some(point) = world.position([px, py], sample, *triangle) else { continue };
                packet.counts[Event::PixelInvocations] += 1;
                packet.counts[Event::ShaderOps] += OPS;
                if let Some((place, _)) = map.place(world.light, point, index) {
                    packet.counts[Event::TextureFetches] += 1;
                    memory.texture(place as u64 * BYTES, &mut packet.counts);
                }
            }
            packet.counts[Event::PixelsResolved] += 1;
            memory.colour(image + pixel as u64 * BYTES, true, true, &mut packet.counts);
        }
        counts += &packet.counts;
        emit(&packet, memory.log());
        memory.clear_log();
    }
    let mut last = Packet::new(PacketKind::Resolve, 0, 0, u32::MAX);
    memory.finish(image..image + world.viewport.pixels() as u64 * BYTES, &mut last.counts);
    counts += &last.counts;
    emit(&last, memory.log());
    Ok(counts)
}
