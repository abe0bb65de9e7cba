//! Integers with a range in their type.

use std::fmt;

use serde::Deserialize;

/// An integer from `MIN` to `MAX`, both included. Deserializing a number outside the range is an error, so
/// the message has the line and column of the file.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Deserialize)]
#[serde(try_from = "i64")]
pub struct Bounded<const MIN: u32, const MAX: u32>(u32);

/// An integer outside its range.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{value} is out of range; it has to be {least} to {most}")]
pub struct OutOfBounds {
    /// The value given.
    pub value: i64,
    /// Smallest allowed value.
    pub least: u32,
    /// Largest allowed value.
    pub most: u32,
}

impl<const MIN: u32, const MAX: u32> Bounded<MIN, MAX> {
    /// Smallest value.
    pub const MIN: Self = Self(MIN);
    /// Largest value.
    pub const MAX: Self = Self(MAX);

    /// Check `value` against the range.
    ///
    /// # Errors
    /// [`OutOfBounds`] with the range.
    pub const fn new(value: u32) -> Result<Self, OutOfBounds> {
        if MIN <= value && value <= MAX {
            Ok(Self(value))
        } else {
            Err(OutOfBounds { value: value as i64, least: MIN, most: MAX })
        }
    }

    /// The value.
    pub const fn get(self) -> u32 {
        self.0
    }
}

impl<const MIN: u32, const MAX: u32> TryFrom<u32> for Bounded<MIN, MAX> {
    type Error = OutOfBounds;
    fn try_from(value: u32) -> Result<Self, OutOfBounds> {
        Self::new(value)
    }
}

impl<const MIN: u32, const MAX: u32> TryFrom<i64> for Bounded<MIN, MAX> {
    type Error = OutOfBounds;
    fn try_from(value: i64) -> Result<Self, OutOfBounds> {
        let out = OutOfBounds { value, least: MIN, most: MAX };
        u32::try_from(value).map_err(|_| out).and_then(Self::new)
    }
}

impl<const MIN: u32, const MAX: u32> fmt::Debug for Bounded<MIN, MAX> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

macro_rules! widens_to {
    ($($wide:ty)*) => {$(
        impl<const MIN: u32, const MAX: u32> From<Bounded<MIN, MAX>> for $wide {
            fn from(number: Bounded<MIN, MAX>) -> $wide {
                number.0.into()
            }
        }
    )*};
}

widens_to! { u32 u64 f64 }

#[cfg(test)]
mod tests {
    use super::*;

    type Queue = Bounded<1, 65_536>;

    #[test]
    fn values_out_of_range_are_refused() {
        assert_eq!([Queue::new(1), Queue::new(65_536)], [Ok(Queue::MIN), Ok(Queue::MAX)]);
        for value in [0, 65_537, u32::MAX] {
            assert_eq!(
                Queue::new(value).unwrap_err().to_string(),
                format!("{value} is out of range; it has to be 1 to 65536")
            );
        }
    }

    #[test]
    fn an_error_in_a_file_names_line_and_field() {
        #[derive(Debug, Deserialize)]
        struct Unit {
            #[allow(dead_code)]
            queue: Queue,
            #[allow(dead_code)]
            next: f64,
        }
        let message = |text: &str| crate::spec::parse::<Unit>(text, "gpu.ron").unwrap_err().to_string();
        for (value, says) in [
            ("4294967295", "`queue`: 4294967295 is out of range; it has to be 1 to 65536"),
            ("18446744073709551616", "`queue`: `18446744073709551616` is too large"),
            ("-1", "`queue`: -1 is out of range; it has to be 1 to 65536"),
            ("0", "`queue`: 0 is out of range"),
            ("1.5", "`queue`: `1.5` is not a whole number"),
            ("nan", "`queue`: `nan` is not a whole number"),
        ] {
            let text = message(&format!("(\n  // how long: it may be\n  queue: {value},\n  next: 1,\n)"));
            assert!(text.starts_with("gpu.ron:3:") && text.contains(says), "{text}");
        }
        // Multi-byte characters before, inside and after the value.
        let text = message("(\u{a0}queue:\u{a0}\u{fc}\u{a0}, next: 1)");
        assert!(text.starts_with("gpu.ron:1:"), "{text}");
        let text = message("(queue: 1, next: nan)");
        assert!(text.contains("`next`: `nan` is not a number"), "{text}");
    }
}
