//! Energies of a trace of any length, in one pass: by the rule of [`PowerIntegral`](super::PowerIntegral), to
//! the last bit.

use super::FrameEnergy;
use crate::io::{TraceChunk, TraceHeader, TraceReader, TraceWriter, WriteError};
use crate::stats::PairSum;

/// Energy of each of some spans of time, from one time (s) to another, J; negative where they are the other
/// way round. All samples are read once.
///
/// # Errors
/// [`WriteError::Read`] if the samples cannot be read.
pub fn energies_j(source: &dyn TraceReader, spans_s: &[(f64, f64)]) -> Result<Vec<f64>, WriteError> {
    let header = source.header();
    let mut sums = Sums::up_to(&header, spans_s.iter().flat_map(|&(a_s, b_s)| [a_s, b_s]));
    source.read_into(&mut sums)?;
    Ok(sums.energies_j(header.rate_hz).collect())
}

/// Running sums of power up to given places.
pub(crate) struct Sums {
    /// Places in samples, in order, and the number of the sum.
    places: Vec<(f64, u32)>,
    next: usize,
    last: u64,
    sums_w: Vec<PairSum>,
    sum_w: PairSum,
}

impl Sums {
    pub(crate) fn up_to(header: &TraceHeader, times_s: impl Iterator<Item = f64>) -> Self {
        let place = |time_s: f64| header.position(time_s).clamp(0.0, header.samples as f64);
        let mut places: Vec<(f64, u32)> =
            times_s.enumerate().map(|(slot, time_s)| (place(time_s), slot as u32)).collect();
        places.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let sums_w = vec![PairSum::default(); places.len()];
        Self { places, next: 0, last: header.samples.saturating_sub(1), sums_w, sum_w: PairSum::default() }
    }

    /// Energy between every two places, J.
    pub(crate) fn energies_j(&self, rate_hz: f64) -> impl Iterator<Item = f64> {
        self.sums_w.chunks_exact(2).map(move |ends| ends[1].minus(ends[0]) / rate_hz)
    }

    /// The sample that the next place lies in.
    fn next_sample(&self) -> u64 {
        self.places.get(self.next).map_or(u64::MAX, |(place, _)| (*place as u64).min(self.last))
    }
}

impl TraceWriter for Sums {
    fn write(&mut self, chunk: &TraceChunk<'_>) -> Result<(), WriteError> {
        let mut wanted = self.next_sample();
        for (sample, power_w) in (chunk.first..).zip(chunk.powers_w()) {
            while wanted == sample {
                let (place, slot) = self.places[self.next];
                self.sums_w[slot as usize] = self.sum_w.plus_product(power_w, place - sample as f64);
                self.next += 1;
                wanted = self.next_sample();
            }
            self.sum_w = self.sum_w.plus(power_w);
        }
        Ok(())
    }
}

/// When the work of each frame ends, s: the end of its last sample above `watts`; its start where there is
/// none. This is the end of the frame by the older rule, from begin to finish. Frames are in order and apart.
///
/// # Errors
/// [`WriteError::Read`] if the samples cannot be read.
pub fn finishes_s(
    source: &dyn TraceReader,
    frames: &[FrameEnergy],
    watts: f64,
) -> Result<Vec<f64>, WriteError> {
    let header = source.header();
    let place = |time_s: f64| header.position(time_s).clamp(0.0, header.samples as f64) as u64;
    let ranges = frames.iter().map(|frame| (place(frame.start_s), place(frame.end_s))).collect();
    let mut lasts = Lasts { ranges, watts, at: 0, last: vec![None; frames.len()] };
    source.read_into(&mut lasts)?;
    let finish = |(last, frame): (&Option<u64>, &FrameEnergy)| {
        last.map_or(frame.start_s, |last| header.time_s(last + 1).clamp(frame.start_s, frame.end_s))
    };
    Ok(lasts.last.iter().zip(frames).map(finish).collect())
}

/// The last sample above some watts in each range of samples.
struct Lasts {
    ranges: Vec<(u64, u64)>,
    watts: f64,
    at: usize,
    last: Vec<Option<u64>>,
}

impl TraceWriter for Lasts {
    fn write(&mut self, chunk: &TraceChunk<'_>) -> Result<(), WriteError> {
        for (sample, power_w) in (chunk.first..).zip(chunk.powers_w()) {
            while self.ranges.get(self.at).is_some_and(|(_, end)| *end <= sample) {
                self.at += 1;
            }
            match self.ranges.get(self.at) {
                Some((from, _)) if *from <= sample && power_w > self.watts => {
                    self.last[self.at] = Some(sample)
                }
                Some(_) => {}
                None => break,
            }
        }
        Ok(())
    }
}

/// Power of evenly spaced samples, the first among them, W: at most about `count`, in order.
///
/// # Errors
/// [`WriteError::Read`] if the samples cannot be read.
pub fn levels_w(source: &dyn TraceReader, count: u64) -> Result<Vec<f64>, WriteError> {
    let step = source.header().samples.div_ceil(count.max(1));
    let mut levels = Levels { step, watts: Vec::new() };
    source.read_into(&mut levels)?;
    Ok(levels.watts)
}

struct Levels {
    step: u64,
    watts: Vec<f64>,
}

impl TraceWriter for Levels {
    fn write(&mut self, chunk: &TraceChunk<'_>) -> Result<(), WriteError> {
        let skip = (chunk.first.next_multiple_of(self.step) - chunk.first) as usize;
        self.watts.extend(chunk.powers_w().skip(skip).step_by(self.step as usize));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::energy::PowerIntegral;
    use crate::frames::Flags;
    use crate::io::SplitTrace;
    use crate::metadata::Metadata;
    use crate::trace::Trace;
    use proptest::prelude::*;

    #[test]
    fn the_old_method_leaves_out_the_idle_at_the_end() {
        let power = vec![5.0, 5.0, 1.0, 5.0, 1.0, 1.0];
        let trace = Trace::new(vec![1.0; 6], power, 10.0, 0.0, Metadata::default()).unwrap();
        let frame = |start_s, end_s| FrameEnergy {
            start_s,
            end_s,
            energy_j: 1.8,
            confidence: 1.0,
            flags: Flags::default(),
        };
        assert!((finishes_s(&trace, &[frame(0.0, 0.6)], 2.0).unwrap()[0] - 0.4).abs() < 1e-12);
        assert_eq!(finishes_s(&trace, &[frame(0.4, 0.6)], 2.0).unwrap(), [0.4]);
    }

    proptest! {
        #[test]
        fn property_energies_and_finishes_in_pieces_are_those_in_memory(
            amperes in prop::collection::vec(-3.0_f32..9.0, 1..900),
            ends in prop::collection::vec(-1.0_f64..12.0, 2..12),
            piece in 1_usize..1000,
            watts in 0.0_f64..20.0,
        ) {
            let samples = amperes.len();
            let trace = Trace::new(vec![2.3; samples], amperes, 101.0, 0.7, Metadata::default()).unwrap();
            let (cut, integral) = (SplitTrace(&trace, piece), PowerIntegral::new(&trace));
            let spans: Vec<(f64, f64)> = ends.windows(2).map(|two| (two[0], two[1])).collect();
            let expected: Vec<f64> = spans.iter().map(|(a_s, b_s)| integral.energy_j(*a_s, *b_s)).collect();
            prop_assert_eq!(energies_j(&cut, &spans).unwrap(), expected);

            let mut edges = ends;
            edges.sort_by(f64::total_cmp);
            let frame = |two: &[f64]| FrameEnergy {
                start_s: two[0], end_s: two[1], energy_j: 0.0, confidence: 1.0, flags: Flags::default(),
            };
            let frames: Vec<FrameEnergy> = edges.windows(2).map(frame).collect();
            let place = |time_s: f64| trace.position(time_s).clamp(0.0, samples as f64) as usize;
            let expected: Vec<f64> = frames.iter().map(|frame| {
                let last = (place(frame.start_s)..place(frame.end_s)).rev().find(|&row| trace.power_w(row) > watts);
                last.map_or(frame.start_s, |last| trace.time_s(last + 1).clamp(frame.start_s, frame.end_s))
            }).collect();
            prop_assert_eq!(finishes_s(&cut, &frames, watts).unwrap(), expected);
            let step = samples.div_ceil(100);
            prop_assert_eq!(levels_w(&cut, 100).unwrap(), trace.powers_w().step_by(step).collect::<Vec<_>>());
        }
    }
}
