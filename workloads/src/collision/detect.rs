//! All pairs of a case.

use rayon::prelude::*;

use super::compare::Scratch;
use super::{Object, Search, Verdict, candidates};

/// What is known of objects `a` and `b`, `a < b`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Answer {
    /// The number of one object.
    pub a: usize,
    /// That of the other, which is greater.
    pub b: usize,
    /// Whether they may collide.
    pub verdict: Verdict,
}

/// The verdict on every pair whose swept boxes touch, in order; all other pairs are apart. Uses the threads of the pool it is
/// called in; the answers do not depend on them.
pub fn detect(objects: &[Object], search: &Search) -> Vec<Answer> {
    detect_each(objects, search, || ())
}

/// The same; `done` is called, by any thread, for every pair that is known.
pub fn detect_each(objects: &[Object], search: &Search, done: impl Fn() + Sync) -> Vec<Answer> {
    candidates(objects)
        .into_par_iter()
        .map_init(Scratch::default, |scratch, (a, b)| {
            let verdict = search.pair(&objects[a], &objects[b], scratch);
            done();
            Answer { a, b, verdict }
        })
        .collect()
}
