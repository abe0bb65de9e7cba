//! Shares of pairs kept in vain over cases like those that the yardsticks of the book were measured over.

use rayon::prelude::*;
use workloads::collision::families::{Case, like_yardsticks, triangles_boxes_touch};
use workloads::collision::{Method, Object, Search, candidates, detect};

/// Looking once at 128 pixels.
const ONCE: Search = Search { resolution: 128, bins: 1, method: Method::FragmentBox, zoom: false };

/// Cases of each kind of two objects and of each of many.
const CASES: [usize; 2] = [30, 3];

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

/// Prints the share kept in vain by each way; the bars are those of some numbers of bins. What `quintile ccd` does by default, looking
/// closer, has to be under that of as many bins.
fn beaten(many: bool, bars: [(u32, f64); 3]) {
    let cases = like_yardsticks(1, CASES);
    let (near, count) = apart(cases.iter().filter(|case| (case.objects.len() > 2) == many));
    let share = |left: usize| left as f64 / count as f64;
    let triangles = near.iter().filter(|[a, b]| triangles_boxes_touch(a, b)).count();
    println!("{count} do not collide");
    println!("boxes of objects {:.4}, of triangles {:.4}", share(near.len()), share(triangles));
    let depth_only = Search { method: Method::DepthOnly, ..ONCE };
    println!("depth only {:.4}", share(kept(&near, &depth_only)));
    let closer = share(kept(&near, &Search::default()));
    println!("looking closer {closer:.4}");
    for (bins, bar) in bars {
        let share = share(kept(&near, &Search { bins, ..ONCE }));
        println!("{bins} bins {share:.4}");
        // One bin has to be better than what the bar was measured with, more as good.
        assert!(share < bar || bins > 1 && share == bar, "{bins} bins");
        assert!(bins > Search::default().bins || closer <= bar, "looking closer");
    }
}

/// Both: `cargo test -p workloads --release --test collision yardsticks -- --ignored --nocapture --test-threads 1`.
#[test]
#[ignore = "minutes: images of 128 pixels, drawn by edges in up to 64 bins"]
fn yardsticks_of_two_are_beaten() {
    beaten(false, [(1, 0.435), (16, 0.429), (64, 0.424)]);
}

#[test]
#[ignore = "minutes, as above"]
fn yardsticks_of_many_are_beaten() {
    beaten(true, [(1, 0.032), (16, 0.016), (64, 0.012)]);
}
