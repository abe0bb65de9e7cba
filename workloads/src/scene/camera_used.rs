//! The camera of a scene: its choice, and a description that reproduces it.

use glam::DVec3;
use serde::Serialize;

use super::Scene;
use super::camera::{Aim, Frustum, LookAt, Rig, SceneCamera, Side, Standing, tan_half};
use super::camera_spec::{CameraKey, CameraSpec, FORMS, InterpolationSpec};
use super::frame::{FrameError, Interval};
use super::graph::movers;
use super::settings::Overrides;
use super::track::{Interpolation, Track};
use crate::error::LoadError;

/// Source of a camera.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(into = "SourceFields")]
pub enum CameraSource {
    /// One of the scene's own.
    Own {
        /// Number among the scene's own cameras.
        index: usize,
        /// Name.
        name: String,
    },
    /// Given by the caller.
    Given,
    /// Placed automatically.
    Placed {
        /// Side from which the camera sees the scene.
        side: Side,
    },
}

/// [`CameraSource`] with the fields of all kinds; those of other kinds are null.
#[derive(Serialize)]
struct SourceFields {
    kind: &'static str,
    index: Option<usize>,
    name: Option<String>,
    side: Option<Side>,
}

impl From<CameraSource> for SourceFields {
    fn from(source: CameraSource) -> Self {
        let of = |kind| Self { kind, index: None, name: None, side: None };
        match source {
            CameraSource::Own { index, name } => Self { index: Some(index), name: Some(name), ..of("own") },
            CameraSource::Given => of("given"),
            CameraSource::Placed { side } => Self { side: Some(side), ..of("placed") },
        }
    }
}

impl std::fmt::Display for CameraSource {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Own { index, name } => write!(f, "the scene's own, `{name}` (number {index})"),
            Self::Given => f.write_str("as given"),
            Self::Placed { side: Side::Inside } => f.write_str("placed inside"),
            Self::Placed { .. } => f.write_str("placed outside"),
        }
    }
}

/// The camera of a scene, when the shutter of the first frame opens.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CameraUsed {
    /// Source.
    #[serde(flatten)]
    pub source: CameraSource,
    /// Whether the camera moves.
    pub moves: bool,
    /// Position in scene units.
    pub position: [f64; 3],
    /// Direction of the view, a unit vector.
    pub direction: [f64; 3],
    /// Upward direction in the image, a unit vector.
    pub up: [f64; 3],
    /// Vertical field of view in degrees; `None` for an orthographic view.
    pub fov_deg: Option<f64>,
    /// Height of an orthographic view in scene units.
    pub view_height: Option<f64>,
    /// Near depth in scene units.
    pub near: f64,
    /// Radius of the lens in scene units; zero for a pinhole.
    pub lens_radius: f32,
    /// Focus depth in scene units; for a pinhole, that of a lens added to it.
    pub focus: f32,
    /// The camera on one line of RON, for `--camera`.
    pub ron: String,
    /// Whether `ron` gives the same camera in every frame. Otherwise `ron` is the still camera of the first frame.
    pub exact: bool,
}

impl Scene {
    /// The camera of the scene.
    ///
    /// # Errors
    /// [`FrameError::Camera`] if its direction is undefined in the first frame.
    pub fn camera_used(&self) -> Result<CameraUsed, FrameError> {
        let first = self.interval(self.settings.frames.start);
        let Standing { open: stand, near, focus, .. } =
            self.standing_before(&first, &self.frame_meshes(&first)?)?;
        let eye = stand.eye + self.origin;
        let (fov_deg, view_height) = match self.sees() {
            Frustum::Perspective { tan_half_height } => (Some(field_of_view(tan_half_height)), None),
            Frustum::Orthographic { half_height } => (None, Some(2.0 * half_height)),
        };
        let focus = self.focus(focus);
        let described = CameraSpec {
            position: Some(eye.to_array()),
            fov_deg,
            view_height,
            near: self.camera.near.or((!self.near_may_change()).then_some(near)),
            lens_radius: Some(self.settings.lens_radius),
            focus: (focus.is_finite() && focus > 0.0).then_some(focus),
            ..CameraSpec::default()
        };
        let (description, exact) = self.with_sight(&first, described);
        Ok(CameraUsed {
            source: self.source_used(),
            moves: self.camera_moves(),
            position: eye.to_array(),
            direction: stand.forward.to_array(),
            up: stand.up.to_array(),
            fov_deg,
            view_height,
            near,
            lens_radius: self.settings.lens_radius,
            focus,
            ron: description.to_ron_line(),
            exact: exact && fov_deg.is_none_or(|fov| (0.1..=175.0).contains(&fov)),
        })
    }

    /// Whether the near depth may differ between frames.
    fn near_may_change(&self) -> bool {
        self.placed.is_none() && self.moving.contains(&true)
    }

    fn source_used(&self) -> CameraSource {
        match (&self.camera_source, &self.placed) {
            (CameraSource::Placed { .. }, Some(placed)) => CameraSource::Placed { side: placed.side },
            (source, _) => source.clone(),
        }
    }

    fn camera_moves(&self) -> bool {
        match &self.camera.rig {
            Rig::LookAt(_) => self.camera.has_track(),
            Rig::Node(node) => movers(&self.graph.nodes).get(*node).copied().unwrap_or(false),
            Rig::Fitted(_) => false,
        }
    }

    /// Adds direction and motion to `described`, and returns whether the description is complete. Directions
    /// are those of the input, before normalization, so that the camera made from them has the same bits.
    fn with_sight(&self, first: &Interval, described: CameraSpec) -> (CameraSpec, bool) {
        let along = |direction: DVec3, up: DVec3| CameraSpec {
            direction: Some(direction.to_array()),
            up: (up != DVec3::Y).then_some(up.to_array()),
            ..described.clone()
        };
        match (&self.camera.rig, &self.placed) {
            (Rig::LookAt(sight), _) => self.with_path(sight, described),
            (Rig::Node(node), _) => {
                let axes = first.open.world(*node).matrix3;
                (along(-axes.z_axis, axes.y_axis), !self.camera_moves())
            }
            (Rig::Fitted(_), Some(placed)) => (along(placed.fit.direction, DVec3::Y), true),
            (Rig::Fitted(_), None) => (described, false),
        }
    }

    fn with_path(&self, sight: &LookAt, described: CameraSpec) -> (CameraSpec, bool) {
        let target = match &sight.aim {
            Aim::At(target) => Some(target),
            Aim::Along(_) => None,
        };
        let mut spec = CameraSpec {
            position: Some(sight.position.rest.to_array()),
            target: target.map(|target| target.rest.to_array()),
            direction: match &sight.aim {
                Aim::At(_) => None,
                Aim::Along(direction) => Some(direction.to_array()),
            },
            up: (sight.up != DVec3::Y).then_some(sight.up.to_array()),
            ..described
        };
        if !self.camera.has_track() {
            return (spec, true);
        }
        // Values that are computed for each frame stay undefined here, so that they are computed again.
        (spec.near, spec.focus) = (self.camera.near, self.settings.focus);
        let tracks =
            [Some(&sight.position), target].map(|place| place.and_then(|place| place.track.as_ref()));
        match keys(tracks) {
            Some((keyframes, interpolation)) => {
                (spec.keyframes, spec.interpolation) = (keyframes, interpolation);
                (spec, true)
            }
            None => (spec, false),
        }
    }
}

/// Keys of the tracks of position and target; `None` if files cannot describe them.
fn keys([position, target]: [Option<&Track>; 2]) -> Option<(Vec<CameraKey>, Option<InterpolationSpec>)> {
    let first = position.or(target)?;
    let is_same = |track: &Track| {
        track.times_s() == first.times_s()
            && track.interpolation() == first.interpolation()
            && track.period_s().is_none()
    };
    if ![position, target].into_iter().flatten().all(is_same) {
        return None;
    }
    let interpolation = match first.interpolation() {
        Interpolation::Linear => None,
        Interpolation::Step => Some(InterpolationSpec::Step),
        Interpolation::CubicSpline => return None,
    };
    let point = |track: Option<&Track>, key: usize| {
        track.map(|track| std::array::from_fn(|axis| track.key(key).get(axis).copied().unwrap_or(0.0)))
    };
    let key = |(index, &time_s): (usize, &f64)| CameraKey {
        time_s,
        position: point(position, index),
        target: point(target, index),
    };
    Some((first.times_s().iter().enumerate().map(key).collect(), interpolation))
}

/// The vertical field of view in degrees with `tan` as the tangent of its half in f32, with as few digits as needed.
pub(super) fn field_of_view(tan: f64) -> f64 {
    let degrees = 2.0 * libm::atan(tan).to_degrees();
    let same = |degrees: &f64| tan_half(*degrees) as f32 == tan as f32;
    let short = [1.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6].map(|scale| (degrees * scale).round() / scale);
    let near = [degrees, degrees.next_up(), degrees.next_down()];
    short.into_iter().chain(near).find(same).unwrap_or(degrees)
}

/// A camera of the scene's file.
#[derive(Clone, Debug, PartialEq)]
pub struct OwnCamera {
    /// Name.
    pub name: String,
    /// The camera.
    pub camera: SceneCamera,
}

/// Name of the scene's camera, if the scene lists no cameras.
const UNNAMED: &str = "scene";

/// The scene's own cameras, and the source of the one in use.
pub(super) fn cameras(own: Vec<OwnCamera>, seeing: &SceneCamera) -> (Vec<OwnCamera>, CameraSource) {
    if let Rig::Fitted(side) = seeing.rig {
        return (own, CameraSource::Placed { side });
    }
    let own = if own.is_empty() {
        vec![OwnCamera { name: UNNAMED.to_owned(), camera: seeing.clone() }]
    } else {
        own
    };
    let index = own.iter().position(|own| own.camera == *seeing).unwrap_or(0);
    let name = own[index].name.clone();
    (own, CameraSource::Own { index, name })
}

/// Lens and image settings in a camera's description.
#[derive(Clone, Debug, Default)]
pub(super) struct CameraSettings {
    size: Option<(u32, u32)>,
    samples: Option<u32>,
    lens_radius: Option<f32>,
    focus: Option<f32>,
}

impl CameraSettings {
    /// `overrides`, completed by the settings of the camera.
    pub fn over(&self, overrides: &Overrides) -> Overrides {
        let lens_radius = overrides.lens_radius.or(self.lens_radius);
        // The focus depth of a pinhole is ignored.
        let focus = self.focus.filter(|_| lens_radius != Some(0.0));
        Overrides {
            size: overrides.size.or(self.size),
            samples: overrides.samples.or(self.samples),
            lens_radius,
            focus: overrides.focus.or(focus),
            ..overrides.clone()
        }
    }
}

impl Scene {
    /// Selects the camera in `overrides`; returns the lens and image settings of its description.
    ///
    /// # Errors
    /// [`LoadError`] for an unknown camera or a wrong description.
    pub(super) fn choose_camera(&mut self, overrides: &Overrides) -> Result<CameraSettings, LoadError> {
        let Some(wanted) = &overrides.camera else { return Ok(CameraSettings::default()) };
        if let Some(index) = self.own_camera(wanted) {
            let OwnCamera { name, camera } = self.cameras[index].clone();
            self.take_camera(camera, CameraSource::Own { index, name });
            return Ok(CameraSettings::default());
        }
        let (spec, file) = CameraSpec::flag(wanted).map_err(|error| self.no_camera(wanted, error))?;
        let settings = self.settings.with(&Overrides {
            camera: None,
            lens_radius: Some(0.0),
            focus: None,
            ..overrides.clone()
        })?;
        let camera = spec.scene_camera(&settings).map_err(|wrong| CameraSpec::wrong(&file, wrong))?;
        let source = match camera.rig {
            Rig::Fitted(side) => CameraSource::Placed { side },
            _ => CameraSource::Given,
        };
        self.take_camera(camera, source);
        let size = (spec.width.is_some() || spec.height.is_some()).then(|| {
            (spec.width.unwrap_or(self.settings.width), spec.height.unwrap_or(self.settings.height))
        });
        Ok(CameraSettings { size, samples: spec.samples, lens_radius: spec.lens_radius, focus: spec.focus })
    }

    /// Replaces the camera. The focus depth of the previous one is dropped.
    fn take_camera(&mut self, camera: SceneCamera, source: CameraSource) {
        if camera != self.camera {
            self.settings.focus = None;
        }
        (self.camera, self.camera_source) = (camera, source);
    }

    /// Index of the scene's own camera with the name or the number `wanted`.
    fn own_camera(&self, wanted: &str) -> Option<usize> {
        let by_name = self.cameras.iter().position(|own| own.name == wanted);
        by_name.or_else(|| wanted.parse().ok().filter(|index| *index < self.cameras.len()))
    }

    /// `error`; if `wanted` is unknown, a message with the scene's own cameras.
    fn no_camera(&self, wanted: &str, error: LoadError) -> LoadError {
        let LoadError::Setting { setting, .. } = error else { return error };
        let names: Vec<&str> = self.cameras.iter().map(|own| own.name.as_str()).collect();
        let own = match names[..] {
            [] => "the scene has none of its own".to_owned(),
            _ => activity::spec::suggestion(wanted, &names),
        };
        LoadError::Setting { setting, message: format!("unknown camera `{wanted}`: {own}; {FORMS}") }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_field_of_view_is_short_and_makes_the_same_camera() {
        assert_eq!(field_of_view(tan_half(40.0)), 40.0);
        assert_eq!(field_of_view(tan_half(37.85)), 37.85);
        for step in 1..3000 {
            let tan = libm::tan(f64::from(step as f32 * 1e-3) / 2.0);
            assert_eq!(tan_half(field_of_view(tan)) as f32, tan as f32, "step {step}");
        }
    }
}
