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

/// What to multiply the numbers of a column by for s or J, by the last unit in its name; `None` where that tells none.
///
/// # Errors
/// What is wrong, if the unit is of something else, or may be.
pub(super) fn scale(column: &str, of: Quantity) -> Result<Option<f64>, String> {
    let name = column.replace('\u{b5}', "u");
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
        None if words.last() == Some(&"min") => {
            Err(format!("column `{column}`: minutes or a minimum? rename it, with s or ms"))
        }
        None => Ok(None),
    }
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
        for column in ["energy_mJ", "frames_per_s", "time_min", "power_W", "clock MHz"] {
            assert!(scale(column, Quantity::Time).is_err(), "{column}");
        }
        for column in ["time_ms", "energy_nJ_per_pixel", "power_W"] {
            assert!(scale(column, Quantity::Energy).is_err(), "{column}");
        }
    }
}
