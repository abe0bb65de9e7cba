//! Plans: sets of tile tests.

/// A set of tile tests, a bit each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in super::super) struct Plan(pub u8);

/// What is at stake where a plan is chosen.
#[derive(Clone, Copy, Debug)]
pub(in super::super) struct Stake {
    /// Plans of these tests are allowed.
    pub allowed: Plan,
    pub moving: bool,
    /// Samples in what is left of lens and time, as a rule.
    pub samples: f64,
    /// Fine tiles that are visited, if this is a coarse one.
    pub tiles: Option<u32>,
    /// Multiply-adds of finding the edges, which a screen needs, too.
    pub found: f64,
    /// Multiply-adds of setting up a screen.
    pub screen: f64,
    /// Multiply-adds of a sample test.
    pub full: f64,
}

impl Plan {
    pub const SIDES: u8 = 1;
    pub const FACING: u8 = 2;
    pub const EDGES: u8 = 4;
    /// Every set of the three.
    pub const COUNT: usize = 8;

    /// The plans of these tests, each after those that it goes on from.
    pub fn within(self) -> impl Iterator<Item = Self> {
        (0..Self::COUNT as u8).map(Self).filter(move |plan| plan.0 & !self.0 == 0)
    }

    pub fn has(self, test: u8) -> bool {
        self.0 & test != 0
    }

    /// The last test of the plan and the plan without it.
    pub fn last(self) -> Option<(u8, Self)> {
        let last = [Self::EDGES, Self::FACING, Self::SIDES].into_iter().find(|&test| self.has(test))?;
        Some((last, Self(self.0 & !last)))
    }
}
