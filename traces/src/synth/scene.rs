//! A scenario as a power curve.

use super::maker::Maker;
use super::scenario::Scenario;
use crate::energy::TrueFrame;
use crate::{Curve, CurveError};

/// A curve, and the frames in it.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// Power over time.
    pub curve: Curve,
    /// The frames, in order; each reaches to the next one's start, the last to `end_s`.
    pub truth: Vec<TrueFrame>,
    /// Where the last one ends, s.
    pub end_s: f64,
}

impl Scenario {
    /// Draws so many frames, idle before and after them.
    ///
    /// # Errors
    /// [`CurveError`] if a number of the scenario is not finite or so large that power would be negative.
    pub fn scene(&self, frames: usize, seed: u64) -> Result<Scene, CurveError> {
        let mut maker = Maker::new(*self, seed)?;
        maker.idle_around()?;
        let starts_s: Vec<f64> = (0..frames).map(|frame| maker.frame(frame)).collect::<Result<_, _>>()?;
        let end_s = maker.now_s();
        maker.idle_around()?;
        let curve = maker.build()?;
        let ends_s = starts_s.iter().skip(1).copied().chain([end_s]);
        let frame = |(&a_s, b_s): (&f64, f64)| TrueFrame { start_s: a_s, energy_j: curve.energy_j(a_s, b_s) };
        let truth = starts_s.iter().zip(ends_s).map(frame).collect();
        Ok(Scene { truth, curve, end_s })
    }
}
