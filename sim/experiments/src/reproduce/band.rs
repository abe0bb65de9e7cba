//! What a condition comes to over the settings that a paper leaves open.

use serde::Serialize;

use super::verdict::Verdict;

/// One setting of everything, and what came out.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Case {
    /// The setting that was varied; empty where all stand as given.
    pub setting: String,
    /// Its value there.
    pub value: String,
    /// The number that is judged.
    pub number: f64,
    /// Whether the condition is met.
    pub holds: bool,
    /// Whether every setting stands as given: the same case ends up in several sweeps and counts once.
    pub base: bool,
}

/// Two values of a setting next to each other between which the condition turns.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Turn {
    /// The setting.
    pub setting: String,
    /// The values, in the order they were tried in.
    pub between: [String; 2],
}

/// All that was tried.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Band {
    /// What `number` is, with its unit.
    pub of: &'static str,
    /// Which settings were varied, and how: one at a time or jointly.
    pub varied: &'static str,
    /// Least number.
    pub min: f64,
    /// Greatest number.
    pub max: f64,
    /// How many different cases there are.
    pub tried: usize,
    /// How many the full form tries.
    pub full: usize,
    /// At how many of them the condition is met.
    pub held: usize,
    /// Where it turns.
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
    /// None yet; `of` names the number and its unit, `varied` the settings that are varied, and how.
    pub fn new(of: &'static str, varied: &'static str) -> Self {
        Self { of, varied, cases: Vec::new(), turns: Vec::new() }
    }

    /// Adds all values of one setting, in order, the others standing: each with its number and whether the condition is met.
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

    /// Of the setting added last, `value` is that at which it stands while others vary.
    pub fn standing_at(&mut self, value: impl std::fmt::Display) {
        let Some(setting) = self.cases.last().map(|case| case.setting.clone()) else { return };
        let value = value.to_string();
        let own = self.cases.iter_mut().rev().take_while(|case| case.setting == setting);
        own.for_each(|case| case.base = case.value == value);
    }

    /// The band, or `None` without a case; the full form tries `full` cases.
    pub fn band(self, full: usize) -> Option<Band> {
        let numbers = || self.cases.iter().map(|case| case.number);
        let (min, max) = (numbers().reduce(f64::min)?, numbers().reduce(f64::max)?);
        let mut counted = false;
        let mut first = |case: &&Case| !case.base || !std::mem::replace(&mut counted, true);
        let different: Vec<&Case> = self.cases.iter().filter(&mut first).collect();
        let (tried, held) = (different.len(), different.iter().filter(|case| case.holds).count());
        let Self { of, varied, cases, turns } = self;
        Some(Band { of, varied, min, max, tried, full, held, turns, cases })
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

    /// In a sentence: the range, how many cases hold, and where it turns.
    pub fn text(&self) -> String {
        let turns: Vec<String> = self
            .turns
            .iter()
            .map(|turn| format!("{} between {} and {}", turn.setting, turn.between[0], turn.between[1]))
            .collect();
        let turns =
            if turns.is_empty() { String::new() } else { format!("; turns along {}", turns.join(", ")) };
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

/// How many cases there are where settings with so many values each are varied one at a time about the same point.
pub(super) fn one_at_a_time<const N: usize>(values: [usize; N]) -> usize {
    values.into_iter().sum::<usize>() + 1 - N
}

/// Four digits that count.
pub(super) fn short(number: f64) -> String {
    let size = number.abs();
    let digits =
        if size > 0.0 && size < 1e6 { (3.0 - libm::floor(libm::log10(size))).clamp(0.0, 6.0) } else { 0.0 };
    if size >= 1e6 { format!("{number:.3e}") } else { format!("{number:.*}", digits as usize) }
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
        assert!(Cases::new("x", "y alone").band(0).is_none());
    }

    #[test]
    fn a_band_says_where_it_turns() {
        let band = band(&[true, true, false]);
        assert_eq!((band.min, band.max, band.held), (2.5, 7.5, 2));
        assert_eq!(
            band.text(),
            "increase in % from 2.500 to 7.500 over the settings tried (eyes alone); the condition is met at 2 of 3; turns along eyes between 2 and 3"
        );
    }

    #[test]
    fn the_case_at_which_all_stand_counts_once() {
        let mut cases = Cases::new("increase in %", "eyes and lens one at a time");
        cases.along("eyes", [(1, 5.0, true), (2, 9.0, false)]).standing_at(1);
        cases.along("lens", [(7, 5.0, true), (8, 6.0, true)]).standing_at(7);
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
