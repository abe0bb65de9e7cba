//! Parts that draw power, and energy by part.

use std::ops::{AddAssign, Index, IndexMut};

use activity::Unit;
use serde::{Serialize, Serializer};

/// A part that draws power: the events of a unit, or power that no event causes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Part {
    /// The events of one unit.
    Unit(Unit),
    /// Constant power during a frame.
    Constant,
    /// Leakage of the powered core.
    Leakage,
    /// Clock trees of busy units, and idle power of powered units.
    ClockTree,
    /// Idle power between frames, with the core power-gated.
    Idle,
}

/// Number of parts.
pub const PARTS: usize = Unit::COUNT + 4;

impl Part {
    /// All parts in the order of storage and summation: units as declared, then the others.
    pub const ALL: [Self; PARTS] = {
        let mut all = [Self::Idle; PARTS];
        let mut at = 0;
        while at < Unit::COUNT {
            all[at] = Self::Unit(Unit::ALL[at]);
            at += 1;
        }
        all[Self::Constant.index()] = Self::Constant;
        all[Self::Leakage.index()] = Self::Leakage;
        all[Self::ClockTree.index()] = Self::ClockTree;
        all
    };

    /// Index in [`Part::ALL`].
    pub const fn index(self) -> usize {
        match self {
            Self::Unit(unit) => unit as usize,
            Self::Constant => Unit::COUNT,
            Self::Leakage => Unit::COUNT + 1,
            Self::ClockTree => Unit::COUNT + 2,
            Self::Idle => Unit::COUNT + 3,
        }
    }

    /// Whether it is a unit that a GPU may lack.
    pub const fn is_optional(self) -> bool {
        matches!(self, Self::Unit(unit) if unit.is_optional())
    }

    /// Name in files, for example `sample_test` or `leakage`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Unit(unit) => unit.name(),
            Self::Constant => "constant",
            Self::Leakage => "leakage",
            Self::ClockTree => "clock_tree",
            Self::Idle => "idle",
        }
    }

    /// One sentence: what draws the power.
    pub const fn doc(self) -> &'static str {
        match self {
            Self::Unit(unit) => unit.doc(),
            Self::Constant => "Drawn as long as a frame runs, whatever it does.",
            Self::Leakage => "Leakage of the powered core.",
            Self::ClockTree => "Clock trees of busy units and what powered but idle units draw.",
            Self::Idle => "The floor between frames, with the core power-gated.",
        }
    }
}

/// Energy by part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Energy {
    /// Energy in joules, in the order of [`Part::ALL`].
    pub by_part_j: [f64; PARTS],
}

impl Energy {
    /// Zero energy.
    pub const ZERO: Self = Self { by_part_j: [0.0; PARTS] };

    /// Sum of all parts in joules, in the order of [`Part::ALL`]. No other total is stored, so it is exact by
    /// definition.
    pub fn total_j(&self) -> f64 {
        self.by_part_j.iter().fold(0.0, |sum, joules| sum + joules)
    }

    /// Every part with its energy in joules, in the order of [`Part::ALL`].
    pub fn iter(&self) -> impl Iterator<Item = (Part, f64)> + '_ {
        Part::ALL.into_iter().zip(self.by_part_j)
    }

    /// The same without units that a GPU may lack and that used no energy.
    pub fn reported(&self) -> impl Iterator<Item = (Part, f64)> + '_ {
        self.iter().filter(|(part, joules)| !part.is_optional() || *joules > 0.0)
    }
}

impl Default for Energy {
    fn default() -> Self {
        Self::ZERO
    }
}

impl Index<Part> for Energy {
    type Output = f64;
    fn index(&self, part: Part) -> &f64 {
        &self.by_part_j[part.index()]
    }
}

impl IndexMut<Part> for Energy {
    fn index_mut(&mut self, part: Part) -> &mut f64 {
        &mut self.by_part_j[part.index()]
    }
}

impl AddAssign<&Self> for Energy {
    fn add_assign(&mut self, other: &Self) {
        for (mine, theirs) in self.by_part_j.iter_mut().zip(other.by_part_j) {
            *mine += theirs;
        }
    }
}

impl Serialize for Energy {
    /// Write a map from part name to joules, as [`Energy::reported`].
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.reported().map(|(part, joules)| (part.name(), joules)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_index_matches_the_position() {
        for (at, part) in Part::ALL.into_iter().enumerate() {
            assert_eq!(part.index(), at, "{part:?}");
        }
    }

    #[test]
    fn names_are_unique() {
        for (at, part) in Part::ALL.into_iter().enumerate() {
            assert!(Part::ALL[..at].iter().all(|other| other.name() != part.name()), "{part:?}");
        }
    }

    #[test]
    fn optional_units_that_use_no_energy_are_not_reported() {
        let mut energy = Energy::ZERO;
        assert_eq!(energy.reported().count(), PARTS - 3);
        energy[Part::Unit(Unit::Edram)] = 1.0;
        assert_eq!(energy.reported().count(), PARTS - 2);
    }

    #[test]
    fn energies_add_part_by_part() {
        let mut energy = Energy::ZERO;
        energy[Part::Leakage] = 1.5;
        let other = energy;
        energy += &other;
        assert_eq!(energy[Part::Leakage], 3.0);
        assert_eq!(energy.total_j(), 3.0);
    }
}
