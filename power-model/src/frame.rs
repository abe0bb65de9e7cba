//! The power of one frame over time.

use crate::parts::{Energy, PARTS};

/// Watts over time of one frame, by part, and the joules they add up to.
#[derive(Clone, Debug, PartialEq)]
pub struct FramePower {
    /// Length of a bin in picoseconds.
    pub(crate) bin_ps: u64,
    /// Length of the frame in picoseconds.
    pub(crate) duration_ps: u64,
    /// Watts by part for each bin; the last one holds up to the end of the frame.
    pub(crate) watts: Vec<[f64; PARTS]>,
    /// Joules by part over the frame.
    pub(crate) energy: Energy,
}

/// Seconds in a picosecond.
pub(crate) const S_PER_PS: f64 = 1e-12;

impl FramePower {
    /// Length of a bin in seconds; the last bin may be shorter.
    pub fn bin_s(&self) -> f64 {
        self.bin_ps as f64 * S_PER_PS
    }

    /// Length of the frame in seconds.
    pub fn duration_s(&self) -> f64 {
        self.duration_ps as f64 * S_PER_PS
    }

    /// Length of the frame in picoseconds.
    pub const fn duration_ps(&self) -> u64 {
        self.duration_ps
    }

    /// Mean watts of each bin, by part in the order of [`crate::Part::ALL`].
    pub fn watts(&self) -> &[[f64; PARTS]] {
        &self.watts
    }

    /// Joules by part over the frame. Its total is the frame's energy, without any idle time after it.
    pub const fn energy(&self) -> &Energy {
        &self.energy
    }

    /// Each bin's true length in seconds and its watts by part; the last bin ends with the frame.
    pub fn bins(&self) -> impl Iterator<Item = (f64, &[f64; PARTS])> {
        self.bins_ps().map(|(length_ps, watts)| (length_ps as f64 * S_PER_PS, watts))
    }

    /// As [`Self::bins`], in picoseconds.
    pub(crate) fn bins_ps(&self) -> impl Iterator<Item = (u64, &[f64; PARTS])> {
        bin_lengths_ps(self.bin_ps, self.duration_ps).zip(&self.watts)
    }

    /// Mean watts over the frame, by part; zero for a frame of no length.
    pub fn mean_w(&self) -> [f64; PARTS] {
        let duration_s = self.duration_s();
        self.energy.by_part_j.map(|joules| if duration_s > 0.0 { joules / duration_s } else { 0.0 })
    }

    /// The highest watts of any bin, all parts together; zero for a frame of no length.
    pub fn peak_w(&self) -> f64 {
        self.watts.iter().map(|watts| watts.iter().sum()).fold(0.0, f64::max)
    }
}

/// The true length of each bin that begins before the frame ends, in picoseconds.
pub(crate) fn bin_lengths_ps(bin_ps: u64, duration_ps: u64) -> impl Iterator<Item = u64> {
    let mut left_ps = duration_ps;
    std::iter::from_fn(move || {
        let length_ps = left_ps.min(bin_ps);
        left_ps -= length_ps;
        (length_ps > 0).then_some(length_ps)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_last_bin_is_partial() {
        let lengths = |bin_ps, duration_ps| bin_lengths_ps(bin_ps, duration_ps).collect::<Vec<_>>();
        assert_eq!(lengths(10, 25), [10, 10, 5]);
        assert_eq!(lengths(10, 20), [10, 10]);
        assert_eq!(lengths(10, 3), [3]);
        assert!(lengths(10, 0).is_empty());
    }
}
