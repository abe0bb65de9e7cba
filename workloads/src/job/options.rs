//! Options of a job, from a RON file and then single values, and the run options (flags) that a job uses.

use std::borrow::Cow;
use std::fmt::Debug;
use std::path::PathBuf;

use activity::spec::{self, suggestion};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Number, Value};

use crate::error::LoadError;
use crate::scene::Overrides;

/// Sources of a job's options; others have defaults.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OptionSource {
    /// RON file.
    pub file: Option<PathBuf>,
    /// Names and values that override the file. A value is a number, `true`, a list such as `[1, 2]`, RON in
    /// parentheses such as `(pitch: 4.5)`, or text.
    pub set: Vec<(String, String)>,
}

/// Options of a job.
pub trait JobOptions: Default + Serialize + DeserializeOwned {
    /// What options need of others; those without a row always have an effect.
    const NEEDS: &'static [Need] = &[];
}

/// What an option needs to have an effect: a choice that another option makes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Need {
    /// The option.
    pub option: &'static str,
    /// The option that makes the choice.
    pub choice: &'static str,
    /// Values of `choice` with which `option` has an effect, as they are set; `none` where it is left out.
    pub values: &'static [&'static str],
}

impl Need {
    /// `option` has an effect if `choice` is one of `values`.
    pub(crate) const fn new(
        option: &'static str,
        choice: &'static str,
        values: &'static [&'static str],
    ) -> Self {
        Self { option, choice, values }
    }

    /// The values in words: `kernel=reduction or kernel=histogram`.
    pub fn text(&self) -> String {
        let value = |value: &&str| match *value {
            "none" => format!("no {}", self.choice),
            value => format!("{}={value}", self.choice),
        };
        self.values.iter().map(value).collect::<Vec<_>>().join(" or ")
    }

    /// Refuses a value other than the default where it has no effect. A default may be given anywhere, so
    /// that settings of a sweep can be written in full.
    fn check(&self, given: &Value, defaults: &Value) -> Result<(), LoadError> {
        let chosen = match &given[self.choice] {
            Value::Null => "none".to_owned(),
            Value::String(text) => text.clone(),
            value => value.to_string(),
        };
        if given[self.option] == defaults[self.option] || self.values.contains(&&*chosen) {
            return Ok(());
        }
        let Self { option, choice, .. } = self;
        let message =
            format!("`{chosen}` has no use for `{option}`: it needs {}, or leave it out", self.text());
        Err(LoadError::Setting { setting: choice, message })
    }
}

impl OptionSource {
    /// Reads the options.
    ///
    /// # Errors
    /// [`LoadError::Spec`] with the place in the file, [`LoadError::Option`] for a single value,
    /// [`LoadError::Setting`] for one without effect.
    pub fn read<T: JobOptions>(&self) -> Result<T, LoadError> {
        let mut options = self.file.as_deref().map(spec::load).transpose()?.unwrap_or_default();
        for (name, value) in &self.set {
            options = with(&options, name, value)?;
        }
        let [given, defaults] =
            [&options, &T::default()].map(|options| serde_json::to_value(options).unwrap_or_default());
        T::NEEDS.iter().try_for_each(|need| need.check(&given, &defaults))?;
        Ok(options)
    }
}

/// Refuses the first check that fails; each has an option name and value, a condition, and the allowed values.
pub(crate) fn must_hold<const N: usize>(
    checks: [(&'static str, &dyn Debug, bool, &'static str); N],
) -> Result<(), LoadError> {
    match checks.into_iter().find(|(_, _, holds, _)| !holds) {
        Some((setting, value, _, allowed)) => {
            Err(LoadError::Setting { setting, message: format!("{value:?}: it has to be {allowed}") })
        }
        None => Ok(()),
    }
}

/// `options` with one value changed.
fn with<T: Serialize + DeserializeOwned>(options: &T, name: &str, value: &str) -> Result<T, LoadError> {
    let refused =
        |message: String| LoadError::Option { option: format!("--set {name}={}", shortened(value)), message };
    let Ok(Value::Object(fields)) = serde_json::to_value(options) else {
        return Err(refused("there are no options to set".to_owned()));
    };
    let Some(known) = fields.get(name) else {
        let known: Vec<&str> = fields.keys().map(String::as_str).collect();
        return Err(refused(format!("unknown option `{name}`, {}", suggestion(name, &known))));
    };
    let read = |value: Value| {
        let mut changed = fields.clone();
        changed.insert(name.to_owned(), value);
        serde_json::from_value(Value::Object(changed)).map_err(|error| error.to_string())
    };
    let typed = parsed(value);
    if let Value::Object(known) = known {
        check_fields(known, (value, &typed), |value| read(value).map(|_: T| ())).map_err(refused)?;
    }
    read(typed).or_else(|error| {
        // A value that looks like a number may be a name.
        let as_text = read(Value::String(value.to_owned()));
        as_text.map_err(|as_name| {
            refused(user_message(
                value,
                if as_name.starts_with("unknown variant") { &as_name } else { &error },
            ))
        })
    })
}

/// Checks a struct value field by field, and names the invalid field.
fn check_fields(
    known: &Map<String, Value>,
    (value, typed): (&str, &Value),
    read: impl Fn(Value) -> Result<(), String>,
) -> Result<(), String> {
    let names: Vec<&str> = known.keys().map(String::as_str).collect();
    let Value::Object(typed) = typed else {
        let (name, example) = known.iter().next().ok_or("nothing can be set in it")?;
        let (value, names) = (shortened(value), names.join(", "));
        return Err(format!("`{value}` names no value: write it as ({name}: {example}); known: {names}"));
    };
    for (name, value_of_it) in typed {
        if !known.contains_key(name) {
            return Err(format!("unknown option `{name}`; {}", suggestion(name, &names)));
        }
        let mut changed = known.clone();
        changed.insert(name.clone(), value_of_it.clone());
        read(Value::Object(changed)).map_err(|error| format!("{name}: {}", user_message(value, &error)))?;
    }
    Ok(())
}

/// Parses a value from the command line.
fn parsed(value: &str) -> Value {
    let text = || Value::String(value.to_owned());
    if value.starts_with(['(', '[']) {
        let as_ron =
            ron::from_str::<ron::Value>(value).ok().and_then(|value| serde_json::to_value(value).ok());
        return as_ron.unwrap_or_else(text);
    }
    // JSON does not allow `.5`.
    let number = || value.parse().ok().and_then(Number::from_f64).map(Value::Number);
    serde_json::from_str(value).ok().or_else(number).unwrap_or_else(text)
}

/// Value types of `serde` messages, with descriptions for users.
const KINDS: [(&str, &str); 11] = [
    ("u8", "a whole number from 0 to 255"),
    ("u16", "a whole number from 0 to 65535"),
    ("u32", "a whole number from 0 to 4294967295"),
    ("u64", "a whole number from 0 on"),
    ("usize", "a whole number from 0 on"),
    ("f32", "a finite number"),
    ("f64", "a finite number"),
    ("a boolean", "true or false"),
    ("a string", "text"),
    ("path string", "the path of a file"),
    ("a sequence", "a list in brackets, with commas between"),
];

/// Rewrites a `serde` error about `value` for users.
fn user_message(value: &str, error: &str) -> String {
    let expected = error.split_once(", expected ").map_or("", |(_, expected)| expected);
    let value = &*shortened(value);
    if error.starts_with("unknown variant") {
        let names: Vec<&str> = expected.split('`').skip(1).step_by(2).collect();
        return format!("unknown value `{value}`; {}", suggestion(value, &names));
    }
    if expected == "fewer elements in array" {
        return format!("`{value}` has too many values in a list");
    }
    if error.starts_with("invalid") && !expected.is_empty() {
        return format!("`{value}` is not {}", kind(expected));
    }
    format!("`{value}`: {error}")
}

/// The value, shortened if it is long.
fn shortened(value: &str) -> Cow<'_, str> {
    const MAX_CHARS: usize = 60;
    match value.char_indices().nth(MAX_CHARS) {
        None => value.into(),
        Some((end, _)) => format!("{}...", &value[..end]).into(),
    }
}

fn kind(expected: &str) -> String {
    let list = |count: &str| format!("a list of {count} values in brackets, with commas between");
    if let Some(count) = expected.strip_prefix("an array of length ") {
        return list(count);
    }
    if let Some(rest) = expected.strip_prefix("a tuple of size ") {
        return list(rest);
    }
    let known = KINDS.iter().find(|(name, _)| *name == expected);
    known.map_or_else(|| expected.to_owned(), |(_, what)| (*what).to_owned())
}

/// One of [`Overrides`]. All jobs use frames and frame rate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Flag {
    Size,
    Samples,
    Shutter,
    Lens,
    Focus,
    Table,
    Clip,
    Camera,
}

/// Flags that a job uses.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Flags {
    /// Used flags; others would have no effect and are refused.
    pub uses: &'static [Flag],
    /// Job options that replace an unused flag.
    pub instead: &'static [(Flag, &'static str)],
}

impl Flags {
    /// Refuses flags without effect; `job` is the job's name.
    pub fn check(&self, job: &str, overrides: &Overrides) -> Result<(), LoadError> {
        let Some(flag) = given(overrides).find(|flag| !self.uses.contains(flag)) else { return Ok(()) };
        let option = self.instead.iter().find(|(other, _)| *other == flag);
        let remedy = option
            .map_or("leave it out".to_owned(), |(_, option)| format!("give --set {option}=... instead"));
        let message = format!("the workload `{job}` has no use for it: {remedy}");
        Err(LoadError::Setting { setting: flag.name(), message })
    }

    /// Name of the job option that stands for `--size`, if there is one.
    pub fn instead_of_size(&self) -> Option<&'static str> {
        self.instead.iter().find(|(flag, _)| *flag == Flag::Size).map(|(_, option)| *option)
    }
}

impl Flag {
    const fn name(self) -> &'static str {
        match self {
            Self::Size => "--size",
            Self::Samples => "--samples",
            Self::Shutter => "--shutter",
            Self::Lens => "--lens",
            Self::Focus => "--focus",
            Self::Table => "--table",
            Self::Clip => "--clip",
            Self::Camera => "--camera",
        }
    }
}

/// Flags with a value.
fn given(overrides: &Overrides) -> impl Iterator<Item = Flag> {
    // The full pattern makes the compiler report new fields.
    let Overrides {
        size,
        samples,
        frame_rate_hz: _,
        shutter,
        frames: _,
        lens_radius,
        focus,
        table,
        clip,
        camera,
    } = overrides;
    let all = [
        (Flag::Size, size.is_some()),
        (Flag::Samples, samples.is_some()),
        (Flag::Shutter, shutter.is_some()),
        (Flag::Lens, lens_radius.is_some()),
        (Flag::Focus, focus.is_some()),
        (Flag::Table, table.is_some()),
        (Flag::Clip, clip.is_some()),
        (Flag::Camera, camera.is_some()),
    ];
    all.into_iter().filter(|(_, given)| *given).map(|(flag, _)| flag)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, PartialEq, Serialize, Deserialize)]
    #[serde(rename_all = "snake_case")]
    enum Method {
        Prism,
        ConvexHull,
    }

    #[derive(Debug, Default, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    struct Light {
        radius: f64,
        target: [f64; 2],
    }

    #[derive(Debug, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    struct Options {
        method: Method,
        boxes: u32,
        depth: Option<f64>,
        scene: Option<String>,
        light: Light,
    }

    impl Default for Options {
        fn default() -> Self {
            Self { method: Method::Prism, boxes: 4, depth: None, scene: None, light: Light::default() }
        }
    }

    impl JobOptions for Options {
        const NEEDS: &'static [Need] =
            &[Need::new("boxes", "method", &["prism"]), Need::new("depth", "scene", &["none"])];
    }

    fn set(pairs: &[(&str, &str)]) -> Result<Options, String> {
        let set = pairs.iter().map(|(name, value)| ((*name).to_owned(), (*value).to_owned())).collect();
        OptionSource { file: None, set }.read().map_err(|error| error.to_string())
    }

    #[test]
    fn values_that_are_set_replace_defaults() {
        assert_eq!(set(&[]).unwrap(), Options::default());
        let changed = set(&[("light", "(radius: 8)"), ("method", "convex_hull"), ("depth", "1.5")]).unwrap();
        let light = Light { radius: 8.0, ..Light::default() };
        assert_eq!(
            changed,
            Options { method: Method::ConvexHull, light, depth: Some(1.5), ..Options::default() }
        );
    }

    #[test]
    fn options_without_effect_are_refused_unless_they_are_the_default() {
        let refused = set(&[("boxes", "8"), ("method", "convex_hull")]).unwrap_err();
        assert_eq!(
            refused,
            "method: `convex_hull` has no use for `boxes`: it needs method=prism, or leave it out"
        );
        assert!(set(&[("boxes", "4"), ("method", "convex_hull")]).is_ok());
        let refused = set(&[("depth", "1"), ("scene", "fox")]).unwrap_err();
        assert_eq!(refused, "scene: `fox` has no use for `depth`: it needs no scene, or leave it out");
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), "(boxes: 16, method: convex_hull)").unwrap();
        let source = OptionSource { file: Some(file.path().to_owned()), set: Vec::new() };
        assert!(source.read::<Options>().unwrap_err().to_string().contains("no use for `boxes`"));
    }

    #[test]
    fn structs_and_tuples_are_set_as_in_ron() {
        assert_eq!(
            parsed("(pitch: 4.5, slant: 0.1, offset: 0)"),
            serde_json::json!({ "pitch": 4.5, "slant": 0.1, "offset": 0 })
        );
        assert_eq!(parsed("[(0.1, 0.2, 0.3), (0, 1, 2)]"), serde_json::json!([[0.1, 0.2, 0.3], [0, 1, 2]]));
        assert_eq!(parsed("[4.5,0.1,0]"), serde_json::json!([4.5, 0.1, 0]));
        assert_eq!((parsed("(a"), parsed("true")), (serde_json::json!("(a"), serde_json::json!(true)));
    }

    #[test]
    fn invalid_values_are_reported() {
        let unknown = set(&[("boxs", "8")]).unwrap_err();
        assert_eq!(unknown, "--set boxs=8: unknown option `boxs`, did you mean `boxes`?");
        assert!(
            set(&[("boxes", "-1")]).unwrap_err().starts_with("--set boxes=-1: `-1` is not a whole number")
        );
        let unknown = set(&[("method", "convex-hull")]).unwrap_err();
        assert!(unknown.ends_with(": unknown value `convex-hull`; did you mean `convex_hull`?"), "{unknown}");
    }

    #[test]
    fn values_that_look_like_numbers_may_be_short_or_names() {
        let changed = set(&[("depth", ".5"), ("light", "(radius: .25)")]).unwrap();
        let named = set(&[("scene", "5")]).unwrap();
        assert_eq!(
            (changed.depth, named.scene.as_deref(), changed.light.radius),
            (Some(0.5), Some("5"), 0.25)
        );
        let long = "9".repeat(400);
        for (value, typed) in [("inf", "inf"), ("nan", "nan"), ("1e999", "1e999"), (&*long, "999...")] {
            let reported = set(&[("depth", value)]).unwrap_err();
            assert!(reported.contains(&format!(": `{}", typed.trim_end_matches('.'))), "{reported}");
            assert!(reported.ends_with("is not a finite number") && reported.len() < 180, "{reported}");
        }
    }

    #[test]
    fn errors_in_struct_values_name_the_field() {
        for (value, says) in [
            ("(1, 2)", "`(1, 2)` names no value: write it as (radius: 0.0); known: radius, target"),
            ("5", "`5` names no value"),
            ("(raduis: 1)", "unknown option `raduis`; did you mean `radius`?"),
            (
                "(radius: 1, target: (1, 2, 3))",
                "target: `(radius: 1, target: (1, 2, 3))` has too many values",
            ),
            ("(radius: inf)", "radius: `(radius: inf)` is not a finite number"),
        ] {
            let reported = set(&[("light", value)]).unwrap_err();
            assert!(reported.starts_with(&format!("--set light={value}: {says}")), "{reported}");
        }
    }

    #[test]
    fn a_file_comes_first() {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), "(boxes: 16, depth: Some(2))").unwrap();
        let set = vec![("boxes".to_owned(), "2".to_owned())];
        let read: Options =
            OptionSource { file: Some(file.path().to_owned()), set: set.clone() }.read().unwrap();
        assert_eq!(read, Options { depth: Some(2.0), boxes: 2, ..Options::default() });
        std::fs::write(file.path(), "(boxs: 16)").unwrap();
        let error = OptionSource { file: Some(file.path().to_owned()), set }.read::<Options>().unwrap_err();
        assert!(error.to_string().contains(":1:"), "{error}");
    }

    fn reported<T: DeserializeOwned>(value: Value, typed: &str) -> String {
        user_message(typed, &serde_json::from_value::<T>(value).err().unwrap().to_string())
    }

    #[test]
    fn types_are_described_for_users() {
        assert_eq!(reported::<u32>((-1).into(), "-1"), "`-1` is not a whole number from 0 to 4294967295");
        assert_eq!(reported::<f64>("wide".into(), "wide"), "`wide` is not a finite number");
        assert_eq!(reported::<bool>(2.into(), "2"), "`2` is not true or false");
        assert!(reported::<[f64; 3]>(2.into(), "2").starts_with("`2` is not a list of 3 values"));
        assert_eq!(
            reported::<[f64; 1]>(serde_json::json!([1, 2]), "[1, 2]"),
            "`[1, 2]` has too many values in a list"
        );
        assert!(
            reported::<(f64, f64)>(serde_json::json!([1]), "[1]")
                .starts_with("`[1]` is not a list of 2 values")
        );
    }

    #[test]
    fn messages_of_serde_do_not_show() {
        for reported in [
            reported::<u8>(300.into(), "300"),
            reported::<String>(1.into(), "1"),
            reported::<Vec<u8>>(1.into(), "1"),
        ] {
            assert!(!reported.contains("invalid") && !reported.contains("expected"), "{reported}");
        }
    }
}
