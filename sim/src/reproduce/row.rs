//! One claim of a paper beside what came out here.

use serde::{Serialize, Serializer};

/// What has to agree for a row to hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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

/// What became of a claim.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum Verdict {
    /// It came out.
    #[serde(rename = "holds")]
    Holds,
    /// It did not.
    #[serde(rename = "differs")]
    Differs,
    /// It waits for a part that does not exist.
    #[serde(rename = "not yet")]
    NotYet,
}

impl Verdict {
    /// Holds or differs.
    pub const fn of(holds: bool) -> Self {
        if holds { Self::Holds } else { Self::Differs }
    }

    /// As printed.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Holds => "holds",
            Self::Differs => "differs",
            Self::NotYet => "not yet",
        }
    }
}

/// A row of the list of claims.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Its name in the list, for example `III-3`.
    pub id: &'static str,
    /// What has to agree; an `F` is added where there are figures.
    #[serde(serialize_with = "letters")]
    pub kind: Kind,
    /// The claim in a few words.
    pub claim: &'static str,
    /// What the paper says.
    pub paper: &'static str,
    /// What came out here.
    pub ours: String,
    /// Whether that agrees.
    pub verdict: Verdict,
    /// When it holds, and why it differs or what it waits for.
    pub note: String,
    /// The numbers behind `ours`, by name.
    pub numbers: Vec<Number>,
    /// The first of its figures, as a path below the folder of results.
    pub figure: Option<String>,
    /// All of them.
    pub figures: Vec<String>,
}

/// A computed number.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Number {
    /// Its name, with its unit.
    pub name: &'static str,
    /// Its value.
    pub value: f64,
}

/// Numbers from names and values.
pub(super) fn numbers<const N: usize>(pairs: [(&'static str, f64); N]) -> Vec<Number> {
    pairs.into_iter().map(|(name, value)| Number { name, value }).collect()
}

fn letters<S: Serializer>(kind: &Kind, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(kind.letter())
}

impl Row {
    /// Whether the row is one that has to hold and does not.
    pub fn fails(&self) -> bool {
        self.kind == Kind::Equality && self.verdict != Verdict::Holds
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_an_equality_that_does_not_hold_fails() {
        let row = |kind, verdict| Row {
            id: "X-1",
            kind,
            claim: "",
            paper: "",
            ours: String::new(),
            verdict,
            note: String::new(),
            numbers: Vec::new(),
            figure: None,
            figures: Vec::new(),
        };
        assert!(
            row(Kind::Equality, Verdict::Differs).fails() && row(Kind::Equality, Verdict::NotYet).fails()
        );
        assert!(!row(Kind::Equality, Verdict::Holds).fails());
        assert!(!row(Kind::Number, Verdict::Differs).fails() && !row(Kind::Order, Verdict::NotYet).fails());
        assert_eq!(serde_json::to_value(row(Kind::Order, Verdict::NotYet)).unwrap()["verdict"], "not yet");
        assert_eq!((Verdict::of(true), Verdict::of(false)), (Verdict::Holds, Verdict::Differs));
    }
}
