//! Times of day in JLS files.

/// Ticks per second: JLS counts time in 2^-30 s.
const TICKS_PER_S: f64 = (1_u64 << 30) as f64;
/// Origin of JLS times, 2018-01-01, in seconds since 1970-01-01 UTC.
const EPOCH_S: i64 = 1_514_764_800;

/// A time of day, in units of 2^-30 s since 2018-01-01 UTC.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Timestamp(pub(crate) i64);

impl Timestamp {
    /// The time `after_s` seconds after `start_s`, the latter since 1970-01-01 UTC; `None` if it is farther
    /// than about 8.5e9 s from 2018. The start is exact to 2^-31 s.
    pub fn from_unix_s(start_s: f64, after_s: f64) -> Option<Self> {
        let ticks = |seconds: f64| libm::round(seconds * TICKS_PER_S) as i128;
        // A float-to-int cast saturates, far beyond i64.
        i64::try_from(ticks(start_s) + ticks(after_s) - (i128::from(EPOCH_S) << 30)).ok().map(Self)
    }

    /// Units of 2^-30 s since 2018-01-01 UTC.
    pub fn ticks(self) -> i64 {
        self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ticks(start_s: f64, after_s: f64) -> Option<i64> {
        Timestamp::from_unix_s(start_s, after_s).map(Timestamp::ticks)
    }

    #[test]
    fn times_count_from_2018_in_2_to_the_minus_30_seconds() {
        assert_eq!(ticks(1_514_764_800.0, 0.0), Some(0));
        assert_eq!(ticks(1_514_764_801.5, 0.25), Some(7 << 28));
        assert_eq!(ticks(0.0, 0.0), Some(-1_514_764_800 << 30));
        // The trace's own limit lies beyond on the side of the past.
        assert_eq!(ticks(-9e9, 0.0), None);
        assert!(ticks(9e9, 1.2e9).is_none() && ticks(9e9, 0.0).is_some());
    }
}
