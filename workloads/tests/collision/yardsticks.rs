//! Shares of pairs kept in vain over cases like those that the yardsticks of the book were measured over.

use rayon::prelude::*;
use workloads::collision::families::{Case, like_yardsticks, triangles_boxes_touch};
use workloads::collision::{Method, Object, Search, candidates, detect};

/// Looking once at 128 pixels.
const ONCE: Search = Search { resolution: 128, bins: 1, method: Method::FragmentBox, zoom: false };

/// Two objects of a case.
type Pair<'a> = [&'a Object; 2];

/// The pairs that do not collide but whose swept boxes touch, and how many there are that do not collide.
fn apart<'a>(cases: impl Iterator<Item = &'a Case>) -> (Vec<Pair<'a>>, usize) {
    let (mut near, mut count) = (Vec::new(), 0);
    for case in cases {
        let objects = &case.objects;
        count += objects.len() * (objects.len() - 1) / 2 - case.collide.len();
        let pairs = candidates(objects).into_iter().filter(|pair| !case.collide.contains(pair));
        near.extend(pairs.map(|(a, b)| [&objects[a], &objects[b]]));
    }
    (near, count)
}

fn kept<'a>(pairs: &[Pair<'a>], search: &Search) -> Vec<Pair<'a>> {
    let may = |pair: &&Pair<'a>| {
        let found = detect(&pair.map(Clone::clone), search);
        found.iter().any(|answer| answer.verdict.may_collide())
    };
    pairs.par_iter().filter(may).copied().collect()
}

/// The bars: `cargo test -p workloads --release --test collision yardsticks -- --ignored --nocapture`. More bins are asked only of
/// what fewer keep, which is all that they could keep.
#[test]
#[ignore = "minutes to an hour: images of 128 pixels, drawn by edges in up to 64 bins"]
fn yardsticks_are_beaten() {
    let cases = like_yardsticks(1, [12, 3]);
    for (name, many, bars) in [("two", false, [0.435, 0.429, 0.424]), ("many", true, [0.032, 0.016, 0.012])] {
        let (near, count) = apart(cases.iter().filter(|case| (case.objects.len() > 2) == many));
        let share = |left: usize| left as f64 / count as f64;
        let triangles = near.iter().filter(|[a, b]| triangles_boxes_touch(a, b)).count();
        println!("{name}: {count} do not collide");
        println!("boxes of objects {:.4}, of triangles {:.4}", share(near.len()), share(triangles));
        println!("looking closer {:.4}", share(kept(&near, &Search { zoom: true, bins: 16, ..ONCE }).len()));
        let mut left = near;
        for (bins, bar) in [1, 16, 64].into_iter().zip(bars) {
            left = kept(&left, &Search { bins, ..ONCE });
            println!("{bins} bins {:.4}", share(left.len()));
            assert!(share(left.len()) <= bar, "{name}: {bins} bins");
        }
    }
}
