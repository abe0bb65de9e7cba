//! Counts over time.

use crate::{Counts, Unit};

/// Activity during one bin of time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Bin {
    /// Count of every event in the bin.
    pub counts: Counts,
    /// Busy time of every unit in the bin, in picoseconds.
    pub busy_ps: [u64; Unit::COUNT],
}

/// Activity of one frame over time, in equal bins from its start. The last bin may extend past the end of the
/// frame; that part is empty.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Timeline {
    /// Length of a bin in picoseconds, at least 1.
    pub bin_ps: u64,
    /// Length of the frame in picoseconds, from its first command to its last pixel.
    pub duration_ps: u64,
    /// The bins; `bins.len() * bin_ps >= duration_ps`.
    pub bins: Vec<Bin>,
}

impl Timeline {
    /// Length of a bin in seconds.
    pub fn bin_s(&self) -> f64 {
        self.bin_ps as f64 * 1e-12
    }

    /// Length of the frame in seconds.
    pub fn duration_s(&self) -> f64 {
        self.duration_ps as f64 * 1e-12
    }

    /// Counts of the whole frame.
    pub fn total(&self) -> Counts {
        self.bins.iter().fold(Counts::default(), |mut total, bin| {
            total += &bin.counts;
            total
        })
    }

    /// Busy time of every unit in the whole frame, in picoseconds.
    pub fn busy_ps(&self) -> [u64; Unit::COUNT] {
        let mut total = [0; Unit::COUNT];
        for bin in &self.bins {
            for (sum, busy) in total.iter_mut().zip(bin.busy_ps) {
                *sum += busy;
            }
        }
        total
    }
}
