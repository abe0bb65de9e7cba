//! What the name of a table's column tells of its unit.

/// What a column holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Quantity {
    Time,
    Energy,
}

impl Quantity {
    fn name(self) -> &'static str {
        match self {
            Self::Time => "times",
            Self::Energy => "energies",
        }
    }
}

/// Units, what they are of and what to multiply by for s or J.
const UNITS: [(&str, Quantity, f64); 17] = [
    ("s", Quantity::Time, 1.0),
    ("sec", Quantity::Time, 1.0),
    ("ms", Quantity::Time, 1e-3),
    ("msec", Quantity::Time, 1e-3),
    ("us", Quantity::Time, 1e-6),
    ("usec", Quantity::Time, 1e-6),
    ("ns", Quantity::Time, 1e-9),
    ("h", Quantity::Time, 3600.0),
    ("J", Quantity::Energy, 1.0),
    ("mJ", Quantity::Energy, 1e-3),
    ("uJ", Quantity::Energy, 1e-6),
    ("nJ", Quantity::Energy, 1e-9),
    ("kJ", Quantity::Energy, 1e3),
    ("MJ", Quantity::Energy, 1e6),
    ("Wh", Quantity::Energy, 3600.0),
    ("mWh", Quantity::Energy, 3.6),
    ("kWh", Quantity::Energy, 3.6e6),
];
/// Units, and words, of neither.
const OTHERS: [&str; 13] =
    ["W", "mW", "kW", "V", "mV", "A", "mA", "Hz", "kHz", "MHz", "fps", "per", "pixels"];

/// Ends of words that are units, too, but are not known: `millisecs`, `microjoules`.
const ENDS: [&str; 12] = [
    "sec", "secs", "second", "seconds", "joule", "joules", "minute", "minutes", "hour", "hours", "tick",
    "ticks",
];
/// Units of times and energies that are not known.
const UNKNOWN: [&str; 18] = [
    "min", "mins", "hr", "hrs", "day", "days", "ps", "fs", "ks", "pJ", "GJ", "Ws", "mWs", "uWh", "MWh", "eV",
    "cal", "cycles",
];

/// What to multiply the numbers of a column by for s or J, by the last unit in its name; `None` where that tells none.
///
/// # Errors
/// What is wrong, if the unit is of something else, or may be.
pub(super) fn scale(column: &str, of: Quantity) -> Result<Option<f64>, String> {
    let name = column.replace(['\u{b5}', '\u{3bc}'], "u");
    let words: Vec<&str> =
        name.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty()).collect();
    let other = |word: &&&str| OTHERS.iter().any(|other| other.eq_ignore_ascii_case(word));
    if let Some(word) = words.iter().find(other) {
        return Err(format!("column `{column}`: `{word}` tells that it holds no {}", of.name()));
    }
    let units: Vec<_> = words.iter().filter_map(|word| unit(word)).collect();
    match units.iter().rfind(|(quantity, _)| *quantity == of) {
        Some((_, scale)) => Ok(Some(*scale)),
        None if !units.is_empty() => {
            Err(format!("column `{column}`: its unit tells that it holds no {}", of.name()))
        }
        None => words.iter().find(|word| seems_unit(word)).map_or(Ok(None), |word| {
            Err(format!(
                "column `{column}`: if `{word}` is its unit, it is not known: rename it, with s, ms, J or mJ"
            ))
        }),
    }
}

/// As [`scale`], with the unit that a file has beside the column's name.
///
/// # Errors
/// What is wrong, also if that unit is not known or contradicts the name.
pub(super) fn scale_with(column: &str, unit: Option<&str>, of: Quantity) -> Result<Option<f64>, String> {
    let named = scale(column, of)?;
    let Some(text) = unit.filter(|text| !text.is_empty()) else { return Ok(named) };
    match scale(text, of).ok().flatten() {
        Some(told) if named.is_none_or(|named| named == told) => Ok(Some(told)),
        _ => Err(format!(
            "column `{column}` has the unit {text} in its metadata, which is none of {} that is known, or contradicts its name: \
             mend it",
            of.name()
        )),
    }
}

/// Whether a word may be a unit, though none that is known.
fn seems_unit(word: &str) -> bool {
    let lower = word.to_lowercase();
    UNKNOWN.iter().any(|unit| unit.eq_ignore_ascii_case(word)) || ENDS.iter().any(|end| lower.ends_with(end))
}

/// Exactly as it is written, or else without regard to case, when `M` is milli.
fn unit(word: &str) -> Option<(Quantity, f64)> {
    let exact = UNITS.iter().find(|(name, ..)| *name == word);
    exact
        .or_else(|| UNITS.iter().find(|(name, ..)| name.eq_ignore_ascii_case(word)))
        .map(|(_, of, scale)| (*of, *scale))
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
            assert_eq!(scale(column, Quantity::Time), Ok(Some(expected)), "{column}");
        }
        for (column, expected) in
            [("energy[mJ]", 1e-3), ("energy_MJ", 1e6), ("energy_mWh", 3.6), ("E_J", 1.0)]
        {
            assert_eq!(scale(column, Quantity::Energy), Ok(Some(expected)), "{column}");
        }
        assert_eq!((scale("time", Quantity::Time), scale("energy", Quantity::Energy)), (Ok(None), Ok(None)));
    }

    #[test]
    fn what_tells_of_something_else_is_refused() {
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
            assert!(scale(column, Quantity::Time).is_err(), "{column}");
        }
        for column in ["time_ms", "energy_nJ_per_pixel", "power_W", "energy_microjoules", "energy_pJ"] {
            assert!(scale(column, Quantity::Energy).is_err(), "{column}");
        }
    }

    #[test]
    fn units_beside_names_count_and_contradict() {
        let time = |column, unit| scale_with(column, Some(unit), Quantity::Time);
        assert_eq!(
            (time("time", "ms"), time("time_ms", "ms"), time("time_ms", "")),
            (Ok(Some(1e-3)), Ok(Some(1e-3)), Ok(Some(1e-3)))
        );
        for (column, unit) in [("time_s", "ms"), ("time", "mJ"), ("time", "furlong")] {
            assert!(time(column, unit).unwrap_err().contains(unit), "{column} {unit}");
        }
    }
}
