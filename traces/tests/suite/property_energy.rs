//! Properties of every curve, trace and set of frames.

use proptest::prelude::*;
use traces::device::{Device, DeviceSpec};
use traces::energy::PowerIntegral;
use traces::frames::{Marks, default_window, find};
use traces::{Curve, CurveBuilder, Metadata, Trace};

fn curve_from(segments: &[(f64, f64)]) -> Curve {
    let mut builder = CurveBuilder::new(0.0).unwrap();
    for &(duration_s, watts) in segments {
        builder.push(duration_s, watts).unwrap();
    }
    builder.build().unwrap()
}

proptest! {
    #[test]
    fn energies_of_adjoining_spans_add_up_to_the_whole(
        samples in prop::collection::vec((0.5_f32..13.0, -1.0_f32..20.0), 1..3000),
        mut cuts in prop::collection::vec(0.0..1.0_f64, 2..40),
        start_s in -1e5..1e5_f64,
    ) {
        let (voltage_v, current_a): (Vec<f32>, Vec<f32>) = samples.into_iter().unzip();
        let trace = Trace::new(voltage_v, current_a, 50e3, start_s, Metadata::default()).unwrap();
        let integral = PowerIntegral::new(&trace);
        cuts.sort_by(f64::total_cmp);
        let times: Vec<f64> = cuts.iter().map(|cut| start_s + cut * (trace.end_s() - start_s)).collect();
        let sum: f64 = times.windows(2).map(|pair| integral.energy_j(pair[0], pair[1])).sum();
        let whole = integral.energy_j(times[0], times[times.len() - 1]);
        let scale: f64 = trace.powers_w().map(f64::abs).sum::<f64>() / 50e3;
        prop_assert!((sum - whole).abs() <= 1e-12 * scale);
    }

    #[test]
    fn the_integral_is_within_the_quantization_bound(
        segments in prop::collection::vec((1e-6..2e-3_f64, 0.0..200.0_f64), 1..200),
        bits in 6_u32..20,
        rate_hz in 1e3..2e5_f64,
        rail_ohm in 0.0..0.1_f64,
    ) {
        let curve = curve_from(&segments);
        prop_assume!(curve.end_s() * rate_hz > 2.0);
        let spec = DeviceSpec { bits, rate_hz, rail_ohm, ..DeviceSpec::default() };
        let device = Device::new(spec).unwrap().noise_free();
        let sampled = device.sample(&curve, 0.0, curve.end_s()).unwrap();
        let bound_j = device.quantization_energy_bound_j(&sampled).unwrap();
        let exact_j = curve.energy_j(sampled.trace.start_s(), sampled.trace.end_s());
        let error_j = PowerIntegral::new(&sampled.trace).total_j() - exact_j;
        prop_assert!(error_j.abs() <= bound_j, "error {} bound {}", error_j, bound_j);
    }
}

#[test]
fn the_quantization_bound_is_no_more_than_a_hundred_times_the_typical_error() {
    // Half a second: errors of 500 samples at 1 kHz average out, so the bound is about sqrt(3 n) times too wide.
    let mut rng = crate::common::Rng(17);
    let (mut errors_j, mut bounds_j) = (0.0, 0.0);
    for _ in 0..50 {
        let segments: Vec<(f64, f64)> = (0..1000).map(|_| (1e-3 * rng.next(), 100.0 * rng.next())).collect();
        let curve = curve_from(&segments);
        let device = Device::new(DeviceSpec { rate_hz: 1e3, ..DeviceSpec::default() }).unwrap().noise_free();
        let sampled = device.sample(&curve, 0.0, curve.end_s()).unwrap();
        errors_j +=
            (PowerIntegral::new(&sampled.trace).total_j() - curve.energy_j(0.0, sampled.trace.end_s())).abs();
        bounds_j += device.quantization_energy_bound_j(&sampled).unwrap();
    }
    assert!(bounds_j < 100.0 * errors_j, "bound over error: {}", bounds_j / errors_j);
}

#[test]
fn analytic_constant_power_is_power_times_time_within_a_bound_that_is_nearly_reached() {
    let mut tightest: f64 = 0.0;
    for milliwatts in 0..400 {
        let watts = 24.0 + f64::from(milliwatts) * 1e-3;
        let curve = curve_from(&[(1.0, watts)]);
        let device = Device::new(DeviceSpec::default()).unwrap().noise_free();
        let sampled = device.sample(&curve, 0.0, 0.01).unwrap();
        let error_j = (PowerIntegral::new(&sampled.trace).total_j() - watts * 0.01).abs();
        let bound_j = device.quantization_energy_bound_j(&sampled).unwrap();
        assert!(error_j <= bound_j);
        assert!(bound_j < 0.01 * watts * 0.01);
        tightest = tightest.max(error_j / bound_j);
    }
    assert!(tightest > 0.8, "the error never reaches more than {tightest} of the bound");
}

#[test]
fn frames_add_up_to_the_integral_from_the_first_start_to_the_end_mark() {
    for (case, period_s) in [(crate::common::vsync(40), 1.0 / 30.0), (crate::common::free_running(80), 0.01)]
    {
        let device = Device::new(DeviceSpec { current_noise_a: 0.02, ..DeviceSpec::default() }).unwrap();
        let trace = device.sample(&case.curve, 0.0, case.curve.end_s()).unwrap().trace;
        let marks =
            Marks::one(case.truth[13].start_s, default_window(period_s, 50e3), case.end_s - 0.0012345);
        let found = find(&trace, &marks).unwrap();
        let integral = PowerIntegral::new(&trace);
        let sum_j: f64 = integral.frames(&found).iter().map(|frame| frame.energy_j).sum();
        let whole_j = integral.energy_j(found.starts[0].time_s, marks.end_s);
        assert!((sum_j / whole_j - 1.0).abs() < 1e-12, "{}", sum_j / whole_j - 1.0);
        assert_eq!(found.frames.last().unwrap().end_s, marks.end_s);
    }
}

#[test]
fn sampling_and_finding_give_the_same_bits_twice() {
    let case = crate::common::free_running(30);
    let run = || {
        let device = Device::new(DeviceSpec::default()).unwrap();
        let trace = device.sample(&case.curve, 0.0, case.curve.end_s()).unwrap().trace;
        let found =
            find(&trace, &Marks::one(case.truth[9].start_s, default_window(0.01, 50e3), case.end_s)).unwrap();
        (trace, found)
    };
    assert_eq!(run(), run());
}
