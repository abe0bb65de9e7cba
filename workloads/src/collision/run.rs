//! One pair of objects, searched closer and closer.

use super::compare::{Scratch, Watch};
use super::frame::Seen;
use super::glance;
use super::object::Object;
use super::pair::Pair;
use super::search::{Method, Search, Verdict};

/// Below this, products of three coordinates would vanish: a pair is then looked at as much larger as brings it near one.
pub(super) const TINY: f64 = 1e-60;

/// The power of two that brings a small number near one, at most 2^1000: times it, all numbers are exact.
pub(super) fn enlarging(small: f64) -> f64 {
    const BIAS: u64 = 1023;
    let exponent = BIAS.saturating_sub(small.to_bits() >> 52).min(1000);
    f64::from_bits((BIAS + exponent) << 52)
}

impl Search {
    /// Whether `a` and `b` may collide.
    pub(super) fn pair(&self, a: &Object, b: &Object, scratch: &mut Scratch) -> Verdict {
        self.watched(a, b, scratch, &mut ())
    }

    /// The same, with `watch` told what is done.
    pub(super) fn watched(
        &self,
        a: &Object,
        b: &Object,
        scratch: &mut Scratch,
        watch: &mut impl Watch,
    ) -> Verdict {
        let largest = a.largest().max(b.largest());
        if largest > 0.0 && largest < TINY {
            let factor = enlarging(largest);
            let [one, other] = [a, b].map(|object| object.scaled(factor));
            return self.looked_at([&one, &other], scratch, watch).scaled(1.0 / factor);
        }
        self.looked_at([a, b], scratch, watch)
    }

    fn looked_at(&self, objects: [&Object; 2], scratch: &mut Scratch, watch: &mut impl Watch) -> Verdict {
        let Some(mut pair) = Pair::new(objects, [0.0, 1.0], self) else { return Verdict::Apart };
        let by_depth = self.method == Method::DepthOnly;
        if by_depth && !self.zoom {
            return pair.by_depth(scratch, watch);
        }
        if !pair.tighten() {
            return Verdict::Apart;
        }
        if !self.zoom {
            return pair.once(scratch, watch);
        }
        if glance::crosses(pair.parts(), &pair.window) {
            return pair.maybe(0, true);
        }
        if by_depth {
            return pair.closer_by_depth(scratch, watch);
        }
        let Some(seen) = Seen::new(pair.parts(), &pair.window) else { return pair.closer(scratch, watch) };
        let moved = Pair::new(seen.objects.each_ref(), pair.window.time, self);
        moved.map_or(Verdict::Apart, |mut moved| seen.told(moved.closer(scratch, watch)))
    }
}
