//! Settings of the rows: stated by the thesis, left open by it, or ours. Each paper has one committed file.
//!
//! A row holds if its condition is met at every value of the open settings. It differs if it is met at none,
//! and depends otherwise. The files are in `sim/experiments/papers`; every result names the SHA-256 of its
//! file.

use std::fmt::Debug;
use std::ops::RangeInclusive;
use std::path::Path;

use activity::spec::{self, SpecError};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize, Serializer};

use super::Paper;
use output::dir::sha256_of_text;
use run::RunError;

/// Amount of computation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Form {
    /// Everything: minutes.
    Full,
    /// Fewer values and less work: some minutes at most.
    Quick,
}

impl Form {
    /// As printed.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Full => "full",
            Self::Quick => "quick",
        }
    }
}

/// Description of a row, independent of its result.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct About {
    /// Name of the row in the list of claims.
    pub id: String,
    /// Kind of agreement.
    pub kind: AgreementKind,
    /// The claim, in full.
    pub claim: String,
    /// Statement of the paper, with the passage.
    pub paper: String,
    /// Condition of the verdict.
    pub holds_when: String,
    /// Claims that are not tested, and those that hold by construction.
    pub limits: String,
}

/// Kind of agreement that a row needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
pub enum AgreementKind {
    /// An equality that holds exactly.
    Equality,
    /// A number with a tolerance.
    Number,
    /// An order or a sign.
    Order,
}

impl AgreementKind {
    /// The letter of the list of claims.
    pub const fn letter(self) -> &'static str {
        match self {
            Self::Equality => "E",
            Self::Number => "N",
            Self::Order => "O",
        }
    }
}

impl Serialize for AgreementKind {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.letter())
    }
}

/// A setting of a row with its source.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum RowSetting<T> {
    /// The thesis states it.
    Stated {
        /// Stated value.
        value: T,
        /// Value of the quick form, if different.
        #[serde(default = "none")]
        quick: Option<T>,
        /// Section or figure, and the quoted words.
        passage: String,
    },
    /// The thesis leaves it open.
    Open {
        /// Value while other settings vary.
        value: T,
        /// All values tried, `value` among them.
        over: Vec<T>,
        /// Values of the quick form; the first replaces `value`.
        #[serde(default = "Vec::new")]
        quick: Vec<T>,
        /// Why this range.
        why: String,
    },
    /// An amount of work, a tolerance or a scene of ours that is not varied.
    Ours {
        /// Value.
        value: T,
        /// Value of the quick form, if different.
        #[serde(default = "none")]
        quick: Option<T>,
        /// Why.
        why: String,
    },
}

fn none<T>() -> Option<T> {
    None
}

impl<T> RowSetting<T> {
    /// Value while other settings vary.
    pub fn get(&self, form: Form) -> &T {
        match self {
            Self::Stated { value, quick, .. } | Self::Ours { value, quick, .. } => {
                quick.as_ref().filter(|_| form == Form::Quick).unwrap_or(value)
            }
            Self::Open { value, quick, .. } => quick.first().filter(|_| form == Form::Quick).unwrap_or(value),
        }
    }

    /// Every value to try.
    pub fn all(&self, form: Form) -> &[T] {
        match self {
            Self::Open { quick, .. } if form == Form::Quick && !quick.is_empty() => quick,
            Self::Open { over, .. } => over,
            Self::Stated { .. } | Self::Ours { .. } => std::slice::from_ref(self.get(form)),
        }
    }

    /// Number of values of the full form.
    pub fn values(&self) -> usize {
        self.all(Form::Full).len()
    }

    /// All values in the file.
    fn written(&self) -> Vec<&T> {
        match self {
            Self::Stated { value, quick, .. } | Self::Ours { value, quick, .. } => {
                std::iter::once(value).chain(quick).collect()
            }
            Self::Open { value, over, quick, .. } => {
                std::iter::once(value).chain(over).chain(quick).collect()
            }
        }
    }
}

impl<T: Debug + PartialEq> RowSetting<T> {
    /// Checks all values of the setting called `name`, and that it has a source.
    ///
    /// # Errors
    /// Names the first invalid value, and what is valid.
    pub fn must(&self, name: &str, holds: impl Fn(&T) -> bool, would_do: &str) -> Result<(), String> {
        if let Some(value) = self.written().into_iter().find(|value| !holds(value)) {
            return Err(format!("`{name}` is {value:?}; it has to be {would_do}"));
        }
        let (Self::Stated { passage: source, .. }
        | Self::Open { why: source, .. }
        | Self::Ours { why: source, .. }) = self;
        if source.trim().is_empty() {
            return Err(format!("`{name}` does not say where it comes from: give the passage or the reason"));
        }
        match self {
            Self::Open { value, over, .. } if over.len() < 2 || !over.contains(value) => Err(format!(
                "`{name}` is open, so `over` has to list two values or more, and {value:?} among them"
            )),
            Self::Open { over, quick, .. } if !quick.iter().all(|value| over.contains(value)) => {
                Err(format!("`{name}`: `quick` has a value that is not in `over`; take it from there"))
            }
            _ => Ok(()),
        }
    }

    /// The same for numbers within a range.
    ///
    /// # Errors
    /// As [`Self::must`].
    pub fn within(&self, name: &str, range: RangeInclusive<T>) -> Result<(), String>
    where
        T: PartialOrd,
    {
        let would_do = format!("{:?} to {:?}", range.start(), range.end());
        self.must(name, |value| range.contains(value), &would_do)
    }
}

/// Declares the settings of rows. A line is a field, the type of its value, and the check that every value of
/// it has to pass. The first field is the description of the row.
macro_rules! row_settings {
    ($($(#[$doc:meta])* $row:ident { $($fields:tt)+ })+) => {$(
        $crate::reproduce::settings::settings_group! { $(#[$doc])* $row { pub about: About, } { $($fields)+ } }
    )+};
}
pub(super) use row_settings;

/// Declares one group of settings, after fields that are not checked.
macro_rules! settings_group {
    (
        $(#[$doc:meta])* $group:ident { $($unchecked:tt)* }
        { $($field:ident: $type:ty, $check:ident($($would_do:expr),+);)+ }
    ) => {
        $(#[$doc])*
        #[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
        #[serde(deny_unknown_fields)]
        pub(super) struct $group {
            $($unchecked)*
            $(pub $field: RowSetting<$type>,)+
        }

        impl $group {
            /// Checks every value; `group` is its name in the file.
            fn check(&self, group: &str) -> Result<(), String> {
                $(self.$field.$check(&format!("{group}.{}", stringify!($field)), $($would_do),+)?;)+
                Ok(())
            }
        }
    };
}
pub(super) use settings_group;

/// Declares the settings file of a paper: its number, its name in `sim/experiments/papers`, and its groups in
/// order, each with the further check that it has to pass.
macro_rules! paper_settings {
    ($paper:expr, $file:literal { $($group:ident: $type:ty $([$further:ident])?,)+ }) => {
        /// The file.
        #[derive(Clone, Debug, serde::Deserialize)]
        #[serde(deny_unknown_fields)]
        pub(super) struct Settings {
            paper: String,
            #[allow(dead_code, reason = "names what passages refer to, for readers of the file")]
            source: String,
            $(pub $group: $type,)+
        }

        impl $crate::reproduce::settings::PaperSettings for Settings {
            const PAPER: $crate::reproduce::Paper = $paper;
            const FILE: &str = concat!("sim/experiments/papers/", $file);
            const TEXT: &str = include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/papers/", $file));

            fn paper(&self) -> &str {
                &self.paper
            }

            fn check(&self) -> Result<(), String> {
                $(
                    self.$group.check(stringify!($group))?;
                    $(self.$group.$further(stringify!($group))?;)?
                )+
                Ok(())
            }
        }

        #[cfg(test)]
        #[test]
        fn the_committed_file_is_valid() {
            let (_, origin) = $crate::reproduce::settings::load::<Settings>(None).unwrap();
            assert!(origin.committed && origin.sha256.len() == 64);
        }
    };
}
pub(super) use paper_settings;

/// All settings of a paper.
pub trait PaperSettings: DeserializeOwned {
    /// Which paper.
    const PAPER: Paper;
    /// The committed file, from the root of the repository.
    const FILE: &str;
    /// Text of the committed file.
    const TEXT: &str;

    /// The number of the paper that the file names.
    fn paper(&self) -> &str;

    /// Checks every value.
    ///
    /// # Errors
    /// Names the first invalid value, and what is valid.
    fn check(&self) -> Result<(), String>;
}

/// Settings file of a result.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct SettingsOrigin {
    /// Name of the file, as given.
    pub file: String,
    /// SHA-256 of its bytes, as `sha256sum` prints it.
    pub sha256: String,
    /// Whether that is the committed file.
    pub committed: bool,
}

/// Settings from `file`, or those that are committed.
///
/// # Errors
/// If the file cannot be read or a value is invalid, with its place.
pub fn load<T: PaperSettings>(file: Option<&Path>) -> Result<(T, SettingsOrigin), RunError> {
    let Some(path) = file else { return parse(T::TEXT, T::FILE) };
    let name = path.display().to_string();
    let text =
        std::fs::read_to_string(path).map_err(|source| SpecError::Read { path: name.clone(), source })?;
    parse(&text, &name)
}

fn parse<T: PaperSettings>(text: &str, name: &str) -> Result<(T, SettingsOrigin), RunError> {
    let settings: T = spec::parse(text, name)?;
    let (paper, number) = (settings.paper(), T::PAPER.number());
    if paper != number {
        let why = format!("`paper` is \"{paper}\"; settings of Paper {number} have \"{number}\"");
        return Err(RunError::invalid(name, why));
    }
    settings.check().map_err(|message| RunError::invalid(name, message))?;
    Ok((
        settings,
        SettingsOrigin { file: name.to_owned(), sha256: sha256_of_text(text), committed: text == T::TEXT },
    ))
}

/// A setting as a report lists it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Listed {
    /// Name of the setting in the file.
    pub name: String,
    /// `stated`, `open` or `ours`.
    pub basis: &'static str,
    /// Value while others vary.
    pub value: serde_json::Value,
    /// All values tried, if more than one.
    pub tried: Vec<serde_json::Value>,
    /// The passage, or the reason.
    pub source: String,
}

/// The settings of a row, by name.
pub fn listed(row: &impl Serialize, form: Form) -> Vec<Listed> {
    let Ok(serde_json::Value::Object(fields)) = serde_json::to_value(row) else { return Vec::new() };
    fields.into_iter().filter_map(|(name, value)| one(name, value, form)).collect()
}

/// Names of the amounts of work of a row that the form reduces. Values to try are no amounts of work.
pub fn reduced(row: &impl Serialize, form: Form) -> Vec<String> {
    let Ok(serde_json::Value::Object(fields)) = serde_json::to_value(row) else { return Vec::new() };
    let less = |(name, value)| {
        let setting: RowSetting<serde_json::Value> = serde_json::from_value(value).ok()?;
        let open = matches!(setting, RowSetting::Open { .. });
        (!open && setting.get(form) != setting.get(Form::Full)).then_some(name)
    };
    fields.into_iter().filter_map(less).collect()
}

fn one(name: String, value: serde_json::Value, form: Form) -> Option<Listed> {
    let setting: RowSetting<serde_json::Value> = serde_json::from_value(value).ok()?;
    let (value, tried) = (setting.get(form).clone(), setting.all(form).to_vec());
    let tried = if tried.len() > 1 { tried } else { Vec::new() };
    let (basis, source) = match setting {
        RowSetting::Stated { passage, .. } => ("stated", passage),
        RowSetting::Open { why, .. } => ("open", why),
        RowSetting::Ours { why, .. } => ("ours", why),
    };
    Some(Listed { name, basis, value, tried, source })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn open(value: u32, over: &[u32], quick: &[u32]) -> RowSetting<u32> {
        RowSetting::Open { value, over: over.to_vec(), quick: quick.to_vec(), why: "because".to_owned() }
    }

    #[test]
    fn the_quick_form_has_values_of_its_own() {
        let setting = open(2, &[1, 2, 3], &[3, 1]);
        assert_eq!((setting.get(Form::Full), setting.all(Form::Full)), (&2, &[1, 2, 3][..]));
        assert_eq!((setting.get(Form::Quick), setting.all(Form::Quick)), (&3, &[3, 1][..]));
        let same = open(2, &[1, 2], &[]);
        assert_eq!((same.get(Form::Quick), same.all(Form::Quick)), (&2, &[1, 2][..]));
        let ours = RowSetting::Ours { value: 9, quick: Some(4), why: String::new() };
        assert_eq!((ours.get(Form::Full), ours.all(Form::Quick)), (&9, &[4][..]));
    }

    #[test]
    fn values_that_cannot_be_are_named_with_what_would_do() {
        let message = |setting: RowSetting<u32>| setting.within("px", 1..=8).unwrap_err();
        assert_eq!(message(open(2, &[2, 9], &[])), "`px` is 9; it has to be 1 to 8");
        assert!(message(open(2, &[2, 3], &[0])).contains("`px` is 0"));
        assert!(message(open(2, &[3, 4], &[])).contains("2 among them"));
        assert!(message(open(2, &[2], &[])).contains("two values or more"));
        let silent = RowSetting::Stated { value: 2, quick: None, passage: " ".to_owned() };
        assert!(message(silent).contains("where it comes from"));
        assert!(open(2, &[1, 2], &[]).within("px", 1..=8).is_ok());
    }

    #[test]
    fn a_row_lists_its_settings_with_their_sources() {
        #[derive(Serialize)]
        struct Row {
            about: About,
            px: RowSetting<u32>,
            cells: RowSetting<(u32, u32)>,
        }
        let about = About {
            id: "X-1".to_owned(),
            kind: AgreementKind::Order,
            claim: String::new(),
            paper: String::new(),
            holds_when: String::new(),
            limits: String::new(),
        };
        let cells =
            RowSetting::Stated { value: (2, 3), quick: Some((1, 1)), passage: "section 1".to_owned() };
        let row = Row { about, px: open(2, &[1, 2], &[1]), cells };
        assert!(reduced(&row, Form::Full).is_empty());
        assert_eq!(reduced(&row, Form::Quick), ["cells"], "px has fewer values, not less work");
        let found = listed(&row, Form::Full);
        let brief: Vec<_> = found.iter().map(|one| (one.name.as_str(), one.basis, one.tried.len())).collect();
        assert_eq!(brief, [("cells", "stated", 0), ("px", "open", 2)]);
        assert_eq!(found[0].value, serde_json::json!([2, 3]));
        assert_eq!((found[0].source.as_str(), found[1].source.as_str()), ("section 1", "because"));
    }
}
