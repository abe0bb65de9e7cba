//! What a claim asks for, and what became of it.

use serde::{Deserialize, Serialize, Serializer};

/// What has to agree for a row to hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
pub enum Kind {
    /// An equality that holds exactly.
    Equality,
    /// A number to be close to.
    Number,
    /// An order or a sign that comes out.
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

/// What became of a claim.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum Verdict {
    /// It came out, at every setting that the paper leaves open.
    #[serde(rename = "holds")]
    Holds,
    /// It did not, at any.
    #[serde(rename = "differs")]
    Differs,
    /// It comes out at some settings that the paper leaves open and not at others.
    #[serde(rename = "depends")]
    Depends,
    /// It waits for a part that does not exist.
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
