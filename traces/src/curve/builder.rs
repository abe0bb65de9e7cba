//! Appending segments one after another.

use super::{Curve, CurveError};
use crate::sum::PairSum;

/// Builds a [`Curve`] from durations, with a clock that does not drift however many segments there are.
#[derive(Clone, Debug)]
pub struct CurveBuilder {
    clock: PairSum,
    edges_s: Vec<f64>,
    watts: Vec<f64>,
}

impl CurveBuilder {
    /// An empty curve that will begin at `start_s`.
    ///
    /// # Errors
    /// [`CurveError::Start`] if the time is not finite.
    pub fn new(start_s: f64) -> Result<Self, CurveError> {
        if !start_s.is_finite() {
            return Err(CurveError::Start { time_s: start_s });
        }
        Ok(Self { clock: PairSum::from_f64(start_s), edges_s: vec![start_s], watts: Vec::new() })
    }

    /// Appends `duration_s` seconds at `watts`. A segment of the same power as the last one extends it; one too
    /// short to move the clock (in particular of no duration) leaves no segment.
    ///
    /// # Errors
    /// [`CurveError::Duration`] or [`CurveError::Power`], with the number of segments so far.
    pub fn push(&mut self, duration_s: f64, watts: f64) -> Result<(), CurveError> {
        let index = self.watts.len();
        let clock = self.clock.plus(duration_s);
        if !(duration_s.is_finite() && duration_s >= 0.0 && clock.value().is_finite()) {
            return Err(CurveError::Duration { index, duration_s });
        }
        if !(watts.is_finite() && watts >= 0.0) {
            return Err(CurveError::Power { index, power_w: watts });
        }
        self.clock = clock;
        self.append(clock.value(), watts);
        Ok(())
    }

    fn append(&mut self, end_s: f64, watts: f64) {
        let Some(last_edge_s) = self.edges_s.last_mut() else { return };
        if end_s <= *last_edge_s {
            return;
        }
        if self.watts.last() == Some(&watts) {
            *last_edge_s = end_s;
        } else {
            self.edges_s.push(end_s);
            self.watts.push(watts);
        }
    }

    /// Where the next segment will begin, s.
    pub fn now_s(&self) -> f64 {
        self.clock.value()
    }

    /// The finished curve.
    ///
    /// # Errors
    /// [`CurveError::Empty`] if nothing was pushed.
    pub fn build(self) -> Result<Curve, CurveError> {
        Curve::new(self.edges_s, self.watts)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_million_short_segments_do_not_drift() {
        let mut builder = CurveBuilder::new(0.0).unwrap();
        for index in 0..1_000_000 {
            builder.push(1e-7, f64::from(index % 2)).unwrap();
        }
        let curve = builder.build().unwrap();
        assert!((curve.end_s() - 0.1).abs() < 1e-15);
        assert!((curve.energy_j(0.0, 0.1) - 0.05).abs() < 1e-13);
    }

    #[test]
    fn equal_neighbours_merge_and_empty_segments_vanish() {
        let mut builder = CurveBuilder::new(1.0).unwrap();
        for (duration_s, watts) in [(1.0, 2.0), (0.0, 9.0), (1.0, 2.0), (1.0, 3.0)] {
            builder.push(duration_s, watts).unwrap();
        }
        assert_eq!(builder.now_s(), 4.0);
        let curve = builder.build().unwrap();
        assert_eq!((curve.edges_s(), curve.watts()), (&[1.0, 3.0, 4.0][..], &[2.0, 3.0][..]));
    }

    #[test]
    fn bad_segments_are_refused_with_their_position() {
        let mut builder = CurveBuilder::new(0.0).unwrap();
        builder.push(1.0, 1.0).unwrap();
        assert!(builder.push(-1.0, 1.0).unwrap_err().to_string().contains("segment 1: duration -1 s"));
        assert!(builder.push(f64::INFINITY, 1.0).is_err());
        assert!(builder.push(1.0, f64::NAN).unwrap_err().to_string().contains("segment 1: power NaN W"));
        assert!(CurveBuilder::new(f64::NAN).unwrap_err().to_string().contains("NaN s"));
        assert_eq!(CurveBuilder::new(0.0).unwrap().build().unwrap_err(), CurveError::Empty);
    }
}
