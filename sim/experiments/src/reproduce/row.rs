//! One claim of a paper, the result of the reproduction with its verdict, and the sensitivity of its
//! condition to the settings that a paper leaves open.

use run::RunError;
use serde::Serialize;

use super::settings::{About, AgreementKind, Form, Listed, listed, reduced};
use crate::study::Ran;

/// A row of the list of claims.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ClaimRow {
    /// The claim, and the condition of the verdict.
    #[serde(flatten)]
    pub about: About,
    /// Result of this program.
    pub ours: String,
    /// Verdict.
    pub verdict: Verdict,
    /// Printed verdict. That of the quick form includes the number of settings tried.
    pub verdict_text: String,
    /// How much was computed.
    pub form: Form,
    /// Amounts of work that the quick form reduced.
    pub less_work: Vec<String>,
    /// Cases of the verdict, if settings were varied.
    pub band: Option<Band>,
    /// Why it differs, where the condition changes, or which part is missing.
    pub note: String,
    /// Amount of work: draws, passes, fragments, samples. A row with a 0 shows nothing.
    pub ran: Vec<NamedValue>,
    /// The numbers behind `ours`, by name.
    pub numbers: Vec<NamedValue>,
    /// Settings of the row.
    pub settings: Vec<Listed>,
    /// SHA-256 of the file of these settings.
    pub settings_sha256: String,
    /// The first of its figures, as a path below the folder of results.
    pub figure: Option<String>,
    /// All of them.
    pub figures: Vec<String>,
}

/// A computed number.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NamedValue {
    /// Name of the number, with its unit.
    pub name: &'static str,
    /// Value of the number.
    pub value: f64,
}

impl NamedValue {
    /// Whether the count is 0.
    fn is_nothing(&self) -> bool {
        self.value.is_nan() || self.value <= 0.0
    }
}

/// Numbers from names and values.
pub(super) fn numbers<const N: usize>(pairs: [(&'static str, f64); N]) -> Vec<NamedValue> {
    pairs.into_iter().map(|(name, value)| NamedValue { name, value }).collect()
}

/// Passes, draws and fragments that ran.
pub(super) fn ran(of: &Ran) -> Vec<NamedValue> {
    let Ran { passes, draws, fragments } = *of;
    numbers([("passes", passes as f64), ("draws", draws as f64), ("fragments", fragments as f64)])
}

/// Settings and form of a row.
pub(super) struct With<'a, S> {
    pub settings: &'a S,
    pub form: Form,
    /// SHA-256 of the file.
    pub sha256: &'a str,
    /// Amounts of work, shared by all rows, that the form reduces.
    pub shared_less: Vec<String>,
}

impl<S: Serialize> With<'_, S> {
    /// The row with its result: `ours`, the verdict and a note.
    pub fn row(&self, about: &About, (ours, verdict, note): (String, Verdict, String)) -> ClaimRow {
        let own = reduced(self.settings, self.form);
        ClaimRow {
            about: about.clone(),
            ours,
            verdict,
            verdict_text: String::new(),
            form: self.form,
            less_work: self.shared_less.iter().cloned().chain(own).collect(),
            band: None,
            note,
            ran: Vec::new(),
            numbers: Vec::new(),
            settings: listed(self.settings, self.form),
            settings_sha256: self.sha256.to_owned(),
            figure: None,
            figures: Vec::new(),
        }
    }

    /// The same with the verdict of the band over all settings tried.
    pub fn banded(&self, about: &About, ours: String, band: Band) -> ClaimRow {
        let row = self.row(about, (ours, band.verdict(), band.text()));
        ClaimRow { band: Some(band), ..row }
    }
}

impl ClaimRow {
    /// Whether a required amount of work is 0.
    pub fn ran_nothing(&self) -> bool {
        self.ran.is_empty() || self.ran.iter().any(NamedValue::is_nothing)
    }

    /// Whether the row is an equality that does not hold.
    pub fn is_unequal(&self) -> bool {
        self.about.kind == AgreementKind::Equality && self.verdict != Verdict::Holds
    }

    /// Whether the row must hold and does not, or did no work.
    pub fn fails(&self) -> bool {
        self.is_unequal() || self.ran_nothing()
    }

    /// The row with another sentence on its limits.
    #[must_use]
    pub(super) fn limited(mut self, more: &str) -> Self {
        self.about.limits = format!("{} {more}", self.about.limits);
        self
    }

    /// The row as reported: with the printed verdict, and without numbers that were not measured.
    #[must_use]
    pub(super) fn judged(self) -> Self {
        let mut row = self.shown();
        row.verdict_text = row.verdict_text();
        row.numbers.retain(|number| number.value.is_finite());
        row
    }

    /// Printed verdict; that of the quick form with its number of settings of those of the full form.
    fn verdict_text(&self) -> String {
        let verdict = self.verdict.name();
        let less = if self.less_work.is_empty() { "quick form" } else { "quick form, less work" };
        match &self.band {
            _ if self.form == Form::Full || self.verdict == Verdict::NotYet => verdict.to_owned(),
            Some(band) => format!("{verdict} at {} of {} settings ({less})", band.tried, band.full),
            None => format!("{verdict} ({less})"),
        }
    }

    /// A row without work shows nothing, even if its condition holds.
    fn shown(self) -> Self {
        if !self.ran_nothing() || self.verdict == Verdict::NotYet {
            return self;
        }
        let none: Vec<&str> =
            self.ran.iter().filter(|number| number.is_nothing()).map(|number| number.name).collect();
        let note = format!("nothing was run ({}), so nothing was shown. {}", none.join(", "), self.note);
        Self { verdict: Verdict::Differs, note, ..self }
    }
}

/// Result of one combination of settings.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SettingCase {
    /// The varied setting; empty if all have their given values.
    pub setting: String,
    /// Value of the varied setting.
    pub value: String,
    /// The number in the condition.
    pub number: f64,
    /// Whether the condition is met.
    pub holds: bool,
    /// Whether all settings have their given values. Several sweeps contain this case; it counts once.
    pub base: bool,
}

/// Two neighbouring values of a setting between which the condition changes.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Turn {
    /// The setting.
    pub setting: String,
    /// The values, in the order of the sweep.
    pub between: [String; 2],
}

/// Summary of all cases.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Band {
    /// Name and unit of `number`.
    pub of: &'static str,
    /// Varied settings, and whether they were varied one at a time or jointly.
    pub varied: &'static str,
    /// Smallest number.
    pub min: f64,
    /// Largest number.
    pub max: f64,
    /// Number of different cases.
    pub tried: usize,
    /// Number of cases of the full form.
    pub full: usize,
    /// Number of cases that meet the condition.
    pub held: usize,
    /// Where the condition changes.
    pub turns: Vec<Turn>,
    /// Every case.
    pub cases: Vec<SettingCase>,
}

/// Cases as they are computed.
#[derive(Debug)]
pub(super) struct Cases {
    of: &'static str,
    varied: &'static str,
    cases: Vec<SettingCase>,
    turns: Vec<Turn>,
}

impl Cases {
    /// No cases yet. `of` names the number and its unit; `varied` names the varied settings, and how they vary.
    pub fn new(of: &'static str, varied: &'static str) -> Self {
        Self { of, varied, cases: Vec::new(), turns: Vec::new() }
    }

    /// Adds a sweep of one setting, in order, with given values of the others. Each case has its number, and
    /// whether it meets the condition.
    pub fn along<V: std::fmt::Display>(
        &mut self,
        setting: &str,
        values: impl IntoIterator<Item = (V, f64, bool)>,
    ) -> &mut Self {
        let first = self.cases.len();
        self.cases.extend(values.into_iter().map(|(value, number, holds)| SettingCase {
            setting: setting.to_owned(),
            value: value.to_string(),
            number,
            holds,
            base: false,
        }));
        let turns = self.cases[first..].windows(2).filter(|pair| pair[0].holds != pair[1].holds);
        self.turns.extend(turns.map(|pair| Turn {
            setting: setting.to_owned(),
            between: [pair[0].value.clone(), pair[1].value.clone()],
        }));
        self
    }

    /// Sets the given value of the setting added last, which it has while others vary.
    pub fn with_base(&mut self, value: impl std::fmt::Display) {
        let Some(setting) = self.cases.last().map(|case| case.setting.clone()) else { return };
        let value = value.to_string();
        let own = self.cases.iter_mut().rev().take_while(|case| case.setting == setting);
        own.for_each(|case| case.base = case.value == value);
    }

    /// The band; the full form tries `full` cases.
    ///
    /// # Errors
    /// [`RunError`] if the settings have no case.
    pub fn band(self, full: usize) -> Result<Band, RunError> {
        let numbers = || self.cases.iter().map(|case| case.number);
        let least_and_most = numbers().reduce(f64::min).zip(numbers().reduce(f64::max));
        let nothing = || RunError::setting(format!("{}: the settings have no value to try", self.of));
        let (min, max) = least_and_most.ok_or_else(nothing)?;
        let mut counted = false;
        let mut first = |case: &&SettingCase| !case.base || !std::mem::replace(&mut counted, true);
        let different: Vec<&SettingCase> = self.cases.iter().filter(&mut first).collect();
        let (tried, held) = (different.len(), different.iter().filter(|case| case.holds).count());
        let Self { of, varied, cases, turns } = self;
        Ok(Band { of, varied, min, max, tried, full, held, turns, cases })
    }
}

impl Band {
    /// Holds everywhere, differs everywhere, or depends.
    pub fn verdict(&self) -> Verdict {
        match self.held {
            0 => Verdict::Differs,
            held if held == self.tried => Verdict::Holds,
            _ => Verdict::Depends,
        }
    }

    /// A sentence: the range, the number of cases that hold, and where the condition changes.
    pub fn text(&self) -> String {
        let turns: Vec<String> = self
            .turns
            .iter()
            .map(|turn| format!("{} between {} and {}", turn.setting, turn.between[0], turn.between[1]))
            .collect();
        let turns =
            if turns.is_empty() { String::new() } else { format!("; it changes along {}", turns.join(", ")) };
        format!(
            "{} from {} to {} over the settings tried ({}); the condition is met at {} of {}{turns}",
            self.of,
            short(self.min),
            short(self.max),
            self.varied,
            self.held,
            self.tried
        )
    }
}

/// Number of cases if settings with these numbers of values are varied one at a time about one point.
pub(super) fn one_at_a_time<const N: usize>(values: [usize; N]) -> usize {
    values.into_iter().sum::<usize>() + 1 - N
}

/// A number with four significant digits.
pub(super) fn short(number: f64) -> String {
    let size = number.abs();
    let digits =
        if size > 0.0 && size < 1e6 { (3.0 - libm::floor(libm::log10(size))).clamp(0.0, 6.0) } else { 0.0 };
    if size >= 1e6 { format!("{number:.3e}") } else { format!("{number:.*}", digits as usize) }
}

/// Verdict of a claim.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum Verdict {
    /// The condition is met at every value of the open settings.
    #[serde(rename = "holds")]
    Holds,
    /// The condition is met at no value.
    #[serde(rename = "differs")]
    Differs,
    /// The condition is met at some values of the open settings and not at others.
    #[serde(rename = "depends")]
    Depends,
    /// A part that the row needs is missing.
    #[serde(rename = "not yet")]
    NotYet,
}

impl Verdict {
    /// Every verdict.
    pub const ALL: [Self; 4] = [Self::Holds, Self::Differs, Self::Depends, Self::NotYet];

    /// Holds or differs.
    pub const fn of(holds: bool) -> Self {
        if holds { Self::Holds } else { Self::Differs }
    }

    /// As printed.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Holds => "holds",
            Self::Differs => "differs",
            Self::Depends => "depends",
            Self::NotYet => "not yet",
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    pub fn row(id: &str, kind: AgreementKind, verdict: Verdict) -> ClaimRow {
        let about = About {
            id: id.to_owned(),
            kind,
            claim: "a claim".to_owned(),
            paper: "one".to_owned(),
            holds_when: "it does".to_owned(),
            limits: "Little.".to_owned(),
        };
        let with = With { settings: &(), form: Form::Full, sha256: "abc", shared_less: Vec::new() };
        let row = with.row(&about, ("two".to_owned(), verdict, "because".to_owned()));
        ClaimRow { ran: numbers([("draws", 3.0)]), numbers: numbers([("n", 2.0)]), ..row }
    }

    #[test]
    fn an_equality_that_does_not_hold_fails() {
        for verdict in [Verdict::Differs, Verdict::Depends, Verdict::NotYet] {
            assert!(row("X-1", AgreementKind::Equality, verdict).fails());
            assert!(
                !row("X-1", AgreementKind::Number, verdict).fails()
                    && !row("X-1", AgreementKind::Order, verdict).fails()
            );
        }
        assert!(!row("X-1", AgreementKind::Equality, Verdict::Holds).fails());
        assert_eq!(
            serde_json::to_value(row("X-1", AgreementKind::Order, Verdict::NotYet)).unwrap()["verdict"],
            "not yet"
        );
    }

    #[test]
    fn a_row_that_ran_nothing_fails_and_shows_nothing() {
        for ran in [Vec::new(), numbers([("draws", 3.0), ("fragments", 0.0)]), numbers([("draws", f64::NAN)])]
        {
            let empty = ClaimRow { ran, ..row("X-1", AgreementKind::Order, Verdict::Holds) };
            assert!(empty.fails());
            let judged = empty.judged();
            assert_eq!(judged.verdict, Verdict::Differs);
            assert!(judged.note.starts_with("nothing was run"), "{}", judged.note);
        }
        let good = row("X-1", AgreementKind::Order, Verdict::Holds);
        assert_eq!(good.clone().judged(), ClaimRow { verdict_text: "holds".to_owned(), ..good });
    }

    /// The quick form may omit the values at which a condition changes.
    #[test]
    fn a_quick_verdict_says_at_how_many_settings_it_was_reached() {
        let quick = ClaimRow { form: Form::Quick, ..row("X-1", AgreementKind::Order, Verdict::Holds) };
        assert_eq!(quick.clone().judged().verdict_text, "holds (quick form)");
        let mut cases = Cases::new("share", "tiles alone");
        cases.along("tiles", [(4, 0.5, true), (8, 0.2, true)]);
        let less_work = vec!["yards".to_owned()];
        let banded = ClaimRow { band: cases.band(6).ok(), less_work, ..quick };
        let text = "holds at 2 of 6 settings (quick form, less work)";
        assert_eq!(banded.clone().judged().verdict_text, text);
        assert_eq!(ClaimRow { form: Form::Full, ..banded.clone() }.judged().verdict_text, "holds");
        assert_eq!(ClaimRow { verdict: Verdict::NotYet, ..banded }.judged().verdict_text, "not yet");
    }

    #[test]
    fn numbers_that_were_not_measured_are_left_out() {
        let some = ClaimRow {
            numbers: numbers([("n", 2.0), ("at_64", f64::NAN)]),
            ..row("X-1", AgreementKind::Order, Verdict::Holds)
        };
        assert_eq!(some.judged().numbers, numbers([("n", 2.0)]));
    }

    fn band(holds: &[bool]) -> Band {
        let mut cases = Cases::new("increase in %", "eyes alone");
        cases.along("eyes", (1..).zip(holds).map(|(eye, holds)| (eye, 2.5 * f64::from(eye), *holds)));
        cases.band(holds.len()).unwrap()
    }

    #[test]
    fn the_verdict_is_that_of_every_case() {
        assert_eq!(band(&[true, true]).verdict(), Verdict::Holds);
        assert_eq!(band(&[false, false]).verdict(), Verdict::Differs);
        assert_eq!(band(&[true, false, true]).verdict(), Verdict::Depends);
        assert!(Cases::new("x", "y alone").band(0).is_err());
    }

    #[test]
    fn a_band_says_where_it_turns() {
        let band = band(&[true, true, false]);
        assert_eq!((band.min, band.max, band.held), (2.5, 7.5, 2));
        assert_eq!(
            band.text(),
            "increase in % from 2.500 to 7.500 over the settings tried (eyes alone); the condition is met at 2 of 3; it changes along eyes between 2 and 3"
        );
    }

    #[test]
    fn the_case_at_which_all_stand_counts_once() {
        let mut cases = Cases::new("increase in %", "eyes and lens one at a time");
        cases.along("eyes", [(1, 5.0, true), (2, 9.0, false)]).with_base(1);
        cases.along("lens", [(7, 5.0, true), (8, 6.0, true)]).with_base(7);
        let band = cases.band(3).unwrap();
        assert_eq!((band.tried, band.held, band.cases.len()), (3, 2, 4));
        assert_eq!(band.verdict(), Verdict::Depends);
    }

    #[test]
    fn numbers_are_short() {
        assert_eq!(
            [0.0, 0.123_456, 12.3456, -1234.56, 2e7].map(short),
            ["0", "0.1235", "12.35", "-1235", "2.000e7"]
        );
    }
}
