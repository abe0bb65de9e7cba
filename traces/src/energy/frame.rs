//! Energy of each frame, start to start.

use super::PowerIntegral;
use crate::frames::{Flags, Found};

/// One measured frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameEnergy {
    /// Start, s.
    pub start_s: f64,
    /// End: the next start, or the end mark, s.
    pub end_s: f64,
    /// Energy by the rule of [`PowerIntegral`], J.
    pub energy_j: f64,
    /// Confidence of its ends, 0 to 1.
    pub confidence: f64,
    /// What is remarkable about it.
    pub flags: Flags,
}

/// One frame as the one who made the trace knows it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrueFrame {
    /// Start, s.
    pub start_s: f64,
    /// Exact energy to the next start, J.
    pub energy_j: f64,
}

impl FrameEnergy {
    /// Duration, s.
    pub fn duration_s(&self) -> f64 {
        self.end_s - self.start_s
    }

    /// Mean power, W; 0 for a frame of no duration.
    pub fn power_w(&self) -> f64 {
        if self.duration_s() > 0.0 { self.energy_j / self.duration_s() } else { 0.0 }
    }

    /// Energy per pixel, J; `None` for no pixels.
    pub fn energy_per_pixel_j(&self, pixels: u64) -> Option<f64> {
        (pixels > 0).then(|| self.energy_j / pixels as f64)
    }
}

impl PowerIntegral<'_> {
    /// Energy of every found frame. They add up to the energy from the first start to the end mark.
    pub fn frames(&self, found: &Found) -> Vec<FrameEnergy> {
        let measure = |span: &crate::frames::FrameSpan| FrameEnergy {
            start_s: span.start_s,
            end_s: span.end_s,
            energy_j: self.energy_j(span.start_s, span.end_s),
            confidence: span.confidence,
            flags: span.flags,
        };
        found.frames.iter().map(measure).collect()
    }
}
