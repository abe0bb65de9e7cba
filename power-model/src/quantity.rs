//! Quantities with a unit and a range in their type, values with a mandatory source, and which end of
//! intervals is taken.

use serde::{Deserialize, Serialize};

/// A value outside the range of its quantity.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{value} {unit} is not a number from {low} to {high} {unit}: give one in that range")]
pub struct OutOfRange {
    /// Value given.
    pub value: f64,
    /// Unit.
    pub unit: &'static str,
    /// Smallest allowed value.
    pub low: f64,
    /// Largest allowed value.
    pub high: f64,
}

macro_rules! quantities {
    ($($(#[$doc:meta])* $name:ident $unit:literal $low:literal to $high:literal)*) => {$(
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, PartialOrd, Deserialize)]
        #[serde(try_from = "f64")]
        pub struct $name(f64);

        impl $name {
            /// Largest value.
            pub const MAX: f64 = $high;

            /// Check `value` against the range of the quantity.
            ///
            /// # Errors
            /// [`OutOfRange`], also for NaN and infinities.
            pub fn new(value: f64) -> Result<Self, OutOfRange> {
                if ($low..=$high).contains(&value) {
                    Ok(Self(value))
                } else {
                    Err(OutOfRange { value, unit: $unit, low: $low, high: $high })
                }
            }

            /// Value in the unit of the quantity.
            pub const fn value(self) -> f64 {
                self.0
            }
        }

        impl TryFrom<f64> for $name {
            type Error = OutOfRange;
            fn try_from(value: f64) -> Result<Self, OutOfRange> {
                Self::new(value)
            }
        }

        impl Quantity for $name {
            const UNIT: &'static str = $unit;
            fn number(&self) -> f64 {
                self.0
            }
        }
    )*};
}

/// Process node in nm, from beyond the smallest today to the first integrated circuits.
pub type Nanometres = activity::Bounded<1, 20_000>;

/// A number with a unit.
pub trait Quantity {
    /// Symbol of the unit.
    const UNIT: &'static str;
    /// Value in that unit.
    fn number(&self) -> f64;
}

quantities! {
    /// Power, 0 to 10 kW, more than any graphics card draws.
    Watts "W" 0.0 to 1e4
    /// Supply voltage, 0.1 to 48 V.
    Volts "V" 0.1 to 48.0
    /// Duration, at most an hour.
    Seconds "s" 0.0 to 3600.0
    /// Idle time recorded before or after a run, at most a minute, to limit the size of recordings.
    RecordedIdle "s" 0.0 to 60.0
    /// Frame rate, 0.1 Hz to 100 kHz.
    Hertz "Hz" 0.1 to 1e5
    /// Junction temperature.
    Celsius "degC" -50.0 to 150.0
    /// Time between occurrences, 0.1 ms to an hour.
    Interval "s" 1e-4 to 3600.0
    /// Fraction of a whole.
    Share "(share)" 0.0 to 1.0
    /// Ratio of two numbers of one kind.
    Ratio "(ratio)" 0.01 to 100.0
    /// Exponent of a law.
    Exponent "(exponent)" 0.0 to 10.0
    /// Energy of one event, at most 1 mJ, which catches wrong units.
    Picojoules "pJ" 0.0 to 1e9
}

/// Kind of source of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
pub enum Basis {
    /// Printed in a publication, or measured.
    Published,
    /// Derived from published numbers; the source says how.
    Derived,
    /// An assumption; the source gives the reasoning.
    Assumed,
}

/// Source of a number: a citation or a reasoning. Never empty.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(try_from = "String")]
pub struct Source(String);

impl Source {
    /// Text.
    pub fn text(&self) -> &str {
        &self.0
    }
}

impl TryFrom<String> for Source {
    type Error = &'static str;
    fn try_from(text: String) -> Result<Self, Self::Error> {
        if text.trim().is_empty() {
            Err("the source is empty: say where the number comes from, or why it was assumed")
        } else {
            Ok(Self(text))
        }
    }
}

/// A quantity with its source, written `Assumed(0.25, "why")` in a platform file.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub enum Sourced<T> {
    /// Printed in a publication, or measured.
    Published(T, Source),
    /// Derived from published numbers.
    Derived(T, Source),
    /// An assumption with its reasoning.
    Assumed(T, Source),
}

impl<T> Sourced<T> {
    /// Quantity.
    pub const fn get(&self) -> &T {
        match self {
            Self::Published(value, _) | Self::Derived(value, _) | Self::Assumed(value, _) => value,
        }
    }

    /// Source in words.
    pub fn source(&self) -> &str {
        match self {
            Self::Published(_, source) | Self::Derived(_, source) | Self::Assumed(_, source) => source.text(),
        }
    }

    /// Kind of source.
    pub const fn basis(&self) -> Basis {
        match self {
            Self::Published(..) => Basis::Published,
            Self::Derived(..) => Basis::Derived,
            Self::Assumed(..) => Basis::Assumed,
        }
    }
}

impl Sourced<Watts> {
    /// Watts computed from these. The range of [`Watts`] is that of numbers in files and does not hold for them.
    pub(crate) fn computed(&self, value: f64, how: &str) -> Self {
        if value == self.value() {
            return self.clone();
        }
        Self::Derived(Watts(value), Source(format!("{}; {how}", self.source())))
    }
}

impl<T: Quantity> Sourced<T> {
    /// Value in the unit given by the name of its field.
    pub fn value(&self) -> f64 {
        self.get().number()
    }

    /// Symbol of the unit.
    pub const fn unit(&self) -> &'static str {
        T::UNIT
    }
}

/// End of the interval of each number.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Bound {
    /// Smallest numbers that the sources allow.
    Low,
    /// Nominal numbers.
    #[default]
    Nominal,
    /// Largest numbers that the sources allow.
    High,
}

impl Bound {
    /// All, in rising order.
    pub const ALL: [Self; 3] = [Self::Low, Self::Nominal, Self::High];
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_quantity_is_nan_infinite_or_negative() {
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -1.0] {
            assert!(Watts::new(bad).is_err(), "{bad}");
            assert!(Picojoules::new(bad).is_err(), "{bad}");
            assert!(Hertz::new(bad).is_err(), "{bad}");
        }
        assert!(Volts::new(0.0).is_err());
        assert_eq!(Watts::new(0.0).map(Watts::value), Ok(0.0));
    }

    #[test]
    fn an_out_of_range_error_names_the_range() {
        let text = Watts::new(-1.0).unwrap_err().to_string();
        assert_eq!(text, "-1 W is not a number from 0 to 10000 W: give one in that range");
    }

    #[test]
    fn an_empty_source_is_none() {
        assert!(Source::try_from("  ".to_owned()).is_err());
    }
}
