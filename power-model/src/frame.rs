//! Power of one frame over time.

use crate::parts::{Energy, PARTS};

/// Power of one frame over time, by part, and its energy.
#[derive(Clone, Debug, PartialEq)]
pub struct FramePower {
    /// Length of a bin in picoseconds.
    pub(crate) bin_ps: u64,
    /// Length of the frame in picoseconds.
    pub(crate) duration_ps: u64,
    /// Power by part and bin in watts; the last bin ends with the frame.
    pub(crate) watts: Vec<[f64; PARTS]>,
    /// Energy of the frame by part, in joules.
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

    /// Mean power of each bin in watts, by part in the order of [`crate::Part::ALL`].
    pub fn watts(&self) -> &[[f64; PARTS]] {
        &self.watts
    }

    /// Energy of the frame by part, in joules. Its total is the frame's energy, without idle time after the
    /// frame.
    pub const fn energy(&self) -> &Energy {
        &self.energy
    }

    /// True length in seconds and power by part of each bin; the last bin ends with the frame.
    pub fn bins(&self) -> impl Iterator<Item = (f64, &[f64; PARTS])> {
        self.bins_ps().map(|(length_ps, watts)| (length_ps as f64 * S_PER_PS, watts))
    }

    /// The bins as [`Self::bins`], with lengths in picoseconds.
    pub(crate) fn bins_ps(&self) -> impl Iterator<Item = (u64, &[f64; PARTS])> {
        bin_lengths_ps(self.bin_ps, self.duration_ps).zip(&self.watts)
    }

    /// Mean power over the frame by part, in watts; zero for a frame of length 0.
    pub fn mean_w(&self) -> [f64; PARTS] {
        let duration_s = self.duration_s();
        self.energy.by_part_j.map(|joules| if duration_s > 0.0 { joules / duration_s } else { 0.0 })
    }

    /// The frame with another length and energy but the same shape: each part keeps its share of every bin.
    /// The number of bins is the same. The last bin may gain or lose a little by rounding to whole
    /// picoseconds.
    #[must_use]
    pub fn reshaped(&self, duration_ps: u64, energy_j: f64) -> Self {
        let length_ratio = duration_ps as f64 / self.duration_ps.max(1) as f64;
        let bin_ps = ((self.bin_ps as f64 * length_ratio).ceil() as u64).max(1);
        let lengths: Vec<f64> =
            bin_lengths_ps(bin_ps, duration_ps).map(|length_ps| length_ps as f64 * S_PER_PS).collect();
        let joules = |watts: &[f64; PARTS], length_s: f64| watts.iter().sum::<f64>() * length_s;
        let before_j: f64 =
            self.watts.iter().zip(&lengths).map(|(watts, &length_s)| joules(watts, length_s)).sum();
        let scale = if before_j > 0.0 { energy_j / before_j } else { 0.0 };
        let watts: Vec<[f64; PARTS]> = self.watts.iter().map(|bin| bin.map(|watts| watts * scale)).collect();
        let mut energy = Energy::ZERO;
        for (watts, length_s) in watts.iter().zip(lengths) {
            energy += &Energy { by_part_j: watts.map(|watts| watts * length_s) };
        }
        Self { bin_ps, duration_ps, watts, energy }
    }

    /// Highest power of any bin, all parts together, in watts; zero for a frame of length 0.
    pub fn peak_w(&self) -> f64 {
        self.watts.iter().map(|watts| watts.iter().sum()).fold(0.0, f64::max)
    }
}

/// True lengths in picoseconds of the bins that begin before the end of the frame.
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
    fn another_length_and_energy_are_met_and_shares_kept() {
        let mut watts = vec![[0.0; PARTS]; 3];
        for (bin, level) in watts.iter_mut().zip([1.0, 3.0, 2.0]) {
            bin[0] = level;
            bin[1] = 2.0 * level;
        }
        let energy = Energy {
            by_part_j: std::array::from_fn(|part| [55e-12, 110e-12].get(part).copied().unwrap_or(0.0)),
        };
        let frame = FramePower { bin_ps: 10, duration_ps: 25, watts, energy };
        for (duration_ps, energy_j) in [(25, 165e-12), (50, 1e-9), (7, 2e-12), (1_000_001, 3e-6)] {
            let other = frame.reshaped(duration_ps, energy_j);
            assert_eq!((other.duration_ps, other.watts.len()), (duration_ps, 3));
            assert!((other.energy.total_j() / energy_j - 1.0).abs() < 1e-12);
            let spent: f64 = other.bins().map(|(length_s, watts)| length_s * watts.iter().sum::<f64>()).sum();
            assert!((spent / energy_j - 1.0).abs() < 1e-12);
            let parts = other.energy.by_part_j;
            assert!((parts[1] / parts[0] - 2.0).abs() < 1e-12 && parts[2] == 0.0);
        }
        assert_eq!(frame.reshaped(0, 1.0).energy.total_j(), 0.0);
    }

    #[test]
    fn only_the_last_bin_is_partial() {
        let lengths = |bin_ps, duration_ps| bin_lengths_ps(bin_ps, duration_ps).collect::<Vec<_>>();
        assert_eq!(lengths(10, 25), [10, 10, 5]);
        assert_eq!(lengths(10, 20), [10, 10]);
        assert_eq!(lengths(10, 3), [3]);
        assert!(lengths(10, 0).is_empty());
    }
}
