//! What is remarkable about a frame.

use core::fmt;

/// One remark.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Flag {
    /// The frame whose start was marked.
    Marked,
    /// It ends at the end mark, not at a found start.
    Last,
    /// More than 1.5 times the median duration: perhaps two frames with a start missed between them.
    Long,
    /// Less than half the median duration: perhaps part of a frame.
    Short,
    /// Confidence below one half.
    Unsure,
    /// Over 1.6 times as long as the frames around it: starts in between may have been missed.
    Merged,
    /// Less than 1 / 1.6 as long as the frames around it: it may be part of one.
    Split,
    /// Its length breaks the even beat of the frames around it: one of its ends may be misplaced.
    Odd,
    /// Of fewer than 16 samples: its ends, known to half a sample at best, may be off by a thirtieth of it and more.
    Coarse,
}

impl Flag {
    /// Every flag, in the order in which they are written.
    pub const ALL: [Self; 9] = [
        Self::Marked,
        Self::Last,
        Self::Long,
        Self::Short,
        Self::Unsure,
        Self::Merged,
        Self::Split,
        Self::Odd,
        Self::Coarse,
    ];

    /// Those that tell of ends that may not be where they are said to be.
    pub const DOUBTS: [Self; 7] =
        [Self::Long, Self::Short, Self::Unsure, Self::Merged, Self::Split, Self::Odd, Self::Coarse];

    /// The word in the `flags` column.
    pub fn name(self) -> &'static str {
        match self {
            Self::Marked => "marked",
            Self::Last => "last",
            Self::Long => "long",
            Self::Short => "short",
            Self::Unsure => "unsure",
            Self::Merged => "merged",
            Self::Split => "split",
            Self::Odd => "odd",
            Self::Coarse => "coarse",
        }
    }

    fn bit(self) -> u16 {
        1 << self as u16
    }
}

/// A set of [`Flag`]s; shown as their names joined by `+`, empty if there are none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Flags(u16);

impl Flags {
    /// Adds a flag.
    pub fn insert(&mut self, flag: Flag) {
        self.0 |= flag.bit();
    }

    /// Whether a flag is set.
    pub fn contains(self, flag: Flag) -> bool {
        self.0 & flag.bit() != 0
    }

    /// Whether any of [`Flag::DOUBTS`] is set.
    pub fn doubted(self) -> bool {
        Flag::DOUBTS.iter().any(|flag| self.contains(*flag))
    }
}

impl fmt::Display for Flags {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut separator = "";
        for flag in Flag::ALL.into_iter().filter(|flag| self.contains(*flag)) {
            write!(f, "{separator}{}", flag.name())?;
            separator = "+";
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flags_print_in_a_fixed_order() {
        let mut flags = Flags::default();
        assert_eq!(flags.to_string(), "");
        flags.insert(Flag::Unsure);
        flags.insert(Flag::Last);
        assert_eq!(flags.to_string(), "last+unsure");
        assert!(flags.contains(Flag::Last) && !flags.contains(Flag::Long));
    }
}
