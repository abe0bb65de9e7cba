//! Camera descriptions: one RON form for scene files, `--camera` and `quintile visibility`.

use std::path::Path;

use activity::spec::SpecError;
use glam::DVec3;
use pipeline::LensShape;
use serde::{Deserialize, Serialize};

use super::camera::{Aim, DEFAULT_FOV_DEG, Frustum, LookAt, Place, Rig, SceneCamera, Side};
use super::settings::SceneSettings;
use super::track::{Interpolation, Track};
use crate::bounded;
use crate::error::{LoadError, Source};

/// A camera in RON. Omitted fields have defaults; without a position the camera is placed automatically.
///
/// Lengths are in scene units, angles in degrees. The world is right-handed with y up.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct CameraSpec {
    /// Position; in `quintile visibility`, the position at shutter open.
    #[serde(deserialize_with = "bounded::vector", skip_serializing_if = "Option::is_none")]
    pub position: Option<[f64; 3]>,
    /// Target.
    #[serde(
        alias = "look_at",
        deserialize_with = "bounded::vector",
        skip_serializing_if = "Option::is_none"
    )]
    pub target: Option<[f64; 3]>,
    /// Direction of the view, of any length, instead of a target.
    #[serde(deserialize_with = "bounded::vector", skip_serializing_if = "Option::is_none")]
    pub direction: Option<[f64; 3]>,
    /// Upward direction, +y by default.
    #[serde(deserialize_with = "bounded::vector", skip_serializing_if = "Option::is_none")]
    pub up: Option<[f64; 3]>,
    /// Side of an automatic placement, instead of a position.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fitted: Option<Side>,
    /// Vertical field of view in degrees, 40 by default (60 for a camera that is placed inside).
    #[serde(deserialize_with = "bounded::field_of_view", skip_serializing_if = "Option::is_none")]
    pub fov_deg: Option<f64>,
    /// Height of an orthographic view, instead of a field of view.
    #[serde(deserialize_with = "bounded::height", skip_serializing_if = "Option::is_none")]
    pub view_height: Option<f64>,
    /// Near depth; a thousandth of the target's depth by default.
    #[serde(deserialize_with = "bounded::near", skip_serializing_if = "Option::is_none")]
    pub near: Option<f64>,
    /// Radius of the lens; zero, the default, is a pinhole.
    #[serde(deserialize_with = "bounded::radius", skip_serializing_if = "Option::is_none")]
    pub lens_radius: Option<f32>,
    /// Focus depth; that of the target by default.
    #[serde(deserialize_with = "bounded::depth", skip_serializing_if = "Option::is_none")]
    pub focus: Option<f32>,
    /// End of a straight motion, which lasts from time zero to the end of the last frame; in
    /// `quintile visibility`, until the shutter closes.
    #[serde(deserialize_with = "bounded::vector", skip_serializing_if = "Option::is_none")]
    pub end_position: Option<[f64; 3]>,
    /// Target at the end.
    #[serde(
        alias = "end_look_at",
        deserialize_with = "bounded::vector",
        skip_serializing_if = "Option::is_none"
    )]
    pub end_target: Option<[f64; 3]>,
    /// Upward direction at the end; `quintile visibility` only.
    #[serde(deserialize_with = "bounded::vector", skip_serializing_if = "Option::is_none")]
    pub end_up: Option<[f64; 3]>,
    /// Positions and targets over time, instead of an end; scenes only.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub keyframes: Vec<CameraKey>,
    /// Interpolation between keys.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub interpolation: Option<InterpolationSpec>,
    /// Image width in pixels. Scene files have `settings` instead of this field and those below.
    #[serde(deserialize_with = "bounded::side", skip_serializing_if = "Option::is_none")]
    pub width: Option<u32>,
    /// Image height in pixels.
    #[serde(deserialize_with = "bounded::side", skip_serializing_if = "Option::is_none")]
    pub height: Option<u32>,
    /// Samples per pixel.
    #[serde(deserialize_with = "bounded::samples", skip_serializing_if = "Option::is_none")]
    pub samples: Option<u32>,
    /// Seed of the samples, 1 by default; `quintile visibility` only.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
    /// Shape of the aperture, a disk by default; `quintile visibility` only.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lens_shape: Option<LensShape>,
    /// Shift of the image to the right and down, in image heights; `quintile visibility` only.
    #[serde(deserialize_with = "bounded::vector", skip_serializing_if = "Option::is_none")]
    pub shift: Option<[f64; 2]>,
}

/// A camera at one time. Omitted fields are those of the camera.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraKey {
    /// Seconds from the start of the scene.
    pub time_s: f64,
    /// Position.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub position: Option<[f64; 3]>,
    /// Target.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub target: Option<[f64; 3]>,
}

/// Interpolation between keys, as written in files.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum InterpolationSpec {
    /// Straight lines, and turns at a constant rate.
    #[default]
    Linear,
    /// The value of the earlier key, until the next one.
    Step,
}

impl From<InterpolationSpec> for Interpolation {
    fn from(spec: InterpolationSpec) -> Self {
        match spec {
            InterpolationSpec::Linear => Self::Linear,
            InterpolationSpec::Step => Self::Step,
        }
    }
}

/// Accepted forms of a camera, for messages.
pub(crate) const FORMS: &str = "give `inside` or `outside`, a .ron file, or its fields, for example 'position: (1, 2, 3), target: (0, 0, 0)'";

/// The wrong field (`camera` for a conflict of several), and a message.
pub(crate) type Wrong = (&'static str, String);

/// Reading and writing.
impl CameraSpec {
    /// Reads the camera in the file at `path`.
    ///
    /// # Errors
    /// If the file cannot be read, or as [`Self::parse`].
    pub fn load(path: &Path) -> Result<Self, LoadError> {
        if path.is_dir() {
            return Err(Source { path }.unreadable(std::io::ErrorKind::IsADirectory.into()));
        }
        let name = path.display().to_string();
        let text = activity::inputs::read_to_string(path)
            .map_err(|source| SpecError::Read { path: name.clone(), source })?;
        Self::parse(&text, &name)
    }

    /// Reads the RON in `text`; `file` names it in messages.
    ///
    /// # Errors
    /// With line and column if the text is not a camera; with the names of fields that conflict.
    pub fn parse(text: &str, file: &str) -> Result<Self, LoadError> {
        let spec: Self = activity::spec::parse(text, file)?;
        spec.check().map_err(|wrong| Self::wrong(file, wrong))?;
        Ok(spec)
    }

    /// Reads the value of a flag, as [`Self::parse`] but with optional parentheses.
    ///
    /// # Errors
    /// As [`Self::parse`].
    pub fn typed(text: &str, flag: &str) -> Result<Self, LoadError> {
        if text.trim_start().starts_with('(') {
            return Self::parse(text, flag);
        }
        Self::parse(&format!("({text})"), flag).map_err(|error| match error {
            LoadError::Spec(SpecError::Parse { path, line: 1, column, message }) => {
                SpecError::Parse { path, line: 1, column: column.saturating_sub(1), message }.into()
            }
            error => error,
        })
    }

    /// The camera in the value of a flag, and its name for messages. The value is `inside` or `outside` for
    /// automatic placement, the name of a `.ron` file, or fields as in [`Self::typed`].
    ///
    /// # Errors
    /// [`LoadError`] if the file cannot be read, or the content is not a camera.
    pub fn flag(text: &str) -> Result<(Self, String), LoadError> {
        let flag = "--camera".to_owned();
        let placed = |side| Self { fitted: Some(side), ..Self::default() };
        match text.trim() {
            "inside" => Ok((placed(Side::Inside), flag)),
            "outside" => Ok((placed(Side::Outside), flag)),
            file if file.ends_with(".ron") => Ok((Self::load(Path::new(file))?, file.to_owned())),
            text if text.contains(':') || text.starts_with('(') => Ok((Self::typed(text, &flag)?, flag)),
            other => {
                let message = format!("`{other}` is not a camera: {FORMS}");
                Err(LoadError::Setting { setting: "camera", message })
            }
        }
    }

    pub(crate) fn wrong(file: &str, (place, message): Wrong) -> LoadError {
        LoadError::Description { file: file.to_owned(), place: place.to_owned(), message }
    }

    /// The camera as a file, in RON.
    pub fn to_ron(&self) -> String {
        let style = ron::ser::PrettyConfig::new().compact_arrays(true);
        // Writing numbers and names as RON cannot fail.
        Self::ron_options().to_string_pretty(self, style).unwrap_or_default()
    }

    /// The camera on one line of RON, for a command line.
    pub fn to_ron_line(&self) -> String {
        let style = ron::ser::PrettyConfig::new().compact_arrays(true).compact_structs(true);
        Self::ron_options().to_string_pretty(self, style).unwrap_or_default()
    }

    fn ron_options() -> ron::Options {
        ron::Options::default().with_default_extension(ron::extensions::Extensions::IMPLICIT_SOME)
    }
}

/// Checks of fields that depend on each other.
impl CameraSpec {
    /// Whether the position is given, so that the camera is not placed automatically.
    pub fn is_placed(&self) -> bool {
        self.position.is_some()
    }

    /// Checks that the fields are consistent.
    ///
    /// # Errors
    /// The first field that is not.
    pub(crate) fn check(&self) -> Result<(), Wrong> {
        let ensure = |holds: bool, place, message: &str| {
            if holds { Ok(()) } else { Err((place, message.to_owned())) }
        };
        ensure(
            self.position.is_some() == (self.target.is_some() || self.direction.is_some()),
            "camera",
            "`position` and `target` (or `direction`) go together: give both, or none to have the camera placed",
        )?;
        ensure(
            self.target.is_none() || self.direction.is_none(),
            "camera",
            "`target` and `direction` both say where it looks: remove one of them",
        )?;
        ensure(
            self.position.is_none() || self.fitted.is_none(),
            "camera",
            "`fitted` is for a camera that is placed by itself: leave it out, or `position`",
        )?;
        let ends = [self.end_position, self.end_target, self.end_up];
        let moves = ends.iter().any(Option::is_some) || !self.keyframes.is_empty();
        ensure(
            self.is_placed() || !moves,
            "camera",
            "it moves but has no start: give `position` and `target`, too",
        )?;
        Frustum::given(self.fov_deg, self.view_height).map_err(|message| ("camera", message))?;
        ensure(
            self.view_height.is_none() || self.is_placed(),
            "camera",
            "an orthographic camera (`view_height`) is not placed by itself: give `position` and `target`, too",
        )?;
        self.check_sight()
    }

    /// Checks that the direction of the view is defined at the start and at the end.
    fn check_sight(&self) -> Result<(), Wrong> {
        let Some(position) = self.position else { return Ok(()) };
        let message = "the camera has no direction, because it coincides with its target or is too far from it: move one of them";
        let looks = |place: &'static str, eye: [f64; 3], target: Option<[f64; 3]>| {
            let along = match (target, self.direction) {
                (Some(target), _) => DVec3::from(target) - DVec3::from(eye),
                (None, direction) => DVec3::from(direction.unwrap_or_default()),
            };
            let length = along.length();
            if length.is_finite() && length > 0.0 { Ok(()) } else { Err((place, message.to_owned())) }
        };
        looks(if self.direction.is_some() { "direction" } else { "target" }, position, self.target)?;
        looks("end_target", self.end_position.unwrap_or(position), self.end_target.or(self.target))
    }

    /// The view, if given.
    pub(crate) fn view(&self) -> Option<Frustum> {
        let given = self.fov_deg.is_some() || self.view_height.is_some();
        given.then(|| Frustum::given(self.fov_deg, self.view_height).unwrap_or_default())
    }

    /// Vertical field of view in degrees.
    pub(crate) fn field_of_view(&self) -> f64 {
        self.fov_deg.unwrap_or(DEFAULT_FOV_DEG)
    }
}

/// Cameras of scenes.
impl CameraSpec {
    /// The camera of a scene with these `settings`. Lens, image and samples are not part of it.
    ///
    /// # Errors
    /// The wrong field: two kinds of motion, invalid keys, or a field that scenes do not use.
    pub(crate) fn scene_camera(&self, settings: &SceneSettings) -> Result<SceneCamera, Wrong> {
        let unused = [
            ("end_up", self.end_up.is_some()),
            ("seed", self.seed.is_some()),
            ("lens_shape", self.lens_shape.is_some()),
            ("shift", self.shift.is_some()),
        ];
        if let Some((place, _)) = unused.into_iter().find(|(_, given)| *given) {
            let message = "only `quintile visibility` has a use for it: leave it out";
            return Err((place, message.to_owned()));
        }
        let rig = match self.position {
            Some(position) => Rig::LookAt(Box::new(self.sight(position, settings)?)),
            None => Rig::Fitted(self.fitted.unwrap_or_default()),
        };
        Ok(SceneCamera { rig, view: self.view(), near: self.near })
    }

    fn sight(&self, position: [f64; 3], settings: &SceneSettings) -> Result<LookAt, Wrong> {
        let end_s = f64::from(settings.frames.end) / settings.frame_rate_hz;
        let position = self.path("end_position", (position, self.end_position), end_s, |key| key.position)?;
        let aim = match (self.target, self.direction) {
            (Some(target), _) => {
                Aim::At(self.path("end_target", (target, self.end_target), end_s, |key| key.target)?)
            }
            (None, direction) => {
                let message = "it goes with `target`, not with `direction`: remove one of them".to_owned();
                if self.end_target.is_some() || self.keyframes.iter().any(|key| key.target.is_some()) {
                    return Err(("end_target", message));
                }
                Aim::Along(DVec3::from(direction.unwrap_or_default()))
            }
        };
        Ok(LookAt { position, aim, up: self.up.map_or(DVec3::Y, DVec3::from) })
    }

    /// A point that moves from `rest` to an end until `end_s`, or from key to key.
    fn path(
        &self,
        place: &'static str,
        (rest, end): ([f64; 3], Option<[f64; 3]>),
        end_s: f64,
        of: fn(&CameraKey) -> Option<[f64; 3]>,
    ) -> Result<Place, Wrong> {
        let (times, points): (Vec<f64>, Vec<[f64; 3]>) = match (end, self.keyframes.is_empty()) {
            (Some(_), false) => return Err((place, "give an end or `keyframes`, not both".to_owned())),
            (Some(end), true) => (vec![0.0, end_s], vec![rest, end]),
            (None, true) => return Ok(Place::fixed(DVec3::from(rest))),
            (None, false) => self.keyframes.iter().map(|key| (key.time_s, of(key).unwrap_or(rest))).unzip(),
        };
        let interpolation = self.interpolation.unwrap_or_default().into();
        let given = if self.keyframes.is_empty() { place } else { "keyframes" };
        let track =
            Track::new(times, points.into_flattened(), 3, interpolation).map_err(|what| (given, what))?;
        Ok(Place { rest: DVec3::from(rest), track: Some(track) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<CameraSpec, LoadError> {
        CameraSpec::parse(text, "c.ron")
    }

    #[test]
    fn mistakes_are_usage_errors_that_name_their_place() {
        for (text, parts) in [
            (
                "(\n  lense_radius: 1)",
                ["c.ron:2:", "unknown field `lense_radius`, did you mean `lens_radius`?"],
            ),
            ("(width: 0)", ["c.ron:1:", "0 is not a number of pixels from 1 to 16384"]),
            ("(samples: 257)", ["c.ron:1:", "1 to 256"]),
            ("(seed: -1)", ["c.ron:1:9: `seed`: ", "`-1` is below 0; write 0 or more"]),
            ("(lens_shape: Disc)", ["c.ron:1:", "unknown variant `Disc`, did you mean `Disk`?"]),
            ("(fov_deg: 180)", ["c.ron:1:", "0.1 to 175 degrees"]),
            ("(view_height: 0)", ["c.ron:1:", "above zero"]),
            ("(view_height: -2)", ["c.ron:1:", "above zero"]),
            ("(view_height: NaN)", ["c.ron:1:", "above zero"]),
            ("(view_height: inf)", ["c.ron:1:", "above zero"]),
            ("(view_height: 2)", ["c.ron: camera:", "give `position` and `target`"]),
            (
                "(position: (0, 0, 5), target: (0, 0, 0), fov_deg: 40, view_height: 2)",
                ["c.ron: camera:", "remove one of them"],
            ),
            ("(position: (0, NaN, 0))", ["c.ron:1:", "numbers from -1e15 to 1e15"]),
            ("(shift: (0, inf))", ["c.ron:1:", "numbers from -1e15 to 1e15"]),
            ("(position: (0, 0))", ["c.ron:1:", "3"]),
            ("(near: 0)", ["c.ron:1:", "above zero"]),
            ("(lens_radius: -1)", ["c.ron:1:", "a radius from 0 to 1e15"]),
            ("(position: (0, 0, 1))", ["c.ron: camera:", "give both"]),
            ("(target: (0, 0, 1))", ["c.ron: camera:", "give both"]),
            ("(end_up: (0, 0, 1))", ["c.ron: camera:", "give `position` and `target`"]),
            ("(position: (1, 0, 1), target: (1, 0, 1))", ["c.ron: target:", "move one of them"]),
            (
                "(position: (1, 0, 1), target: (0, 0, 0), end_target: (1, 0, 1))",
                ["c.ron: end_target:", "move one"],
            ),
            (
                "(position: (0, 0, 1), target: (0, 0, 0), direction: (0, 0, -1))",
                ["c.ron: camera:", "remove one of them"],
            ),
            ("(position: (0, 0, 1), direction: (0, 0, 0))", ["c.ron: direction:", "move one of them"]),
            ("(position: (0, 0, 1), target: (0, 0, 0), fitted: Inside)", ["c.ron: camera:", "leave it out"]),
            ("(fitted: inside)", ["c.ron:1:", "did you mean `Inside`?"]),
            ("(width: 3", ["c.ron:1:", "Expected comma"]),
        ] {
            let error = parse(text).unwrap_err();
            assert!(error.is_usage(), "{error}");
            for part in parts {
                assert!(error.to_string().contains(part), "{text}: `{part}` is not in: {error}");
            }
        }
        assert!(!CameraSpec::load(Path::new("/nowhere/c.ron")).unwrap_err().is_usage());
        assert!(!CameraSpec::load(Path::new("/")).unwrap_err().is_usage());
    }

    #[test]
    fn keys_that_make_no_track_are_named_as_keys() {
        let spec = "position: (0, 0, 3), target: (0, 0, 0), keyframes: [(time_s: 1), (time_s: 0.5)]";
        let wrong = parse(&format!("({spec})")).unwrap().scene_camera(&SceneSettings::default());
        assert_eq!(wrong.err().map(|(place, _)| place), Some("keyframes"));
    }

    #[test]
    fn a_camera_written_is_the_camera_read() {
        for text in [
            "(width: 64, seed: 18446744073709551615, lens_shape: Square, position: (0.1, 1e-9, 3), \
             look_at: (0, 0, 0), end_position: (0, 1, 3), lens_radius: 0.1, focus: 2.7, shift: (0.5, -0.25))",
            "(position: (0, 0, 3), target: (0, 0, 0), view_height: 2.5, near: 0.1)",
            "(position: (0, 0, 3), direction: (0.1, 0.2, -0.7), up: (0, 0, 1), lens_radius: 0, focus: 2)",
            "(position: (0, 0, 3), target: (0, 1, 0), interpolation: Step, \
             keyframes: [(time_s: 0), (time_s: 0.5, position: (1, 2, 3)), (time_s: 1, target: (0, 0, 1))])",
            "(fitted: Inside, fov_deg: 70)",
        ] {
            let spec = parse(text).unwrap();
            for written in [spec.to_ron(), spec.to_ron_line()] {
                assert_eq!(parse(&written).unwrap(), spec, "{written}");
            }
            let line = spec.to_ron_line();
            assert!(!line.contains('\n'), "{line}");
        }
        assert!(parse("()").unwrap() == CameraSpec::default() && !CameraSpec::default().is_placed());
    }

    #[test]
    fn what_is_typed_needs_no_parentheses_and_errors_point_into_it() {
        let (spec, name) = CameraSpec::flag("position: (0, 0, 3), target: (0, 0, 0)").unwrap();
        assert_eq!((spec.position, name.as_str()), (Some([0.0, 0.0, 3.0]), "--camera"));
        assert_eq!(CameraSpec::flag("inside").unwrap().0.fitted, Some(Side::Inside));
        for (text, says) in [
            ("positon: (0, 0, 3)", "--camera:1:1: unknown field `positon`, did you mean `position`?"),
            ("(positon: (0, 0, 3))", "--camera:1:2: unknown field `positon`"),
            ("position: (0, 0, 3)", "--camera: camera: `position` and `target`"),
            ("upside", "camera: `upside` is not a camera: give `inside` or `outside`, a .ron file"),
            ("", "camera: `` is not a camera"),
        ] {
            let error = CameraSpec::flag(text).unwrap_err();
            assert!(error.is_usage() && error.to_string().starts_with(says), "{text}: {error}");
        }
        assert!(!CameraSpec::flag("/nowhere/c.ron").unwrap_err().is_usage());
    }
}
