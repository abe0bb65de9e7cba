//! The system around a GPU as it stands in a platform's file.

use serde::Deserialize;

use super::{Provenance, provenance};
use crate::quantity::{Hertz, Interval, Seconds, Share, Sourced, Watts};

/// What a platform does besides drawing. Every part may be left out.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct System {
    /// Frames a second at which applications are capped: a whole part of the display's ticks.
    pub frame_cap_hz: Option<Sourced<Hertz>>,
    /// What an application draws more just after its launch.
    pub launch: Option<Launch>,
    /// What a blocking finish at the end of each frame costs.
    pub finish: Option<Finish>,
    /// What the operating system does on the side.
    pub disturbances: Vec<Disturbance>,
}

/// After its launch an application draws more for a while, whatever it does: a state of voltages and clocks that is left
/// at once (Johnsson and Akenine-Moeller, Paper III, section 5.1).
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Launch {
    /// The power on top, between frames as within them.
    pub extra_w: Sourced<Watts>,
    /// How long, from the first frame's start.
    pub duration_s: Sourced<Seconds>,
}

/// A call that returns when everything drawn is finished, such as `glFinish` (Paper III, section 5.2).
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Finish {
    /// What the processor draws on top while it waits, from the frame's start on: asleep it would draw less.
    pub waiting_w: Sourced<Watts>,
    /// From the last pixel to the return of the call.
    pub return_s: Sourced<Seconds>,
}

/// Something that happens again and again and draws power on top (Paper III, section 5.3).
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(try_from = "Written")]
pub struct Disturbance(Written);

/// As it stands in the file, before anything is known of whether it can be.
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
    /// Its name.
    pub fn name(&self) -> &str {
        &self.0.name
    }

    /// The time from one to the next, on average, s.
    pub fn period_s(&self) -> f64 {
        self.0.period_s.value()
    }

    /// Which part of its period each one may come late: 0 for a clock, 1 for no pattern but its mean.
    pub fn irregularity(&self) -> f64 {
        self.0.irregularity.value()
    }

    /// How long each lasts, at most a period, s.
    pub fn duration_s(&self) -> f64 {
        self.0.duration_s.value()
    }

    /// The power on top, on average, W.
    pub fn extra_w(&self) -> f64 {
        self.0.extra_w.value()
    }

    /// The same with another power on top.
    #[must_use]
    pub fn drawing(mut self, extra_w: Sourced<Watts>) -> Self {
        self.0.extra_w = extra_w;
        self
    }

    /// By which part of it each one may draw more or less: 0 where all are alike.
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
