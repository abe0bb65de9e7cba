//! Kind and verdict of a claim.

use serde::{Deserialize, Serialize, Serializer};

/// Kind of agreement that a row needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
pub enum Kind {
    /// An equality that holds exactly.
    Equality,
    /// A number with a tolerance.
    Number,
    /// An order or a sign.
    Order,
}

impl Kind {
    /// The letter of the list of claims.
    pub const fn letter(self) -> &'static str {
        match self {
            Self::Equality => "E",
            Self::Number => "N",
            Self::Order => "O",
        }
    }
}

impl Serialize for Kind {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.letter())
    }
}

/// Verdict of a claim.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum Verdict {
    /// The condition is met at every value of the open settings.
    #[serde(rename = "holds")]
    Holds,
    /// The condition is met at no value.
    #[serde(rename = "differs")]
    Differs,
    /// The condition is met at some values of the open settings and not at others.
    #[serde(rename = "depends")]
    Depends,
    /// A part that the row needs is missing.
    #[serde(rename = "not yet")]
    NotYet,
}

impl Verdict {
    /// Every verdict.
    pub const ALL: [Self; 4] = [Self::Holds, Self::Differs, Self::Depends, Self::NotYet];

    /// Holds or differs.
    pub const fn of(holds: bool) -> Self {
        if holds { Self::Holds } else { Self::Differs }
    }

    /// As printed.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Holds => "holds",
            Self::Differs => "differs",
            Self::Depends => "depends",
            Self::NotYet => "not yet",
        }
    }
}
