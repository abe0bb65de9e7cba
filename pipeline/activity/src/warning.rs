//! Coded remarks about a run.

use serde::Serialize;

/// A run has entered a regime its methods are known to be bad at, or has gone on without something it was
/// told to use. Codes are stable and listed in the book's chapter on warnings.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
pub struct Warning {
    /// A stable code in kebab case, for example `missing-image`.
    pub code: &'static str,
    /// What happened, where, and what it means for the results.
    pub message: String,
}

impl Warning {
    /// A warning with its stable code.
    pub fn new(code: &'static str, message: impl Into<String>) -> Self {
        Self { code, message: message.into() }
    }
}

impl std::fmt::Display for Warning {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "[{}] {}", self.code, self.message)
    }
}
