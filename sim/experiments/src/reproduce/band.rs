//! Kind and verdict of a claim, and the sensitivity of its condition to the settings that a paper leaves open.

use run::RunError;
use serde::{Deserialize, Serialize, Serializer};

/// Result of one combination of settings.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Case {
    /// The varied setting; empty if all have their given values.
    pub setting: String,
    /// Its value.
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
    pub cases: Vec<Case>,
}

/// Cases as they are computed.
#[derive(Debug)]
pub(super) struct Cases {
    of: &'static str,
    varied: &'static str,
    cases: Vec<Case>,
    turns: Vec<Turn>,
}

impl Cases {
    /// No cases yet. `of` names the number and its unit; `varied` names the varied settings, and how they vary.
    pub fn new(of: &'static str, varied: &'static str) -> Self {
        Self { of, varied, cases: Vec::new(), turns: Vec::new() }
    }

    /// Adds a sweep of one setting, in order, with given values of the others. Each case has its number, and whether it meets the
    /// condition.
    pub fn along<V: std::fmt::Display>(
        &mut self,
        setting: &str,
        values: impl IntoIterator<Item = (V, f64, bool)>,
    ) -> &mut Self {
        let first = self.cases.len();
        self.cases.extend(values.into_iter().map(|(value, number, holds)| Case {
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
        let mut first = |case: &&Case| !case.base || !std::mem::replace(&mut counted, true);
        let different: Vec<&Case> = self.cases.iter().filter(&mut first).collect();
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

/// Kind of agreement that a row needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
pub enum Kind {
    /// An equality that holds exactly.
    Equality,
    /// A number with a tolerance.
    Number,
    /// An order or a sign.
    Order,
}

impl Kind {
    /// The letter of the list of claims.
    pub const fn letter(self) -> &'static str {
        match self {
            Self::Equality => "E",
            Self::Number => "N",
            Self::Order => "O",
        }
    }
}

impl Serialize for Kind {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.letter())
    }
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
mod tests {
    use super::*;

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
