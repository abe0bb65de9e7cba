//! Cases with power and energy known in closed form.

use super::common::{at, bare, model, reference, steady, table, volts, watts};
use activity::{Counts, Event, Unit};
use power_model::{Bound, Energy, Pacing, Part, PowerModel, Seconds, Sourced, pace};

const US_PS: u64 = 1_000_000;

#[test]
fn an_event_at_a_known_rate_draws_rate_times_energy() {
    // 3000 per microsecond are 3e9 per second.
    let frame = model(&bare()).frame(&steady(US_PS, 4, Event::SampleMadds, 3000, 0)).unwrap();
    let expected_w = 3e9 * table().joules(Bound::Nominal)[Event::SampleMadds as usize];
    for watts in frame.watts() {
        assert!((watts[at(Unit::SampleTest)] / expected_w - 1.0).abs() < 1e-14);
        assert_eq!(watts.iter().sum::<f64>(), watts[at(Unit::SampleTest)]);
    }
    assert!((frame.energy().total_j() / (expected_w * 4e-6) - 1.0).abs() < 1e-14);
    assert!((frame.peak_w() / expected_w - 1.0).abs() < 1e-14);
}

#[test]
fn core_energy_goes_with_the_square_of_the_voltage_and_memory_does_not() {
    let mut faster = bare();
    faster.v_v = volts(1.08);
    let (slow, fast) = (model(&bare()), model(&faster));
    for row in table().rows() {
        let ratio = fast.event_j(row.event()) / slow.event_j(row.event());
        let expected = if matches!(row.event().unit(), Unit::Edram | Unit::Dram) { 1.0 } else { 1.44 };
        assert!((ratio - expected).abs() < 1e-12, "{:?}: {ratio}", row.event());
    }
}

#[test]
fn an_idle_frame_draws_constant_power_and_leakage() {
    let platform = reference();
    let frame = model(&platform).frame(&steady(US_PS, 3, Event::Draws, 0, 0)).unwrap();
    let seconds = 3e-6;
    let energy = frame.energy();
    assert!((energy[Part::Constant] / (platform.constant_w.value() * seconds) - 1.0).abs() < 1e-14);
    assert!((energy[Part::Leakage] / (platform.leakage_w() * seconds) - 1.0).abs() < 1e-14);
    assert_eq!(energy.total_j(), energy[Part::Constant] + energy[Part::Leakage]);
}

#[test]
fn a_used_unit_clocks_while_busy_and_idles_otherwise_and_the_others_do_not_exist() {
    let platform = reference();
    let timeline = steady(US_PS, 2, Event::TextureFetches, 1, US_PS / 4);
    let frame = model(&platform).frame(&timeline).unwrap();
    let row = &platform.units()[at(Unit::Texture)];
    let expected_j = 2e-6 * (0.25 * row.clock_tree_w.value() + 0.75 * row.idle_unit_w.value());
    assert!((frame.energy()[Part::ClockTree] / expected_j - 1.0).abs() < 1e-13);
}

#[test]
fn a_partial_last_bin_keeps_its_joules_and_its_watts_are_over_its_own_length() {
    let mut platform = bare();
    platform.constant_w = watts(2.0);
    let mut timeline = steady(US_PS, 3, Event::SampleMadds, 1000, 0);
    timeline.duration_ps = 2 * US_PS + US_PS / 4;
    let frame = model(&platform).frame(&timeline).unwrap();
    let event_j = 1000.0 * table().joules(Bound::Nominal)[Event::SampleMadds as usize];
    assert_eq!(frame.energy()[Part::Unit(Unit::SampleTest)], event_j + event_j + event_j);
    assert!((frame.energy()[Part::Constant] / (2.0 * 2.25e-6) - 1.0).abs() < 1e-14);
    let last_w = frame.watts()[2];
    assert!((last_w[at(Unit::SampleTest)] / (event_j / 0.25e-6) - 1.0).abs() < 1e-14);
    assert!((last_w[Part::Constant.index()] - 2.0).abs() < 1e-14);
    let lengths: Vec<f64> = frame.bins().map(|(length_s, _)| length_s).collect();
    assert!((lengths[2] / 0.25e-6 - 1.0).abs() < 1e-14 && lengths.len() == 3);
}

#[test]
fn bins_past_the_end_of_the_frame_cost_nothing() {
    let mut timeline = steady(US_PS, 2, Event::SampleMadds, 10, 0);
    let without = model(&reference()).frame(&timeline).unwrap();
    timeline.bins.resize(5, activity::Bin::default());
    assert_eq!(model(&reference()).frame(&timeline).unwrap(), without);
}

#[test]
fn counts_from_a_file_have_the_energy_of_their_rows() {
    let mut counts = Counts::default();
    counts[Event::DramReadBytes] = 5_000_000;
    counts[Event::TilesCulledSides] = 99;
    let model = model(&reference());
    let energy = model.counts_energy(&counts);
    assert_eq!(energy.total_j(), 5e6 * model.event_j(Event::DramReadBytes));
    assert_eq!(energy[Part::Unit(Unit::Dram)], energy.total_j());
    assert_eq!(model.counts_energy(&Counts::default()), Energy::ZERO);
}

#[test]
fn a_platform_row_replaces_the_tables() {
    let text = include_str!("bare.ron").trim_end().trim_end_matches(')').to_owned()
        + r#"energy_rows: [(event: "dram_read_bytes", low_pj: 1, nominal_pj: 2, high_pj: 3, supply: Memory,
             basis: Assumed, per: "a byte", source: "for this test")])"#;
    let platform = power_model::Platform::parse(&text, "own.ron").unwrap();
    for (bound, pj) in [(Bound::Low, 1.0), (Bound::Nominal, 2.0), (Bound::High, 3.0)] {
        let model = PowerModel::at(&table(), &platform, bound).unwrap();
        assert_eq!(model.event_j(Event::DramReadBytes), pj * 1e-12);
    }
    assert_eq!(model(&platform).event_j(Event::ShaderOps), model(&bare()).event_j(Event::ShaderOps));
}

#[test]
fn under_v_sync_frames_start_on_ticks_and_idle_in_between() {
    let platform = reference();
    let frame = model(&platform).frame(&steady(100 * US_PS, 45, Event::ShaderOps, 1_000_000, 0)).unwrap();
    let run = pace(&[&frame, &frame, &frame], &platform, Pacing::vsync(100.0).unwrap()).unwrap();
    let lead_in_s = platform.lead_in_s.value();
    for (index, paced) in run.frames.iter().enumerate() {
        assert!((paced.start_s - lead_in_s - 0.01 * index as f64).abs() < 1e-12);
        assert!((paced.busy_end_s - paced.start_s - 0.0045).abs() < 1e-12);
        assert!((paced.energy[Part::Idle] / (0.0055 * platform.idle_w.value()) - 1.0).abs() < 1e-12);
    }
    assert!((run.end_s - run.start_s - 0.03).abs() < 1e-12);
    assert!((run.curve.end_s() - run.end_s - platform.tail_s.value()).abs() < 1e-12);
    assert!(run.warnings.is_empty());
    assert_eq!(run.curve.power_at(0.0), platform.idle_w.value());
}

#[test]
fn free_running_frames_follow_after_the_submission_gap() {
    let mut platform = reference();
    platform.submit_gap_s = Sourced::Assumed(Seconds::new(0.001).unwrap(), super::common::source());
    let frame = model(&platform).frame(&steady(100 * US_PS, 20, Event::ShaderOps, 10, 0)).unwrap();
    let run = pace(&[&frame, &frame], &platform, Pacing::FreeRunning).unwrap();
    for paced in &run.frames {
        assert!((paced.busy_end_s - paced.start_s - 0.002).abs() < 1e-12);
        assert!((paced.end_s - paced.busy_end_s - 0.001).abs() < 1e-12);
    }
    assert_eq!(run.frames[0].end_s, run.frames[1].start_s);
}

#[test]
fn frames_longer_than_a_period_miss_ticks_and_it_is_said_once() {
    let platform = reference();
    let model = model(&platform);
    let long = model.frame(&steady(100 * US_PS, 250, Event::ShaderOps, 10, 0)).unwrap();
    let short = model.frame(&steady(100 * US_PS, 50, Event::ShaderOps, 10, 0)).unwrap();
    let run = pace(&[&long, &short, &long], &platform, Pacing::vsync(100.0).unwrap()).unwrap();
    assert!((run.frames[1].start_s - run.start_s - 0.03).abs() < 1e-12);
    let [warning] = run.warnings.as_slice() else { panic!("{:?}", run.warnings) };
    assert_eq!(warning.code, "missed-vsync");
    assert!(warning.message.starts_with("2 of 3 frames"), "{warning}");
    assert!(warning.message.contains("(ticks missed in all: 4)"), "{warning}");
}
