//! Warnings: the analysis went on, but where it stands on weak ground it says so.

use serde::Serialize;

/// A coded warning. The code never changes its meaning; the message is for people.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Warning {
    /// Stable, lower case, with hyphens.
    pub code: &'static str,
    /// What was seen, and what one can do about it.
    pub message: String,
}

impl Warning {
    pub(crate) fn new(code: &'static str, message: String) -> Self {
        Self { code, message }
    }
}
