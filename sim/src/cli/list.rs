//! `quintile list`.

use serde::Serialize;

use super::Failure;
use super::args::ListArgs;
use super::terminal::{print, print_json};
use crate::gpu::GpuSpec;

/// Everything that can be named, each with a line that says what it is.
#[derive(Serialize)]
struct Listing {
    scenes: Vec<Entry>,
    gpus: Vec<Entry>,
    platforms: Vec<Entry>,
    energy_tables: Vec<Entry>,
    sample_tables: Vec<Entry>,
    workloads: Vec<Entry>,
    charts: Vec<Entry>,
    figures: Vec<Entry>,
}

#[derive(Serialize)]
struct Entry {
    name: String,
    what: String,
}

impl Entry {
    fn new(name: impl Into<String>, what: impl Into<String>) -> Self {
        Self { name: name.into(), what: what.into() }
    }
}

pub(super) fn list(args: &ListArgs) -> Result<(), Failure> {
    let listing = listing();
    if args.json {
        return print_json(&listing, true);
    }
    let groups = [
        ("scenes", &listing.scenes),
        ("GPUs", &listing.gpus),
        ("platforms", &listing.platforms),
        ("energy tables", &listing.energy_tables),
        ("sample tables", &listing.sample_tables),
        ("workloads", &listing.workloads),
        ("charts", &listing.charts),
        ("figures", &listing.figures),
    ];
    let mut lines = Vec::new();
    for (title, entries) in groups {
        lines.push(format!("{title}:"));
        lines.extend(entries.iter().map(|entry| format!("  {:<18} {}", entry.name, entry.what)));
    }
    print(&lines.join("\n"))
}

fn listing() -> Listing {
    let gpu = |name| Entry::new(name, GpuSpec::load(name).map(|gpu| gpu.doc).unwrap_or_default());
    let platform = |name| {
        Entry::new(
            name,
            power_model::Platform::builtin(name).map(|platform| platform.doc).unwrap_or_default(),
        )
    };
    let table = |name| {
        Entry::new(
            name,
            power_model::EnergyTable::builtin(name).map(|table| table.doc().to_owned()).unwrap_or_default(),
        )
    };
    Listing {
        scenes: workloads::builtin_names().map(|(name, what)| Entry::new(name, what)).collect(),
        gpus: GpuSpec::names().map(gpu).collect(),
        platforms: power_model::Platform::names().map(platform).collect(),
        energy_tables: power_model::EnergyTable::names().map(table).collect(),
        sample_tables: pipeline::SampleSpec::names().map(|(name, what)| Entry::new(name, what)).collect(),
        charts: crate::chart::CHARTS.iter().map(|(name, what)| Entry::new(*name, *what)).collect(),
        workloads: workloads::job::names().map(|(name, what)| Entry::new(name, what)).collect(),
        figures: crate::run::FIGURES.iter().map(|(name, what)| Entry::new(*name, *what)).collect(),
    }
}
