use super::*;
use crate::Trace;

/// Times from start to start, s.
fn gaps(scenario: &Scenario, frames: usize, seed: u64) -> Vec<f64> {
    let scene = scenario.scene(frames, seed).unwrap();
    scene.truth.windows(2).map(|two| two[1].start_s - two[0].start_s).collect()
}

#[test]
fn frames_follow_one_another_and_their_energies_add_up() {
    for scenario in SCENARIOS {
        let scene = scenario.scene(40, 3).unwrap();
        assert_eq!(scene.truth.len(), 40);
        assert!(scene.truth.windows(2).all(|two| two[0].start_s < two[1].start_s), "{}", scenario.name);
        let sum: f64 = scene.truth.iter().map(|frame| frame.energy_j).sum();
        let whole = scene.curve.energy_j(scene.truth[0].start_s, scene.end_s);
        assert!((sum - whole).abs() < 1e-9 * whole, "{}", scenario.name);
    }
}

#[test]
fn v_sync_keeps_to_ticks_and_free_running_does_not_wait() {
    let on_tick = |gap: &f64| (gap * 60.0 - (gap * 60.0).round()).abs() < 1e-6;
    assert!(gaps(&SCENARIOS[0], 30, 1).iter().all(on_tick));
    assert!(!gaps(&SCENARIOS[1], 30, 1).iter().any(on_tick));
}

#[test]
fn clock_steps_stretch_frames_and_lower_power() {
    let steady = Scenario { content: 0.0, ..SCENARIOS[1] };
    let ratio = |gaps: &[f64]| {
        let ends = gaps.iter().fold((f64::INFINITY, 0.0_f64), |(a, b), &g| (a.min(g), b.max(g)));
        ends.1 / ends.0
    };
    assert!(ratio(&gaps(&steady, 600, 5)) < 1.1);
    assert!(ratio(&gaps(&Scenario { clocks: true, ..steady }, 600, 5)) > 1.3);
}

#[test]
fn three_phases_are_idle_twice_within_a_frame() {
    let scene = SCENARIOS[2].scene(3, 4).unwrap();
    let (a_s, b_s) = (scene.truth[0].start_s, scene.truth[1].start_s);
    let edges = scene.curve.edges_s().windows(2).zip(scene.curve.watts());
    let idle = edges.filter(|(edge, watts)| {
        edge[0] >= a_s && edge[1] <= b_s && **watts < 0.56 && edge[1] - edge[0] > 2e-3
    });
    assert_eq!(idle.count(), 3, "two gaps and the wait for the tick");
}

#[test]
fn content_launch_drift_and_disturbances_each_change_the_energy_of_frames() {
    let energies = |scenario: &Scenario| -> Vec<f64> {
        scenario.scene(200, 6).unwrap().truth.iter().map(|frame| frame.energy_j).collect()
    };
    let plain = energies(&SCENARIOS[0]);
    let differ = |scenario: Scenario| {
        let other = energies(&scenario);
        other.iter().zip(&plain).filter(|(a, b)| (*a - *b).abs() > 1e-9).count()
    };
    let plain_scenario = SCENARIOS[0];
    assert_eq!(differ(plain_scenario), 0);
    assert_eq!(differ(Scenario { launch: true, ..plain_scenario }), 48);
    assert_eq!(differ(Scenario { drift: true, ..plain_scenario }), 200);
    // 3.3 s of frames, a burst of 0.09 s every 2 s: one or two, each over at most seven frames.
    assert!((5..=14).contains(&differ(Scenario { disturbed: true, ..plain_scenario })));
    assert!(differ(Scenario { content: 0.1, ..plain_scenario }) > 190);
}

#[test]
fn a_longer_scene_begins_like_a_shorter_one_and_another_seed_differs() {
    let of = |frames, seed| SCENARIOS[7].scene(frames, seed).unwrap().truth;
    assert_eq!(of(20, 3)[..19], of(60, 3)[..19]);
    assert_ne!(of(20, 3)[1..], of(20, 4)[1..]);
}

#[test]
fn noise_is_as_asked_and_the_same_seed_gives_the_same_trace() {
    let scene = SCENARIOS[1].scene(100, 2).unwrap();
    let at = |snr_db: f64| scene.record(&Recording { snr_db, seed: 9, ..Recording::default() }).unwrap();
    let powers = |trace: &Trace| trace.powers_w().collect::<Vec<_>>();
    let (noisy, clean) = (powers(&at(0.0)), powers(&at(200.0)));
    let inner = 20_000..40_000;
    let variance = |x: Vec<f64>| {
        let mean = x.iter().sum::<f64>() / x.len() as f64;
        x.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / x.len() as f64
    };
    let noise = variance(inner.clone().map(|i| noisy[i] - clean[i]).collect());
    let ratio = variance(inner.map(|i| clean[i]).collect()) / noise;
    assert!((0.8..1.25).contains(&ratio), "{ratio}");
    assert_eq!(at(0.0), at(0.0));
    assert!(scene.record(&Recording { bits: 99, ..Recording::default() }).is_err());
}

#[test]
fn auto_tracks_unless_the_window_has_hardly_any_samples() {
    use crate::frames::{Marks, Method, default_window, find};
    let scene = SCENARIOS[1].scene(40, 2).unwrap();
    let method = |rate_hz: f64| {
        let trace = scene.record(&Recording { rate_hz, ..Recording::default() }).unwrap();
        let window = default_window(0.0, rate_hz);
        find(&trace, &Marks::one(scene.truth[15].start_s, window, trace.end_s())).unwrap().method
    };
    assert_eq!((method(50e3), method(2e3)), (Method::Tracking, Method::SumOfSquares));
}

#[test]
fn no_frames_are_idle_alone() {
    let scene = SCENARIOS[0].scene(0, 1).unwrap();
    assert!(scene.truth.is_empty() && scene.curve.watts() == [0.55]);
    assert!(scene.record(&Recording::default()).is_ok());
}
