//! Densities with a bound over any box.

use std::f64::consts::TAU;

use serde::{Deserialize, Serialize};

/// How many points there are to be, up to a factor.
pub trait Density<const D: usize>: Sync {
    /// The density at a point of the unit cube, not below zero.
    fn at(&self, point: &[f64; D]) -> f64;

    /// At least as much as the density anywhere in a box.
    fn most(&self, low: &[f64; D], high: &[f64; D]) -> f64;
}

/// Densities that have a name, each in any dimension.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Named {
    /// The same everywhere.
    Constant,
    /// The mean of the coordinates.
    Ramp,
    /// A bell about the middle with a deviation of 0.15.
    #[default]
    Gauss,
    /// Three waves along each axis: the product of `(1 + cos(6 pi x)) / 2`.
    Waves,
}

/// Twice the variance of the bell.
const SPREAD: f64 = 2.0 * 0.15 * 0.15;
/// Waves to a unit of length.
const WAVES: f64 = 3.0;
/// What rounding may lose.
const ROUNDING: f64 = 1.0 + 1e-12;

fn wave(x: f64) -> f64 {
    0.5 + 0.5 * libm::cos(TAU * WAVES * x)
}

impl Named {
    /// All of them, with the names they go by.
    pub const ALL: [(&'static str, Self); 4] =
        [("constant", Self::Constant), ("ramp", Self::Ramp), ("gauss", Self::Gauss), ("waves", Self::Waves)];

    /// The density called `name`.
    pub fn by_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|(known, _)| *known == name).map(|(_, density)| density)
    }
}

impl<const D: usize> Density<D> for Named {
    fn at(&self, point: &[f64; D]) -> f64 {
        match self {
            Self::Constant => 1.0,
            Self::Ramp => point.iter().sum::<f64>() / D as f64,
            Self::Gauss => {
                let square: f64 = point.iter().map(|x| (x - 0.5) * (x - 0.5)).sum();
                libm::exp(-square / SPREAD)
            }
            Self::Waves => point.iter().map(|&x| wave(x)).product(),
        }
    }

    fn most(&self, low: &[f64; D], high: &[f64; D]) -> f64 {
        let near = |k: usize| match self {
            Self::Constant | Self::Ramp => high[k],
            Self::Gauss => 0.5_f64.clamp(low[k], high[k]),
            // A crest, where there is one; an end otherwise.
            Self::Waves => {
                let crest = (low[k] * WAVES).ceil() / WAVES;
                let ends = if wave(low[k]) > wave(high[k]) { low[k] } else { high[k] };
                if crest <= high[k] { crest } else { ends }
            }
        };
        let highest: [f64; D] = std::array::from_fn(near);
        ROUNDING * self.at(&highest)
    }
}
