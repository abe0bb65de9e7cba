//! Stamps in pieces, compared with the rule applied to all of them at once.

use super::*;
use proptest::prelude::*;

const PATH: &str = "t.csv";

/// The rule, in the order in which it complains: all rows in time, all steps equal, all rows in place.
fn oracle(stamps: &Stamps, description: &Description) -> Result<Grid, String> {
    let count = stamps.len();
    let since = |row: usize, earlier: usize| match stamps {
        Stamps::Nanoseconds(times) => (i128::from(times[row]) - i128::from(times[earlier])) as f64 / 1e9,
        Stamps::Seconds(times) => times[row] - times[earlier],
        Stamps::Absent => 0.0,
    };
    let time = |row: usize| stamps.time_s(row);
    for row in 0..count {
        if !time(row).is_finite() {
            return Err(format!("row {}: time_s is {}", row + 1, time(row)));
        }
        if row > 0 && since(row, row - 1) <= 0.0 {
            return Err(format!("row {}: time {} s is not after {} s", row + 1, time(row), time(row - 1)));
        }
    }
    let off = |row: usize, off: f64, hz: f64| {
        Err(format!(
            "row {}: time {} s is {off:.2} sample periods off an even rate of {hz} Hz",
            row + 1,
            time(row)
        ))
    };
    let rate_hz = match description.rate_hz {
        Some(rate_hz) => rate_hz,
        None if count == 1 => return Err("sample rate is unknown".to_owned()),
        None => {
            let mut steps: Vec<f64> = (1..count.min(1002)).map(|row| since(row, row - 1)).collect();
            steps.sort_by(f64::total_cmp);
            let guess_s = steps[steps.len() / 2];
            for row in 1..count {
                let step = since(row, row - 1) / guess_s - 1.0;
                if step.abs() > 0.5 {
                    return off(row, step, 1.0 / guess_s);
                }
            }
            let resolution_s = if matches!(stamps, Stamps::Nanoseconds(_)) { 1.5e-9 } else { f64::INFINITY };
            rounded_rate_hz((count - 1) as f64, since(count - 1, 0), resolution_s)
        }
    };
    for row in 1..count {
        let off_periods = since(row, 0) * rate_hz - row as f64;
        if off_periods.abs() > 0.25 {
            return off(row, off_periods, rate_hz);
        }
    }
    Ok(Grid {
        start_s: description.start_s.filter(|s| (s - time(0)).abs() * rate_hz <= 0.25).unwrap_or(time(0)),
        rate_hz,
    })
}

fn in_pieces(stamps: &Stamps, description: &Description, pieces: &[usize]) -> Result<Grid, String> {
    let fit = |rate_hz: Option<f64>| {
        let mut fit = Fit::new(Path::new(PATH), rate_hz, description.start_s);
        let (mut from, mut sizes) = (0, pieces.iter().cycle());
        while from < stamps.len() {
            let to = stamps.len().min(from + sizes.next().unwrap());
            fit.push(&match stamps {
                Stamps::Nanoseconds(times) => Stamps::Nanoseconds(times[from..to].to_vec()),
                Stamps::Seconds(times) => Stamps::Seconds(times[from..to].to_vec()),
                Stamps::Absent => Stamps::Absent,
            });
            from = to;
        }
        fit.conclude().map_err(|error| error.to_string())
    };
    let fitted = fit(description.rate_hz)?;
    if fitted.sure { Ok(fitted.grid) } else { Ok(fit(Some(fitted.grid.rate_hz))?.grid) }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]
    #[test]
    fn property_pieces_of_any_size_give_what_the_rule_for_all_rows_gives(
        rows in 1_usize..2500,
        rate_hz in prop_oneof![Just(1000.0), Just(44_117.65), Just(1e6 / 3.0), 0.1..1e6_f64],
        whole in any::<bool>(),
        stated in prop_oneof![Just(None), Just(Some(1.0)), Just(Some(1.0001)), Just(Some(1.0003)), Just(Some(1.3))],
        faults in prop::collection::vec((1_usize..2500, prop_oneof![Just(0.1), Just(0.3), Just(-3.0), Just(5.0), Just(f64::NAN)], any::<bool>()), 0..3),
        drift in prop_oneof![Just(0.0), Just(1e-7), Just(1e-5)],
        pieces in prop::collection::vec(1_usize..1500, 1..4),
    ) {
        let mut times: Vec<f64> = (0..rows).map(|row| 3.0 + (row as f64 + drift * (row as f64).powi(2)) / rate_hz).collect();
        for (at, periods, all_after) in faults {
            let end = if all_after { rows } else { rows.min(at + 1) };
            times.iter_mut().take(end).skip(at).for_each(|time| *time += periods / rate_hz);
        }
        let stamps = if whole {
            Stamps::Nanoseconds(times.iter().map(|time| (time * 1e9).round() as i64).collect())
        } else {
            Stamps::Seconds(times)
        };
        let description = Description { rate_hz: stated.map(|share| share * rate_hz), start_s: Some(3.0), ..Description::default() };
        let (said, says) = (in_pieces(&stamps, &description, &pieces), oracle(&stamps, &description));
        match (&said, &says) {
            (Err(said), Err(says)) => prop_assert!(said.contains(says.as_str()), "{} {}", said, says),
            _ => prop_assert_eq!(said, says),
        }
    }
}

#[test]
fn a_rate_that_puts_one_late_row_a_hair_off_is_looked_at_again() {
    for (hair, right) in [(0.2499, true), (0.2501, false)] {
        let mut times: Vec<f64> = (0..5000).map(f64::from).collect();
        times[4000] += hair;
        let stamps = Stamps::Seconds(times);
        let result = in_pieces(&stamps, &Description::default(), &[700]);
        assert_eq!(result.is_ok(), right, "{result:?}");
        assert_eq!(result.is_ok(), oracle(&stamps, &Description::default()).is_ok());
    }
}

#[test]
fn a_step_between_two_pieces_is_compared_with_the_others_too() {
    for (at, periods) in [(1100, 5), (1100, -5), (1101, 5), (2199, 1), (2200, 1), (2201, 1)] {
        let time = |row: i64| 1_000_000 * (row + if row < at { 0 } else { periods });
        let stamps = Stamps::Nanoseconds((0..3000).map(time).collect());
        let result = in_pieces(&stamps, &Description::default(), &[1100]).unwrap_err();
        let says = oracle(&stamps, &Description::default()).unwrap_err();
        assert!(result.contains(&says), "{result} {says}");
    }
}

#[test]
fn times_that_wrap_around_are_not_in_order() {
    let times = vec![i64::MAX - 3, i64::MAX - 1, i64::MIN, i64::MIN + 2, i64::MIN + 4];
    let description = Description { rate_hz: Some(5e8), ..Description::default() };
    // Without a rate, after enough rows to know the step.
    let wrapping = (0..1500_i64).map(|row| (i64::MAX - 2600).wrapping_add(2 * row)).collect();
    let message = in_pieces(&Stamps::Nanoseconds(wrapping), &Description::default(), &[1100]).unwrap_err();
    assert!(message.contains("row 1302") && message.contains("is not after"), "{message}");
    let message = in_pieces(&Stamps::Nanoseconds(times), &description, &[1, 4]).unwrap_err();
    assert!(message.contains("row 3") && message.contains("is not after"), "{message}");
}

fn fit(stamps: Stamps) -> Result<Grid, ReadError> {
    grid(Path::new("t.csv"), &stamps, &Description::default())
}

#[test]
fn rates_come_out_whole_from_rounded_stamps() {
    let nanoseconds = |rate: f64| {
        Stamps::Nanoseconds((0..5000).map(|i| (f64::from(i) * 1e9 / rate).round() as i64).collect())
    };
    assert_eq!(fit(nanoseconds(50e3)).unwrap().rate_hz, 50e3);
    assert_eq!(fit(nanoseconds(3e6)).unwrap().rate_hz, 3e6);
    let microseconds =
        Stamps::Seconds((0..5000).map(|i| (f64::from(i) * 1e6 / 44_100.0).round() / 1e6).collect());
    assert_eq!(fit(microseconds).unwrap().rate_hz, 44_100.0);
    let slow = fit(Stamps::Seconds((0..9).map(|i| 100.0 + 2.5 * f64::from(i)).collect())).unwrap();
    assert_eq!(slow, Grid { start_s: 100.0, rate_hz: 0.4 });
}

#[test]
fn each_bad_stamp_is_named_with_its_row() {
    let message = |times: &[f64]| fit(Stamps::Seconds(times.to_vec())).unwrap_err().to_string();
    assert!(message(&[0.0, 1.0, 1.0]).contains("t.csv: row 3: time 1 s is not after 1 s"));
    assert!(
        message(&[0.0, 1.0, 2.0, 4.0, 5.0])
            .contains("row 4: time 4 s is 1.00 sample periods off an even rate of 1 Hz")
    );
    assert!(message(&[0.0, 1.0, 2.0, 3.4, 4.0]).contains("row 4"));
    assert!(message(&[0.0, f64::NAN]).contains("row 2: time_s is NaN"));
    assert!(message(&[0.0]).contains("sample rate is unknown"));
}

#[test]
fn a_wrong_stated_rate_is_found() {
    let description = Description { rate_hz: Some(2.0), ..Description::default() };
    let error = grid(Path::new("t.csv"), &Stamps::Seconds(vec![0.0, 1.0]), &description).unwrap_err();
    assert!(error.to_string().contains("row 2") && error.to_string().contains("2 Hz"), "{error}");
}

#[test]
fn stamps_coarser_than_the_samples_need_a_stated_rate_and_agree_with_it() {
    let rounded = |rate_hz: f64| {
        Stamps::Seconds((0..900).map(|i| (f64::from(i) * 1e3 / rate_hz).round() / 1e3).collect())
    };
    let stated = |rate_hz| Description { rate_hz: Some(rate_hz), ..Description::default() };
    let grid = |stamps: &Stamps, description: &Description| grid(Path::new("t.csv"), stamps, description);
    for rate_hz in [1250.0, 2500.0, 9000.0] {
        let stamps = rounded(rate_hz);
        assert_eq!(grid(&stamps, &stated(rate_hz)).unwrap(), Grid { start_s: 0.0, rate_hz });
        let error = grid(&stamps, &Description::default()).unwrap_err().to_string();
        assert!(error.contains("give --rate"), "{error}");
        let error = grid(&stamps, &stated(1.02 * rate_hz)).unwrap_err().to_string();
        assert!(error.contains("off an even rate"), "{error}");
    }
    let twice = Stamps::Seconds([0, 1, 2, 2, 3, 4].map(|i| f64::from(i) / 1e3).to_vec());
    let error = grid(&twice, &stated(1e3)).unwrap_err().to_string();
    assert!(error.contains("row 4") && error.contains("1.00 sample periods off"), "a row too many: {error}");
    let error = grid(&Stamps::Seconds(vec![2.0; 9]), &stated(1e3)).unwrap_err().to_string();
    assert!(error.contains("row 2: time 2 s is not after 2 s"), "{error}");
}

#[test]
fn coarse_stamps_with_gaps_have_their_rate() {
    let stamps = (0..4000_u32).filter(|row| row % 1000 != 500);
    let times: Vec<f64> = stamps.map(|row| libm::round(f64::from(row) * 2.2) / 1000.0).collect();
    assert!((mean_rate_hz(&times) * 0.0022 - 1.0).abs() < 1e-3, "{}", mean_rate_hz(&times));
}
