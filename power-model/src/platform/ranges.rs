//! How far off the watts of a platform may be.

use serde::Deserialize;

use super::Platform;
use crate::quantity::{Bound, Ratio, Source, Watts};

/// Range of numbers that are uncertain for one reason and so are off together, as multiples of those in the file.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(try_from = "WrittenRange")]
pub struct Range {
    low: Ratio,
    high: Ratio,
    source: Source,
}

/// A range as written in a file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WrittenRange {
    low: Ratio,
    high: Ratio,
    source: Source,
}

impl TryFrom<WrittenRange> for Range {
    type Error = String;
    fn try_from(written: WrittenRange) -> Result<Self, String> {
        let WrittenRange { low, high, source } = written;
        let (least, most) = (low.value(), high.value());
        if !(least <= 1.0 && 1.0 <= most) {
            return Err(format!(
                "a range from {least} to {most} times leaves the number itself out: put low <= 1 <= high"
            ));
        }
        Ok(Self { low, high, source })
    }
}

impl Range {
    /// Multiple at `bound`.
    pub const fn at(&self, bound: Bound) -> f64 {
        match bound {
            Bound::Low => self.low.value(),
            Bound::Nominal => 1.0,
            Bound::High => self.high.value(),
        }
    }

    /// Source in words.
    pub fn source(&self) -> &str {
        self.source.text()
    }
}

/// Ranges of the watts of a platform.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ranges {
    /// Of [`Platform::constant_w`].
    pub constant: Range,
    /// Of the leakage.
    pub leakage: Range,
    /// Of the clock trees and idle power of all units.
    pub clock_trees: Range,
    /// Of [`Platform::idle_w`].
    pub idle: Range,
}

impl Platform {
    /// The platform with its watts at one end of their ranges. Without `ranges` they are the same at both.
    #[must_use]
    pub fn at(&self, bound: Bound) -> Self {
        let Some(ranges) = &self.ranges else { return self.clone() };
        let moved = |watts: &crate::Sourced<Watts>, range: &Range| {
            watts.computed(watts.value() * range.at(bound), "at one end of its range")
        };
        let mut platform = self.clone();
        platform.constant_w = moved(&self.constant_w, &ranges.constant);
        platform.leakage.reference_w = moved(&self.leakage.reference_w, &ranges.leakage);
        platform.idle_w = moved(&self.idle_w, &ranges.idle);
        for row in &mut platform.units {
            row.clock_tree_w = moved(&row.clock_tree_w, &ranges.clock_trees);
            row.idle_unit_w = moved(&row.idle_unit_w, &ranges.clock_trees);
        }
        platform
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_builtin_has_ranges_with_sources() {
        for name in Platform::names() {
            let Platform { ranges: Some(ranges), .. } = Platform::builtin(name).unwrap() else {
                panic!("{name} has no ranges")
            };
            for range in [&ranges.constant, &ranges.leakage, &ranges.clock_trees, &ranges.idle] {
                assert!(range.at(Bound::Low) < 1.0 && range.at(Bound::High) > 1.0, "{name}: {range:?}");
                assert!(range.source().len() > 20, "{name}: {range:?}");
            }
        }
    }

    #[test]
    fn watts_move_with_the_bound_and_stay_at_the_nominal_one() {
        let platform = Platform::builtin("reference").unwrap();
        assert_eq!(platform.at(Bound::Nominal), platform);
        let ranges = platform.ranges.clone().unwrap();
        for bound in [Bound::Low, Bound::High] {
            let ratio = platform.at(bound).leakage_w() / platform.leakage_w();
            assert!((ratio - ranges.leakage.at(bound)).abs() < 1e-12, "{bound:?}");
            let moved = platform.at(bound);
            assert_eq!(moved.idle_w.value(), platform.idle_w.value() * ranges.idle.at(bound), "{bound:?}");
            let ratio = moved.units()[0].clock_tree_w.value() / platform.units()[0].clock_tree_w.value();
            assert!((ratio - ranges.clock_trees.at(bound)).abs() < 1e-12, "{bound:?}");
        }
    }
}
