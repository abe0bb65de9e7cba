//! Surfaces as programs of groups read them.

use glam::Vec4;

use super::group::GroupLane;
use crate::buffer::{Buffer, BufferBinding};
use crate::surface::{Format, Layout, SurfaceSpec};

/// A surface that a pass stored, for programs of groups. Its words are where the pass wrote them, so that caches see the same
/// lines. Fixed functions decode values, as for the typed views of Direct3D 11.
#[derive(Clone, Copy, Debug)]
pub struct SurfaceView {
    words: Buffer<u32>,
    layout: Layout,
    format: Format,
    size: [u32; 2],
}

impl SurfaceView {
    /// A view of `words`, which are those of a surface with this layout.
    pub(crate) fn new(words: Buffer<u32>, layout: Layout, spec: &SurfaceSpec<'_>) -> Self {
        let size = [spec.viewport.width(), spec.viewport.height()];
        Self { words, layout, format: spec.format, size }
    }

    /// The surface, for a pass that reads it.
    pub fn reads(&self) -> BufferBinding {
        self.words.reads()
    }

    /// Width and height in pixels.
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// Samples per pixel.
    pub fn samples(&self) -> u32 {
        self.layout.samples
    }

    /// Address of a sample of a pixel; `None` outside of the image.
    pub fn address(&self, pixel: [u32; 2], sample: u32) -> Option<u64> {
        let is_inside = self.is_inside(pixel, sample);
        is_inside.then(|| self.layout.at(pixel, sample))
    }

    fn is_inside(&self, pixel: [u32; 2], sample: u32) -> bool {
        pixel[0] < self.size[0] && pixel[1] < self.size[1] && sample < self.samples()
    }

    /// First word of a sample; beyond all words outside of the image.
    fn index(&self, pixel: [u32; 2], sample: u32) -> u32 {
        if self.is_inside(pixel, sample) { self.layout.word(pixel, sample) } else { u32::MAX - 1 }
    }
}

impl GroupLane<'_, '_> {
    /// Value of a sample of a pixel, by a load of each of its words; 0 after a fault, as outside of the image.
    pub fn texel(&self, view: &SurfaceView, pixel: [u32; 2], sample: u32) -> Vec4 {
        let first = view.index(pixel, sample);
        let mut bytes = [0; Format::MAX_BYTES];
        for (word, to) in (first..).zip(bytes.chunks_exact_mut(4)).take(view.format.words() as usize) {
            to.copy_from_slice(&self.load(view.words, word).to_le_bytes());
        }
        view.format.decode(&bytes)
    }
}
