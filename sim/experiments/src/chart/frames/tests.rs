use super::*;
use crate::study::written;

const SMALL: Effort = Effort { frames: 40, rates_hz: &[1e3, 20e3], snrs_db: &[30.0], bits: &[], seeds: &[1] };

fn small() -> (tempfile::TempDir, FramesChart) {
    let (dir, chart, _) = written::<FramesChart>(SMALL);
    (dir, chart)
}

#[test]
fn tracking_finds_the_frames_of_every_scene_and_few_samples_leave_hardly_any() {
    let (dir, chart) = small();
    assert_eq!(chart.rows.len(), 3 * SCENARIOS.len() * Way::ALL.len());
    let f1 = |rate_hz| chart.mean(Axis::Rate, rate_hz, Way::Tracking, |o| Some(o.f1)).unwrap();
    assert!(f1(20e3) > 0.95 && f1(1e3) < f1(20e3), "{} {}", f1(1e3), f1(20e3));
    for row in &chart.rows {
        assert_eq!(row.fails, row.outcome.f1 < FAILS_BELOW);
        assert!(row.outcome.wrong_flagged <= row.outcome.wrong && row.outcome.f1 <= 1.0);
    }
    let text = std::fs::read_to_string(dir.path().join("frames.csv")).unwrap();
    assert_eq!(text.lines().count(), 1 + chart.rows.len());
}

#[test]
fn all_but_host_time_is_the_same_every_time() {
    let without_time = |chart: FramesChart| {
        let mut rows = chart.rows;
        rows.iter_mut().for_each(|row| row.outcome.host_s_per_1e6 = 0.0);
        rows.into_iter().map(|row| row.outcome).collect::<Vec<_>>()
    };
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    assert_eq!(without_time(small().1), without_time(one.install(|| small().1)));
}

#[test]
fn outcomes_are_joined_by_means_and_sums() {
    let a = Outcome { f1: 0.5, energy_error: None, wrong: 2, right: 3, ..Outcome::default() };
    let b = Outcome { f1: 1.0, energy_error: Some(0.1), wrong: 1, right_flagged: 4, ..Outcome::default() };
    let both = joined(&[a, b]);
    assert_eq!(
        (both.f1, both.energy_error, both.wrong, both.right, both.right_flagged),
        (0.75, Some(0.1), 3, 3, 4)
    );
    assert_eq!(joined(&[a]).energy_error, None);
}
