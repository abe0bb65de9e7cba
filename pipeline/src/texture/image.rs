//! Stored textures: 8-bit RGBA in sRGB with a mip chain, and the sRGB transfer function.

use std::sync::LazyLock;

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
pub(super) struct Level {
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

    /// Lowest alpha of all texels.
    pub fn min_alpha(&self) -> u8 {
        self.levels[0].texels.iter().map(|texel| texel[3]).min().unwrap_or(u8::MAX)
    }

    pub(super) fn levels(&self) -> &[Level] {
        &self.levels
    }

    pub(super) fn wrap(&self) -> [Wrap; 2] {
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

static TO_LINEAR: LazyLock<[f32; 256]> = LazyLock::new(|| std::array::from_fn(|code| decode(code as f64)));

fn decode(code: f64) -> f32 {
    let c = code / 255.0;
    (if c <= 0.040_45 { c / 12.92 } else { libm::pow((c + 0.055) / 1.055, 2.4) }) as f32
}

/// Linear value in [0, 1] of an 8-bit sRGB code (IEC 61966-2-1:1999). It uses `libm`, so bytes do not depend
/// on the machine.
pub fn srgb8_to_linear(code: u8) -> f32 {
    TO_LINEAR[code as usize]
}

/// Linear values half way between neighbouring codes.
static BORDERS: LazyLock<[f32; 255]> =
    LazyLock::new(|| std::array::from_fn(|code| decode(code as f64 + 0.5)));

/// Nearest 8-bit sRGB code of a linear value. Values outside [0, 1] are clamped, NaN becomes 0.
pub fn linear_to_srgb8(linear: f32) -> u8 {
    BORDERS.partition_point(|&border| border <= linear) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

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
}
