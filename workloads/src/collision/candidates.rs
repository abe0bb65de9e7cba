//! The broad phase: pairs whose swept boxes touch.

use super::Object;

/// Pairs `(a, b)`, `a < b`, of objects whose swept boxes touch, in order. Sorts along x and sweeps (Cohen et al. 1995, "I-COLLIDE",
/// section 3.2.1, on one axis).
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

#[cfg(test)]
mod tests {
    use super::*;
    use pipeline::random::mix;

    #[test]
    fn the_sweep_finds_what_all_against_all_does() {
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
}
