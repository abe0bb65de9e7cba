//! Collision detection: public queries, an oracle, and constructed cases. No collision may be missed.

mod contacts;
mod exact;
mod oracle;
mod public;
mod reference_rates;
mod refinement;

use pipeline::random::{mix, unit};
use workloads::collision::{CollisionMethod, Object, PairSearch, detect};

type Ends = [[[f64; 3]; 3]; 2];

/// Searches from the coarsest to the finest; none may miss a collision.
const SEARCHES: [PairSearch; 7] = [
    PairSearch { resolution: 1, bins: 1, method: CollisionMethod::FragmentBox, zoom: false },
    PairSearch { resolution: 8, bins: 1, method: CollisionMethod::BoxBox, zoom: false },
    PairSearch { resolution: 8, bins: 4, method: CollisionMethod::FragmentBox, zoom: false },
    PairSearch { resolution: 32, bins: 16, method: CollisionMethod::BoxBox, zoom: false },
    PairSearch { resolution: 16, bins: 1, method: CollisionMethod::DepthOnly, zoom: false },
    PairSearch { resolution: 32, bins: 8, method: CollisionMethod::BoxBox, zoom: true },
    PairSearch { resolution: 64, bins: 16, method: CollisionMethod::FragmentBox, zoom: true },
];

fn may_collide(a: Ends, b: Ends, search: &PairSearch) -> bool {
    objects_may_collide(&[a, b].map(|ends| Object::from_ends(vec![ends], 0.0).unwrap()), search)
}

fn objects_may_collide(objects: &[Object; 2], search: &PairSearch) -> bool {
    detect(objects, search).first().is_some_and(|answer| answer.verdict.may_collide())
}

/// A coordinate in the unit cube, from a hash.
fn random(seed: u64, n: u64) -> f64 {
    unit(mix(seed.wrapping_mul(1000) + n))
}
