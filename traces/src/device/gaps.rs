//! What was lost, between samples that were made.

use crate::io::{Sink, Stretch, WriteError};
use crate::trace::on_line;
use core::ops::Range;

/// Samples of a gap that are made at once.
const PIECE: usize = 1 << 16;

/// Takes samples as if none were lost, and hands them on with those that were put on the line between their neighbours, as
/// [`Trace::without`](crate::Trace::without) does.
pub(super) struct Gaps<'a> {
    lost: &'a [Range<usize>],
    /// The gap that is next, or in which the samples at hand are.
    at: usize,
    /// Voltage and current before it.
    before: [f32; 2],
    into: &'a mut dyn Sink,
}

impl<'a> Gaps<'a> {
    pub fn new(lost: &'a [Range<usize>], into: &'a mut dyn Sink) -> Self {
        Self { lost, at: 0, before: [0.0; 2], into }
    }

    pub fn take(&mut self, made: &Stretch<'_>) -> Result<(), WriteError> {
        let (mut from, len) = (0, made.len());
        while from < len {
            let (now, place) =
                (made.first as usize + from, |sample: usize| len.min(sample - made.first as usize));
            match self.lost.get(self.at) {
                Some(gap) if gap.end <= now => {
                    self.bridge(gap.clone(), [made.voltage_v[from], made.current_a[from]])?;
                    self.at += 1;
                }
                Some(gap) if gap.start <= now => from = place(gap.end),
                next => {
                    let to = next.map_or(len, |gap| place(gap.start));
                    self.into.take(&made.part(from, to))?;
                    self.before = [made.voltage_v[to - 1], made.current_a[to - 1]];
                    from = to;
                }
            }
        }
        Ok(())
    }

    /// After the last sample: a gap that nothing follows.
    pub fn finish(&mut self) -> Result<(), WriteError> {
        while let Some(gap) = self.lost.get(self.at) {
            self.bridge(gap.clone(), self.before)?;
            self.at += 1;
        }
        Ok(())
    }

    fn bridge(&mut self, gap: Range<usize>, after: [f32; 2]) -> Result<(), WriteError> {
        for from in gap.clone().step_by(PIECE) {
            let places = from - gap.start..gap.len().min(from - gap.start + PIECE);
            let line = |channel: usize| -> Vec<f32> {
                places
                    .clone()
                    .map(|at| on_line(self.before[channel], after[channel], at, gap.len()))
                    .collect()
            };
            let (voltage_v, current_a) = (line(0), line(1));
            let (voltage_v, current_a) = (&voltage_v[..], &current_a[..]);
            self.into.take(&Stretch { first: from as u64, voltage_v, current_a, lost: true })?;
        }
        Ok(())
    }
}
