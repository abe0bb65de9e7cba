//! Frames of a file of any length: one pass, in pieces, on all threads.
//!
//! The method is that of [`frames`](crate::frames) by the sum of squares or the normalized distance, to the
//! bit: a trace in memory is searched in the same way.

pub use crate::clock::{SampleClock, clock};
use crate::energy::FrameEnergy;
use crate::frames::{
    FinderMethod, Found, FrameSpan, MarkError, Marks, MatchPlan, Matched, Placement, Samples,
};
use crate::io::{ReadError, ReadOptions, RowBatch, Rows};
use crate::stats::PairSum;
use crate::trace::Metadata;
use rayon::prelude::*;
use std::path::Path;
use thiserror::Error;

/// Rows decoded at once: they are used again while they are in the second cache.
const BATCH_ROWS: usize = 1 << 16;

/// Frames of a file with their energies.
#[derive(Clone, Debug, PartialEq)]
pub struct Streamed {
    /// The frames.
    pub found: Found,
    /// Energies of the frames, in order.
    pub energies: Vec<FrameEnergy>,
    /// When samples were taken, and how many.
    pub clock: SampleClock,
    /// Energy of the whole trace, J.
    pub total_j: f64,
    /// The metadata of the file.
    pub metadata: Metadata,
}

/// Finds frames by the sum of squares, or by [`FinderMethod::Normalized`], and takes their energies. An
/// infinite `marks.end_s` stands for the end of the file.
///
/// # Errors
/// [`AnalysisError`] if the file cannot be read, its samples are not even or finite, or the marks are not in it.
pub fn find(
    path: &Path,
    options: &ReadOptions,
    marks: &Marks,
    method: FinderMethod,
) -> Result<Streamed, AnalysisError> {
    let clock = clock(path, options)?;
    let placement = marks.place_on(clock.start_s, clock.rate_hz, clock.samples.unwrap_or(u64::MAX >> 12))?;
    let windows = windows(path, options, &placement, marks, clock)?;
    let plan = MatchPlan::new(clock, placement, windows, marks, method);
    let rows = Rows::open(path, options)?;
    let mut file = InFile { rows, batch: RowBatch::default(), clock };
    let gathered = plan.gather(&mut file)?;
    file.rows.description.check_rows(path, gathered.samples)?;
    file.rows.description.check_end(path)?;
    let Matched { found, sums_w, clock, total_w } = plan.conclude(marks, gathered);
    let energy = |(span, sums): (&FrameSpan, &[PairSum])| FrameEnergy {
        start_s: span.start_s,
        end_s: span.end_s,
        energy_j: sums[1].minus(sums[0]) / clock.rate_hz,
        confidence: span.confidence,
        flags: span.flags,
    };
    let energies = found.frames.par_iter().zip(sums_w.par_windows(2)).map(energy).collect();
    let total_j = total_w.value() / clock.rate_hz;
    Ok(Streamed { found, energies, clock, total_j, metadata: file.rows.description.metadata })
}

/// Why a file could not be analysed.
#[derive(Debug, Error)]
pub enum AnalysisError {
    /// The file.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The marks.
    #[error(transparent)]
    Mark(#[from] MarkError),
}

/// The samples of a file.
struct InFile {
    rows: Rows,
    batch: RowBatch,
    clock: SampleClock,
}

impl Samples for InFile {
    type Error = ReadError;

    fn append(
        &mut self,
        from: u64,
        voltage_v: &mut Vec<f32>,
        current_a: &mut Vec<f32>,
    ) -> Result<usize, ReadError> {
        let read = self.rows.append(BATCH_ROWS, &mut self.batch, voltage_v, current_a)?;
        if read > 0 {
            self.clock.check(self.rows.path(), &self.batch.stamps, from)?;
        }
        Ok(read)
    }

    fn check_finite(&self, from: u64, voltage_v: &[f32], current_a: &[f32]) -> Result<(), ReadError> {
        self.rows.check_finite(voltage_v, current_a, from)
    }
}

/// The powers (W) about the marks, read by themselves.
fn windows(
    path: &Path,
    options: &ReadOptions,
    placement: &Placement,
    marks: &Marks,
    clock: SampleClock,
) -> Result<Vec<Vec<f64>>, AnalysisError> {
    let mut windows = Vec::new();
    for (placed, &mark_s) in placement.marks.iter().zip(&marks.starts_s) {
        let mut rows = Rows::open(path, options)?;
        rows.skip(placed.first as u64)?;
        let (mut batch, mut voltage_v, mut current_a) = (RowBatch::default(), Vec::new(), Vec::new());
        while voltage_v.len() < placement.samples {
            let missing = placement.samples - voltage_v.len();
            if rows.append(missing, &mut batch, &mut voltage_v, &mut current_a)? == 0 {
                let end_s = clock.time_s((placed.first + voltage_v.len()) as f64);
                return Err(MarkError::OutsideTrace { mark_s, start_s: clock.start_s, end_s }.into());
            }
        }
        windows.push(voltage_v.iter().zip(&current_a).map(|(&v, &i)| f64::from(v) * f64::from(i)).collect());
    }
    Ok(windows)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::CurveBuilder;
    use crate::device::{Device, DeviceSpec};
    use crate::energy::PowerIntegral;
    use crate::frames::{FinderOptions, Window, default_window, find_with};
    use crate::io::parquet;
    use crate::trace::Trace;

    /// Frames whose length and content vary, over more than one piece.
    fn trace(frames: u32) -> Trace {
        let mut builder = CurveBuilder::new(0.0).unwrap();
        builder.push(0.05, 5.0).unwrap();
        for frame in 0..frames {
            for draw in 0..40_u32 {
                builder.push(2e-4 + 1e-7 * f64::from(frame % 17), 8.0 + f64::from(draw * 37 % 29)).unwrap();
            }
            builder.push(1.5e-3 + 1e-4 * f64::from(frame * 7 % 13), 5.0).unwrap();
        }
        builder.push(0.02, 5.0).unwrap();
        let curve = builder.build().unwrap();
        Device::new(DeviceSpec::default()).unwrap().sample(&curve, 0.0, curve.end_s()).unwrap().trace
    }

    #[test]
    fn oracle_streamed_frames_are_those_found_in_memory_and_add_up() {
        let trace = trace(3000);
        assert!(trace.samples() > 1 << 20);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("t.parquet");
        parquet::save(&trace, &path).unwrap();
        let window = default_window(0.01, trace.rate_hz());
        let found =
            find_with(&trace, &Marks::one(0.05, window, trace.end_s()), &FinderOptions::default()).unwrap();
        let marks = Marks {
            starts_s: vec![found.starts[100].time_s, found.starts[2000].time_s],
            window,
            end_s: f64::INFINITY,
        };
        let in_memory = Marks { end_s: trace.end_s(), ..marks.clone() };
        let expected = find_with(
            &trace,
            &in_memory,
            &FinderOptions { method: FinderMethod::SumOfSquares, without: None },
        )
        .unwrap();
        let streamed = find(&path, &ReadOptions::default(), &marks, FinderMethod::SumOfSquares).unwrap();
        assert_eq!(streamed.found.starts.len(), expected.starts.len());
        assert!((streamed.found.threshold.value_w2 / expected.threshold.value_w2 - 1.0).abs() < 1e-2);
        let integral = PowerIntegral::new(&trace);
        for (ours, theirs) in streamed.energies.iter().zip(integral.frames(&expected)) {
            assert!((ours.start_s - theirs.start_s).abs() < 1e-8, "{ours:?} {theirs:?}");
            assert!(
                (ours.energy_j - integral.energy_j(ours.start_s, ours.end_s)).abs() < 1e-10 * ours.energy_j
            );
            assert_eq!(ours.flags, theirs.flags);
        }
        let sum: f64 = streamed.energies.iter().map(|frame| frame.energy_j).sum();
        let whole = integral.energy_j(streamed.energies[0].start_s, trace.end_s());
        assert!((sum / whole - 1.0).abs() < 1e-12);
        assert!((streamed.total_j / integral.total_j() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn the_same_for_one_thread_and_for_several() {
        let trace = trace(500);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("t.parquet");
        parquet::save(&trace, &path).unwrap();
        let marks = Marks::one(0.05, default_window(0.01, trace.rate_hz()), f64::INFINITY);
        let on = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| find(&path, &ReadOptions::default(), &marks, FinderMethod::SumOfSquares).unwrap())
        };
        assert!(on(1) == on(3));
    }

    #[test]
    fn a_mark_in_the_rest_between_frames_is_reported_as_in_memory() {
        let trace = trace(300);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("t.parquet");
        parquet::save(&trace, &path).unwrap();
        let warned = |mark_s: f64, window: Window| {
            let marks = Marks::one(mark_s, window, trace.end_s());
            let options = FinderOptions { method: FinderMethod::SumOfSquares, without: None };
            let [ours, theirs] = [
                find(&path, &ReadOptions::default(), &marks, FinderMethod::SumOfSquares).unwrap().found,
                find_with(&trace, &marks, &options).unwrap(),
            ]
            .map(|found| found.warnings.into_iter().find(|warning| warning.code == "flat-mark"));
            assert_eq!(ours, theirs);
            ours.is_some()
        };
        // Before the first frame there is idle power alone.
        assert!(warned(0.02, Window { pre_s: 5e-3, post_s: 20e-3 }));
        assert!(!warned(0.05, default_window(0.01, trace.rate_hz())));
    }
}
