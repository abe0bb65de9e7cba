//! A texture as stored: 8-bit RGBA in sRGB, with its mip chain.

/// What happens outside [0, 1].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// The texture repeats.
    #[default]
    Repeat,
    /// The texture repeats, every other copy mirrored.
    Mirror,
    /// The border texel goes on.
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

/// Why a texture cannot be built.
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
    /// The data does not fill the image.
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
    /// alpha linear. The mip chain is made by averaging 2x2 texels in linear light.
    ///
    /// # Errors
    /// When a side is zero or above 16384, or the data does not fill the image.
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

    /// The lowest alpha of any texel.
    pub fn least_alpha(&self) -> u8 {
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
                let sum: f32 = corners.iter().map(|texel| super::srgb8_to_linear(texel[channel])).sum();
                super::linear_to_srgb8(sum / 4.0)
            }
        })
    }
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
}
