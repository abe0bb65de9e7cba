//! Comparison of two runs by their `summary.json`, or of two tables of frames.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde_json::Value;
use traces::energy::Spread;

use super::CompareError;

/// File of a run that is compared.
pub(super) const SUMMARY: &str = "summary.json";

/// Comparison of two runs.
#[derive(Clone, Debug, Serialize)]
pub struct RunComparison {
    /// The summaries.
    pub files: [String; 2],
    /// Reasons why the two runs may not be comparable.
    pub warnings: Vec<String>,
    /// Quantities whose order the stated errors of the runs leave open.
    pub undecided: Vec<String>,
    /// Settings and inputs that differ.
    pub settings: Vec<ComparedSetting>,
    /// All numbers of both runs, in the order of the file.
    pub values: Vec<ValueChange>,
}

/// A setting or input of both runs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ComparedSetting {
    /// Path of the key in the file.
    pub name: String,
    /// Value in A; null if missing.
    pub a: Value,
    /// Value in B; null if missing.
    pub b: Value,
}

/// Keys of settings and inputs. The command line is not compared.
const SETTINGS: [&str; 10] = [
    "schema",
    "version",
    "scene",
    "gpu",
    "platform",
    "energy_table",
    "settings",
    "camera",
    "inputs",
    "modelled",
];

/// Keys within [`SETTINGS`] that are results.
const RESULTS: [&str; 5] =
    ["modelled.units", "modelled.units_not_modelled", "modelled.limits", "camera.ron", "settings.triangles"];

/// Keys of numbers: key, name of the group, and unit if the key's name does not end in one.
const GROUPS: [(&str, &str, &str); 14] = [
    ("truth", "frames (truth)", ""),
    ("measured", "frames (measured)", ""),
    ("power_by_part_w", "power", "W"),
    ("energy_by_part_j", "energy of the run", "J"),
    ("unit_busy", "busy share", ""),
    ("stalls", "shares of time", ""),
    ("sample_test_efficiency", "sample test", ""),
    ("facts", "facts", ""),
    ("counts", "counters", ""),
    ("checks", "checks", ""),
    ("detection", "detection", ""),
    ("stated_error", "stated errors", ""),
    ("verified", "actual errors", ""),
    ("hardware", "hardware", ""),
];

/// Keys of `frames` whose means are compared.
const OF_FRAMES: [&str; 3] = ["cycles", "busy_ms", "busy_s"];

/// Compares two runs, each given as a folder or as a summary file.
pub(super) fn compare(a: &Path, b: &Path) -> Result<RunComparison, CompareError> {
    let paths = [a, b].map(|path| if path.is_dir() { path.join(SUMMARY) } else { path.to_owned() });
    let runs = [read(&paths[0])?, read(&paths[1])?];
    let settings = settings(&runs);
    Ok(RunComparison {
        files: paths.map(|path: PathBuf| path.display().to_string()),
        warnings: warnings(&runs),
        undecided: undecided(&runs),
        settings,
        values: values(&runs),
    })
}

fn read(path: &Path) -> Result<Value, CompareError> {
    let text = std::fs::read(path).map_err(CompareError::unreadable(path))?;
    let run: Value = serde_json::from_slice(&text)
        .map_err(|error| CompareError::broken(path, format!("not JSON: {error}; run it again")))?;
    if run["scene"].is_string() && run["images"].is_array() {
        let images = path.with_file_name("images").display().to_string();
        return Err(CompareError::Usage(format!(
            "{}: it is a run of images alone (`--timing none`), which has no numbers to compare: compare its images, {images}",
            path.display()
        )));
    }
    let whole = run["scene"].is_string() && run["counts"].is_object() && run["frames"].is_array();
    if !whole {
        let message = "it is not the summary of `quintile run`: give the folder of a run or its summary.json";
        return Err(CompareError::broken(path, message));
    }
    Ok(run)
}

fn warnings(runs: &[Value; 2]) -> Vec<String> {
    let mut warnings = Vec::new();
    let [a, b] = runs;
    if a["schema"] != b["schema"] {
        warnings.push(format!(
            "the files have different schemas ({}, {}): what only one of them has is not compared",
            shown(&a["schema"]),
            shown(&b["schema"])
        ));
    }
    if a["scene"] != b["scene"] {
        warnings.push(format!("the scenes differ ({}, {})", shown(&a["scene"]), shown(&b["scene"])));
    }
    let pixels = |run: &Value| [run["settings"]["width"].as_u64(), run["settings"]["height"].as_u64()];
    if pixels(a) != pixels(b) {
        warnings.push("the images have different sizes: compare energies per pixel".to_owned());
    }
    let frames = |run: &Value| run["frames"].as_array().map_or(0, Vec::len);
    if frames(a) != frames(b) {
        warnings.push(format!(
            "the runs have {} and {} frames: compare means of frames, not sums of runs",
            frames(a),
            frames(b)
        ));
    }
    if a["modelled"]["timing"] != b["modelled"]["timing"] {
        warnings.push(format!(
            "time was modelled differently ({}, {}): a difference may be an error of the model",
            shown(&a["modelled"]["timing"]),
            shown(&b["modelled"]["timing"])
        ));
    }
    warnings
}

/// A number of a frame: its name, the name of its stated error, and its value.
type OfFrame = (&'static str, &'static str, fn(&Value) -> Option<f64>);

/// Quantities that differ by less than the stated errors of both runs together.
fn undecided(runs: &[Value; 2]) -> Vec<String> {
    let mean = |run: &Value, of: fn(&Value) -> Option<f64>| {
        let numbers = run["frames"].as_array()?.iter().map(of).collect::<Option<Vec<f64>>>()?;
        Some(numbers.iter().sum::<f64>() / numbers.len() as f64).filter(|mean| *mean > 0.0)
    };
    let quantity = |(name, error, of): OfFrame| {
        let [a, b] = [mean(&runs[0], of)?, mean(&runs[1], of)?];
        let [of_a, of_b] = runs.each_ref().map(|run| run["stated_error"][error].as_f64());
        let reach = libm::log1p(of_a?) + libm::log1p(of_b?);
        let ratio = b / a;
        (a != b && libm::log(ratio).abs() <= reach).then(|| {
            let [low, high] = [ratio / libm::exp(reach), ratio * libm::exp(reach)];
            format!(
                "{name}: B over A is {ratio:.4}, and between {low:.4} and {high:.4} within the stated errors"
            )
        })
    };
    let quantities: [OfFrame; 2] = [
        ("busy time", "cycles", |frame| frame["busy_s"].as_f64()),
        ("busy energy", "energy", |frame| {
            let parts = frame["energy_by_part_j"].as_object()?.iter().filter(|(part, _)| *part != "idle");
            parts.map(|(_, energy)| energy.as_f64()).sum()
        }),
    ];
    quantities.into_iter().filter_map(quantity).collect()
}

/// A JSON value as text: strings without quotes, `-` for null, input files by path and the first digits of
/// their SHA-256.
pub fn shown(value: &Value) -> String {
    match value {
        Value::Array(items) if items.iter().any(|item| item["path"].is_string()) => {
            items.iter().map(shown).collect::<Vec<_>>().join(", ")
        }
        Value::Object(input) if input.contains_key("path") => {
            let text = |key: &str| input.get(key).and_then(Value::as_str).unwrap_or("missing");
            format!("{} ({:.8})", text("path"), text("sha256"))
        }
        Value::Null => "-".to_owned(),
        Value::String(text) => text.clone(),
        other => other.to_string(),
    }
}

fn settings(runs: &[Value; 2]) -> Vec<ComparedSetting> {
    let pairs = SETTINGS.iter().flat_map(|key| leaves(key, [&runs[0][key], &runs[1][key]]));
    let differs = |(name, [a, b]): &(String, [&Value; 2])| {
        a != b && !RESULTS.iter().any(|result| name.starts_with(result))
    };
    let made = |(name, [a, b]): (String, [&Value; 2])| ComparedSetting { name, a: a.clone(), b: b.clone() };
    let [a, b] = runs.each_ref().map(options);
    let options = (a != b).then(|| ComparedSetting { name: "options".to_owned(), a, b });
    pairs.filter(differs).map(made).chain(options).collect()
}

/// Options of a workload and changed values as on the command line, or null.
fn options(run: &Value) -> Value {
    let options = &run["request"]["options"];
    let pair = |pair: &Value| Some(format!("{}={}", pair[0].as_str()?, pair[1].as_str()?));
    let set = options["set"].as_array().into_iter().flatten().filter_map(pair);
    let change = |change: &Value| Some(format!("{}={}", change["path"].as_str()?, change["value"].as_str()?));
    let changes = run["request"]["changes"].as_array().into_iter().flatten().filter_map(change);
    let file = options["file"].as_str().map(str::to_owned);
    let all: Vec<String> = file.into_iter().chain(set).chain(changes).collect();
    if all.is_empty() { Value::Null } else { Value::String(all.join(" ")) }
}

fn values(runs: &[Value; 2]) -> Vec<ValueChange> {
    let mut values: Vec<ValueChange> = OF_FRAMES.iter().filter_map(|name| of_frames(runs, name)).collect();
    for (key, group, unit) in GROUPS {
        for (name, pair) in leaves(key, [&runs[0][key], &runs[1][key]]) {
            let name = name.strip_prefix(key).map_or(name.as_str(), |rest| rest.trim_start_matches('.'));
            let name = if name.is_empty() { key } else { name };
            let numbers = pair.map(Value::as_f64);
            if numbers.iter().any(Option::is_some) {
                let unit = if unit.is_empty() { unit_of(name) } else { unit };
                values.push(ValueChange::new(group, name, unit, numbers));
            }
        }
    }
    values
}

/// Mean over frames of the number `name`.
fn of_frames(runs: &[Value; 2], name: &str) -> Option<ValueChange> {
    let mean = |run: &Value| {
        let numbers: Option<Vec<f64>> =
            run["frames"].as_array()?.iter().map(|frame| frame[name].as_f64()).collect();
        let numbers = numbers.filter(|numbers| !numbers.is_empty())?;
        Some(numbers.iter().sum::<f64>() / numbers.len() as f64)
    };
    let means = [mean(&runs[0]), mean(&runs[1])];
    let known = means.iter().any(Option::is_some);
    known.then(|| ValueChange::new("mean of a frame", name, unit_of(name), means))
}

/// Unit from the ending of a name, or of a part of its path.
fn unit_of(name: &str) -> &'static str {
    let units = [
        ("_nj_per_pixel", "nJ"),
        ("_ms", "ms"),
        ("_mj", "mJ"),
        ("_s", "s"),
        ("_j", "J"),
        ("_w", "W"),
        ("_hz", "Hz"),
        ("_bytes", "bytes"),
    ];
    let of_part = |part: &str| units.iter().find(|(ending, _)| part.ends_with(ending)).map(|(_, unit)| *unit);
    name.split('.').find_map(of_part).unwrap_or("")
}

/// Pairs of values below two others, by path. Lists count as one value.
fn leaves<'a>(name: &str, pair: [&'a Value; 2]) -> Vec<(String, [&'a Value; 2])> {
    let objects = pair.map(Value::as_object);
    if objects.iter().all(Option::is_none) {
        return vec![(name.to_owned(), pair)];
    }
    let mut keys: Vec<&String> = objects.iter().flatten().flat_map(|object| object.keys()).collect();
    keys.sort();
    keys.dedup();
    keys.into_iter().flat_map(|key| leaves(&format!("{name}.{key}"), pair.map(|value| &value[key]))).collect()
}

/// Largest relative difference of sums of the same numbers in another order.
const ROUNDING: f64 = 1e-13;

/// Value of a quantity in A and in B.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ValueChange {
    /// Group of the quantity.
    pub group: String,
    /// Name of the number.
    pub name: String,
    /// Unit of the number; empty for counts and shares.
    pub unit: String,
    /// Value in A, if present.
    pub a: Option<f64>,
    /// Value in B, if present.
    pub b: Option<f64>,
    /// B minus A.
    pub difference: Option<f64>,
    /// B over A; `None` if A is zero.
    pub ratio: Option<f64>,
}

impl ValueChange {
    /// The change from `a` to `b`.
    pub fn new(group: &str, name: &str, unit: &str, [a, b]: [Option<f64>; 2]) -> Self {
        let both = a.zip(b);
        Self {
            group: group.to_owned(),
            name: name.to_owned(),
            unit: unit.to_owned(),
            a,
            b,
            difference: both.map(|(a, b)| b - a),
            ratio: both.filter(|(a, _)| *a != 0.0).map(|(a, b)| b / a),
        }
    }

    /// Whether both values are equal but for the rounding of sums, or both are missing.
    pub fn is_equal(&self) -> bool {
        let close = |(a, b): (f64, f64)| (a - b).abs() <= ROUNDING * a.abs().max(b.abs());
        self.a == self.b || self.a.zip(self.b).is_some_and(close)
    }
}

/// Comparison of two tables of frames.
#[derive(Clone, Debug, Serialize)]
pub struct TableComparison {
    /// The files.
    pub files: [String; 2],
    /// Number of frames, and mean and standard deviation of each column.
    pub values: Vec<ValueChange>,
}

/// Columns of `frames.csv` that are compared, with their units.
const COLUMNS: [(&str, &str); 6] = [
    ("duration_s", "s"),
    ("energy_J", "J"),
    ("power_W", "W"),
    ("energy_per_pixel_J", "J"),
    ("confidence", ""),
    ("true_energy_J", "J"),
];

/// Compares two tables written by `quintile run` or `quintile trace frames`.
pub(super) fn compare_tables(a: &Path, b: &Path) -> Result<TableComparison, CompareError> {
    let [one, other] = [read_table(a)?, read_table(b)?];
    let frames = [&one, &other].map(|table| table.values().map(Vec::len).max().map(|count| count as f64));
    let mut values = vec![ValueChange::new("frames", "frames", "", frames)];
    for (column, unit) in COLUMNS {
        let numbers = [&one, &other].map(|table| table.get(column).filter(|column| !column.is_empty()));
        if numbers.iter().all(Option::is_none) {
            continue;
        }
        let spreads = numbers.map(|numbers| numbers.and_then(|numbers| Spread::of(numbers)));
        let means = spreads.map(|spread| spread.map(|spread| spread.mean));
        values.push(ValueChange::new("mean over frames", column, unit, means));
        let deviations = spreads.map(|spread| spread.map(|spread| spread.deviation));
        values.push(ValueChange::new("standard deviation", column, unit, deviations));
    }
    Ok(TableComparison { files: [a, b].map(|path| path.display().to_string()), values })
}

/// Reads the known columns; empty cells are skipped.
fn read_table(path: &Path) -> Result<BTreeMap<&'static str, Vec<f64>>, CompareError> {
    let broken = |message: String| CompareError::broken(path, message);
    let file = std::fs::File::open(path).map_err(CompareError::unreadable(path))?;
    let mut reader = csv::Reader::from_reader(file);
    let header = reader.headers().map_err(|error| broken(format!("not a CSV file: {error}")))?.clone();
    let place = |name: &str| header.iter().position(|column| column == name);
    let places: Vec<(&'static str, usize)> =
        COLUMNS.iter().filter_map(|(name, _)| Some((*name, place(name)?))).collect();
    if !places.iter().any(|(name, _)| *name == "energy_J") {
        return Err(broken(
            "it has no column `energy_J`: give a frames.csv of `quintile run` or `quintile trace frames`"
                .to_owned(),
        ));
    }
    let mut table: BTreeMap<&'static str, Vec<f64>> =
        places.iter().map(|(name, _)| (*name, Vec::new())).collect();
    for (line, record) in (2..).zip(reader.records()) {
        let record = record.map_err(|error| broken(format!("line {line}: {error}")))?;
        for (name, place) in &places {
            let cell = record.get(*place).unwrap_or_default().trim();
            if cell.is_empty() {
                continue;
            }
            let number = cell.parse::<f64>().ok().filter(|number| number.is_finite());
            let number = number.ok_or_else(|| {
                broken(format!("line {line}: {name} is `{cell}`, which is not a finite number"))
            })?;
            table.entry(name).or_default().push(number);
        }
    }
    Ok(table)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn run(scene: &str, samples: u32, energy: f64) -> Value {
        json!({
            "schema": 2, "scene": scene, "gpu": "g", "settings": {"width": 4, "height": 4, "samples": samples},
            "truth": {"frames": 2, "energy_j": {"mean": energy, "deviation": 0.0}},
            "counts": {"samples_tested": 100 * samples}, "unit_busy": {"setup": 0.5},
            "frames": [{"cycles": 10, "busy_s": 1.0}, {"cycles": 30, "busy_s": 1.0}],
            "modelled": {"timing": "packet", "units": ["a"]},
        })
    }

    #[test]
    fn settings_have_paths_and_numbers_have_units() {
        let runs = [run("a", 4, 2.0), run("a", 8, 3.0)];
        let differ = settings(&runs);
        assert_eq!(
            differ,
            [ComparedSetting { name: "settings.samples".to_owned(), a: json!(4), b: json!(8) }]
        );
        let values = values(&runs);
        let energy = values.iter().find(|change| change.name == "energy_j.mean").unwrap();
        assert_eq!((energy.unit.as_str(), energy.difference, energy.ratio), ("J", Some(1.0), Some(1.5)));
        let cycles = values.iter().find(|change| change.name == "cycles").unwrap();
        assert_eq!((cycles.a, cycles.is_equal()), (Some(20.0), true));
        assert!(warnings(&runs).is_empty());
    }

    #[test]
    fn orders_within_the_stated_errors_are_undecided() {
        let run = |busy_s: f64, energy_j: f64, error: f64| {
            json!({
                "frames": [{"busy_s": busy_s, "energy_by_part_j": {"dram": energy_j, "idle": 100.0}}],
                "stated_error": {"cycles": error, "energy": error},
            })
        };
        let found = undecided(&[run(1.0, 1.0, 0.05), run(1.08, 2.0, 0.05)]);
        assert_eq!(
            found,
            ["busy time: B over A is 1.0800, and between 0.9796 and 1.1907 within the stated errors"]
        );
        assert!(undecided(&[run(1.0, 1.0, 0.0), run(1.08, 2.0, 0.05)]).is_empty());
        assert!(undecided(&[run(1.0, 1.0, 0.05), json!({"frames": []})]).is_empty());
    }

    #[test]
    fn options_of_a_workload_are_shown_as_given() {
        let mut runs = [run("a", 4, 2.0), run("a", 4, 2.0)];
        runs[1]["request"] =
            json!({"options": {"file": null, "set": [["method", "forward"], ["lights", "3"]]}});
        let differ = settings(&runs);
        let options = ComparedSetting {
            name: "options".to_owned(),
            a: Value::Null,
            b: json!("method=forward lights=3"),
        };
        assert_eq!(differ, [options]);
    }

    #[test]
    fn input_files_are_shown_by_path_and_hash() {
        let inputs =
            json!([{"path": "a.ron", "bytes": 3, "sha256": "0123456789ab"}, {"path": "b", "sha256": null}]);
        assert_eq!(shown(&inputs), "a.ron (01234567), b (missing)");
    }

    #[test]
    fn runs_that_are_not_comparable_give_warnings() {
        let mut other = run("b", 4, 2.0);
        other["settings"]["width"] = json!(8);
        other["frames"] = json!([{"cycles": 1}]);
        other["modelled"]["timing"] = json!("stepped");
        other["schema"] = json!(3);
        let found = warnings(&[run("a", 4, 2.0), other]).join("\n");
        for says in [
            "different schemas (2, 3)",
            "scenes differ (a, b)",
            "sizes",
            "2 and 1 frames",
            "(packet, stepped)",
        ] {
            assert!(found.contains(says), "{found}");
        }
    }

    #[test]
    fn a_change_has_a_sign_and_a_ratio() {
        let change = ValueChange::new("g", "n", "J", [Some(2.0), Some(1.5)]);
        assert_eq!((change.difference, change.ratio), (Some(-0.5), Some(0.75)));
        assert_eq!(ValueChange::new("g", "n", "J", [Some(0.0), Some(1.0)]).ratio, None);
        assert!(ValueChange::new("g", "n", "J", [Some(0.1 + 0.2), Some(0.3)]).is_equal());
        assert!(!ValueChange::new("g", "n", "J", [Some(1.0), Some(1.0 + 1e-9)]).is_equal());
        let missing = ValueChange::new("g", "n", "J", [None, Some(1.0)]);
        assert!(!missing.is_equal() && missing.difference.is_none());
    }

    #[test]
    fn tables_are_compared_by_their_means() {
        let folder = tempfile::tempdir().unwrap();
        let put = |name: &str, text: &str| {
            std::fs::write(folder.path().join(name), text).unwrap();
            folder.path().join(name)
        };
        let a = put("a.csv", "frame,duration_s,energy_J,true_energy_J\n0,0.1,2,\n1,0.1,4,\n");
        let b = put("b.csv", "frame,duration_s,energy_J,true_energy_J\n0,0.1,6,\n");
        let compared = compare_tables(&a, &b).unwrap();
        let energy = compared.values.iter().find(|change| change.name == "energy_J").unwrap();
        assert_eq!((energy.a, energy.b, energy.ratio), (Some(3.0), Some(6.0), Some(2.0)));
        assert_eq!(compared.values[0].difference, Some(-1.0));
        assert!(compared.values.iter().all(|change| change.name != "true_energy_J"));
        for (text, says) in
            [("a,b\n1,2\n", "no column `energy_J`"), ("energy_J\nnan\n", "line 2: energy_J is `nan`")]
        {
            let error = compare_tables(&a, &put("c.csv", text)).unwrap_err();
            assert!(error.is_usage() && error.to_string().contains(says), "{error}");
        }
    }
}
