//! Which frames of a run differ.

use std::collections::HashMap;

use rayon::prelude::*;
use workloads::{Fingerprint, Job};

use crate::RunError;

/// Groups of frames with equal input. Each group is simulated once.
///
/// Inputs are compared by the [`Fingerprint`] of everything that the renderer receives and that changes from
/// frame to frame: the camera at both ends of the shutter, every mesh, and all that a workload prepares.
/// Settings, materials, lights, background, sample table and hardware are constant in a run and are not
/// compared.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Distinct {
    /// First frame of each group, in order.
    numbers: Vec<u32>,
    /// Index of the group of each frame of the run.
    groups: Vec<usize>,
    /// Number of the first frame of the run.
    start: u32,
}

impl Distinct {
    /// Prepares and compares all frames of `job`.
    ///
    /// # Errors
    /// When a frame cannot be made.
    pub fn new(job: &dyn Job) -> Result<Self, RunError> {
        let range = job.settings().frames.clone();
        if range.len() == 1 {
            return Ok(Self::of(range.start, &[()]));
        }
        let start = range.start;
        let prints = range.into_par_iter().map(|number| job.fingerprint(number));
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

    /// Number of the first frame of each group, in order: the frames to simulate.
    pub fn numbers(&self) -> &[u32] {
        &self.numbers
    }

    /// Index of the group of each frame of the run, in [`Self::numbers`].
    pub fn groups(&self) -> &[usize] {
        &self.groups
    }

    /// Numbers of the frames in `group`.
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
