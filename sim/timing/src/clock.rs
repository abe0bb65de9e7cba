//! Time in grains. A grain divides the period of every clock, so all times are integers.

use crate::spec::Clock;

/// A time or a duration, in grains.
pub type Time = u64;

/// First edge of a clock at or after `at`. Most times are edges already.
pub(crate) fn aligned(at: Time, period: Time) -> Time {
    if period == 1 { at } else { at.next_multiple_of(period) }
}

const PS_PER_MS: u64 = 1_000_000_000;
/// Largest number of grains in a millisecond. A frame of some seconds then fits into 64 bits.
const MAX_GRAINS_PER_MS: u64 = 1_000_000_000_000_000;

/// Two clocks and their common grain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Clocks {
    grains_per_ms: u64,
    periods: [Time; 2],
}

impl Clocks {
    /// Clocks of the given frequencies, each rounded to 1 kHz. `None` if a frequency is below 1 kHz, or if
    /// the common grain is too fine.
    pub fn new(core_hz: f64, memory_hz: f64) -> Option<Self> {
        let khz = [core_hz, memory_hz].map(|hz| (hz / 1e3).round() as u64);
        let [core, memory] = khz;
        if core == 0 || memory == 0 {
            return None;
        }
        let grains_per_ms =
            (core / gcd(core, memory)).checked_mul(memory).filter(|&g| g <= MAX_GRAINS_PER_MS)?;
        Some(Self { grains_per_ms, periods: khz.map(|khz| grains_per_ms / khz) })
    }

    /// Grains in a cycle of `clock`.
    pub fn period(&self, clock: Clock) -> Time {
        self.periods[clock as usize]
    }

    /// First edge of either clock after `now`.
    pub fn next_edge(&self, now: Time) -> Time {
        let [core, memory] = self.periods.map(|period| now - now % period + period);
        core.min(memory)
    }

    /// First edge of either clock at or after `at`.
    pub fn edge_from(&self, at: Time) -> Time {
        let [core, memory] = self.periods.map(|period| at.next_multiple_of(period));
        core.min(memory)
    }

    /// Picoseconds from 0 to `at`, rounded up.
    pub fn ps(&self, at: Time) -> u64 {
        if PS_PER_MS.is_multiple_of(self.grains_per_ms) {
            return at * (PS_PER_MS / self.grains_per_ms);
        }
        match at.checked_mul(PS_PER_MS) {
            Some(product) => product.div_ceil(self.grains_per_ms),
            None => (u128::from(at) * u128::from(PS_PER_MS)).div_ceil(u128::from(self.grains_per_ms)) as u64,
        }
    }

    /// Picoseconds from 0 to `at` and `part` / `of` of a grain after it, rounded up.
    pub(crate) fn ps_after(&self, at: Time, part: u64, of: u64) -> u64 {
        let parts = u128::from(at) * u128::from(of) + u128::from(part);
        (parts * u128::from(PS_PER_MS)).div_ceil(u128::from(self.grains_per_ms) * u128::from(of)) as u64
    }

    /// Picoseconds in `length`, rounded down.
    pub(crate) fn ps_below(&self, length: Time) -> u64 {
        match length.checked_mul(PS_PER_MS) {
            Some(product) => product / self.grains_per_ms,
            None => (u128::from(length) * u128::from(PS_PER_MS) / u128::from(self.grains_per_ms)) as u64,
        }
    }

    /// First time at or after `ps` picoseconds.
    pub(crate) fn grain_from(&self, ps: u64) -> Time {
        ps.checked_sub(1).map_or(0, |before| self.grain_up_to(before) + 1)
    }

    /// Last time at or before `ps` picoseconds.
    pub(crate) fn grain_up_to(&self, ps: u64) -> Time {
        match ps.checked_mul(self.grains_per_ms) {
            Some(product) => product / PS_PER_MS,
            None => (u128::from(ps) * u128::from(self.grains_per_ms) / u128::from(PS_PER_MS)) as Time,
        }
    }

    /// Cycles of `clock` that begin before `at`.
    pub fn cycles(&self, clock: Clock, at: Time) -> u64 {
        at.div_ceil(self.period(clock))
    }
}

pub(crate) fn gcd(a: u64, b: u64) -> u64 {
    if b == 0 { a } else { gcd(b, a % b) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_periods_are_whole() {
        let clocks = Clocks::new(925e6, 1375e6).unwrap();
        assert_eq!([Clock::Core, Clock::Memory].map(|c| clocks.period(c)), [55, 37]);
        assert_eq!(clocks.next_edge(0), 37);
        assert_eq!(clocks.next_edge(37), 55);
        // 925 cycles of the core clock are 1 us.
        assert_eq!(clocks.ps(925 * 55), 1_000_000);
        assert_eq!(clocks.cycles(Clock::Core, 56), 2);
    }

    #[test]
    fn grains_and_picoseconds_convert_both_ways() {
        let clocks = Clocks::new(925e6, 1375e6).unwrap();
        for ps in [0, 1, 19, 20, 1_000_000, 1_000_001] {
            let (first, last) = (clocks.grain_from(ps), clocks.grain_up_to(ps));
            assert!(clocks.ps(first) >= ps && clocks.ps(last) <= ps && clocks.ps(last + 1) > ps, "{ps}");
            assert!(first == 0 || clocks.ps(first - 1) < ps, "{ps}");
        }
        assert_eq!([55, 37].map(|grains| clocks.ps_below(grains)), [1081, 727]);
    }

    #[test]
    fn clocks_without_a_coarse_grain_are_refused() {
        assert!(Clocks::new(1e12, 999_999_999e3).is_none());
        assert!(Clocks::new(400e6, 10.0).is_none());
    }
}
