//! Surroundings of the GPU in closed form: launch, blocking finish, disturbances.

use activity::Event;
use power_model::{
    Bound, Cause, Circumstances, FramePower, PacedFrame, PacedRun, Pacing, PacingError, Platform, Pulse,
    Surrounded, overlay, pace,
};
use proptest::prelude::*;
use traces::device::{Device, DeviceSpec};
use traces::energy::{PowerIntegral, mean_over_discarded, outliers, warm_up};
use traces::{Curve, Trace};

use super::common::{model, steady, table};

const MS_PS: u64 = 1_000_000_000;
const SETTLED: Circumstances = Circumstances { launch: false, blocking_finish: false, seed: 1 };

fn phone() -> Platform {
    Platform::builtin("iphone_4s").unwrap()
}

/// A phone with no disturbance except the given one.
fn quiet(but: &str) -> Platform {
    let mut phone = phone();
    phone.system.disturbances.retain(|disturbance| disturbance.name() == but);
    phone
}

/// Equal frames of 20 ms at 30 frames per second.
fn thirty(platform: &Platform, frames: usize) -> PacedRun {
    let frame: FramePower =
        model(platform).frame(&steady(MS_PS, 20, Event::ShaderOps, 4_000_000, MS_PS / 2)).unwrap();
    pace(&vec![&frame; frames], platform, Pacing::vsync(30.0).unwrap()).unwrap()
}

fn recorded(curve: &Curve) -> Trace {
    let spec = DeviceSpec {
        rate_hz: 40e3,
        rail_v: 3.9,
        current_range_a: [0.0, 1.0],
        bits: 16,
        ..DeviceSpec::default()
    };
    Device::new(spec).unwrap().noise_free().sample(curve, 0.0, curve.end_s()).unwrap().trace
}

/// Energies from start to start, from the recording alone.
fn energies_j(surrounded: &Surrounded) -> Vec<f64> {
    let trace = recorded(&surrounded.curve);
    let integral = PowerIntegral::new(&trace);
    surrounded.frames.iter().map(|frame| integral.energy_j(frame.start_s, frame.end_s)).collect()
}

#[test]
fn the_launch_transient_is_the_knee_of_the_warm_up() {
    let phone = quiet("");
    let run = thirty(&phone, 240);
    let launched = phone.system.surround(&run, &Circumstances { launch: true, ..SETTLED }).unwrap();
    let energies = energies_j(&launched);
    let found = warm_up(&energies);
    // 1.6 s at 30 frames a second, 0.05 W over a thirtieth of a second.
    assert_eq!(found.frames, 48);
    assert!((found.excess_j / (0.05 / 30.0) - 1.0).abs() < 0.01, "{found:?}");
    let means = mean_over_discarded(&energies);
    assert!(means[0] > means[24] && means[24] > means[48] && (means[48] / means[200] - 1.0).abs() < 1e-4);
    let settled = phone.system.surround(&run, &SETTLED).unwrap();
    assert_eq!(warm_up(&energies_j(&settled)).frames, 0);
    assert_eq!(settled.curve, run.curve);
}

#[test]
fn a_blocking_finish_costs_its_power_until_it_returns_and_leaves_idle_alone() {
    let phone = quiet("");
    let run = thirty(&phone, 5);
    let blocked = phone.system.surround(&run, &Circumstances { blocking_finish: true, ..SETTLED }).unwrap();
    let finish = phone.system.finish.as_ref().unwrap();
    let (waiting_w, return_s) = (finish.waiting_w.value(), finish.return_s.value());
    for (frame, plain) in blocked.frames.iter().zip(&run.frames) {
        assert!((frame.finish_s - plain.busy_end_s - return_s).abs() < 1e-12);
        let expected_j = waiting_w * (0.020 + return_s);
        assert!((frame.extra_j / expected_j - 1.0).abs() < 1e-9);
        assert!((frame.energy_j - plain.energy.total_j() - expected_j).abs() < 1e-12);
        let idle_j = |curve: &Curve| curve.energy_j(frame.finish_s + 1e-9, frame.end_s);
        assert_eq!(idle_j(&blocked.curve), idle_j(&run.curve));
    }
    // Begin to finish gives more than start to start if work fills most of the frame, and less otherwise.
    let period_s: f64 = 1.0 / 30.0;
    let idle_w = phone.idle_w.value();
    let gain_j = |busy_s: f64| waiting_w * (busy_s + return_s) - idle_w * (period_s - busy_s - return_s);
    assert!(gain_j(0.020) < 0.0 && gain_j(0.030) > 0.0);
    let old_j = blocked.curve.energy_j(blocked.frames[1].start_s, blocked.frames[1].finish_s);
    assert!((old_j - run.frames[1].energy.total_j() - gain_j(0.020)).abs() < 1e-9);
}

#[test]
fn a_periodic_disturbance_touches_the_frames_that_overlap_it_and_no_others() {
    let phone = quiet("five_seconds");
    let run = thirty(&phone, 600);
    for seed in 0..20 {
        let disturbed = phone.system.surround(&run, &Circumstances { seed, ..SETTLED }).unwrap();
        for pair in disturbed.pulses.windows(2) {
            assert!((pair[1].start_s - pair[0].start_s - 5.0).abs() < 1e-9);
        }
        for pulse in disturbed.pulses.iter().filter(|p| p.start_s > run.start_s && p.end_s < run.end_s) {
            // 90 ms and frames of 33.3 ms.
            let touched =
                disturbed.frames.iter().filter(|f| pulse.overlap_s(f.start_s, f.end_s) > 0.0).count();
            assert!((3..=4).contains(&touched), "{touched}");
        }
        let found = outliers(&energies_j(&disturbed));
        for (frame, out) in disturbed.frames.iter().zip(found) {
            let overlap_s: f64 =
                disturbed.pulses.iter().map(|p| p.overlap_s(frame.start_s, frame.end_s)).sum();
            assert!((frame.extra_j - 0.4 * overlap_s).abs() < 1e-12);
            // Less than a thousandth of a frame's energy is within rounding.
            assert!(out == (overlap_s > 0.0) || overlap_s < 1e-3, "overlap {overlap_s} s, outlier {out}");
        }
    }
}

#[test]
fn an_irregular_disturbance_occurs_once_per_period_at_times_of_its_seed() {
    let phone = quiet("stray_spike");
    let run = thirty(&phone, 300);
    let starts = |seed| -> Vec<f64> {
        let disturbed = phone.system.surround(&run, &Circumstances { seed, ..SETTLED }).unwrap();
        disturbed.pulses.iter().map(|pulse| pulse.start_s).collect()
    };
    let one = starts(1);
    assert_eq!(one, starts(1));
    assert_ne!(one, starts(2));
    let expected = run.curve.end_s() / 0.066;
    assert!((one.len() as f64 - expected).abs() <= 3.0, "{} for {expected}", one.len());
    let gaps: Vec<f64> = one.windows(2).map(|pair| pair[1] - pair[0]).collect();
    assert!(gaps.iter().all(|gap| (0.0..2.0 * 0.066).contains(gap)));
    // The difference of two uniform numbers of a period has a triangular distribution, with variance P^2/6.
    let variance = gaps.iter().map(|gap| (gap - 0.066) * (gap - 0.066)).sum::<f64>() / gaps.len() as f64;
    assert!((variance / (0.066 * 0.066 / 6.0) - 1.0).abs() < 0.4, "{variance}");
    // 0.2 W, times 0.5 to 1.5, uniform: variance 0.2^2 / 12.
    let drawn = phone.system.surround(&run, &SETTLED).unwrap().pulses;
    let powers: Vec<f64> = drawn.iter().map(|pulse| pulse.extra_w).collect();
    assert!(powers.iter().all(|watts| (0.1..=0.3).contains(watts)));
    let mean = powers.iter().sum::<f64>() / powers.len() as f64;
    let variance = powers.iter().map(|w| (w - mean) * (w - mean)).sum::<f64>() / powers.len() as f64;
    assert!((mean - 0.2).abs() < 0.02 && (variance / (0.04 / 12.0) - 1.0).abs() < 0.4, "{mean} {variance}");
}

#[test]
fn disturbances_reach_into_the_first_and_the_last_moment() {
    let phone = quiet("five_seconds");
    let run = thirty(&phone, 60);
    // A disturbance of 90 ms in 5 s covers a given time in 1.8 % of all runs.
    let under_way = |time_s: f64, seed| {
        let disturbed = phone.system.surround(&run, &Circumstances { seed, ..SETTLED }).unwrap();
        disturbed.pulses.iter().any(|p| (p.start_s..p.end_s).contains(&time_s))
    };
    for time_s in [0.0, 1.0, run.curve.end_s() - 1e-6] {
        let count = (0..4000).filter(|&seed| under_way(time_s, seed)).count();
        // 72 expected, standard deviation 8.4.
        assert!((40..=105).contains(&count), "{count} at {time_s} s");
    }
}

#[test]
fn frame_energies_add_up_to_the_curve_in_all_surroundings() {
    for name in ["iphone_4s", "hd_4000"] {
        let platform = Platform::builtin(name).unwrap();
        let run = thirty(&platform, 200);
        let all = Circumstances { launch: true, blocking_finish: true, seed: 7 };
        let surrounded = platform.system.surround(&run, &all).unwrap();
        let sum_j: f64 = surrounded.frames.iter().map(|frame| frame.energy_j).sum();
        let curve_j = surrounded.curve.energy_j(surrounded.start_s, surrounded.end_s);
        assert!((sum_j / curve_j - 1.0).abs() < 1e-12, "{name}");
        for kind in [Cause::Launch, Cause::Finish, Cause::Disturbance(1)] {
            assert!(surrounded.pulses.iter().any(|pulse| pulse.cause == kind), "{name}: {kind:?}");
        }
    }
}

#[test]
fn a_table_of_another_node_is_scaled_in_the_core_only() {
    let hd_4000 = Platform::builtin("hd_4000").unwrap();
    let (scaled, table) = (model(&hd_4000), table());
    let volts = hd_4000.v_v.value() / table.v0_v();
    let expected = 0.62 * volts * volts * table.joules(Bound::Nominal)[Event::SampleMadds as usize];
    assert!((scaled.event_j(Event::SampleMadds) / expected - 1.0).abs() < 1e-12);
    // The platform's own rows are not scaled.
    assert!((scaled.event_j(Event::DramReadBytes) / 24e-12 - 1.0).abs() < 1e-12);
    let memory = model(&phone()).event_j(Event::DramReadBytes);
    assert_eq!(memory, table.joules(Bound::Nominal)[Event::DramReadBytes as usize]);
}

#[test]
fn too_many_disturbances_are_an_error_and_no_memory() {
    let mut phone = quiet("");
    let text = "(disturbances: [(name: \"x\", period_s: Assumed(0.0001, \"t\"), irregularity: Assumed(0, \"t\"), \
                duration_s: Assumed(0, \"t\"), extra_w: Assumed(1, \"t\"), variation: Assumed(0, \"t\"))])";
    phone.system = activity::spec::parse(text, "x.ron").unwrap();
    let mut run = thirty(&phone, 1);
    run.curve = Curve::new(vec![0.0, 2e4], vec![1.0]).unwrap();
    let error = phone.system.surround(&run, &SETTLED).unwrap_err();
    assert!(matches!(error, PacingError::TooDisturbed { .. }));
    assert!(error.to_string().contains("20000 s") && error.to_string().contains("10000000"), "{error}");
}

#[test]
fn a_finish_that_returns_after_the_frame_ends_with_it() {
    let mut phone = quiet("");
    phone.idle_w = super::common::watts(0.3);
    let mut run = thirty(&phone, 3);
    run.frames.iter_mut().for_each(|frame: &mut PacedFrame| frame.busy_end_s = frame.end_s - 1e-5);
    let blocked = phone.system.surround(&run, &Circumstances { blocking_finish: true, ..SETTLED }).unwrap();
    assert!(blocked.frames.iter().all(|frame| frame.finish_s == frame.end_s));
}

proptest! {
    /// The added energy is that of the pulses, each clipped to the curve.
    #[test]
    fn an_overlay_adds_the_energy_of_its_pulses(
        lengths in proptest::collection::vec(1e-4f64..0.5, 1..20),
        pulses in proptest::collection::vec((-1.0f64..5.0, 0.0f64..2.0, 0.0f64..10.0), 0..20),
    ) {
        let mut edges_s = vec![0.0];
        edges_s.extend(lengths.iter().scan(0.0, |sum, length| { *sum += length; Some(*sum) }));
        let watts = (0..lengths.len()).map(|i| 1.0 + (i % 3) as f64).collect();
        let curve = Curve::new(edges_s, watts).unwrap();
        let pulses: Vec<Pulse> = pulses
            .into_iter()
            .map(|(start_s, length_s, extra_w)| Pulse { start_s, end_s: start_s + length_s, extra_w, cause: Cause::Finish })
            .collect();
        let over = overlay(&curve, &pulses).unwrap();
        let extra_j: f64 = pulses.iter().map(|pulse| pulse.energy_j(0.0, curve.end_s())).sum();
        let (before_j, after_j) = (curve.energy_j(0.0, 9e9), over.energy_j(0.0, 9e9));
        prop_assert!((after_j - before_j - extra_j).abs() < 1e-9);
        for k in 0..40 {
            let time_s = curve.end_s() * f64::from(k) / 40.0;
            let expected_w = curve.power_at(time_s)
                + pulses.iter().filter(|p| (p.start_s..p.end_s).contains(&time_s)).map(|p| p.extra_w).sum::<f64>();
            prop_assert!((over.power_at(time_s) - expected_w).abs() < 1e-9);
        }
    }
}
