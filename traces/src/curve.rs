//! Noise-free power over time, as a simulator computes it.

use crate::stats::PairSum;
use thiserror::Error;

/// Why a [`Curve`] cannot be built.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum CurveError {
    /// There is no segment.
    #[error("a power curve needs at least one segment: push one before building")]
    Empty,
    /// The number of edges is not the number of segments plus one.
    #[error("{segments} segments need {} edges, {edges} were given", segments + 1)]
    Lengths {
        /// Edges given.
        edges: usize,
        /// Segments given.
        segments: usize,
    },
    /// An edge is not finite or not later than the one before it.
    #[error("edge {index} at {time_s} s: edges must be finite and increasing; sort them and drop repeats")]
    Edge {
        /// Position of the edge, from 0.
        index: usize,
        /// The edge, s.
        time_s: f64,
    },
    /// A segment's power is no finite number of watts or, where it is simulated, below zero.
    #[error("segment {index}: power {power_w} W is not finite, or below 0 in a simulation")]
    Power {
        /// Position of the segment, from 0.
        index: usize,
        /// The power, W.
        power_w: f64,
    },
    /// A segment's duration is not finite or is negative.
    #[error("segment {index}: duration {duration_s} s is not finite and at least 0")]
    Duration {
        /// How many segments had been pushed before.
        index: usize,
        /// The duration, s.
        duration_s: f64,
    },
    /// The start time is not finite.
    #[error("a curve cannot start at {time_s} s: give a finite start")]
    Start {
        /// The start, s.
        time_s: f64,
    },
}

/// Power that is constant between edges: `watts[i]` holds on `[edges_s[i], edges_s[i + 1])`.
///
/// Outside its edges the power is zero. Energies come from prefix sums in two f64, so the energy of a short
/// interval late in a long curve is as exact as that of the first one.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    edges_s: Vec<f64>,
    watts: Vec<f64>,
    /// Energy from the start up to each edge.
    prefix_j: Vec<PairSum>,
}

impl Curve {
    /// A curve from `n + 1` edges (s, increasing) and `n` powers (W, at or above 0).
    ///
    /// # Errors
    /// [`CurveError`] names the edge or segment that is wrong.
    pub fn new(edges_s: Vec<f64>, watts: Vec<f64>) -> Result<Self, CurveError> {
        Self::from_least(edges_s, watts, 0.0)
    }

    /// The same from a recording, whose noise may take its powers below 0.
    ///
    /// # Errors
    /// As [`Curve::new`].
    pub fn recorded(edges_s: Vec<f64>, watts: Vec<f64>) -> Result<Self, CurveError> {
        Self::from_least(edges_s, watts, f64::NEG_INFINITY)
    }

    fn from_least(edges_s: Vec<f64>, watts: Vec<f64>, least_w: f64) -> Result<Self, CurveError> {
        if watts.is_empty() {
            return Err(CurveError::Empty);
        }
        if edges_s.len() != watts.len() + 1 {
            return Err(CurveError::Lengths { edges: edges_s.len(), segments: watts.len() });
        }
        check_edges(&edges_s)?;
        let is_power = |watts: f64| watts.is_finite() && watts >= least_w;
        if let Some((index, &power_w)) = watts.iter().enumerate().find(|(_, watts)| !is_power(**watts)) {
            return Err(CurveError::Power { index, power_w });
        }
        let prefix_j = prefix_energy(&edges_s, &watts);
        Ok(Self { edges_s, watts, prefix_j })
    }

    /// The first edge, s.
    pub fn start_s(&self) -> f64 {
        self.edges_s.first().copied().unwrap_or(0.0)
    }

    /// The last edge, s.
    pub fn end_s(&self) -> f64 {
        self.edges_s.last().copied().unwrap_or(0.0)
    }

    /// The edges, s: one more than there are segments.
    pub fn edges_s(&self) -> &[f64] {
        &self.edges_s
    }

    /// The power of each segment, W.
    pub fn watts(&self) -> &[f64] {
        &self.watts
    }

    /// Power at a time, W; at an edge that of the segment that begins there; 0 outside the curve.
    pub fn power_at(&self, time_s: f64) -> f64 {
        let after = self.edges_s.partition_point(|edge| *edge <= time_s);
        after.checked_sub(1).and_then(|segment| self.watts.get(segment)).copied().unwrap_or(0.0)
    }

    /// Energy from `a_s` to `b_s`, J: the exact integral, rounded once. Negative if `b_s < a_s`.
    pub fn energy_j(&self, a_s: f64, b_s: f64) -> f64 {
        self.energy_to(b_s).minus(self.energy_to(a_s))
    }

    /// Mean power of `count` successive periods of `1 / rate_hz` from `start_s`, W, in one sweep.
    ///
    /// The means times the period add up to the energy of the whole span: successive periods share their
    /// edge.
    pub fn sample_means_w(&self, start_s: f64, rate_hz: f64, count: usize) -> Vec<f64> {
        let mut segment = 0;
        let mut before = self.energy_to(start_s);
        let mut means_w = Vec::with_capacity(count);
        for index in 0..count {
            let time_s = (start_s + (index + 1) as f64 / rate_hz).clamp(self.start_s(), self.end_s());
            while segment + 1 < self.watts.len() && self.edges_s[segment + 1] <= time_s {
                segment += 1;
            }
            let energy = self.energy_within(segment, time_s);
            means_w.push(energy.minus(before) * rate_hz);
            before = energy;
        }
        means_w
    }

    fn energy_to(&self, time_s: f64) -> PairSum {
        let time_s = time_s.clamp(self.start_s(), self.end_s());
        let after = self.edges_s.partition_point(|edge| *edge <= time_s);
        self.energy_within(after.saturating_sub(1).min(self.watts.len() - 1), time_s)
    }

    fn energy_within(&self, segment: usize, time_s: f64) -> PairSum {
        self.prefix_j[segment].plus_span(self.edges_s[segment], time_s, self.watts[segment])
    }
}

fn check_edges(edges_s: &[f64]) -> Result<(), CurveError> {
    let mut previous_s = f64::NEG_INFINITY;
    for (index, &time_s) in edges_s.iter().enumerate() {
        if !time_s.is_finite() || time_s <= previous_s {
            return Err(CurveError::Edge { index, time_s });
        }
        previous_s = time_s;
    }
    Ok(())
}

fn prefix_energy(edges_s: &[f64], watts: &[f64]) -> Vec<PairSum> {
    let mut sum = PairSum::default();
    let mut prefix = Vec::with_capacity(edges_s.len());
    prefix.push(sum);
    for (edge, &power_w) in edges_s.windows(2).zip(watts) {
        sum = sum.plus_span(edge[0], edge[1], power_w);
        prefix.push(sum);
    }
    prefix
}

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

    /// Appends `duration_s` seconds at `watts`. A segment of the same power as the last one extends it; one
    /// too short to move the clock (in particular of no duration) leaves no segment.
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

    /// Begin of the next segment, s.
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
    fn energy_of_a_part_is_power_times_overlap() {
        let curve = Curve::new(vec![1.0, 2.0, 4.0], vec![3.0, 5.0]).unwrap();
        assert_eq!(curve.energy_j(1.5, 3.0), 1.5 + 5.0);
        assert_eq!(curve.energy_j(0.0, 9.0), 13.0);
        assert_eq!(curve.energy_j(3.0, 1.5), -6.5);
        assert_eq!([curve.power_at(0.5), curve.power_at(2.0), curve.power_at(4.0)], [0.0, 5.0, 0.0]);
    }

    #[test]
    fn a_late_microsecond_of_a_long_curve_is_exact_to_1e_12() {
        let edges: Vec<f64> = (0..=200_000).map(|i| f64::from(i) * 5e-4).collect();
        let watts: Vec<f64> = (0..200_000).map(|i| 1.0 + f64::from(i % 7)).collect();
        let curve = Curve::new(edges.clone(), watts.clone()).unwrap();
        let (a_s, b_s) = (edges[199_990] + 1e-4, edges[199_990] + 1.01e-4);
        let expected_j = watts[199_990] * (b_s - a_s);
        assert!((curve.energy_j(a_s, b_s) / expected_j - 1.0).abs() < 1e-12);
    }

    #[test]
    fn the_sweep_gives_the_same_means_as_the_integral() {
        let curve = Curve::new(vec![0.0, 0.3, 0.31, 0.9, 2.0], vec![1.0, 9.0, 0.0, 4.0]).unwrap();
        for (index, mean_w) in curve.sample_means_w(0.05, 10.0, 19).into_iter().enumerate() {
            let a_s = 0.05 + index as f64 / 10.0;
            let b_s = 0.05 + (index + 1) as f64 / 10.0;
            assert!((mean_w - curve.energy_j(a_s, b_s) * 10.0).abs() < 1e-14);
        }
    }

    #[test]
    fn each_bad_curve_names_what_is_wrong() {
        let message = |edges: &[f64], watts: &[f64]| {
            Curve::new(edges.to_vec(), watts.to_vec()).unwrap_err().to_string()
        };
        assert!(message(&[0.0], &[]).contains("at least one segment"));
        assert!(message(&[0.0, 1.0], &[1.0, 2.0]).contains("2 segments need 3 edges, 2 were given"));
        assert!(message(&[0.0, 0.0], &[1.0]).contains("edge 1 at 0 s"));
        assert!(message(&[0.0, f64::NAN], &[1.0]).contains("edge 1 at NaN s"));
        assert!(message(&[0.0, 1.0, 2.0], &[1.0, -1.0]).contains("segment 1: power -1 W"));
    }

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
