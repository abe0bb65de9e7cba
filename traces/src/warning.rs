//! Warnings about a result that may be wrong.

use serde::Serialize;

/// A coded warning. The code never changes its meaning; the message is for people.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Warning {
    /// Stable, lower case, with hyphens.
    pub code: &'static str,
    /// The observation, and what to do.
    pub message: String,
}

impl Warning {
    pub(crate) fn new(code: &'static str, message: String) -> Self {
        Self { code, message }
    }
}
