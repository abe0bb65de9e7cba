//! Energy sums of a run, recomputed from its files with an independent implementation.

use std::path::Path;
use std::sync::LazyLock;

use crate::support::{Results, number, quintile};
use activity::{Event, Unit};
use power_model::{Bound, EnergyTable, Part, Platform};
use serde_json::Value;

/// Runs under test: a tiny one, one whose frames are found, and one without V-sync. Each is run once for all
/// tests.
static RUNS: LazyLock<[Results; 3]> = LazyLock::new(|| {
    let folder = |name| Path::new(env!("CARGO_TARGET_TMPDIR")).join("energies").join(name);
    let default = ["--size", "320x180", "--frames", "0..6"];
    let free = [&default[..], &["--pacing", "free"]].concat();
    [
        quintile().run_in(&folder("tiny"), "tiny", &[]),
        quintile().run_in(&folder("default"), "default", &default),
        quintile().run_in(&folder("free"), "default", &free),
    ]
});

/// `E(a, b) = sum over samples of V I |[t, t + dt] cap [a, b]|`, summed with Neumaier's compensation.
fn integral_j(results: &Results, from_s: f64, to_s: f64) -> f64 {
    let trace = results.trace();
    let (mut sum, mut lost) = (0.0f64, 0.0f64);
    for (index, (volts, amperes)) in trace.voltage_v().iter().zip(trace.current_a()).enumerate() {
        let begin_s = trace.start_s() + index as f64 / trace.rate_hz();
        let end_s = trace.start_s() + (index + 1) as f64 / trace.rate_hz();
        let overlap_s = (end_s.min(to_s) - begin_s.max(from_s)).max(0.0);
        let joules = f64::from(*volts) * f64::from(*amperes) * overlap_s;
        let next = sum + joules;
        lost += if sum.abs() >= joules.abs() { (sum - next) + joules } else { (joules - next) + sum };
        sum = next;
    }
    sum + lost
}

fn end_mark_s(results: &Results) -> f64 {
    let trace = results.trace();
    let end = trace.metadata.marks.iter().find(|mark| mark.kind == traces::MarkKind::End);
    end.expect("the trace has an end mark").time_s
}

#[test]
fn frames_add_up_to_the_integral_from_the_first_start_to_the_end_mark() {
    for results in RUNS.iter() {
        let frames = results.frames();
        let sum: f64 = frames.iter().map(|frame| frame.energy_j).sum();
        let whole = integral_j(results, frames[0].start_s, end_mark_s(results));
        assert!((sum / whole - 1.0).abs() < 1e-9, "{sum} J in frames, {whole} J in the trace");
        let stated = number(&results.summary(), "/checks/frames_against_integral_relative");
        assert!(stated < 1e-9, "{stated}");
    }
}

#[test]
fn each_frame_is_the_integral_from_its_start_to_the_next() {
    for results in RUNS.iter() {
        let frames = results.frames();
        for pair in frames.windows(2) {
            assert_eq!(pair[0].end_s, pair[1].start_s);
        }
        assert_eq!(frames.last().map(|frame| frame.end_s), Some(end_mark_s(results)));
        for frame in frames {
            let whole = integral_j(results, frame.start_s, frame.end_s);
            assert!((frame.energy_j / whole - 1.0).abs() < 1e-9, "{frame:?}: {whole} J");
        }
    }
}

/// Parts of a GPU without levels below the L2.
fn parts() -> impl Iterator<Item = Part> {
    Part::ALL.into_iter().filter(|part| !part.is_optional())
}

fn by_part_j(energy: &Value) -> Vec<f64> {
    parts().map(|part| number(energy, &format!("/{}", part.name()))).collect()
}

/// Parts are summed in the order of [`Part::ALL`], frames in theirs; both orders are stated in the book.
#[test]
fn joules_by_part_summed_in_their_order_are_the_energy_exactly() {
    for results in RUNS.iter() {
        let summary = results.summary();
        let mut sums_j = vec![0.0; parts().count()];
        for frame in summary["frames"].as_array().into_iter().flatten() {
            let by_part = by_part_j(&frame["energy_by_part_j"]);
            let sum: f64 = by_part.iter().fold(0.0, |sum, joules| sum + joules);
            assert_eq!(sum, number(frame, "/energy_j"), "frame {}", frame["frame"]);
            sums_j.iter_mut().zip(by_part).for_each(|(sum, joules)| *sum += joules);
        }
        assert_eq!(sums_j, by_part_j(&summary["energy_by_part_j"]));
        assert_eq!(summary["energy_by_part_j"].as_object().map(serde_json::Map::len), Some(parts().count()));
    }
}

/// A unit's energy is its counts times the rows of the table, independent of timing; idle energy is the
/// platform's.
#[test]
fn joules_by_part_follow_from_counts_and_times() {
    let table = EnergyTable::builtin("28nm").expect("a built-in table").joules(Bound::Nominal);
    let platform = Platform::builtin("reference").expect("a built-in platform");
    for results in RUNS.iter() {
        let summary = results.summary();
        for unit in Unit::ALL.into_iter().filter(|unit| !unit.is_optional()) {
            let events = Event::ALL.into_iter().filter(|event| event.unit() == unit);
            let expected: f64 = events
                .map(|event| number(&summary, &format!("/counts/{}", event.name())) * table[event as usize])
                .sum();
            let found = number(&summary, &format!("/energy_by_part_j/{}", unit.name()));
            assert!((found - expected).abs() <= 1e-9 * expected, "{}: {found} J, {expected} J", unit.name());
        }
        let frames = summary["frames"].as_array().cloned().unwrap_or_default();
        let total_s = |key: &str| frames.iter().map(|frame| number(frame, key)).sum::<f64>();
        let busy_s = total_s("/busy_s");
        for (part, watts, seconds) in [
            ("idle", platform.idle_w.value(), total_s("/duration_s") - busy_s),
            ("constant", platform.constant_w.value(), busy_s),
            ("leakage", platform.leakage_w(), busy_s),
        ] {
            let found = number(&summary, &format!("/energy_by_part_j/{part}"));
            assert!((found / (watts * seconds) - 1.0).abs() < 1e-9, "{part}: {found} J");
        }
    }
}

#[test]
fn a_trace_without_noise_is_the_curve_within_the_quantization() {
    for results in RUNS.iter() {
        let checks = &results.summary()["checks"];
        let off_j = number(checks, "/noise_free_trace_minus_curve_j").abs();
        let bound_j = number(checks, "/quantization_bound_j");
        assert!(off_j <= bound_j, "{off_j} J off, the recorder's steps explain {bound_j} J");
        let total_j = number(&results.summary(), "/truth/total_j");
        assert!(bound_j < 0.03 * total_j, "a bound of {bound_j} J says nothing about {total_j} J");
        assert!(number(checks, "/parts_against_curve_relative") < 1e-9);
    }
}

/// The recorded trace is noisy; over a run the noise averages out.
#[test]
fn the_recording_has_the_energy_of_the_curve() {
    for results in RUNS.iter() {
        let summary = results.summary();
        let first = number(&summary, "/frames/0/start_s");
        let truth_j = number(&summary, "/truth/total_j");
        let recorded_j = integral_j(results, first, end_mark_s(results));
        assert!((recorded_j / truth_j - 1.0).abs() < 5e-3, "{recorded_j} J recorded, {truth_j} J spent");
    }
}

#[test]
fn energy_per_pixel_and_power_follow_from_energy() {
    let results = quintile().run("default", &["--size", "64x36", "--frames", "0..2"]);
    for frame in results.summary()["frames"].as_array().into_iter().flatten() {
        let (energy_j, s) = (number(frame, "/energy_j"), number(frame, "/duration_s"));
        let per_pixel_j = energy_j / (64.0 * 36.0);
        assert!((number(frame, "/energy_per_pixel_j") / per_pixel_j - 1.0).abs() < 1e-12);
        assert!((number(frame, "/power_w") / (energy_j / s) - 1.0).abs() < 1e-12);
    }
}
