//! RON scene files: what is in them ([`spec`]), and scenes made from that.

mod object;
mod spec;

use std::path::Path;

use glam::{DVec3, Vec3};
use warnings::{Code, Warning};

use crate::error::{LoadError, Source};
use crate::material::Light;
use crate::scene::{CameraSpec, Parts, Rig, SceneCamera, Settings};
use spec::{LightSpec, SceneSpec, SettingsSpec};

/// Reads the scene at `path`.
pub(super) fn import(path: &Path) -> Result<Parts, LoadError> {
    // A folder and a file that is not text have different remedies.
    if path.is_dir() {
        return Err(Source { path }.unreadable(std::io::ErrorKind::IsADirectory.into()));
    }
    let spec: SceneSpec = activity::spec::load(path)?;
    build(spec, path)
}

/// A scene file being turned into a scene.
#[derive(Clone, Copy)]
struct Context<'a> {
    path: &'a Path,
}

impl Context<'_> {
    fn wrong(self, place: impl Into<String>, message: impl Into<String>) -> LoadError {
        let file = self.path.display().to_string();
        LoadError::Description { file, place: place.into(), message: message.into() }
    }

    /// A sample table: a name stays one, a file is relative to the scene.
    fn table(self, name: &str) -> String {
        if Path::new(name).extension().is_none() {
            name.to_owned()
        } else {
            self.beside(name).display().to_string()
        }
    }

    /// A file named in the scene, relative to it.
    fn beside(self, name: &str) -> std::path::PathBuf {
        self.path.parent().map_or_else(|| Path::new(name).to_path_buf(), |folder| folder.join(name))
    }

    /// An error of a file that the scene names as `name`: one that cannot be read is reported where it is named.
    fn named(self, name: &str, error: LoadError) -> LoadError {
        let LoadError::Read { file, source } = error else { return error };
        let text = activity::spec::read(self.path).unwrap_or_default();
        let quoted = format!("\"{name}\"");
        let at = text.lines().enumerate().find_map(|(line, text)| Some((line, text.find(&quoted)?)));
        let place = at.map_or(String::new(), |(line, column)| format!(":{}:{}", line + 1, column + 1));
        LoadError::Read { file: format!("{}{place}: {file}", self.path.display()), source }
    }
}

fn build(spec: SceneSpec, path: &Path) -> Result<Parts, LoadError> {
    let context = Context { path };
    let mut parts = Parts::new(spec.name.unwrap_or_else(|| path.display().to_string()));
    parts.settings = settings(context, &spec.settings);
    if let Some(camera) = &spec.camera {
        take_lens(context, camera, &spec.settings, &mut parts.settings)?;
    }
    // The settings are checked with the scene, but an object's default timing needs a rate that makes sense.
    parts.settings.check().map_err(|error| context.wrong("settings", error.to_string()))?;
    if let Some(background) = spec.background {
        parts.background = color(context, "background", background)?;
    }
    if let Some(light) = &spec.light {
        parts.light = lamp(context, light)?;
    }
    if spec.objects.is_empty() {
        return Err(context.wrong("objects", "there are none: add a `file` or a `shape`"));
    }
    for (index, object) in spec.objects.iter().enumerate() {
        object::add(context, &mut parts, index, object)?;
    }
    if let Some(camera) = &spec.camera {
        parts.camera = looking(context, camera, &parts.settings)?;
    }
    if matches!(parts.camera.rig, Rig::Fitted(_)) && parts.settings.focus.is_some() {
        let message = "`focus` is a depth from a camera that is placed by itself: give the scene a `camera` to be sure of it";
        parts.warnings.push(Warning::new(Code::FocusOfFittedCamera, message));
    }
    Ok(parts)
}

fn settings(context: Context, spec: &SettingsSpec) -> Settings {
    let plain = Settings::default();
    let (start, end) = spec.frames.unwrap_or((0, 12));
    Settings {
        width: spec.width.unwrap_or(plain.width),
        height: spec.height.unwrap_or(plain.height),
        samples: spec.samples.unwrap_or(plain.samples),
        frame_rate_hz: spec.frame_rate_hz.unwrap_or(plain.frame_rate_hz),
        shutter: spec.shutter.unwrap_or(plain.shutter),
        frames: start..end,
        lens_radius: spec.lens_radius.unwrap_or(plain.lens_radius),
        focus: spec.focus,
        table: spec.table.as_ref().map_or(plain.table, |table| context.table(table)),
    }
}

/// A linear RGB value that is finite and not below zero.
fn color(context: Context, place: &str, value: [f32; 3]) -> Result<Vec3, LoadError> {
    let usable = value.iter().all(|part| part.is_finite() && *part >= 0.0);
    let message = "a colour is linear RGB: three finite numbers from zero upwards";
    if usable { Ok(Vec3::from_array(value)) } else { Err(context.wrong(place, message)) }
}

/// Three finite numbers.
fn vector(context: Context, place: &str, value: [f64; 3]) -> Result<DVec3, LoadError> {
    let value = DVec3::from_array(value);
    if value.is_finite() {
        Ok(value)
    } else {
        Err(context.wrong(place, "it has a value that is NaN or infinite: give three finite numbers"))
    }
}

fn lamp(context: Context, spec: &LightSpec) -> Result<Light, LoadError> {
    let plain = Light::default();
    let shade = |place: &str, value: Option<[f32; 3]>, otherwise: Vec3| {
        value.map_or(Ok(otherwise), |value| color(context, place, value))
    };
    let toward = match spec.toward {
        Some(toward) => {
            let toward = vector(context, "light.toward", toward)?;
            let length = toward.length();
            if !(length.is_finite() && length > 0.0) {
                return Err(
                    context.wrong("light.toward", "it has no length: point it from the scene to the lamp")
                );
            }
            Some((toward / length).as_vec3())
        }
        None => None,
    };
    Ok(Light {
        toward,
        color: shade("light.color", spec.color, plain.color)?,
        sky: shade("light.sky", spec.sky, plain.sky)?,
        ground: shade("light.ground", spec.ground, plain.ground)?,
    })
}

/// The lens may stand beside the camera or in the settings, not in both.
fn take_lens(
    context: Context,
    camera: &CameraSpec,
    given: &SettingsSpec,
    settings: &mut Settings,
) -> Result<(), LoadError> {
    let image = [
        ("width", camera.width.is_some()),
        ("height", camera.height.is_some()),
        ("samples", camera.samples.is_some()),
    ];
    if let Some((field, _)) = image.into_iter().find(|(_, given)| *given) {
        return Err(context
            .wrong(format!("camera.{field}"), format!("it belongs in `settings`: put `{field}` there")));
    }
    let twice = [
        ("lens_radius", camera.lens_radius.is_some() && given.lens_radius.is_some()),
        ("focus", camera.focus.is_some() && given.focus.is_some()),
    ];
    if let Some((field, _)) = twice.into_iter().find(|(_, twice)| *twice) {
        return Err(context.wrong(format!("camera.{field}"), "`settings` has one, too: remove one of them"));
    }
    settings.lens_radius = camera.lens_radius.unwrap_or(settings.lens_radius);
    // A camera that says it is a pinhole may say where a lens would be sharp.
    let focus = camera.focus.filter(|_| camera.lens_radius != Some(0.0));
    settings.focus = focus.or(settings.focus);
    Ok(())
}

fn looking(context: Context, spec: &CameraSpec, settings: &Settings) -> Result<SceneCamera, LoadError> {
    let place = |field: &str| if field == "camera" { field.to_owned() } else { format!("camera.{field}") };
    spec.check()
        .and_then(|()| spec.scene_camera(settings))
        .map_err(|(field, message)| context.wrong(place(field), message))
}

/// Errors in a file that a scene names point at that file.
fn broken(path: &Path, place: &str, message: String) -> LoadError {
    Source { path }.broken(place, message)
}
