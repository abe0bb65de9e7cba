//! A warning, and how many become one.

use std::collections::BTreeMap;
use std::fmt;

use serde::Serialize;

use crate::Code;

/// A run has entered a regime its methods are known to be bad at, or has gone on without something its input asks for.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
pub struct Warning {
    /// Its subject.
    pub code: Code,
    /// The event, the number of things it concerns, and its effect on the results; one line.
    pub message: String,
    /// How many things it concerns (materials, primitives, frames); 1 where it is about the run as a whole.
    pub count: usize,
    /// Which things these are, the first [`Warning::MAX_DETAILS`] of them; none where the message says it all.
    pub details: Vec<String>,
    #[serde(skip)]
    kind: Option<Kind>,
}

/// Parts of a counted message: "3 point lights ignored: only one directional light is used".
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Kind {
    thing: &'static str,
    what: &'static str,
}

impl Warning {
    /// The most details that a warning keeps.
    pub const MAX_DETAILS: usize = 256;

    /// A warning about the run as a whole, or one whose message has all numbers.
    pub fn new(code: Code, message: impl Into<String>) -> Self {
        Self { code, message: message.into(), count: 1, details: Vec::new(), kind: None }
    }

    /// A warning about one `thing`, a noun whose plural ends in `s`; `what` goes on after the noun, and `detail` says which
    /// thing it is. [`Warning::fold`] makes one warning of all that are about the same kind of thing.
    pub fn about(code: Code, thing: &'static str, what: &'static str, detail: impl Into<String>) -> Self {
        let kind = Kind { thing, what };
        Self { code, message: kind.message(1), count: 1, details: vec![detail.into()], kind: Some(kind) }
    }

    /// The same about as many things as there are `details`, of which only the first are computed.
    pub fn about_all(
        code: Code,
        thing: &'static str,
        what: &'static str,
        details: impl ExactSizeIterator<Item = String>,
    ) -> Option<Self> {
        let (kind, count) = (Kind { thing, what }, details.len());
        let details = details.take(Self::MAX_DETAILS).collect();
        (count > 0).then(|| Self { code, message: kind.message(count), count, details, kind: Some(kind) })
    }

    /// The same with a number of things it concerns, and which these are.
    #[must_use]
    pub fn with_details(mut self, count: usize, details: impl IntoIterator<Item = String>) -> Self {
        self.count = count;
        self.details = details.into_iter().take(Self::MAX_DETAILS).collect();
        self
    }

    /// The warnings in order of their codes, those about the same kind of thing as one with a count, and equal ones once.
    pub fn fold(all: impl IntoIterator<Item = Self>) -> Vec<Self> {
        let mut counted: BTreeMap<(Code, Kind), Self> = BTreeMap::new();
        let mut folded = Vec::new();
        for warning in all {
            match warning.kind {
                Some(kind) => match counted.get_mut(&(warning.code, kind)) {
                    Some(known) => known.join(warning, kind),
                    None => drop(counted.insert((warning.code, kind), warning)),
                },
                None => folded.push(warning),
            }
        }
        folded.extend(counted.into_values());
        folded.sort();
        folded.dedup();
        folded
    }

    fn join(&mut self, other: Self, kind: Kind) {
        self.count += other.count;
        self.message = kind.message(self.count);
        let room = Self::MAX_DETAILS - self.details.len().min(Self::MAX_DETAILS);
        self.details.extend(other.details.into_iter().take(room));
    }

    /// The message with the first thing that it concerns and how many more there are.
    pub fn line(&self) -> String {
        let message = &self.message;
        match (self.details.first(), self.count) {
            (None, _) => message.clone(),
            (Some(first), 0 | 1) => format!("{message} ({first})"),
            (Some(first), count) => format!("{message} ({first}, and {} more)", count - 1),
        }
    }

    /// How many of the things it concerns are not in its details.
    pub fn omitted(&self) -> usize {
        if self.details.is_empty() { 0 } else { self.count.saturating_sub(self.details.len()) }
    }
}

impl Kind {
    fn message(self, count: usize) -> String {
        let Self { thing, what } = self;
        format!("{count} {thing}{} {what}", if count == 1 { "" } else { "s" })
    }
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "[{}] {}", self.code, self.line())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn light(node: usize) -> Warning {
        let what = "ignored: only one directional light is used";
        Warning::about(Code::LightIgnored, "point light", what, format!("node {node}"))
    }

    #[test]
    fn warnings_about_one_kind_of_thing_become_one_with_a_count() {
        let whole = Warning::new(Code::EmptyFrame, "nothing is seen");
        let folded = Warning::fold([light(4), whole.clone(), light(7), whole.clone(), light(9)]);
        assert_eq!(folded.len(), 2);
        assert_eq!(folded[0], whole);
        assert_eq!(folded[1].message, "3 point lights ignored: only one directional light is used");
        assert_eq!((folded[1].count, folded[1].details.len()), (3, 3));
        let head = "[light-ignored] 3 point lights ignored: only one directional light is used";
        assert_eq!(folded[1].to_string(), format!("{head} (node 4, and 2 more)"));
        assert_eq!(folded[0].to_string(), "[empty-frame] nothing is seen");
        assert!(Warning::fold([light(4)])[0].to_string().contains("1 point light ignored"));
    }

    #[test]
    fn folding_twice_changes_nothing() {
        let once = Warning::fold([light(4), light(7)]);
        assert_eq!(Warning::fold(once.clone()), once);
        let more = Warning::fold(once.into_iter().chain([light(9)]));
        assert_eq!((more[0].count, more[0].message.starts_with("3 point lights")), (3, true));
    }

    #[test]
    fn the_number_of_details_is_limited_and_the_count_is_not() {
        let many = Warning::fold((0..1000).map(light));
        assert_eq!((many[0].count, many[0].details.len()), (1000, Warning::MAX_DETAILS));
        assert_eq!(many[0].omitted(), 744);
    }
}
