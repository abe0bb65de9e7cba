//! The files of a run. `summary.json` comes last: where it is, all is there.

use traces::energy::FrameTable;
use traces::score::{TOLERANCE_S, truth_beside};

use super::{Outcome, RunError, pictures, report, timeline};
use crate::output::dir::OutDir;
use crate::output::perfetto;
use crate::output::progress::Progress;

/// Writes everything but the images, which are there already.
pub(super) fn write(outcome: &Outcome, dir: OutDir, progress: &Progress) -> Result<(), RunError> {
    let bar = progress.bar("files", 4);
    let trace = &outcome.measurement.trace;
    dir.write_atomic("trace.parquet", |out| Ok(traces::io::parquet::write(trace, out)?))?;
    dir.write_atomic("trace.csv", |out| Ok(traces::io::csv::write(trace, out)?))?;
    dir.write_atomic("trace.json", |out| Ok(traces::io::csv::write_sidecar(trace, out)?))?;
    bar.inc();
    write_frames(outcome, &dir)?;
    let process = format!("quintile {} on {}", outcome.plan.scene.name(), outcome.plan.gpu.name);
    let timeline = timeline::timeline(outcome, &process);
    dir.write_atomic("timeline.perfetto-trace", |out| Ok(perfetto::write(&timeline, out)?))?;
    bar.inc();
    let plots = pictures::plots(outcome);
    for plot in &plots {
        plot.picture.write(&dir, plot.stem)?;
    }
    bar.inc();
    report::report(outcome, &plots)?.write(&dir, "report.html")?;
    bar.inc();
    dir.complete(|out| {
        serde_json::to_writer_pretty(&mut *out, &outcome.summary)?;
        Ok(writeln!(out)?)
    })?;
    Ok(())
}

fn write_frames(outcome: &Outcome, dir: &OutDir) -> Result<(), RunError> {
    let measurement = &outcome.measurement;
    let truth = truth_beside(&measurement.frames, &measurement.truth, TOLERANCE_S);
    let table = FrameTable::new(measurement.frames.clone(), Some(outcome.plan.pixels())).with_truth(truth)?;
    dir.write_atomic("frames.csv", |out| Ok(table.write_csv(out)?))?;
    Ok(())
}
