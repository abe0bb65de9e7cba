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
    detect_each(&[objects], search, || ()).pop().unwrap_or_default()
}

/// The same for the objects of each of several cases, whose pairs share the threads; `done` is called, by any thread, for every
/// pair that is known.
pub fn detect_each(cases: &[&[Object]], search: &Search, done: impl Fn() + Sync) -> Vec<Vec<Answer>> {
    let of_case =
        |(case, objects): (usize, &&[Object])| candidates(objects).into_iter().map(move |pair| (case, pair));
    let pairs: Vec<_> = cases.iter().enumerate().flat_map(of_case).collect();
    let looked_at = |scratch: &mut Scratch, &(case, (a, b)): &(usize, (usize, usize))| {
        let verdict = search.pair(&cases[case][a], &cases[case][b], scratch);
        done();
        Answer { a, b, verdict }
    };
    let found: Vec<Answer> = pairs.par_iter().map_init(Scratch::default, looked_at).collect();
    let mut answers = vec![Vec::new(); cases.len()];
    for ((case, _), answer) in pairs.into_iter().zip(found) {
        answers[case].push(answer);
    }
    answers
}
