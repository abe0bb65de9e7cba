//! From minima to frames and their energies.

use super::pass::{Candidate, Gathered, Plan};
use super::{Clock, Streamed};
use crate::energy::FrameEnergy;
use crate::frames::{
    FrameStart, MarkError, Marks, Placement, choose, conclude_at, confidence, flat_mark, misalignment_w2,
    noise_deviation, regularity, start_after_idle,
};
use crate::stats::{PairSum, upper_median};
use crate::trace::{Metadata, Trace};
use rayon::prelude::*;

/// A start and the sum of powers (W) before it.
type Summed = (FrameStart, PairSum);

pub(super) fn conclude(
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
    let view = Starter { plan: &plan, threshold };
    let confidence = confidence(&threshold);
    let below = gathered.candidates.par_iter().filter(|c| c.distance_w2 < threshold.value_w2);
    starts.par_extend(below.map(|candidate| view.start(candidate, &confidence)));
    drop(std::mem::take(&mut gathered.candidates));
    starts.sort_by(|a, b| a.0.time_s.total_cmp(&b.0.time_s));
    starts.dedup_by(|later, earlier| later.0.time_s <= earlier.0.time_s);
    if let Some(first) = view.first(&starts, &mut gathered) {
        starts.insert(0, first);
    }
    let tolerance_s = 0.5 * plan.spacing as f64 / clock.rate_hz;
    starts.retain(|(start, _)| start.marked || start.time_s < marks.end_s - tolerance_s);
    let end_w = gathered.sums_w.last().copied().flatten().unwrap_or(gathered.total_w);
    let sums: Vec<PairSum> = starts.iter().map(|(_, sum)| *sum).chain([end_w]).collect();
    let starts: Vec<FrameStart> = starts.into_iter().map(|(start, _)| start).collect();
    let mut found = conclude_at(clock.rate_hz, &marks, &plan.placement, starts, threshold);
    found.warnings.extend(flat_mark(plan.windows(), sigma_w));
    let energy = |(span, sums): (&crate::frames::FrameSpan, &[PairSum])| FrameEnergy {
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
    threshold: crate::frames::Threshold,
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
    fn threshold(&self, gathered: &mut Gathered, sigma_w: f64) -> crate::frames::Threshold {
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
        let start = |(mark, sum): (&crate::frames::Placed, &Option<PairSum>)| {
            let start = FrameStart { time_s: mark.mark_s, distance_w2: 0.0, confidence: 1.0, marked: true };
            (start, sum.unwrap_or_default())
        };
        self.placement.marks.iter().zip(&gathered.sums_w).map(start).collect()
    }
}
