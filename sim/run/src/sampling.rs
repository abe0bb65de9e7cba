//! What `--timing` takes: a level for every frame, or for some of them.

use serde::{Deserialize, Serialize};

use timing::Level;

/// How the times of a run are found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Method {
    /// Every unit from cycle to cycle: the reference, slow
    Stepped,
    /// A recurrence over packets
    #[default]
    Packet,
    /// The busiest unit of each batch, fill and drain
    Bound,
    /// One frame in fifty at `packet`, the others predicted from a preview, with intervals
    Sampled,
}

impl Method {
    /// The level of the frames that are simulated.
    pub const fn level(self) -> Level {
        match self {
            Self::Stepped => Level::Stepped,
            Self::Packet | Self::Sampled => Level::Packet,
            Self::Bound => Level::Bound,
        }
    }

    /// How many frames are simulated.
    pub const fn sampling(self) -> Sampling {
        match self {
            Self::Sampled => Sampling::Some,
            _ => Sampling::Every,
        }
    }
}

/// How many frames of a run are simulated whole.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Sampling {
    /// All that differ.
    #[default]
    Every,
    /// One in fifty, at least six.
    Some,
    /// So many.
    Count(usize),
    /// As many as it takes for the relative half-widths of all 95 % intervals to be at most `target`, but no more than `most`.
    Until {
        /// Relative half-width.
        target: f64,
        /// Frames.
        most: usize,
    },
}

impl Sampling {
    /// Frames for one that is simulated.
    const ONE_IN: usize = 50;
    /// Fewest: one to scale the previews by, and two strata of two or three.
    pub const LEAST: usize = 6;
    /// To begin with where it goes on until it is sure: one, and three strata of two.
    pub const BEGIN: usize = 7;

    /// How many of `frames` to begin with.
    pub fn first(self, frames: usize) -> usize {
        match self {
            Self::Every => frames,
            Self::Some => frames.div_ceil(Self::ONE_IN).max(Self::LEAST),
            Self::Count(count) => count,
            Self::Until { most, .. } => Self::BEGIN.min(most),
        }
    }

    /// How many next, where `done` of `frames` gave intervals of `relative` half-width; `None` where that is enough.
    pub fn next(self, done: usize, frames: usize, relative: f64) -> Option<usize> {
        let Self::Until { target, most } = self else { return None };
        // A NaN is not enough.
        let enough = relative <= target || done >= frames.min(most);
        let next = if 4 * done > frames { frames } else { 2 * done - 1 };
        (!enough).then(|| next.min(most))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_in_fifty_and_six_at_least() {
        assert_eq!([36, 300, 301, 1000].map(|n| Sampling::Some.first(n)), [6, 6, 7, 20]);
    }

    #[test]
    fn it_doubles_until_it_is_sure() {
        let until = Sampling::Until { target: 0.01, most: 300 };
        assert_eq!(until.next(7, 300, 0.02), Some(13));
        assert_eq!(until.next(7, 300, f64::NAN), Some(13));
        assert_eq!(until.next(13, 300, 0.01), None);
        assert_eq!(until.next(96, 300, 0.02), Some(300));
        assert_eq!(until.next(300, 300, f64::NAN), None);
        let capped = Sampling::Until { target: 0.01, most: 20 };
        assert_eq!([7, 13, 20].map(|done| capped.next(done, 300, 0.5)), [Some(13), Some(20), None]);
        assert_eq!(Sampling::Some.next(6, 300, 1.0), None);
    }
}
