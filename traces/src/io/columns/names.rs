//! What a column's name says.

/// What a column measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(in crate::io) enum Quantity {
    Time,
    Voltage,
    Current,
    Power,
}

/// A column's name, understood.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Named {
    pub quantity: Quantity,
    /// What to multiply by for s, V, A or W.
    pub scale: f64,
    pub rail: String,
    /// Whether a word or a unit of more than one letter says what it is, or a unit in brackets.
    pub sure: bool,
    /// Whether it has a unit.
    pub has_unit: bool,
}

const UNITS: [(&str, Quantity, f64); 17] = [
    ("s", Quantity::Time, 1.0),
    ("ms", Quantity::Time, 1e-3),
    ("us", Quantity::Time, 1e-6),
    ("ns", Quantity::Time, 1e-9),
    ("kv", Quantity::Voltage, 1e3),
    ("v", Quantity::Voltage, 1.0),
    ("mv", Quantity::Voltage, 1e-3),
    ("uv", Quantity::Voltage, 1e-6),
    ("ka", Quantity::Current, 1e3),
    ("a", Quantity::Current, 1.0),
    ("ma", Quantity::Current, 1e-3),
    ("ua", Quantity::Current, 1e-6),
    ("na", Quantity::Current, 1e-9),
    ("kw", Quantity::Power, 1e3),
    ("w", Quantity::Power, 1.0),
    ("mw", Quantity::Power, 1e-3),
    ("uw", Quantity::Power, 1e-6),
];

/// Units written out, as they stand in metadata.
const WORDS: [(&str, &str); 12] = [
    ("sec", "s"),
    ("second", "s"),
    ("seconds", "s"),
    ("msec", "ms"),
    ("usec", "us"),
    ("volt", "v"),
    ("volts", "v"),
    ("amp", "a"),
    ("amps", "a"),
    ("ampere", "a"),
    ("watt", "w"),
    ("watts", "w"),
];

/// The signs for micro, U+00B5 and the Greek letter U+03BC, that names and units may have in place of `u`.
pub(in crate::io) const MICRO: [char; 2] = ['\u{b5}', '\u{3bc}'];

/// A unit that stands beside a name; `None` if it is not known.
pub(super) fn unit(text: &str) -> Option<Named> {
    let lower = text.to_ascii_lowercase();
    let symbol = WORDS.iter().find(|(word, _)| *word == lower).map_or(text, |(_, symbol)| symbol);
    understood(&format!("_{symbol}")).filter(|told| told.has_unit && told.rail.is_empty())
}

fn quantity(token: &str) -> Option<Quantity> {
    match token {
        "time" | "timestamp" | "t" => Some(Quantity::Time),
        "voltage" | "volts" | "volt" => Some(Quantity::Voltage),
        "current" | "amps" | "i" => Some(Quantity::Current),
        "power" | "watts" | "p" => Some(Quantity::Power),
        _ => None,
    }
}

/// `gpu_voltage_V`, `Main(mA)`, `Time (s)`, `voltage_V`: quantity, unit and what is left, the rail. `None` for names of
/// other things.
pub(super) fn understood(name: &str) -> Option<Named> {
    let lower = name.trim_start_matches('\u{feff}').to_ascii_lowercase().replace(MICRO, "u");
    let tokens: Vec<&str> =
        lower.split(|c: char| !c.is_alphanumeric()).filter(|token| !token.is_empty()).collect();
    let told = tokens.iter().find_map(|token| quantity(token));
    let unit = tokens.iter().rev().find_map(|token| {
        let fits =
            |(name, of, _): &&(&str, Quantity, f64)| name == token && told.is_none_or(|told| told == *of);
        UNITS.iter().find(fits).map(|(_, of, scale)| (*token, *of, *scale))
    });
    let quantity_told = told.or(unit.map(|(_, of, _)| of))?;
    // A single letter is a unit only where nothing but a rail stands beside it or the quantity is told as well.
    let scale = if is_mega(name, unit) { 1e6 } else { unit.map_or(1.0, |(_, _, scale)| scale) };
    let has_unit = unit.is_some();
    let sure = tokens.iter().any(|token| token.len() > 1 && quantity(token) == told && told.is_some())
        || unit.is_some_and(|(token, ..)| token.len() > 1 || lower.ends_with(&format!("({token})")));
    let mut unit = unit.map(|(token, _, _)| token);
    let mut rail: Vec<&str> = Vec::new();
    for token in tokens.iter().rev() {
        if unit == Some(*token) {
            unit = None;
        } else if quantity(token) != Some(quantity_told) {
            rail.push(token);
        }
    }
    rail.reverse();
    Some(Named { quantity: quantity_told, scale, rail: rail.join("_"), sure, has_unit })
}

/// `power_MW` are megawatts; where all is in capitals, `M` says nothing.
fn is_mega(name: &str, unit: Option<(&str, Quantity, f64)>) -> bool {
    let mega = |token: &str| {
        token.starts_with('M') && unit.is_some_and(|(unit, _, _)| token.eq_ignore_ascii_case(unit))
    };
    name.contains(char::is_lowercase)
        && unit.is_some_and(|(unit, of, _)| of != Quantity::Time && unit.len() == 2)
        && name
            .split(|c: char| !c.is_alphanumeric())
            .any(|token| mega(token) && token == token.to_uppercase())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(name: &str) -> Option<(Quantity, f64, String)> {
        understood(name).map(|named| (named.quantity, named.scale, named.rail))
    }

    #[test]
    fn names_of_recorders_are_understood() {
        let is = |quantity, scale, rail: &str| Some((quantity, scale, rail.to_owned()));
        assert_eq!(read("voltage_V"), is(Quantity::Voltage, 1.0, ""));
        assert_eq!(read("CURRENT_a"), is(Quantity::Current, 1.0, ""));
        assert_eq!(read("time_ns"), is(Quantity::Time, 1e-9, ""));
        assert_eq!(read("Timestamp(ms)"), is(Quantity::Time, 1e-3, ""));
        assert_eq!(read("Main(mA)"), is(Quantity::Current, 1e-3, "main"));
        assert_eq!(read("Main Voltage(V)"), is(Quantity::Voltage, 1.0, "main"));
        assert_eq!(read("gpu_power_W"), is(Quantity::Power, 1.0, "gpu"));
        assert_eq!(read("current_A_cpu"), is(Quantity::Current, 1.0, "cpu"));
        assert_eq!(read("note"), None);
        assert_eq!(read("power_kW"), is(Quantity::Power, 1e3, ""));
        assert_eq!(read("power_MW"), is(Quantity::Power, 1e6, ""));
        assert_eq!(read("power_mW"), is(Quantity::Power, 1e-3, ""));
        assert_eq!(read("POWER_MW"), is(Quantity::Power, 1e-3, ""));
        for name in ["current_\u{b5}A", "current (\u{3bc}A)"] {
            assert_eq!(read(name), is(Quantity::Current, 1e-6, ""), "{name}");
        }
    }

    #[test]
    fn units_alone_are_symbols_or_words_and_others_are_not_known() {
        let read = |text| unit(text).map(|unit| (unit.quantity, unit.scale));
        assert_eq!(read("\u{3bc}A"), Some((Quantity::Current, 1e-6)));
        assert_eq!(read("[mA]"), Some((Quantity::Current, 1e-3)));
        assert_eq!(read("Volts"), Some((Quantity::Voltage, 1.0)));
        assert_eq!(read("msec"), Some((Quantity::Time, 1e-3)));
        for text in ["milliamps", "mAmp", "ticks", "min", "furlong", "power", "t"] {
            assert_eq!(read(text), None, "{text}");
        }
    }
}
