//! Flags that change the settings of a scene: which of them a job has a use for.

use crate::error::LoadError;
use crate::scene::Overrides;

/// One of [`Overrides`]. Frames and their rate are of use to every job.
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

/// What a job makes of them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Flags {
    /// Those that it has a use for; the others would change nothing and are refused.
    pub uses: &'static [Flag],
    /// Options of the job that do what some of the others would do.
    pub instead: &'static [(Flag, &'static str)],
}

impl Flags {
    /// Refuses what would be ignored; `job` is its name.
    pub fn check(&self, job: &str, overrides: &Overrides) -> Result<(), LoadError> {
        let Some(flag) = given(overrides).find(|flag| !self.uses.contains(flag)) else { return Ok(()) };
        let option = self.instead.iter().find(|(other, _)| *other == flag);
        let mend = option
            .map_or("leave it out".to_owned(), |(_, option)| format!("give --set {option}=... instead"));
        let message = format!("the workload `{job}` has no use for it: {mend}");
        Err(LoadError::Setting { setting: flag.name(), message })
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

/// The flags that were given.
fn given(overrides: &Overrides) -> impl Iterator<Item = Flag> {
    // Taken apart whole, so that none that is added later is forgotten.
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
