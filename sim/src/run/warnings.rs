//! Regimes in which the methods of a run are known to be bad.

use activity::{Counts, Event, Warning};
use traces::frames::Flag;

use super::{Choice, Measurement, Plan, Simulated, regime_warnings};
use crate::timing::Doubt;

/// A frame shorter than this many samples cannot be integrated well: each end is uncertain by a good part of a sample.
const FEWEST_SAMPLES: f64 = 50.0;

/// Every warning of a run, sorted and each once.
pub(super) fn gather(plan: &Plan, simulated: &Simulated, measurement: &Measurement) -> Vec<Warning> {
    let mut all = plan.work.warnings().to_vec();
    all.extend(simulated.distinct.iter().flat_map(|frame| frame.warnings.iter().cloned()));
    all.extend(measurement.run.warnings.iter().cloned());
    // A run of one frame has no other that could resemble it.
    let alone = simulated.frames.len() == 1;
    let told = measurement.found.warnings.iter().filter(|w| !(alone && w.code == "only-mark"));
    all.extend(told.map(|w| Warning::new(w.code, w.message.clone())));
    all.extend(doubted(plan, simulated));
    all.extend(degenerate(simulated));
    all.extend(nothing_seen(simulated));
    all.extend(short_frames(measurement));
    all.extend(detection(measurement));
    all.extend(clipped(measurement));
    all.extend(lost(measurement));
    all.extend(unsure(simulated));
    all.extend(regime_warnings::gather(simulated));
    all.sort();
    all.dedup();
    all
}

/// Of each reason not to trust times, the frame that gives most of it.
fn doubted(plan: &Plan, simulated: &Simulated) -> Vec<Warning> {
    let mut worst: Vec<(u32, Doubt)> = Vec::new();
    for (frame, &doubt) in
        simulated.distinct.iter().flat_map(|f| f.doubts.iter().map(|doubt| (f.index, doubt)))
    {
        match worst.iter_mut().find(|(_, known)| known.code() == doubt.code()) {
            Some(known) if known.1.extent() < doubt.extent() => *known = (frame, doubt),
            Some(_) => {}
            None => worst.push((frame, doubt)),
        }
    }
    let level = plan.options.timing;
    worst.iter().map(|(frame, doubt)| doubt.warning(*frame, level)).collect()
}

fn degenerate(simulated: &Simulated) -> Option<Warning> {
    let without_area = |counts: &Counts| counts[Event::TrianglesDegenerate] + counts[Event::TrianglesFlat];
    let worst = simulated.distinct.iter().max_by_key(|frame| without_area(&frame.counts))?;
    let (dropped, flat) = (worst.counts[Event::TrianglesDegenerate], worst.counts[Event::TrianglesFlat]);
    (dropped + flat > 0).then(|| {
        let (all, of, frame) = (dropped + flat, worst.counts[Event::TrianglesIn], worst.index);
        Warning::new(
            "degenerate-triangle",
            format!(
                "{all} of {of} triangles have no area at any time (frame {frame}): {dropped} with two equal corners were \
                 dropped, {flat} with their corners on one line were kept, so that closed surfaces stay closed; clean the \
                 mesh where it was made"
            ),
        )
    })
}

fn nothing_seen(simulated: &Simulated) -> Option<Warning> {
    let empty = simulated.known().filter(|frame| frame.counts[Event::SamplesHit] == 0).count();
    (empty > 0).then(|| {
        Warning::new(
            "empty-frame",
            format!("{empty} of {} frames show nothing: check the camera", simulated.known().count()),
        )
    })
}

/// A choice that is not as good, or not as fast, as was asked for.
pub(super) fn missed(choice: &Choice) -> Vec<Warning> {
    let late = choice.budget_s.zip(choice.expected_host_s).filter(|(budget, expected)| expected > budget);
    let late = late.map(|(budget_s, expected_s)| {
        let message = format!(
            "simulating was expected to take {expected_s:.1} s, more than the {budget_s} s of --budget, at the cheapest \
             there is; give more time, or fewer frames, samples or pixels"
        );
        Warning::new("budget-missed", message)
    });
    let inexact = (choice.meets_accuracy == Some(false)).then(|| {
        Warning::new(
            "accuracy-missed",
            format!(
                "the error is expected to be {:.2} %, more than the {} % of --accuracy: --budget allows no more, or all \
                 frames would have to be simulated; give more time, or less accuracy",
                choice.expected_error_percent,
                choice.accuracy_percent.unwrap_or_default()
            ),
        )
    });
    late.into_iter().chain(inexact).collect()
}

/// Intervals wider than this share of their value either way are worth a word.
const WIDE_PERCENT: f64 = 5.0;

fn unsure(simulated: &Simulated) -> Option<Warning> {
    let sampled = simulated.sampled.as_ref()?;
    let worst = sampled.worst_percent();
    (worst > WIDE_PERCENT).then(|| {
        Warning::new(
            "prediction-unsure",
            format!(
                "{} of {} frames were simulated, and totals predicted from them are good to {worst:.1} % only: frames differ in \
                 ways that their previews do not show; give --accuracy, or simulate all",
                sampled.simulated_frames.len(),
                simulated.frames.len()
            ),
        )
    })
}

fn short_frames(measurement: &Measurement) -> Option<Warning> {
    let rate_hz = measurement.trace.rate_hz();
    let samples = |busy_s: f64| busy_s * rate_hz;
    let shortest = measurement
        .run
        .frames
        .iter()
        .map(|frame| frame.busy_end_s - frame.start_s)
        .fold(f64::INFINITY, f64::min);
    let short =
        measurement.run.frames.iter().filter(|f| samples(f.busy_end_s - f.start_s) < FEWEST_SAMPLES).count();
    (short > 0).then(|| {
        Warning::new(
            "short-frame",
            format!(
                "{short} of {} frames are busy for less than {FEWEST_SAMPLES} samples of the trace (the shortest for \
                 {:.1}): their shape is not resolved and starts are uncertain; record at a higher rate",
                measurement.run.frames.len(),
                samples(shortest)
            ),
        )
    })
}

fn detection(measurement: &Measurement) -> Option<Warning> {
    let score = &measurement.score;
    let unsure = measurement.frames.iter().filter(|frame| frame.flags.contains(Flag::Unsure)).count();
    (score.matched < score.truth || score.found > score.matched).then(|| {
        Warning::new(
            "frames-missed",
            format!(
                "{} of {} frame starts were found in the trace, with {} false ones ({unsure} flagged unsure): energies \
                 of the frames beside them are wrong",
                score.matched,
                score.truth,
                score.found - score.matched
            ),
        )
    })
}

fn clipped(measurement: &Measurement) -> Option<Warning> {
    (measurement.clipped > 0).then(|| {
        Warning::new(
            "clipped-samples",
            format!("{} samples are beyond the recorder's range", measurement.clipped),
        )
    })
}

fn lost(measurement: &Measurement) -> Option<Warning> {
    measurement.trace.losses().map(|losses| Warning::new("packets-lost", losses))
}

#[cfg(test)]
mod tests {
    use super::super::{Quantity, SampledSummary};
    use super::*;

    #[test]
    fn wide_intervals_are_told_and_narrow_ones_are_not() {
        let of = |half_width_percent: f64| {
            let quantity =
                |half_width_percent| Quantity { value: 1.0, low: 0.9, high: 1.1, half_width_percent };
            let sampled = SampledSummary {
                simulated_frames: vec![0, 7, 30],
                frames_per_simulated: 12.0,
                strata: 2,
                preview: [160, 90, 1],
                confidence: 0.95,
                cycles_per_frame: quantity(1.0),
                busy_energy_per_frame_j: quantity(half_width_percent),
                busy_power_w: quantity(1.0),
            };
            let (distinct, pictures, heat) = (Vec::new(), Vec::new(), Vec::new());
            unsure(&Simulated { distinct, frames: vec![0; 36], pictures, heat, sampled: Some(sampled) })
        };
        assert_eq!(of(WIDE_PERCENT), None);
        let message = of(7.25).map(|warning| warning.to_string()).unwrap_or_default();
        assert!(message.contains("3 of 36 frames") && message.contains("7.2 %"), "{message}");
    }
}
