//! Which frames of a run are drawn from the same input, so that each input is simulated once.

use std::collections::HashMap;

use rayon::prelude::*;
use workloads::Fingerprint;

use super::{RunError, Work};

/// The frames of a run in groups of equal input.
///
/// Inputs are compared by the [`Fingerprint`] of everything that the renderer receives and that changes from frame to frame:
/// the camera at both ends of the shutter, every mesh, and whatever else a workload prepares. What does not change within a run
/// (settings, materials, lights, background, sample table, hardware) needs no comparison.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Distinct {
    /// The first frame of each group, in order.
    numbers: Vec<u32>,
    /// For each frame of the run the index of its group.
    groups: Vec<usize>,
    /// Number of the first frame of the run.
    start: u32,
}

impl Distinct {
    /// Prepares every frame of `work` and compares them.
    ///
    /// # Errors
    /// When a frame cannot be made.
    pub fn new(work: &Work) -> Result<Self, RunError> {
        let range = work.settings().frames.clone();
        if range.len() == 1 {
            return Ok(Self::of(range.start, &[()]));
        }
        let start = range.start;
        let prints = range.into_par_iter().map(|number| work.fingerprint(number));
        Ok(Self::of(start, &prints.collect::<Result<Vec<Fingerprint>, _>>()?))
    }

    fn of<K: Eq + std::hash::Hash>(start: u32, inputs: &[K]) -> Self {
        let (mut numbers, mut known) = (Vec::new(), HashMap::new());
        let groups = (start..)
            .zip(inputs)
            .map(|(number, input)| {
                *known.entry(input).or_insert_with(|| {
                    numbers.push(number);
                    numbers.len() - 1
                })
            })
            .collect();
        Self { numbers, groups, start }
    }

    /// The first frame of each group, in order: those that have to be simulated.
    pub fn numbers(&self) -> &[u32] {
        &self.numbers
    }

    /// For each frame of the run the index of its group in [`Self::numbers`].
    pub fn groups(&self) -> &[usize] {
        &self.groups
    }

    /// Numbers of the frames in group `group`.
    pub fn members(&self, group: usize) -> impl Iterator<Item = u32> {
        (self.start..).zip(&self.groups).filter(move |(_, of)| **of == group).map(|(number, _)| number)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_frames_share_a_group_wherever_they_are() {
        let found = Distinct::of(7, &["a", "b", "a", "a", "c", "b"]);
        assert_eq!((found.numbers(), found.groups()), (&[7, 8, 11][..], &[0, 1, 0, 0, 2, 1][..]));
        assert_eq!(found.members(0).collect::<Vec<_>>(), [7, 9, 10]);
        assert_eq!(found.members(2).collect::<Vec<_>>(), [11]);
    }
}
