//! The system around a GPU, as a platform file describes it.

use serde::Deserialize;

use super::{Provenance, provenance};
use crate::quantity::{Hertz, Interval, Seconds, Share, Sourced, Watts};

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

    fn provenance(&self) -> [Provenance<'_>; 5] {
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
    pub(crate) fn provenance(&self) -> Vec<Provenance<'_>> {
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
