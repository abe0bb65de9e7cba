//! Looking closer and closer at a pair.

use super::compare::{Scratch, Watch};
use super::pair::{Look, Outcome, Pair};
use super::pass::{Effort, Fit, Part};
use super::search::Verdict;

/// Looking closer ends when so much of space and time, and of the triangles, is left of a round.
const STUCK: f64 = 0.5;
/// Tiles across that looking closer begins with, at least; more where there are more than so many triangles for a tile.
const FIRST_TILES: u32 = 8;
const TRIANGLES_A_TILE: f64 = 16.0;
/// So many triangles are looked at by their boxes first.
const MANY: usize = 64;
/// Up to so many, edges are tried before closer tiles: they leave fewer fragments, and so enough for those. Of more, boxes find most
/// that is not needed for less.
const VERY_MANY: usize = 1024;
/// Fragments that may be drawn for a pair before it is let stand: many for few triangles, which are cheap all the same and often
/// nearly touch, and a few for each of many.
const MOST_FRAGMENTS: u64 = 1 << 18;
const LEAST_FRAGMENTS: u64 = 1 << 16;
const FRAGMENTS_LESS: u64 = 128;
const FRAGMENTS_EACH: u64 = 4;
/// Rounds that may be needed to halve space and time down to the spacing of numbers.
const MOST_ROUNDS: u32 = 64;

/// So many triangles of a part say how fast it is.
const SOME: usize = 64;

impl Pair<'_> {
    /// From few tiles to many and, wherever that leaves less of space and time, closer. Many triangles are looked at by their boxes
    /// until that no longer helps, those that are left by their edges.
    pub fn closer(&mut self, scratch: &mut Scratch, watch: &mut impl Watch) -> Verdict {
        if !self.tighten() {
            return Verdict::Apart;
        }
        let most = self.search.resolution;
        let mut effort = self.effort();
        let mut fit = if self.triangles() > MANY { Fit::Boxes } else { Fit::Edges };
        let first = (self.triangles() as f64 / TRIANGLES_A_TILE).sqrt() as u32;
        let (mut resolution, mut last) = (first.max(FIRST_TILES).min(most), self.maybe(0, false));
        for _ in 0..MOST_ROUNDS {
            let (before, triangles) = (self.window, self.triangles());
            let look = Look { resolution, bins: self.bins(resolution), fit };
            let round = match self.round(look, &mut effort, scratch, watch) {
                Outcome::Apart => return Verdict::Apart,
                Outcome::GaveUp => break,
                Outcome::Left(round) => round,
            };
            self.window = round.window;
            last = self.maybe(round.tiles, round.seen);
            if round.seen {
                break;
            }
            if !self.tighten() {
                return Verdict::Apart;
            }
            if self.triangles() <= MANY {
                fit = Fit::Edges;
            }
            let stuck = round.window.share_of(&before) > STUCK;
            let crowded = self.triangles() as f64 > STUCK * triangles as f64;
            let may_double = stuck && resolution < most;
            match fit {
                Fit::Boxes if crowded && (!may_double || self.triangles() <= VERY_MANY) => fit = Fit::Edges,
                _ if may_double => resolution = (2 * resolution).min(most),
                Fit::Edges if crowded && stuck => break,
                _ => {}
            }
        }
        last
    }

    /// By depths alone, from few tiles to many: apart by few is apart by many. What is still together after so many fragments stays.
    pub fn closer_by_depth(&self, scratch: &mut Scratch, watch: &mut impl Watch) -> Verdict {
        let most = self.search.resolution;
        let (mut effort, mut resolution, mut last) = (self.effort(), FIRST_TILES.min(most), 0);
        while let Some(tiles) = self.depths(resolution, &mut effort, scratch, watch) {
            if tiles == 0 {
                return Verdict::Apart;
            }
            last = tiles;
            if resolution == most {
                break;
            }
            resolution = (2 * resolution).min(most);
        }
        self.maybe(last, false)
    }

    /// What may be drawn for the pair.
    fn effort(&self) -> Effort {
        let triangles = self.triangles() as u64;
        let few = MOST_FRAGMENTS.saturating_sub(FRAGMENTS_LESS * triangles).max(LEAST_FRAGMENTS);
        Effort::of(few + FRAGMENTS_EACH * triangles)
    }

    /// Bins of time in which a triangle moves by a tile or so, and no more than asked for.
    fn bins(&self, resolution: u32) -> u32 {
        let ([first, last], grain) = (self.window.time, self.grain());
        let step = |part: &Part<'_>| {
            let some = part.list.iter().step_by(part.list.len().div_ceil(SOME).max(1));
            let moved = |triangle: &u32| {
                let [open, close] = &part.object.triangles[*triangle as usize];
                let moved = |axis: usize| {
                    let extent = self.window.space[axis][1] - self.window.space[axis][0];
                    let way = (close[0][axis] - open[0][axis]).abs() * (last - first);
                    if extent > 0.0 { way / (extent / f64::from(resolution)).max(grain) } else { 0.0 }
                };
                moved(0).max(moved(1)).max(moved(2))
            };
            some.clone().map(moved).sum::<f64>() / some.len().max(1) as f64
        };
        let step = self.parts().iter().map(step).fold(0.0, f64::max);
        (step.ceil() as u32).clamp(1, self.search.bins)
    }
}

#[cfg(test)]
mod tests {
    use super::super::families::slide;
    use super::super::pass::{Fragment, Pass};
    use super::super::{Method, Object, Search, detect};
    use super::*;

    /// Counts what is drawn.
    struct Drawn(u64);

    impl Watch for Drawn {
        fn fragment(&mut self, _: &Pass, _: usize, _: &Fragment) {
            self.0 += 1;
        }
    }

    /// Two triangles that lie closer than any tile can tell.
    #[test]
    fn no_method_draws_for_ever_where_it_may_look_closer() {
        let slanted = |x: f64| [[x, 0.0, 0.0], [x + 1.0, 0.0, 1.0], [x, 1.0, 1.0]];
        let object = |x: f64| Object::from_ends(vec![[slanted(x); 2]], 0.0).unwrap();
        for method in [Method::FragmentBox, Method::BoxBox, Method::DepthOnly] {
            let search = Search { resolution: 1024, bins: 16, method, zoom: true };
            let mut drawn = Drawn(0);
            let verdict = search.watched(&object(0.0), &object(1e-7), &mut Scratch::default(), &mut drawn);
            assert!(verdict.may_collide() && drawn.0 <= MOST_FRAGMENTS + 8, "{method:?}: {}", drawn.0);
        }
    }

    #[test]
    fn more_tiles_keep_no_more_plates_that_slide_along_each_other() {
        for gap in [0.03, 0.1] {
            let kept = |resolution: u32| {
                let search = Search { resolution, ..Search::default() };
                let keeps = |seed: &u64| detect(&slide(*seed, gap), &search)[0].verdict.may_collide();
                (0..8).filter(keeps).count()
            };
            let kept = [8, 16, 64].map(kept);
            assert!(kept.is_sorted_by(|few, more| few >= more), "gap {gap}: {kept:?}");
        }
    }

    /// A corner that runs into the middle of a triangle: what is left of space is soon as small as numbers can tell.
    #[test]
    fn tiles_that_numbers_cannot_tell_apart_are_not_drawn() {
        let floor = [[0.0, 0.0, 0.1], [1.0, 0.0, 0.2], [0.0, 1.0, 0.4]];
        let falling = |z: f64| [[0.3, 0.3, z], [0.31, 0.3, z + 1.0], [0.3, 0.32, z + 1.0]];
        let [a, b] =
            [[floor; 2], [falling(1.0), falling(0.22)]].map(|ends| Object::from_ends(vec![ends], 0.0));
        let mut drawn = Drawn(0);
        let search = Search::default();
        let verdict = search.watched(&a.unwrap(), &b.unwrap(), &mut Scratch::default(), &mut drawn);
        assert!(verdict.may_collide() && drawn.0 < MOST_FRAGMENTS / 4, "{}: {verdict:?}", drawn.0);
    }
}
