//! The ways to find frames, each built on the one before.

use core::fmt;
use core::str::FromStr;
use serde::Serialize;

/// How frame starts are found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Sum of squared differences to the marked window, threshold, local minima (Paper III).
    SumOfSquares,
    /// The same with windows brought to zero mean and unit deviation, so that neither idle power nor clock counts.
    Normalized,
    /// The nearest of several windows, learnt from starts that are beyond doubt.
    Templates,
    /// The sequence of starts that resembles the templates, itself and an even beat best.
    Tracking,
    /// Sum of squares where that is clear, else tracking.
    #[default]
    Auto,
}

impl Method {
    /// All of them, in order.
    pub const ALL: [Self; 5] = [Self::SumOfSquares, Self::Normalized, Self::Templates, Self::Tracking, Self::Auto];

    /// The name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::SumOfSquares => "squares",
            Self::Normalized => "normalized",
            Self::Templates => "templates",
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
