//! Energy between two times.

use super::{Idle, energies_j};
use crate::io::{TraceReader, WriteError};
use crate::trace::{SpanError, check_span};
use thiserror::Error;

/// Energy of a segment of a trace.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SegmentEnergy {
    /// Energy less that of idling, J.
    pub energy_j: f64,
    /// Mean power less that of idling, W.
    pub power_w: f64,
    /// Energy of idling, J.
    pub idle_j: f64,
}

/// Reason why a segment has no energy.
#[derive(Debug, Error)]
pub enum SegmentError {
    /// The times are not in the trace, or in the wrong order.
    #[error(transparent)]
    Span(#[from] SpanError),
    /// The samples could not be read.
    #[error(transparent)]
    Read(#[from] WriteError),
}

impl SegmentEnergy {
    /// The energy from `from_s` to `to_s`, less that of idling.
    ///
    /// # Errors
    /// [`SegmentError`] if the segment is not within the trace, or samples cannot be read.
    pub fn of(
        trace: &dyn TraceReader,
        (from_s, to_s): (f64, f64),
        idle: Option<&Idle<'_>>,
    ) -> Result<Self, SegmentError> {
        let header = trace.header();
        check_span([header.start_s, header.end_s()], [from_s, to_s])?;
        let total_j = energies_j(trace, &[(from_s, to_s)])?[0];
        let idle_j = idle.map_or(0.0, |idle| idle.energy_j(header.start_s, from_s, to_s));
        let energy_j = total_j - idle_j;
        Ok(Self { energy_j, power_w: energy_j / (to_s - from_s), idle_j })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metadata::Metadata;
    use crate::trace::Trace;

    #[test]
    fn idle_energy_is_taken_off_and_wrong_segments_are_refused() {
        let trace = Trace::new(vec![2.0; 100], vec![1.5; 100], 100.0, 0.0, Metadata::default()).unwrap();
        let segment = SegmentEnergy::of(&trace, (0.25, 0.75), Some(&Idle::Mean(1.0))).unwrap();
        let expected = [(segment.energy_j, 1.0), (segment.power_w, 2.0), (segment.idle_j, 0.5)];
        assert!(expected.iter().all(|(found, expected)| (found - expected).abs() < 1e-12), "{segment:?}");
        for (from_s, to_s) in [(0.75, 0.25), (0.5, 1.5), (-1.0, 0.5)] {
            assert!(matches!(SegmentEnergy::of(&trace, (from_s, to_s), None), Err(SegmentError::Span(_))));
        }
    }
}
