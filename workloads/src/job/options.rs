//! Options of a job: a RON file, and single values over it.

use std::path::PathBuf;

use activity::spec;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Number, Value};

use super::words::{clipped, plain};
use crate::error::LoadError;

/// Where the options of a job come from; what is not named has its default.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OptionSource {
    /// A file in RON.
    pub file: Option<PathBuf>,
    /// Names and values that come after it. A value is a number, `true`, a list such as `[1, 2]`, what RON has in round brackets, such as
    /// `(pitch: 4.5)`, or else text.
    pub set: Vec<(String, String)>,
}

impl OptionSource {
    /// The options.
    ///
    /// # Errors
    /// [`LoadError::Spec`] with the place in the file, [`LoadError::Setting`] for a value that was set.
    pub fn read<T: Default + Serialize + DeserializeOwned>(&self) -> Result<T, LoadError> {
        let mut options = self.file.as_deref().map(spec::load).transpose()?.unwrap_or_default();
        for (name, value) in &self.set {
            options = with(&options, name, value)?;
        }
        Ok(options)
    }
}

/// Refuses the first option that does not hold; each with its name and what it may be.
pub(crate) fn must_hold<const N: usize>(
    checks: [(&'static str, bool, &'static str); N],
) -> Result<(), LoadError> {
    match checks.into_iter().find(|(_, holds, _)| !holds) {
        Some((setting, _, allowed)) => {
            Err(LoadError::Setting { setting, message: format!("it has to be {allowed}") })
        }
        None => Ok(()),
    }
}

/// `options` with one of them changed.
fn with<T: Serialize + DeserializeOwned>(options: &T, name: &str, value: &str) -> Result<T, LoadError> {
    let refused = |message: String| LoadError::Setting { setting: "set", message };
    let Ok(Value::Object(fields)) = serde_json::to_value(options) else {
        return Err(refused(format!("`{name}`: there are no options to set")));
    };
    let Some(known) = fields.get(name) else {
        let known: Vec<&str> = fields.keys().map(String::as_str).collect();
        return Err(refused(format!("unknown option `{name}`, {}", spec::suggestion(name, &known))));
    };
    let read = |value: Value| {
        let mut changed = fields.clone();
        changed.insert(name.to_owned(), value);
        serde_json::from_value(Value::Object(changed)).map_err(|error| error.to_string())
    };
    let (typed, told) = (parsed(value), |message: String| refused(format!("{name}: {message}")));
    if let Value::Object(known) = known {
        inside(known, (value, &typed), |value| read(value).map(|_: T| ())).map_err(told)?;
    }
    read(typed).or_else(|error| {
        // What looks like a number may be a name.
        let as_text = read(Value::String(value.to_owned()));
        as_text.map_err(|as_name| {
            told(plain(value, if as_name.starts_with("unknown variant") { &as_name } else { &error }))
        })
    })
}

/// Refuses what cannot be in the place of values that have names, and says which of them it is.
fn inside(
    known: &Map<String, Value>,
    (value, typed): (&str, &Value),
    read: impl Fn(Value) -> Result<(), String>,
) -> Result<(), String> {
    let names: Vec<&str> = known.keys().map(String::as_str).collect();
    let Value::Object(typed) = typed else {
        let (name, example) = known.iter().next().ok_or("nothing can be set in it")?;
        let (value, names) = (clipped(value), names.join(", "));
        return Err(format!(
            "`{value}` names no value: write it as ({name}: {example}); known here: {names}"
        ));
    };
    for (name, value_of_it) in typed {
        if !known.contains_key(name) {
            return Err(format!("there is no `{name}`; {}", spec::suggestion(name, &names)));
        }
        let mut changed = known.clone();
        changed.insert(name.clone(), value_of_it.clone());
        read(Value::Object(changed)).map_err(|error| format!("{name}: {}", plain(value, &error)))?;
    }
    Ok(())
}

/// A value as it was written on the command line.
fn parsed(value: &str) -> Value {
    let text = || Value::String(value.to_owned());
    if value.starts_with(['(', '[']) {
        let as_ron =
            ron::from_str::<ron::Value>(value).ok().and_then(|value| serde_json::to_value(value).ok());
        return as_ron.unwrap_or_else(text);
    }
    // JSON has no `.5`.
    let number = || value.parse().ok().and_then(Number::from_f64).map(Value::Number);
    serde_json::from_str(value).ok().or_else(number).unwrap_or_else(text)
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

    fn set(pairs: &[(&str, &str)]) -> Result<Options, String> {
        let set = pairs.iter().map(|(name, value)| ((*name).to_owned(), (*value).to_owned())).collect();
        OptionSource { file: None, set }.read().map_err(|error| error.to_string())
    }

    #[test]
    fn values_that_are_set_replace_defaults() {
        assert_eq!(set(&[]).unwrap(), Options::default());
        let changed = set(&[("boxes", "8"), ("method", "convex_hull"), ("depth", "1.5")]).unwrap();
        assert_eq!(
            changed,
            Options { method: Method::ConvexHull, boxes: 8, depth: Some(1.5), ..Options::default() }
        );
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
    fn what_cannot_be_set_is_told() {
        assert_eq!(set(&[("boxs", "8")]).unwrap_err(), "set: unknown option `boxs`, did you mean `boxes`?");
        assert!(set(&[("boxes", "-1")]).unwrap_err().starts_with("set: boxes: `-1` is not a whole number"));
        let unknown = set(&[("method", "convex-hull")]).unwrap_err();
        assert_eq!(unknown, "set: method: there is no `convex-hull`; did you mean `convex_hull`?");
    }

    #[test]
    fn what_looks_like_a_number_may_be_written_short_or_be_a_name() {
        let changed = set(&[("depth", ".5"), ("scene", "5"), ("light", "(radius: .25)")]).unwrap();
        assert_eq!(
            (changed.depth, changed.scene.as_deref(), changed.light.radius),
            (Some(0.5), Some("5"), 0.25)
        );
        let long = "9".repeat(400);
        for (value, typed) in [("inf", "inf"), ("nan", "nan"), ("1e999", "1e999"), (&*long, "999...")] {
            let told = set(&[("depth", value)]).unwrap_err();
            assert!(told.starts_with(&format!("set: depth: `{}", typed.trim_end_matches('.'))), "{told}");
            assert!(told.ends_with("is not a finite number") && told.len() < 120, "{told}");
        }
    }

    #[test]
    fn what_is_inside_round_brackets_is_told_by_its_name() {
        for (value, says) in [
            (
                "(1, 2)",
                "light: `(1, 2)` names no value: write it as (radius: 0.0); known here: radius, target",
            ),
            ("5", "light: `5` names no value"),
            ("(raduis: 1)", "light: there is no `raduis`; did you mean `radius`?"),
            (
                "(radius: 1, target: (1, 2, 3))",
                "light: target: `(radius: 1, target: (1, 2, 3))` has too many values",
            ),
            ("(radius: inf)", "light: radius: `(radius: inf)` is not a finite number"),
        ] {
            let told = set(&[("light", value)]).unwrap_err();
            assert!(told.starts_with(&format!("set: {says}")), "{told}");
        }
    }

    #[test]
    fn a_file_comes_first() {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), "(boxes: 16, method: convex_hull)").unwrap();
        let set = vec![("boxes".to_owned(), "2".to_owned())];
        let read: Options =
            OptionSource { file: Some(file.path().to_owned()), set: set.clone() }.read().unwrap();
        assert_eq!(read, Options { method: Method::ConvexHull, boxes: 2, ..Options::default() });
        std::fs::write(file.path(), "(boxs: 16)").unwrap();
        let error = OptionSource { file: Some(file.path().to_owned()), set }.read::<Options>().unwrap_err();
        assert!(error.to_string().contains(":1:"), "{error}");
    }
}
