//! Detection of potentially colliding pairs: the broad phase, and the search of each pair.

use rayon::prelude::*;

use super::object::Object;
use super::pair::{CollisionMethod, Pair, PairSearch, PairVerdict};
use super::pass::{FragmentBudget, Part, PassBackend, Resources, Scratch};
use super::{Bounds, contact_probe};

/// Verdict on objects `a` and `b`, `a < b`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PairAnswer {
    /// Index of one object.
    pub a: usize,
    /// Index of the other object, which is greater.
    pub b: usize,
    /// Whether the objects may collide.
    pub verdict: PairVerdict,
}

/// Verdicts on all pairs whose swept boxes touch, in order; all other pairs are apart. Runs on the current
/// thread pool; the results do not depend on the number of threads.
pub fn detect(objects: &[Object], search: &PairSearch) -> Vec<PairAnswer> {
    detect_each(&[objects], search, || ()).pop().unwrap_or_default()
}

/// The same for the objects of several cases, whose pairs share the threads. `done` is called by any thread
/// after each pair.
pub fn detect_each(cases: &[&[Object]], search: &PairSearch, done: impl Fn() + Sync) -> Vec<Vec<PairAnswer>> {
    let of_case =
        |(case, objects): (usize, &&[Object])| candidates(objects).into_iter().map(move |pair| (case, pair));
    let pairs: Vec<_> = cases.iter().enumerate().flat_map(of_case).collect();
    let search_pair = |scratch: &mut Scratch, &(case, (a, b)): &(usize, (usize, usize))| {
        let verdict = search.pair(&cases[case][a], &cases[case][b], scratch);
        done();
        PairAnswer { a, b, verdict }
    };
    let found: Vec<PairAnswer> =
        pairs.par_iter().with_max_len(1).map_init(Scratch::default, search_pair).collect();
    let mut answers = vec![Vec::new(); cases.len()];
    for ((case, _), answer) in pairs.into_iter().zip(found) {
        answers[case].push(answer);
    }
    answers
}

/// Largest coordinate of a pair that is scaled up, so that products of three coordinates do not underflow.
pub(super) const MAX_SCALED_COORDINATE: f64 = 1e-60;

/// Power of two that scales a small number to about one, at most 2^1000. The product is exact.
pub(super) fn upscale_factor(small: f64) -> f64 {
    const BIAS: u64 = 1023;
    let exponent = BIAS.saturating_sub(small.to_bits() >> 52).min(1000);
    f64::from_bits((BIAS + exponent) << 52)
}

/// Most triangles in the window of a pair that is drawn unrefined after refinement.
const MAX_TRIANGLES_UNREFINED: usize = 64;
/// Most fragments of such a pair: along three axes, two triangles of each object that fill an image of 128 pixels and
/// 16 time bins.
pub(super) const UNREFINED_FRAGMENTS: u64 = 3 * 2 * 2 * 128 * 128 * 16;

impl PairSearch {
    /// Whether `a` and `b` may collide.
    pub(super) fn pair(&self, a: &Object, b: &Object, scratch: &mut Scratch) -> PairVerdict {
        self.pair_observed(a, b, scratch, &mut ())
    }

    /// The same, with a `backend` of the passes.
    pub(super) fn pair_observed(
        &self,
        a: &Object,
        b: &Object,
        scratch: &mut Scratch,
        backend: &mut impl PassBackend,
    ) -> PairVerdict {
        let largest = a.largest().max(b.largest());
        if largest > 0.0 && largest < MAX_SCALED_COORDINATE {
            let factor = upscale_factor(largest);
            let [one, other] = [a, b].map(|object| object.scaled(factor));
            return self.searched([&one, &other], scratch, backend).scaled(1.0 / factor);
        }
        self.searched([a, b], scratch, backend)
    }

    fn searched(
        &self,
        objects: [&Object; 2],
        scratch: &mut Scratch,
        backend: &mut impl PassBackend,
    ) -> PairVerdict {
        if self.zoom {
            return self.refined(objects, scratch, backend);
        }
        self.unrefined(objects, &mut Resources { scratch, budget: FragmentBudget::unlimited(), backend })
    }

    /// Draws a pair once, at the requested resolution. A pair that exceeds the budget stays.
    fn unrefined(
        &self,
        objects: [&Object; 2],
        resources: &mut Resources<'_, impl PassBackend>,
    ) -> PairVerdict {
        let Some(mut pair) = Pair::new(objects, [0.0, 1.0], self) else { return PairVerdict::Apart };
        if self.method == CollisionMethod::DepthOnly {
            return pair.by_depth(resources);
        }
        if pair.tighten() { pair.once(resources) } else { PairVerdict::Apart }
    }

    /// Refines a pair. One of few triangles that stays is drawn unrefined, too, as refinement may end with tiles that
    /// are larger than those of the requested resolution.
    fn refined(
        &self,
        objects: [&Object; 2],
        scratch: &mut Scratch,
        backend: &mut impl PassBackend,
    ) -> PairVerdict {
        let Some(mut pair) = Pair::new(objects, [0.0, 1.0], self) else { return PairVerdict::Apart };
        if !pair.tighten() {
            return PairVerdict::Apart;
        }
        if contact_probe::finds_contact(pair.parts(), &pair.window) {
            return pair.maybe(0, true);
        }
        let few = pair.triangles() <= MAX_TRIANGLES_UNREFINED;
        let verdict = self.closer(&mut pair, scratch, backend);
        if !few || !verdict.may_collide() || verdict.is_contact() {
            return verdict;
        }
        let budget = FragmentBudget::of(UNREFINED_FRAGMENTS);
        let unrefined = Self { zoom: false, ..*self };
        match unrefined.unrefined(objects, &mut Resources { scratch, budget, backend }) {
            PairVerdict::Apart => PairVerdict::Apart,
            PairVerdict::Maybe { .. } => verdict,
        }
    }

    /// Refines what remains of a pair, in the frame of the larger object if that moves.
    fn closer(
        &self,
        pair: &mut Pair<'_>,
        scratch: &mut Scratch,
        backend: &mut impl PassBackend,
    ) -> PairVerdict {
        if self.method == CollisionMethod::DepthOnly {
            return pair.refine_by_depth(scratch, backend);
        }
        let Some(seen) = InFrame::new(pair.parts(), &pair.window) else {
            return pair.refine(scratch, backend);
        };
        let in_frame = Pair::new(seen.objects.each_ref(), pair.window.time, self);
        in_frame.map_or(PairVerdict::Apart, |mut in_frame| seen.to_world(in_frame.refine(scratch, backend)))
    }
}

/// Pairs `(a, b)`, `a < b`, of objects whose swept boxes touch, in order. The method is sort and sweep along
/// x (Cohen et al. 1995, "I-COLLIDE", section 3.2.1, on one axis).
pub fn candidates(objects: &[Object]) -> Vec<(usize, usize)> {
    let mut order: Vec<usize> = (0..objects.len()).filter(|&object| !objects[object].is_empty()).collect();
    let from = |object: usize| objects[object].bounds.space[0][0];
    order.sort_by(|&a, &b| from(a).total_cmp(&from(b)).then(a.cmp(&b)));
    let mut pairs = Vec::new();
    for (place, &a) in order.iter().enumerate() {
        let last = objects[a].bounds.space[0][1];
        for &b in order[place + 1..].iter().take_while(|&&b| from(b) <= last) {
            if objects[a].bounds.meet(&objects[b].bounds).is_some() {
                pairs.push((a.min(b), a.max(b)));
            }
        }
    }
    pairs.sort_unstable();
    pairs
}

/// Least motion of the frame, as a share of the window's extent, that is worth a copy of the triangles.
const MIN_MOTION: f64 = 1.0 / 64.0;
/// The same for [`MANY_TRIANGLES`] or more, which cost more to copy.
const MIN_MOTION_OF_MANY: f64 = 0.25;
/// Triangles of both parts from which [`MIN_MOTION_OF_MANY`] holds.
const MANY_TRIANGLES: usize = 4096;

/// Parts of two objects, in the frame of reference of the larger one. Contacts do not depend on the frame.
/// In this frame the larger object hardly moves, so a tile contains few triangles at all times instead of
/// everything that sweeps through it.
struct InFrame {
    pub objects: [Object; 2],
    /// Translation of the frame from time 0 to time 1.
    translation: [f64; 3],
}

/// Largest coordinate that is transformed. Differences then stay within the range of the rasterizer.
const MAX_COORDINATE: f64 = 1e59;

impl InFrame {
    /// Copies both parts into the frame of the larger object; `None` if its motion is small compared with the
    /// window.
    pub fn new(parts: [Part<'_>; 2], window: &Bounds) -> Option<Self> {
        let [a, b] = parts.map(|part| part.object);
        let translations = [a, b].map(Object::translation);
        let translation = if size(a, &translations[0]) >= size(b, &translations[1]) {
            translations[0]
        } else {
            translations[1]
        };
        let triangles: usize = parts.iter().map(|part| part.list.len()).sum();
        let least = if triangles < MANY_TRIANGLES { MIN_MOTION } else { MIN_MOTION_OF_MANY };
        let extent = |axis: usize| window.space[axis][1] - window.space[axis][0];
        let worth = a.largest().max(b.largest()) <= MAX_COORDINATE
            && (0..3).any(|axis| translation[axis].abs() > least * extent(axis));
        worth.then(|| Self {
            objects: parts.map(|part| part.object.in_frame(part.list, translation)),
            translation,
        })
    }

    /// Transforms the bounds of a verdict back to world space.
    pub fn to_world(&self, verdict: PairVerdict) -> PairVerdict {
        let PairVerdict::Maybe { mut bounds, tiles, seen } = verdict else { return verdict };
        for (range, translation) in bounds.space.iter_mut().zip(self.translation) {
            let [from, to] = bounds.time.map(|t| t * translation);
            let size = range[0].abs().max(range[1].abs()) + translation.abs();
            let margin = if translation == 0.0 { 0.0 } else { 4.0 * f64::EPSILON * size };
            *range = [range[0] + from.min(to) - margin, range[1] + from.max(to) + margin];
        }
        PairVerdict::Maybe { bounds, tiles, seen }
    }
}

/// Longest side of an object's swept box, less its translation.
fn size(object: &Object, translation: &[f64; 3]) -> f64 {
    let sides = object
        .bounds
        .space
        .iter()
        .zip(translation)
        .map(|([low, high], translation)| high - low - translation.abs());
    sides.fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use pipeline::random::mix;

    #[test]
    fn the_sweep_finds_the_same_pairs_as_brute_force() {
        let at = |n: u64| (mix(n) % 1000) as f64;
        let object = |n: u64| {
            let [x, y, z] = [at(3 * n), at(3 * n + 1), at(3 * n + 2)];
            let near = [[x, y, z], [x + 220.0, y, z], [x, y + 190.0, z + 250.0]];
            Object::from_ends(vec![[near, near]], 0.0).unwrap()
        };
        let objects: Vec<_> = (0..60).map(object).chain(Object::from_ends(vec![], 0.0)).collect();
        let touch = |a: usize, b: usize| objects[a].bounds.meet(&objects[b].bounds).is_some();
        let all = (0..60).flat_map(|a| (a + 1..60).map(move |b| (a, b))).filter(|&(a, b)| touch(a, b));
        let all: Vec<_> = all.collect();
        assert!(all.len() > 20, "{}", all.len());
        assert_eq!(candidates(&objects), all);
    }

    fn framed(objects: [&Object; 2]) -> Option<InFrame> {
        let window = objects[0].bounds.meet(&objects[1].bounds)?;
        InFrame::new(objects.map(|object| Part { object, list: &[0] }), &window)
    }

    #[test]
    fn the_larger_object_stands_still_and_bounds_are_in_world_space() {
        let square = |x: f64, size: f64| [[x, 0.0, 0.0], [x + size, 0.0, 0.0], [x, size, 0.0]];
        let large = Object::from_ends(vec![[square(0.0, 4.0), square(8.0, 4.0)]], 0.0).unwrap();
        let small = Object::from_ends(vec![[square(1.0, 1.0), square(1.5, 1.0)]], 0.0).unwrap();
        let seen = framed([&small, &large]).unwrap();
        assert_eq!(seen.objects[1].triangles[0][0], seen.objects[1].triangles[0][1]);
        assert_eq!(seen.objects[0].triangles[0][1], square(-6.5, 1.0));
        let bounds = Bounds { space: [[1.0, 2.0], [0.0, 1.0], [0.0, 0.0]], time: [0.25, 0.5] };
        let PairVerdict::Maybe { bounds: to_world, .. } =
            seen.to_world(PairVerdict::Maybe { bounds, tiles: 1, seen: false })
        else {
            panic!("a pair that may collide")
        };
        assert!((to_world.space[0][0] - 3.0).abs() < 1e-12 && (to_world.space[0][1] - 6.0).abs() < 1e-12);
        assert_eq!(to_world.space[1..], bounds.space[1..]);
        let still = Object::from_ends(vec![[square(0.0, 4.0); 2]], 0.0).unwrap();
        assert!(framed([&small, &still]).is_none());
    }
}
