//! Conversion of consecutive energies into a power curve.

use traces::Curve;

use crate::error::PacingError;
use crate::frame::S_PER_PS;

/// Builder of a power curve from energies spent over whole picoseconds.
///
/// The times of a curve are rounded to f64. The power of a step is its energy over the *rounded* length, so
/// the integral of the curve equals the energy spent. (Exact power over rounded lengths loses 1e-12 of a
/// short frame.)
#[derive(Debug, Default)]
pub(crate) struct Ledger {
    now_ps: u64,
    /// Energy of spans too short to move the rounded time; it goes into the next longer span.
    pending_j: f64,
    edges_s: Vec<f64>,
    watts: Vec<f64>,
}

impl Ledger {
    /// A ledger that begins at 0 s.
    pub(crate) fn new() -> Self {
        Self { edges_s: vec![0.0], ..Self::default() }
    }

    /// Current time, as the curve has it.
    pub(crate) fn now_s(&self) -> f64 {
        self.now_ps as f64 * S_PER_PS
    }

    /// Spend `joules` evenly over the next `length_ps` picoseconds.
    pub(crate) fn spend(&mut self, length_ps: u64, joules: f64) -> Result<(), PacingError> {
        self.now_ps = self.now_ps.checked_add(length_ps).ok_or(PacingError::TooLong)?;
        self.pending_j += joules;
        let (now_s, before_s) = (self.now_s(), self.edges_s.last().copied().unwrap_or(0.0));
        if now_s > before_s {
            self.edges_s.push(now_s);
            self.watts.push(self.pending_j / (now_s - before_s));
            self.pending_j = 0.0;
        }
        Ok(())
    }

    /// The finished curve.
    pub(crate) fn close(mut self) -> Result<Curve, PacingError> {
        if let ([.., before_s, end_s], Some(last_w)) = (self.edges_s.as_slice(), self.watts.last_mut()) {
            *last_w += self.pending_j / (end_s - before_s);
        }
        Ok(Curve::new(self.edges_s, self.watts)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joules_are_kept_however_short_their_spans() {
        let mut ledger = Ledger::new();
        // After two hours, a picosecond no longer changes an f64.
        let two_hours_ps = 7_200_000_000_000_000;
        ledger.spend(two_hours_ps, 0.0).unwrap();
        for _ in 0..1000 {
            ledger.spend(1, 1e-12).unwrap();
        }
        ledger.spend(0, 5e-10).unwrap();
        let curve = ledger.close().unwrap();
        let spent_j = curve.energy_j(7200.0, 7201.0);
        assert!((spent_j / 1.5e-9 - 1.0).abs() < 1e-9, "{spent_j}");
    }

    #[test]
    fn a_run_of_centuries_is_an_error() {
        let mut ledger = Ledger::new();
        ledger.spend(u64::MAX, 1.0).unwrap();
        assert_eq!(ledger.spend(1, 1.0), Err(PacingError::TooLong));
    }
}
