//! Sampling a recorded trace again, in pieces.

use super::Device;
use super::sample::{Channels, Gaps, LowPass, SampleError};
use crate::curve::CurveError;
use crate::energy::{Sums, energies_j};
use crate::io::{TraceChunk, TraceHeader, TraceReader, TraceWriter, WriteError};
use crate::stats::PairSum;
use crate::trace::{check_times, losses, lost_at_end, lost_samples};
use core::ops::Range;
use rayon::prelude::*;
use warnings::{Code, Warning};

/// Mean powers that are converted at once.
const PIECE_SAMPLES: usize = 1 << 16;
/// Mean powers that a thread converts at once.
const TASK_SAMPLES: usize = 1 << 12;
/// Most samples: they are not held in memory, but take time.
const MAX_SAMPLES: f64 = (1_u64 << 36) as f64;
/// Largest change of the energy without a warning, as a share. On a rail as assumed by default, a specified
/// voltage misses at most 0.1 V of 12 V, and gain and offset of a meter are a percent or so: several times
/// that is another voltage, or too few codes.
const MAX_ENERGY_CHANGE: f64 = 0.03;

/// A trace as a coarser device would have recorded it: the original is read again whenever samples are
/// needed, and neither is in memory. The samples are those of [`Device::sample`] for the power
/// of the trace, to the last bit.
pub struct Resampled<'a> {
    device: &'a Device,
    trace: &'a dyn TraceReader,
    header: TraceHeader,
    lost: Vec<Range<usize>>,
    /// Energy of all samples, J.
    pub energy_j: f64,
    /// Samples whose current was clipped to the range; above 0 is worth a warning.
    pub clipped_currents: usize,
    /// Samples whose voltage was clipped to the range.
    pub clipped_voltages: usize,
}

impl Device {
    /// Samples a trace as if its power were drawn from the device's rail. It is gone through once, so that
    /// whatever is wrong is known before the first sample.
    ///
    /// # Errors
    /// [`WriteError::Source`] as [`Device::sample`], and [`WriteError::Read`] if the trace cannot be read.
    pub fn resample_in_pieces<'a>(&'a self, trace: &'a dyn TraceReader) -> Result<Resampled<'a>, WriteError> {
        let TraceHeader { start_s, metadata, .. } = trace.header();
        let end_s = trace.header().end_s();
        let count = self.periods([start_s, end_s], [start_s, end_s], MAX_SAMPLES);
        let samples = count.as_ref().map_or(0, |count| *count);
        let lost = self.lost(samples);
        let header = TraceHeader {
            start_s,
            rate_hz: self.spec.rate_hz,
            samples: samples as u64,
            lost_samples: lost_samples(&lost) as u64,
            lost_at_end: lost_at_end(&lost, samples),
            metadata: self.metadata(metadata),
        };
        let (energy_j, clipped_currents, clipped_voltages) = (0.0, 0, 0);
        let mut made =
            Resampled { device: self, trace, header, lost, energy_j, clipped_currents, clipped_voltages };
        let mut sums = Sums::up_to(&made.header, [start_s, made.header.end_s()].into_iter());
        let pass = made.pass(&mut sums)?;
        pass.check(count.err())?;
        (made.clipped_currents, made.clipped_voltages) = (pass.clipped_currents, pass.clipped_voltages);
        check_times(made.header.samples, self.spec.rate_hz, start_s).map_err(SampleError::Trace)?;
        made.energy_j = sums.energies_j(self.spec.rate_hz).next().unwrap_or(0.0);
        Ok(made)
    }
}

impl Resampled<'_> {
    /// Energy of the original over the same time, J.
    ///
    /// # Errors
    /// [`WriteError::Read`] if it cannot be read.
    pub fn original_energy_j(&self) -> Result<f64, WriteError> {
        Ok(energies_j(self.trace, &[(self.header.start_s, self.header.end_s())])?[0])
    }

    /// Warning about an energy that is not that of the original, `original_j`.
    pub fn energy_change(&self, original_j: f64) -> Option<Warning> {
        let change = self.energy_j - original_j;
        let message = || {
            format!(
                "the device records {:.6} J of {original_j:.6} J ({:+.1} %)",
                self.energy_j,
                100.0 * change / original_j
            )
        };
        (change.abs() > MAX_ENERGY_CHANGE * original_j.abs() && original_j != 0.0)
            .then(|| Warning::new(Code::EnergyChanged, message()))
    }

    /// Warning about samples beyond the range of the device.
    pub fn clipping(&self) -> Option<Warning> {
        let [currents, voltages] = [self.clipped_currents, self.clipped_voltages];
        let message =
            || format!("{currents} currents and {voltages} voltages were beyond the device's range");
        (currents + voltages > 0).then(|| Warning::new(Code::Clipped, message()))
    }

    /// The losses of the device, in words; `None` without any.
    pub fn losses(&self) -> Option<String> {
        losses(&self.lost, |index| self.header.time_s(index as u64))
    }

    fn pass<'a>(&'a self, into: &'a mut dyn TraceWriter) -> Result<Pass<'a>, WriteError> {
        let mut pass = Pass::new(self, into);
        self.trace.read_into(&mut pass)?;
        pass.finish()?;
        Ok(pass)
    }
}

impl TraceReader for Resampled<'_> {
    fn header(&self) -> TraceHeader {
        self.header.clone()
    }

    fn read_into(&self, writer: &mut dyn TraceWriter) -> Result<(), WriteError> {
        Ok(self.pass(writer)?.check(None)?)
    }
}

/// One way through the trace.
struct Pass<'a> {
    device: &'a Device,
    of: TraceHeader,
    made: &'a TraceHeader,
    /// Energy before the current sample, and before the next mean, J.
    energy: PairSum,
    before: PairSum,
    /// Means so far, and those not yet turned into samples, W.
    means: u64,
    means_w: Vec<f64>,
    low_pass: Option<LowPass>,
    gaps: Gaps<'a>,
    clipped_currents: usize,
    clipped_voltages: usize,
    edge: Option<CurveError>,
    power: Option<CurveError>,
    overload: Option<SampleError>,
}

impl<'a> Pass<'a> {
    fn new(resampled: &'a Resampled<'_>, into: &'a mut dyn TraceWriter) -> Self {
        let Resampled { device, trace, header, lost, .. } = resampled;
        Self {
            device,
            of: trace.header(),
            made: header,
            energy: PairSum::default(),
            before: PairSum::default(),
            means: 0,
            means_w: Vec::with_capacity(PIECE_SAMPLES),
            low_pass: device.low_pass(),
            gaps: Gaps::new(lost, into),
            clipped_currents: 0,
            clipped_voltages: 0,
            edge: None,
            power: None,
            overload: None,
        }
    }

    /// Takes one sample of the trace: the means of all periods that end in it.
    fn step(&mut self, index: u64, power_w: f64) -> Result<(), WriteError> {
        let (begin_s, end_s) = (self.of.time_s(index), self.of.time_s(index + 1));
        self.check_sample(index, [begin_s, end_s], power_w);
        if index == 0 {
            self.before = self.energy.plus_span(begin_s, begin_s, power_w);
        }
        let (last, rate_hz) = (index + 1 == self.of.samples, self.made.rate_hz);
        while self.means < self.made.samples {
            let limit_s = [self.of.start_s, self.of.end_s()];
            let time_s =
                (self.made.start_s + (self.means + 1) as f64 / rate_hz).clamp(limit_s[0], limit_s[1]);
            if time_s >= end_s && !last {
                break;
            }
            let energy = self.energy.plus_span(begin_s, time_s, power_w);
            self.means_w.push(energy.minus(self.before) * rate_hz);
            (self.before, self.means) = (energy, self.means + 1);
            if self.means_w.len() == PIECE_SAMPLES {
                self.convert()?;
            }
        }
        self.energy = self.energy.plus_span(begin_s, end_s, power_w);
        Ok(())
    }

    /// As a [`Curve`](crate::Curve) is checked.
    fn check_sample(&mut self, index: u64, [begin_s, end_s]: [f64; 2], power_w: f64) {
        let index = index as usize;
        if !(end_s.is_finite() && end_s > begin_s) {
            self.edge.get_or_insert(CurveError::Edge { index: index + 1, time_s: end_s });
        }
        if !power_w.is_finite() {
            self.power.get_or_insert(CurveError::Power { index, power_w });
        }
    }

    /// Converts the pending means to samples, in parallel, and writes them.
    fn convert(&mut self) -> Result<(), WriteError> {
        let mut means_w = std::mem::take(&mut self.means_w);
        if self.edge.is_none() && self.power.is_none() && self.overload.is_none() {
            if let Some(low_pass) = &mut self.low_pass {
                low_pass.apply(&mut means_w);
            }
            let (device, start_s, first) =
                (self.device, self.made.start_s, self.means - means_w.len() as u64);
            let tasks = means_w.par_chunks(TASK_SAMPLES).enumerate();
            let made: Vec<_> = tasks
                .map(|(task, means_w)| device.convert(first + (task * TASK_SAMPLES) as u64, means_w, start_s))
                .collect();
            for (task, channels) in made.into_iter().enumerate() {
                match channels {
                    Ok(channels) => self.hand_on(first + (task * TASK_SAMPLES) as u64, &channels)?,
                    Err(error) => {
                        self.overload = Some(error);
                        break;
                    }
                }
            }
        }
        means_w.clear();
        self.means_w = means_w;
        Ok(())
    }

    fn hand_on(&mut self, first: u64, channels: &Channels) -> Result<(), WriteError> {
        self.clipped_currents += channels.clipped_currents;
        self.clipped_voltages += channels.clipped_voltages;
        let (voltage_v, current_a) = (&channels.voltage_v[..], &channels.current_a[..]);
        self.gaps.write(&TraceChunk { first, voltage_v, current_a, lost: false })
    }

    fn finish(&mut self) -> Result<(), WriteError> {
        self.convert()?;
        self.gaps.finish()
    }

    /// The first errors, in the order in which a trace in memory is checked.
    fn check(&self, periods: Option<SampleError>) -> Result<(), SampleError> {
        let curve = self.edge.clone().or(self.power.clone()).map(SampleError::Curve);
        curve.or(periods).or(self.overload.clone()).map_or(Ok(()), Err)
    }
}

impl TraceWriter for Pass<'_> {
    fn write(&mut self, chunk: &TraceChunk<'_>) -> Result<(), WriteError> {
        (chunk.first..).zip(chunk.powers_w()).try_for_each(|(index, power_w)| self.step(index, power_w))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::curve::Curve;
    use crate::device::{DeviceSpec, SampledTrace};
    use crate::io::SplitTrace;
    use crate::trace::Metadata;
    use crate::trace::Trace;
    use proptest::prelude::*;

    /// The whole trace at once, as if its power were drawn from the device's rail.
    fn resample(device: &Device, trace: &Trace) -> Result<SampledTrace, SampleError> {
        let edges_s = (0..=trace.samples()).map(|index| trace.time_s(index)).collect();
        let curve = Curve::recorded(edges_s, trace.powers_w().collect())?;
        let mut sampled = device.sample(&curve, trace.start_s(), curve.end_s())?;
        sampled.trace.metadata = device.metadata(trace.metadata.clone());
        Ok(sampled)
    }

    /// 10 W on a rail of 12 V, for a second.
    fn at_12_v() -> Trace {
        Trace::new(vec![12.0; 1000], vec![10.0 / 12.0; 1000], 1e3, 0.0, Metadata::default()).unwrap()
    }

    #[test]
    fn a_voltage_of_another_rail_and_too_few_codes_change_the_energy_with_a_warning() {
        let trace = at_12_v();
        let warned = |change: fn(&mut DeviceSpec)| {
            let mut spec = DeviceSpec { rate_hz: 100.0, ..DeviceSpec::fitting(12.0, 10.0) };
            change(&mut spec);
            let device = Device::new(spec).unwrap();
            let sampled = device.resample_in_pieces(&trace).unwrap();
            sampled.energy_change(sampled.original_energy_j().unwrap()).map(|warning| warning.message)
        };
        assert_eq!(warned(|spec| spec.specified_voltage_v = Some(12.0)), None);
        assert!(warned(|spec| spec.specified_voltage_v = Some(5.0)).unwrap().contains("(-58.3 %)"));
        assert!(warned(|spec| spec.bits = 2).is_some());
    }

    /// Joins pieces.
    #[derive(Default)]
    struct All {
        voltage_v: Vec<f32>,
        current_a: Vec<f32>,
        lost: Vec<usize>,
    }

    impl TraceWriter for All {
        fn write(&mut self, chunk: &TraceChunk<'_>) -> Result<(), WriteError> {
            assert_eq!(chunk.first, self.voltage_v.len() as u64);
            if chunk.lost {
                self.lost.extend(chunk.first as usize..chunk.first as usize + chunk.len());
            }
            self.voltage_v.extend_from_slice(chunk.voltage_v);
            self.current_a.extend_from_slice(chunk.current_a);
            Ok(())
        }
    }

    fn bits(values: &[f32]) -> Vec<u32> {
        values.iter().map(|value| value.to_bits()).collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(128))]
        #[test]
        fn property_in_pieces_the_device_records_what_it_records_in_memory(
            watts in prop::collection::vec(prop_oneof![30 => 0.0_f32..60.0, 1 => Just(-1.0_f32), 1 => Just(2e4_f32)], 1..3000),
            spoilt in prop::bool::weighted(0.2),
            rates_hz in (prop_oneof![Just(1000.0), 300.0..5e4_f64], prop_oneof![Just(1000.0), Just(1e5), 2.0..9e4_f64]),
            start_s in prop_oneof![Just(0.0), -3.0..1e3_f64],
            low_pass_s in prop_oneof![Just(None), Just(Some(0.01))],
            noise in prop_oneof![Just(0.0), Just(0.01)],
            (packet_samples, packet_loss) in prop_oneof![Just((1, 0.0)), Just((7, 0.4)), Just((64, 0.9))],
            piece in prop_oneof![1_usize..40, 200..4000_usize],
        ) {
            let watts: Vec<f32> = if spoilt { watts } else { watts.iter().map(|w| w.clamp(0.0, 60.0)).collect() };
            let trace = Trace::new(vec![1.0; watts.len()], watts, rates_hz.0, start_s, Metadata::default()).unwrap();
            let device = Device::new(DeviceSpec {
                rate_hz: rates_hz.1, low_pass_s, current_noise_a: noise, packet_samples, packet_loss,
                current_range_a: [-4.0, 4.0], ..DeviceSpec::default()
            }).unwrap();
            let cut = SplitTrace(&trace, piece);
            match (resample(&device, &trace), device.resample_in_pieces(&cut)) {
                (Ok(whole), Ok(pieces)) => {
                    let mut all = All::default();
                    pieces.read_into(&mut all).unwrap();
                    prop_assert_eq!(bits(&all.voltage_v), bits(whole.trace.voltage_v()));
                    prop_assert_eq!(bits(&all.current_a), bits(whole.trace.current_a()));
                    prop_assert_eq!(all.lost, whole.trace.lost().iter().cloned().flatten().collect::<Vec<_>>());
                    prop_assert_eq!(pieces.header(), whole.trace.header());
                    prop_assert_eq!(pieces.energy_j, crate::energy::PowerIntegral::new(&whole.trace).total_j());
                    prop_assert_eq!(
                        (pieces.clipped_currents, pieces.clipped_voltages),
                        (whole.clipped_currents, whole.clipped_voltages)
                    );
                }
                (whole, pieces) => {
                    let said = pieces.map(|_| String::new()).unwrap_or_else(|error| error.to_string());
                    let says = whole.map(|_| String::new()).unwrap_or_else(|error| error.to_string());
                    prop_assert_eq!(said, says);
                }
            }
        }
    }
}
