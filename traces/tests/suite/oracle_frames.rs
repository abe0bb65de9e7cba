//! The finder against frames whose starts and energies are known.

use crate::common::{Case, free_running, vsync};
use traces::device::{Device, DeviceSpec};
use traces::energy::{PowerIntegral, Score, TOLERANCE_S, TrueFrame, score};
use traces::frames::{Found, Marks, default_window, find};
use traces::{Curve, CurveBuilder, Trace};

/// The battery rail of a phone in a recorder of +-4 A and +-6 V (assumed), with noise for a ratio of power
/// variance to noise variance.
fn device(case: &Case, snr_db: f64) -> Device {
    let spec = DeviceSpec {
        rail_v: 3.85,
        rail_ohm: 0.06,
        current_range_a: [-4.0, 4.0],
        voltage_range_v: [-6.0, 6.0],
        voltage_noise_v: 0.0005,
        ..DeviceSpec::default()
    };
    let first_s = case.truth[0].start_s;
    let count = ((case.end_s - first_s) * 50e3) as usize;
    let means_w = case.curve.sample_means_w(first_s, 50e3, count);
    let mean_w = means_w.iter().sum::<f64>() / count as f64;
    let variance = means_w.iter().map(|w| (w - mean_w) * (w - mean_w)).sum::<f64>() / count as f64;
    let noise_w = variance.sqrt() * 10.0_f64.powf(-snr_db / 20.0);
    Device::new(DeviceSpec { current_noise_a: noise_w / spec.rail_v, ..spec }).unwrap()
}

fn sampled(case: &Case, snr_db: f64) -> Trace {
    device(case, snr_db).sample(&case.curve, 0.0, case.curve.end_s()).unwrap().trace
}

fn analyse(trace: &Trace, case: &Case, marked: usize, period_hint_s: f64) -> (Found, Score) {
    let window = default_window(period_hint_s, trace.rate_hz());
    let found = find(trace, &Marks::one(case.truth[marked].start_s, window, case.end_s)).unwrap();
    let frames = PowerIntegral::new(trace).frames(&found);
    let score = score(&frames, &case.truth, TOLERANCE_S);
    (found, score)
}

#[test]
fn vsync_frames_are_all_found_from_40_to_10_db_without_a_warning() {
    let case = vsync(60);
    for (snr_db, timing_s, energy) in [(40.0, 4e-6, 0.0006), (20.0, 8e-6, 0.005), (10.0, 30e-6, 0.015)] {
        let (found, score) = analyse(&sampled(&case, snr_db), &case, 20, 1.0 / 30.0);
        assert_eq!((score.matched, score.found), (60, 60), "{snr_db} dB: {:?}", found.threshold);
        assert!(found.warnings.is_empty(), "{snr_db} dB: {:?}", found.warnings);
        assert!(
            score.median_timing_error_s().unwrap() < timing_s,
            "{snr_db} dB: {:?}",
            score.median_timing_error_s()
        );
        assert!(
            score.median_energy_error().unwrap() < energy,
            "{snr_db} dB: {:?}",
            score.median_energy_error()
        );
    }
}

#[test]
fn free_running_frames_are_all_found_from_40_to_10_db() {
    let case = free_running(120);
    for (snr_db, timing_s, energy) in [(40.0, 25e-6, 0.002), (20.0, 25e-6, 0.004), (10.0, 60e-6, 0.01)] {
        let (found, score) = analyse(&sampled(&case, snr_db), &case, 40, 1.0 / 90.0);
        assert_eq!((score.matched, score.found), (120, 120), "{snr_db} dB: {:?}", found.threshold);
        assert!(
            score.median_timing_error_s().unwrap() < timing_s,
            "{snr_db} dB: {:?}",
            score.median_timing_error_s()
        );
        assert!(
            score.median_energy_error().unwrap() < energy,
            "{snr_db} dB: {:?}",
            score.median_energy_error()
        );
    }
}

/// Frames of one burst at `busy_w` and idle, for cases that can be worked out by hand.
fn square_wave(count: u32, period_s: f64, busy_s: f64) -> Case {
    let mut builder = CurveBuilder::new(0.0).unwrap();
    builder.push(0.01, 5.0).unwrap();
    let mut truth = Vec::new();
    for _ in 0..count {
        truth.push(TrueFrame {
            start_s: builder.now_s(),
            energy_j: 20.0 * busy_s + 5.0 * (period_s - busy_s),
        });
        builder.push(busy_s, 20.0).unwrap();
        builder.push(period_s - busy_s, 5.0).unwrap();
    }
    let end_s = builder.now_s();
    builder.push(0.01, 5.0).unwrap();
    Case { curve: builder.build().unwrap(), truth, end_s }
}

#[test]
fn analytic_a_square_wave_off_the_sample_grid_gives_its_starts_and_energies() {
    // 333.7 samples a frame: every frame starts at another phase of a sample.
    let case = square_wave(100, 333.7 / 50e3, 100.3 / 50e3);
    let device = Device::new(DeviceSpec::default()).unwrap().noise_free();
    let trace = device.sample(&case.curve, 0.0, case.curve.end_s()).unwrap().trace;
    let (found, score) = analyse(&trace, &case, 30, 333.7 / 50e3);
    assert_eq!((score.matched, score.found), (100, 100));
    // The mark is exact, the others within 0.15 sample (two sharp edges), unbiased.
    assert!(score.worst_timing_error_s().unwrap() < 0.15 / 50e3, "{:?}", score.worst_timing_error_s());
    let bias_s = score.timing_errors_s.iter().sum::<f64>() / 100.0;
    assert!(bias_s.abs() < 0.02 / 50e3, "{bias_s}");
    assert_eq!(found.starts[30].time_s, case.truth[30].start_s);
    // Each end may put 15 W on the wrong side for 0.15 sample, and the sample the edge falls in, shared out evenly by
    // the rule, for up to x (1 - x) = 0.25 sample.
    let limit = 2.0 * 15.0 * (0.15 + 0.25) / 50e3 / case.truth[0].energy_j;
    assert!(score.worst_energy_error().unwrap() < limit, "{:?} {limit}", score.worst_energy_error());
    assert!(found.warnings.is_empty(), "{:?}", found.warnings);
}

#[test]
fn frames_shorter_than_the_usual_window_are_found_with_one_that_fits() {
    // 80 samples a frame, against a usual window of 250.
    let case = square_wave(300, 80.0 / 50e3, 30.0 / 50e3);
    let trace = Device::new(DeviceSpec::default())
        .unwrap()
        .sample(&case.curve, 0.0, case.curve.end_s())
        .unwrap()
        .trace;
    let (found, score) = analyse(&trace, &case, 100, 80.0 / 50e3);
    assert_eq!((score.matched, score.found), (300, 300), "{:?}", found.threshold);
}

#[test]
fn several_marks_are_all_exact_and_help_each_other() {
    let case = free_running(100);
    let trace = sampled(&case, 20.0);
    let marks = [10, 50, 90].map(|frame: usize| case.truth[frame].start_s);
    let window = default_window(0.01, 50e3);
    let found = find(&trace, &Marks { starts_s: marks.to_vec(), window, end_s: case.end_s }).unwrap();
    assert_eq!(
        found.starts.iter().filter(|start| start.marked).map(|start| start.time_s).collect::<Vec<_>>(),
        marks
    );
    let score = score(&PowerIntegral::new(&trace).frames(&found), &case.truth, TOLERANCE_S);
    assert_eq!((score.matched, score.found), (100, 100));
}

fn codes(found: &Found) -> Vec<&'static str> {
    found.warnings.iter().map(|warning| warning.code.name()).collect()
}

#[test]
fn a_frame_like_no_other_is_reported_alone_with_a_warning() {
    let mut rng = crate::common::Rng(5);
    let mut builder = CurveBuilder::new(0.0).unwrap();
    for _ in 0..2000 {
        builder.push(0.1e-3 + 1e-3 * rng.next(), 1.0 + 10.0 * rng.next()).unwrap();
    }
    let case = Case {
        truth: vec![TrueFrame { start_s: 0.5, energy_j: 1.0 }],
        end_s: 1.0,
        curve: builder.build().unwrap(),
    };
    let (found, _) = analyse(&sampled(&case, 40.0), &case, 0, 1.0);
    assert!(
        codes(&found).iter().any(|code| ["only-mark", "weak-separation"].contains(code)),
        "{:?}",
        found.threshold
    );
}

#[test]
fn each_warning_fires_on_its_case() {
    // One frame in idle: nothing to compare with.
    let case = square_wave(1, 0.02, 0.005);
    let quiet = |curve: &Curve| {
        Device::new(DeviceSpec::default()).unwrap().sample(curve, 0.0, curve.end_s()).unwrap().trace
    };
    assert_eq!(codes(&analyse(&quiet(&case.curve), &case, 0, 0.02).0), ["only-mark"]);
    // A mark right at the start of the trace.
    let case = square_wave(20, 0.01, 0.004);
    let trace = device(&case, 40.0).sample(&case.curve, 0.0095, case.curve.end_s()).unwrap().trace;
    assert!(codes(&analyse(&trace, &case, 0, 0.01).0).contains(&"window-cut"));
    // 20 samples a frame.
    let case = square_wave(50, 20.0 / 50e3, 8.0 / 50e3);
    assert!(codes(&analyse(&quiet(&case.curve), &case, 10, 20.0 / 50e3).0).contains(&"few-samples"));
    // The same with the usual window, which covers a dozen frames.
    assert!(codes(&analyse(&quiet(&case.curve), &case, 20, 1.0).0).contains(&"window-longer-than-frame"));
    // Frames that come in bursts.
    let mut builder = CurveBuilder::new(0.0).unwrap();
    builder.push(0.01, 5.0).unwrap();
    for frame in 0..40 {
        builder.push(0.004, 20.0).unwrap();
        builder.push(if frame % 4 == 3 { 0.05 } else { 0.006 }, 5.0).unwrap();
    }
    let curve = builder.build().unwrap();
    let trace = quiet(&curve);
    let found = find(&trace, &Marks::one(0.01, default_window(0.01, 50e3), trace.end_s())).unwrap();
    assert_eq!(found.frames.len(), 40);
    assert!(codes(&found).contains(&"irregular-spacing"), "{:?}", found.warnings);
}
