//! Settings of a point by path, and the options of a run made from them.

use std::collections::HashSet;
use std::sync::Arc;

use activity::spec::suggestion;
use run::{Change, InputFile, Plan, RunError, RunOptions};
use serde::{Deserialize, Deserializer, Serialize};
use serde_json::{Map, Value, json};
use timing::Level;

/// A setting and its value as text, which the points of a sweep share.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Setting {
    /// An option of a run (`timing`), a view option (`samples`), a value in an input file (`gpu.core_hz`), or
    /// an option of a workload (`workload.bins`).
    pub path: Arc<str>,
    /// The value.
    pub value: Arc<str>,
}

/// Text of a value: a number, `true`, text, or a list.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Text(pub Arc<str>);

impl<'de> Deserialize<'de> for Text {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let value = ron::Value::deserialize(from)?;
        match value {
            ron::Value::String(text) => Ok(Self(text.into())),
            ron::Value::Seq(items) => {
                let items = items.iter().map(ron::to_string).collect::<Result<Vec<_>, _>>();
                items
                    .map(|items| Self(format!("({})", items.join(", ")).into()))
                    .map_err(serde::de::Error::custom)
            }
            other => ron::to_string(&other)
                .map(|text| Self(without_zeros(text).into()))
                .map_err(serde::de::Error::custom),
        }
    }
}

/// A number such as `1100000000.0` without what says nothing; other texts as they are.
fn without_zeros(text: String) -> String {
    let number =
        text.parse::<f64>().ok().filter(|number| number.is_finite() && text.contains(['.', 'e', 'E']));
    number.map_or(text, plain)
}

/// A number as text, with an exponent where it is far from 1.
pub(crate) fn plain(number: f64) -> String {
    let is_plain = number == 0.0 || (1e-4..1e16).contains(&number.abs());
    if is_plain { number.to_string() } else { format!("{number:e}") }
}

/// Options of a run that can be set.
pub(crate) const OPTIONS: [&str; 8] =
    ["scene", "gpu", "platform", "energy", "bound", "timing", "pacing", "seed"];

/// View options that can be set: those of [`workloads::Overrides`].
const VIEW: [&str; 10] = [
    "size",
    "samples",
    "frame_rate_hz",
    "shutter",
    "frames",
    "lens_radius",
    "focus",
    "table",
    "clip",
    "camera",
];

/// Settings within a file or a workload, for lists of what is known.
const WITHIN: [&str; 5] = ["gpu.PATH", "platform.PATH", "table.PATH", "scene.PATH", "workload.NAME"];

/// First name of paths to options of a workload.
const WORKLOAD: &str = "workload";

/// Stage of a run, in order, and the settings that it is the first to depend on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Stage {
    /// Settings of the work and of the pipeline: frames are drawn, to packets and counts.
    Drawing,
    /// Settings of units, clocks and the timing level: packets are timed.
    Timing,
    /// Settings of platform, energy table and pacing: timelines get energies.
    Power,
}

impl Setting {
    /// A setting.
    pub fn new(path: impl Into<Arc<str>>, value: impl Into<Arc<str>>) -> Self {
        Self { path: path.into(), value: value.into() }
    }

    /// Name of the option of `quintile run` that stands for it in messages.
    pub(crate) fn option(&self) -> &str {
        match &*self.path {
            "lens_radius" => "lens",
            "frame_rate_hz" => "rate",
            path => path.strip_prefix("workload.").unwrap_or(path),
        }
    }

    /// Whether files that a run reads may depend on it.
    pub(crate) fn names_files(&self) -> bool {
        let within = ["workload.", "scene.", "gpu.power"];
        matches!(&*self.path, "scene" | "gpu" | "platform" | "energy" | "table" | "camera")
            || within.iter().any(|start| self.path.starts_with(start))
    }

    /// Whether it is of the hardware rather than of the work, or of how the work is measured.
    pub(crate) fn is_of_design(&self) -> bool {
        let of_file = matches!(
            InputFile::of(&self.path),
            Some(InputFile::Gpu | InputFile::Platform | InputFile::Table)
        );
        of_file || matches!(&*self.path, "gpu" | "platform" | "energy")
    }

    /// The first stage of a run that depends on it. A GPU as a whole, and all that is not known to be later,
    /// is of the drawing.
    pub(crate) fn stage(&self) -> Stage {
        match &*self.path {
            "platform" | "energy" | "bound" | "pacing" => Stage::Power,
            "timing" | "gpu.core_hz" | "gpu.memory_hz" => Stage::Timing,
            // What a warp does is counted as it is drawn.
            "gpu.units.shader.warp_lanes" => Stage::Drawing,
            path if path.starts_with("gpu.units.") => Stage::Timing,
            path => match InputFile::of(path) {
                Some(InputFile::Platform | InputFile::Table) => Stage::Power,
                _ => Stage::Drawing,
            },
        }
    }

    fn refused(&self, message: impl std::fmt::Display) -> RunError {
        RunError::invalid(format_args!("{}: `{}`", self.path, self.value), message)
    }
}

/// Texts of settings that are kept once, however many points have them.
#[derive(Default)]
pub(crate) struct Texts {
    known: HashSet<Arc<str>>,
}

impl Texts {
    /// `setting` with the texts that are known, which its own join.
    pub fn shared(&mut self, setting: &Setting) -> Setting {
        Setting { path: self.text(&setting.path), value: self.text(&setting.value) }
    }

    fn text(&mut self, text: &Arc<str>) -> Arc<str> {
        match self.known.get(text) {
            Some(known) => known.clone(),
            None => {
                self.known.insert(text.clone());
                text.clone()
            }
        }
    }
}

/// Whether `path` is a name or a description in an input file, which changes no number.
pub(crate) fn is_label(path: &str) -> bool {
    InputFile::of(path).is_some()
        && path.split_once('.').is_some_and(|(_, name)| matches!(name, "name" | "doc"))
}

/// Whether `path` is an option of the run or of the view.
pub fn is_option(path: &str) -> bool {
    OPTIONS.contains(&path) || VIEW.contains(&path)
}

/// What was meant by a `path` that is nearly a known one; `None` for one that is known or like none.
pub fn misspelt(path: &str) -> Option<String> {
    check_path(path).err().filter(|message| message.contains("did you mean"))
}

/// Checks that `path` names a kind of setting.
///
/// # Errors
/// In words, with the nearest known name.
pub(crate) fn check_path(path: &str) -> Result<(), String> {
    let first = path.split_once('.').map(|(first, _)| first);
    let is_known = match first {
        Some(first) => first == WORKLOAD || InputFile::of(path).is_some(),
        None => is_option(path),
    };
    if is_known {
        return Ok(());
    }
    let suggestion = match first {
        Some(_) => InputFile::suggestion(path),
        None => suggestion(path, &OPTIONS.into_iter().chain(VIEW).chain(WITHIN).collect::<Vec<_>>()),
    };
    Err(format!("unknown setting `{path}`, {suggestion}"))
}

/// A run with `settings`, planned.
///
/// # Errors
/// The first setting or input that is invalid.
pub(crate) fn planned(settings: &[Setting]) -> Result<Plan, RunError> {
    options(settings).and_then(Plan::resolve)
}

/// A run with `settings` that draws the same as `drawn`.
///
/// # Errors
/// As [`planned`].
pub(crate) fn planned_beside(drawn: &Plan, settings: &[Setting]) -> Result<Plan, RunError> {
    options(settings).and_then(|options| drawn.beside(options))
}

/// Options of a run with `settings`.
///
/// # Errors
/// [`RunError::Setting`] for a value of the wrong type. Values in input files and options of workloads are
/// checked when the run is planned.
fn options(settings: &[Setting]) -> Result<RunOptions, RunError> {
    check_scene(settings)?;
    let mut options = RunOptions::default();
    for setting in settings {
        let Setting { path, value } = setting;
        if InputFile::of(path).is_some() {
            options.changes.push(Change { path: path.to_string(), value: value.to_string() });
        } else if let Some(name) = path.strip_prefix("workload.") {
            options.options.set.push((name.to_owned(), value.to_string()));
        } else {
            options = with(&options, setting)?;
        }
    }
    Ok(options)
}

/// `options` with an option of the run or of the view changed.
///
/// # Errors
/// [`RunError::Setting`] for a value of the wrong type.
pub fn with(options: &RunOptions, setting: &Setting) -> Result<RunOptions, RunError> {
    let Ok(Value::Object(fields)) = serde_json::to_value(options) else {
        return Err(setting.refused("the options cannot be changed"));
    };
    let changed = |value: Value| {
        let mut fields = fields.clone();
        let view = fields.get_mut("overrides").and_then(Value::as_object_mut);
        let of_view = view.filter(|_| VIEW.contains(&&*setting.path));
        let within: &mut Map<String, Value> = match of_view {
            Some(view) => view,
            None => &mut fields,
        };
        within.insert(setting.path.to_string(), value);
        serde_json::from_value(Value::Object(fields))
    };
    // A value that looks like a number may be a name.
    let typed = changed(json_of(setting));
    typed.or_else(|error| {
        changed(Value::String(setting.value.to_string()))
            .map_err(|_| setting.refused(in_words(setting, &error)))
    })
}

/// The value in JSON: a number, `true`, a pair such as `(64, 48)`, or text. Frames are a pair or a range such
/// as `0..4`.
fn json_of(setting: &Setting) -> Value {
    let text = setting.value.trim();
    // Runs that are compared have a timing level; `null` would leave it out.
    if &*setting.path == "timing" {
        return Value::String(text.to_owned());
    }
    let list = text.replace('(', "[").replace(')', "]");
    let value = serde_json::from_str(&list).unwrap_or_else(|_| Value::String(text.to_owned()));
    if &*setting.path != "frames" {
        return value;
    }
    let numbers =
        |start: &str, end: &str| Some((start.trim().parse::<u32>().ok()?, end.trim().parse::<u32>().ok()?));
    let range = text.split_once("..").and_then(|(start, end)| numbers(start, end));
    match (range, value.as_array().map(Vec::as_slice)) {
        (Some((start, end)), _) => json!({ "start": start, "end": end }),
        (_, Some([start, end])) => json!({ "start": start, "end": end }),
        _ => value,
    }
}

/// What is wrong with a value, and which values there are.
fn in_words(setting: &Setting, error: &serde_json::Error) -> String {
    let Setting { path, value } = setting;
    if &**path == "timing" && matches!(&**value, "sampled" | "none") {
        let levels = Level::ALL.map(Level::name).join(", ");
        return format!(
            "designs are compared at one of {levels}: use `packet`, or `quintile run --timing {value}` for each design"
        );
    }
    let text = error.to_string();
    let Some((_, expected)) = text.split_once(", expected ") else { return text };
    if text.starts_with("unknown variant") {
        let names: Vec<&str> = expected.split('`').skip(1).step_by(2).collect();
        return format!("unknown value, {}", suggestion(&setting.value, &names));
    }
    let of_path = match &*setting.path {
        "frames" => Some("two whole numbers, such as (0, 4)"),
        "size" => Some("two whole numbers, such as (64, 48)"),
        _ => None,
    };
    let expected = of_path.unwrap_or(match expected {
        "u8" | "u16" | "u32" | "u64" | "usize" => "a whole number from 0, within its range",
        "f32" | "f64" => "a number",
        _ => "of a form that this setting takes",
    });
    format!("it is not {expected}")
}

/// Refuses a value in a scene that is no RON file, and names the setting that stands for it.
fn check_scene(settings: &[Setting]) -> Result<(), RunError> {
    let Some(inside) = settings.iter().find(|setting| setting.path.starts_with("scene.")) else {
        return Ok(());
    };
    let scene = settings.iter().find(|setting| &*setting.path == "scene");
    let scene = scene.map_or("default", |scene| &scene.value);
    if scene.ends_with(".ron") {
        return Ok(());
    }
    let name = inside.path.rsplit('.').next().unwrap_or_default();
    let instead = match name {
        "width" | "height" => "`size`".to_owned(),
        name if VIEW.contains(&name) => format!("`{name}`"),
        _ => format!("the settings {}, or `workload.NAME` of a workload", VIEW.join(", ")),
    };
    let why = format!("`{scene}` is not a scene in a .ron file: use {instead} in its place");
    Err(RunError::invalid(format_args!("{}={}", inside.path, inside.value), why))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn one(path: &str, value: &str) -> Result<RunOptions, String> {
        options(&[Setting::new(path, value)]).map_err(|error| error.to_string())
    }

    #[test]
    fn every_kind_of_setting_has_its_place() {
        assert_eq!(one("samples", "4").unwrap().overrides.samples, Some(4));
        assert_eq!(one("size", "(64, 48)").unwrap().overrides.size, Some((64, 48)));
        assert_eq!(one("frames", "(1, 3)").unwrap().overrides.frames, Some(1..3));
        assert_eq!(one("frames", "1..3").unwrap().overrides.frames, Some(1..3));
        assert_eq!(one("clip", "5").unwrap().overrides.clip.as_deref(), Some("5"));
        assert_eq!(one("timing", "bound").unwrap().level().name(), "bound");
        assert_eq!(one("gpu.core_hz", "1e8").unwrap().changes[0].path, "gpu.core_hz");
        assert_eq!(one("workload.bins", "8").unwrap().options.set, [("bins".to_owned(), "8".to_owned())]);
    }

    #[test]
    fn every_listed_option_is_one_of_a_run() {
        let Ok(Value::Object(fields)) = serde_json::to_value(RunOptions::default()) else { panic!() };
        assert!(OPTIONS.iter().all(|name| fields.contains_key(*name)));
        let view: Vec<&str> = fields["overrides"].as_object().unwrap().keys().map(String::as_str).collect();
        assert!(view.len() == VIEW.len() && VIEW.iter().all(|name| view.contains(name)), "{view:?}");
    }

    #[test]
    fn a_value_in_a_scene_that_is_no_ron_file_names_its_setting() {
        let refused = |path: &str| {
            let settings = [Setting::new("scene", "Fox.glb"), Setting::new(path, "4")];
            options(&settings).unwrap_err().to_string()
        };
        assert!(refused("scene.settings.samples").ends_with("use `samples` in its place"));
        assert!(refused("scene.settings.width").ends_with("use `size` in its place"));
        assert!(refused("scene.objects.0.velocity").contains("lens_radius, focus"));
    }

    #[test]
    fn values_of_another_type_are_refused_in_words() {
        for (path, value) in [
            ("samples", "1.5"),
            ("samples", "-1"),
            ("samples", "99999999999"),
            ("samples", "(1, 2)"),
            ("samples", "true"),
            ("size", "3"),
            ("size", "(1, 2, 3)"),
            ("size", "x"),
            ("frames", "5"),
            ("frames", "(1, 2, 3)"),
            ("frames", "a..b"),
            ("seed", "-1"),
            ("shutter", "x"),
            ("lens_radius", "true"),
            ("focus", "(1, 2)"),
            ("timing", "1"),
            ("bound", "true"),
            ("pacing", "(1, 2)"),
            ("frame_rate_hz", "x"),
        ] {
            let message = one(path, value).unwrap_err();
            let words = [
                "u32", "u64", "f32", "f64", "tuple", "struct", "enum", "integer", "variant", "floating",
                "line ",
            ];
            assert!(words.iter().all(|word| !message.contains(word)), "{message}");
            assert!(message.starts_with(&format!("{path}: `{value}`: ")), "{message}");
        }
    }

    #[test]
    fn unknown_names_and_values_get_a_suggestion() {
        assert_eq!(check_path("timming").unwrap_err(), "unknown setting `timming`, did you mean `timing`?");
        assert!(check_path("gpuu.core_hz").unwrap_err().contains("did you mean `gpu.core_hz`?"));
        let known = check_path("what").unwrap_err();
        assert!(
            known.contains("focus") && known.contains("gpu.PATH") && known.contains("workload.NAME"),
            "{known}"
        );
        assert!(check_path("platform.v_v").is_ok() && check_path("workload.x").is_ok());
        assert_eq!(
            one("timing", "stepd").unwrap_err(),
            "timing: `stepd`: unknown value, did you mean `stepped`?"
        );
        for level in ["sampled", "none"] {
            let says = format!(
                "timing: `{level}`: designs are compared at one of stepped, packet, bound: use `packet`, or `quintile run --timing {level}` for each design"
            );
            assert_eq!(one("timing", level).unwrap_err(), says);
        }
        assert_eq!(
            one("samples", "x").unwrap_err(),
            "samples: `x`: it is not a whole number from 0, within its range"
        );
    }
}
