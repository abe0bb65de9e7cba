//! Units and what they measure: one table for the columns of traces, the signals of JLS, the columns of tables and
//! the arguments of a command.

use thiserror::Error;

/// Quantity of a column or an argument.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum PhysicalQuantity {
    /// Times, s.
    Time,
    /// Voltages, V.
    Voltage,
    /// Currents, A.
    Current,
    /// Powers, W.
    Power,
    /// Energies, J.
    Energy,
    /// Rates, Hz.
    Rate,
    /// Resistances, ohm.
    Resistance,
}

impl PhysicalQuantity {
    /// Plural name, for messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Time => "times",
            Self::Voltage => "voltages",
            Self::Current => "currents",
            Self::Power => "powers",
            Self::Energy => "energies",
            Self::Rate => "rates",
            Self::Resistance => "resistances",
        }
    }
}

/// A unit, and where its name is understood.
struct Unit {
    name: &'static str,
    quantity: PhysicalQuantity,
    /// Factor to s, V, A, W, J, Hz or ohm.
    scale: f64,
    places: u8,
}

/// In the names of columns of a trace, in any case.
const TRACE: u8 = 1;
/// Beside the names of columns of a trace, in metadata; there the units of [`TRACE`] are understood as well.
const METADATA: u8 = 2;
/// As the unit of a JLS signal, in any case.
const JLS: u8 = 4;
/// In the names of columns of other tables; case counts where it makes a difference.
const TABLE: u8 = 8;
/// Behind a number in an argument of a command; case counts.
const ARGUMENT: u8 = 16;

const fn unit(name: &'static str, quantity: PhysicalQuantity, scale: f64, places: u8) -> Unit {
    Unit { name, quantity, scale, places }
}

/// All units. Of two that differ in case alone, the first is meant where case does not decide.
const UNITS: [Unit; 50] = [
    unit("s", PhysicalQuantity::Time, 1.0, TRACE | TABLE | ARGUMENT),
    unit("sec", PhysicalQuantity::Time, 1.0, METADATA | TABLE),
    unit("second", PhysicalQuantity::Time, 1.0, METADATA),
    unit("seconds", PhysicalQuantity::Time, 1.0, METADATA),
    unit("ms", PhysicalQuantity::Time, 1e-3, TRACE | TABLE | ARGUMENT),
    unit("msec", PhysicalQuantity::Time, 1e-3, METADATA | TABLE),
    unit("us", PhysicalQuantity::Time, 1e-6, TRACE | TABLE | ARGUMENT),
    unit("usec", PhysicalQuantity::Time, 1e-6, METADATA | TABLE),
    unit("ns", PhysicalQuantity::Time, 1e-9, TRACE | TABLE | ARGUMENT),
    unit("min", PhysicalQuantity::Time, 60.0, ARGUMENT),
    unit("h", PhysicalQuantity::Time, 3600.0, TABLE | ARGUMENT),
    unit("kV", PhysicalQuantity::Voltage, 1e3, TRACE | ARGUMENT),
    unit("V", PhysicalQuantity::Voltage, 1.0, TRACE | JLS | ARGUMENT),
    unit("mV", PhysicalQuantity::Voltage, 1e-3, TRACE | JLS | ARGUMENT),
    unit("uV", PhysicalQuantity::Voltage, 1e-6, TRACE | JLS | ARGUMENT),
    unit("volt", PhysicalQuantity::Voltage, 1.0, METADATA),
    unit("volts", PhysicalQuantity::Voltage, 1.0, METADATA),
    unit("kA", PhysicalQuantity::Current, 1e3, TRACE | ARGUMENT),
    unit("A", PhysicalQuantity::Current, 1.0, TRACE | JLS | ARGUMENT),
    unit("mA", PhysicalQuantity::Current, 1e-3, TRACE | JLS | ARGUMENT),
    unit("uA", PhysicalQuantity::Current, 1e-6, TRACE | JLS | ARGUMENT),
    unit("nA", PhysicalQuantity::Current, 1e-9, TRACE | JLS),
    unit("amp", PhysicalQuantity::Current, 1.0, METADATA),
    unit("amps", PhysicalQuantity::Current, 1.0, METADATA),
    unit("ampere", PhysicalQuantity::Current, 1.0, METADATA),
    unit("kW", PhysicalQuantity::Power, 1e3, TRACE | ARGUMENT),
    unit("W", PhysicalQuantity::Power, 1.0, TRACE | JLS | ARGUMENT),
    unit("mW", PhysicalQuantity::Power, 1e-3, TRACE | JLS | ARGUMENT),
    unit("uW", PhysicalQuantity::Power, 1e-6, TRACE | JLS | ARGUMENT),
    unit("watt", PhysicalQuantity::Power, 1.0, METADATA),
    unit("watts", PhysicalQuantity::Power, 1.0, METADATA),
    unit("J", PhysicalQuantity::Energy, 1.0, TABLE),
    unit("mJ", PhysicalQuantity::Energy, 1e-3, TABLE),
    unit("uJ", PhysicalQuantity::Energy, 1e-6, TABLE),
    unit("nJ", PhysicalQuantity::Energy, 1e-9, TABLE),
    unit("kJ", PhysicalQuantity::Energy, 1e3, TABLE),
    unit("MJ", PhysicalQuantity::Energy, 1e6, TABLE),
    unit("Wh", PhysicalQuantity::Energy, 3600.0, TABLE),
    unit("mWh", PhysicalQuantity::Energy, 3.6, TABLE),
    unit("kWh", PhysicalQuantity::Energy, 3.6e6, TABLE),
    unit("Hz", PhysicalQuantity::Rate, 1.0, ARGUMENT),
    unit("kHz", PhysicalQuantity::Rate, 1e3, ARGUMENT),
    unit("MHz", PhysicalQuantity::Rate, 1e6, ARGUMENT),
    unit("GHz", PhysicalQuantity::Rate, 1e9, ARGUMENT),
    unit("Ohm", PhysicalQuantity::Resistance, 1.0, ARGUMENT),
    unit("mOhm", PhysicalQuantity::Resistance, 1e-3, ARGUMENT),
    unit("kOhm", PhysicalQuantity::Resistance, 1e3, ARGUMENT),
    unit("\u{3a9}", PhysicalQuantity::Resistance, 1.0, ARGUMENT),
    unit("m\u{3a9}", PhysicalQuantity::Resistance, 1e-3, ARGUMENT),
    unit("\u{2126}", PhysicalQuantity::Resistance, 1.0, ARGUMENT),
];

/// The signs for micro, U+00B5 and the Greek letter U+03BC, that names and units may have in place of `u`.
pub(crate) const MICRO: [char; 2] = ['\u{b5}', '\u{3bc}'];

/// The quantity that a word of the name of a trace's column stands for, in small letters.
pub(crate) fn quantity_word(word: &str) -> Option<PhysicalQuantity> {
    match word {
        "time" | "timestamp" | "t" => Some(PhysicalQuantity::Time),
        "voltage" | "volts" | "volt" => Some(PhysicalQuantity::Voltage),
        "current" | "amps" | "i" => Some(PhysicalQuantity::Current),
        "power" | "watts" | "p" => Some(PhysicalQuantity::Power),
        _ => None,
    }
}

/// Names of columns of times in other tables, without their units, the likeliest first.
pub(crate) const TIME_WORDS: [&str; 6] = ["start", "time", "mark", "stamp", "timestamp", "t"];

fn units(places: u8) -> impl Iterator<Item = &'static Unit> {
    UNITS.iter().filter(move |unit| unit.places & places != 0)
}

/// Quantity and factor of a unit in any case, as a word of the name of a trace's column; `of` restricts the
/// quantity.
pub(crate) fn trace_unit(word: &str, of: Option<PhysicalQuantity>) -> Option<(PhysicalQuantity, f64)> {
    let fits = |unit: &&Unit| {
        unit.name.eq_ignore_ascii_case(word) && of.is_none_or(|quantity| unit.quantity == quantity)
    };
    units(TRACE).find(fits).map(|unit| (unit.quantity, unit.scale))
}

/// Quantity and factor of a unit that is written out in metadata, in any case.
pub(crate) fn written_out_unit(text: &str) -> Option<(PhysicalQuantity, f64)> {
    let found = units(METADATA).find(|unit| unit.name.eq_ignore_ascii_case(text));
    found.map(|unit| (unit.quantity, unit.scale))
}

/// Factor from the unit of a JLS signal to V, A or W; `None` for others.
pub(crate) fn jls_unit(text: &str) -> Option<f64> {
    let name = text.replace(MICRO, "u");
    units(JLS).find(|unit| unit.name.eq_ignore_ascii_case(&name)).map(|unit| unit.scale)
}

/// The value of an argument in s, V, A, W, Hz or ohm: a finite number with a unit of the quantity behind it,
/// or in the unit `bare` if there is none.
///
/// ```
/// use traces::units::{PhysicalQuantity, parse};
///
/// assert_eq!(parse("2 min", PhysicalQuantity::Time, "s"), Some(120.0));
/// assert_eq!(parse("2", PhysicalQuantity::Time, "ms"), Some(2e-3));
/// assert_eq!(parse("2 V", PhysicalQuantity::Time, "s"), None);
/// ```
pub fn parse(text: &str, of: PhysicalQuantity, bare: &str) -> Option<f64> {
    let text = text.trim().replace(MICRO, "u");
    let known = || units(ARGUMENT).filter(|unit| unit.quantity == of);
    let number = |unit: &Unit, text: &str| Some(text.trim_end().parse::<f64>().ok()? * unit.scale);
    let of_bare = known().find(|unit| unit.name == bare).and_then(|unit| number(unit, &text));
    let value = of_bare.or_else(|| known().find_map(|unit| number(unit, text.strip_suffix(unit.name)?)));
    value.filter(|value| value.is_finite())
}

/// A unit in the name of a table's column: exactly as it is written, or else without regard to case, when `M`
/// is milli.
fn table_unit(word: &str) -> Option<(PhysicalQuantity, f64)> {
    let exact = units(TABLE).find(|unit| unit.name == word);
    exact
        .or_else(|| units(TABLE).find(|unit| unit.name.eq_ignore_ascii_case(word)))
        .map(|unit| (unit.quantity, unit.scale))
}

/// Words in the name of a column that exclude times and energies.
const OTHER_WORDS: [&str; 13] =
    ["W", "mW", "kW", "V", "mV", "A", "mA", "Hz", "kHz", "MHz", "fps", "per", "pixels"];
/// Endings of words that are units as well, but not known: `millisecs`, `microjoules`.
const UNKNOWN_ENDINGS: [&str; 12] = [
    "sec", "secs", "second", "seconds", "joule", "joules", "minute", "minutes", "hour", "hours", "tick",
    "ticks",
];
/// Units of times and energies that are not known.
const UNKNOWN: [&str; 18] = [
    "min", "mins", "hr", "hrs", "day", "days", "ps", "fs", "ks", "pJ", "GJ", "Ws", "mWs", "uWh", "MWh", "eV",
    "cal", "cycles",
];

/// The name or the unit of a table's column does not fit its use.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("{0}")]
pub struct UnitError(String);

/// Factor from the numbers of a table's column to s or J, by the last unit in its name; `None` for a name
/// without a unit.
///
/// # Errors
/// [`UnitError`] if the unit is of something else, or may be.
pub fn scale(column: &str, of: PhysicalQuantity) -> Result<Option<f64>, UnitError> {
    let name = column.replace(MICRO, "u");
    let words: Vec<&str> =
        name.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty()).collect();
    let other = |word: &&&str| OTHER_WORDS.iter().any(|other| other.eq_ignore_ascii_case(word));
    if let Some(word) = words.iter().find(other) {
        return Err(UnitError(format!("column `{column}`: `{word}` says that it holds no {}", of.name())));
    }
    let units: Vec<_> = words.iter().filter_map(|word| table_unit(word)).collect();
    match units.iter().rfind(|(quantity, _)| *quantity == of) {
        Some((_, scale)) => Ok(Some(*scale)),
        None if !units.is_empty() => {
            Err(UnitError(format!("column `{column}`: its unit says that it holds no {}", of.name())))
        }
        None => words.iter().find(|word| may_be_unit(word)).map_or(Ok(None), |word| {
            Err(UnitError(format!(
                "column `{column}`: if `{word}` is its unit, it is not known: rename it, with s, ms, J or mJ"
            )))
        }),
    }
}

/// As [`scale`], with the unit that a file has beside the name of the column.
///
/// # Errors
/// [`UnitError`], also if that unit is not known or contradicts the name.
pub fn scale_with(column: &str, unit: Option<&str>, of: PhysicalQuantity) -> Result<Option<f64>, UnitError> {
    let named = scale(column, of)?;
    let Some(text) = unit.filter(|text| !text.is_empty()) else { return Ok(named) };
    match scale(text, of).ok().flatten() {
        Some(stated) if named.is_none_or(|named| named == stated) => Ok(Some(stated)),
        _ => Err(UnitError(format!(
            "column `{column}` has the unit {text} in its metadata, which is none of {} that is known, or contradicts its name: \
             fix it",
            of.name()
        ))),
    }
}

/// Whether a word may be a unit that is not known.
fn may_be_unit(word: &str) -> bool {
    let lower = word.to_lowercase();
    UNKNOWN.iter().any(|unit| unit.eq_ignore_ascii_case(word))
        || UNKNOWN_ENDINGS.iter().any(|ending| lower.ends_with(ending))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_read_wherever_they_stand() {
        for (column, expected) in [
            ("time_ms", 1e-3),
            ("Time [ms]", 1e-3),
            ("time.ms", 1e-3),
            ("Frame Time (ms)", 1e-3),
            ("time_ms_mean", 1e-3),
            ("time_\u{b5}s", 1e-6),
            ("time_\u{3bc}s", 1e-6),
            ("time_msec", 1e-3),
            ("time_sec", 1.0),
            ("TIME_MS", 1e-3),
            ("time_h", 3600.0),
        ] {
            assert_eq!(scale(column, PhysicalQuantity::Time), Ok(Some(expected)), "{column}");
        }
        for (column, expected) in
            [("energy[mJ]", 1e-3), ("energy_MJ", 1e6), ("energy_mWh", 3.6), ("E_J", 1.0)]
        {
            assert_eq!(scale(column, PhysicalQuantity::Energy), Ok(Some(expected)), "{column}");
        }
        assert_eq!(
            (scale("time", PhysicalQuantity::Time), scale("energy", PhysicalQuantity::Energy)),
            (Ok(None), Ok(None))
        );
    }

    #[test]
    fn units_of_something_else_are_refused() {
        for column in [
            "energy_mJ",
            "frames_per_s",
            "time_min",
            "power_W",
            "clock MHz",
            "time_millisecs",
            "time_ticks",
            "t [ps]",
        ] {
            assert!(scale(column, PhysicalQuantity::Time).is_err(), "{column}");
        }
        for column in ["time_ms", "energy_nJ_per_pixel", "power_W", "energy_microjoules", "energy_pJ"] {
            assert!(scale(column, PhysicalQuantity::Energy).is_err(), "{column}");
        }
    }

    #[test]
    fn units_beside_names_count_and_contradict() {
        let time = |column, unit| scale_with(column, Some(unit), PhysicalQuantity::Time);
        assert_eq!(
            (time("time", "ms"), time("time_ms", "ms"), time("time_ms", "")),
            (Ok(Some(1e-3)), Ok(Some(1e-3)), Ok(Some(1e-3)))
        );
        for (column, unit) in [("time_s", "ms"), ("time", "mJ"), ("time", "furlong")] {
            assert!(time(column, unit).unwrap_err().to_string().contains(unit), "{column} {unit}");
        }
    }

    #[test]
    fn the_same_unit_may_be_known_in_one_place_and_not_in_another() {
        assert_eq!((trace_unit("h", None), table_unit("h")), (None, Some((PhysicalQuantity::Time, 3600.0))));
        assert_eq!(
            (trace_unit("sec", None), written_out_unit("Sec")),
            (None, Some((PhysicalQuantity::Time, 1.0)))
        );
        assert_eq!(
            (jls_unit("\u{b5}A"), jls_unit("\u{3bc}a"), jls_unit("kW")),
            (Some(1e-6), Some(1e-6), None)
        );
        assert_eq!(
            trace_unit("MV", Some(PhysicalQuantity::Voltage)),
            Some((PhysicalQuantity::Voltage, 1e-3))
        );
        assert_eq!(trace_unit("V", Some(PhysicalQuantity::Time)), None);
        assert_eq!((table_unit("min"), parse("1min", PhysicalQuantity::Time, "s")), (None, Some(60.0)));
        assert_eq!((jls_unit("nA"), parse("1nA", PhysicalQuantity::Current, "A")), (Some(1e-9), None));
    }
}
