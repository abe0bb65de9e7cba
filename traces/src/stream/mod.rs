//! Frames of a file of any length: one pass, in pieces, on all threads.
//!
//! The method is the sum of squares of [`frames`](crate::frames), with the same minima and the same
//! threshold. Here, offsets are screened by a transform in f32; the distance of every minimum, its place
//! finer than a sample and the energy up to there are computed in f64 while its samples are in memory. No
//! step depends on the number of threads.

mod clock;
mod pass;
mod piece;
mod screen;

use crate::energy::FrameEnergy;
use crate::frames::{
    Found, FrameSpan, FrameStart, MarkError, Marks, Placed, Placement, Threshold, choose, conclude_at,
    confidence, flat_mark, misalignment_w2, noise_deviation, regularity, start_after_idle,
};
use crate::io::{ReadError, ReadOptions, Rows};
use crate::stats::{PairSum, upper_median};
use crate::trace::{Metadata, Trace};
pub use clock::{Clock, clock};
use pass::{Candidate, Gathered, Plan};
use rayon::prelude::*;
use std::path::Path;
use thiserror::Error;

/// Frames of a file with their energies.
#[derive(Clone, Debug, PartialEq)]
pub struct Streamed {
    /// The frames.
    pub found: Found,
    /// Their energies, in order.
    pub energies: Vec<FrameEnergy>,
    /// When samples were taken, and how many.
    pub clock: Clock,
    /// Energy of the whole trace, J.
    pub total_j: f64,
    /// The metadata of the file.
    pub metadata: Metadata,
}

/// Finds frames by the sum of squares and takes their energies. An infinite `marks.end_s` stands for the end
/// of the file.
///
/// # Errors
/// [`StreamError`] if the file cannot be read, its samples are not even or finite, or the marks are not in it.
pub fn find(path: &Path, options: &ReadOptions, marks: &Marks) -> Result<Streamed, StreamError> {
    let clock = clock(path, options)?;
    let plan = Plan::new(path, options, marks, clock)?;
    let mut rows = Rows::open(path, options)?;
    let gathered = plan.gather(&mut rows)?;
    rows.description.check_rows(path, gathered.samples)?;
    rows.description.check_end(path)?;
    Ok(conclude(plan, marks, gathered, rows.description.metadata)?)
}

/// Why a file could not be analysed.
#[derive(Debug, Error)]
pub enum StreamError {
    /// The file.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The marks.
    #[error(transparent)]
    Mark(#[from] MarkError),
}

/// A start and the sum of powers (W) before it.
type Summed = (FrameStart, PairSum);

/// From minima to frames and their energies.
fn conclude(
    plan: Plan,
    marks: &Marks,
    mut gathered: Gathered,
    metadata: Metadata,
) -> Result<Streamed, MarkError> {
    let clock = Clock { samples: Some(gathered.samples), ..plan.clock };
    let trace_end_s = clock.time_s(gathered.samples as f64);
    let marks = Marks { end_s: marks.end_s.min(trace_end_s), ..marks.clone() };
    let sigma_w = noise_deviation(upper_median(&mut gathered.steps_w));
    let threshold = plan.threshold(&mut gathered, sigma_w);
    let mut starts = plan.marked(&gathered);
    let starter = Starter { plan: &plan, threshold };
    let confidence = confidence(&threshold);
    let below = gathered.candidates.par_iter().filter(|c| c.distance_w2 < threshold.value_w2);
    starts.par_extend(below.map(|candidate| starter.start(candidate, &confidence)));
    drop(std::mem::take(&mut gathered.candidates));
    starts.sort_by(|a, b| a.0.time_s.total_cmp(&b.0.time_s));
    starts.dedup_by(|later, earlier| later.0.time_s <= earlier.0.time_s);
    if let Some(first) = starter.first(&starts, &mut gathered) {
        starts.insert(0, first);
    }
    let tolerance_s = 0.5 * plan.spacing as f64 / clock.rate_hz;
    starts.retain(|(start, _)| start.marked || start.time_s < marks.end_s - tolerance_s);
    let end_w = gathered.sums_w.last().copied().flatten().unwrap_or(gathered.total_w);
    let sums: Vec<PairSum> = starts.iter().map(|(_, sum)| *sum).chain([end_w]).collect();
    let starts: Vec<FrameStart> = starts.into_iter().map(|(start, _)| start).collect();
    let mut found = conclude_at(clock.rate_hz, &marks, &plan.placement, starts, threshold);
    found.warnings.extend(flat_mark(plan.windows(), sigma_w));
    let energy = |(span, sums): (&FrameSpan, &[PairSum])| FrameEnergy {
        start_s: span.start_s,
        end_s: span.end_s,
        energy_j: sums[1].minus(sums[0]) / clock.rate_hz,
        confidence: span.confidence,
        flags: span.flags,
    };
    let energies = found.frames.par_iter().zip(sums.par_windows(2)).map(energy).collect();
    Ok(Streamed { found, energies, clock, total_j: gathered.total_w.value() / clock.rate_hz, metadata })
}

struct Starter<'a> {
    plan: &'a Plan,
    threshold: Threshold,
}

impl Starter<'_> {
    fn start(&self, candidate: &Candidate, confidence: impl Fn(f64) -> f64) -> Summed {
        let mark = &self.plan.placement.marks[candidate.mark as usize];
        let start = FrameStart {
            time_s: mark.mark_s + (candidate.aligned - mark.first as f64) / self.plan.clock.rate_hz,
            distance_w2: candidate.distance_w2,
            confidence: confidence(candidate.distance_w2),
            marked: false,
        };
        (start, candidate.sum_w)
    }

    /// The first frame, after idle, if it lies in what was kept of the beginning. The marks' windows are put
    /// behind it.
    fn first(&self, starts: &[Summed], gathered: &mut Gathered) -> Option<Summed> {
        let starts: Vec<FrameStart> = starts.iter().map(|(start, _)| *start).collect();
        let head = &mut gathered.head;
        head.add_up();
        let width = self.plan.placement.samples;
        let rate_hz = self.plan.clock.rate_hz;
        let reach = self.plan.clock.position(starts.first()?.time_s) + width as f64;
        if reach > head.len() as f64 {
            return None;
        }
        let kept = reach as usize;
        let mut power: Vec<f64> = (0..kept).map(|place| head.power_w(place)).collect();
        let mut placement = self.plan.placement.clone();
        for (mark, template) in placement.marks.iter_mut().zip(&self.plan.templates) {
            mark.mark_s += (power.len() as f64 - mark.first as f64) / rate_hz;
            mark.first = power.len();
            power.extend_from_slice(template);
        }
        let (voltage_v, current_a) = (head.voltage_v[..kept].to_vec(), head.current_a[..kept].to_vec());
        let start_s = self.plan.clock.start_s;
        let trace = Trace::new(voltage_v, current_a, rate_hz, start_s, Metadata::default()).ok()?;
        let first =
            start_after_idle(&trace, &power, &placement, &self.threshold, &starts, self.plan.spacing)?;
        Some((first, head.sum_to(self.plan.clock.position(first.time_s))))
    }
}

impl Plan {
    /// By what was gathered, in which noise has a deviation of `sigma_w`.
    fn threshold(&self, gathered: &mut Gathered, sigma_w: f64) -> Threshold {
        let candidates = &gathered.candidates;
        let distances: Vec<f64> = candidates.par_iter().map(|candidate| candidate.distance_w2).collect();
        let noise_w2 = 2.0 * self.placement.samples as f64 * sigma_w * sigma_w;
        let background_w2 = upper_median(&mut gathered.distances_w2);
        let span = match (candidates.first(), candidates.last()) {
            (Some(first), Some(last)) => (last.offset - first.offset) as usize,
            _ => 0,
        };
        choose(&distances, background_w2, noise_w2, self.misalignment_w2(), |value_w2| {
            let below = distances.iter().zip(candidates).filter(|(distance_w2, _)| **distance_w2 < value_w2);
            let mut offsets: Vec<usize> = below.map(|(_, candidate)| candidate.offset as usize).collect();
            for mark in &self.placement.marks {
                offsets.insert(offsets.partition_point(|offset| *offset < mark.first), mark.first);
            }
            regularity(&offsets, span)
        })
    }

    /// The time of each mark, s, and the powers around it.
    fn windows(&self) -> impl Iterator<Item = (f64, &[f64])> {
        let marks = self.placement.marks.iter().map(|mark| mark.mark_s);
        marks.zip(self.templates.iter().map(Vec::as_slice))
    }

    fn misalignment_w2(&self) -> f64 {
        let mut placement: Placement = self.placement.clone();
        for (index, mark) in placement.marks.iter_mut().enumerate() {
            mark.first = index * self.placement.samples;
        }
        misalignment_w2(&self.templates.concat(), &placement)
    }

    fn marked(&self, gathered: &Gathered) -> Vec<Summed> {
        let start = |(mark, sum): (&Placed, &Option<PairSum>)| {
            let start = FrameStart { time_s: mark.mark_s, distance_w2: 0.0, confidence: 1.0, marked: true };
            (start, sum.unwrap_or_default())
        };
        self.placement.marks.iter().zip(&gathered.sums_w).map(start).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::CurveBuilder;
    use crate::device::{Device, DeviceSpec};
    use crate::energy::PowerIntegral;
    use crate::frames::{FinderMethod, Options, Window, default_window, find_with};
    use crate::io::parquet;

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
        let found = find_with(&trace, &Marks::one(0.05, window, trace.end_s()), &Options::default()).unwrap();
        let marks = Marks {
            starts_s: vec![found.starts[100].time_s, found.starts[2000].time_s],
            window,
            end_s: f64::INFINITY,
        };
        let in_memory = Marks { end_s: trace.end_s(), ..marks.clone() };
        let expected =
            find_with(&trace, &in_memory, &Options { method: FinderMethod::SumOfSquares }).unwrap();
        let streamed = find(&path, &ReadOptions::default(), &marks).unwrap();
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
            pool.install(|| find(&path, &ReadOptions::default(), &marks).unwrap())
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
            let options = Options { method: FinderMethod::SumOfSquares };
            let [ours, theirs] = [
                find(&path, &ReadOptions::default(), &marks).unwrap().found,
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
