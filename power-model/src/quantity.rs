//! Numbers that cannot be built out of range, and numbers that cannot be written without a source.

use serde::Deserialize;

/// A number outside the range its quantity can have.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{value} {unit} is not a number from {low} to {high} {unit}: give one in that range")]
pub struct OutOfRange {
    /// The number that was given.
    pub value: f64,
    /// Its unit.
    pub unit: &'static str,
    /// The smallest allowed.
    pub low: f64,
    /// The largest allowed.
    pub high: f64,
}

macro_rules! quantities {
    ($($(#[$doc:meta])* $name:ident $unit:literal $low:literal to $high:literal)*) => {$(
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, PartialOrd, Deserialize)]
        #[serde(try_from = "f64")]
        pub struct $name(f64);

        impl $name {
            /// The largest there is.
            pub const MOST: f64 = $high;

            /// Checks `value` against the range of this quantity.
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

            /// The number, in the unit of this quantity.
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

/// A process node, nm: from beyond the smallest to the first integrated circuits.
pub type Nanometres = activity::Bounded<1, 20_000>;

/// A number with a unit, for lists of where numbers come from.
pub trait Quantity {
    /// The unit's symbol.
    const UNIT: &'static str;
    /// The number in that unit.
    fn number(&self) -> f64;
}

quantities! {
    /// Power, 0 to 10 kW: a supply that delivers more is not a graphics card's.
    Watts "W" 0.0 to 1e4
    /// A supply voltage, 0.1 to 48 V.
    Volts "V" 0.1 to 48.0
    /// A length of time, at most an hour.
    Seconds "s" 0.0 to 3600.0
    /// Idle time recorded before or after a run, at most a minute: more shows nothing new and fills the disk.
    RecordedIdle "s" 0.0 to 60.0
    /// A rate of frames, 0.1 Hz to 100 kHz.
    Hertz "Hz" 0.1 to 1e5
    /// A junction temperature.
    Celsius "degC" -50.0 to 150.0
    /// A time from one thing to the next of its kind, 0.1 ms to an hour: nothing repeats without pause.
    Interval "s" 1e-4 to 3600.0
    /// A part of a whole.
    Share "(share)" 0.0 to 1.0
    /// One number over another of the same kind.
    Ratio "(ratio)" 0.01 to 100.0
    /// An exponent of a stated law.
    Exponent "(exponent)" 0.0 to 10.0
    /// Energy of one event, at most 1 mJ: more is a mistake of units.
    Picojoules "pJ" 0.0 to 1e9
}

/// Where a number comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
pub enum Basis {
    /// Printed in a publication, or measured, as it stands.
    Published,
    /// Worked out from published numbers; the source says how.
    Derived,
    /// A guess; the source gives the reasoning.
    Assumed,
}

impl Basis {
    /// The word used in tables.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Published => "published",
            Self::Derived => "derived",
            Self::Assumed => "assumed",
        }
    }
}

/// The source of a number: a citation or the reasoning. Never empty.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(try_from = "String")]
pub struct Source(String);

impl Source {
    /// The text.
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
    /// Worked out from published numbers.
    Derived(T, Source),
    /// A guess with its reasoning.
    Assumed(T, Source),
}

impl<T> Sourced<T> {
    /// The quantity.
    pub const fn get(&self) -> &T {
        match self {
            Self::Published(value, _) | Self::Derived(value, _) | Self::Assumed(value, _) => value,
        }
    }

    /// Where it comes from, in words.
    pub fn source(&self) -> &str {
        match self {
            Self::Published(_, source) | Self::Derived(_, source) | Self::Assumed(_, source) => source.text(),
        }
    }

    /// Where it comes from, in one word.
    pub const fn basis(&self) -> Basis {
        match self {
            Self::Published(..) => Basis::Published,
            Self::Derived(..) => Basis::Derived,
            Self::Assumed(..) => Basis::Assumed,
        }
    }
}

impl<T: Quantity> Sourced<T> {
    /// The number in the unit its field's name states.
    pub fn value(&self) -> f64 {
        self.get().number()
    }

    /// The unit's symbol.
    pub const fn unit(&self) -> &'static str {
        T::UNIT
    }
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
    fn out_of_range_says_what_would_be_in_range() {
        let text = Watts::new(-1.0).unwrap_err().to_string();
        assert_eq!(text, "-1 W is not a number from 0 to 10000 W: give one in that range");
    }

    #[test]
    fn an_empty_source_is_none() {
        assert!(Source::try_from("  ".to_owned()).is_err());
    }
}
