//! Properties of all timelines and runs.

use super::common::{model, reference};
use activity::{Bin, Event, Timeline, Unit};
use power_model::{Bound, Energy, FramePower, PARTS, Pacing, Part, PowerModel, pace};
use proptest::prelude::*;

fn bin(length_ps: u64) -> impl Strategy<Value = Bin> {
    let counts = prop::collection::vec(0..100_000_u64, Event::COUNT);
    let busy_ps = prop::collection::vec(0..=length_ps, Unit::COUNT);
    (counts, busy_ps).prop_map(|(counts, busy_ps)| {
        let mut bin = Bin::default();
        for (event, count) in Event::ALL.into_iter().zip(counts) {
            bin.counts[event] = count;
        }
        for (to, from) in bin.busy_ps.iter_mut().zip(busy_ps) {
            *to = from;
        }
        bin
    })
}

/// One to eight bins; the last one may be partial.
fn timeline() -> impl Strategy<Value = Timeline> {
    (1_000..20_000_000_u64, 1..8_usize, 1..1_000_u64).prop_flat_map(|(bin_ps, count, cut)| {
        let last_ps = 1 + (bin_ps - 1) * cut / 1_000;
        let whole = prop::collection::vec(bin(bin_ps), count - 1);
        (whole, bin(last_ps)).prop_map(move |(mut bins, last)| {
            bins.push(last);
            Timeline { bin_ps, duration_ps: bin_ps * (count as u64 - 1) + last_ps, bins }
        })
    })
}

fn frame(timeline: &Timeline) -> FramePower {
    model(&reference()).frame(timeline).unwrap()
}

fn close(a: f64, b: f64, relative: f64) -> bool {
    (a - b).abs() <= relative * a.abs().max(b.abs())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn energies_are_never_negative_and_parts_are_the_total(timeline in timeline()) {
        let frame = frame(&timeline);
        prop_assert!(frame.energy().by_part_j.iter().all(|joules| joules.is_finite() && *joules >= 0.0));
        let mut sum_j = 0.0;
        for part in Part::ALL {
            sum_j += frame.energy()[part];
        }
        prop_assert_eq!(sum_j, frame.energy().total_j());
    }

    #[test]
    fn watts_over_bins_integrate_to_the_energy_part_by_part(timeline in timeline()) {
        let frame = frame(&timeline);
        let mut joules = [0.0; PARTS];
        for (length_s, watts) in frame.bins() {
            for (sum, watts) in joules.iter_mut().zip(watts) {
                *sum += watts * length_s;
            }
        }
        for (part, sum_j) in Part::ALL.into_iter().zip(joules) {
            prop_assert!(close(sum_j, frame.energy()[part], 1e-13), "{:?}", part);
        }
    }

    #[test]
    fn event_energies_of_a_frame_are_those_of_its_total_counts(timeline in timeline()) {
        let (model, frame) = (model(&reference()), frame(&timeline));
        let from_counts = model.counts_energy(&timeline.total());
        for unit in Unit::ALL {
            prop_assert!(close(from_counts[Part::Unit(unit)], frame.energy()[Part::Unit(unit)], 1e-13));
        }
    }

    #[test]
    fn a_timeline_twice_over_costs_twice(mut timeline in timeline()) {
        timeline.duration_ps = timeline.bin_ps * timeline.bins.len() as u64;
        let once = frame(&timeline);
        timeline.bins.extend(timeline.bins.clone());
        timeline.duration_ps *= 2;
        let twice = frame(&timeline);
        let mut sum = *once.energy();
        sum += once.energy();
        for part in Part::ALL {
            prop_assert!(close(sum[part], twice.energy()[part], 1e-13));
        }
    }

    #[test]
    fn low_nominal_and_high_stay_in_order(timeline in timeline()) {
        let joules = Bound::ALL.map(|bound| {
            let model = PowerModel::at(&super::common::table(), &reference(), bound).unwrap();
            model.frame(&timeline).unwrap().energy().total_j()
        });
        prop_assert!(joules.is_sorted());
    }

    #[test]
    fn paced_frames_add_up_to_the_integral_of_the_curve(
        timelines in prop::collection::vec(timeline(), 1..40),
        rate_hz in prop::option::of(1.0..50_000.0_f64),
    ) {
        let platform = reference();
        let frames: Vec<FramePower> = timelines.iter().map(frame).collect();
        let pacing = rate_hz.map_or(Pacing::FreeRunning, |rate_hz| Pacing::vsync(rate_hz).unwrap());
        let run = pace(&frames.iter().collect::<Vec<_>>(), &platform, pacing).unwrap();

        let sum_j: f64 = run.frames.iter().map(|frame| frame.energy.total_j()).sum();
        let curve_j = run.curve.energy_j(run.start_s, run.end_s);
        prop_assert!(close(sum_j, curve_j, 1e-12), "{} against {}", sum_j, curve_j);
        prop_assert!(close(run.energy().total_j(), curve_j, 1e-12));
        let mut parts = Energy::ZERO;
        for frame in &run.frames {
            parts += &frame.energy;
        }
        prop_assert_eq!(parts, run.energy());
    }

    #[test]
    fn paced_frames_abut_and_idle_only_after_their_work(
        timelines in prop::collection::vec(timeline(), 1..20),
        rate_hz in 1.0..50_000.0_f64,
    ) {
        let frames: Vec<FramePower> = timelines.iter().map(frame).collect();
        let run = pace(&frames.iter().collect::<Vec<_>>(), &reference(), Pacing::vsync(rate_hz).unwrap()).unwrap();
        prop_assert_eq!(run.frames[0].start_s, run.start_s);
        prop_assert_eq!(run.frames.last().map(|frame| frame.end_s), Some(run.end_s));
        prop_assert!(run.frames.windows(2).all(|pair| pair[0].end_s == pair[1].start_s));
        for (paced, frame) in run.frames.iter().zip(&frames) {
            prop_assert!(paced.start_s < paced.busy_end_s && paced.busy_end_s <= paced.end_s);
            prop_assert!((paced.busy_end_s - paced.start_s - frame.duration_s()).abs() < 1e-12);
            let periods = (paced.start_s - run.start_s) * rate_hz;
            prop_assert!((periods - periods.round()).abs() < 1e-6, "frame starts off a tick: {}", periods);
        }
    }
}

/// Bins of one microsecond over frames of two minutes in total: rounding errors must not grow with the number
/// of bins.
#[test]
fn a_million_bins_keep_the_sum_and_the_integral_together() {
    let mut timeline = super::common::steady(1_000_000, 4_000, Event::ShaderOps, 1_000, 400_000);
    for (index, bin) in timeline.bins.iter_mut().enumerate() {
        bin.counts[Event::SampleMadds] = (index * 7919 % 10_007) as u64;
    }
    let frame = frame(&timeline);
    let run = pace(&vec![&frame; 250], &reference(), Pacing::vsync(60.0).unwrap()).unwrap();
    let curve_j = run.curve.energy_j(run.start_s, run.end_s);
    let sum_j: f64 = run.frames.iter().map(|frame| frame.energy.total_j()).sum();
    assert!(close(sum_j, curve_j, 1e-12), "{sum_j} against {curve_j}");
}
