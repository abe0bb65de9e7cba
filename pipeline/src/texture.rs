//! Textures: mip chains with addresses, and filtering.

use std::sync::LazyLock;

use glam::{Vec2, Vec3, Vec4};

use crate::memory::LINE_BYTES;

/// Wrap mode: texture coordinates outside [0, 1].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// The texture repeats.
    #[default]
    Repeat,
    /// The texture repeats, every other copy mirrored.
    Mirror,
    /// The border texel continues.
    Clamp,
}

/// An image with its mip chain.
#[derive(Clone, Debug)]
pub struct Texture {
    levels: Vec<Level>,
    wrap: [Wrap; 2],
}

/// One level of a mip chain.
#[derive(Clone, Debug)]
struct Level {
    pub width: u32,
    pub height: u32,
    /// Blocks of 4x4 texels before this level in the chain, for addresses.
    pub first_block: u32,
    pub texels: Vec<[u8; 4]>,
}

/// Why a texture is invalid.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TextureError {
    /// A side is zero or above 16384 texels.
    #[error("a texture of {width} x {height} texels; each side has to be 1 to 16384")]
    Size {
        /// Width in texels.
        width: u32,
        /// Height in texels.
        height: u32,
    },
    /// The data does not match the size.
    #[error("{found} texels for an image of {expected}")]
    Length {
        /// Texels given.
        found: usize,
        /// Texels needed.
        expected: usize,
    },
}

impl Texture {
    /// A texture of `width` x `height` texels, rows from the top, each `[r, g, b, a]` with colour in sRGB and
    /// alpha linear. The mip chain averages 2x2 texels in linear light.
    ///
    /// # Errors
    /// [`TextureError`] if a side is zero or above 16384, or the data does not match the size.
    pub fn from_srgb8(
        width: u32,
        height: u32,
        texels: Vec<[u8; 4]>,
        wrap: [Wrap; 2],
    ) -> Result<Self, TextureError> {
        if !(1..=16_384).contains(&width) || !(1..=16_384).contains(&height) {
            return Err(TextureError::Size { width, height });
        }
        let expected = width as usize * height as usize;
        if texels.len() != expected {
            return Err(TextureError::Length { found: texels.len(), expected });
        }
        let mut levels = vec![Level { width, height, first_block: 0, texels }];
        while let Some(next) = levels.last().and_then(Level::halved) {
            levels.push(next);
        }
        Ok(Self { levels, wrap })
    }

    /// Width and height of the finest level in texels.
    pub fn size(&self) -> [u32; 2] {
        [self.levels[0].width, self.levels[0].height]
    }

    /// Bytes of the whole chain, stored in blocks of 4x4 texels.
    pub fn bytes(&self) -> u64 {
        self.levels.iter().map(|level| u64::from(level.blocks()) * 64).sum()
    }

    /// Bytes of the whole chain of a texture of `width` x `height` texels.
    pub fn bytes_of(mut width: u32, mut height: u32) -> u64 {
        let blocks = |width: u32, height: u32| u64::from(width.div_ceil(4)) * u64::from(height.div_ceil(4));
        let mut bytes = 64 * blocks(width, height);
        while width > 1 || height > 1 {
            (width, height) = ((width / 2).max(1), (height / 2).max(1));
            bytes += 64 * blocks(width, height);
        }
        bytes
    }

    /// Lowest alpha of all texels.
    pub fn min_alpha(&self) -> u8 {
        self.levels[0].texels.iter().map(|texel| texel[3]).min().unwrap_or(u8::MAX)
    }

    fn levels(&self) -> &[Level] {
        &self.levels
    }

    fn wrap(&self) -> [Wrap; 2] {
        self.wrap
    }
}

impl Level {
    fn halved(&self) -> Option<Self> {
        if self.width == 1 && self.height == 1 {
            return None;
        }
        let (width, height) = ((self.width / 2).max(1), (self.height / 2).max(1));
        let texels = (0..height)
            .flat_map(|y| (0..width).map(move |x| (x, y)))
            .map(|(x, y)| self.mean_of_four(2 * x, 2 * y))
            .collect();
        Some(Self { width, height, first_block: self.first_block + self.blocks(), texels })
    }

    fn blocks(&self) -> u32 {
        self.width.div_ceil(4) * self.height.div_ceil(4)
    }

    fn mean_of_four(&self, x: u32, y: u32) -> [u8; 4] {
        let corners = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(dx, dy)| {
            let (x, y) = ((x + dx).min(self.width - 1), (y + dy).min(self.height - 1));
            self.texels[(y * self.width + x) as usize]
        });
        std::array::from_fn(|channel| {
            if channel == 3 {
                let sum: u32 = corners.iter().map(|texel| u32::from(texel[3])).sum();
                ((sum + 2) / 4) as u8
            } else {
                let sum: f32 = corners.iter().map(|texel| srgb8_to_linear(texel[channel])).sum();
                linear_to_srgb8(sum / 4.0)
            }
        })
    }
}

/// Linear value of a code, and the value of a code of opacity.
static TO_LINEAR: LazyLock<[[f32; 2]; 256]> =
    LazyLock::new(|| std::array::from_fn(|code| [decode(code as f64), code as f32 / 255.0]));

fn decode(code: f64) -> f32 {
    let c = code / 255.0;
    (if c <= 0.040_45 { c / 12.92 } else { libm::pow((c + 0.055) / 1.055, 2.4) }) as f32
}

/// Linear value in [0, 1] of an 8-bit sRGB code (IEC 61966-2-1:1999). It uses `libm`, so bytes do not depend
/// on the machine.
pub fn srgb8_to_linear(code: u8) -> f32 {
    TO_LINEAR[code as usize][0]
}

/// Linear values half way between neighbouring codes.
static BORDERS: LazyLock<[f32; 255]> =
    LazyLock::new(|| std::array::from_fn(|code| decode(code as f64 + 0.5)));

/// Weights of the channels of linear sRGB in its luminance (IEC 61966-2-1).
pub const LUMINANCE: Vec3 = Vec3::new(0.2126, 0.7152, 0.0722);

/// Bits of a number that [`AT_LEAST`] leaves out.
const LEFT_OUT: u32 = 17;

/// Code of the smallest number with given leading bits, up to 1.
static AT_LEAST: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let smallest = (0..=1_f32.to_bits() >> LEFT_OUT).map(|leading| f32::from_bits(leading << LEFT_OUT));
    smallest.map(|linear| BORDERS.partition_point(|&border| border <= linear) as u8).collect()
});

/// Nearest 8-bit sRGB code of a linear value. Values outside [0, 1] are clamped, NaN becomes 0.
pub fn linear_to_srgb8(linear: f32) -> u8 {
    let linear = if linear > 0.0 { linear.min(1.0) } else { 0.0 };
    let known = AT_LEAST[(linear.to_bits() >> LEFT_OUT) as usize];
    let more = BORDERS[usize::from(known)..].iter().take_while(|&&border| border <= linear).count();
    known + more as u8
}

/// Side of the block of texels in a line; blocks of 4x4 let neighbours in both directions share lines.
const BLOCK: u32 = 4;

/// Level of detail as one or two mip levels and the weight of the coarser one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Footprint {
    pub(crate) fine: usize,
    pub(crate) coarse: usize,
    pub(crate) weight: f32,
}

impl Footprint {
    /// Footprint at a level of detail, 0 for the finest and `last` for the coarsest level; NaN is 0.
    pub(crate) fn at_lod(lod: f32, last: usize) -> Self {
        let lod = lod.max(0.0).min(last as f32);
        let fine = lod as usize;
        Self { fine, coarse: (fine + 1).min(last), weight: lod - fine as f32 }
    }
}

/// A texture at an address in memory.
#[derive(Clone, Copy, Debug)]
pub struct Sampler<'a> {
    texture: &'a Texture,
    address: u64,
}

impl<'a> Sampler<'a> {
    /// A sampler of `texture`, stored from byte `address`.
    pub fn new(texture: &'a Texture, address: u64) -> Self {
        Self { texture, address }
    }

    /// Footprint of a pixel whose neighbours are `dx` and `dy` away in texture coordinates. The longer of the
    /// two in texels decides (Williams 1983, with the conservative choice of OpenGL).
    pub fn footprint(&self, dx: Vec2, dy: Vec2) -> Footprint {
        let [width, height] = self.texture.size().map(|side| side as f32);
        let texels = |d: Vec2| (d * Vec2::new(width, height)).length();
        let longest = texels(dx).max(texels(dy));
        self.at_lod(if longest.is_finite() { libm::log2f(longest.max(1.0)) } else { f32::INFINITY })
    }

    /// Footprint at a level of detail, 0 for the finest level; NaN is 0.
    pub fn at_lod(&self, lod: f32) -> Footprint {
        Footprint::at_lod(lod, self.texture.levels().len() - 1)
    }

    /// Filtered texel at `uv` in linear RGBA.
    pub fn sample(&self, uv: Vec2, footprint: &Footprint) -> Vec4 {
        let level = |index: usize| self.bilinear(&self.texture.levels()[index], uv);
        let fine = level(footprint.fine);
        if footprint.weight == 0.0 { fine } else { fine.lerp(level(footprint.coarse), footprint.weight) }
    }

    /// Bilinear fetches of [`Self::sample`].
    pub fn fetches(footprint: &Footprint) -> u32 {
        1 + u32::from(footprint.weight != 0.0)
    }

    /// Call `each` with the address of every line that [`Self::sample`] reads; consecutive equal lines are
    /// merged.
    pub fn lines(&self, uv: Vec2, footprint: &Footprint, mut each: impl FnMut(u64)) {
        let mut previous = u64::MAX;
        let both = [footprint.fine, footprint.coarse];
        for &index in &both[..Self::fetches(footprint) as usize] {
            let level = &self.texture.levels()[index];
            for [x, y] in self.taps(level, uv).0 {
                let line = self.address + u64::from(level.first_block + block(level, x, y)) * LINE_BYTES;
                if line != previous {
                    each(line);
                }
                previous = line;
            }
        }
    }

    fn bilinear(&self, level: &Level, uv: Vec2) -> Vec4 {
        let (taps, fraction) = self.taps(level, uv);
        let values: &[[f32; 2]; 256] = &TO_LINEAR;
        let [a, b, c, d] = taps.map(|[x, y]| {
            let [r, g, b, alpha] = level.texels[(y * level.width + x) as usize].map(usize::from);
            Vec4::new(values[r][0], values[g][0], values[b][0], values[alpha][1])
        });
        a.lerp(b, fraction.x).lerp(c.lerp(d, fraction.x), fraction.y)
    }

    fn taps(&self, level: &Level, uv: Vec2) -> ([[u32; 2]; 4], Vec2) {
        taps([level.width, level.height], self.texture.wrap(), uv)
    }
}

/// The four texels around `uv` in an image of `size`, and the position between them.
pub(crate) fn taps(size: [u32; 2], wrap: [Wrap; 2], uv: Vec2) -> ([[u32; 2]; 4], Vec2) {
    let at = uv * Vec2::new(size[0] as f32, size[1] as f32) - Vec2::splat(0.5);
    let first = Vec2::new(floor(at.x), floor(at.y));
    let [x, y] = [(first.x, size[0], wrap[0]), (first.y, size[1], wrap[1])]
        .map(|(first, side, wrap)| both_wrapped(first, side, wrap));
    ([[x[0], y[0]], [x[1], y[0]], [x[0], y[1]], [x[1], y[1]]], at - first)
}

/// The floor, without a call on machines that have no instruction for it.
fn floor(value: f32) -> f32 {
    /// From here on all numbers are whole.
    const WHOLE: f32 = 8_388_608.0;
    let truncated = value as i32 as f32;
    if value.abs() < WHOLE { truncated - f32::from(truncated > value) } else { value }
}

fn block(level: &Level, x: u32, y: u32) -> u32 {
    y / BLOCK * level.width.div_ceil(BLOCK) + x / BLOCK
}

/// Texel `first` and the next one, wrapped into `0..side`.
#[inline]
fn both_wrapped(first: f32, side: u32, wrap: Wrap) -> [u32; 2] {
    let (texel, side) = (first as i64, i64::from(side));
    // Few fetches wrap.
    if texel >= 0 && texel < side - 1 {
        return [texel as u32, texel as u32 + 1];
    }
    [texel, texel.saturating_add(1)].map(|texel| wrapped(texel, side, wrap))
}

/// Texel wrapped into `0..side`.
fn wrapped(texel: i64, side: i64, wrap: Wrap) -> u32 {
    // Divisions are slow.
    let within =
        |count: i64| if count & (count - 1) == 0 { texel & (count - 1) } else { texel.rem_euclid(count) };
    let inside = match wrap {
        Wrap::Clamp => texel.clamp(0, side - 1),
        Wrap::Repeat => within(side),
        Wrap::Mirror => {
            let turn = within(2 * side);
            turn.min(2 * side - 1 - turn)
        }
    };
    inside as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_floor_is_that_of_the_standard_library() {
        let values =
            [0.0, 0.5, -0.5, 1.0, -1.0, 8_388_607.5, -8_388_607.5, 8_388_608.0, -3e38, f32::INFINITY];
        for value in values {
            assert_eq!(floor(value), value.floor(), "{value}");
        }
        assert!(floor(f32::NAN).is_nan());
    }

    #[test]
    fn the_chain_ends_at_one_texel() {
        let texture = Texture::from_srgb8(5, 3, vec![[10, 20, 30, 255]; 15], [Wrap::Repeat; 2]).unwrap();
        let sizes: Vec<_> = texture.levels().iter().map(|l| (l.width, l.height, l.first_block)).collect();
        assert_eq!(sizes, [(5, 3, 0), (2, 1, 2), (1, 1, 3)]);
        assert!(texture.levels().iter().all(|l| l.texels.iter().all(|t| *t == [10, 20, 30, 255])));
    }

    #[test]
    fn a_zero_area_image_is_refused() {
        assert!(Texture::from_srgb8(0, 4, vec![], [Wrap::Clamp; 2]).is_err());
        assert!(Texture::from_srgb8(2, 2, vec![[0; 4]; 3], [Wrap::Clamp; 2]).is_err());
    }

    #[test]
    fn every_code_survives_the_round_trip() {
        for code in 0..=255 {
            assert_eq!(linear_to_srgb8(srgb8_to_linear(code)), code);
        }
    }

    #[test]
    fn values_out_of_range_are_clamped() {
        assert_eq!(linear_to_srgb8(-1.0), 0);
        assert_eq!(linear_to_srgb8(7.0), 255);
        assert_eq!(linear_to_srgb8(f32::NAN), 0);
    }

    fn checker(wrap: Wrap) -> Texture {
        let texels =
            (0..16).map(|i| if (i % 4 + i / 4) % 2 == 0 { [255; 4] } else { [0, 0, 0, 255] }).collect();
        Texture::from_srgb8(4, 4, texels, [wrap; 2]).unwrap()
    }

    #[test]
    fn the_centre_of_a_texel_is_the_texel() {
        let texture = checker(Wrap::Repeat);
        let sampler = Sampler::new(&texture, 0);
        let sharp = sampler.footprint(Vec2::ZERO, Vec2::ZERO);
        assert_eq!(sampler.sample(Vec2::new(0.125, 0.125), &sharp).x, 1.0);
        assert_eq!(sampler.sample(Vec2::new(0.375, 0.125), &sharp).x, 0.0);
        assert_eq!(sampler.sample(Vec2::new(0.25, 0.125), &sharp).x, 0.5);
        assert_eq!(sampler.sample(Vec2::new(1.125, -0.875), &sharp).x, 1.0);
    }

    #[test]
    fn a_wide_footprint_is_the_mean() {
        let texture = checker(Wrap::Clamp);
        let sampler = Sampler::new(&texture, 0);
        let all = sampler.footprint(Vec2::new(1.0, 0.0), Vec2::new(0.0, 7.0));
        let mean = sampler.sample(Vec2::new(0.3, 0.9), &all);
        assert!((mean.x - 0.5).abs() < 0.01, "{mean}");
        assert_eq!(Sampler::fetches(&all), 1);
    }

    #[test]
    fn codes_change_at_the_borders() {
        let near = |border: &f32| [border.next_down(), *border, border.next_up()];
        let all = BORDERS.iter().flat_map(near).chain((0..5000).map(|step| step as f32 * 2.1e-4));
        for linear in all {
            let expected = BORDERS.partition_point(|&border| border <= linear) as u8;
            assert_eq!(linear_to_srgb8(linear), expected, "{linear}");
        }
        assert_eq!(linear_to_srgb8(-0.0), 0);
    }

    #[test]
    fn wrapping() {
        let inside = |wrap| [-5.0_f32, -1.0, 0.0, 3.0, 4.0, 9.0].map(|first| both_wrapped(first, 4, wrap)[0]);
        assert_eq!(inside(Wrap::Clamp), [0, 0, 0, 3, 3, 3]);
        assert_eq!(inside(Wrap::Repeat), [3, 3, 0, 3, 0, 1]);
        assert_eq!(inside(Wrap::Mirror), [3, 0, 0, 3, 3, 1]);
    }

    #[test]
    fn far_coordinates_do_not_overflow() {
        let texture = checker(Wrap::Mirror);
        let sampler = Sampler::new(&texture, 0);
        let footprint = sampler.footprint(Vec2::splat(f32::MAX), Vec2::splat(f32::NAN));
        assert!(sampler.sample(Vec2::splat(1e30), &footprint).is_finite());
    }

    #[test]
    fn one_block_is_one_line() {
        let texture = checker(Wrap::Clamp);
        let sampler = Sampler::new(&texture, 640);
        let mut lines = Vec::new();
        let sharp = sampler.footprint(Vec2::ZERO, Vec2::ZERO);
        sampler.lines(Vec2::splat(0.5), &sharp, |line| lines.push(line));
        assert_eq!(lines, [640]);
    }
}
