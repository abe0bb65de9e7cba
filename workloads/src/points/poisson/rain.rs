//! Darts that fall like rain: on every cell independently of all others, at times of their own.
//!
//! A Poisson number of darts at uniform times in each of many cells of one size is, put in the order of time, the same as a Poisson
//! number of darts thrown one by one at cells chosen at random (the superposition of Poisson processes). So cells may be gone through in
//! any order and by any number of workers; only what is left is put in order.

use super::grid::Dart;
use crate::points::random::Stream;

/// A dart and when it falls.
#[derive(Clone, Copy, Debug)]
pub(super) struct Drop<const D: usize> {
    pub time: u64,
    pub dart: Dart<D>,
}

/// What has fallen on many cells.
#[derive(Debug)]
pub(super) struct Fallen<const D: usize> {
    /// The darts that are free of what was there before, in no order.
    pub drops: Vec<Drop<D>>,
    /// All of them.
    pub darts: u64,
}

impl<const D: usize> Default for Fallen<D> {
    fn default() -> Self {
        Self { drops: Vec::new(), darts: 0 }
    }
}

/// So many darts fall on a cell at most; that more would is less likely than 2^-64.
const MOST: usize = 24;

/// The rain on the cells of a level.
pub(super) struct Rain {
    stream: Stream,
    /// Words up to which at most 0, 1, ... darts fall.
    up_to: [u64; MOST],
}

impl Rain {
    /// `mean` darts on each cell, at most 1.
    pub fn new(stream: Stream, mean: f64) -> Self {
        let (mut one, mut sum, mut up_to) = ((-mean).exp(), 0.0, [0; MOST]);
        for (count, word) in up_to.iter_mut().enumerate() {
            sum += one;
            one *= mean / (count + 1) as f64;
            // The cast saturates.
            *word = (sum * 2.0_f64.powi(64)) as u64;
        }
        Self { stream, up_to }
    }

    /// Hands `each` dart on a cell: its time, and where it falls along each axis, up to `side`.
    #[inline]
    pub fn on<const D: usize>(&self, cell: [u64; D], side: f64, mut each: impl FnMut(u64, [f64; D])) {
        let own = cell.iter().fold(self.stream, |stream, &at| stream.of(at));
        let word = own.word(0);
        let mut count = 0;
        while count + 1 < MOST && word >= self.up_to[count] {
            let at = 1 + count as u64 * (D as u64 + 1);
            each(own.word(at), std::array::from_fn(|k| own.unit(at + 1 + k as u64) * side));
            count += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_number_of_drops_is_that_of_a_poisson_process() {
        let rain = Rain::new(Stream::new(3, 0), 0.7);
        let mut counts = [0.0; 4];
        for cell in 0..100_000 {
            let mut count = 0;
            rain.on([cell, 5], 0.25, |_, within| {
                count += 1;
                assert!(within.iter().all(|at| (0.0..0.25).contains(at)));
            });
            counts[count.min(3)] += 1e-5;
        }
        let none = (-0.7_f64).exp();
        for (found, expected) in counts.into_iter().zip([none, 0.7 * none, 0.245 * none]) {
            assert!((found - expected).abs() < 0.006, "{counts:?}");
        }
    }
}
