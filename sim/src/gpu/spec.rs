//! The GPU file.

use std::path::Path;

use activity::{Unit, spec};
use pipeline::PipelineSpec;
use serde::Deserialize;

use super::Rates;

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
    /// Rates, latencies and queues of each unit.
    pub units: Units,
}

/// A clock domain.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
pub enum Clock {
    /// `core_hz`.
    #[default]
    Core,
    /// `memory_hz`.
    Memory,
}

/// How fast one unit works.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct UnitSpec {
    /// The clock its cycles are counted in.
    #[serde(default)]
    pub clock: Clock,
    /// Cycles from the end of its work on a packet until the next unit sees it.
    pub latency_cycles: u32,
    /// Packets that may wait in front of it, at least 1.
    pub queue: u32,
    /// Events per cycle. The parts of a unit work side by side: the slowest sets the pace.
    pub rates: Rates,
}

/// The spec of every unit.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs, reason = "the fields are the units, documented there")]
pub struct Units {
    pub command: UnitSpec,
    pub shader: UnitSpec,
    pub setup: UnitSpec,
    pub traversal: UnitSpec,
    pub z_cull: UnitSpec,
    pub sample_test: UnitSpec,
    pub depth: UnitSpec,
    pub shading_cache: UnitSpec,
    pub texture: UnitSpec,
    pub colour: UnitSpec,
    pub l2: UnitSpec,
    pub dram: UnitSpec,
}

impl Units {
    /// The spec of `unit`.
    pub fn get(&self, unit: Unit) -> &UnitSpec {
        match unit {
            Unit::Command => &self.command,
            Unit::Shader => &self.shader,
            Unit::Setup => &self.setup,
            Unit::Traversal => &self.traversal,
            Unit::ZCull => &self.z_cull,
            Unit::SampleTest => &self.sample_test,
            Unit::Depth => &self.depth,
            Unit::ShadingCache => &self.shading_cache,
            Unit::Texture => &self.texture,
            Unit::Colour => &self.colour,
            Unit::L2 => &self.l2,
            Unit::Dram => &self.dram,
        }
    }
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
const BUILTIN: [(&str, &str); 1] = [("reference", include_str!("../../gpus/reference.ron"))];

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

    /// Cycles of `clock` in a second.
    pub fn clock_hz(&self, clock: Clock) -> f64 {
        match clock {
            Clock::Core => self.core_hz,
            Clock::Memory => self.memory_hz,
        }
    }

    fn validated(self, file: &str) -> Result<Self, GpuError> {
        let wrong = |message: String| Err(GpuError::Value { file: file.to_owned(), message });
        for (field, value) in [("core_hz", self.core_hz), ("memory_hz", self.memory_hz)] {
            if !(1e3..=1e12).contains(&value) {
                return wrong(format!("`{field}` is {value}; a clock has to be 1e3 to 1e12 hertz"));
            }
        }
        for unit in Unit::ALL {
            let spec = self.units.get(unit);
            if spec.queue == 0 {
                return wrong(format!("`units.{}.queue` is 0; a queue holds at least 1 packet", unit.name()));
            }
            if let Some((event, _)) = spec.rates.iter().find(|(event, _)| event.unit() != unit) {
                let (event, owner) = (event.name(), event.unit().name());
                return wrong(format!(
                    "`units.{}.rates` has `{event}`; it belongs in `units.{owner}`",
                    unit.name()
                ));
            }
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
