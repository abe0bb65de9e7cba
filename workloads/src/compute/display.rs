//! Programs that write the image: a tone map, an equalised image, and a heat map of lights.

use glam::{Vec3, Vec4};
use pipeline::surface::Format;
use pipeline::texture::LUMINANCE;
use pipeline::{Buffer, Group, GroupLane, GroupShader, SurfaceView};

use super::block::Blocks;
use super::histogram::bin;

/// What a pixel of the image shows.
pub(super) enum Show {
    /// Colours exposed for this mean luminance, and compressed (Reinhard et al. 2002, equation 3).
    Exposed(Buffer<f32>),
    /// The same for the luminance of the only texel of a level.
    ExposedBy(SurfaceView),
    /// Colours whose luminance is the share of values up to their bin, by sums over bins.
    Equalised(Buffer<u32>),
    /// Counts of the tiles of these blocks over the largest, as the colours of a hot body, over the image in grey.
    Heat { counts: Buffer<u32>, most: Buffer<u32>, tiles: Blocks },
}

/// Luminance to which the mean is exposed.
const KEY: f32 = 0.18;
/// Least luminance that is exposed.
const DARKEST: f32 = 1e-4;

/// Writes the image.
pub(super) struct Display {
    pub image: SurfaceView,
    pub blocks: Blocks,
    pub show: Show,
    /// A word for each pixel, in [`FORMAT`].
    pub out: Buffer<u32>,
}

/// Format of the image.
const FORMAT: Format = Format::Rgba8Srgb;

/// Colours of an image in [`FORMAT`].
pub(super) fn decoded(words: &[u32]) -> Vec<Vec3> {
    words.iter().map(|word| FORMAT.decode(&word.to_le_bytes()).truncate()).collect()
}

/// An encoded colour. Fixed functions do it, as for typed stores.
fn encoded(color: Vec3) -> u32 {
    let bytes = FORMAT.encode(Vec4::from((color, 1.0)));
    u32::from_le_bytes(std::array::from_fn(|byte| bytes[byte]))
}

impl GroupShader for Display {
    fn run(&self, group: &mut Group<'_>) {
        let (id, size, width) = (group.id(), group.size(), self.image.size()[0]);
        group.lanes(|lane| {
            self.blocks.pixels(lane, id, size, |pixel| {
                let color = self.show.color(lane, pixel, self.mean(lane, pixel));
                lane.store(self.out, lane.madd(pixel[1], width, pixel[0]), encoded(color));
            });
        });
    }
}

impl Display {
    fn mean(&self, lane: &GroupLane<'_, '_>, pixel: [u32; 2]) -> Vec3 {
        let samples = self.image.samples();
        let color = |sample| lane.texel(&self.image, pixel, sample).truncate();
        let sum = (1..samples).fold(color(0), |sum, sample| lane.add(sum, color(sample)));
        if samples == 1 { sum } else { lane.scale(sum, 1.0 / samples as f32) }
    }
}

/// A colour exposed for a mean luminance.
fn exposed(lane: &GroupLane<'_, '_>, color: Vec3, mean: f32) -> Vec3 {
    let exposure = lane.mul(KEY, lane.recip(lane.max(mean, DARKEST)));
    let exposed = lane.scale(color, exposure);
    let over = lane.add(Vec3::ONE, exposed).to_array().map(|part| lane.recip(part));
    lane.mul(exposed, Vec3::from(over))
}

impl Show {
    fn color(&self, lane: &GroupLane<'_, '_>, pixel: [u32; 2], color: Vec3) -> Vec3 {
        match self {
            Self::Exposed(mean) => exposed(lane, color, lane.load(*mean, 0)),
            Self::ExposedBy(level) => {
                exposed(lane, color, lane.dot(lane.texel(level, [0; 2], 0).truncate(), LUMINANCE))
            }
            Self::Equalised(sums) => {
                let luminance = lane.dot(color, LUMINANCE);
                let [below, all] =
                    [bin(lane, luminance, sums.len()), sums.len() - 1].map(|bin| lane.load(*sums, bin));
                let share = lane.mul(below as f32, lane.recip(all as f32));
                lane.scale(color, lane.mul(share, lane.recip(lane.max(luminance, DARKEST))))
            }
            Self::Heat { counts, most, tiles } => {
                // The sizes of tiles are powers of two.
                let at = [0, 1].map(|axis| lane.shift_right(pixel[axis], tiles.block[axis].ilog2()));
                let count = lane.load(*counts, lane.madd(at[1], tiles.groups()[0], at[0]));
                let most: u32 = lane.load(*most, 0);
                let share = lane.mul(count as f32, lane.recip(lane.max(most as f32, 1.0)));
                let hot = [0.0, 1.0, 2.0].map(|from| lane.saturate(lane.madd(3.0, share, -from)));
                let grey = lane.mul(0.5, lane.dot(color, LUMINANCE));
                lane.madd(Vec3::from(hot), Vec3::splat(0.7), Vec3::splat(grey))
            }
        }
    }
}
