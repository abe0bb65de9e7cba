//! Parsers of flag values: numbers, and physical quantities whose unit may be left out. Errors describe the
//! expected form.

use std::ops::Range;
use std::str::FromStr;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use experiments::stress::measure::SWITCHES;
use pipeline::Features;
use traces::units::{self, PhysicalQuantity};

/// Parser of one of some values, each with its name and a sentence for the help.
pub(super) fn named<T: Clone + Send + Sync + 'static, const N: usize>(
    values: [(T, &'static str, &'static str); N],
) -> impl TypedValueParser<Value = T> {
    let names = values.each_ref().map(|(_, name, help)| PossibleValue::new(*name).help(*help));
    PossibleValuesParser::new(names).try_map(move |given| {
        let known = values.iter().find(|(_, name, _)| given.eq_ignore_ascii_case(name));
        known.map(|(value, ..)| value.clone()).ok_or(format!("unknown value `{given}`"))
    })
}

/// Range of frames, the end not included; at least one frame.
pub(super) fn frames(text: &str) -> Result<Range<u32>, String> {
    let wrong = || format!("`{text}` is not a range of frames; write it as 0..36");
    let (start, end) = text.split_once("..").ok_or_else(wrong)?;
    let number = |part: &str| part.trim().parse::<u32>().map_err(|_| wrong());
    let (start, end) = (number(start)?, number(end)?);
    match start < end {
        true => Ok(start..end),
        false => Err(format!(
            "the range `{text}` is empty; the end is not included, so one frame is {start}..{}",
            start.saturating_add(1)
        )),
    }
}

/// Set of tile tests, by their names in GPU files.
pub(super) fn tests(text: &str) -> Result<Features, String> {
    match text {
        "all" => return Ok(Features::ALL),
        "none" => return Ok(Features::NONE),
        "auto" => return Ok(Features { auto: true, ..Features::ALL }),
        _ => {}
    }
    let mut features = Features::NONE;
    for name in text.split(',').map(|name| name.trim().replace('-', "_")) {
        let switch = SWITCHES.iter().find(|switch| switch.name == name).ok_or_else(|| {
            let names = SWITCHES.map(|switch| switch.name).join(", ");
            format!("unknown tile test `{name}`; there are {names}, or all, none, auto")
        })?;
        (switch.on)(&mut features);
    }
    Ok(features)
}

/// Name and value, separated by `=`.
pub(super) fn setting(text: &str) -> Result<(String, String), String> {
    let (name, value) =
        text.split_once('=').ok_or_else(|| format!("`{text}` has no value; write it as name=value"))?;
    Ok((name.trim().to_owned(), value.trim().to_owned()))
}

/// Share in percent, above 0 % and at most 100 %, as a fraction.
pub(super) fn percent(text: &str) -> Result<f64, String> {
    let number =
        text.trim_end().strip_suffix('%').ok_or_else(|| format!("`{text}` has no %; write it as 2%"))?;
    let value: f64 = number.trim().parse().map_err(|_| format!("`{text}` is not a share; write it as 2%"))?;
    if value > 0.0 && value <= 100.0 {
        return Ok(value / 100.0);
    }
    Err(format!("`{text}` cannot be met; it has to be more than 0% and at most 100%, for example 2%"))
}

/// Duration in seconds. The unit is required, because a bare number is ambiguous.
pub(super) fn duration(text: &str) -> Result<f64, String> {
    let wrong = || format!("`{text}` is not a time; write it as 30s, 500ms, 2min or 1h");
    if text.trim().ends_with(|last: char| last.is_ascii_digit() || last == '.') {
        return Err(wrong());
    }
    length_of_time(text).map_err(|_| wrong())
}

/// A seed.
pub(super) fn seed(text: &str) -> Result<u64, String> {
    text.trim().parse().map_err(|_| format!("a seed has to be a whole number from 0 to {}", u64::MAX))
}

/// Width and height, each 1 to 16384.
pub(super) fn size(text: &str) -> Result<(u32, u32), String> {
    let wrong = || format!("`{text}` is not a size; write it as 1280x720, each side 1 to 16384 pixels");
    let (width, height) = text.split_once(['x', 'X']).ok_or_else(wrong)?;
    let side = |part: &str| {
        let pixels = part.trim().parse().ok().filter(|side| (1..=MAX_SIDE_PX).contains(side));
        pixels.ok_or_else(wrong)
    };
    Ok((side(width)?, side(height)?))
}

/// Largest side of an image in pixels.
const MAX_SIDE_PX: u32 = 16_384;

/// Samples per pixel.
pub(super) fn per_pixel(text: &str) -> Result<u32, String> {
    let samples = text.trim().parse().ok().filter(|samples| (1..=256).contains(samples));
    samples.ok_or_else(|| format!("`{text}` is not a number of samples; it has to be 1 to 256"))
}

/// Radius of a lens in scene units.
pub(super) fn lens(text: &str) -> Result<f32, String> {
    number(text, "a radius of the lens in scene units; it has to be a finite number of at least 0", |r| {
        r >= 0.0
    })
}

/// Depth in scene units.
pub(super) fn depth(text: &str) -> Result<f32, String> {
    number(text, "a depth in scene units; it has to be a finite number above zero", |depth| depth > 0.0)
}

/// Share of the frame period.
pub(super) fn shutter(text: &str) -> Result<f64, String> {
    number(text, "a fraction of the frame period; it has to be 0 to 1", |open| (0.0..=1.0).contains(&open))
}

/// Share in [0, 1).
pub(super) fn share_below_one(text: &str) -> Result<f64, String> {
    number(text, "a share; it has to be at least 0 and below 1, for example 0.01", |share| {
        (0.0..1.0).contains(&share)
    })
}

/// Gain of a device.
pub(super) fn gain(text: &str) -> Result<f64, String> {
    number(text, "a gain; it has to be a finite number above zero, for example 1.01", |gain| gain > 0.0)
}

/// Finite number for which `fits` holds; `expected` describes it in errors.
fn number<T: FromStr + Into<f64> + Copy>(
    text: &str,
    expected: &str,
    fits: impl Fn(f64) -> bool,
) -> Result<T, String> {
    let value = text.trim().parse::<T>().ok().filter(|&value| value.into().is_finite() && fits(value.into()));
    value.ok_or_else(|| format!("`{text}` is not {expected}"))
}

/// A quantity as an argument: how it is called, and how it is written.
struct Expected {
    quantity: PhysicalQuantity,
    /// Name with article, for messages.
    what: &'static str,
    /// The unit of a bare number.
    bare: &'static str,
    /// Examples for messages.
    examples: &'static str,
}

const fn expected(
    quantity: PhysicalQuantity,
    what: &'static str,
    bare: &'static str,
    examples: &'static str,
) -> Expected {
    Expected { quantity, what, bare, examples }
}

const RATE: Expected = expected(PhysicalQuantity::Rate, "a rate", "Hz", "50kHz or 1MHz");
const TIME: Expected = expected(PhysicalQuantity::Time, "a time", "s", "2.5s, 20us or 1min");
const SHORT_TIME: Expected = expected(PhysicalQuantity::Time, "a time", "ms", "4ms or 20us");
const VOLTAGE: Expected = expected(PhysicalQuantity::Voltage, "a voltage", "V", "12V or 5mV");
const CURRENT: Expected = expected(PhysicalQuantity::Current, "a current", "A", "2A or 5mA");
const POWER: Expected = expected(PhysicalQuantity::Power, "a power", "W", "14W or 250mW");
const RESISTANCE: Expected = expected(PhysicalQuantity::Resistance, "a resistance", "Ohm", "0.1Ohm or 4mOhm");

impl Expected {
    /// Parses a finite value; the result is in SI.
    fn parse(&self, text: &str) -> Result<f64, String> {
        units::parse(text, self.quantity, self.bare).ok_or_else(|| self.wrong(text.trim(), ""))
    }

    /// Parses a value for which `fits` holds; `range` describes it in errors.
    fn parse_in(&self, text: &str, range: &str, fits: impl Fn(f64) -> bool) -> Result<f64, String> {
        self.parse(text).and_then(|value| if fits(value) { Ok(value) } else { Err(self.wrong(text, range)) })
    }

    /// Message about a value that is not of this quantity.
    fn wrong(&self, text: &str, range: &str) -> String {
        let Self { what, bare, examples, .. } = self;
        format!(
            "`{text}` is not {what}{range}; write a number in {bare} or with its unit, for example {examples}"
        )
    }
}

/// A rate above 0, Hz.
pub(super) fn rate(text: &str) -> Result<f64, String> {
    RATE.parse_in(text, " above 0", |hertz| hertz > 0.0)
}

/// Point in time, s.
pub(super) fn time(text: &str) -> Result<f64, String> {
    TIME.parse(text)
}

/// Duration above 0, s.
pub(super) fn length_of_time(text: &str) -> Result<f64, String> {
    TIME.parse_in(text, " above 0", |seconds| seconds > 0.0)
}

/// Duration of at least 0, s; a bare number is in milliseconds.
pub(super) fn milliseconds(text: &str) -> Result<f64, String> {
    SHORT_TIME.parse_in(text, " of at least 0", |seconds| seconds >= 0.0)
}

/// A voltage, V.
pub(super) fn voltage(text: &str) -> Result<f64, String> {
    VOLTAGE.parse(text)
}

/// A voltage above 0, V.
pub(super) fn positive_voltage(text: &str) -> Result<f64, String> {
    VOLTAGE.parse_in(text, " above 0", |volts| volts > 0.0)
}

/// A voltage of at least 0, V.
pub(super) fn size_of_voltage(text: &str) -> Result<f64, String> {
    VOLTAGE.parse_in(text, " of at least 0", |volts| volts >= 0.0)
}

/// A current, A.
pub(super) fn current(text: &str) -> Result<f64, String> {
    CURRENT.parse(text)
}

/// A current above 0, A.
pub(super) fn positive_current(text: &str) -> Result<f64, String> {
    CURRENT.parse_in(text, " above 0", |amperes| amperes > 0.0)
}

/// A current of at least 0, A.
pub(super) fn size_of_current(text: &str) -> Result<f64, String> {
    CURRENT.parse_in(text, " of at least 0", |amperes| amperes >= 0.0)
}

/// A power, W.
pub(super) fn power(text: &str) -> Result<f64, String> {
    POWER.parse(text)
}

/// A power of at least 0, W.
pub(super) fn size_of_power(text: &str) -> Result<f64, String> {
    POWER.parse_in(text, " of at least 0", |watts| watts >= 0.0)
}

/// A resistance of at least 0, ohm.
pub(super) fn resistance(text: &str) -> Result<f64, String> {
    RESISTANCE.parse_in(text, " of at least 0", |ohm| ohm >= 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tile_tests_by_name() {
        assert_eq!(tests("all"), Ok(Features::ALL));
        assert_eq!(tests("edges, z-max"), Ok(Features { edges: true, z_max: true, ..Features::NONE }));
        assert!(
            tests("edges,hiz")
                .unwrap_err()
                .contains("unknown tile test `hiz`; there are lens_lines, side_planes")
        );
        assert!(tests("").is_err());
    }

    #[test]
    fn shares_and_durations() {
        assert_eq!([percent("2%"), percent("0.5 %"), percent("100%")], [Ok(0.02), Ok(0.005), Ok(1.0)]);
        assert!(percent("2").unwrap_err().contains("write it as 2%"));
        for wrong in ["0%", "-1%", "101%", "NaN%", "%", "two%"] {
            assert!(percent(wrong).unwrap_err().contains("2%"), "{wrong}");
        }
        assert_eq!(
            [duration("30s"), duration("500ms"), duration("2 min"), duration("1h")].map(Result::unwrap),
            [30.0, 0.5, 120.0, 3600.0]
        );
        assert_eq!(duration("250us"), Ok(250.0 * 1e-6));
        for wrong in ["30", "1e3", "s", "-1s", "0s", "infs", "NaNs", "3 days"] {
            assert!(duration(wrong).unwrap_err().contains("30s"), "{wrong}");
        }
    }

    #[test]
    fn seeds_are_whole_numbers_from_zero() {
        assert_eq!([seed("0"), seed("18446744073709551615")], [Ok(0), Ok(u64::MAX)]);
        for wrong in ["-1", "1.5", "18446744073709551616", "one", ""] {
            assert!(seed(wrong).unwrap_err().contains("from 0 to 18446744073709551615"), "{wrong}");
        }
    }

    #[test]
    fn ranges_and_sizes() {
        assert_eq!(frames("3..7"), Ok(3..7));
        assert!(frames("3-7").unwrap_err().contains("0..36"));
        assert!(frames("-3..7").is_err());
        for empty in ["3..3", "7..3"] {
            assert!(frames(empty).unwrap_err().contains("is empty"), "{empty}");
        }
        assert_eq!(size("1280x720"), Ok((1280, 720)));
        for wrong in ["1280", "0x1", "1x16385", "4294967297x1", "-1x1"] {
            assert!(size(wrong).unwrap_err().contains("1280x720, each side 1 to 16384 pixels"), "{wrong}");
        }
    }

    #[test]
    fn errors_of_numbers_name_the_valid_range() {
        assert_eq!([lens("0"), lens("2.5"), depth("1e3")], [Ok(0.0), Ok(2.5), Ok(1e3)]);
        assert_eq!([shutter("0"), shutter("1"), share_below_one("0.5")], [Ok(0.0), Ok(1.0), Ok(0.5)]);
        assert_eq!([per_pixel("1"), per_pixel("256")], [Ok(1), Ok(256)]);
        assert_eq!(
            lens("-1").unwrap_err(),
            "`-1` is not a radius of the lens in scene units; it has to be a finite number of at least 0"
        );
        for wrong in ["-1", "inf", "NaN", "1e39", "2mm", ""] {
            assert!(lens(wrong).is_err() && depth(wrong).is_err() && shutter(wrong).is_err(), "{wrong}");
        }
        assert!(depth("0").is_err() && shutter("1.5").is_err() && share_below_one("1").is_err());
        for wrong in ["0", "257", "1.5", "many"] {
            assert!(per_pixel(wrong).unwrap_err().contains("1 to 256"), "{wrong}");
        }
    }

    #[test]
    fn units_are_read_and_bare_numbers_are_in_the_unit_of_the_option() {
        for (text, hertz) in
            [("1e6", 1e6), ("1MHz", 1e6), ("50 kHz", 50e3), ("2.5kHz", 2500.0), ("60Hz", 60.0)]
        {
            assert_eq!(rate(text), Ok(hertz), "{text}");
        }
        for (text, seconds) in
            [("2.5", 2.5), ("20us", 20.0 * 1e-6), ("-3ms", -3.0 * 1e-3), ("1min", 60.0), ("2 h", 7200.0)]
        {
            assert_eq!(time(text), Ok(seconds), "{text}");
        }
        for text in ["4", "4ms", "4000us", "4000\u{b5}s", "0.004s"] {
            assert!((milliseconds(text).unwrap() - 0.004).abs() < 1e-15, "{text}");
        }
        assert_eq!([voltage("5mV"), positive_voltage("12")], [Ok(0.005), Ok(12.0)]);
        assert_eq!([current("-2A"), size_of_current("250mA")], [Ok(-2.0), Ok(0.25)]);
        assert_eq!([power("14"), size_of_power("1.5kW")], [Ok(14.0), Ok(1500.0)]);
        assert_eq!([resistance("4mOhm"), resistance("0.004")], [Ok(0.004), Ok(0.004)]);
    }

    #[test]
    fn errors_give_an_example() {
        for (message, says) in [
            (
                rate("0"),
                "`0` is not a rate above 0; write a number in Hz or with its unit, for example 50kHz or 1MHz",
            ),
            (rate("1mhz"), "1MHz"),
            (rate("1Mhz"), "1MHz"),
            (rate("inf"), "`inf` is not a rate"),
            (rate("1e400"), "`1e400` is not a rate"),
            (rate("20us"), "in Hz"),
            (rate("MHz"), "`MHz` is not a rate"),
            (time("5mV"), "20us"),
            (time("5m"), "20us"),
            (milliseconds("-1"), "`-1` is not a time of at least 0; write a number in ms"),
            (voltage("3 volts"), "12V or 5mV"),
            (positive_current("0A"), "`0A` is not a current above 0"),
            (size_of_power("-1"), "14W"),
            (resistance("NaN"), "4mOhm"),
        ] {
            let message = message.unwrap_err();
            assert!(message.contains(says), "{message}");
        }
    }
}
