//! Work that a measurement ran, added up from the reports of its frames.

use std::ops::AddAssign;

use activity::{Counts, Event};
use pipeline::FrameReport;

/// Counts of what ran.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Ran {
    /// Passes.
    pub passes: u64,
    /// Draws.
    pub draws: u64,
    /// Samples inside a triangle.
    pub fragments: u64,
}

impl Ran {
    /// Work of a frame.
    pub fn of(report: &FrameReport) -> Self {
        Self::counted(report.passes.len() as u64, &report.counts())
    }

    /// Work of so many passes with these counts.
    pub fn counted(passes: u64, counts: &Counts) -> Self {
        Self { passes, draws: counts[Event::Draws], fragments: counts[Event::SamplesHit] }
    }
}

impl AddAssign for Ran {
    fn add_assign(&mut self, other: Self) {
        self.passes += other.passes;
        self.draws += other.draws;
        self.fragments += other.fragments;
    }
}

impl std::iter::Sum for Ran {
    fn sum<I: Iterator<Item = Self>>(all: I) -> Self {
        all.fold(Self::default(), |mut sum, one| {
            sum += one;
            sum
        })
    }
}
