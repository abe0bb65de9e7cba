//! The one rule for the energy of a trace, and the energy of each frame from start to start: of a trace in
//! memory, or of one of any length in one pass, to the same last bit.

use crate::frames::{Flags, Found};
use crate::io::{TraceChunk, TraceHeader, TraceReader, TraceWriter, WriteError};
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
    use proptest::prelude::*;

    use super::*;
    use crate::energy::PowerIntegral;
    use crate::frames::Flags;
    use crate::io::SplitTrace;
    use crate::trace::Metadata;
    use crate::trace::Trace;

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
