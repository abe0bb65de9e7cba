//! Size of an image.

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
