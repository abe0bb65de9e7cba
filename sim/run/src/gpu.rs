//! GPU file, and the check that platform and energy table belong to the GPU.

use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use activity::spec;
use pipeline::PipelineSpec;
use power_model::{EnergyTable, Platform};
use serde::Deserialize;
use timing::{Clocks, Machine, MachineSpec, TimingError};
use warnings::{Code, Warning};

use crate::RunOptions;

/// A GPU. `docs/gpu.md` documents every field.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GpuSpec {
    /// What it is called.
    pub name: String,
    /// What it stands for, in a sentence.
    pub doc: String,
    /// The platform and the energy table that its watts are modelled with; nothing where none belongs to it.
    #[serde(default)]
    pub power: Option<PowerFiles>,
    /// Clock of everything but memory, in hertz.
    pub core_hz: f64,
    /// Clock of memory, in hertz.
    pub memory_hz: f64,
    /// Sizes of the pipeline.
    pub pipeline: PipelineSpec,
    /// Rates, latencies, queues and clocks of each unit.
    pub units: MachineSpec,
}

/// A platform and an energy table, each a name or a file whose name ends in `.ron`.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PowerFiles {
    /// The platform.
    pub platform: String,
    /// The energy table.
    pub energy: String,
}

impl PowerFiles {
    /// Takes names of files as relative to the folder of `file`.
    fn beside(&mut self, file: &Path) {
        for name in [&mut self.platform, &mut self.energy] {
            if name.ends_with(".ron") {
                *name = file.with_file_name(&*name).display().to_string();
            }
        }
    }
}

impl Default for PowerFiles {
    /// Those of the reference, which also serve a GPU to which none belong.
    fn default() -> Self {
        Self { platform: "reference".to_owned(), energy: "28nm".to_owned() }
    }
}

/// Why a GPU cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum GpuError {
    /// The file cannot be read or parsed.
    #[error(transparent)]
    Spec(#[from] spec::SpecError),
    /// A value cannot be.
    #[error("{place}: {message}")]
    Value {
        /// The file as it was named, with line and column where the value stands in it.
        place: String,
        /// Which value, what is wrong with it and what would do.
        message: String,
    },
    /// No GPU has this name.
    #[error("no GPU called `{name}`; {suggestion}; or name a .ron file")]
    Unknown {
        /// What was asked for.
        name: String,
        /// The nearest name, or all of them.
        suggestion: String,
    },
}

/// Clocks of a GPU: from a model on an FPGA to ten times what is built.
const CLOCKS_HZ: RangeInclusive<f64> = 1e6..=1e11;

/// The GPUs that come with the program: name and file.
const BUILTIN: [(&str, &str); 4] = [
    ("reference", include_str!("../gpus/reference.ron")),
    ("mobile", include_str!("../gpus/mobile.ron")),
    ("discrete", include_str!("../gpus/discrete.ron")),
    ("hd_4000", include_str!("../gpus/hd_4000.ron")),
];

impl GpuSpec {
    /// Names of the GPUs that come with the program.
    pub fn names() -> impl Iterator<Item = &'static str> {
        BUILTIN.iter().map(|(name, _)| *name)
    }

    /// The GPU called `name`, or in the file of that name when it ends in `.ron`.
    ///
    /// # Errors
    /// When there is none, or its file has a mistake.
    pub fn load(name: impl AsRef<Path>) -> Result<Self, GpuError> {
        let path = name.as_ref();
        let name = &*path.to_string_lossy();
        if let Some((_, text)) = BUILTIN.iter().find(|(known, _)| *known == name) {
            return Self::parse(text, name);
        }
        if path.extension().is_none_or(|ending| ending != "ron") {
            let known: Vec<_> = Self::names().collect();
            let suggestion = spec::suggestion(name, &known);
            return Err(GpuError::Unknown { name: name.to_owned(), suggestion });
        }
        let mut gpu = Self::parse(&spec::read(path)?, name)?;
        if let Some(power) = &mut gpu.power {
            power.beside(path);
        }
        Ok(gpu)
    }

    /// A GPU from RON text; `file` stands for the file in messages.
    ///
    /// # Errors
    /// When the text has a mistake.
    pub fn parse(text: &str, file: &str) -> Result<Self, GpuError> {
        let spec: Self = spec::parse(text, file)?;
        match spec.validate() {
            Ok(()) => Ok(spec),
            Err((field, message)) => {
                let place = spec::place_of(text, &field)
                    .map_or_else(|| file.to_owned(), |(line, column)| format!("{file}:{line}:{column}"));
                Err(GpuError::Value { place, message })
            }
        }
    }

    /// What its time depends on.
    ///
    /// # Errors
    /// When the GPU was not validated.
    pub fn machine(&self) -> Result<Machine<'_>, TimingError> {
        let clocks = self.clocks().ok_or_else(|| TimingError::Clocks(self.name.clone()))?;
        Ok(Machine { units: &self.units, clocks, batch_triangles: self.pipeline.batch_triangles })
    }

    /// Both clocks in one time.
    pub fn clocks(&self) -> Option<Clocks> {
        Clocks::new(self.core_hz, self.memory_hz)
    }

    /// Checks what the types of single fields do not; on failure the field and what is wrong with it.
    fn validate(&self) -> Result<(), (String, String)> {
        for (field, value) in [("core_hz", self.core_hz), ("memory_hz", self.memory_hz)] {
            if !CLOCKS_HZ.contains(&value) {
                let [slow, fast] = [CLOCKS_HZ.start(), CLOCKS_HZ.end()];
                let message = format!("`{field}` is {value:?}; a clock has to be {slow:e} to {fast:e} hertz");
                return Err((field.to_owned(), message));
            }
        }
        if self.clocks().is_none() {
            let message = format!(
                "`core_hz` {:?} and `memory_hz` {:?} have no common cycle in reach; round them to megahertz",
                self.core_hz, self.memory_hz
            );
            return Err(("memory_hz".to_owned(), message));
        }
        self.units.validate().map_err(|(field, message)| (format!("units.{field}"), message))?;
        self.pipeline
            .validate()
            .map_err(|error| (format!("pipeline.{}", error.field()), format!("`pipeline`: {error}")))
    }
}

/// A warning where the GPU's file names another platform or energy table than those in use, or none: the watts of a platform
/// are stated for the size and the clock of one GPU, and nothing scales them.
pub(super) fn check_pairing(
    options: &RunOptions,
    gpu: &GpuSpec,
    platform: &Platform,
    table: &EnergyTable,
) -> Option<Warning> {
    let in_use = format!("platform `{}` and energy table `{}`", platform.name, table.name());
    let message = match &gpu.power {
        None => format!(
            "no platform belongs to GPU `{}`, so its watts come from {in_use}, which were made for another machine: compare its \
             cycles and counts, not its watts; or write a platform for it and name that as `power` in the GPU file",
            gpu.name
        ),
        Some(own) if belongs(own, options, platform, table) => return None,
        Some(own) => format!(
            "GPU `{}` belongs to platform `{}` and energy table `{}`, and its watts come from {in_use}: they are those of another \
             machine; leave --platform and --energy out, or choose the GPU that belongs to them (`quintile list`)",
            gpu.name, own.platform, own.energy
        ),
    };
    Some(Warning::new(Code::PlatformMismatch, message))
}

/// By the names in the files, or by what was asked for where that is a file itself.
fn belongs(own: &PowerFiles, options: &RunOptions, platform: &Platform, table: &EnergyTable) -> bool {
    let is = |own: &str, asked: &Option<PathBuf>, name: &str| {
        own == name || asked.as_ref().is_none_or(|asked| asked == Path::new(own))
    };
    is(&own.platform, &options.platform, &platform.name) && is(&own.energy, &options.energy, table.name())
}

#[cfg(test)]
mod tests {
    use super::*;

    const REFERENCE: &str = BUILTIN[0].1;

    fn message(text: &str) -> String {
        GpuSpec::parse(text, "gpu.ron").unwrap_err().to_string()
    }

    #[test]
    fn every_builtin_gpu_is_valid() {
        for name in GpuSpec::names() {
            assert_eq!(GpuSpec::load(name).unwrap().name, name);
        }
    }

    #[test]
    fn mistakes_name_their_place() {
        let text = message(&REFERENCE.replace("tile_px: 8", "tile_pz: 8"));
        assert!(text.starts_with("gpu.ron:") && text.contains("did you mean `tile_px`?"), "{text}");
        let text = message(&REFERENCE.replace("\"samples_resolved\"", "\"samples_resolve\""));
        assert!(text.contains("did you mean `samples_resolved`?"), "{text}");
        let text = message(&REFERENCE.replace("\"indices\": 1", "\"indices\": -1"));
        assert!(text.contains("`indices`: -1.0 is out of range"), "{text}");
        let text = message(&REFERENCE.replace("\"indices\": 1", "\"depth_reads\": 1"));
        assert!(text.contains("belongs in `units.depth`"), "{text}");
        let text = message(&REFERENCE.replace("coarse_tile_px: 32", "coarse_tile_px: 30"));
        assert!(text.starts_with("gpu.ron:11:25: ") && text.contains("coarse_tile_px"), "{text}");
    }

    #[test]
    fn sizes_beyond_any_hardware_are_refused_with_their_line() {
        let text =
            message(&REFERENCE.replace("queue: 8, lines_per_cycle", "queue: 4294967295, lines_per_cycle"));
        assert!(
            text.starts_with("gpu.ron:53:")
                && text.contains("`queue`: 4294967295 is out of range; it has to be 1 to 65536"),
            "{text}"
        );
    }

    #[test]
    fn an_unknown_name_gets_a_suggestion() {
        let text = GpuSpec::load("referense").unwrap_err().to_string();
        assert!(text.contains("did you mean `reference`?"), "{text}");
    }
}
