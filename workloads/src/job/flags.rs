//! Run options (flags) that change the settings of a scene, and which of them a job uses.

use crate::error::LoadError;
use crate::scene::Overrides;

/// One of [`Overrides`]. All jobs use frames and frame rate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Flag {
    Size,
    Samples,
    Shutter,
    Lens,
    Focus,
    Table,
    Clip,
    Camera,
}

/// Flags that a job uses.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Flags {
    /// Used flags; others would have no effect and are refused.
    pub uses: &'static [Flag],
    /// Job options that replace an unused flag.
    pub instead: &'static [(Flag, &'static str)],
}

impl Flags {
    /// Refuses flags without effect; `job` is the job's name.
    pub fn check(&self, job: &str, overrides: &Overrides) -> Result<(), LoadError> {
        let Some(flag) = given(overrides).find(|flag| !self.uses.contains(flag)) else { return Ok(()) };
        let option = self.instead.iter().find(|(other, _)| *other == flag);
        let remedy = option
            .map_or("leave it out".to_owned(), |(_, option)| format!("give --set {option}=... instead"));
        let message = format!("the workload `{job}` has no use for it: {remedy}");
        Err(LoadError::Setting { setting: flag.name(), message })
    }

    /// Name of the job option that stands for `--size`, if there is one.
    pub fn instead_of_size(&self) -> Option<&'static str> {
        self.instead.iter().find(|(flag, _)| *flag == Flag::Size).map(|(_, option)| *option)
    }
}

impl Flag {
    const fn name(self) -> &'static str {
        match self {
            Self::Size => "--size",
            Self::Samples => "--samples",
            Self::Shutter => "--shutter",
            Self::Lens => "--lens",
            Self::Focus => "--focus",
            Self::Table => "--table",
            Self::Clip => "--clip",
            Self::Camera => "--camera",
        }
    }
}

/// Flags with a value.
fn given(overrides: &Overrides) -> impl Iterator<Item = Flag> {
    // The full pattern makes the compiler report new fields.
    let Overrides {
        size,
        samples,
        frame_rate_hz: _,
        shutter,
        frames: _,
        lens_radius,
        focus,
        table,
        clip,
        camera,
    } = overrides;
    let all = [
        (Flag::Size, size.is_some()),
        (Flag::Samples, samples.is_some()),
        (Flag::Shutter, shutter.is_some()),
        (Flag::Lens, lens_radius.is_some()),
        (Flag::Focus, focus.is_some()),
        (Flag::Table, table.is_some()),
        (Flag::Clip, clip.is_some()),
        (Flag::Camera, camera.is_some()),
    ];
    all.into_iter().filter(|(_, given)| *given).map(|(flag, _)| flag)
}
