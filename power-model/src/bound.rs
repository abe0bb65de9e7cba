//! Which end of all intervals is taken.

use serde::{Deserialize, Serialize};

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
