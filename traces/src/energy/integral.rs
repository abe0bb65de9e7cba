//! The one rule for the energy of a trace, and the energy of each frame from start to start.

use crate::frames::{Flags, Found};
use crate::stats::PairSum;
use crate::trace::Trace;

/// Samples per stored prefix sum: 16 bytes per 256 samples, and at most 256 additions per look-up.
const BLOCK: usize = 256;

/// Energy of a trace between any two times by **one rule**: every sample counts by its overlap,
///
/// `E(a, b) = sum over i of V_i I_i |[t_i, t_i + dt] cap [a, b]|`,
///
/// so samples cut by `a` or `b` count by fraction, and what lies outside the trace counts nothing. As both
/// ends use the same running integral, energies of adjoining spans add up to the energy of the whole.
#[derive(Clone, Debug)]
pub struct PowerIntegral<'a> {
    trace: &'a Trace,
    /// Sum of the powers (W) before each block.
    prefix_w: Vec<PairSum>,
}

impl<'a> PowerIntegral<'a> {
    /// Prepares the prefix sums: one pass over the trace.
    pub fn new(trace: &'a Trace) -> Self {
        let mut sum = PairSum::default();
        let mut prefix_w = Vec::with_capacity(trace.samples() / BLOCK + 1);
        for (index, power_w) in trace.powers_w().enumerate() {
            if index % BLOCK == 0 {
                prefix_w.push(sum);
            }
            sum = sum.plus(power_w);
        }
        Self { trace, prefix_w }
    }

    /// The trace.
    pub fn trace(&self) -> &'a Trace {
        self.trace
    }

    /// Energy from `a_s` to `b_s`, J; negative if `b_s < a_s`.
    pub fn energy_j(&self, a_s: f64, b_s: f64) -> f64 {
        self.power_sum_to(b_s).minus(self.power_sum_to(a_s)) / self.trace.rate_hz()
    }

    /// Energy of the whole trace, J.
    pub fn total_j(&self) -> f64 {
        self.energy_j(self.trace.start_s(), self.trace.end_s())
    }

    /// Sum of the powers (W) up to a time, the sample it falls in by fraction.
    fn power_sum_to(&self, time_s: f64) -> PairSum {
        let last = self.trace.samples() - 1;
        let position = self.trace.position(time_s).clamp(0.0, self.trace.samples() as f64);
        let index = (position as usize).min(last);
        let block = index / BLOCK;
        let mut sum = self.prefix_w[block];
        for whole in block * BLOCK..index {
            sum = sum.plus(self.trace.power_w(whole));
        }
        sum.plus_product(self.trace.power_w(index), position - index as f64)
    }
}

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
    /// Flags.
    pub flags: Flags,
}

/// Ground truth of one frame, for synthetic traces.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metadata::Metadata;

    fn ramp(samples: u16) -> Trace {
        let current = (0..samples).map(f32::from).collect();
        Trace::new(vec![2.0; usize::from(samples)], current, 10.0, 1.0, Metadata::default()).unwrap()
    }

    #[test]
    fn cut_samples_count_by_fraction() {
        let trace = ramp(4);
        let integral = PowerIntegral::new(&trace);
        // Powers 0, 2, 4, 6 W for 0.1 s each from 1 s.
        assert!((integral.energy_j(1.15, 1.225) - (2.0 * 0.05 + 4.0 * 0.025)).abs() < 1e-15);
        assert!((integral.total_j() - 1.2).abs() < 1e-15);
        assert!((integral.energy_j(-5.0, 50.0) - 1.2).abs() < 1e-15);
        assert!((integral.energy_j(1.2, 1.1) + 0.2).abs() < 1e-15);
    }

    #[test]
    fn the_rule_is_the_sum_over_overlaps() {
        let trace = ramp(1000);
        let integral = PowerIntegral::new(&trace);
        for (a_s, b_s) in [(1.0, 101.0), (1.234, 77.7), (26.55, 26.61), (0.0, 30.0)] {
            let by_rule: f64 = (0..trace.samples())
                .map(|i| {
                    trace.power_w(i)
                        * (f64::min(trace.time_s(i + 1), b_s) - f64::max(trace.time_s(i), a_s)).max(0.0)
                })
                .sum();
            assert!((integral.energy_j(a_s, b_s) / by_rule - 1.0).abs() < 1e-12);
        }
    }
}
