//! Whole numbers that cannot be built out of range.

use std::fmt;

use serde::Deserialize;

/// A whole number from `LEAST` to `MOST`, both included. A file with another number is refused while it is read, so the
/// message has its line and column.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Deserialize)]
#[serde(try_from = "i64")]
pub struct Bounded<const LEAST: u32, const MOST: u32>(u32);

/// A whole number outside its range.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{value} is out of range; it has to be {least} to {most}")]
pub struct OutOfBounds {
    /// The number that was given.
    pub value: i64,
    /// The least allowed.
    pub least: u32,
    /// The most allowed.
    pub most: u32,
}

impl<const LEAST: u32, const MOST: u32> Bounded<LEAST, MOST> {
    /// The least there is.
    pub const MIN: Self = Self(LEAST);
    /// The most there is.
    pub const MAX: Self = Self(MOST);

    /// Checks `value` against the range.
    ///
    /// # Errors
    /// [`OutOfBounds`] with the range.
    pub const fn new(value: u32) -> Result<Self, OutOfBounds> {
        if LEAST <= value && value <= MOST {
            Ok(Self(value))
        } else {
            Err(OutOfBounds { value: value as i64, least: LEAST, most: MOST })
        }
    }

    /// The number.
    pub const fn get(self) -> u32 {
        self.0
    }
}

impl<const LEAST: u32, const MOST: u32> TryFrom<u32> for Bounded<LEAST, MOST> {
    type Error = OutOfBounds;
    fn try_from(value: u32) -> Result<Self, OutOfBounds> {
        Self::new(value)
    }
}

impl<const LEAST: u32, const MOST: u32> TryFrom<i64> for Bounded<LEAST, MOST> {
    type Error = OutOfBounds;
    fn try_from(value: i64) -> Result<Self, OutOfBounds> {
        let out = OutOfBounds { value, least: LEAST, most: MOST };
        u32::try_from(value).map_err(|_| out).and_then(Self::new)
    }
}

impl<const LEAST: u32, const MOST: u32> fmt::Debug for Bounded<LEAST, MOST> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

macro_rules! widens_to {
    ($($wide:ty)*) => {$(
        impl<const LEAST: u32, const MOST: u32> From<Bounded<LEAST, MOST>> for $wide {
            fn from(number: Bounded<LEAST, MOST>) -> $wide {
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
    fn what_is_out_of_range_cannot_be_built() {
        assert_eq!([Queue::new(1), Queue::new(65_536)], [Ok(Queue::MIN), Ok(Queue::MAX)]);
        for value in [0, 65_537, u32::MAX] {
            assert_eq!(
                Queue::new(value).unwrap_err().to_string(),
                format!("{value} is out of range; it has to be 1 to 65536")
            );
        }
    }

    #[test]
    fn files_are_refused_with_the_place_and_the_field() {
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
        // Letters of several bytes before, in and behind the value.
        let text = message("(\u{a0}queue:\u{a0}\u{fc}\u{a0}, next: 1)");
        assert!(text.starts_with("gpu.ron:1:"), "{text}");
        let text = message("(queue: 1, next: nan)");
        assert!(text.contains("`next`: `nan` is not a number"), "{text}");
    }
}
