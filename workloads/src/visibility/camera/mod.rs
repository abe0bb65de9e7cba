//! Cameras in RON: the image, its samples, and who looks from where at both ends of the shutter.

mod place;

use std::path::Path;

use activity::spec::SpecError;
use pipeline::LensShape;
use serde::{Deserialize, Serialize};

use crate::error::{LoadError, Source};
use crate::import::ron::bounded;
use crate::scene::{DEFAULT_FOV_DEG, View as Seen};

pub(super) use place::{View, fit};

/// A camera as a file describes it. Whatever is left out takes its default; without a position and a target the camera
/// is fitted to what it looks at.
///
/// Lengths are in scene units. The world is that of the house: right-handed, y up.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct CameraSpec {
    /// Pixels across, 512 by default.
    #[serde(deserialize_with = "bounded::side")]
    width: Option<u32>,
    /// Pixels down, 512 by default.
    #[serde(deserialize_with = "bounded::side")]
    height: Option<u32>,
    /// Samples in a pixel, 16 by default.
    #[serde(deserialize_with = "bounded::samples")]
    samples: Option<u32>,
    /// Seed of the samples, 1 by default.
    seed: Option<u64>,
    /// Shape of the aperture, a disk by default.
    lens_shape: LensShape,
    /// Vertical field of view in degrees, 40 by default.
    #[serde(deserialize_with = "bounded::field_of_view", skip_serializing_if = "Option::is_none")]
    fov_deg: Option<f64>,
    /// Height of what is seen, at any depth: an orthographic view, instead of a field of view.
    #[serde(deserialize_with = "bounded::height", skip_serializing_if = "Option::is_none")]
    view_height: Option<f64>,
    /// Where it is when the shutter opens.
    #[serde(deserialize_with = "bounded::vector")]
    position: Option<[f64; 3]>,
    /// What it looks at.
    #[serde(alias = "look_at", deserialize_with = "bounded::vector")]
    target: Option<[f64; 3]>,
    /// Which way is up, +y by default.
    #[serde(deserialize_with = "bounded::vector")]
    up: Option<[f64; 3]>,
    /// Where it is when the shutter closes.
    #[serde(deserialize_with = "bounded::vector", skip_serializing_if = "Option::is_none")]
    end_position: Option<[f64; 3]>,
    /// What it looks at by then.
    #[serde(
        alias = "end_look_at",
        deserialize_with = "bounded::vector",
        skip_serializing_if = "Option::is_none"
    )]
    end_target: Option<[f64; 3]>,
    /// Which way is up by then.
    #[serde(deserialize_with = "bounded::vector", skip_serializing_if = "Option::is_none")]
    end_up: Option<[f64; 3]>,
    /// Radius of the lens; zero, the default, is a pinhole.
    #[serde(deserialize_with = "bounded::radius")]
    lens_radius: Option<f32>,
    /// Depth at which the lens is sharp; that of the target by default.
    #[serde(deserialize_with = "bounded::depth", skip_serializing_if = "Option::is_none")]
    focus: Option<f32>,
    /// How far the image is moved to the right and down, in image heights.
    #[serde(deserialize_with = "bounded::vector")]
    shift: Option<[f64; 2]>,
    /// Depth below which nothing is seen; a thousandth of that of the target by default.
    #[serde(deserialize_with = "bounded::depth")]
    near: Option<f32>,
}

impl CameraSpec {
    /// Reads the camera at `path`.
    ///
    /// # Errors
    /// When it cannot be read, or as [`Self::parse`].
    pub fn load(path: &Path) -> Result<Self, LoadError> {
        if path.is_dir() {
            return Err(Source { path }.unreadable(std::io::ErrorKind::IsADirectory.into()));
        }
        let name = path.display().to_string();
        let text =
            std::fs::read_to_string(path).map_err(|source| SpecError::Read { path: name.clone(), source })?;
        Self::parse(&text, &name)
    }

    /// Reads the RON in `text`; `file` names it in messages.
    ///
    /// # Errors
    /// With line and column where the text is no camera; where its parts do not go together, with their names.
    pub fn parse(text: &str, file: &str) -> Result<Self, LoadError> {
        let spec: Self = activity::spec::parse(text, file)?;
        let describe = |(place, message): Wrong| LoadError::Description {
            file: file.to_owned(),
            place: place.to_owned(),
            message,
        };
        spec.check().map_err(describe)?;
        // What a camera that has a place comes to is known here, where its file is.
        if spec.is_placed() {
            spec.completed().view().map(|_| spec.clone()).map_err(describe)
        } else {
            Ok(spec)
        }
    }

    /// The camera as a file, in RON.
    pub fn to_ron(&self) -> String {
        let options =
            ron::Options::default().with_default_extension(ron::extensions::Extensions::IMPLICIT_SOME);
        let style = ron::ser::PrettyConfig::new().compact_arrays(true);
        // Numbers and names always have a RON form.
        options.to_string_pretty(self, style).unwrap_or_default()
    }

    /// Whether it says where it is, rather than wanting to be fitted.
    pub fn is_placed(&self) -> bool {
        self.position.is_some() && self.target.is_some()
    }

    fn check(&self) -> Result<(), Wrong> {
        let ensure = |holds: bool, place, message: &str| {
            if holds { Ok(()) } else { Err((place, message.to_owned())) }
        };
        ensure(
            self.position.is_some() == self.target.is_some(),
            "camera",
            "`position` and `target` go together: give both, or none to have the camera fitted",
        )?;
        let ends = [self.end_position, self.end_target, self.end_up];
        ensure(
            self.is_placed() || ends.iter().all(Option::is_none),
            "camera",
            "it has an end but no start: give `position` and `target`, too",
        )?;
        self.seen()?;
        ensure(
            self.view_height.is_none() || self.is_placed(),
            "camera",
            "an orthographic camera (`view_height`) is not fitted: give `position` and `target`, too",
        )?;
        ensure(
            self.focus.is_none() || self.radius() > 0.0,
            "focus",
            "there is no lens to focus: give a `lens_radius` above zero, too, or leave it out",
        )
    }

    pub(super) fn samples(&self) -> u32 {
        self.samples.unwrap_or(16)
    }

    pub(super) fn seed(&self) -> u64 {
        self.seed.unwrap_or(1)
    }

    pub(super) fn shape(&self) -> LensShape {
        self.lens_shape
    }

    /// Width and height in pixels.
    pub(super) fn size(&self) -> [u32; 2] {
        [self.width, self.height].map(|side| side.unwrap_or(512))
    }

    fn radius(&self) -> f32 {
        self.lens_radius.unwrap_or(0.0)
    }

    fn field_of_view(&self) -> f64 {
        self.fov_deg.unwrap_or(DEFAULT_FOV_DEG)
    }

    /// How much it sees.
    fn seen(&self) -> Result<Seen, Wrong> {
        Seen::given(self.fov_deg, self.view_height).map_err(|message| ("camera", message))
    }
}

/// What of a camera is wrong, and how, in words.
pub(super) type Wrong = (&'static str, String);

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
            ("(seed: -1)", ["c.ron:1:", "out of bounds"]),
            ("(lens_shape: Disc)", ["c.ron:1:", "unknown variant `Disc`, did you mean `Disk`?"]),
            ("(fov_deg: 180)", ["c.ron:1:", "0.1 to 175 degrees"]),
            ("(view_height: 0)", ["c.ron:1:", "above zero"]),
            ("(view_height: -2)", ["c.ron:1:", "above zero"]),
            ("(view_height: NaN)", ["c.ron:1:", "above zero"]),
            ("(view_height: inf)", ["c.ron:1:", "above zero"]),
            ("(view_height: 2)", ["c.ron: camera:", "give `position` and `target`"]),
            (
                "(position: (0, 0, 5), target: (0, 0, 0), fov_deg: 40, view_height: 2)",
                ["c.ron: camera:", "leave one out"],
            ),
            ("(position: (0, NaN, 0))", ["c.ron:1:", "finite numbers"]),
            ("(shift: (0, inf))", ["c.ron:1:", "finite numbers"]),
            ("(position: (0, 0))", ["c.ron:1:", "3"]),
            ("(near: 0)", ["c.ron:1:", "above zero"]),
            ("(lens_radius: -1)", ["c.ron:1:", "zero upwards"]),
            ("(focus: 3)", ["c.ron: focus:", "give a `lens_radius`"]),
            ("(position: (0, 0, 1))", ["c.ron: camera:", "give both"]),
            ("(target: (0, 0, 1))", ["c.ron: camera:", "give both"]),
            ("(end_up: (0, 0, 1))", ["c.ron: camera:", "give `position` and `target`"]),
            ("(position: (1, 0, 1), target: (1, 0, 1))", ["c.ron: target:", "move one of them"]),
            (
                "(position: (1, 0, 1), target: (0, 0, 0), end_target: (1, 0, 1))",
                ["c.ron: end_target:", "move one"],
            ),
            ("(position: (0, 0, 1e-60), target: (0, 0, 0))", ["c.ron: near:", "above zero"]),
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
    fn a_camera_written_is_the_camera_read() {
        let text = "(width: 64, seed: 18446744073709551615, lens_shape: Square, position: (0.1, 1e-9, 3), \
                    look_at: (0, 0, 0), end_position: (0, 1, 3), lens_radius: 0.1, focus: 2.7, shift: (0.5, -0.25))";
        let spec = parse(text).unwrap().completed();
        let written = spec.to_ron();
        assert_eq!(parse(&written).unwrap(), spec, "{written}");
        assert!(written.contains("end_position") && !written.contains("end_target"), "{written}");
        let flat = parse("(position: (0, 0, 3), target: (0, 0, 0), view_height: 2.5)").unwrap().completed();
        let written = flat.to_ron();
        assert_eq!(parse(&written).unwrap(), flat, "{written}");
        assert!(written.contains("view_height") && !written.contains("fov_deg"), "{written}");
        assert!(parse("()").unwrap() == CameraSpec::default() && !CameraSpec::default().is_placed());
    }
}
