//! Boxes of space and time.

/// A triangle at time 0 and at time 1.
pub(super) type Ends = [[[f64; 3]; 3]; 2];

/// A closed box of space and a range of time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Least and greatest x, y, z.
    pub space: [[f64; 2]; 3],
    /// First and last time.
    pub time: [f64; 2],
}

/// What two ranges share; touching counts.
#[inline]
pub(super) fn meet(a: [f64; 2], b: [f64; 2]) -> Option<[f64; 2]> {
    let both = [a[0].max(b[0]), a[1].min(b[1])];
    (both[0] <= both[1]).then_some(both)
}

/// The range that holds both.
#[inline]
pub(super) fn hull(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0].min(b[0]), a[1].max(b[1])]
}

/// A range that holds nothing yet.
pub(super) const NOTHING: [f64; 2] = [f64::INFINITY, f64::NEG_INFINITY];

impl Bounds {
    /// Holds nothing yet.
    pub(super) const NOTHING: Self = Self { space: [NOTHING; 3], time: NOTHING };

    /// The box that holds both.
    #[must_use]
    pub(super) fn hull(&self, other: &Self) -> Self {
        let space = [0, 1, 2].map(|axis| hull(self.space[axis], other.space[axis]));
        Self { space, time: hull(self.time, other.time) }
    }

    /// The box of points at any time.
    pub fn of(points: impl IntoIterator<Item = [f64; 3]>) -> Self {
        let mut space = [NOTHING; 3];
        for point in points {
            for (range, at) in space.iter_mut().zip(point) {
                *range = [range[0].min(at), range[1].max(at)];
            }
        }
        Self { space, time: [0.0, 1.0] }
    }

    /// What both hold, if anything.
    #[inline]
    pub fn meet(&self, other: &Self) -> Option<Self> {
        let shared = |axis: usize| meet(self.space[axis], other.space[axis]);
        Some(Self { space: [shared(0)?, shared(1)?, shared(2)?], time: meet(self.time, other.time)? })
    }

    /// The same with every side `margin` farther out in space.
    #[must_use]
    pub fn inflated(&self, margin: f64) -> Self {
        Self { space: self.space.map(|[low, high]| [low - margin, high + margin]), ..*self }
    }

    /// What a few operations on coordinates in it are rounded by.
    pub(super) fn rounding(&self) -> f64 {
        8.0 * f64::EPSILON * self.space.as_flattened().iter().fold(0.0, |size: f64, at| size.max(at.abs()))
    }

    /// What is left of it, as the product of the shares of each extent; an extent of zero stays what it is.
    pub fn share_of(&self, whole: &Self) -> f64 {
        let ranges = self.space.iter().chain([&self.time]).zip(whole.space.iter().chain([&whole.time]));
        let share = |(part, all): (&[f64; 2], &[f64; 2])| {
            let length = all[1] - all[0];
            if length > 0.0 { ((part[1] - part[0]) / length).clamp(0.0, 1.0) } else { 1.0 }
        };
        ranges.map(share).product()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_that_touch_share_their_border() {
        let a = Bounds::of([[0.0; 3], [1.0; 3]]);
        let b = Bounds::of([[1.0, 0.5, -1.0], [2.0, 2.0, 0.0]]);
        let both = a.meet(&b).map(|both| both.space);
        assert_eq!(both, Some([[1.0, 1.0], [0.5, 1.0], [0.0, 0.0]]));
        assert_eq!(a.meet(&Bounds::of([[1.0 + 1e-15, 0.0, 0.0]])), None);
    }

    #[test]
    fn a_share_counts_every_extent_that_is_there() {
        let whole = Bounds { space: [[0.0, 4.0], [0.0, 2.0], [3.0, 3.0]], time: [0.0, 1.0] };
        let part = Bounds { space: [[1.0, 2.0], [0.0, 1.0], [3.0, 3.0]], time: [0.5, 1.0] };
        assert_eq!(part.share_of(&whole), 0.25 * 0.5 * 0.5);
    }
}
