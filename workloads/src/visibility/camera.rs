//! Conversion of a camera description to a camera with a pose at both ends of the shutter.

use glam::{Affine3A, DVec2, DVec3};
use pipeline::{Camera, CameraError, Lens, LensShape, Viewport};

use super::MovingMesh;
use crate::scene::camera::{CameraFrame, Extent, Fit};
use crate::scene::inside::Inside;
use crate::scene::{CameraSpec, Side, Wrong, tan_half};

/// Default near depth, relative to the depth of the target.
const NEAR: f64 = 1e-3;

/// A camera with its poses and image.
pub(super) struct PosedCamera {
    /// Pose at shutter open and at shutter close.
    pub stands: [CameraFrame; 2],
    /// The camera in its own space.
    pub camera: Camera,
    /// Image size.
    pub viewport: Viewport,
}

impl CameraSpec {
    /// Checks the fields that moving meshes do not support, and that a placed camera can be built.
    ///
    /// # Errors
    /// The first invalid field.
    pub(super) fn check_for_meshes(&self) -> Result<(), Wrong> {
        let unused = "a shutter has two ends: give `end_position` and `end_target` instead";
        if !self.keyframes.is_empty() || self.interpolation.is_some() {
            return Err(("keyframes", unused.to_owned()));
        }
        if self.focus.is_some() && self.lens_radius.is_none() {
            let message = "there is no lens to focus: give a `lens_radius` above zero, too, or leave it out";
            return Err(("focus", message.to_owned()));
        }
        if self.is_placed() { self.completed().stands_and_image().map(drop) } else { Ok(()) }
    }

    /// The camera with all defaults filled in.
    pub(super) fn completed(&self) -> Self {
        let [width, height] = self.size();
        let depth = self.target_depth();
        let focus = if self.radius() > 0.0 { self.focus.or(depth.map(|depth| depth as f32)) } else { None };
        Self {
            width: Some(width),
            height: Some(height),
            samples: Some(self.samples_per_pixel()),
            seed: Some(self.sample_seed()),
            lens_shape: Some(self.shape()),
            fov_deg: self.view_height.is_none().then(|| self.field_of_view()),
            up: self.up.or(Some(DVec3::Y.to_array())),
            lens_radius: Some(self.radius()),
            focus,
            shift: self.shift.or(Some([0.0; 2])),
            near: self.near.or(depth.map(|depth| NEAR * depth)),
            ..self.clone()
        }
    }

    /// Samples per pixel.
    pub(super) fn samples_per_pixel(&self) -> u32 {
        self.samples.unwrap_or(16)
    }

    /// Seed of the samples.
    pub(super) fn sample_seed(&self) -> u64 {
        self.seed.unwrap_or(1)
    }

    /// Shape of the aperture.
    pub(super) fn shape(&self) -> LensShape {
        self.lens_shape.unwrap_or_default()
    }

    /// Width and height in pixels.
    fn size(&self) -> [u32; 2] {
        [self.width, self.height].map(|side| side.unwrap_or(512))
    }

    fn radius(&self) -> f32 {
        self.lens_radius.unwrap_or(0.0)
    }

    /// Builds the camera with its poses.
    ///
    /// # Errors
    /// The first invalid field: a missing pose, a degenerate direction, or a value out of the range of `f32`.
    pub(super) fn stands_and_image(&self) -> Result<PosedCamera, Wrong> {
        let open = self.stand("target", self.position, self.target, self.up)?;
        let (position, target) = (self.end_position.or(self.position), self.end_target.or(self.target));
        let close = self.stand("end_target", position, target, self.end_up.or(self.up))?;
        let [width, height] = self.size();
        let wrong = || ("width", format!("{width}x{height}: each side has to be 1 to 16384 pixels"));
        let viewport = Viewport::new(width, height).ok_or_else(wrong)?;
        Ok(PosedCamera { stands: [open, close], camera: self.camera()?, viewport })
    }

    fn stand(
        &self,
        place: &'static str,
        position: Option<[f64; 3]>,
        target: Option<[f64; 3]>,
        up: Option<[f64; 3]>,
    ) -> Result<CameraFrame, Wrong> {
        let eye = DVec3::from(position.unwrap_or([f64::NAN; 3]));
        let along = match (target, self.direction) {
            (Some(target), _) => DVec3::from(target) - eye,
            (None, direction) => DVec3::from(direction.unwrap_or([f64::NAN; 3])),
        };
        let message = "the camera has no direction, because it coincides with its target or is too far from it: move one of them";
        CameraFrame::new(eye, along, up.map_or(DVec3::Y, DVec3::from))
            .ok_or_else(|| (place, message.to_owned()))
    }

    /// Builds the camera in its own space.
    fn camera(&self) -> Result<Camera, Wrong> {
        let out_of = |place| move |error: CameraError| (place, error.to_string());
        let near = self.near.unwrap_or(0.0) as f32;
        let view = self.view().unwrap_or_default();
        let camera = view.camera(Affine3A::IDENTITY, near).map_err(out_of("near"))?;
        let camera = camera
            .with_shift(DVec2::from_array(self.shift.unwrap_or_default()).as_vec2())
            .map_err(out_of("shift"))?;
        if self.radius() == 0.0 {
            return Ok(camera);
        }
        let lens = Lens::new(self.radius(), self.focus.unwrap_or(0.0)).map_err(out_of("focus"))?;
        Ok(camera.with_lens(Some(lens)))
    }

    fn target_depth(&self) -> Option<f64> {
        Some(DVec3::from(self.position?).distance(DVec3::from(self.target?)))
    }
}

/// Fits the camera inside `mesh` if requested, otherwise so that all of it is in view during the shutter.
/// Also returns whether this holds from all of the lens. `None` for a mesh without triangles or with extreme
/// coordinates.
pub(super) fn fit(spec: &CameraSpec, mesh: &MovingMesh) -> Option<(CameraSpec, bool)> {
    let (fit, fov_deg) = match spec.fitted {
        Some(Side::Inside) => {
            let corners = mesh.corners().map(|[open, _]| open).collect::<Vec<_>>();
            let triangles = corners.chunks_exact(3).map(|corner| [corner[0], corner[1], corner[2]]).collect();
            (Inside::find(triangles, true)?.fit, spec.fov_deg.unwrap_or(Inside::FOV_DEG))
        }
        Some(Side::Auto | Side::Outside) | None => (around(spec, mesh)?, spec.field_of_view()),
    };
    let stand = fit.stand;
    let placed = CameraSpec {
        position: Some(stand.eye.to_array()),
        target: Some((stand.eye + fit.focus * stand.forward).to_array()),
        up: Some(stand.up.to_array()),
        fitted: None,
        fov_deg: Some(fov_deg),
        near: spec.near.or(Some(fit.near)),
        ..spec.clone()
    };
    let finite = stand.eye.is_finite() && fit.focus.is_finite();
    finite.then(|| (placed.completed(), fit.holds_lens))
}

/// Pose from which all of `mesh` is in view.
fn around(spec: &CameraSpec, mesh: &MovingMesh) -> Option<Fit> {
    let [width, height] = spec.size().map(f64::from);
    let tan = tan_half(spec.field_of_view());
    let mut extent = Extent::new(tan * width / height, tan)?;
    mesh.corners().flatten().for_each(|point| extent.add(point));
    let radius = f64::from(spec.radius());
    extent.fit((radius > 0.0).then(|| (radius, spec.focus.map(f64::from))))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn view(text: &str) -> PosedCamera {
        CameraSpec::parse(text, "c.ron").unwrap().completed().stands_and_image().unwrap()
    }

    #[test]
    fn camera_space_is_right_up_forward_at_both_ends() {
        let view = view("(position: (0, 0, 5), target: (0, 0, 0), end_position: (5, 0, 0))");
        let point = DVec3::new(1.0, 2.0, 3.0);
        assert_eq!(view.stands[0].view(point), DVec3::new(1.0, 2.0, 2.0));
        assert_eq!(view.stands[1].view(point), DVec3::new(-3.0, 2.0, 4.0));
    }

    #[test]
    fn lens_and_near_follow_the_target_by_default() {
        let explicit = view(
            "(position: (0, 0, 5), target: (0, 0, 0), lens_radius: 0.5, focus: 3, near: 0.25, fov_deg: 90)",
        );
        assert_eq!(explicit.camera.lens(), Some(Lens::new(0.5, 3.0).unwrap()));
        assert_eq!((explicit.camera.near(), explicit.camera.half_height()), (0.25, 1.0));
        let plain = view("(position: (0, 0, 5), target: (0, 0, 0), lens_radius: 0.5)");
        assert_eq!(plain.camera.lens(), Some(Lens::new(0.5, 5.0).unwrap()));
        assert_eq!(plain.camera.near(), 0.005);
        assert_eq!(view("(position: (0, 0, 5), target: (0, 0, 0))").camera.lens(), None);
        let flat = view("(position: (0, 0, 5), target: (0, 0, 0), view_height: 3, lens_radius: 0.5)").camera;
        assert!(flat.is_orthographic() && !plain.camera.is_orthographic());
        assert_eq!((flat.half_height(), flat.lens()), (1.5, plain.camera.lens()));
    }

    #[test]
    fn a_fitted_camera_holds_a_moving_triangle() {
        let corners = [DVec3::ZERO, DVec3::X, DVec3::Y];
        let mesh = MovingMesh {
            open: corners.to_vec(),
            close: corners.iter().map(|corner| *corner * 3.0 + DVec3::Z).collect(),
            triangles: vec![[0, 1, 2]],
        };
        let (spec, holds_lens) = fit(&CameraSpec::default(), &mesh).unwrap();
        assert!(holds_lens && spec.is_placed());
        let view = spec.stands_and_image().unwrap();
        for point in mesh.corners().flatten().map(|corner| view.stands[0].view(corner)) {
            let tan = f64::from(view.camera.half_height());
            assert!(point.z > f64::from(view.camera.near()));
            assert!((point.x / point.z).abs() < tan && (point.y / point.z).abs() < tan, "{point}");
        }
        assert!(fit(&spec, &MovingMesh::default()).is_none());
    }

    #[test]
    fn unsupported_fields_are_refused_by_name() {
        for (text, place, says) in [
            ("(focus: 3)", "focus", "give a `lens_radius`"),
            ("(position: (0, 0, 1e-60), target: (0, 0, 0))", "near", "above zero"),
            ("(position: (0, 0, 1), direction: (0, 0, -1))", "near", "above zero"),
            (
                "(position: (0, 0, 1), target: (0, 0, 0), keyframes: [(time_s: 1, position: (0, 1, 0))])",
                "keyframes",
                "end_position",
            ),
        ] {
            let (wrong, message) = CameraSpec::parse(text, "c.ron").unwrap().check_for_meshes().unwrap_err();
            assert!(wrong == place && message.contains(says), "{text}: {wrong}: {message}");
        }
        let explicit = CameraSpec::parse("(lens_radius: 0, focus: 3)", "c.ron").unwrap();
        assert_eq!(explicit.check_for_meshes(), Ok(()));
    }
}
