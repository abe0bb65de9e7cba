//! Where a scene is over all its frames, the camera placed for that, and the warnings of placing it.

use std::ops::Range;
use std::sync::Arc;

use glam::DVec3;
use warnings::{Code, Warning};

use super::Scene;
use super::camera::{Extent, Fit, Frustum, Rig, Side};
use super::frame::FrameError;
use super::inside::Inside;
use super::settings::LAST_FRAME;

/// Codes of the warnings that placing a camera gives; they hold for the settings of that time.
pub(super) const CODES: [Code; 3] = [Code::LensLeavesView, Code::LeavesFittedView, Code::CameraInside];

/// Triangles of a scene above which it is not looked at whether it is a room: that takes 72 bytes a triangle.
const MAX_ROOM_TRIANGLES: usize = 4_000_000;

fn camera_inside(room: &Inside) -> Warning {
    let message = format!(
        "{:.0} % of the scene's surface is enclosed by the rest of it, so the camera stands inside; `--camera outside` shows the \
         scene from outside",
        100.0 * room.enclosed
    );
    Warning::new(Code::CameraInside, message)
}

/// A camera that was placed by itself.
#[derive(Clone, Copy, Debug)]
pub(super) struct Placed {
    pub fit: Fit,
    pub view: Frustum,
    /// Side from which the camera sees the scene.
    pub side: Side,
}

/// The warning itself.
pub(crate) fn lens_leaves_view() -> Warning {
    let message = "the lens is so large for its focus depth that parts of the scene leave the view: the fitted camera only holds them for the centre of the lens";
    Warning::new(Code::LensLeavesView, message)
}

fn leaves_fitted_view(fitted: &Range<u32>) -> Warning {
    let message = format!(
        "parts of the scene leave the view in the requested frames: the fitted camera holds them in the scene's own frames, {} to \
         {}; give the scene a `camera`, or set its `frames`",
        fitted.start,
        fitted.end - 1
    );
    Warning::new(Code::LeavesFittedView, message)
}

/// Frames looked at when a camera is fitted; more are sampled evenly.
const FITTED_FRAMES: u32 = 256;

impl Scene {
    /// The middle of the bounds in the first of the scene's own frames and, for a camera that is placed by
    /// itself, its place.
    pub(super) fn measure(&mut self) -> Result<(DVec3, Option<Placed>), FrameError> {
        let [low, high] = self.bounds(self.own_frames.start)?;
        let centre = low + 0.5 * (high - low);
        let Rig::Fitted(side) = self.camera.rig else { return Ok((centre, None)) };
        let placed = match self.inside(side)? {
            Some(placed) => Some(placed),
            None => self.outside()?,
        };
        Ok((centre, placed))
    }

    /// Smallest and largest coordinates, relative to the origin of positions, while the shutter of `frame` is
    /// open.
    pub(super) fn bounds(&self, frame: u32) -> Result<[DVec3; 2], FrameError> {
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        self.visit_points(frame, false, &mut |point| {
            low = low.min(point);
            high = high.max(point);
        })?;
        Ok([low, high])
    }

    /// The place inside, where it is requested or the scene is a room.
    fn inside(&mut self, side: Side) -> Result<Option<Placed>, FrameError> {
        let found = match side {
            Side::Outside => None,
            Side::Inside => Inside::find(self.surface()?, true),
            Side::Auto if self.graph.triangle_count() > MAX_ROOM_TRIANGLES => None,
            Side::Auto => self.room()?,
        };
        if let (Side::Auto, Some(room)) = (side, &found) {
            self.warnings.push(camera_inside(room));
        }
        let view = self.camera.view.unwrap_or_else(super::inside::view);
        Ok(found.map(|inside| Placed { fit: inside.fit, view, side: Side::Inside }))
    }

    /// The place inside if the scene is a room. Other settings do not change it, but for the clip.
    fn room(&mut self) -> Result<Option<Inside>, FrameError> {
        if self.room.is_none() {
            self.room = Some(Inside::find(self.surface()?, false));
        }
        Ok(self.room.flatten())
    }

    /// Every triangle when the shutter of the first of the scene's own frames opens, counter-clockwise seen
    /// from its front.
    fn surface(&self) -> Result<Vec<[DVec3; 3]>, FrameError> {
        let interval = self.interval(self.own_frames.start);
        let mut surface = Vec::with_capacity(self.graph.triangle_count());
        for instance in &self.graph.instances {
            let (open, _) = interval.path(self, *instance)?;
            let corner = |vertex: u32| open[vertex as usize].as_dvec3();
            let mirrors = interval.open.transforms(&self.graph, *instance).mirrors();
            let turned = |[a, b, c]: [DVec3; 3]| if mirrors { [a, c, b] } else { [a, b, c] };
            let triangles = self.graph.meshes[instance.mesh].triangles.iter();
            surface.extend(triangles.map(|corners| turned(corners.map(corner))));
        }
        Ok(surface)
    }

    /// The place outside from which everything is in view over [`Self::fitted_frames`].
    fn outside(&mut self) -> Result<Option<Placed>, FrameError> {
        let first = self.own_frames.start;
        let aspect = f64::from(self.settings.width) / f64::from(self.settings.height);
        let view = self.camera.view.unwrap_or_default();
        let Frustum::Perspective { tan_half_height: tan } = view else { return Ok(None) };
        let Some(mut extent) = Extent::new(tan * aspect, tan) else { return Ok(None) };
        let fitted = self.fitted_frames();
        for index in some_of(&fitted) {
            self.visit_points(index, index != first, &mut |point| extent.add(point))?;
        }
        let radius = f64::from(self.settings.lens_radius);
        let fit = extent.fit((radius > 0.0).then(|| (radius, self.settings.focus.map(f64::from))));
        if fit.is_some_and(|fit| !fit.holds_lens) {
            self.warnings.push(lens_leaves_view());
        }
        if let Some(fit) = fit.filter(|_| !is_within(&self.settings.frames, &fitted)) {
            let mut leaves = false;
            for index in some_of(&self.settings.frames) {
                self.visit_points(index, true, &mut |point| leaves |= !extent.sees(&fit, point))?;
            }
            self.warnings.extend(leaves.then(|| leaves_fitted_view(&fitted)));
        }
        Ok(fit.map(|fit| Placed { fit, view, side: Side::Outside }))
    }

    /// The frames that a fitted camera holds: the scene's own, and one loop of the clip that plays.
    fn fitted_frames(&self) -> Range<u32> {
        let loop_s = if self.clips.is_empty() { 0.0 } else { self.graph.last_key_s() };
        let loop_frames = libm::ceil(loop_s * self.settings.frame_rate_hz) as u32;
        self.own_frames.start..self.own_frames.end.max(loop_frames.min(LAST_FRAME))
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

fn is_within(inner: &Range<u32>, outer: &Range<u32>) -> bool {
    outer.start <= inner.start && inner.end <= outer.end
}

/// All frames of a range that is not empty, or [`FITTED_FRAMES`] of them, evenly, with the first and the
/// last.
fn some_of(frames: &Range<u32>) -> Vec<u32> {
    let count = frames.end - frames.start;
    let looked_at = count.min(FITTED_FRAMES);
    let last = u64::from(looked_at.max(2) - 1);
    let nth = |i: u32| frames.start + (u64::from(i) * u64::from(count - 1) / last) as u32;
    (0..looked_at).map(nth).collect()
}
