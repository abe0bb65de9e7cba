//! Trilinear filtering, and the memory lines it reads.

use glam::{Vec2, Vec4};

use super::image::Level;
use super::{Texture, Wrap, srgb8_to_linear};
use crate::memory::LINE_BYTES;

/// Side of the block of texels in a line; blocks of 4x4 let neighbours in both directions share lines.
const BLOCK: u32 = 4;

/// Level of detail as one or two mip levels and the weight of the coarser one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Footprint {
    fine: usize,
    coarse: usize,
    weight: f32,
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
        let last = self.texture.levels().len() - 1;
        let longest = texels(dx).max(texels(dy));
        let lod =
            if longest.is_finite() { libm::log2f(longest.max(1.0)).min(last as f32) } else { last as f32 };
        let fine = lod as usize;
        Footprint { fine, coarse: (fine + 1).min(last), weight: lod - fine as f32 }
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
        let [a, b, c, d] = taps.map(|[x, y]| {
            let [r, g, b, alpha] = level.texels[(y * level.width + x) as usize];
            Vec4::new(srgb8_to_linear(r), srgb8_to_linear(g), srgb8_to_linear(b), f32::from(alpha) / 255.0)
        });
        a.lerp(b, fraction.x).lerp(c.lerp(d, fraction.x), fraction.y)
    }

    /// The four texels around `uv` and the position between them.
    fn taps(&self, level: &Level, uv: Vec2) -> ([[u32; 2]; 4], Vec2) {
        let [wrap_x, wrap_y] = self.texture.wrap();
        let at = uv * Vec2::new(level.width as f32, level.height as f32) - Vec2::splat(0.5);
        let first = at.floor();
        let x = [0, 1].map(|step| wrapped(first.x, step, level.width, wrap_x));
        let y = [0, 1].map(|step| wrapped(first.y, step, level.height, wrap_y));
        ([[x[0], y[0]], [x[1], y[0]], [x[0], y[1]], [x[1], y[1]]], at - first)
    }
}

fn block(level: &Level, x: u32, y: u32) -> u32 {
    y / BLOCK * level.width.div_ceil(BLOCK) + x / BLOCK
}

/// Texel `first + step` wrapped into `0..side`.
fn wrapped(first: f32, step: i64, side: u32, wrap: Wrap) -> u32 {
    let (texel, side) = ((first as i64).saturating_add(step), i64::from(side));
    let inside = match wrap {
        Wrap::Clamp => texel.clamp(0, side - 1),
        Wrap::Repeat => texel.rem_euclid(side),
        Wrap::Mirror => {
            let turn = texel.rem_euclid(2 * side);
            turn.min(2 * side - 1 - turn)
        }
    };
    inside as u32
}

#[cfg(test)]
mod tests {
    use super::*;

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
    fn wrapping() {
        let inside = |wrap| [-5.0_f32, -1.0, 0.0, 3.0, 4.0, 9.0].map(|first| wrapped(first, 0, 4, wrap));
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
