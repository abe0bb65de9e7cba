//! Sampling a noise-free curve, and the packets that are lost between recorder and host.

use core::ops::Range;

use thiserror::Error;

use super::Device;
use crate::curve::{Curve, CurveError};
use crate::io::{TraceChunk, TraceWriter, WriteError};
use crate::stats::Random;
use crate::trace::{Metadata, Trace, TraceError, on_line};

/// Most samples: 16 bytes each while they are made.
const MAX_SAMPLES: f64 = (1_u64 << 29) as f64;

/// Why a curve cannot be sampled.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum SampleError {
    /// The span is not within the curve.
    #[error(
        "cannot sample {start_s} s to {end_s} s: the power curve covers {curve_start_s} s to {curve_end_s} s"
    )]
    Span {
        /// Requested start, s.
        start_s: f64,
        /// Requested end, s.
        end_s: f64,
        /// Start of the curve, s.
        curve_start_s: f64,
        /// End of the curve, s.
        curve_end_s: f64,
    },
    /// The span is shorter than one sample.
    #[error(
        "{start_s} s to {end_s} s is shorter than one sample at {rate_hz} Hz: raise the rate or sample longer"
    )]
    TooShort {
        /// Requested start, s.
        start_s: f64,
        /// Requested end, s.
        end_s: f64,
        /// The device's rate, Hz.
        rate_hz: f64,
    },
    /// More samples than are made at once.
    #[error(
        "{start_s} s to {end_s} s at {rate_hz} Hz are {count:.0} samples, more than are made: \
         lower the rate or sample a part"
    )]
    TooLong {
        /// Requested start, s.
        start_s: f64,
        /// Requested end, s.
        end_s: f64,
        /// The device's rate, Hz.
        rate_hz: f64,
        /// How many they would be.
        count: f64,
    },
    /// The rail cannot deliver the power.
    #[error(
        "at {time_s} s the load draws {power_w} W, more than the rail can deliver ({limit_w} W = V^2 / 4R): \
         raise the device's rail_v or lower its rail_ohm"
    )]
    Overload {
        /// Left edge of the sample, s.
        time_s: f64,
        /// Power drawn, W.
        power_w: f64,
        /// The limit, W.
        limit_w: f64,
    },
    /// The trace that is to be sampled is no curve of power.
    #[error("the trace cannot be sampled again: {0}")]
    Curve(#[from] CurveError),
    /// The result is no valid trace.
    #[error(transparent)]
    Trace(#[from] TraceError),
}

impl From<SampleError> for WriteError {
    fn from(error: SampleError) -> Self {
        Self::Source(Box::new(error))
    }
}

/// A synthetic trace, and how many of its samples were beyond the device's range.
#[derive(Clone, Debug, PartialEq)]
pub struct SampledTrace {
    /// The trace.
    pub trace: Trace,
    /// Samples whose current was clipped to the range; above 0 is worth a warning.
    pub clipped_currents: usize,
    /// Samples whose voltage was clipped to the range.
    pub clipped_voltages: usize,
}

/// The channels while they are filled.
pub(super) struct Channels {
    pub voltage_v: Vec<f32>,
    pub current_a: Vec<f32>,
    pub clipped_voltages: usize,
    pub clipped_currents: usize,
}

impl Device {
    /// Samples a curve over the whole periods in `[start_s, end_s]`.
    ///
    /// Each sample is the exact mean power of its period, low-passed if so specified, converted to voltage
    /// and current at the rail (so that `V I` is the mean power), with noise added and both quantized. The
    /// trace's metadata names the device and the seed.
    ///
    /// # Errors
    /// [`SampleError`]: span outside the curve or too short, rail overloaded.
    pub fn sample(&self, curve: &Curve, start_s: f64, end_s: f64) -> Result<SampledTrace, SampleError> {
        let count = self.periods([start_s, end_s], [curve.start_s(), curve.end_s()], MAX_SAMPLES)?;
        let mut means_w = curve.sample_means_w(start_s, self.spec.rate_hz, count);
        if let Some(mut low_pass) = self.low_pass() {
            low_pass.apply(&mut means_w);
        }
        let channels = self.convert(0, &means_w, start_s)?;
        let metadata = self.metadata(Metadata::default());
        let trace = Trace::new(channels.voltage_v, channels.current_a, self.spec.rate_hz, start_s, metadata)?;
        Ok(SampledTrace {
            trace: trace.without(self.lost(count)),
            clipped_currents: channels.clipped_currents,
            clipped_voltages: channels.clipped_voltages,
        })
    }

    /// The metadata of a trace recorded by this device.
    pub(super) fn metadata(&self, of: Metadata) -> Metadata {
        Metadata { device: self.spec.name.clone(), seed: self.spec.seed, ..of }
    }

    pub(super) fn low_pass(&self) -> Option<LowPass> {
        self.spec.low_pass_s.map(|time_constant_s| LowPass::new(time_constant_s * self.spec.rate_hz))
    }

    fn amperes(&self, current_a: f64) -> f64 {
        self.spec.current_gain * current_a + self.spec.current_offset_a
    }

    fn volts(&self, voltage_v: f64) -> f64 {
        self.spec.voltage_gain * voltage_v + self.spec.voltage_offset_v
    }

    /// Whole periods between two times within a curve, `most` at most.
    pub(super) fn periods(
        &self,
        [start_s, end_s]: [f64; 2],
        [curve_start_s, curve_end_s]: [f64; 2],
        most: f64,
    ) -> Result<usize, SampleError> {
        if !(start_s >= curve_start_s && end_s <= curve_end_s && start_s <= end_s) {
            return Err(SampleError::Span { start_s, end_s, curve_start_s, curve_end_s });
        }
        // A span of whole periods must not lose one to the rounding of its ends.
        let periods = (end_s - start_s) * self.spec.rate_hz;
        let count = libm::floor(periods * (1.0 + 4.0 * f64::EPSILON) + 1e-9);
        if count < 1.0 {
            return Err(SampleError::TooShort { start_s, end_s, rate_hz: self.spec.rate_hz });
        }
        if count > most {
            return Err(SampleError::TooLong { start_s, end_s, rate_hz: self.spec.rate_hz, count });
        }
        Ok(count as usize)
    }

    /// Turns means, of which `first` went before, into samples.
    pub(super) fn convert(&self, first: u64, means_w: &[f64], start_s: f64) -> Result<Channels, SampleError> {
        let noise = Random::new(self.spec.seed, 0);
        let noisy = self.spec.current_noise_a > 0.0 || self.spec.voltage_noise_v > 0.0;
        let mut channels = Channels {
            voltage_v: Vec::with_capacity(means_w.len()),
            current_a: Vec::with_capacity(means_w.len()),
            clipped_voltages: 0,
            clipped_currents: 0,
        };
        for (index, &power_w) in (first..).zip(means_w) {
            let Some((volts, amperes)) = self.rail.solve(power_w) else {
                let time_s = start_s + index as f64 / self.spec.rate_hz;
                return Err(SampleError::Overload { time_s, power_w, limit_w: self.rail.limit_w() });
            };
            let (a, v) = if noisy { noise.normals(index) } else { (0.0, 0.0) };
            let (voltage, voltage_clipped) =
                self.voltage.quantize(self.volts(volts) + self.spec.voltage_noise_v * v);
            let (current, current_clipped) =
                self.current.quantize(self.amperes(amperes) + self.spec.current_noise_a * a);
            channels.voltage_v.push(self.spec.specified_voltage_v.map_or(voltage, |volts| volts as f32));
            channels.current_a.push(current);
            channels.clipped_voltages += usize::from(voltage_clipped);
            channels.clipped_currents += usize::from(current_clipped);
        }
        Ok(channels)
    }
}

/// One pole with a time constant in samples, started at rest: `y += (1 - exp(-1/tau)) (x - y)`, the step
/// response of an RC filter taken at sample steps.
pub(super) struct LowPass {
    share: f64,
    state: Option<f64>,
}

impl LowPass {
    fn new(time_constant_samples: f64) -> Self {
        Self { share: -libm::expm1(-1.0 / time_constant_samples), state: None }
    }

    /// Filters the values that follow those filtered before.
    pub fn apply(&mut self, values: &mut [f64]) {
        for value in values {
            let mut state = self.state.unwrap_or(*value);
            state += self.share * (*value - state);
            (*value, self.state) = (state, Some(state));
        }
    }
}

/// Stream of the random numbers of losses, apart from those of the noise.
const RANDOM_STREAM: u64 = 1;

impl Device {
    /// The segments of `samples` that do not arrive, neighbouring packets in one. Each packet but the first
    /// is lost or not by itself.
    pub(super) fn lost(&self, samples: usize) -> Vec<Range<usize>> {
        let random = Random::new(self.spec.seed, RANDOM_STREAM);
        let length = self.spec.packet_samples as usize;
        let packets = 1..samples.div_ceil(length);
        let mut lost: Vec<Range<usize>> = Vec::new();
        for packet in packets.filter(|&packet| random.uniform(packet as u64) < self.spec.packet_loss) {
            let range = packet * length..samples.min((packet + 1) * length);
            match lost.last_mut().filter(|last| last.end == range.start) {
                Some(last) => last.end = range.end,
                None => lost.push(range),
            }
        }
        lost
    }
}

/// Samples of a gap that are made at once.
const PIECE_SAMPLES: usize = 1 << 16;

/// Writes samples as if none were lost, with the lost ones on the line between their neighbours, as
/// [`Trace::without`](crate::Trace::without) does.
pub(super) struct Gaps<'a> {
    lost: &'a [Range<usize>],
    /// The next gap, or that of the current samples.
    at: usize,
    /// Voltage and current before it.
    before: [f32; 2],
    into: &'a mut dyn TraceWriter,
}

impl<'a> Gaps<'a> {
    pub fn new(lost: &'a [Range<usize>], into: &'a mut dyn TraceWriter) -> Self {
        Self { lost, at: 0, before: [0.0; 2], into }
    }

    pub fn write(&mut self, made: &TraceChunk<'_>) -> Result<(), WriteError> {
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
                    self.into.write(&made.part(from, to))?;
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
        for from in gap.clone().step_by(PIECE_SAMPLES) {
            let places = from - gap.start..gap.len().min(from - gap.start + PIECE_SAMPLES);
            let line = |channel: usize| -> Vec<f32> {
                places
                    .clone()
                    .map(|at| on_line(self.before[channel], after[channel], at, gap.len()))
                    .collect()
            };
            let (voltage_v, current_a) = (line(0), line(1));
            let (voltage_v, current_a) = (&voltage_v[..], &current_a[..]);
            self.into.write(&TraceChunk { first: from as u64, voltage_v, current_a, lost: true })?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::curve::Curve;
    use crate::device::{Device, DeviceSpec};
    use crate::io;
    use crate::io::{ReadError, ReadOptions, RepairKind, csv, parquet};

    fn curve(watts: f64) -> Curve {
        Curve::new(vec![0.0, 1.0], vec![watts]).unwrap()
    }

    #[test]
    fn more_samples_than_memory_holds_are_refused() {
        let year = Curve::new(vec![0.0, 3e7], vec![10.0]).unwrap();
        let device = Device::new(DeviceSpec { rate_hz: 1e7, ..DeviceSpec::default() }).unwrap();
        let message = device.sample(&year, 0.0, 3e7).unwrap_err().to_string();
        assert!(message.contains("300000000000000 samples"), "{message}");
    }

    #[test]
    fn a_second_at_50_khz_is_fifty_thousand_samples_wherever_it_starts() {
        let long = Curve::new(vec![0.0, 100.0], vec![10.0]).unwrap();
        let device = Device::new(DeviceSpec::default()).unwrap();
        for start_s in [0.0, 0.1, 7.3, 98.999] {
            assert_eq!(device.sample(&long, start_s, start_s + 1.0).unwrap().trace.samples(), 50_000);
        }
    }

    #[test]
    fn clipping_is_counted() {
        let device =
            Device::new(DeviceSpec { current_range_a: [0.0, 1.0], ..DeviceSpec::default() }).unwrap();
        let sampled = device.sample(&curve(24.0), 0.0, 0.01).unwrap();
        assert_eq!((sampled.clipped_currents, sampled.clipped_voltages), (500, 0));
    }

    #[test]
    fn the_filter_reaches_63_percent_of_a_step_after_its_time_constant() {
        let mut values = vec![0.0; 1];
        values.extend(vec![1.0; 100]);
        LowPass::new(50.0).apply(&mut values);
        assert!((values[50] - (1.0 - (-1.0_f64).exp())).abs() < 1e-12);
    }

    #[test]
    fn each_way_to_fail_says_where() {
        let device = Device::new(DeviceSpec::default()).unwrap();
        let message = |device: &Device, watts: f64, a: f64, b: f64| {
            device.sample(&curve(watts), a, b).unwrap_err().to_string()
        };
        assert!(
            message(&device, 1.0, 0.5, 1.5).contains("0.5 s to 1.5 s: the power curve covers 0 s to 1 s")
        );
        assert!(message(&device, 1.0, f64::NAN, 1.0).contains("NaN"));
        assert!(message(&device, 1.0, 0.5, 0.5).contains("shorter than one sample"));
        assert!(message(&device, 9_001.0, 0.25, 0.5).contains("at 0.25 s the load draws 9001"));
        let huge = Device::new(DeviceSpec { rate_hz: 10.0, ..DeviceSpec::default() }).unwrap();
        let far = Curve::new(vec![0.0, 1e10], vec![1.0]).unwrap();
        assert!(matches!(huge.sample(&far, 9.9e9, 9.9e9 + 1.0), Err(SampleError::Trace(_))));
    }

    fn device(packet_loss: f64, seed: u64) -> Device {
        Device::new(DeviceSpec { packet_samples: 100, packet_loss, seed, ..DeviceSpec::default() }).unwrap()
    }

    #[test]
    fn as_many_are_lost_as_asked_whole_and_never_the_first() {
        for seed in 1..20 {
            let lost = device(0.1, seed).lost(100_050);
            let samples: usize = lost.iter().map(ExactSizeIterator::len).sum();
            // 1000 packets, each lost with 0.1: within five standard deviations of 100.
            assert!((samples as f64 - 10_000.0).abs() < 5.0 * 949.0, "{samples}");
            assert!(lost.iter().all(|range| range.start >= 100 && range.start % 100 == 0));
            assert!(lost.windows(2).all(|two| two[0].end < two[1].start));
        }
        assert!(device(0.0, 1).lost(100_000).is_empty());
        assert_ne!(device(0.1, 1).lost(100_000), device(0.1, 2).lost(100_000));
    }

    #[test]
    fn a_file_has_the_gaps_and_a_reader_reports_their_places() {
        let curve = Curve::new((0..=40).map(|i| f64::from(i) * 0.01).collect(), vec![12.0; 40]).unwrap();
        let trace = device(0.2, 3).sample(&curve, 0.0, 0.4).unwrap().trace;
        let first = trace.lost()[0].clone();
        let dir = std::env::temp_dir().join(format!("quintile-packets-{}", std::process::id()));
        std::fs::create_dir_all(&dir).unwrap();
        let (table, text) = (dir.join("t.parquet"), dir.join("t.csv"));
        parquet::save(&trace, &table).unwrap();
        csv::save_as(&trace, &text, b',', false).unwrap();
        for path in [table, text] {
            let refused = io::read(&path, &ReadOptions::default()).unwrap_err();
            let at_gap = |row: u64| row == first.start as u64 + 1;
            assert!(matches!(refused, ReadError::Uneven { row, .. } if at_gap(row)), "{refused}");
            let repaired = io::read(&path, &ReadOptions { repair: true, ..ReadOptions::default() }).unwrap();
            let gaps = repaired.repairs.iter().filter(|repair| repair.code == RepairKind::FilledGap);
            let gaps: Vec<u64> = gaps.map(|repair| repair.count).collect();
            let lost: Vec<u64> = trace
                .lost()
                .iter()
                .filter(|lost| lost.end < trace.samples())
                .map(|lost| lost.len() as u64)
                .collect();
            assert_eq!(gaps, lost);
        }
        std::fs::remove_dir_all(dir).unwrap();
    }
}
