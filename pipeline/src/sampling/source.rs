//! Anything that says where and when each pixel looks.

use super::Sample;

/// A source of samples. A sample is a pure function of the source, the pixel and the index: workers ask for the same
/// ones again and again.
pub trait SampleSource: Send + Sync + std::fmt::Debug {
    /// Samples in each pixel, 1 to 256.
    fn per_pixel(&self) -> u32;

    /// Writes the samples of pixel (`px`, `py`), [`Self::per_pixel`] of them, into `into`.
    fn pixel_into(&self, px: u32, py: u32, into: &mut [Sample]);

    /// The samples of the block of 8x8 pixels that starts at (`px`, `py`) by time, where the source knows them: each as
    /// pixel in the block times `per_pixel` plus index in the pixel.
    fn block_by_time(&self, _px: u32, _py: u32) -> Option<&[u16]> {
        None
    }
}
