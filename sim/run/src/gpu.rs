//! GPU file, and the check that platform and energy table belong to the GPU.

use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use activity::{LEVELS, Unit, spec};
use output::table::digits;
use pipeline::PipelineSpec;
use power_model::{EnergyTable, Platform, Scaling};
use serde::Deserialize;
use timing::{Clocks, Machine, MachineSpec, TimingError};
use warnings::{Code, Warning};

use crate::RunOptions;

/// Specification of a GPU. `docs/gpu.md` documents every field.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GpuSpec {
    /// Name of the GPU.
    pub name: String,
    /// Description, one sentence.
    pub doc: String,
    /// Platform and energy table of its power model, if it has its own.
    #[serde(default)]
    pub power: Option<PowerFiles>,
    /// Core clock in hertz: all units except memory.
    pub core_hz: f64,
    /// Memory clock in hertz.
    pub memory_hz: f64,
    /// Sizes of the pipeline.
    pub pipeline: PipelineSpec,
    /// Rates, latencies, queues and clocks of each unit.
    pub units: MachineSpec,
}

/// Platform and energy table: names, or files that end in `.ron`.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PowerFiles {
    /// The platform.
    pub platform: String,
    /// The energy table.
    pub energy: String,
}

impl PowerFiles {
    /// Resolves file names relative to the folder of `file`.
    fn beside(&mut self, file: &Path) {
        for name in [&mut self.platform, &mut self.energy] {
            if name.ends_with(".ron") {
                *name = file.with_file_name(&*name).display().to_string();
            }
        }
    }
}

impl Default for PowerFiles {
    /// Platform and table of the reference GPU, also used for a GPU without its own.
    fn default() -> Self {
        Self { platform: "reference".to_owned(), energy: "28nm".to_owned() }
    }
}

/// Error of a GPU file.
#[derive(Debug, thiserror::Error)]
pub enum GpuError {
    /// The file cannot be read or parsed.
    #[error(transparent)]
    Spec(#[from] spec::SpecError),
    /// A value is invalid.
    #[error("{place}: {message}")]
    Value {
        /// File name as given, with line and column of the value if it is in the file.
        place: String,
        /// The value, what is wrong with it, and valid values.
        message: String,
    },
    /// The GPU of a platform cannot be loaded.
    #[error("`made_for` of platform `{platform}`: {source}")]
    Home {
        /// Name of the platform.
        platform: String,
        /// Why.
        source: Box<Self>,
    },
    /// No GPU has this name.
    #[error("no GPU called `{name}`; {suggestion}; or name a .ron file")]
    Unknown {
        /// Name as given.
        name: String,
        /// The most similar name, or all names.
        suggestion: String,
    },
}

/// Valid clocks in hertz: from a prototype on an FPGA to ten times those of products.
const CLOCKS_HZ: RangeInclusive<f64> = 1e6..=1e11;

/// Built-in GPUs: name and RON text.
const BUILTIN: [(&str, &str); 5] = [
    ("reference", include_str!("../gpus/reference.ron")),
    ("mobile", include_str!("../gpus/mobile.ron")),
    ("discrete", include_str!("../gpus/discrete.ron")),
    ("hd_4000", include_str!("../gpus/hd_4000.ron")),
    ("iris_pro", include_str!("../gpus/iris_pro.ron")),
];

impl GpuSpec {
    /// Names of the built-in GPUs.
    pub fn names() -> impl Iterator<Item = &'static str> {
        BUILTIN.iter().map(|(name, _)| *name)
    }

    /// Loads the built-in GPU `name`, or the file `name` if it ends in `.ron`.
    ///
    /// # Errors
    /// If no GPU has this name, or its file is invalid.
    pub fn load(name: impl AsRef<Path>) -> Result<Self, GpuError> {
        let path = name.as_ref();
        let name = &*path.to_string_lossy();
        if let Some(text) = Self::builtin_text(name) {
            return Self::parse(text, name);
        }
        if path.extension().is_none_or(|ending| ending != "ron") {
            let known: Vec<_> = Self::names().collect();
            let suggestion = spec::suggestion(name, &known);
            return Err(GpuError::Unknown { name: name.to_owned(), suggestion });
        }
        let mut gpu = Self::parse(&spec::read(path)?, name)?;
        gpu.name_power_files_beside(path);
        Ok(gpu)
    }

    /// RON text of the built-in GPU `name`.
    pub(crate) fn builtin_text(name: &str) -> Option<&'static str> {
        BUILTIN.iter().find(|(known, _)| *known == name).map(|(_, text)| *text)
    }

    /// Resolves names of platform and table files relative to the folder of the GPU file at `path`.
    pub(crate) fn name_power_files_beside(&mut self, path: &Path) {
        if let Some(power) = &mut self.power {
            power.beside(path);
        }
    }

    /// Parses and validates RON text; messages name `file`.
    ///
    /// # Errors
    /// If the text is invalid.
    pub fn parse(text: &str, file: &str) -> Result<Self, GpuError> {
        let mut spec: Self = spec::parse(text, file)?;
        spec.pipeline.warp_lanes = spec.units.shader.warp_lanes.get();
        match spec.validate() {
            Ok(()) => Ok(spec),
            Err((field, message)) => {
                let place = spec::position_of(text, &field)
                    .map_or_else(|| file.to_owned(), |(line, column)| format!("{file}:{line}:{column}"));
                Err(GpuError::Value { place, message })
            }
        }
    }

    /// Parameters of the timing model.
    ///
    /// # Errors
    /// If the clocks have no common cycle; a loaded GPU is validated.
    pub fn machine(&self) -> Result<Machine<'_>, TimingError> {
        let clocks = self.clocks().ok_or_else(|| TimingError::Clocks(self.name.clone()))?;
        Ok(Machine { units: &self.units, clocks })
    }

    /// Core and memory clock with a common cycle; `None` if there is none.
    pub fn clocks(&self) -> Option<Clocks> {
        Clocks::new(self.core_hz, self.memory_hz)
    }

    /// Checks relations between fields. Error: name of the field and message.
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
        self.check_levels()?;
        self.check_compute()?;
        self.pipeline
            .validate()
            .map_err(|error| (format!("pipeline.{}", error.field()), format!("`pipeline`: {error}")))
    }
}

impl GpuSpec {
    /// Checks that bins and each level below the L2 have both a size and a rate.
    fn check_levels(&self) -> Result<(), (String, String)> {
        let of_level = |((level, size), rate): ((Unit, Option<_>), Option<_>)| {
            (
                level.name(),
                size.is_some(),
                rate.is_some(),
                "a level below the L2 needs",
                "latency, queue and lines per cycle",
            )
        };
        let levels = LEVELS.into_iter().zip(self.pipeline.memory.levels()).zip(self.units.levels());
        let bins = (self.pipeline.memory.bins.is_some(), self.units.bins.is_some());
        let bins = ("bins", bins.0, bins.1, "bins in memory need", "packets in flight");
        for (name, has_size, has_rate, who, rate) in std::iter::once(bins).chain(levels.map(of_level)) {
            let (size_field, rate_field) = (format!("pipeline.memory.{name}"), format!("units.{name}"));
            let (given, missing, what) = match (has_size, has_rate) {
                (true, false) => (size_field, rate_field, rate),
                (false, true) => (rate_field, size_field, "entries and ways"),
                _ => continue,
            };
            let message = format!(
                "`{given}` is given and `{missing}` is missing: {who} both; add its {what}, or leave both out"
            );
            return Err((given, message));
        }
        Ok(())
    }
}

impl GpuSpec {
    /// Checks that groups have both sizes and rates, and that the largest group fits on a core.
    fn check_compute(&self) -> Result<(), (String, String)> {
        let wrong = |field: &str, message: String| Err((field.to_owned(), message));
        let sizes = match (&self.pipeline.compute, &self.units.compute) {
            (None, None) => return Ok(()),
            (Some(sizes), Some(_)) => sizes,
            (sizes, _) => {
                let both = ["pipeline.compute", "units.compute"];
                let [given, missing] = if sizes.is_some() { both } else { [both[1], both[0]] };
                let message = format!(
                    "`{given}` is given and `{missing}` is missing: groups need both; add it, or leave both out"
                );
                return wrong(given, message);
            }
        };
        let shader = &self.units.shader;
        if sizes.warp_lanes != shader.warp_lanes.get() {
            let message = format!(
                "`warp_lanes` of `pipeline.compute` is {}, and that of `units.shader` is {}; they have to be equal",
                sizes.warp_lanes,
                shader.warp_lanes.get()
            );
            return wrong("pipeline.compute.warp_lanes", message);
        }
        let most = u64::from(shader.warps) * u64::from(shader.warp_lanes);
        if u64::from(sizes.group_lanes) > most {
            let message = format!(
                "`group_lanes` is {}, and a core holds {most} lanes (`warps` times `warp_lanes`)",
                sizes.group_lanes
            );
            return wrong("pipeline.compute.group_lanes", message);
        }
        if sizes.shared_bytes > shader.shared_bytes.get() {
            let message = format!(
                "`shared_bytes` of a group is {}, and a core has {} (`units.shader.shared_bytes`)",
                sizes.shared_bytes,
                shader.shared_bytes.get()
            );
            return wrong("pipeline.compute.shared_bytes", message);
        }
        Ok(())
    }
}

/// Ratio from which watts are too far from those of the GPU of the platform to be scaled without a warning.
const FAR: f64 = 4.0;

/// Difference of a ratio from 1 from which messages state it.
const MIN_STATED: f64 = 5e-4;

/// Checks that platform and energy table belong to the GPU, and that it is near the one that the platform was
/// made for.
pub(super) fn check_pairing(
    options: &RunOptions,
    gpu: &GpuSpec,
    (platform, table): (&Platform, &EnergyTable),
    scaling: &Scaling,
) -> Option<Warning> {
    let in_use = format!("platform `{}` and energy table `{}`", platform.name, table.name());
    let (ratio, of) = scaling.farthest();
    let scaled = if (ratio - 1.0).abs() < MIN_STATED {
        format!("of GPU `{}`, not scaled, as memories and logic are of the same size", platform.made_for)
    } else {
        format!("of GPU `{}`; {of} is scaled by {}", platform.made_for, digits(ratio))
    };
    let message = match &gpu.power {
        None => format!(
            "no platform belongs to GPU `{}`, so its watts come from {in_use}, which are those {scaled}: compare its cycles, counts and \
             area, not its watts; or write a platform for it and name that as `power` in the GPU file",
            gpu.name
        ),
        Some(own) if belongs(own, options, platform, table) => {
            if (1.0 / FAR..=FAR).contains(&ratio) {
                return None;
            }
            format!(
                "the watts of GPU `{}` are far from home: {in_use} are those {scaled}, which holds for changes of up to {FAR} times; \
                 write a platform for this GPU and name it as `power` in the GPU file",
                gpu.name
            )
        }
        Some(own) => format!(
            "GPU `{}` belongs to platform `{}` and energy table `{}`, and its watts come from {in_use}, those {scaled}; \
             leave --platform and --energy out, or choose the GPU that belongs to them (`quintile list`)",
            gpu.name, own.platform, own.energy
        ),
    };
    Some(Warning::new(Code::PlatformMismatch, message))
}

/// Whether the GPU file names this platform and table, by the path in the options or by a name. A changed
/// copy of a supplied file has the same name and is another machine.
fn belongs(own: &PowerFiles, options: &RunOptions, platform: &Platform, table: &EnergyTable) -> bool {
    let is_named =
        |own: &str, given: &Option<PathBuf>| given.as_ref().is_none_or(|given| given == Path::new(own));
    let same_platform = || Platform::builtin(&own.platform).is_ok_and(|supplied| supplied == *platform);
    let same_table = || EnergyTable::builtin(&own.energy).is_ok_and(|supplied| supplied == *table);
    (is_named(&own.platform, &options.platform) || same_platform())
        && (is_named(&own.energy, &options.energy) || same_table())
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
    fn errors_name_line_and_column() {
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
    fn a_gpu_without_a_platform_says_what_is_scaled_where_something_is() {
        let message = |l2: &str| {
            let text = REFERENCE.replace("entries: 4096", l2);
            let mut gpu = GpuSpec::parse(&text, "gpu.ron").unwrap();
            let own = gpu.power.take().unwrap();
            let platform = Platform::builtin(&own.platform).unwrap();
            let table = EnergyTable::builtin(&own.energy).unwrap();
            let scaling = crate::hardware::scaling(&gpu, &platform).unwrap();
            let warning = check_pairing(&RunOptions::default(), &gpu, (&platform, &table), &scaling);
            warning.unwrap().message
        };
        let same = message("entries: 4096");
        assert!(same.contains("of GPU `reference`, not scaled, as") && !same.contains("1.000"), "{same}");
        let larger = message("entries: 8192");
        assert!(larger.contains(" is scaled by "), "{larger}");
    }

    #[test]
    fn sizes_out_of_range_are_refused_with_their_line() {
        let text =
            message(&REFERENCE.replace("queue: 8, lines_per_cycle", "queue: 4294967295, lines_per_cycle"));
        assert!(
            text.starts_with("gpu.ron:65:")
                && text.contains("`queue`: 4294967295 is out of range; it has to be 1 to 65536"),
            "{text}"
        );
    }

    #[test]
    fn levels_below_the_l2_are_checked() {
        let iris = BUILTIN[4].1;
        let spec = GpuSpec::parse(iris, "gpu.ron").unwrap();
        assert!(spec.pipeline.memory.levels().iter().all(Option::is_some));
        // A size without a rate, and a rate without a size.
        let text = message(
            &REFERENCE.replace("l2: (entries: 4096", "llc: (entries: 8, ways: 2), l2: (entries: 4096"),
        );
        assert!(text.starts_with("gpu.ron:20:") && text.contains("`units.llc` is missing"), "{text}");
        let text = message(&REFERENCE.replace("bins: (in_flight: 128),", ""));
        assert!(text.contains("`pipeline.memory.bins` is given and `units.bins` is missing"), "{text}");
        let text = message(&iris.replace("edram: (entries: 2097152, ways: 16),", ""));
        assert!(text.contains("`units.edram` is given and `pipeline.memory.edram` is missing"), "{text}");
        // Impossible geometry, unknown keys, sizes out of range.
        let text = message(&iris.replace("98304, ways: 12", "98304, ways: 5"));
        assert!(
            text.starts_with("gpu.ron:") && text.contains("`memory.llc`: a cache of 98304 entries in 5 ways"),
            "{text}"
        );
        let text = message(&iris.replace("edram: (clock", "eddram: (clock"));
        assert!(text.contains("did you mean `edram`?"), "{text}");
        let text = message(&iris.replace("latency_cycles: 24, queue: 32", "latency_cycles: 24, queue: 0"));
        assert!(text.contains("`queue`: 0 is out of range"), "{text}");
        let text = message(
            &iris
                .replace("latency_cycles: 40, queue: 32, channels", "latency_cycles: 40, queue: 3, channels"),
        );
        assert!(text.contains("`queue` of `units.dram` is 3") && text.contains("at least 4"), "{text}");
        let text = message(&iris.replace("row_cycles: 28", "write_queue: 2, row_cycles: 28"));
        assert!(text.contains("`write_queue` of `units.dram` is 2") && text.contains("at least 3"), "{text}");
        let text = message(&iris.replace("interval_cycles: 6240", "interval_cycles: 459"));
        assert!(
            text.contains("`refresh.interval_cycles` of `units.dram` is 459")
                && text.contains("at least 460"),
            "{text}"
        );
        let text = message(&iris.replace("row_cycles: 28", "row_cycle: 28"));
        assert!(text.contains("row_cycle") && text.contains("row_cycles"), "{text}");
        let text = message(&iris.replace(", busy_cycles: 208", ""));
        assert!(text.contains("busy_cycles"), "{text}");
    }

    #[test]
    fn groups_have_to_fit_on_a_core() {
        assert!(GpuSpec::load("mobile").unwrap().units.compute.is_none());
        for (from, to, says) in [
            (
                "compute: (warp_lanes: 32",
                "compute: (warp_lanes: 16",
                "`units.shader` is 32; they have to be equal",
            ),
            ("group_lanes: 256", "group_lanes: 1024", "`group_lanes` is 1024, and a core holds 512 lanes"),
            (
                "shared_bytes: 16384",
                "shared_bytes: 65536",
                "`shared_bytes` of a group is 65536, and a core has 32768",
            ),
            ("banks: 32", "banks: 0", "`compute.banks` is 0; it has to be 1 to 128"),
            (
                "\"shared_cycles\": 2",
                "\"groups\": 2",
                "`units.compute.rates` has `groups`, which takes no time",
            ),
            ("shared_bytes: 32768,", "shared_bytes: 32768, bank: 1,", "unknown field `bank`"),
        ] {
            let text = message(&REFERENCE.replace(from, to));
            assert!(text.starts_with("gpu.ron:") && text.contains(says), "{text}");
        }
        let alone = REFERENCE.replace(
            "compute: (warp_lanes: 32, group_lanes: 256, shared_bytes: 16384, banks: 32, atomic_units: 1),",
            "",
        );
        assert!(message(&alone).contains("`units.compute` is given and `pipeline.compute` is missing"));
    }

    #[test]
    fn an_unknown_name_gets_a_suggestion() {
        let text = GpuSpec::load("referense").unwrap_err().to_string();
        assert!(text.contains("did you mean `reference`?"), "{text}");
    }
}
