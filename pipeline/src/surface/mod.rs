//! Surfaces: named images of a frame that passes write and later ones read, in a [`Format`], with one or more
//! samples per pixel. What is read is what the format kept. A shader reads textures, surfaces and buffers
//! through [`BoundSlot`].

mod format;

use std::sync::Arc;

use glam::{Vec2, Vec4};

use crate::buffer::BoundBuffer;
use crate::memory::LINE_BYTES;
use crate::texture::{Footprint, Sampler, Wrap, taps};

pub use format::Format;

/// Largest number of colour targets of a pass.
pub const MAX_TARGETS: usize = 4;

/// Image size in pixels; both sides are 1 to 16384.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Viewport {
    width: u32,
    height: u32,
}

impl Viewport {
    /// Longest side of an image in pixels.
    pub const MAX_PX: u32 = 16_384;

    /// A viewport of `width` x `height` pixels, or `None` if a side is zero or above [`Self::MAX_PX`].
    pub fn new(width: u32, height: u32) -> Option<Self> {
        let fits = |side| (1..=Self::MAX_PX).contains(&side);
        (fits(width) && fits(height)).then_some(Self { width, height })
    }

    /// Width in pixels.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Height in pixels.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// Half the size in pixels: the largest |X| and |Y| of an image coordinate.
    pub fn half_px(&self) -> [f32; 2] {
        [0.5 * self.width as f32, 0.5 * self.height as f32]
    }

    /// Number of pixels.
    pub fn pixels(&self) -> usize {
        self.width as usize * self.height as usize
    }

    /// Image coordinate of the left edge of pixel column `px`, or of the top edge of a row with the height as
    /// `side`. The origin is the centre of the image, for any tile size, and the value is exact.
    pub(crate) fn edge(px: u32, side: u32) -> f32 {
        px as f32 - 0.5 * side as f32
    }
}

/// A surface before it has an address.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SurfaceSpec<'a> {
    /// Name in messages.
    pub name: &'a str,
    /// Size in pixels.
    pub viewport: Viewport,
    /// Format of a sample.
    pub format: Format,
    /// Samples per pixel.
    pub samples: u32,
    /// Levels of its mip chain, 1 for none.
    pub levels: u32,
}

impl<'a> SurfaceSpec<'a> {
    /// A surface with one sample per pixel and one level.
    pub fn new(name: &'a str, viewport: Viewport, format: Format) -> Self {
        Self { name, viewport, format, samples: 1, levels: 1 }
    }

    /// The surface with a chain of `levels`, at least one and at most down to a pixel. Each is half as wide
    /// and high as the one before, rounded down.
    #[must_use]
    pub fn with_levels(self, levels: u32) -> Self {
        let most = self.viewport.width().max(self.viewport.height()).ilog2() + 1;
        Self { levels: levels.clamp(1, most), ..self }
    }

    /// The surface with a chain down to one pixel.
    #[must_use]
    pub fn mipmapped(self) -> Self {
        self.with_levels(u32::MAX)
    }

    /// Size of a level; `None` beyond the last.
    pub fn size_of(&self, level: u32) -> Option<Viewport> {
        let side = |side: u32| (side >> level).max(1);
        let is_there = level < self.levels;
        is_there.then(|| Viewport::new(side(self.viewport.width()), side(self.viewport.height())))?
    }

    /// The surface with `samples` per pixel.
    #[must_use]
    pub fn sampled(self, samples: u32) -> Self {
        Self { samples, ..self }
    }
}

/// Contents of a surface: every sample as its format keeps it, in the order `(y width + x) samples + index`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Texels {
    viewport: Viewport,
    format: Format,
    samples: u32,
    bytes: Vec<u8>,
}

impl Texels {
    /// All samples hold `value`.
    pub fn filled(spec: &SurfaceSpec<'_>, value: Vec4) -> Self {
        let SurfaceSpec { viewport, format, samples, .. } = *spec;
        let bytes =
            format.encode(value)[..format.bytes() as usize].repeat(viewport.pixels() * samples as usize);
        Self { viewport, format, samples, bytes }
    }

    /// Value of the sample with this index.
    pub fn get(&self, index: usize) -> Vec4 {
        let bytes = self.format.bytes() as usize;
        self.format.decode(&self.bytes[index * bytes..])
    }

    /// Stores the sample with this index.
    pub fn set(&mut self, index: usize, value: Vec4) {
        let bytes = self.format.bytes() as usize;
        self.bytes[index * bytes..][..bytes].copy_from_slice(&self.format.encode(value)[..bytes]);
    }

    /// All values in order.
    pub fn values(&self) -> Vec<Vec4> {
        self.bytes.chunks_exact(self.format.bytes() as usize).map(|bytes| self.format.decode(bytes)).collect()
    }

    /// The words of all samples where `layout` has them; 0 in between.
    pub fn words(&self, layout: &Layout, count: usize) -> Vec<u32> {
        let (mut words, per_sample) = (vec![0; count], self.format.words() as usize);
        for (number, sample) in self.bytes.chunks_exact(4 * per_sample).enumerate() {
            let [pixel, index] = [number / self.samples as usize, number % self.samples as usize];
            let [width, pixel] = [self.viewport.width(), pixel as u32];
            let first = layout.word([pixel % width, pixel / width], index as u32) as usize;
            let of_sample = sample.chunks_exact(4).map(|word| std::array::from_fn(|byte| word[byte]));
            words[first..][..per_sample]
                .iter_mut()
                .zip(of_sample)
                .for_each(|(to, bytes)| *to = u32::from_le_bytes(bytes));
        }
        words
    }

    /// Value of a sample of a pixel; `None` outside.
    pub fn at(&self, [x, y]: [i32; 2], sample: u32) -> Option<Vec4> {
        let [x, y] = [u32::try_from(x).ok()?, u32::try_from(y).ok()?];
        let is_inside = x < self.viewport.width() && y < self.viewport.height() && sample < self.samples;
        let pixel = y as usize * self.viewport.width() as usize + x as usize;
        is_inside.then(|| self.get(pixel * self.samples as usize + sample as usize))
    }

    pub fn format(&self) -> Format {
        self.format
    }

    pub fn samples(&self) -> u32 {
        self.samples
    }

    pub fn viewport(&self) -> Viewport {
        self.viewport
    }

    pub fn size(&self) -> [u32; 2] {
        [self.viewport.width(), self.viewport.height()]
    }
}

/// Addresses of the samples of a surface: tile by tile, pixel by pixel in rows of the tile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    /// First byte.
    pub address: u64,
    /// Side of a tile in pixels.
    pub tile_px: u32,
    /// Tiles in a row.
    pub tiles_across: u32,
    /// Samples per pixel.
    pub samples: u32,
    /// Bytes of a sample.
    pub bytes: u64,
}

impl Layout {
    /// Layout of a surface from `address` on, and its size in bytes, with the last tiles whole.
    pub fn new(spec: &SurfaceSpec<'_>, tile_px: u32, address: u64) -> (Self, u64) {
        let [across, down] =
            [spec.viewport.width(), spec.viewport.height()].map(|side| side.div_ceil(tile_px));
        let (samples, bytes) = (spec.samples, spec.format.bytes());
        let pixels = u64::from(across) * u64::from(down) * u64::from(tile_px * tile_px);
        (Self { address, tile_px, tiles_across: across, samples, bytes }, pixels * u64::from(samples) * bytes)
    }

    /// Address of a sample of a pixel inside.
    pub fn at(&self, [x, y]: [u32; 2], sample: u32) -> u64 {
        let side = self.tile_px;
        let tile = u64::from(y / side) * u64::from(self.tiles_across) + u64::from(x / side);
        let pixel = tile * u64::from(side * side) + u64::from(y % side * side + x % side);
        self.address + (pixel * u64::from(self.samples) + u64::from(sample)) * self.bytes
    }

    /// Number of the first word of 32 bits of a sample of a pixel inside.
    pub fn word(&self, pixel: [u32; 2], sample: u32) -> u32 {
        ((self.at(pixel, sample) - self.address) / 4) as u32
    }
}

/// What a shader reads in one of its slots.
#[derive(Clone, Debug)]
pub struct BoundSlot<'a>(Source<'a>);

#[derive(Clone, Debug)]
enum Source<'a> {
    Texture(Sampler<'a>),
    /// Levels, from the finest.
    Surface(Vec<(Arc<Texels>, Layout)>),
    Buffer(BoundBuffer),
}

impl<'a> BoundSlot<'a> {
    /// A texture in memory.
    pub(crate) fn texture(sampler: Sampler<'a>) -> Self {
        Self(Source::Texture(sampler))
    }

    /// Levels of a surface that earlier passes wrote, from the finest.
    pub(crate) fn surface(levels: Vec<(Arc<Texels>, Layout)>) -> Self {
        Self(Source::Surface(levels))
    }

    /// Words of a buffer.
    pub(crate) fn buffer(words: BoundBuffer) -> Self {
        Self(Source::Buffer(words))
    }

    /// The word of buffer `number` at `index`, and the address of its line; `None` if another one is bound
    /// here, or beyond it.
    pub(crate) fn word(&self, number: u32, index: u32) -> Option<(u32, u64)> {
        let Source::Buffer(words) = &self.0 else { return None };
        words.word(number, index).map(|(word, address)| (word, address / LINE_BYTES * LINE_BYTES))
    }

    /// Filtered texel at `uv`, and the number of bilinear fetches. `line` gets every line that is read.
    pub(crate) fn fetch(&self, uv: Vec2, lod: f32, mut line: impl FnMut(u64)) -> (Vec4, u32) {
        match &self.0 {
            Source::Texture(sampler) => {
                let footprint = sampler.at_lod(lod);
                sampler.lines(uv, &footprint, line);
                (sampler.sample(uv, &footprint), Sampler::fetches(&footprint))
            }
            Source::Surface(levels) => trilinear(levels, uv, lod, &mut line),
            Source::Buffer(_) => (Vec4::ZERO, 0),
        }
    }

    /// Unfiltered sample of a pixel; zero outside of a surface and for others.
    pub(crate) fn load(&self, pixel: [i32; 2], sample: u32, mut line: impl FnMut(u64)) -> Vec4 {
        let Source::Surface(levels) = &self.0 else { return Vec4::ZERO };
        let Some((texels, layout)) = levels.first() else { return Vec4::ZERO };
        let Some(value) = texels.at(pixel, sample) else { return Vec4::ZERO };
        line(layout.at(pixel.map(|part| part as u32), sample) / LINE_BYTES * LINE_BYTES);
        value
    }
}

/// Mean of the two levels next to `lod`, as of a texture, and the number of bilinear fetches. Levels that are
/// not filtered are not mixed: the nearest is read.
fn trilinear(
    levels: &[(Arc<Texels>, Layout)],
    uv: Vec2,
    lod: f32,
    line: &mut impl FnMut(u64),
) -> (Vec4, u32) {
    let Some(last) = levels.len().checked_sub(1) else { return (Vec4::ZERO, 0) };
    let Footprint { fine, coarse, weight } = Footprint::at_lod(lod, last);
    let mut level = |index: usize| bilinear(&levels[index].0, &levels[index].1, uv, &mut *line);
    if !is_filtered(&levels[0].0) {
        return (level(if weight < 0.5 { fine } else { coarse }), 1);
    }
    let first = level(fine);
    if weight == 0.0 { (first, 1) } else { (first.lerp(level(coarse), weight), 2) }
}

fn is_filtered(texels: &Texels) -> bool {
    texels.format().can_blend() && texels.samples() == 1
}

/// Mean of the four texels around `uv` by their distance; border texels continue. Integers, depths and
/// surfaces of several samples are not filtered: the nearest texel, the first sample.
fn bilinear(texels: &Texels, layout: &Layout, uv: Vec2, mut line: impl FnMut(u64)) -> Vec4 {
    let (around, fraction) = taps(texels.size(), [Wrap::Clamp; 2], uv);
    let is_filtered = is_filtered(texels);
    let nearest = usize::from(fraction.x >= 0.5) + 2 * usize::from(fraction.y >= 0.5);
    let mut previous = u64::MAX;
    let mut read = |[x, y]: [u32; 2]| {
        let at = layout.at([x, y], 0) / LINE_BYTES * LINE_BYTES;
        if at != previous {
            line(at);
        }
        previous = at;
        texels.at([x as i32, y as i32], 0).unwrap_or_default()
    };
    if !is_filtered {
        return read(around[nearest]);
    }
    let [a, b, c, d] = around.map(&mut read);
    a.lerp(b, fraction.x).lerp(c.lerp(d, fraction.x), fraction.y)
}

#[cfg(test)]
mod tests {
    use super::{Format, SurfaceSpec, *};

    #[test]
    fn every_sample_has_its_own_bytes() {
        let spec = SurfaceSpec::new("s", Viewport::new(10, 5).unwrap(), Format::Rg32f).sampled(3);
        let (layout, bytes) = Layout::new(&spec, 4, 640);
        assert_eq!(bytes, 3 * 2 * 16 * 3 * 8);
        let pixels = (0..5).flat_map(|y| (0..10).map(move |x| [x, y]));
        let mut all: Vec<u64> = pixels.flat_map(|at| (0..3).map(move |s| layout.at(at, s))).collect();
        all.sort_unstable();
        assert!(all.windows(2).all(|two| two[1] - two[0] >= 8) && all[0] == 640);
        assert!(all.last().is_some_and(|last| last + 8 <= 640 + bytes));
    }

    #[test]
    fn samples_are_read_as_stored_and_nothing_is_outside() {
        let spec = SurfaceSpec::new("s", Viewport::new(3, 2).unwrap(), Format::R32f).sampled(2);
        let mut texels = Texels::filled(&spec, Vec4::splat(0.25));
        texels.set((3 + 2) * 2 + 1, Vec4::splat(7.0));
        assert_eq!(texels.at([2, 1], 1), Some(Vec4::new(7.0, 0.0, 0.0, 1.0)));
        assert_eq!(texels.at([2, 1], 0), Some(Vec4::new(0.25, 0.0, 0.0, 1.0)));
        assert_eq!([texels.at([3, 1], 0), texels.at([-1, 0], 0), texels.at([0, 0], 2)], [None; 3]);
        assert_eq!(texels.values().len(), 12);
        let (layout, bytes) = Layout::new(&spec, 2, 64);
        let words = texels.words(&layout, bytes as usize / 4);
        assert_eq!(words.iter().filter(|word| **word == 0.25_f32.to_bits()).count(), 11);
        // The third pixel of the second row is the third of the second tile.
        assert_eq!((words.len(), words[2 * (4 + 2) + 1]), (16, 7.0_f32.to_bits()));
    }

    fn ramp(format: Format) -> BoundSlot<'static> {
        let spec = SurfaceSpec::new("ramp", Viewport::new(16, 4).unwrap(), format);
        let mut texels = Texels::filled(&spec, Vec4::ZERO);
        (0..64).for_each(|index| texels.set(index, Vec4::splat((index % 16) as f32)));
        BoundSlot::surface(vec![(Arc::new(texels), Layout::new(&spec, 8, 1024).0)])
    }

    fn lines(read: impl FnOnce(&mut dyn FnMut(u64)) -> Vec4) -> (f32, Vec<u64>) {
        let mut lines = Vec::new();
        let value = read(&mut |line| lines.push(line));
        (value.x, lines)
    }

    #[test]
    fn loads_read_one_line_and_fetches_up_to_four() {
        let ramp = ramp(Format::R32f);
        assert_eq!(lines(|line| ramp.load([9, 1], 0, line)), (9.0, vec![1024 + 256]));
        assert_eq!(lines(|line| ramp.load([16, 1], 0, line)), (0.0, vec![]));
        let (value, read) = lines(|line| ramp.fetch(Vec2::new(0.5, 0.5), 0.0, line).0);
        // Between columns 7 and 8, the last and the first of two tiles.
        assert_eq!((value, read.len()), (7.5, 4));
        assert_eq!(lines(|line| ramp.fetch(Vec2::splat(-3.0), 5.0, line).0), (0.0, vec![1024]));
    }

    #[test]
    fn integers_are_not_filtered() {
        let (value, read) = lines(|line| ramp(Format::R32u).fetch(Vec2::new(0.49, 0.5), 0.0, line).0);
        assert_eq!((value, read.len()), (7.0, 1));
    }
}
