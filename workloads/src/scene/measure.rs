//! Where a scene is over all its frames, and the camera fitted to that.

use std::sync::Arc;

use activity::Warning;
use glam::DVec3;

use super::Scene;
use super::camera::{Rig, View};
use super::fit::{Extent, Fit};
use super::frame::FrameError;

/// Code of the warning that a fitted camera cannot hold a scene for the whole lens.
pub(super) const LENS_LEAVES_VIEW: &str = "lens-leaves-view";

/// The warning itself.
pub(crate) fn lens_leaves_view() -> Warning {
    let message = "the lens is so large for its focus depth that parts of the scene leave the view: the fitted camera only holds them for the centre of the lens";
    Warning::new(LENS_LEAVES_VIEW, message)
}

/// Frames looked at when a camera is fitted; longer runs are sampled evenly.
const FITTED_FRAMES: u32 = 256;

impl Scene {
    /// The middle of the first frame's bounds and, for a camera that wants it, a fit over all frames.
    pub(super) fn measure(&mut self) -> Result<(DVec3, Option<Fit>), FrameError> {
        let first = self.settings.frames.start;
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        self.visit_points(first, false, &mut |point| {
            low = low.min(point);
            high = high.max(point);
        })?;
        let centre = low + 0.5 * (high - low);
        if self.camera.rig != Rig::Fitted {
            return Ok((centre, None));
        }
        let aspect = f64::from(self.settings.width) / f64::from(self.settings.height);
        let View::Perspective { tan_half_height: tan } = self.camera.view else { return Ok((centre, None)) };
        let Some(mut extent) = Extent::new(tan * aspect, tan) else { return Ok((centre, None)) };
        for index in self.fitted_frames() {
            self.visit_points(index, index != first, &mut |point| extent.add(point))?;
        }
        let radius = f64::from(self.settings.lens_radius);
        let fit = extent.fit((radius > 0.0).then(|| (radius, self.settings.focus.map(f64::from))));
        if fit.is_some_and(|fit| !fit.holds_lens) {
            self.warnings.push(lens_leaves_view());
        }
        Ok((centre, fit))
    }

    fn fitted_frames(&self) -> Vec<u32> {
        let frames = &self.settings.frames;
        let count = frames.end - frames.start;
        let looked_at = count.min(FITTED_FRAMES);
        let last = u64::from(looked_at.max(2) - 1);
        let nth = |i: u32| frames.start + (u64::from(i) * u64::from(count - 1) / last) as u32;
        (0..looked_at).map(nth).collect()
    }

    /// Calls `visit` with every vertex at both ends of a frame's shutter.
    fn visit_points(
        &self,
        frame: u32,
        only_moving: bool,
        visit: &mut impl FnMut(DVec3),
    ) -> Result<(), FrameError> {
        let interval = self.interval(frame);
        for (index, instance) in self.graph.instances.iter().enumerate() {
            if only_moving && !self.moving[index] || self.graph.meshes[instance.mesh].triangles.is_empty() {
                continue;
            }
            let (open, close) = interval.path(self, *instance)?;
            open.iter().for_each(|point| visit(point.as_dvec3()));
            if !Arc::ptr_eq(&open, &close) {
                close.iter().for_each(|point| visit(point.as_dvec3()));
            }
        }
        Ok(())
    }
}
