//! The GPU file.

use std::path::Path;

use activity::spec;
use pipeline::PipelineSpec;
use serde::Deserialize;
use timing::{Clocks, MachineSpec};

/// A GPU. `docs/gpu.md` documents every field.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GpuSpec {
    /// What it is called.
    pub name: String,
    /// What it stands for, in a sentence.
    pub doc: String,
    /// Clock of everything but memory, in hertz.
    pub core_hz: f64,
    /// Clock of memory, in hertz.
    pub memory_hz: f64,
    /// Sizes of the pipeline.
    pub pipeline: PipelineSpec,
    /// Rates, latencies, queues and clocks of each unit.
    pub units: MachineSpec,
}

/// Why a GPU cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum GpuError {
    /// The file cannot be read or parsed.
    #[error(transparent)]
    Spec(#[from] spec::SpecError),
    /// A value cannot be.
    #[error("{file}: {message}")]
    Value {
        /// The file as it was named.
        file: String,
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

/// The GPUs that come with the program: name and file.
const BUILTIN: [(&str, &str); 4] = [
    ("reference", include_str!("../../gpus/reference.ron")),
    ("mobile", include_str!("../../gpus/mobile.ron")),
    ("discrete", include_str!("../../gpus/discrete.ron")),
    ("hd_4000", include_str!("../../gpus/hd_4000.ron")),
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
    pub fn load(name: &str) -> Result<Self, GpuError> {
        if let Some((_, text)) = BUILTIN.iter().find(|(known, _)| *known == name) {
            return Self::parse(text, name);
        }
        if !name.ends_with(".ron") {
            let known: Vec<_> = Self::names().collect();
            let suggestion = spec::suggestion(name, &known);
            return Err(GpuError::Unknown { name: name.to_owned(), suggestion });
        }
        spec::load::<Self>(Path::new(name)).map_err(GpuError::from)?.validated(name)
    }

    /// A GPU from RON text; `file` stands for the file in messages.
    ///
    /// # Errors
    /// When the text has a mistake.
    pub fn parse(text: &str, file: &str) -> Result<Self, GpuError> {
        spec::parse::<Self>(text, file)?.validated(file)
    }

    /// Both clocks in one time.
    pub fn clocks(&self) -> Option<Clocks> {
        Clocks::new(self.core_hz, self.memory_hz)
    }

    fn validated(self, file: &str) -> Result<Self, GpuError> {
        let wrong = |message: String| Err(GpuError::Value { file: file.to_owned(), message });
        for (field, value) in [("core_hz", self.core_hz), ("memory_hz", self.memory_hz)] {
            if !(1e3..=1e12).contains(&value) {
                return wrong(format!("`{field}` is {value}; a clock has to be 1e3 to 1e12 hertz"));
            }
        }
        if self.clocks().is_none() {
            return wrong(format!(
                "`core_hz` {} and `memory_hz` {} have no common cycle in reach; round them to megahertz",
                self.core_hz, self.memory_hz
            ));
        }
        if let Err(message) = self.units.validate() {
            return wrong(message);
        }
        match self.pipeline.validate() {
            Ok(()) => Ok(self),
            Err(error) => wrong(format!("`pipeline`: {error}")),
        }
    }
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
        assert!(text.contains("above zero"), "{text}");
        let text = message(&REFERENCE.replace("\"indices\": 1", "\"depth_reads\": 1"));
        assert!(text.contains("belongs in `units.depth`"), "{text}");
        let text = message(&REFERENCE.replace("coarse_tile_px: 32", "coarse_tile_px: 30"));
        assert!(text.contains("coarse_tile_px"), "{text}");
    }

    #[test]
    fn an_unknown_name_gets_a_suggestion() {
        let text = GpuSpec::load("referense").unwrap_err().to_string();
        assert!(text.contains("did you mean `reference`?"), "{text}");
    }
}
