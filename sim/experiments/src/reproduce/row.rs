//! One claim of a paper, and the result of the reproduction.

use serde::Serialize;

use super::band::{Band, Kind, Verdict};
use super::settings::{About, Form, Listed, listed, reduced};
use crate::study::Ran;

/// A row of the list of claims.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
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
    pub ran: Vec<Number>,
    /// The numbers behind `ours`, by name.
    pub numbers: Vec<Number>,
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
pub struct Number {
    /// Its name, with its unit.
    pub name: &'static str,
    /// Its value.
    pub value: f64,
}

impl Number {
    /// Whether the count is 0.
    fn is_nothing(&self) -> bool {
        self.value.is_nan() || self.value <= 0.0
    }
}

/// Numbers from names and values.
pub(super) fn numbers<const N: usize>(pairs: [(&'static str, f64); N]) -> Vec<Number> {
    pairs.into_iter().map(|(name, value)| Number { name, value }).collect()
}

/// Passes, draws and fragments that ran.
pub(super) fn ran(of: &Ran) -> Vec<Number> {
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
    pub fn row(&self, about: &About, (ours, verdict, note): (String, Verdict, String)) -> Row {
        let own = reduced(self.settings, self.form);
        Row {
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
    pub fn banded(&self, about: &About, ours: String, band: Band) -> Row {
        let row = self.row(about, (ours, band.verdict(), band.text()));
        Row { band: Some(band), ..row }
    }
}

impl Row {
    /// Whether a required amount of work is 0.
    pub fn ran_nothing(&self) -> bool {
        self.ran.is_empty() || self.ran.iter().any(Number::is_nothing)
    }

    /// Whether the row is an equality that does not hold.
    pub fn is_unequal(&self) -> bool {
        self.about.kind == Kind::Equality && self.verdict != Verdict::Holds
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

#[cfg(test)]
pub(super) mod tests {
    use super::super::band::Cases;
    use super::*;

    pub fn row(id: &str, kind: Kind, verdict: Verdict) -> Row {
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
        Row { ran: numbers([("draws", 3.0)]), numbers: numbers([("n", 2.0)]), ..row }
    }

    #[test]
    fn an_equality_that_does_not_hold_fails() {
        for verdict in [Verdict::Differs, Verdict::Depends, Verdict::NotYet] {
            assert!(row("X-1", Kind::Equality, verdict).fails());
            assert!(!row("X-1", Kind::Number, verdict).fails() && !row("X-1", Kind::Order, verdict).fails());
        }
        assert!(!row("X-1", Kind::Equality, Verdict::Holds).fails());
        assert_eq!(
            serde_json::to_value(row("X-1", Kind::Order, Verdict::NotYet)).unwrap()["verdict"],
            "not yet"
        );
    }

    #[test]
    fn a_row_that_ran_nothing_fails_and_shows_nothing() {
        for ran in [Vec::new(), numbers([("draws", 3.0), ("fragments", 0.0)]), numbers([("draws", f64::NAN)])]
        {
            let empty = Row { ran, ..row("X-1", Kind::Order, Verdict::Holds) };
            assert!(empty.fails());
            let judged = empty.judged();
            assert_eq!(judged.verdict, Verdict::Differs);
            assert!(judged.note.starts_with("nothing was run"), "{}", judged.note);
        }
        let good = row("X-1", Kind::Order, Verdict::Holds);
        assert_eq!(good.clone().judged(), Row { verdict_text: "holds".to_owned(), ..good });
    }

    /// The quick form may omit the values at which a condition changes.
    #[test]
    fn a_quick_verdict_says_at_how_many_settings_it_was_reached() {
        let quick = Row { form: Form::Quick, ..row("X-1", Kind::Order, Verdict::Holds) };
        assert_eq!(quick.clone().judged().verdict_text, "holds (quick form)");
        let mut cases = Cases::new("share", "tiles alone");
        cases.along("tiles", [(4, 0.5, true), (8, 0.2, true)]);
        let less_work = vec!["yards".to_owned()];
        let banded = Row { band: cases.band(6).ok(), less_work, ..quick };
        let text = "holds at 2 of 6 settings (quick form, less work)";
        assert_eq!(banded.clone().judged().verdict_text, text);
        assert_eq!(Row { form: Form::Full, ..banded.clone() }.judged().verdict_text, "holds");
        assert_eq!(Row { verdict: Verdict::NotYet, ..banded }.judged().verdict_text, "not yet");
    }

    #[test]
    fn numbers_that_were_not_measured_are_left_out() {
        let some = Row {
            numbers: numbers([("n", 2.0), ("at_64", f64::NAN)]),
            ..row("X-1", Kind::Order, Verdict::Holds)
        };
        assert_eq!(some.judged().numbers, numbers([("n", 2.0)]));
    }
}
