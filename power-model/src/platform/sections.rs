//! Sections of a platform file: the system around a GPU, and how far off the watts may be.

use serde::Deserialize;

use super::{Platform, ValueSource, provenance};
use crate::quantity::{Bound, Hertz, Interval, Ratio, Seconds, Share, Source, Sourced, Watts};

/// Power of the system apart from drawing. All parts are optional.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct System {
    /// Frame rate at which applications are capped: the rate of the display's ticks over an integer.
    pub frame_cap_hz: Option<Sourced<Hertz>>,
    /// Extra power of an application after its launch.
    pub launch: Option<Launch>,
    /// Cost of a blocking finish at the end of each frame.
    pub finish: Option<Finish>,
    /// Periodic activity of the operating system.
    pub disturbances: Vec<Disturbance>,
}

/// Extra power after the launch of an application, independent of its work. It stems from a state of voltages
/// and clocks that ends abruptly (Johnsson and Akenine-Moeller, Paper III, section 5.1).
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Launch {
    /// Extra power, during frames and between them.
    pub extra_w: Sourced<Watts>,
    /// Duration from the start of the first frame.
    pub duration_s: Sourced<Seconds>,
}

/// A call that returns when all drawing is finished, such as `glFinish` (Paper III, section 5.2).
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Finish {
    /// Extra power of the waiting processor, from the start of the frame on; a sleeping processor draws less.
    pub waiting_w: Sourced<Watts>,
    /// Time from the last pixel to the return of the call.
    pub return_s: Sourced<Seconds>,
}

/// A recurring disturbance with extra power (Paper III, section 5.3).
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(try_from = "Written")]
pub struct Disturbance(Written);

/// The disturbance as written in the file, before validation.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Written {
    name: String,
    period_s: Sourced<Interval>,
    irregularity: Sourced<Share>,
    duration_s: Sourced<Seconds>,
    extra_w: Sourced<Watts>,
    variation: Sourced<Share>,
}

impl TryFrom<Written> for Disturbance {
    type Error = String;
    fn try_from(written: Written) -> Result<Self, String> {
        let (lasts, every) = (written.duration_s.value(), written.period_s.value());
        if lasts > every {
            return Err(format!(
                "disturbance `{}` lasts {lasts} s but comes every {every} s: shorten it, or add its power to idle_w \
                 and constant_w",
                written.name
            ));
        }
        Ok(Self(written))
    }
}

impl Disturbance {
    /// Name.
    pub fn name(&self) -> &str {
        &self.0.name
    }

    /// Mean time between occurrences, s.
    pub fn period_s(&self) -> f64 {
        self.0.period_s.value()
    }

    /// Largest delay of an occurrence as a fraction of the period: 0 is periodic, 1 is irregular.
    pub fn irregularity(&self) -> f64 {
        self.0.irregularity.value()
    }

    /// Duration of an occurrence, at most a period, s.
    pub fn duration_s(&self) -> f64 {
        self.0.duration_s.value()
    }

    /// Mean extra power, W.
    pub fn extra_w(&self) -> f64 {
        self.0.extra_w.value()
    }

    /// The disturbance with another extra power.
    #[must_use]
    pub fn drawing(mut self, extra_w: Sourced<Watts>) -> Self {
        self.0.extra_w = extra_w;
        self
    }

    /// Largest relative deviation of an occurrence's extra power; 0 if all are equal.
    pub fn variation(&self) -> f64 {
        self.0.variation.value()
    }

    fn provenance(&self) -> [ValueSource<'_>; 5] {
        let field = |name: &str| format!("system.disturbances.{}.{name}", self.0.name);
        [
            provenance(&field("period_s"), &self.0.period_s),
            provenance(&field("irregularity"), &self.0.irregularity),
            provenance(&field("duration_s"), &self.0.duration_s),
            provenance(&field("extra_w"), &self.0.extra_w),
            provenance(&field("variation"), &self.0.variation),
        ]
    }
}

impl System {
    /// Every number with its source, in the order of the file.
    pub(crate) fn provenance(&self) -> Vec<ValueSource<'_>> {
        let mut list = Vec::new();
        list.extend(self.frame_cap_hz.as_ref().map(|cap| provenance("system.frame_cap_hz", cap)));
        if let Some(launch) = &self.launch {
            list.push(provenance("system.launch.extra_w", &launch.extra_w));
            list.push(provenance("system.launch.duration_s", &launch.duration_s));
        }
        if let Some(finish) = &self.finish {
            list.push(provenance("system.finish.waiting_w", &finish.waiting_w));
            list.push(provenance("system.finish.return_s", &finish.return_s));
        }
        list.extend(self.disturbances.iter().flat_map(Disturbance::provenance));
        list
    }
}

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
        let moved = |watts: &Sourced<Watts>, range: &Range| {
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
