//! The files of a run.

use traces::energy::{ExtraColumn, FrameEnergy, FrameTable};
use traces::score::{TOLERANCE_S, truth_beside};

use super::frame::image_name;
use super::heat::heat_name;
use super::{FIGURES, FrameRow, Outcome, Plan, RunError, pictures, report, timeline};
use output::dir::{Claim, OutDir, SUMMARY};
use output::perfetto;
use output::progress::Progress;

/// The files that a run may write.
pub(super) fn claim(plan: &Plan) -> Claim {
    let ends: &[&str] = if plan.options.exr { &["png", "exr"] } else { &["png"] };
    let frames = || plan.work.settings().frames.clone();
    let images =
        frames().flat_map(|frame| ends.iter().map(move |end| format!("{}.{end}", image_name(frame))));
    let maps = plan.options.heat.iter().flat_map(|&event| frames().map(move |frame| heat_name(event, frame)));
    let heat = maps.flat_map(|name| ["png", "exr", "csv"].map(|end| format!("{name}.{end}")));
    let figures = FIGURES.map(|(figure, _)| figure).into_iter().chain(["stalls"]);
    Claim::new("run")
        .files(images.chain(heat))
        .plots(figures.map(|figure| format!("plots/{figure}")))
        .files(["trace.parquet", "trace.csv", "trace.json", "frames.csv"])
        .files(["timeline.perfetto-trace", "report.html", SUMMARY])
}

/// Writes everything but the images, which are there already.
pub(super) fn write(outcome: &Outcome, dir: &OutDir, progress: &Progress) -> Result<(), RunError> {
    let bar = progress.bar("files", 4);
    let trace = &outcome.measurement.trace;
    dir.write_file("trace.parquet", |out| Ok(traces::io::parquet::write(trace, out)?))?;
    dir.write_file("trace.csv", |out| Ok(traces::io::csv::write(trace, out)?))?;
    dir.write_file("trace.json", |out| Ok(traces::io::csv::write_sidecar(trace, out)?))?;
    bar.inc();
    write_frames(outcome, dir)?;
    let process = format!("quintile {} on {}", outcome.plan.work.name(), outcome.plan.gpu.name);
    let timeline = timeline::timeline(outcome, &process);
    dir.write_file("timeline.perfetto-trace", |out| Ok(perfetto::write(&timeline, out)?))?;
    bar.inc();
    let plots = pictures::plots(outcome);
    for plot in &plots {
        plot.picture.write(dir, plot.stem)?;
    }
    bar.inc();
    report::report(outcome, &plots)?.write(dir, "report.html")?;
    bar.inc();
    Ok(dir.write_json(SUMMARY, &outcome.summary)?)
}

fn write_frames(outcome: &Outcome, dir: &OutDir) -> Result<(), RunError> {
    let measurement = &outcome.measurement;
    let truth = truth_beside(&measurement.frames, &measurement.truth, TOLERANCE_S);
    let table = FrameTable::new(measurement.frames.clone(), Some(outcome.plan.pixels()))
        .with_truth(truth)?
        .with_columns(predictions(outcome))?;
    dir.write_file("frames.csv", |out| Ok(table.write_csv(out)?))?;
    Ok(())
}

/// Of a run with predicted frames: which ones these are, and the ends of the intervals of their energies.
fn predictions(outcome: &Outcome) -> Vec<ExtraColumn> {
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
