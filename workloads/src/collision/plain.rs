//! The passes of the paper and nothing else (thesis, Paper VI, section 3): both objects drawn whole along each of the three axes,
//! over all of the space that either sweeps, one box of time and depth a pixel. Nothing is narrowed on the CPU, no pass knows of
//! another, and all are drawn.

use super::bounds::Bounds;
use super::compare::{Comparison, Scratch, Watch};
use super::object::Object;
use super::pass::{Effort, Fit, Fragment, Part, Pass};
use super::run::{TINY, enlarging};
use super::search::Method;

/// What the passes have drawn, and what they have left of a pair.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Drawn {
    /// Passes: three with boxes of time and depth, six by depth alone.
    pub passes: u64,
    /// Objects drawn; one by depth alone serves both directions.
    pub draws: u64,
    /// Triangles of these.
    pub triangles: u64,
    /// Pixels that triangles may touch.
    pub fragments: u64,
    /// Pixels in which both objects may touch, seen along x, y and z; by depth alone those of the direction with fewer.
    pub left: [u64; 3],
}

impl Drawn {
    /// Whether the pair stays in the potentially colliding set: no projection separates it.
    pub fn may_collide(&self) -> bool {
        self.left.iter().all(|pixels| *pixels > 0)
    }

    /// Adds what another pair took; what is left of pairs is not added up.
    #[must_use]
    pub fn and(self, other: &Self) -> Self {
        Self {
            passes: self.passes + other.passes,
            draws: self.draws + other.draws,
            triangles: self.triangles + other.triangles,
            fragments: self.fragments + other.fragments,
            left: self.left,
        }
    }
}

impl Watch for Drawn {
    fn part(&mut self, _: &Pass, _: usize, part: Part<'_>) {
        self.draws += 1;
        self.triangles += part.list.len() as u64;
    }

    fn fragment(&mut self, _: &Pass, _: usize, _: &Fragment) {
        self.fragments += 1;
    }
}

/// Draws pairs by one method at one resolution; its buffers are used over and over.
pub struct PlainPasses {
    method: Method,
    resolution: u32,
    scratch: Scratch,
}

impl PlainPasses {
    /// With `resolution` pixels across, 1 to 1024.
    pub fn new(method: Method, resolution: u32) -> Self {
        Self { method, resolution, scratch: Scratch::default() }
    }

    /// Draws both objects in every pass.
    pub fn pair(&mut self, a: &Object, b: &Object) -> Drawn {
        let largest = a.largest().max(b.largest());
        if largest > 0.0 && largest < TINY {
            let factor = enlarging(largest);
            return self.drawn([&a.scaled(factor), &b.scaled(factor)]);
        }
        self.drawn([a, b])
    }

    fn drawn(&mut self, objects: [&Object; 2]) -> Drawn {
        let mut drawn = Drawn::default();
        if objects.iter().any(|object| object.is_empty()) {
            return drawn;
        }
        let window = Bounds { time: [0.0, 1.0], ..objects[0].bounds.hull(&objects[1].bounds) };
        let grain = objects.iter().map(|object| object.unsure()).fold(window.rounding(), f64::max);
        let lists = objects.map(|object| (0..object.len() as u32).collect::<Vec<_>>());
        let parts = [0, 1].map(|which| Part { object: objects[which], list: &lists[which] });
        for axis in 0..3 {
            let pass = Pass::new(axis, &window, (self.resolution, grain), Fit::Edges);
            let comparison = Comparison { pass: &pass, parts, bins: &[Some(window)] };
            drawn.left[axis] = self.left(&comparison, &mut drawn);
            drawn.passes += if self.method == Method::DepthOnly { 2 } else { 1 };
        }
        drawn
    }

    /// Pixels in which both may touch in a pass.
    fn left(&mut self, comparison: &Comparison<'_>, drawn: &mut Drawn) -> u64 {
        let (scratch, effort) = (&mut self.scratch, &mut Effort::endless());
        // Effort has no end, so that there always is an answer; a pair without one would have to stay.
        match self.method {
            Method::DepthOnly => {
                comparison.depths(scratch, effort, drawn).map_or(1, |[front, behind]| front.min(behind))
            }
            Method::BoxBox => {
                comparison.boxes_against_boxes(scratch, effort, drawn).map_or(1, |left| left.tiles)
            }
            Method::FragmentBox => {
                comparison.fragments_against_boxes(scratch, effort, drawn).map_or(1, |left| left.tiles)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::families::cases;
    use super::super::{Search, detect};
    use super::*;

    #[test]
    fn every_collision_stays_and_every_pass_is_drawn() {
        for case in cases(7, 3) {
            for method in [Method::FragmentBox, Method::BoxBox, Method::DepthOnly] {
                let mut passes = PlainPasses::new(method, 16);
                for &(a, b) in &case.collide {
                    let drawn = passes.pair(&case.objects[a], &case.objects[b]);
                    assert!(drawn.may_collide(), "{} {a} {b} {method:?}", case.family);
                    assert!(drawn.fragments > 0 && drawn.draws == 6);
                    assert_eq!(drawn.passes, if method == Method::DepthOnly { 6 } else { 3 });
                }
            }
        }
    }

    /// What the CPU narrows first is a subset of what the passes see.
    #[test]
    fn what_passes_clear_alone_is_cleared_with_help_as_well() {
        let search = Search { resolution: 32, bins: 1, method: Method::FragmentBox, zoom: false };
        let (mut alone, mut helped) = (0, 0);
        for case in cases(5, 3).iter().filter(|case| case.objects.len() == 2) {
            let drawn = PlainPasses::new(Method::FragmentBox, 32).pair(&case.objects[0], &case.objects[1]);
            let answers = detect(&case.objects, &search);
            helped += usize::from(answers.iter().all(|answer| !answer.verdict.may_collide()));
            alone += usize::from(!drawn.may_collide());
        }
        assert!(alone > 0 && alone <= helped, "{alone} of {helped}");
    }

    #[test]
    fn what_is_empty_is_apart() {
        let none = Object::from_ends(Vec::new(), 0.0).unwrap();
        let drawn = PlainPasses::new(Method::BoxBox, 8).pair(&none, &none);
        assert!(!drawn.may_collide() && drawn.draws == 0);
    }
}
