//! `quintile list`.

mod options;

use serde::Serialize;

use super::Failure;
use super::ListArgs;
use super::outputs::{print, print_json};
use activity::spec::suggestion;
use experiments::catalog::{ALL, CHARTS};
use options::{Listed, OPTIONS, as_set};
use output::table::Table;
use run::GpuSpec;

/// Names of all built-in things, each with a description.
#[derive(Serialize)]
struct Listing {
    scenes: Vec<Entry>,
    gpus: Vec<Gpu>,
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

/// A GPU with its platform and energy table, if it has its own.
#[derive(Serialize)]
struct Gpu {
    #[serde(flatten)]
    entry: Entry,
    platform: Option<String>,
    energy_table: Option<String>,
}

impl Gpu {
    fn builtin(name: &str) -> Self {
        let spec = GpuSpec::load(name).ok();
        let (doc, power) = spec.map(|spec| (spec.doc, spec.power)).unwrap_or_default();
        let (platform, energy_table) = power.map(|power| (power.platform, power.energy)).unzip();
        Self { entry: Entry::new(name, doc), platform, energy_table }
    }

    /// The entry with its platform and energy table as text.
    fn line(&self) -> Entry {
        let Entry { name, what } = &self.entry;
        let own = match (&self.platform, &self.energy_table) {
            (Some(platform), Some(table)) => format!("platform {platform}, energy table {table}"),
            _ => "no platform of its own".to_owned(),
        };
        Entry::new(name, format!("{what} [{own}]"))
    }
}

impl Entry {
    fn new(name: impl Into<String>, what: impl Into<String>) -> Self {
        Self { name: name.into(), what: what.into() }
    }
}

/// A workload with its options.
#[derive(Serialize)]
struct Workload {
    #[serde(flatten)]
    entry: Entry,
    options: Vec<Listed>,
}

pub(super) fn list(args: &ListArgs) -> Result<(), Failure> {
    match &args.workload {
        Some(name) => workload(name, args.json),
        None => everything(args),
    }
}

/// Prints the options of one workload.
fn workload(name: &str, json: bool) -> Result<(), Failure> {
    let mut workloads = workloads::catalog::names().zip(OPTIONS);
    let found = workloads.find(|((known, _), _)| *known == name);
    let Some(((name, what), options)) = found else {
        let known: Vec<&str> = workloads::catalog::names().map(|(name, _)| name).collect();
        let message = format!("unknown workload `{name}`, {}", suggestion(name, &known));
        return Err(Failure { message, code: 2 });
    };
    let listed = Workload { entry: Entry::new(name, what), options: options.listed()? };
    if json {
        return print_json(&listed, true);
    }
    let mut table = Table::of_texts(["option", "default", "range", "meaning"]);
    for option in &listed.options {
        table.row([option.name, &as_set(&option.default), &option.range, option.meaning].map(str::to_owned));
    }
    print(&format!("{name}: {what}\n\n{table}\nSet one with: quintile run {name} --set OPTION=VALUE"))
}

fn everything(args: &ListArgs) -> Result<(), Failure> {
    let listing = listing();
    if args.json {
        return print_json(&listing, true);
    }
    let groups = [
        ("scenes", &listing.scenes),
        ("GPUs", &listing.gpus.iter().map(Gpu::line).collect()),
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
        gpus: GpuSpec::names().map(Gpu::builtin).collect(),
        platforms: power_model::Platform::names().map(platform).collect(),
        energy_tables: power_model::EnergyTable::names().map(table).collect(),
        sample_tables: pipeline::SampleSpec::names().map(|(name, what)| Entry::new(name, what)).collect(),
        charts: charts(),
        workloads: workloads::catalog::names().map(|(name, what)| Entry::new(name, what)).collect(),
        figures: run::FIGURES.iter().map(|(name, what)| Entry::new(*name, *what)).collect(),
    }
}

/// `all` and the charts, each with its line in small letters as those of everything else.
fn charts() -> Vec<Entry> {
    let named = CHARTS.iter().map(|chart| (chart.name, chart.about));
    let entry = |(name, about): (&str, &str)| {
        let mut letters = about.chars();
        let first = letters.next().map(|letter| letter.to_ascii_lowercase());
        Entry::new(name, first.into_iter().chain(letters).collect::<String>())
    };
    std::iter::once(ALL).chain(named).map(entry).collect()
}
