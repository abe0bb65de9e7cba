//! Warnings of a run.

mod regimes;

use std::collections::BTreeMap;

use activity::{Counts, Event};
use output::table::si;
use power_model::{PacedFrame, PacedRun};
use timing::error_size;
use traces::frames::Flag;
use warnings::{Code, Warning};

use self::regimes::of_regimes;
use crate::heat::HeatPicture;
use crate::measure::MIN_BUSY_SAMPLES;
use crate::{CONFIDENCE, Choice, Measurement, Observed, Plan, RunFrame, Simulated, StatedError, Verified};

/// All warnings of a run, sorted, without duplicates.
pub(crate) fn gather(plan: &Plan, simulated: &Simulated, measurement: &Measurement) -> Vec<Warning> {
    let mut all = warnings_of(plan, simulated, &measurement.run);
    let short = short_frames(measurement);
    // In a run of one frame, or of frames that are too short, finding only the mark is expected.
    let unseen = short.is_some() && measurement.is_mark_alone();
    let explained = simulated.frames.len() == 1 || unseen;
    let of_trace = measurement.found.warnings.iter().filter(|w| !(explained && w.code == "only-mark"));
    all.extend(of_trace.cloned());
    all.extend(start_errors(measurement).filter(|_| short.is_none()));
    all.extend(short);
    all.extend(detection(measurement).filter(|_| !unseen));
    all.extend(clipped(measurement.clipped));
    all.extend(lost(measurement));
    Warning::fold(all)
}

/// Warnings of a run but for those about its recorded trace, sorted, without duplicates.
pub fn warnings_of(plan: &Plan, simulated: &Simulated, paced: &PacedRun) -> Vec<Warning> {
    let mut all = plan.job.warnings().to_vec();
    all.extend(plan.pairing.clone());
    all.extend(of_frames(
        simulated
            .distinct
            .iter()
            .map(|frame| (frame.index, frame.observed().map_or(&[][..], |of| &of.warnings))),
    ));
    all.extend(paced.warnings.iter().cloned());
    all.extend(accuracy(plan, simulated));
    all.extend(degenerate(simulated));
    all.extend(empty_frames(simulated));
    all.extend(heat_outside_image(simulated));
    all.extend(idle_above_busy(plan, simulated));
    all.extend(wide_intervals(simulated));
    all.extend(costly_preview(simulated));
    all.extend(of_regimes(simulated));
    Warning::fold(all)
}

/// Warnings of a run of images alone, of its frames among them.
pub(crate) fn of_images<'a>(
    plan: &Plan,
    frames: impl ExactSizeIterator<Item = (u32, &'a [Warning])>,
) -> Vec<Warning> {
    let mut all = plan.job.warnings().to_vec();
    all.extend(of_frames(frames));
    Warning::fold(all)
}

/// Merges warnings of frames by code: the message of the first frame, with the number of frames if messages
/// differ.
fn of_frames<'a>(frames: impl ExactSizeIterator<Item = (u32, &'a [Warning])>) -> Vec<Warning> {
    let of = frames.len();
    let mut by_code: BTreeMap<Code, Vec<(u32, &Warning)>> = BTreeMap::new();
    for (frame, warning) in frames.flat_map(|(frame, warnings)| warnings.iter().map(move |w| (frame, w))) {
        by_code.entry(warning.code).or_default().push((frame, warning));
    }
    let joined = |found: Vec<(u32, &Warning)>| {
        let (first, warning) = found[0];
        if found.iter().all(|(_, other)| other.message == warning.message) {
            return warning.clone();
        }
        let frames = found.len();
        let message = format!("{} (frame {first}; the same in {frames} of {of} frames)", warning.message);
        let details = found.iter().map(|(frame, warning)| format!("frame {frame}: {}", warning.message));
        Warning::new(warning.code, message).with_details(frames, details)
    };
    by_code.into_values().map(joined).collect()
}

/// Warning about the frame that the check of the timing level found farthest off.
fn accuracy(plan: &Plan, simulated: &Simulated) -> Option<Warning> {
    let checked = simulated.observed().filter_map(|(frame, observed)| Some((frame.index, observed.checked?)));
    let (frame, worst) =
        checked.filter(|(_, of)| of.is_far()).max_by(|(_, a), (_, b)| a.size().total_cmp(&b.size()))?;
    Some(worst.warning(frame, plan.options.level(), plan.chosen))
}

fn degenerate(simulated: &Simulated) -> Option<Warning> {
    let without_area = |counts: &Counts| counts[Event::TrianglesDegenerate] + counts[Event::TrianglesFlat];
    let (worst, Observed { counts, .. }) =
        simulated.observed().max_by_key(|(_, observed)| without_area(&observed.counts))?;
    let (dropped, flat) = (counts[Event::TrianglesDegenerate], counts[Event::TrianglesFlat]);
    (dropped + flat > 0).then(|| {
        let (all, of, frame) = (dropped + flat, counts[Event::TrianglesIn], worst.index);
        Warning::new(
            Code::DegenerateTriangle,
            format!(
                "triangles have no area at any time ({all} of {of}, frame {frame}): those with two equal corners ({dropped}) were \
                 dropped, those with their corners on one line ({flat}) were kept, so that closed surfaces stay closed; clean the \
                 mesh where it was made"
            ),
        )
    })
}

fn empty_frames(simulated: &Simulated) -> Option<Warning> {
    // Passes in conservative mode shade tiles and have no samples.
    let shows = |counts: &Counts| counts[Event::SamplesHit] + counts[Event::PixelInvocations] > 0;
    let empty = simulated.known().filter(|frame| !shows(&frame.counts)).count();
    (empty > 0).then(|| {
        Warning::new(
            Code::EmptyFrame,
            format!("frames show nothing ({empty} of {}): check the camera", simulated.known().count()),
        )
    })
}

/// Share of a heat map's quantity below which a warning is given.
const MIN_PLACED: f64 = 0.1;

/// Warnings about quantities of which a heat map shows next to nothing, each for its worst frame.
fn heat_outside_image(simulated: &Simulated) -> Vec<Warning> {
    let mut worst: Vec<&HeatPicture> = Vec::new();
    for picture in &simulated.heat {
        match worst.iter_mut().find(|worst| worst.request == picture.request) {
            Some(worst) if picture.placed < worst.placed => *worst = picture,
            Some(_) => {}
            None => worst.push(picture),
        }
    }
    let warning = |worst: &HeatPicture| {
        let message = format!(
            "the heat map of {} shows {:.1} % of it (frame {}): the rest has no place in the image (vertices, groups, memory, \
             or passes of another size); choose another quantity or pass",
            worst.request,
            1e2 * worst.placed,
            worst.frame
        );
        Warning::new(Code::HeatOutsideImage, message)
    };
    worst.into_iter().filter(|worst| worst.placed < MIN_PLACED).map(warning).collect()
}

/// Warnings about a choice that misses the requested accuracy, as expected or as `verified`, or the time budget.
pub(crate) fn missed_requests(choice: &Choice, verified: Option<&Verified>) -> Vec<Warning> {
    let late = choice.budget_s.zip(choice.expected_host_s).filter(|(budget, expected)| expected > budget);
    let late = late.map(|(budget_s, expected_s)| {
        let message = format!(
            "even the cheapest choice is expected to take {}, more than the {} of --budget; give more time, or fewer frames, \
             samples or pixels",
            si(expected_s, "s"),
            si(budget_s, "s")
        );
        Warning::new(Code::BudgetMissed, message)
    });
    let inexact = (choice.meets_accuracy == Some(false)).then(|| {
        Warning::new(
            Code::AccuracyMissed,
            format!(
                "the error is expected to be {:.2} %, more than the {} % of --accuracy: --budget allows no more, or all \
                 frames would have to be simulated; give more time, or less accuracy",
                choice.expected_error * 100.0,
                choice.accuracy.unwrap_or_default() * 100.0
            ),
        )
    });
    let wrong = choice
        .accuracy
        .zip(verified)
        .and_then(|(accuracy, verified)| actual_error(accuracy, [choice.expected_error, verified.error]));
    late.into_iter().chain(wrong.or(inexact)).collect()
}

/// A warning if the actual error is larger than the requested `accuracy`. The expected error and the actual one are
/// given.
fn actual_error(accuracy: f64, [expected, actual]: [f64; 2]) -> Option<Warning> {
    let message = format!(
        "the actual error is {:.2} %, more than the {} % of --accuracy; {:.2} % was expected from a probe with smaller \
         images: use --timing stepped",
        actual * 100.0,
        accuracy * 100.0,
        expected * 100.0
    );
    (actual > accuracy).then(|| Warning::new(Code::AccuracyMissed, message))
}

/// A warning if the actual errors of cycles or energy are larger than the stated ones, as they are in up to one run in
/// twenty.
pub(crate) fn beyond_stated(stated: &StatedError, actual: &Verified) -> Option<Warning> {
    let pairs =
        [("cycles", actual.cycles_error, stated.cycles), ("energy", actual.energy_error, stated.energy)];
    // Stated errors are factors, so that a fifth too short counts as a quarter.
    let is_beyond = |&(_, actual, stated): &(&str, f64, f64)| error_size(libm::log1p(actual)) > stated;
    let parts: Vec<_> = pairs
        .into_iter()
        .filter(is_beyond)
        .map(|(of, actual, stated)| {
            let factor = 1.0 + error_size(libm::log1p(actual));
            format!("{of} {:+.2} %, a factor of {factor:.3} with {:.3} stated", actual * 100.0, 1.0 + stated)
        })
        .collect();
    let message = format!(
        "the actual error is larger than the stated one, which holds for {:.0} % of runs ({}): use --timing stepped here",
        CONFIDENCE * 100.0,
        parts.join(", ")
    );
    (!parts.is_empty()).then(|| Warning::new(Code::StatedErrorExceeded, message))
}

/// Relative half-width in percent above which an interval gives a warning.
const MAX_HALF_WIDTH_PERCENT: f64 = 5.0;

fn wide_intervals(simulated: &Simulated) -> Option<Warning> {
    let sampled = simulated.sampled.as_ref()?;
    let worst = sampled.worst() * 100.0;
    (worst > MAX_HALF_WIDTH_PERCENT).then(|| {
        Warning::new(
            Code::WidePredictionInterval,
            format!(
                "{} of {} frames were simulated, and totals predicted from them are good to {worst:.1} % only: frames differ in \
                 ways that their previews do not show; give --accuracy, or simulate all",
                sampled.simulated_frames.len(),
                simulated.frames.len()
            ),
        )
    })
}

/// Share of a frame's cycles in its preview from which on a warning is given.
const COSTLY_PREVIEW_SHARE: f64 = 0.5;

fn costly_preview(simulated: &Simulated) -> Option<Warning> {
    let share = simulated.sampled.as_ref()?.preview_share;
    (share >= COSTLY_PREVIEW_SHARE).then(|| {
        let message = format!(
            "the preview of a frame takes {:.0} % of its cycles, because its passes do not shrink with the image, or the image is small \
             already: predicting frames saves little; use --timing packet",
            share * 100.0
        );
        Warning::new(Code::CostlyPreview, message)
    })
}

/// Warning about frames that are busy for less than two samples.
fn short_frames(measurement: &Measurement) -> Option<Warning> {
    let resolution = &measurement.resolution;
    let frames = &measurement.run.frames;
    let is_short =
        |frame: &&PacedFrame| (frame.busy_end_s - frame.start_s) * resolution.rate_hz < MIN_BUSY_SAMPLES;
    let short = frames.iter().filter(is_short).count();
    (short > 0).then(|| {
        let found = if measurement.is_mark_alone() {
            "only the marked one was found, so that nothing is measured by frame"
        } else {
            "they may be missed, or found elsewhere"
        };
        let faster = resolution.needed_hz().map_or(String::new(), |rate_hz| format!("--trace-rate {rate_hz}, or "));
        Warning::new(
            Code::ShortFrame,
            format!(
                "{short} of {} frames are too short for the recorder: at {} the shortest is busy for {:.1} samples, and \
                 {found}; {faster}a larger image",
                frames.len(),
                si(resolution.rate_hz, "Hz"),
                resolution.samples_in_shortest()
            ),
        )
    })
}

fn detection(measurement: &Measurement) -> Option<Warning> {
    let score = &measurement.score;
    let flagged = measurement.frames.iter().filter(|frame| frame.flags.contains(Flag::LowConfidence)).count();
    (score.matched < score.truth || score.found > score.matched).then(|| {
        Warning::new(
            Code::FramesMissed,
            format!(
                "{} of {} frame starts were found in the trace, with {} false ones ({flagged} flagged low_confidence): energies \
                 of the frames beside them are wrong",
                score.matched,
                score.truth,
                score.found - score.matched
            ),
        )
    })
}

/// Warning about found starts that are off by more than half of the frame's busy time.
fn start_errors(measurement: &Measurement) -> Option<Warning> {
    let found = measurement.by_true_frame();
    let frames = measurement.run.frames.iter().zip(found).filter_map(|(frame, found)| {
        Some(((found?.start_s - frame.start_s).abs(), frame.busy_end_s - frame.start_s))
    });
    starts_off(frames, measurement.truth.len())
}

/// Of the error of each start that was found and the busy time of its frame, both in seconds.
fn starts_off(frames: impl Iterator<Item = (f64, f64)>, truth: usize) -> Option<Warning> {
    let off: Vec<(f64, f64)> = frames.filter(|(error_s, busy_s)| *error_s > 0.5 * busy_s).collect();
    let (error_s, busy_s) = off.iter().copied().max_by(|a, b| (a.0 / a.1).total_cmp(&(b.0 / b.1)))?;
    let message = format!(
        "{} of {truth} frame starts were found more than half of their frame's busy time off, the worst by {} where the frame is \
         busy for {}: part of its energy counts to its neighbour; raise --trace-rate, draw larger images, or find frames with a \
         shorter --window of `quintile trace frames`",
        off.len(),
        si(error_s, "s"),
        si(busy_s, "s")
    );
    Some(Warning::new(Code::StartError, message))
}

/// Warning about a platform whose idle power is above the power of a frame.
fn idle_above_busy(plan: &Plan, simulated: &Simulated) -> Option<Warning> {
    let idle_w = plan.platform.idle_w.value();
    let busy_w = |frame: &RunFrame| frame.power.energy().total_j() / frame.power.duration_s();
    let lowest_w = simulated.distinct.iter().map(busy_w).fold(f64::INFINITY, f64::min);
    (idle_w > lowest_w).then(|| {
        let message = format!(
            "platform `{}` draws {} between frames and only {} in a frame: the longer a frame takes the less energy it needs, and \
             frames show as dips; lower `idle_w`, or raise `constant_w`",
            plan.platform.name,
            si(idle_w, "W"),
            si(lowest_w, "W")
        );
        Warning::new(Code::IdleAboveBusy, message)
    })
}

/// Warning about samples beyond the range of the recorder. The range holds a quarter more than the peak takes on an
/// ideal rail; on rails below half a volt the voltage may fall by more than that under load.
fn clipped(samples: usize) -> Option<Warning> {
    (samples > 0).then(|| {
        Warning::new(Code::ClippedSamples, format!("{samples} samples are beyond the recorder's range"))
    })
}

fn lost(measurement: &Measurement) -> Option<Warning> {
    measurement.trace.losses().map(|losses| Warning::new(Code::PacketsLost, losses))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{HeatQuantity, HeatRequest, RunQuantity, SampledSummary};

    #[test]
    fn starts_off_by_more_than_half_of_their_frame_are_warned_about() {
        let warning =
            starts_off([(1e-6, 140e-6), (200e-6, 140e-6), (80e-6, 140e-6)].into_iter(), 36).unwrap();
        assert_eq!(warning.code, Code::StartError);
        let message = "2 of 36 frame starts were found more than half of their frame's busy time off, the worst by 200 µs \
                       where the frame is busy for 140 µs";
        assert!(warning.message.starts_with(message), "{warning}");
        assert_eq!(starts_off([(69e-6, 140e-6)].into_iter(), 36), None);
    }

    #[test]
    fn a_warning_of_many_frames_is_one_line() {
        let of = |frames: &[u32]| -> Vec<(u32, Vec<Warning>)> {
            let warned = |frame| Warning::new(Code::CausticsCoarse, format!("waves of {frame} squares"));
            (0..5).map(|f| (f, if frames.contains(&f) { vec![warned(f)] } else { vec![] })).collect()
        };
        let fold = |all: &[(u32, Vec<Warning>)]| of_frames(all.iter().map(|(f, w)| (*f, &w[..])));
        let one = fold(&of(&[3]));
        assert_eq!(one, [Warning::new(Code::CausticsCoarse, "waves of 3 squares")]);
        let three = fold(&of(&[1, 2, 4]));
        assert_eq!(three.len(), 1);
        assert_eq!(three[0].message, "waves of 1 squares (frame 1; the same in 3 of 5 frames)");
        assert_eq!((three[0].count, three[0].details[2].as_str()), (3, "frame 4: waves of 4 squares"));
        assert!(fold(&of(&[])).is_empty());
    }

    #[test]
    fn an_actual_error_beyond_the_requested_accuracy_is_warned_about() {
        assert_eq!(actual_error(0.02, [0.0015, 0.02]), None);
        let warning = actual_error(0.02, [0.0015, 0.1355]).unwrap();
        assert_eq!(warning.code, Code::AccuracyMissed);
        let message = "the actual error is 13.55 %, more than the 2 % of --accuracy; 0.15 % was expected";
        assert!(warning.message.starts_with(message), "{warning}");
    }

    #[test]
    fn an_actual_error_beyond_the_stated_one_is_warned_about() {
        let stated = StatedError { cycles: 0.25, energy: 0.02 };
        let off = |cycles_error, energy_error| Verified { cycles_error, energy_error, ..Verified::default() };
        // A fifth too short: the truth is a quarter longer.
        assert_eq!(beyond_stated(&stated, &off(-0.19, 0.019)), None);
        assert_eq!(beyond_stated(&stated, &off(0.24, -0.019)), None);
        let cycles = beyond_stated(&stated, &off(-0.21, 0.0)).unwrap();
        assert_eq!(cycles.code, Code::StatedErrorExceeded);
        assert!(
            cycles.message.contains("(cycles -21.00 %, a factor of 1.266 with 1.250 stated)"),
            "{cycles}"
        );
        let both = beyond_stated(&stated, &off(0.26, 0.03)).unwrap();
        let says = "(cycles +26.00 %, a factor of 1.260 with 1.250 stated, energy +3.00 %, a factor of 1.030 with 1.020 stated)";
        assert!(both.message.contains(says), "{both}");
    }

    #[test]
    fn any_clipped_sample_gives_a_warning() {
        assert_eq!(clipped(0), None);
        let warning = clipped(3).unwrap();
        assert_eq!(warning.code, Code::ClippedSamples);
        assert!(warning.message.starts_with("3 samples"), "{}", warning.message);
    }

    #[test]
    fn only_wide_intervals_give_a_warning() {
        let of = |percent: f64| {
            let relative_half_width = percent / 100.0;
            let quantity =
                |relative_half_width| RunQuantity { value: 1.0, low: 0.9, high: 1.1, relative_half_width };
            let sampled = SampledSummary {
                simulated_frames: vec![0, 7, 30],
                frames_per_simulated: 12.0,
                strata: 2,
                preview: [160, 90, 1],
                preview_share: 0.1,
                confidence: 0.95,
                cycles_per_frame: quantity(0.01),
                busy_energy_per_frame_j: quantity(relative_half_width),
                busy_power_w: quantity(0.01),
            };
            let (distinct, pictures, heat) = (Vec::new(), Vec::new(), Vec::new());
            wide_intervals(&Simulated {
                distinct,
                frames: vec![0; 36],
                pictures,
                heat,
                sampled: Some(sampled),
            })
        };
        assert_eq!(of(MAX_HALF_WIDTH_PERCENT), None);
        let warning = of(7.25).unwrap();
        assert_eq!(warning.code, Code::WidePredictionInterval);
        let message = warning.to_string();
        assert!(message.contains("3 of 36 frames") && message.contains("7.2 %"), "{message}");
    }

    #[test]
    fn each_heat_map_that_shows_next_to_nothing_has_one_warning() {
        let [hits, madds, reads] =
            [Event::SamplesHit, Event::TileMadds, Event::DepthReads].map(HeatQuantity::Event);
        let picture = |(quantity, frame, placed)| {
            let request = HeatRequest { quantity, pass: None };
            HeatPicture { request, frame, placed, png: Vec::new() }
        };
        let heat = [(hits, 3, 0.05), (madds, 3, 0.0), (reads, 3, 0.9), (hits, 4, 0.01), (madds, 4, 0.5)];
        let heat = heat.map(picture).into();
        let (distinct, pictures) = Default::default();
        let simulated = Simulated { distinct, frames: vec![0; 2], pictures, heat, sampled: None };
        let messages: Vec<String> =
            heat_outside_image(&simulated).iter().map(|warning| warning.message.clone()).collect();
        assert_eq!(messages.len(), 2, "{messages:?}");
        assert!(messages[0].contains("samples_hit shows 1.0 %") && messages[0].contains("(frame 4)"));
        assert!(messages[1].contains("tile_madds shows 0.0 %") && messages[1].contains("(frame 3)"));
    }
}
