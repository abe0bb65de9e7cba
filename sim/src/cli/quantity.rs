//! Values of options that are physical quantities: a number, and a unit that may be left out.

/// Kind of quantity, with its units and the unit of a bare number.
struct Quantity {
    /// Name with article, for messages.
    what: &'static str,
    /// The unit of a bare number.
    bare: &'static str,
    /// Units, each with its value in SI.
    units: &'static [(&'static str, f64)],
    /// Examples for messages.
    examples: &'static str,
}

const RATE: Quantity = Quantity {
    what: "a rate",
    bare: "Hz",
    units: &[("Hz", 1.0), ("kHz", 1e3), ("MHz", 1e6), ("GHz", 1e9)],
    examples: "50kHz or 1MHz",
};
const TIMES: &[(&str, f64)] = &[
    ("s", 1.0),
    ("ms", 1e-3),
    ("us", 1e-6),
    ("\u{b5}s", 1e-6),
    ("\u{3bc}s", 1e-6),
    ("ns", 1e-9),
    ("min", 60.0),
    ("h", 3600.0),
];
const TIME: Quantity = Quantity { what: "a time", bare: "s", units: TIMES, examples: "2.5s, 20us or 1min" };
const SHORT_TIME: Quantity = Quantity { bare: "ms", examples: "4ms or 20us", ..TIME };
const VOLTAGE: Quantity = Quantity {
    what: "a voltage",
    bare: "V",
    units: &[("V", 1.0), ("kV", 1e3), ("mV", 1e-3), ("uV", 1e-6), ("\u{b5}V", 1e-6), ("\u{3bc}V", 1e-6)],
    examples: "12V or 5mV",
};
const CURRENT: Quantity = Quantity {
    what: "a current",
    bare: "A",
    units: &[("A", 1.0), ("kA", 1e3), ("mA", 1e-3), ("uA", 1e-6), ("\u{b5}A", 1e-6), ("\u{3bc}A", 1e-6)],
    examples: "2A or 5mA",
};
const POWER: Quantity = Quantity {
    what: "a power",
    bare: "W",
    units: &[("W", 1.0), ("kW", 1e3), ("mW", 1e-3), ("uW", 1e-6), ("\u{b5}W", 1e-6), ("\u{3bc}W", 1e-6)],
    examples: "14W or 250mW",
};
const RESISTANCE: Quantity = Quantity {
    what: "a resistance",
    bare: "Ohm",
    units: &[
        ("Ohm", 1.0),
        ("mOhm", 1e-3),
        ("kOhm", 1e3),
        ("\u{3a9}", 1.0),
        ("m\u{3a9}", 1e-3),
        ("\u{2126}", 1.0),
    ],
    examples: "0.1Ohm or 4mOhm",
};

impl Quantity {
    /// Parses a finite value; the result is in SI.
    fn parse(&self, text: &str) -> Result<f64, String> {
        let text = text.trim();
        let with_unit = |(unit, si): &(&str, f64)| {
            let number = text.strip_suffix(unit)?.trim_end();
            Some(number.parse::<f64>().ok()? * si)
        };
        let bare_si = self.units.iter().find(|(unit, _)| *unit == self.bare).map_or(1.0, |(_, si)| *si);
        let bare = text.parse::<f64>().ok().map(|number| number * bare_si);
        let value = bare.or_else(|| self.units.iter().find_map(with_unit));
        value.filter(|value| value.is_finite()).ok_or_else(|| self.wrong(text, ""))
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
