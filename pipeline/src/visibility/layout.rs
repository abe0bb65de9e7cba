//! Layout of samples in packets, computed before any triangle is known.

use rayon::prelude::*;

use super::bin::BinSamples;
use super::sorter::{Plan, Sorter};
use crate::geometry::{Camera, Projection, Viewport};
use crate::sampling::SampleSource;

/// Samples of an image, divided in the dimensions in use and ready to be tested against triangles.
#[derive(Clone, Debug)]
pub struct SampleLayout {
    pub(super) viewport: Viewport,
    pub(super) per_pixel: u32,
    pub(super) projection: Projection,
    pub(super) plan: Plan,
    pub(super) bins: Vec<BinSamples>,
}

impl SampleLayout {
    /// Sort the samples of `source` for the view of `camera` in `viewport`. `moving` says whether triangles
    /// may move; otherwise time is not divided. Samples outside the clip planes of the camera see nothing.
    /// `None` for an orthographic camera, which the engine does not support.
    pub fn new(camera: &Camera, viewport: Viewport, source: &dyn SampleSource, moving: bool) -> Option<Self> {
        if camera.is_orthographic() {
            return None;
        }
        let projection = Projection::new(camera, viewport);
        let per_pixel = source.per_pixel();
        let plan = Plan::new(per_pixel, moving, !projection.shear.is_none());
        let across = viewport.width().div_ceil(plan.bin_px);
        let down = viewport.height().div_ceil(plan.bin_px);
        let bins = (0..across * down)
            .into_par_iter()
            .map(|bin| {
                let origin = [bin % across * plan.bin_px, bin / across * plan.bin_px];
                Sorter { viewport, source, shear: &projection.shear, plan: &plan, clip: camera.clip() }
                    .bin(origin)
            })
            .collect();
        Some(Self { viewport, per_pixel, projection, plan, bins })
    }

    /// Number of samples of the image.
    pub fn samples(&self) -> usize {
        self.viewport.pixels() * self.per_pixel as usize
    }

    /// Index in the image of the sample with index `sample_index` of a bin, if it exists.
    pub(super) fn in_image(&self, bin: &BinSamples, sample_index: u32) -> Option<usize> {
        if sample_index == BinSamples::NO_SAMPLE {
            return None;
        }
        let (pixel, index) = (sample_index / self.per_pixel, sample_index % self.per_pixel);
        let [x, y] = [bin.origin[0] + pixel % self.plan.bin_px, bin.origin[1] + pixel / self.plan.bin_px];
        let pixel = y as usize * self.viewport.width() as usize + x as usize;
        Some(pixel * self.per_pixel as usize + index as usize)
    }
}
