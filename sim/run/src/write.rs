//! Files of a run.

use activity::{Packet, S_PER_PS, Unit};
use output::dir::{Claim, OutDir, SUMMARY};
use output::terminal::Progress;
use power_model::Part;
use timing::{DrawSpan, PassTime};
use traces::energy::{ExtraColumn, FrameEnergy, FrameTable, TOLERANCE_S, truth_beside};
use traces::io::perfetto::{
    self, CounterTrack, FrameSlice, MAX_SLICES, PassSpan, PerfettoTimeline, UnitTrack, slices_of_bins,
};

use crate::frame::image_name;
use crate::passes::{WRITE_BACK, stall_tracks, take_turns};
use crate::{FIGURES, FinishedRun, FrameRow, Observed, Plan, RunError, report};

/// Files that a run may write.
pub(super) fn claim(plan: &Plan) -> Claim {
    let ends: &[&str] = if plan.options.exr { &["png", "exr"] } else { &["png"] };
    let frames = || plan.job.settings().frames.clone();
    let images =
        frames().flat_map(|frame| ends.iter().map(move |end| format!("{}.{end}", image_name(frame))));
    let maps = plan.options.heat.iter().flat_map(|of| frames().map(move |frame| of.path(frame)));
    let heat = maps.flat_map(|name| ["png", "exr", "csv"].map(|end| format!("{name}.{end}")));
    let figures = FIGURES.map(|(figure, _)| figure).into_iter();
    let changed = plan.changed.iter().map(|changed| changed.file.result());
    Claim::new("run")
        .files(changed)
        .files(images.chain(heat))
        .plots(figures.map(|figure| format!("plots/{figure}")))
        .files(["trace.parquet", "trace.csv", "trace.json", "frames.csv"])
        .files(["timeline.perfetto-trace", "report.html", SUMMARY])
}

/// Writes all files except images, which the simulation has written.
pub(super) fn write(outcome: &FinishedRun, dir: &OutDir, progress: &Progress) -> Result<(), RunError> {
    let bar = progress.bar("files", 4);
    let trace = &outcome.measurement.trace;
    dir.write_file("trace.parquet", |out| Ok(traces::io::parquet::write(trace, out)?))?;
    dir.write_file("trace.csv", |out| Ok(traces::io::csv::write(trace, out)?))?;
    dir.write_file("trace.json", |out| Ok(traces::io::csv::write_sidecar(trace, out)?))?;
    bar.inc();
    for changed in &outcome.plan.changed {
        dir.write_file(changed.file.result(), |out| Ok(out.write_all(changed.text.as_bytes())?))?;
    }
    write_frames(outcome, dir)?;
    let process = format!("quintile {} on {}", outcome.plan.name, outcome.plan.gpu.name);
    let timeline = timeline(outcome, &process);
    dir.write_file("timeline.perfetto-trace", |out| Ok(perfetto::write(&timeline, out)?))?;
    bar.inc();
    let plots = report::plots(outcome);
    for plot in &plots {
        plot.picture.write(dir, plot.stem)?;
    }
    bar.inc();
    report::report(outcome, &plots)?.write(dir, "report.html")?;
    bar.inc();
    Ok(dir.write_json(SUMMARY, &outcome.summary)?)
}

fn write_frames(outcome: &FinishedRun, dir: &OutDir) -> Result<(), RunError> {
    let measurement = &outcome.measurement;
    let truth = truth_beside(&measurement.frames, &measurement.truth, TOLERANCE_S);
    let table = FrameTable::new(measurement.frames.clone(), Some(outcome.plan.pixels()))
        .with_truth(truth)?
        .with_columns(predictions(outcome))?;
    dir.write_file("frames.csv", |out| Ok(table.write_csv(out)?))?;
    Ok(())
}

/// Columns of a sampled run: whether a frame is predicted, and the ends of its energy interval.
fn predictions(outcome: &FinishedRun) -> Vec<ExtraColumn> {
    if outcome.simulated.sampled.is_none() {
        return Vec::new();
    }
    let measurement = &outcome.measurement;
    let by_truth = measurement.by_true_frame();
    let row = |found: &FrameEnergy| {
        let truth = by_truth.iter().position(|matched| *matched == Some(found))?;
        Some(&outcome.summary.frames[truth])
    };
    let rows: Vec<Option<&FrameRow>> = measurement.frames.iter().map(row).collect();
    let column = |name, cell: &dyn Fn(&FrameRow) -> String| {
        let cells = rows.iter().map(|row| row.map_or_else(String::new, cell)).collect();
        ExtraColumn { name, cells }
    };
    let end = |row: &FrameRow, end: usize| {
        row.energy_interval_j.map_or(String::new(), |ends| ends[end].to_string())
    };
    vec![
        column("predicted", &|row| u8::from(row.predicted).to_string()),
        column("predicted_energy_low_J", &|row| end(row, 0)),
        column("predicted_energy_high_J", &|row| end(row, 1)),
    ]
}

const NS: f64 = 1e9;

/// Timeline for the Perfetto viewer: frames, units in use, total power and power by part.
fn timeline<'a>(outcome: &'a FinishedRun, process: &'a str) -> PerfettoTimeline<'a> {
    let total = outcome.simulated.total();
    let units = Unit::ALL
        .into_iter()
        .filter(|&unit| total.uses(unit))
        .map(|unit| unit_track(outcome, unit))
        .collect();
    let energy = outcome.measurement.run.energy();
    let parts = Part::ALL.into_iter().filter(|part| energy[*part] > 0.0);
    let starts: Vec<u64> = outcome.measurement.run.frames.iter().map(|paced| ns(paced.start_s)).collect();
    let power = std::iter::once(total_power(outcome)).chain(parts.map(|part| part_power(outcome, part)));
    let counters = power.chain(stall_tracks(&outcome.simulated, &starts)).collect();
    PerfettoTimeline { process, frames: frames(outcome), units, counters }
}

fn ns(time_s: f64) -> u64 {
    (time_s * NS).round() as u64
}

fn frames(outcome: &FinishedRun) -> Vec<FrameSlice> {
    let frames = outcome.simulated.in_order().zip(&outcome.summary.frames);
    let most = MAX_SLICES / outcome.summary.frames.len().max(1);
    outcome
        .measurement
        .run
        .frames
        .iter()
        .zip(frames)
        .map(|(paced, (frame, row))| FrameSlice {
            passes: frame.observed().map_or(Vec::new(), |observed| passes(observed, paced.start_s, most)),
            frame: u64::from(row.frame),
            start_ns: ns(paced.start_s),
            busy_end_ns: ns(paced.busy_end_s),
            end_ns: ns(paced.end_s),
            numbers: vec![
                ("energy_mJ", row.energy_j * 1e3),
                ("energy_nJ_per_pixel", row.energy_per_pixel_j * 1e9),
                ("power_W", row.power_w),
            ],
        })
        .collect()
}

/// Passes of a frame that starts at `start_s`, each from the end of the one before, with their draws; no
/// passes or draws if there are more than `most`.
fn passes(observed: &Observed, start_s: f64, most: usize) -> Vec<PassSpan> {
    if observed.times.len() > most {
        return Vec::new();
    }
    let at = |ps: u64| ns(start_s + ps as f64 * S_PER_PS);
    let mut before_ps = 0;
    let span = |((name, time), number): ((&str, &PassTime), u32)| {
        let start_ps = std::mem::replace(&mut before_ps, time.end_ps);
        let ends_ns = [start_ps, time.end_ps].map(at);
        let name = name.to_owned();
        let parts = draws(observed, number, ends_ns, (at, most));
        PassSpan { name, start_ns: ends_ns[0], end_ns: ends_ns[1], parts }
    };
    let names = observed.report.passes.iter().map(|pass| pass.name.as_str()).chain([WRITE_BACK]);
    let spans = names.zip(&observed.times).zip(0..).map(span);
    spans.filter(|span| span.start_ns < span.end_ns).collect()
}

/// Draws of pass number `pass`, which lasts so long. If they take turns they are one slice, which says so.
fn draws(
    observed: &Observed,
    pass: u32,
    [start_ns, end_ns]: [u64; 2],
    (at, most): (impl Fn(u64) -> u64, usize),
) -> Vec<PassSpan> {
    let count = observed.report.passes.get(pass as usize).map_or(0, |pass| pass.draws.len());
    if count < 2 || observed.times.iter().all(|time| time.draws_ps.is_empty()) {
        return Vec::new();
    }
    if observed.spans.is_empty() || observed.spans.len() > most || take_turns(&observed.spans) {
        let name = format!("{count} draws, in no order of time");
        return vec![PassSpan { name, start_ns, end_ns, parts: Vec::new() }];
    }
    let mut before_ps = 0;
    let span = |span: &DrawSpan| {
        let ends_ps = [std::mem::replace(&mut before_ps, span.end_ps), span.end_ps];
        let [start_ns, end_ns] = ends_ps.map(|ps| at(ps).clamp(start_ns, end_ns));
        let is_shown = span.pass == pass && span.draw != Packet::NONE && start_ns < end_ns;
        is_shown.then(|| PassSpan {
            name: format!("draw {}", span.draw),
            start_ns,
            end_ns,
            parts: Vec::new(),
        })
    };
    observed.spans.iter().filter_map(span).collect()
}

fn unit_track(outcome: &FinishedRun, unit: Unit) -> UnitTrack<'static> {
    let limit = (MAX_SLICES / outcome.simulated.frames.len().max(1)).max(1);
    let slices = outcome
        .measurement
        .run
        .frames
        .iter()
        .zip(outcome.simulated.in_order())
        .flat_map(|(paced, frame)| {
            let busy: Vec<f64> = frame.busy.iter().map(|shares| f64::from(shares[unit as usize])).collect();
            slices_of_bins(ns(paced.start_s), frame.power.bin_s() * NS, &busy, limit)
        })
        .collect();
    UnitTrack { name: unit.name(), doc: unit.doc(), slices }
}

fn total_power(outcome: &FinishedRun) -> CounterTrack<'static> {
    let curve = &outcome.measurement.run.curve;
    let points = curve.edges_s().iter().zip(curve.watts()).map(|(&edge, &watts)| (ns(edge), watts)).collect();
    CounterTrack { name: "power, total", unit: "W", points }
}

fn part_power(outcome: &FinishedRun, part: Part) -> CounterTrack<'static> {
    let idle_w = outcome.plan.platform.idle_w.value();
    let between = if part == Part::Idle { idle_w } else { 0.0 };
    let mut points = vec![(0, between)];
    for (paced, frame) in outcome.measurement.run.frames.iter().zip(outcome.simulated.in_order()) {
        let mut at = paced.start_s;
        for (length_s, watts) in frame.power.bins() {
            points.push((ns(at), watts[part.index()]));
            at += length_s;
        }
        points.push((ns(paced.busy_end_s), between));
    }
    CounterTrack { name: part.name(), unit: "W", points }
}
