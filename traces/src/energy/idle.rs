//! Idle power: measured, and taken off.

use super::{FrameEnergy, PowerIntegral};

/// Idle power to take off.
#[derive(Clone, Debug)]
pub enum Idle<'a> {
    /// The same at all times, W: the mean over a stretch or a recording. Less noisy.
    Mean(f64),
    /// Instant by instant: what an idle recording shows as long after its start (repeated where it is shorter); it takes
    /// periodic patterns off, and adds the noise of both.
    Instant(PowerIntegral<'a>),
}

impl Idle<'_> {
    /// Energy of idling from `a_s` to `b_s` of a trace that starts at `start_s`, J.
    pub fn energy_j(&self, start_s: f64, a_s: f64, b_s: f64) -> f64 {
        match self {
            Self::Mean(watts) => watts * (b_s - a_s),
            Self::Instant(recording) => since(recording, b_s - start_s) - since(recording, a_s - start_s),
        }
    }

    /// Takes the idle energy off every frame.
    pub fn take_off(&self, start_s: f64, frames: &mut [FrameEnergy]) {
        for frame in frames {
            frame.energy_j -= self.energy_j(start_s, frame.start_s, frame.end_s);
        }
    }
}

/// Energy of the recording, repeated, from its start on, J.
fn since(integral: &PowerIntegral<'_>, time_s: f64) -> f64 {
    let trace = integral.trace();
    let length_s = trace.end_s() - trace.start_s();
    let whole = libm::floor(time_s / length_s);
    let rest_s = time_s - whole * length_s;
    whole * integral.total_j() + integral.energy_j(trace.start_s(), trace.start_s() + rest_s)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frames::Flags;
    use crate::metadata::Metadata;
    use crate::trace::Trace;

    fn trace(power: Vec<f32>) -> Trace {
        Trace::new(vec![1.0; power.len()], power, 10.0, 0.0, Metadata::default()).unwrap()
    }

    fn frame(start_s: f64, end_s: f64, energy_j: f64) -> FrameEnergy {
        FrameEnergy { start_s, end_s, energy_j, confidence: 1.0, flags: Flags::default() }
    }

    #[test]
    fn a_constant_idle_is_the_same_by_mean_and_by_instant_also_beyond_its_recording() {
        let recording = trace(vec![2.0; 7]);
        for (a_s, b_s) in [(0.0, 0.3), (0.55, 3.21)] {
            let by_instant = Idle::Instant(PowerIntegral::new(&recording)).energy_j(0.0, a_s, b_s);
            assert!((by_instant - Idle::Mean(2.0).energy_j(0.0, a_s, b_s)).abs() < 1e-12);
        }
    }

    #[test]
    fn taken_off_every_frame() {
        let mut frames = [frame(0.0, 0.5, 3.0)];
        Idle::Mean(2.0).take_off(0.0, &mut frames);
        assert_eq!(frames[0].energy_j, 2.0);
    }
}
