//! Bindings of a draw as its shader reads them: textures, and surfaces and buffers of earlier passes.

use std::sync::Arc;

use glam::{Vec2, Vec4};

use super::{Layout, Texels};
use crate::buffer::BoundBuffer;
use crate::memory::LINE_BYTES;
use crate::texture::{Footprint, Sampler, Wrap, taps};

/// What a shader reads in one of its slots.
#[derive(Clone, Debug)]
pub struct Bound<'a>(Source<'a>);

#[derive(Clone, Debug)]
enum Source<'a> {
    Texture(Sampler<'a>),
    /// Levels, from the finest.
    Surface(Vec<(Arc<Texels>, Layout)>),
    Buffer(BoundBuffer),
}

impl<'a> Bound<'a> {
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

    /// The word of buffer `number` at `index`, and the address of its line; `None` if another one is bound here, or beyond it.
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

/// Mean of the two levels next to `lod`, as of a texture, and the number of bilinear fetches. Levels that are not filtered are not
/// mixed: the nearest is read.
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

/// Mean of the four texels around `uv` by their distance; border texels continue. Integers, depths and surfaces of several
/// samples are not filtered: the nearest texel, the first sample.
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
    use super::super::{Format, SurfaceSpec};
    use super::*;
    use crate::viewport::Viewport;

    fn ramp(format: Format) -> Bound<'static> {
        let spec = SurfaceSpec::new("ramp", Viewport::new(16, 4).unwrap(), format);
        let mut texels = Texels::filled(&spec, Vec4::ZERO);
        (0..64).for_each(|index| texels.set(index, Vec4::splat((index % 16) as f32)));
        Bound::surface(vec![(Arc::new(texels), Layout::new(&spec, 8, 1024).0)])
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
