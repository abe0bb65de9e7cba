//! Values of `run --set`: each option that has several makes more runs.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use output::table::{Table, count_or_digits, si};

use run::{Change, FrameRow, RunOptions, Summary};
use sweep::Setting;
use workloads::catalog;

use super::Failure;

/// Most runs of one command; a sweep has more.
const MAX_RUNS: usize = 1000;

/// Most letters of the name of a folder.
const MAX_NAME: usize = 150;

/// A run of several.
#[derive(Clone, Debug)]
pub(super) struct Listed {
    /// The settings that differ.
    pub varied: Vec<Setting>,
    /// Options with all settings.
    pub options: RunOptions,
    /// Folder of its results.
    pub out: PathBuf,
}

/// The runs that `sets` make of `options`, each in a folder of its own below `out`; a single one in `out`
/// itself. The last option that has several values varies fastest.
///
/// # Errors
/// If a value cannot be set, is listed twice, or is one too many.
pub(super) fn runs(
    options: &RunOptions,
    sets: &[(String, String)],
    out: &Path,
) -> Result<Vec<Listed>, Failure> {
    let lists: Vec<(String, Vec<String>)> =
        sets.iter().map(|(path, value)| (full(path, &options.scene), split(value))).collect();
    let (several, single): (Vec<_>, Vec<_>) = lists.into_iter().partition(|(_, values)| values.len() > 1);
    let wrong = |message: String| Failure { message: format!("--set: {message}"), code: 2 };
    let count = several.iter().try_fold(1_usize, |count, (_, values)| count.checked_mul(values.len()));
    if count.is_none_or(|count| count > MAX_RUNS) {
        return Err(wrong(format!("these lists make more than {MAX_RUNS} runs: use `quintile sweep`")));
    }
    for (at, (path, values)) in several.iter().enumerate() {
        let is_repeated = several[at + 1..].iter().chain(&single).any(|(other, _)| other == path);
        if is_repeated {
            return Err(wrong(format!("`{path}` is given twice: write all of its values in one list")));
        }
        if values.iter().any(String::is_empty) {
            return Err(wrong(format!("`{path}` has an empty value in its list")));
        }
    }
    let mut names = BTreeSet::new();
    let combined = sweep::combinations(several).map_err(wrong)?;
    let listed = |varied: Vec<Setting>| {
        let mut options = options.clone();
        for (path, values) in &single {
            set(&mut options, &Setting::new(path.as_str(), values.concat()))?;
        }
        varied.iter().try_for_each(|setting| set(&mut options, setting))?;
        let out = if varied.is_empty() { out.to_owned() } else { out.join(unique(&varied, &mut names)) };
        Ok(Listed { varied, options, out })
    };
    combined.into_iter().map(listed).collect()
}

/// Whether `scene` names a workload.
fn is_workload(scene: &Path) -> bool {
    catalog::names().any(|(name, _)| Path::new(name) == scene)
}

/// `path` as sweep files name it: a name without a dot is an option of the workload, where one runs.
fn full(path: &str, scene: &Path) -> String {
    if !path.contains('.') && is_workload(scene) { format!("workload.{path}") } else { path.to_owned() }
}

/// Sets one option: a value in an input file, an option of a workload, or one of the run.
///
/// # Errors
/// If its value cannot be set, or its name is nearly that of another.
pub(super) fn set(options: &mut RunOptions, setting: &Setting) -> Result<(), Failure> {
    let Setting { path, value } = setting;
    if let Some(name) = path.strip_prefix("workload.") {
        options.options.set.push((name.to_owned(), value.to_string()));
    } else if path.contains('.') {
        options.changes.push(Change { path: path.to_string(), value: value.to_string() });
    } else if is_workload(&options.scene) {
        options.options.set.push((path.to_string(), value.to_string()));
    } else if sweep::is_option(path) {
        *options = sweep::with(options, setting)?;
    } else if let Some(meant) = sweep::misspelt(path) {
        return Err(Failure { message: format!("--set {path}={value}: {meant}"), code: 2 });
    } else {
        // An option of a workload; scenes refuse it.
        options.options.set.push((path.to_string(), value.to_string()));
    }
    Ok(())
}

/// The values of a list: what is between commas outside of brackets and quotes.
fn split(list: &str) -> Vec<String> {
    let (mut depth, mut is_quoted, mut is_escaped) = (0_usize, false, false);
    let is_end = |letter: char| {
        let escaped = is_escaped;
        is_escaped = is_quoted && !escaped && letter == '\\';
        match letter {
            '"' if !escaped => is_quoted = !is_quoted,
            _ if is_quoted => {}
            '(' | '[' | '{' => depth += 1,
            ')' | ']' | '}' => depth = depth.saturating_sub(1),
            _ => {}
        }
        letter == ',' && depth == 0 && !is_quoted
    };
    list.split(is_end).map(|value| value.trim().to_owned()).collect()
}

/// Name of a folder for these settings that is not among `names`.
fn unique(settings: &[Setting], names: &mut BTreeSet<String>) -> String {
    let parts: Vec<String> =
        settings.iter().map(|setting| format!("{}={}", setting.path, setting.value)).collect();
    let plain =
        |letter: char| if letter.is_alphanumeric() || "-_.=+,".contains(letter) { letter } else { '_' };
    let name: String = parts.join(",").chars().map(plain).take(MAX_NAME).collect();
    let numbered = (2..).map(|number| format!("{name}-{number}"));
    let free = std::iter::once(name.clone()).chain(numbered).find(|name| !names.contains(name));
    let free = free.unwrap_or(name);
    names.insert(free.clone());
    free
}

/// Compares runs: what differs, and means of a frame, also over those of the first run.
pub(super) fn table(runs: &[(Listed, Summary)]) -> Table {
    let varied = runs.first().map_or(&[][..], |(run, _)| &run.varied);
    let names = varied.iter().map(|setting| &*setting.path);
    let numbers = ["cycles", "busy time", "ratio", "energy", "ratio"];
    let mut table = Table::new(names.chain(numbers).collect::<Vec<_>>());
    let Some((_, first)) = runs.first() else { return table };
    let mean = |summary: &Summary, of: fn(&FrameRow) -> f64| {
        summary.frames.iter().map(of).sum::<f64>() / summary.frames.len() as f64
    };
    for (run, summary) in runs {
        let cycles = mean(summary, |frame| frame.cycles as f64);
        let cell = |of: fn(&FrameRow) -> f64, unit: &str| {
            let value = mean(summary, of);
            [si(value, unit), format!("{:.4}", value / mean(first, of))]
        };
        let numbers = cell(|frame| frame.busy_s, "s").into_iter().chain(cell(|frame| frame.energy_j, "J"));
        let settings = run.varied.iter().map(|setting| setting.value.to_string());
        table.row(settings.chain([count_or_digits(cycles)]).chain(numbers).collect::<Vec<_>>());
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    fn made(scene: &str, sets: &[(&str, &str)]) -> Result<Vec<Listed>, String> {
        let options = RunOptions { scene: scene.into(), ..RunOptions::default() };
        let sets: Vec<(String, String)> =
            sets.iter().map(|(path, value)| ((*path).to_owned(), (*value).to_owned())).collect();
        runs(&options, &sets, Path::new("out")).map_err(|failure| failure.message)
    }

    #[test]
    fn commas_within_brackets_and_quotes_do_not_split() {
        for (list, values) in [
            ("4", &["4"][..]),
            ("4, 8", &["4", "8"]),
            ("(1, 2),(3, 4)", &["(1, 2)", "(3, 4)"]),
            ("Box(size: (1, 1, 1))", &["Box(size: (1, 1, 1))"]),
            (r#""a, \"b", c"#, &[r#""a, \"b""#, "c"]),
            ("4,", &["4", ""]),
        ] {
            assert_eq!(split(list), values, "{list}");
        }
    }

    #[test]
    fn lists_make_runs_with_folders_of_their_own() {
        let listed =
            made("tiny", &[("gpu.core_hz", "2e8"), ("gpu.pipeline.tile_px", "4,8"), ("samples", "1,2")]);
        let listed = listed.unwrap();
        let folders: Vec<String> = listed.iter().map(|run| run.out.display().to_string()).collect();
        assert_eq!(folders[0], "out/gpu.pipeline.tile_px=4,samples=1");
        assert_eq!(folders[3], "out/gpu.pipeline.tile_px=8,samples=2");
        assert_eq!(listed[3].options.overrides.samples, Some(2));
        assert_eq!(listed[3].options.changes.len(), 2);
        let single = made("tiny", &[("samples", "4")]).unwrap();
        assert_eq!((single.len(), &*single[0].out), (1, Path::new("out")));
    }

    #[test]
    fn names_without_a_dot_are_options_of_a_workload_where_one_runs() {
        let listed = made("glossy", &[("scene", "default"), ("workload.map_px", "64")]).unwrap();
        assert_eq!(listed[0].options.scene, Path::new("glossy"));
        assert_eq!(listed[0].options.options.set.len(), 2);
        let listed = made("glossy", &[("texels", "64,128")]).unwrap();
        assert_eq!(listed[1].options.options.set, [("texels".to_owned(), "128".to_owned())]);
        let scenes = made("default", &[("scene", "tiny,carousel")]).unwrap();
        assert_eq!(scenes[1].options.scene, Path::new("carousel"));
    }

    #[test]
    fn folders_differ_whatever_the_values_are() {
        let mut names = BTreeSet::new();
        let [a, b] = ["a/b", "a:b"].map(|value| unique(&[Setting::new("clip", value)], &mut names));
        assert_eq!([a.as_str(), b.as_str()], ["clip=a_b", "clip=a_b-2"]);
    }

    #[test]
    fn wrong_lists_say_what_to_do() {
        for (sets, says) in [
            (&[("gpu.core_hz", "1e8,2e8"), ("gpu.core_hz", "3e8")][..], "given twice"),
            (&[("gpu.core_hz", "1e8,")], "an empty value"),
            (&[("gpu.core_hz", "1e8,1e8")], "has 1e8 twice"),
            (&[("gpo.core_hz", "1e8,2e8")], "did you mean `gpu.core_hz`?"),
            (&[("timng", "bound")], "--set timng=bound: unknown setting `timng`, did you mean `timing`?"),
        ] {
            let error = made("tiny", sets).unwrap_err();
            assert!(error.contains(says), "{error}");
        }
        let long = (0..40).map(|n| n.to_string()).collect::<Vec<_>>().join(",");
        let error = made("tiny", &[("seed", &long), ("samples", &long)]).unwrap_err();
        assert!(error.contains("use `quintile sweep`"), "{error}");
    }
}
