//! One stream at every level: error against the reference, host time, and the cost of timing added to
//! drawing. Streams made to break levels, and rates from outside.

use std::collections::BTreeMap;

use activity::{Event, PacketBuffer, Timeline, Unit};
use cpu_time::{ProcessTime, ThreadTime};
use power_model::{Bound, EnergyTable, FramePower, Platform, PowerModel};
use run::{GpuSpec, RunError, cheapest_level};
use serde::Serialize;
use timing::stepped::{self, StepOptions, Stream};
use timing::{
    Checked, CheckedClock, Clocks, DemandBuilder, Level, PacketClock, Recorder, SliceWriter, Slices, Timed,
    TimingError, Totals, bound, streams,
};

use super::Reference;
use super::animations::{Subject, SubjectKind};

/// Bins of a microsecond, as in a run.
const BIN_PS: u64 = 1_000_000;
const MAX_BINS: usize = 1 << 20;
/// Fast levels are timed several times, and the fastest counts.
const TIMES: usize = 5;

/// A level on a stream.
#[derive(Clone, Debug, Serialize)]
pub struct TimingRow {
    /// The scene, family or workload.
    pub scene: String,
    /// Kind of the scene; `None` for a stream that no pipeline emitted.
    pub kind: Option<SubjectKind>,
    /// The GPU.
    pub gpu: String,
    /// The level.
    pub level: Level,
    /// Packets of the stream.
    pub packets: usize,
    /// Cycles of the frame.
    pub cycles: u64,
    /// Cycles of the frame by the reference.
    pub stepped_cycles: u64,
    /// Relative error of the cycles.
    pub cycle_error_percent: f64,
    /// Relative error of the energy of the frame.
    pub energy_error_percent: f64,
    /// Error of the busy time of the unit that is worst, over the time of the frame.
    pub busy_error_percent: f64,
    /// Relative error of the bytes to and from memory.
    pub dram_error_percent: f64,
    /// RMS of the difference of power over mean power, at 50 kHz.
    pub power_shape_error_percent: f64,
    /// The same at 1 us.
    pub power_shape_error_1us_percent: f64,
    /// The unit that the reference finds busiest over the frame, and its share.
    pub busiest: (&'static str, f64),
    /// What the check of the level finds.
    pub checked_percent: f64,
    /// Whether a run at this level would warn of it.
    pub warns: bool,
    /// Seconds of the host's processor, timing alone: the stream is written.
    pub cpu_s: f64,
    /// Seconds of the host's processor to turn packets into service demands, once for all levels.
    pub written_s: f64,
    /// Seconds of the host for the reference over these.
    pub speedup_over_stepped: f64,
}

/// Speed of the reference.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Speed {
    unit_cycles: u64,
    cycles: u64,
    cpu_s: f64,
}

impl Speed {
    pub fn figures(&self) -> Reference {
        let per_s = |count: u64| count as f64 / self.cpu_s.max(1e-12);
        Reference {
            unit_cycles_per_s: per_s(self.unit_cycles),
            cycles_per_s: per_s(self.cycles),
            cpu_s: self.cpu_s,
        }
    }
}

/// The power model of a GPU on the platform of the reference GPU, scaled to its hardware.
pub(in crate::chart) fn power_model(gpu: &GpuSpec) -> Result<PowerModel, RunError> {
    let platform = Platform::builtin("reference")?;
    let scaling = run::scaling(gpu, &platform)?;
    Ok(PowerModel::on(&EnergyTable::builtin("28nm")?, &platform, Bound::Nominal, &scaling)?)
}

/// A row for each level but the reference.
pub(super) fn rows(
    (scene, kind): (&str, Option<SubjectKind>),
    gpu: &GpuSpec,
    stream: &PacketBuffer,
    speed: &mut Speed,
) -> Result<Vec<TimingRow>, RunError> {
    let model = power_model(gpu)?;
    let power = |timed: &Timed| {
        model.frame(&timed.timeline).map_err(|source| RunError::Timeline { frame: 0, source })
    };
    let written = Written::new(gpu, stream)?;
    let (truth, stepped_s) = timed(Level::Stepped, gpu, &written)?;
    speed.unit_cycles += truth.unit_cycles;
    speed.cycles += truth.cycles;
    speed.cpu_s += stepped_s;
    let true_power = power(&truth)?;
    let mut rows = Vec::new();
    for level in Level::ALL.into_iter().filter(|&level| level != Level::Stepped) {
        let (found, mut cpu_s) = timed(level, gpu, &written)?;
        for _ in 1..TIMES {
            cpu_s = cpu_s.min(timed(level, gpu, &written)?.1);
        }
        let (found_power, check) = (power(&found)?, written.check(level, gpu, found.cycles)?);
        rows.push(TimingRow {
            scene: scene.to_owned(),
            kind,
            gpu: gpu.name.clone(),
            level,
            packets: stream.len(),
            cycles: found.cycles,
            stepped_cycles: truth.cycles,
            cycle_error_percent: percent(found.cycles as f64, truth.cycles as f64),
            energy_error_percent: percent(found_power.energy().total_j(), true_power.energy().total_j()),
            busy_error_percent: busy_error(&found.timeline, &truth.timeline),
            dram_error_percent: percent(dram(&found.timeline), dram(&truth.timeline)),
            power_shape_error_percent: shape_error(&found_power, &true_power, 20e-6),
            power_shape_error_1us_percent: shape_error(&found_power, &true_power, 1e-6),
            busiest: busiest(&truth.timeline),
            checked_percent: 100.0 * check.map_or(0.0, |check| check.error),
            warns: check.is_some_and(Checked::is_far),
            cpu_s,
            written_s: written.cpu_s,
            speedup_over_stepped: stepped_s / cpu_s,
        });
    }
    Ok(rows)
}

/// A frame's packets as service demands of one machine, written once for all levels.
pub(in crate::chart) struct Written {
    clocks: Clocks,
    builder: DemandBuilder,
    stream: Stream,
    totals: Totals,
    slices: Slices,
    cpu_s: f64,
}

impl Written {
    pub fn new(gpu: &GpuSpec, packets: &PacketBuffer) -> Result<Self, RunError> {
        let clocks = gpu.clocks().ok_or_else(|| TimingError::Clocks(gpu.name.clone()))?;
        let started = ThreadTime::now();
        let mut builder = DemandBuilder::new(&gpu.units);
        let (mut stream, mut totals) = (Stream::default(), Totals::new(&gpu.units, &clocks));
        for (packet, lines) in packets.iter() {
            stream.push(&mut builder, packet, lines);
            stream.add_last(&builder, &mut totals);
        }
        let cpu_s = started.elapsed().as_secs_f64();
        let mut slices = SliceWriter::default();
        packets.iter().for_each(|(packet, lines)| slices.push(packet, lines));
        Ok(Self { clocks, builder, stream, totals, slices: slices.finish(), cpu_s })
    }

    /// The check of a level by which the frame takes so many cycles.
    pub fn check(&self, level: Level, gpu: &GpuSpec, cycles: u64) -> Result<Option<Checked>, RunError> {
        Ok(self.slices.check(level, gpu.machine()?, cycles))
    }
}

/// The frame at a level, and the host's seconds for it: timing alone, as the stream is written.
pub(in crate::chart) fn timed(
    level: Level,
    gpu: &GpuSpec,
    written: &Written,
) -> Result<(Timed, f64), RunError> {
    let Written { clocks, builder, stream, totals, .. } = written;
    let started = ThreadTime::now();
    let recorder = Recorder::new(BIN_PS, MAX_BINS);
    let timed = match level {
        Level::Stepped => {
            stepped::run(&gpu.units, *clocks, builder, stream, recorder, &StepOptions::default())
                .map_err(TimingError::from)?
        }
        Level::Packet => PacketClock::new(&gpu.units, *clocks, recorder).run(stream),
        Level::Bound => bound(&gpu.units, *clocks, totals, recorder),
    };
    Ok((timed, started.elapsed().as_secs_f64()))
}

fn percent(found: f64, truth: f64) -> f64 {
    if found == truth { 0.0 } else { (found / truth - 1.0) * 100.0 }
}

fn dram(timeline: &Timeline) -> f64 {
    let total = timeline.total();
    (total[Event::DramReadBytes] + total[Event::DramWriteBytes]) as f64
}

fn busy_error(found: &Timeline, truth: &Timeline) -> f64 {
    let pairs = found.busy_ps().into_iter().zip(truth.busy_ps());
    pairs.map(|(a, b)| a.abs_diff(b) as f64 / truth.duration_ps as f64 * 100.0).fold(0.0, f64::max)
}

fn busiest(timeline: &Timeline) -> (&'static str, f64) {
    let busy = timeline.busy_ps();
    let unit = Unit::ALL.into_iter().max_by_key(|&unit| busy[unit as usize]).unwrap_or(Unit::Command);
    (unit.name(), busy[unit as usize] as f64 / timeline.duration_ps as f64)
}

/// Root mean square of the difference of power, each sample the mean over `step_s`, over the mean power of the truth.
fn shape_error(found: &FramePower, truth: &FramePower, step_s: f64) -> f64 {
    let steps = (found.duration_s().max(truth.duration_s()) / step_s).ceil().max(1.0) as usize;
    let (a, b) = (sampled(found, step_s, steps), sampled(truth, step_s, steps));
    let square: f64 = a.iter().zip(&b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>() / steps as f64;
    square.sqrt() / (b.iter().sum::<f64>() / steps as f64) * 100.0
}

fn sampled(power: &FramePower, step_s: f64, steps: usize) -> Vec<f64> {
    let mut joules = vec![0.0; steps];
    let mut from_s = 0.0;
    for (length_s, watts) in power.bins() {
        let watts: f64 = watts.iter().sum();
        let to_s = from_s + length_s;
        let mut at = ((from_s / step_s) as usize).min(steps - 1);
        while at < steps && at as f64 * step_s < to_s {
            let overlap = to_s.min((at + 1) as f64 * step_s) - from_s.max(at as f64 * step_s);
            joules[at] += watts * overlap.max(0.0);
            at += 1;
        }
        from_s = to_s;
    }
    joules.into_iter().map(|joules| joules / step_s).collect()
}

/// Each is measured so often, and the fastest counts.
const ADDED_TIMES: usize = 3;

/// A frame drawn, and drawn with a clock. Seconds of the host's processor, all threads together.
#[derive(Clone, Debug, Serialize)]
pub struct AddedRow {
    /// The scene.
    pub scene: String,
    /// The GPU.
    pub gpu: String,
    /// The level.
    pub level: Level,
    /// To draw the frame, its packets to nobody.
    pub drawn_s: f64,
    /// To draw it, its packets to the clock of the level.
    pub timed_s: f64,
    /// Time that the clock adds.
    pub added_percent: f64,
}

/// A frame at the levels that are cheap.
pub(super) fn added(subject: &Subject, gpu: &GpuSpec) -> Result<Vec<AddedRow>, RunError> {
    let drawn_s = fastest(|| subject.render(gpu, |_, _| {}))?;
    let row = |level| {
        let timed_s = fastest(|| {
            let mut clock = CheckedClock::new(level, gpu.machine()?, Recorder::new(BIN_PS, MAX_BINS));
            subject.render(gpu, |packet, lines| clock.push(packet, lines))?;
            clock.finish()?;
            Ok(())
        })?;
        let added_percent = (timed_s / drawn_s - 1.0) * 100.0;
        let (scene, gpu) = (subject.name().to_owned(), gpu.name.clone());
        Ok(AddedRow { scene, gpu, level, drawn_s, timed_s, added_percent })
    };
    [Level::Packet, Level::Bound].into_iter().map(row).collect()
}

/// Processor seconds of the fastest of some times.
fn fastest(mut work: impl FnMut() -> Result<(), RunError>) -> Result<f64, RunError> {
    let mut least = f64::INFINITY;
    for _ in 0..ADDED_TIMES {
        let started = ProcessTime::now();
        work()?;
        least = least.min(started.elapsed().as_secs_f64());
    }
    Ok(least)
}

/// The GPU of the class of the card whose rates are known.
const CARD: &str = "discrete";
/// Values of `--accuracy` in the chart.
const ASKED_PERCENT: [f64; 3] = [1.0, 5.0, 20.0];
/// Triangles of a batch: few, so that the front end and the tiles take turns.
const BATCH: u32 = 512;

/// A stream on a GPU.
#[derive(Clone, Debug, Serialize)]
pub struct FailureRow {
    /// The property that breaks a level.
    pub stream: &'static str,
    /// The GPU.
    pub gpu: String,
    /// Cycles by the reference.
    pub stepped_cycles: u64,
    /// The other levels by name.
    pub levels: BTreeMap<&'static str, FailedLevel>,
    /// Levels that `--accuracy` would choose.
    pub chosen: Vec<Chosen>,
}

/// The level that is chosen where so many percent are requested.
#[derive(Clone, Debug, Serialize)]
pub struct Chosen {
    /// Requested error, percent.
    pub asked_percent: f64,
    /// The cheapest level within it.
    pub level: Level,
}

/// A level on such a stream.
#[derive(Clone, Debug, Serialize)]
pub struct FailedLevel {
    /// Relative error of the cycles.
    pub cycle_error_percent: f64,
    /// Relative error of the energy.
    pub energy_error_percent: f64,
    /// What the check of the level finds.
    pub checked_percent: f64,
    /// Whether a run would warn of it.
    pub warns: bool,
}

/// A rate by a microbenchmark that requests nothing else, in units of 1e9 a second.
#[derive(Clone, Debug, Serialize)]
pub struct RateRow {
    /// The work that the rate counts.
    pub rate: &'static str,
    /// One of it, over a second.
    pub unit: &'static str,
    /// Rate by each level.
    pub giga_per_s: BTreeMap<&'static str, f64>,
    /// Rate of a graphics card of 2012, listed by its maker or measured.
    pub card: &'static str,
}

fn buffered(packets: &streams::Packets) -> PacketBuffer {
    packets.iter().map(|(packet, lines)| (packet, &lines[..])).collect()
}

/// Every stream on every GPU of `gpus`.
pub(super) fn failures(gpus: &[GpuSpec]) -> Result<Vec<FailureRow>, RunError> {
    let cases: Vec<_> = gpus.iter().map(|gpu| streams::failures(&gpu.units, BATCH)).collect();
    let mut failures = Vec::new();
    for stream in 0..cases.iter().map(Vec::len).max().unwrap_or(0) {
        for (gpu, case) in gpus.iter().zip(&cases).filter_map(|(gpu, cases)| Some((gpu, cases.get(stream)?)))
        {
            let mut gpu = GpuSpec { units: case.units.clone(), ..gpu.clone() };
            gpu.pipeline.batch_triangles = BATCH;
            let packets = buffered(&case.packets);
            failures
                .push(failure(case.name, rows((case.name, None), &gpu, &packets, &mut Speed::default())?));
        }
    }
    Ok(failures)
}

fn failure(stream: &'static str, found: Vec<TimingRow>) -> FailureRow {
    let error = |level: Level| {
        let row = found.iter().find(|row| row.level == level);
        row.map_or(0.0, |row| row.cycle_error_percent.abs().max(row.energy_error_percent.abs()))
    };
    let chosen = |percent| Chosen { asked_percent: percent, level: cheapest_level(error, percent) };
    let level = |row: &TimingRow| FailedLevel {
        cycle_error_percent: row.cycle_error_percent,
        energy_error_percent: row.energy_error_percent,
        checked_percent: row.checked_percent,
        warns: row.warns,
    };
    FailureRow {
        stream,
        gpu: found.first().map_or_else(String::new, |row| row.gpu.clone()),
        stepped_cycles: found.first().map_or(0, |row| row.stepped_cycles),
        levels: found.iter().map(|row| (row.level.name(), level(row))).collect(),
        chosen: ASKED_PERCENT.map(chosen).into(),
    }
}

/// Every rate of the large GPU.
pub(super) fn rates() -> Result<Vec<RateRow>, RunError> {
    let gpu = GpuSpec::load(CARD)?;
    let card = |name: &str| match name {
        name if name.contains("nothing to memory") => "29.6 listed",
        name if name.contains("blended") => "13.3 measured",
        "triangles" => "1.85 listed",
        "texels" => "118.4 listed",
        _ => "264 listed",
    };
    let row = |rate: streams::Rate| {
        let written = Written::new(&gpu, &buffered(&rate.packets))?;
        let mut giga_per_s = BTreeMap::new();
        for level in Level::ALL {
            let (timed, _) = timed(level, &gpu, &written)?;
            giga_per_s.insert(level.name(), rate.amount / timed.timeline.duration_s() / 1e9);
        }
        Ok(RateRow { rate: rate.name, unit: rate.unit, giga_per_s, card: card(rate.name) })
    };
    streams::rates().into_iter().map(row).collect()
}
