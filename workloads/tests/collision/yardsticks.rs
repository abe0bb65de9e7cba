//! Shares of pairs kept in vain over cases like those that the yardsticks of the book were measured over.

use rayon::prelude::*;
use workloads::collision::families::{Case, like_yardsticks, triangles_boxes_touch};
use workloads::collision::{Method, Object, Search, candidates, detect};

/// Looking once at 128 pixels.
const ONCE: Search = Search { resolution: 128, bins: 1, method: Method::FragmentBox, zoom: false };

/// Cases of each kind of two objects and of many: 330 in all, as many as the yardsticks were measured over.
const CASES: [usize; 2] = [30, 30];

/// Bins of time with the bars of two objects and of many.
const BARS: [(u32, [f64; 2]); 3] = [(1, [0.435, 0.032]), (16, [0.429, 0.016]), (64, [0.424, 0.012])];

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

fn kept(pairs: &[Pair<'_>], search: &Search) -> usize {
    let may = |pair: &&Pair<'_>| {
        let found = detect(&pair.map(Clone::clone), search);
        found.iter().any(|answer| answer.verdict.may_collide())
    };
    pairs.par_iter().filter(may).count()
}

/// The bars: `cargo test -p workloads --release --test collision yardsticks -- --ignored --nocapture`. What `quintile ccd` does by
/// default, looking closer, has to be under those of 16 bins.
#[test]
#[ignore = "a quarter of an hour: images of 128 pixels, drawn by edges in up to 64 bins"]
fn yardsticks_are_beaten() {
    let cases = like_yardsticks(1, CASES);
    for (many, name) in ["two", "many"].into_iter().enumerate() {
        let (near, count) = apart(cases.iter().filter(|case| usize::from(case.objects.len() > 2) == many));
        let share = |left: usize| left as f64 / count as f64;
        let triangles = near.iter().filter(|[a, b]| triangles_boxes_touch(a, b)).count();
        println!("{name}: {count} do not collide");
        println!("boxes of objects {:.4}, of triangles {:.4}", share(near.len()), share(triangles));
        let depth_only = Search { method: Method::DepthOnly, ..ONCE };
        println!("depth only {:.4}", share(kept(&near, &depth_only)));
        let closer = share(kept(&near, &Search::default()));
        println!("looking closer {closer:.4}");
        for (bins, bars) in BARS {
            let share = share(kept(&near, &Search { bins, ..ONCE }));
            println!("{bins} bins {share:.4}");
            assert!(share < bars[many] || bins > 1 && share == bars[many], "{name}: {bins} bins");
            assert!(bins > 16 || closer <= bars[many], "{name}: looking closer");
        }
    }
}
