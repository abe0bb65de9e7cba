//! Clip planes across lens and shutter.

use serde::Serialize;

/// The part of lens and shutter in which something is drawn: from the first value up to the second on each axis. Samples on the
/// first are in, samples on the second are not, so that parts side by side share no sample. (In conservative mode both count.)
/// An infinite value is no bound: it takes that, not 1, to keep samples on the very rim of the lens.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Clip {
    u: [f32; 2],
    v: [f32; 2],
    t: [f32; 2],
}

impl Default for Clip {
    fn default() -> Self {
        Self::NONE
    }
}

impl Clip {
    /// No clip planes.
    pub const NONE: Self = {
        let all = [f32::NEG_INFINITY, f32::INFINITY];
        Self { u: all, v: all, t: all }
    };

    /// Clip planes across `u`, `v` (lens, -1 to 1) and `t` (shutter, 0 to 1), or `None` where a bound is not a number.
    pub fn new(u: [f32; 2], v: [f32; 2], t: [f32; 2]) -> Option<Self> {
        let numbers = [u, v, t].iter().flatten().all(|bound| !bound.is_nan());
        numbers.then_some(Self { u, v, t })
    }

    /// The first and the last value that is in, on each axis: standard mode.
    pub fn half_open(&self) -> [[f32; 2]; 3] {
        [self.u, self.v, self.t]
            .map(|[lo, hi]| if hi == f32::INFINITY { [lo, hi] } else { [lo, hi.next_down()] })
    }

    /// Both bounds: conservative mode.
    pub fn closed(&self) -> [[f32; 2]; 3] {
        [self.u, self.v, self.t]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_side_by_side_share_nothing_and_miss_nothing() {
        let parts = [[f32::NEG_INFINITY, 0.0], [0.0, 0.5], [0.5, f32::INFINITY]];
        let all = [-1.0, 1.0];
        for value in [-1.0, -0.0, 0.0, -f32::MIN_POSITIVE / 4.0, f32::EPSILON, 0.5, 0.5_f32.next_down(), 1.0]
        {
            let owners = parts.iter().filter(|part| {
                let [[lo, hi], ..] = Clip::new(**part, all, all).unwrap().half_open();
                (lo..=hi).contains(&value)
            });
            assert_eq!(owners.count(), 1, "{value}");
        }
        assert_eq!(Clip::new([0.0, f32::NAN], all, all), None);
        assert_eq!(Clip::new(all, all, [0.25, 0.5]).unwrap().closed()[2], [0.25, 0.5]);
    }
}
