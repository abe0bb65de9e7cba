//! Which camera sees a scene: one of its own, one that is described, or one that is placed by itself.

use super::Scene;
use super::camera::{Rig, SceneCamera};
use super::camera_spec::{CameraSpec, FORMS};
use super::camera_used::CameraSource;
use super::settings::Overrides;
use crate::error::LoadError;

/// A camera that a scene brings along.
#[derive(Clone, Debug, PartialEq)]
pub struct OwnCamera {
    /// Its name.
    pub name: String,
    /// The camera.
    pub camera: SceneCamera,
}

/// Name of the camera of a scene whose cameras have none.
const UNNAMED: &str = "scene";

/// The scene's own cameras, and where the one that sees it comes from.
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

/// What a camera says about its lens and its image.
#[derive(Clone, Debug, Default)]
pub(super) struct CameraSettings {
    size: Option<(u32, u32)>,
    samples: Option<u32>,
    lens_radius: Option<f32>,
    focus: Option<f32>,
}

impl CameraSettings {
    /// `overrides` with what the camera says where they say nothing.
    pub fn over(&self, overrides: &Overrides) -> Overrides {
        let lens_radius = overrides.lens_radius.or(self.lens_radius);
        // A camera that says it is a pinhole may say where a lens would be sharp.
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
    /// Takes the camera that `overrides` ask for; gives what it says beside its place.
    ///
    /// # Errors
    /// When there is no such camera, or what describes it is wrong.
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

    /// Another camera sees the scene from now on: the focus depth of the one before means nothing to it.
    fn take_camera(&mut self, camera: SceneCamera, source: CameraSource) {
        if camera != self.camera {
            self.settings.focus = None;
        }
        (self.camera, self.camera_source) = (camera, source);
    }

    /// Index of the scene's own camera called `wanted`, or with that number.
    fn own_camera(&self, wanted: &str) -> Option<usize> {
        let by_name = self.cameras.iter().position(|own| own.name == wanted);
        by_name.or_else(|| wanted.parse().ok().filter(|index| *index < self.cameras.len()))
    }

    /// `error`, with the cameras that there are where it says that `wanted` is none.
    fn no_camera(&self, wanted: &str, error: LoadError) -> LoadError {
        let LoadError::Setting { setting, .. } = error else { return error };
        let names: Vec<&str> = self.cameras.iter().map(|own| own.name.as_str()).collect();
        let own = match names[..] {
            [] => "the scene has none of its own".to_owned(),
            _ => activity::spec::suggestion(wanted, &names),
        };
        LoadError::Setting { setting, message: format!("there is no camera `{wanted}`: {own}; {FORMS}") }
    }
}
