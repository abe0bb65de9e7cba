//! Extra power over a stretch of time, and a curve with such stretches on top.

use traces::{Curve, CurveError};

/// Why power is drawn on top.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// The application was launched a moment ago.
    Launch,
    /// The processor waits in a blocking finish.
    Finish,
    /// The disturbance at this place in the `disturbances` of a [`crate::System`].
    Disturbance(usize),
}

/// Power on top from one time to another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pulse {
    /// When it begins, s.
    pub start_s: f64,
    /// When it ends, s.
    pub end_s: f64,
    /// The power on top, W.
    pub extra_w: f64,
    /// Why.
    pub cause: Cause,
}

impl Pulse {
    /// How much of it lies between two times, s.
    pub fn overlap_s(&self, from_s: f64, to_s: f64) -> f64 {
        (self.end_s.min(to_s) - self.start_s.max(from_s)).max(0.0)
    }

    /// Its energy between two times, J.
    pub fn energy_j(&self, from_s: f64, to_s: f64) -> f64 {
        self.extra_w * self.overlap_s(from_s, to_s)
    }
}

/// The curve with pulses on top; what reaches beyond its ends is cut. Pulses that overlap add up.
///
/// # Errors
/// When a pulse's power is not finite or below zero.
pub fn overlay(curve: &Curve, pulses: &[Pulse]) -> Result<Curve, CurveError> {
    let mut pulses: Vec<&Pulse> = pulses.iter().filter(|pulse| pulse.end_s > pulse.start_s).collect();
    pulses.sort_by(|a, b| a.start_s.total_cmp(&b.start_s));
    let edges_s = edges(curve, &pulses);
    let mut watts = Vec::with_capacity(edges_s.len() - 1);
    let (mut segment, mut next, mut active) = (0, 0, Vec::new());
    for &time_s in &edges_s[..edges_s.len() - 1] {
        while curve.edges_s()[segment + 1] <= time_s {
            segment += 1;
        }
        while let Some(pulse) = pulses.get(next).filter(|pulse| pulse.start_s <= time_s) {
            active.push(*pulse);
            next += 1;
        }
        active.retain(|pulse| pulse.end_s > time_s);
        // Summed anew each time: a running sum would keep the rounding of pulses that are over.
        let extra_w: f64 = active.iter().map(|pulse| pulse.extra_w).sum();
        watts.push(curve.watts()[segment] + extra_w);
    }
    Curve::new(edges_s, watts)
}

/// The edges of the curve and of all pulses within it, in order and each once.
fn edges(curve: &Curve, pulses: &[&Pulse]) -> Vec<f64> {
    let inside = |time_s: &f64| (curve.start_s()..curve.end_s()).contains(time_s);
    let mut edges_s = curve.edges_s().to_vec();
    edges_s.extend(pulses.iter().flat_map(|pulse| [pulse.start_s, pulse.end_s]).filter(inside));
    edges_s.sort_by(f64::total_cmp);
    // -0 and 0 are two numbers to the order, and one edge.
    edges_s.dedup_by(|later, earlier| *later <= *earlier);
    edges_s
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pulse(start_s: f64, end_s: f64, extra_w: f64) -> Pulse {
        Pulse { start_s, end_s, extra_w, cause: Cause::Launch }
    }

    #[test]
    fn overlapping_pulses_add_up_and_ends_are_cut() {
        let curve = Curve::new(vec![0.0, 1.0, 4.0], vec![2.0, 3.0]).unwrap();
        let pulses =
            [pulse(3.5, 9.0, 4.0), pulse(-1.0, 0.5, 1.0), pulse(0.25, 2.0, 0.5), pulse(5.0, 6.0, 7.0)];
        let over = overlay(&curve, &pulses).unwrap();
        assert_eq!(over.edges_s(), [0.0, 0.25, 0.5, 1.0, 2.0, 3.5, 4.0]);
        assert_eq!(over.watts(), [3.0, 3.5, 2.5, 3.5, 3.0, 7.0]);
    }

    #[test]
    fn nothing_on_top_changes_nothing() {
        let curve = Curve::new(vec![0.0, 0.3, 0.31], vec![1.0, 0.0]).unwrap();
        assert_eq!(overlay(&curve, &[]), Ok(curve.clone()));
        assert_eq!(overlay(&curve, &[pulse(0.1, 0.1, 9.0), pulse(0.2, 0.1, 9.0)]), Ok(curve));
    }

    #[test]
    fn power_that_is_none_is_refused() {
        let curve = Curve::new(vec![0.0, 1.0], vec![1.0]).unwrap();
        assert!(overlay(&curve, &[pulse(0.2, 0.4, f64::NAN)]).is_err());
        assert!(overlay(&curve, &[pulse(0.2, 0.4, -2.0)]).is_err());
    }
}
