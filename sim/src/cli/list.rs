//! `quintile list`, with the options and facts of each workload.
//!
//! Defaults are those of the workloads themselves. Ranges are checked against what the workloads accept by
//! the tests below.

use activity::spec::suggestion;
use experiments::{ALL, CHARTS};
use output::table::Table;
use run::GpuSpec;
use serde::Serialize;
use serde_json::{Map, Value};
use workloads::job::{FactKind, JobOptions, Need};
use workloads::{caustics, collision, compute, deferred, glossy, multiview, occlusion, points, soft_shadows};

use super::{Failure, ListArgs, print, print_json};

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

/// A workload with its options and facts.
#[derive(Serialize)]
struct Workload {
    #[serde(flatten)]
    entry: Entry,
    options: Vec<Listed>,
    facts: &'static [FactKind],
}

pub(super) fn list(args: &ListArgs) -> Result<(), Failure> {
    match &args.workload {
        Some(name) => workload(name, args.json),
        None => everything(args),
    }
}

/// Prints the options and facts of one workload.
fn workload(name: &str, json: bool) -> Result<(), Failure> {
    let mut workloads = workloads::catalog::names().zip(OPTIONS);
    let found = workloads.find(|((known, _), _)| *known == name);
    let Some(((name, what), options)) = found else {
        let known: Vec<&str> = workloads::catalog::names().map(|(name, _)| name).collect();
        let message = format!("unknown workload `{name}`, {}", suggestion(name, &known));
        return Err(Failure { message, code: 2 });
    };
    let listed = Workload {
        entry: Entry::new(name, what),
        options: options.listed()?,
        facts: workloads::catalog::facts(name),
    };
    if json {
        return print_json(&listed, true);
    }
    let mut table = Table::of_texts(["option", "default", "range", "needs", "meaning"]);
    for Listed { name, default, range, needs, meaning } in &listed.options {
        table.row([name, &*as_set(default), range, needs, meaning].map(str::to_owned));
    }
    let mut facts = Table::of_texts(["fact", "unit", "meaning"]);
    for FactKind { name, unit, meaning } in listed.facts {
        facts.row([name, unit, meaning].map(|text| (*text).to_owned()));
    }
    print(&format!(
        "{name}: {what}\n\n{table}\nSet one with: quintile run {name} --set OPTION=VALUE\n\n{facts}\n\
         Means over frames, in `facts` of summary.json; each where an option above makes it"
    ))
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

/// Options of a workload.
struct WorkloadOptions {
    workload: &'static str,
    options: &'static [Doc],
    needs: &'static [Need],
    defaults: fn() -> Result<String, serde_json::Error>,
}

/// An option: name, range, meaning.
struct Doc(&'static str, Range, &'static str);

/// Values that an option takes.
enum Range {
    /// Numbers from one to another, alone or each in a list.
    Numbers(f64, f64),
    /// One of these names.
    Names(&'static [&'static str]),
    /// Others, in words.
    Words(&'static str),
}

use Range::{Names, Numbers, Words};

const SCENE: Range = Words("a built-in scene or a file");
const SWITCH: Range = Words("true or false");

/// The options of every workload, in the order of their declarations.
const OPTIONS: &[WorkloadOptions] = &[
    WorkloadOptions {
        workload: "caustics",
        options: &[
            Doc(
                "cells",
                Numbers(1.0, 1024.0),
                "squares of two generator triangles along each side of the water",
            ),
            Doc("side_m", Numbers(1e-3, 1e4), "side of the water in metres"),
            Doc("depth_m", Numbers(1e-3, 1e4), "depth of the water in metres"),
            Doc("wave_m", Numbers(1e-3, 1e4), "longest wave in metres; the shortest is a third of it"),
            Doc("slope", Numbers(0.0, 1.0), "root mean square slope of the waves"),
            Doc(
                "pleat",
                Numbers(0.0, 0.9),
                "offset of every other column of corners along its light, as a share of its length",
            ),
            Doc("method", Names(&["moving", "refined", "hull", "prism"]), "how light volumes are rasterized"),
            Doc(
                "look",
                Names(&["volume", "floor"]),
                "light in the water from the side, or on the floor from above",
            ),
        ],
        needs: caustics::CausticsOptions::NEEDS,
        defaults: || serde_json::to_string(&caustics::CausticsOptions::default()),
    },
    WorkloadOptions {
        workload: "ccd",
        options: &[
            Doc("file", Words("an .mts file"), "moving objects; without it, balls that move at random"),
            Doc("balls", Numbers(2.0, 100.0), "number of balls"),
            Doc("resolution", Numbers(1.0, 1024.0), "tiles across each image"),
            Doc("bins", Numbers(1.0, 256.0), "time bins of a tile"),
            Doc("method", Names(&["fragment_box", "box_box", "depth_only"]), "comparison in a tile"),
            Doc("narrow", SWITCH, "pairs one by one within the space that their swept boxes share"),
        ],
        needs: collision::CollisionOptions::NEEDS,
        defaults: || serde_json::to_string(&collision::CollisionOptions::default()),
    },
    WorkloadOptions {
        workload: "compute",
        options: &[
            Doc(
                "kernel",
                Names(&["reduction", "mip_chain", "histogram", "light_culling"]),
                "what groups compute",
            ),
            Doc("scene", SCENE, "the scene, drawn without motion and without a lens"),
            Doc("group", Words("a power of two, 16 to 1024"), "lanes of a group"),
            Doc("per_lane", Numbers(1.0, 64.0), "pixels of a lane, of reduction and histogram"),
            Doc("step", Numbers(1.0, 16.0), "one pixel in so many is read along both axes"),
            Doc("order", Names(&["sequential", "interleaved"]), "which sums a step of the reduction adds"),
            Doc("stride", Numbers(1.0, 64.0), "words of shared memory between the sums of lanes"),
            Doc("padded", SWITCH, "an empty word of shared memory after each row of banks"),
            Doc("atomics", Names(&["shared", "global"]), "where lanes count: shared memory or a buffer"),
            Doc("bins", Words("a power of two, 16 to 256"), "bins of the histogram"),
            Doc("copies", Numbers(1.0, 32.0), "histograms in the shared memory of a group"),
            Doc("contrast", Numbers(0.0, 1.0), "contrast of the image; 0 is one grey"),
            Doc("lights", Numbers(1.0, 65536.0), "number of lights"),
            Doc("light_radius", Numbers(0.0, 1.0), "reach of a light, as a share of the scene's diagonal"),
            Doc("tile_px", Words("a power of two, 4 to 64"), "side of a tile in pixels"),
            Doc("depth_bounds", SWITCH, "the depths of a tile bound its lights"),
            Doc("list", Numbers(1.0, 65536.0), "most lights of a tile"),
        ],
        needs: compute::ComputeOptions::NEEDS,
        defaults: || serde_json::to_string(&compute::ComputeOptions::default()),
    },
    WorkloadOptions {
        workload: "deferred",
        options: &[
            Doc("scene", SCENE, "the scene"),
            Doc("method", Names(&["deferred", "forward"]), "from a G-buffer, or as surfaces are drawn"),
            Doc("lights", Numbers(0.0, 4096.0), "point lights besides the light of the scene"),
            Doc("range", Numbers(1e-15, 1e15), "range of a point light; scene units"),
            Doc(
                "lighting",
                Names(&["screen", "volumes"]),
                "a loop over all lights for the whole image, or the volume of each light",
            ),
            Doc("normals", Names(&["rgba16f", "rgba8"]), "format of normals in the G-buffer"),
            Doc(
                "rate",
                Names(&["sample", "pixel"]),
                "lighting for every sample, or for the first of a pixel",
            ),
        ],
        needs: deferred::DeferredOptions::NEEDS,
        defaults: || serde_json::to_string(&deferred::DeferredOptions::default()),
    },
    WorkloadOptions {
        workload: "glossy",
        options: &[
            Doc("scene", SCENE, "the scene; without it, a test scene of the workload"),
            Doc(
                "centre",
                Numbers(-1e15, 1e15),
                "centre of the receiver, a horizontal rectangle; scene units",
            ),
            Doc("half", Numbers(1e-15, 1e15), "half of the sides of the receiver along x and z; scene units"),
            Doc(
                "index",
                Numbers(1.0, 10.0),
                "refraction into a medium with this index; without it, reflection",
            ),
            Doc(
                "roughness",
                Words("0 to 100 times the smaller half side"),
                "radius of the lens in scene units; 0 is a mirror",
            ),
            Doc(
                "texels",
                Words("1 to 16384, across as well"),
                "texels of the map from the near to the far side of the receiver",
            ),
            Doc("map_samples", Numbers(1.0, 256.0), "samples per texel"),
            Doc("fresnel", Numbers(0.0, 1.0), "share of reflected light at normal incidence"),
        ],
        needs: glossy::GlossyOptions::NEEDS,
        defaults: || serde_json::to_string(&glossy::GlossyOptions::default()),
    },
    WorkloadOptions {
        workload: "multiview",
        options: &[
            Doc("scene", SCENE, "the scene"),
            Doc("views", Numbers(1.0, 64.0), "number of views"),
            Doc(
                "spacing",
                Words("1e-35 or more; with overlap 0 twice the aperture"),
                "distance between neighbouring views, scene units",
            ),
            Doc("aperture", Words("1e-35 or more"), "radius of the aperture of a view, scene units"),
            Doc(
                "overlap",
                Words("0 or more"),
                "steps of the camera line under the box filter of a view; 0 for separate round lenses",
            ),
            Doc(
                "focus",
                Words("above 0"),
                "depth at which all views agree, scene units; without it, that of the scene's lens",
            ),
            Doc(
                "show",
                Names(&["side_by_side", "interlaced", "one"]),
                "arrangement of the views in the image",
            ),
            Doc(
                "panel",
                Words("pitch 1 to 1e6; slant and offset -1e6 to 1e6"),
                "lenses of a panel: subpixels under one, tangent of the slant, start of the first",
            ),
            Doc("view_by_view", SWITCH, "one pass for each view: the same images at another cost"),
            Doc("check_cache", SWITCH, "draw once more with an infinite cache, and warn of misses"),
        ],
        needs: multiview::MultiViewOptions::NEEDS,
        defaults: || serde_json::to_string(&multiview::MultiViewOptions::default()),
    },
    WorkloadOptions {
        workload: "occlusion",
        options: &[
            Doc("walls", Numbers(0.0, 1000.0), "number of walls"),
            Doc("slats", Numbers(1.0, 1000.0), "slats of a wall"),
            Doc("gaps", Numbers(0.0, 1.0), "share of a wall that is gaps between slats"),
            Doc("objects", Numbers(0.0, 1e5), "number of boxes, most of them behind a wall"),
            Doc(
                "motion",
                Numbers(0.0, 100.0),
                "motion of a wall during the shutter in metres; it is 3 m wide",
            ),
            Doc("lens", Numbers(0.0, 1.0), "radius of the lens in metres"),
            Doc(
                "query",
                Names(&["intervals", "any", "samples"]),
                "what is asked of a box: intervals, whether any sample passes, or how many samples do",
            ),
            Doc("tile_px", Numbers(1.0, 256.0), "side of a tile of the first level in pixels"),
            Doc("boxes", Numbers(1.0, 16.0), "boxes of lens and time in a tile, along u, v and t"),
        ],
        needs: occlusion::OcclusionOptions::NEEDS,
        defaults: || serde_json::to_string(&occlusion::OcclusionOptions::default()),
    },
    WorkloadOptions {
        workload: "sampling",
        options: &[
            Doc("points", Names(&["darts", "noise", "volume"]), "kind of points"),
            Doc(
                "dimensions",
                Numbers(0.0, 5.0),
                "2 or 3 for darts, 1 to 4 for noise, 3 to 5 for volumes; 0 for the fewest",
            ),
            Doc(
                "radius",
                Numbers(0.0, 0.5),
                "least distance of darts in the unit square, from 0.005 on, in 3D from 0.03 on; 0 for 0.02, in 3D 0.06",
            ),
            Doc("rounds", Numbers(1.0, 8.0), "rounds of darts that are rasterized"),
            Doc("periodic", SWITCH, "whether the domain of darts is a torus instead of a box"),
            Doc("count", Numbers(100.0, 2e6), "points of noise on average"),
        ],
        needs: points::job::PointOptions::NEEDS,
        defaults: || serde_json::to_string(&points::job::PointOptions::default()),
    },
    WorkloadOptions {
        workload: "soft-shadows",
        options: &[
            Doc("scene", SCENE, "the scene; without it, a test scene of the workload"),
            Doc(
                "light",
                Words("radius up to 100 times the distance to the target, fov_deg 1 to 170"),
                "the area light: position, target, radius, near in scene units; fov_deg is the field of view of its map",
            ),
            Doc("map_px", Words("2 to 4096, even"), "texels of the map across and down"),
            Doc(
                "bias",
                Words("0 or more"),
                "depth behind the map at which a point is still lit, scene units",
            ),
            Doc(
                "points",
                Words("[(u, v, t), ...]"),
                "samples of light and time; without them, a scrambled Sobol sequence",
            ),
            Doc("accumulate", SWITCH, "accumulation instead of one pass: the same image at another cost"),
        ],
        needs: soft_shadows::SoftShadowOptions::NEEDS,
        defaults: || serde_json::to_string(&soft_shadows::SoftShadowOptions::default()),
    },
];

/// An option as it is printed.
#[derive(Serialize)]
struct Listed {
    pub name: &'static str,
    pub default: Value,
    pub range: String,
    /// What it needs to have an effect, in words; empty if it always has one.
    pub needs: String,
    pub meaning: &'static str,
}

impl WorkloadOptions {
    /// The options with their defaults.
    fn listed(&self) -> Result<Vec<Listed>, Failure> {
        let internal = |error| Failure { message: format!("{}: {error}", self.workload), code: 1 };
        let defaults: Map<String, Value> =
            (self.defaults)().and_then(|text| serde_json::from_str(&text)).map_err(internal)?;
        let listed = |Doc(name, range, meaning): &Doc| Listed {
            name,
            default: defaults.get(*name).cloned().unwrap_or_default(),
            range: range.text(),
            needs: self.needs_of(name).map(Need::text).collect::<Vec<_>>().join(", and "),
            meaning,
        };
        Ok(self.options.iter().map(listed).collect())
    }

    /// What an option needs to have an effect.
    fn needs_of(&self, option: &str) -> impl Iterator<Item = &'static Need> {
        self.needs.iter().filter(move |need| need.option == option)
    }
}

impl Range {
    fn text(&self) -> String {
        match self {
            Numbers(low, high) => format!("{} to {}", plain(*low), plain(*high)),
            Names(names) => names.join(", "),
            Words(words) => (*words).to_owned(),
        }
    }
}

/// A number in full, or by powers of ten where it is very small or large.
fn plain(value: f64) -> String {
    let in_full = value == 0.0 || (1e-4..1e7).contains(&value.abs());
    if in_full { format!("{value}") } else { format!("{value:e}") }
}

/// A default as `--set` takes it.
fn as_set(value: &Value) -> String {
    match value {
        Value::Null => "none".to_owned(),
        Value::String(text) => text.clone(),
        Value::Number(number) => number.as_f64().map_or_else(|| number.to_string(), plain),
        Value::Array(values) => format!("[{}]", values.iter().map(as_set).collect::<Vec<_>>().join(", ")),
        Value::Object(fields) => {
            let fields = fields.iter().map(|(name, value)| format!("{name}: {}", as_set(value)));
            format!("({})", fields.collect::<Vec<_>>().join(", "))
        }
        Value::Bool(value) => value.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use workloads::job::{JobRequest, OptionSource};
    use workloads::{Overrides, catalog};

    use super::*;

    /// Whether a workload takes an option with what it needs.
    fn accepts(workload: &str, name: &str, value: &str) -> Result<(), String> {
        let options = OPTIONS.iter().find(|options| options.workload == workload).unwrap();
        let needed = options.needs_of(name).map(|need| (need.choice, need.values[0]));
        let set = needed.filter(|(_, value)| *value != "none").chain([(name, value)]);
        let set = set.map(|(name, value)| (name.to_owned(), value.to_owned())).collect();
        let source = OptionSource { file: None, set };
        let request = JobRequest { overrides: &Overrides::default(), seed: 1 };
        catalog::find(workload, &source, &request).unwrap().map(drop).map_err(|error| error.to_string())
    }

    /// A value of the form of the default.
    fn like(default: &Value, number: f64) -> String {
        match default {
            Value::Array(values) => format!("[{}]", vec![plain(number); values.len()].join(", ")),
            _ => plain(number),
        }
    }

    #[test]
    fn every_option_of_every_workload_is_listed() {
        let workloads: Vec<&str> = OPTIONS.iter().map(|options| options.workload).collect();
        assert_eq!(workloads, catalog::names().map(|(name, _)| name).collect::<Vec<_>>());
        for options in OPTIONS {
            let defaults: Map<String, Value> = serde_json::from_str(&(options.defaults)().unwrap()).unwrap();
            let mut listed: Vec<&str> = options.options.iter().map(|Doc(name, ..)| *name).collect();
            listed.sort_unstable();
            let mut known: Vec<&str> = defaults.keys().map(String::as_str).collect();
            known.sort_unstable();
            assert_eq!(listed, known, "{}", options.workload);
        }
    }

    #[test]
    fn workloads_accept_the_ends_of_ranges_and_nothing_beyond() {
        for options in OPTIONS {
            for (Doc(name, range, _), listed) in options.options.iter().zip(options.listed().ok().unwrap()) {
                let check = |number: f64| accepts(options.workload, name, &like(&listed.default, number));
                if let Numbers(low, high) = *range {
                    let beyond = 1e-3 * (high - low);
                    for number in [low - beyond, high + beyond.max(1.0)] {
                        assert!(check(number).is_err(), "{} {name} {number}", options.workload);
                    }
                    for number in [low, high] {
                        let is_own = |error: &String| {
                            let own = [format!("{name}:"), format!("--set {name}=")];
                            own.iter().any(|own| error.starts_with(own))
                        };
                        let refused = check(number).err().filter(is_own);
                        assert_eq!(refused, None, "{} {name} {number}", options.workload);
                    }
                }
            }
        }
    }

    /// A value that is not the default of an option.
    fn another(range: &Range, default: &Value) -> String {
        match range {
            Numbers(low, high) if default.as_f64() == Some(*low) => plain(*high),
            Numbers(low, _) => like(default, *low),
            Names(names) => names.iter().find(|name| default != *name).unwrap().to_string(),
            Words(_) if default.is_boolean() => (default == false).to_string(),
            Words(_) if default.is_number() => "32".to_owned(),
            Words(_) => "(pitch: 9)".to_owned(),
        }
    }

    /// The error for an option whose other needs are met, and one is not.
    fn refused(options: &WorkloadOptions, need: &Need, choice: &str, value: &str) -> String {
        let others = options.needs_of(need.option).filter(|other| *other != need);
        let others = others.map(|other| (other.choice, other.values[0]));
        let set = others.chain([(need.choice, choice), (need.option, value)]);
        let set = set.map(|(name, value)| (name.to_owned(), value.to_owned())).collect();
        let request = JobRequest { overrides: &Overrides::default(), seed: 1 };
        let made = catalog::find(options.workload, &OptionSource { file: None, set }, &request).unwrap();
        made.err().filter(workloads::LoadError::is_usage).unwrap().to_string()
    }

    #[test]
    fn options_without_effect_are_refused_with_what_they_need() {
        for options in OPTIONS {
            let listed = options.listed().ok().unwrap();
            let place = |name| options.options.iter().position(|Doc(known, ..)| *known == name).unwrap();
            for need in options.needs {
                let (Doc(_, range, _), default) =
                    (&options.options[place(need.option)], &listed[place(need.option)].default);
                let Doc(_, Names(choices), _) = options.options[place(need.choice)] else { continue };
                for choice in choices.iter().filter(|choice| !need.values.contains(choice)) {
                    let message = refused(options, need, choice, &another(range, default));
                    assert!(message.contains(&need.text()) && message.contains(need.option), "{message}");
                }
            }
        }
    }

    #[test]
    fn workloads_accept_the_names_listed_and_their_defaults() {
        for options in OPTIONS {
            for (Doc(name, range, _), listed) in options.options.iter().zip(options.listed().ok().unwrap()) {
                let workload = options.workload;
                if let Names(names) = range {
                    names.iter().for_each(|value| assert_eq!(accepts(workload, name, value), Ok(())));
                    let known = accepts(workload, name, "?").unwrap_err();
                    assert!(known.ends_with(&format!("known: {}", names.join(", "))), "{known}");
                }
                if !listed.default.is_null() {
                    assert_eq!(
                        accepts(workload, name, &as_set(&listed.default)),
                        Ok(()),
                        "{workload} {name}"
                    );
                }
            }
        }
    }

    #[test]
    fn defaults_are_written_as_they_are_set() {
        let value = serde_json::json!({ "a": [1.0, 0.25], "b": null, "c": "moving", "d": true, "e": 1e-9 });
        assert_eq!(as_set(&value), "(a: [1, 0.25], b: none, c: moving, d: true, e: 1e-9)");
    }
}
