//! The ways to find frames.

use core::fmt;
use core::str::FromStr;
use serde::Serialize;

/// How frame starts are found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Sum of squared differences to the marked window, threshold, local minima (Paper III).
    SumOfSquares,
    /// The same by z-normalized distance: likeness of shape, whatever the level and the scale of power.
    Normalized,
    /// The sequence of starts that resembles several templates, by shape and by squares, itself, and an even beat best.
    Tracking,
    /// Tracking; with fewer than 20 samples in the window, of tracking, the sum of squares and normalized that with the most even beat,
    /// with fewer than 8 the sum of squares. That also where there are fewer than 16 frames, or more than 16 million samples and no doubt.
    #[default]
    Auto,
}

impl Method {
    /// All of them, in order.
    pub const ALL: [Self; 4] = [Self::SumOfSquares, Self::Normalized, Self::Tracking, Self::Auto];

    /// The name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::SumOfSquares => "squares",
            Self::Normalized => "normalized",
            Self::Tracking => "tracking",
            Self::Auto => "auto",
        }
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Method {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let names = || Self::ALL.map(Self::name).join(", ");
        Self::ALL
            .into_iter()
            .find(|method| method.name() == text)
            .ok_or_else(|| format!("no method {text}: choose one of {}", names()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_is_read_back_and_others_are_refused_with_the_choice() {
        for method in Method::ALL {
            assert_eq!(method.to_string().parse(), Ok(method));
        }
        assert_eq!(
            "dtw".parse::<Method>(),
            Err("no method dtw: choose one of squares, normalized, tracking, auto".to_owned())
        );
    }
}
