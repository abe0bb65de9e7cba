//! Errors: each mistake gives one message with the file, the position, what is wrong and how to fix it.

use std::path::Path;

use activity::{Bin, Event, Timeline, Unit};
use power_model::{EnergyTable, ModelError, Pacing, PacingError, Platform, PowerModel, TimelineError, pace};

use super::common::{bare, model, reference, steady, table, volts};

const TABLE: &str = include_str!("../../tables/28nm.ron");
const PLATFORM: &str = include_str!("../../platforms/reference.ron");
const PHONE: &str = include_str!("../../platforms/iphone_4s.ron");

/// The message for the table with the first `from` replaced by `to`.
fn table_error(from: &str, to: &str) -> String {
    assert!(TABLE.contains(from), "the table has no `{from}`");
    EnergyTable::parse(&TABLE.replacen(from, to, 1), "mine.ron").unwrap_err().to_string()
}

/// The message for the platform with the first `from` replaced by `to`.
fn platform_error(from: &str, to: &str) -> String {
    assert!(PLATFORM.contains(from), "the platform has no `{from}`");
    Platform::parse(&PLATFORM.replacen(from, to, 1), "mine.ron").unwrap_err().to_string()
}

/// The message for the phone with the first `from` replaced by `to`.
fn phone_error(from: &str, to: &str) -> String {
    assert!(PHONE.contains(from), "the phone has no `{from}`");
    Platform::parse(&PHONE.replacen(from, to, 1), "mine.ron").unwrap_err().to_string()
}

/// First line of `text` that contains `what`, from 1.
fn line_of(text: &str, what: &str) -> usize {
    1 + text.lines().position(|line| line.contains(what)).unwrap()
}

fn assert_says(message: &str, parts: &[&str]) {
    for part in parts {
        assert!(message.contains(part), "`{part}` is missing in: {message}");
    }
}

#[test]
fn a_row_for_an_unknown_event_is_named_with_its_neighbour() {
    let message = table_error("\"sample_madds\"", "\"sample_mads\"");
    let place = format!("mine.ron:{}:", line_of(TABLE, "event: \"sample_madds\""));
    assert_says(&message, &[&place, "unknown event `sample_mads`", "did you mean `sample_madds`?"]);
}

#[test]
fn a_second_row_for_an_event_is_named() {
    let message = table_error("\"tile_madds\"", "\"setup_madds\"");
    assert_says(&message, &["mine.ron", "`setup_madds`", "more than once"]);
    let message = table_error("(event: \"helper_invocations\"", "(event: \"shader_ops\"");
    assert_says(&message, &["mine.ron", "`shader_ops`", "more than once"]);
}

#[test]
fn an_event_without_a_row_is_named() {
    let line = TABLE.lines().find(|line| line.contains("(event: \"helper_invocations\"")).unwrap();
    let message = table_error(line, "");
    assert_says(&message, &["mine.ron", "`helper_invocations`", "has no row", "under `free`"]);
}

#[test]
fn invalid_energies_are_refused_with_their_position() {
    for bad in ["-1", "NaN", "inf", "1e300"] {
        let message = table_error("nominal_pj: 600", &format!("nominal_pj: {bad}"));
        let place = format!("mine.ron:{}:", line_of(TABLE, "nominal_pj: 600"));
        assert_says(&message, &[&place, "pJ is not a number from 0 to 1000000000 pJ"]);
    }
}

#[test]
fn an_interval_out_of_order_is_named_with_its_row() {
    for (from, to) in [("low_pj: 100,", "low_pj: 601,"), ("high_pj: 6000,", "high_pj: 599,")] {
        assert_says(&table_error(from, to), &["mine.ron:", "row `draws`", "not in rising order"]);
    }
}

#[test]
fn a_row_of_no_energy_belongs_under_free() {
    let message = table_error("low_pj: 100, nominal_pj: 600", "low_pj: 0, nominal_pj: 0");
    assert_says(&message, &["mine.ron:", "row `draws`", "under `free`"]);
}

#[test]
fn a_row_without_source_or_width_is_refused() {
    let source = TABLE.lines().find(|line| line.contains("source: ")).unwrap();
    assert_says(&table_error(source, "source: \"\","), &["mine.ron:", "the source is empty"]);
    let per = TABLE.lines().find(|line| line.contains("per: ")).unwrap();
    assert_says(&table_error(per, "per: \" \","), &["mine.ron:", "row `draws`", "`per` is empty"]);
}

#[test]
fn an_unknown_field_of_a_row_is_named_with_its_neighbour() {
    let message = table_error("nominal_pj: 600", "nominal_pJ: 600");
    assert_says(&message, &["mine.ron:", "unknown field `nominal_pJ`", "did you mean `nominal_pj`?"]);
}

#[test]
fn a_reference_voltage_outside_its_own_range_is_refused() {
    assert_says(&table_error("v_min_v: 0.8", "v_min_v: 1.0"), &["mine.ron", "v_min_v <= v0_v <= v_max_v"]);
}

#[test]
fn unknown_names_come_with_the_nearest_known() {
    assert_says(&EnergyTable::builtin("28mm").unwrap_err().to_string(), &["`28mm`", "did you mean `28nm`?"]);
    assert_says(&Platform::builtin("referenz").unwrap_err().to_string(), &["did you mean `reference`?"]);
    assert_says(&Platform::builtin("iphone4s").unwrap_err().to_string(), &["did you mean `iphone_4s`?"]);
}

#[test]
fn a_missing_file_is_named() {
    let nowhere = Path::new("/nonexistent/x.ron");
    assert_says(&EnergyTable::load(nowhere).unwrap_err().to_string(), &["/nonexistent/x.ron", "cannot read"]);
    assert_says(&Platform::load(nowhere).unwrap_err().to_string(), &["/nonexistent/x.ron", "cannot read"]);
}

#[test]
fn invalid_platform_numbers_are_refused_with_their_position() {
    for (from, to, range) in [
        ("constant_w: Assumed(0.80", "constant_w: Assumed(-0.80", "-0.8 W is not a number from 0"),
        ("idle_w: Assumed(0.95", "idle_w: Assumed(NaN", "NaN W is not a number"),
        ("v_v: Assumed(0.9", "v_v: Assumed(0", "0 V is not a number from 0.1"),
        ("lead_in_s: Assumed(0.25", "lead_in_s: Assumed(inf", "inf s is not a number"),
        ("temperature_c: Assumed(60.0", "temperature_c: Assumed(1e9", "degC"),
    ] {
        let place = format!("mine.ron:{}:", line_of(PLATFORM, from));
        assert_says(&platform_error(from, to), &[&place, range, "give one in that range"]);
    }
}

#[test]
fn a_platforms_unknown_words_are_named_with_their_neighbours() {
    let message = platform_error("    idle_w: ", "    idel_w: ");
    assert_says(&message, &["mine.ron:", "unknown field `idel_w`", "did you mean `idle_w`?"]);
    let message = platform_error("unit: \"texture\"", "unit: \"textures\"");
    assert_says(&message, &["mine.ron:", "unknown unit `textures`", "did you mean `texture`?"]);
    let message = platform_error("constant_w: Assumed", "constant_w: Asumed");
    assert_says(&message, &["mine.ron:", "unknown variant `Asumed`", "did you mean `Assumed`?"]);
}

#[test]
fn a_platforms_units_are_there_once_each() {
    let message = platform_error("unit: \"texture\"", "unit: \"colour\"");
    assert_says(&message, &["mine.ron", "unit `colour`", "more than once"]);
    let line = PLATFORM.lines().find(|line| line.contains("unit: \"texture\"")).unwrap();
    assert_says(&platform_error(line, ""), &["mine.ron", "unit `texture` has no row"]);
}

#[test]
fn a_platforms_own_rows_are_there_once_each() {
    let row =
        r#"(event: "draws", low_pj: 1, nominal_pj: 2, high_pj: 3, basis: Assumed, per: "x", source: "y")"#;
    let message = platform_error("    idle_w: ", &format!("    energy_rows: [{row}, {row}],\n    idle_w: "));
    assert_says(&message, &["mine.ron", "event `draws`", "more than once under `energy_rows`"]);
}

#[test]
fn invalid_surroundings_are_refused_with_their_position() {
    for (from, to, parts) in [
        ("launch: (", "lunch: (", ["unknown field `lunch`", "did you mean `launch`?"]),
        ("waiting_w: ", "wating_w: ", ["unknown field `wating_w`", "did you mean `waiting_w`?"]),
        ("irregularity: ", "iregularity: ", ["unknown field `iregularity`", "did you mean `irregularity`?"]),
        ("core_scale: ", "scale: ", ["unknown field `scale`", "known: node_nm, core_scale"]),
        (
            "frame_cap_hz: Published(30",
            "frame_cap_hz: Published(0",
            ["0 Hz is not a number", "give one in that range"],
        ),
        ("extra_w: Published(0.05", "extra_w: Published(-0.05", ["-0.05 W is not", "give one in that range"]),
        (
            "period_s: Published(5.0",
            "period_s: Published(0.0",
            ["0 s is not a number from 0.0001", "give one in that range"],
        ),
        (
            "irregularity: Published(1.0",
            "irregularity: Published(1.5",
            ["1.5 (share) is not", "from 0 to 1 (share)"],
        ),
        ("core_scale: Derived(1.96", "core_scale: Derived(0", ["0 (ratio) is not", "from 0.01 to 100"]),
    ] {
        let place = format!("mine.ron:{}:", line_of(PHONE, from));
        assert_says(&phone_error(from, to), &[&place, parts[0], parts[1]]);
    }
}

#[test]
fn a_disturbance_is_shorter_than_its_period_and_has_a_unique_name() {
    let message = phone_error("duration_s: Published(0.090", "duration_s: Published(6");
    assert_says(&message, &["mine.ron:", "`five_seconds` lasts 6 s but comes every 5 s", "shorten it"]);
    let message = phone_error("name: \"stray_spike\"", "name: \"regular_spike\"");
    assert_says(&message, &["mine.ron", "disturbance `regular_spike`", "more than once"]);
}

#[test]
fn a_number_without_a_reason_is_refused() {
    let reason = PLATFORM.lines().find(|line| line.contains("submit_gap_s")).unwrap();
    let message = platform_error(reason, "    submit_gap_s: Assumed(0.001, \"\"),");
    assert_says(&message, &["mine.ron:", "the source is empty"]);
}

#[test]
fn a_table_for_another_node_or_voltage_is_refused() {
    let mut platform = reference();
    platform.v_v = volts(1.2);
    let error = PowerModel::new(&table(), &platform).unwrap_err();
    assert!(matches!(error, ModelError::Voltage { .. }));
    assert_says(&error.to_string(), &["`reference` runs at 1.2 V", "from 0.8 to 1.1 V"]);
    platform.node_nm = 22;
    let error = PowerModel::new(&table(), &platform).unwrap_err();
    assert!(matches!(error, ModelError::Node { .. }));
    assert_says(&error.to_string(), &["22 nm part", "`28nm` is for 28 nm"]);
}

#[test]
fn a_timeline_that_contradicts_itself_is_refused() {
    let model = model(&bare());
    let good = steady(1000, 2, Event::Draws, 1, 1000);
    let refuse = |timeline: Timeline| model.frame(&timeline).unwrap_err();
    assert_eq!(refuse(Timeline { bin_ps: 0, ..good.clone() }), TimelineError::EmptyBin);
    let error = refuse(Timeline { duration_ps: 2001, ..good.clone() });
    assert_eq!(error, TimelineError::TooShort { bins: 2, bin_ps: 1000, duration_ps: 2001 });
    assert_says(&error.to_string(), &["2 bins of 1000 ps", "frame of 2001 ps"]);
    let error = refuse(Timeline { duration_ps: 1000, ..good.clone() });
    assert_eq!(error, TimelineError::AfterEnd { bin: 1 });
    let error = refuse(Timeline { duration_ps: 1999, ..good });
    assert_says(&error.to_string(), &["bin 1", "`command` busy for 1000 of 999 ps"]);
    let nothing = Timeline { bin_ps: 1, duration_ps: 0, bins: vec![Bin::default()] };
    assert_eq!(model.frame(&nothing).map(|frame| frame.energy().total_j()), Ok(0.0));
    assert_eq!(Unit::Command.name(), "command");
}

#[test]
fn pacing_needs_frames_and_a_rate() {
    assert_eq!(pace(&[], &reference(), Pacing::FreeRunning).unwrap_err(), PacingError::NoFrames);
    for rate_hz in [0.0, -60.0, f64::NAN, f64::INFINITY] {
        assert_says(
            &Pacing::vsync(rate_hz).unwrap_err().to_string(),
            &["the V-sync rate", "Hz is not a number from"],
        );
    }
    assert!(PacingError::NoFrames.to_string().contains("render at least one"));
}

#[test]
fn frames_without_length_lead_in_or_gap_leave_no_curve_to_draw() {
    let nothing = Timeline { bin_ps: 1, duration_ps: 0, bins: vec![] };
    let frame = model(&bare()).frame(&nothing).unwrap();
    let error = pace(&[&frame], &bare(), Pacing::FreeRunning).unwrap_err();
    assert_says(&error.to_string(), &["the power curve of the run", "at least one segment"]);
}

#[test]
fn a_range_has_to_hold_the_number_itself() {
    let message = platform_error("low: 0.6, high: 1.5", "low: 1.2, high: 1.5");
    assert_says(&message, &["mine.ron:", "from 1.2 to 1.5 times", "put low <= 1 <= high"]);
    let message = platform_error("low: 0.6, high: 1.5", "low: 0.6, high: 1500");
    assert_says(&message, &["mine.ron:", "1500 (ratio) is not a number from 0.01 to 100"]);
}

#[test]
fn a_platform_without_its_gpu_is_refused() {
    assert_says(
        &platform_error("    made_for: \"reference\",\n", ""),
        &["mine.ron:", "missing field `made_for`"],
    );
}
