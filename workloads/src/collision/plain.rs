//! The passes of the paper alone (thesis, Paper VI, section 3). Both objects are drawn whole along each of
//! the three axes, over all of the space that either sweeps, with one box of time and depth per pixel. The
//! CPU narrows nothing, the passes are independent, and all of them are drawn.
//!
//! Many objects: the potentially colliding set in two linear sweeps (Govindaraju, Redon, Lin and Manocha 2003,
//! "CULLIDE", section 3, generalized to time by the thesis, Paper VI, section 3).
//!
//! Along each axis every object is drawn twice in each sweep: its fragments are compared with the boxes of
//! all objects before it, then they enlarge the boxes. The second sweep goes the other way. An object that
//! meets the boxes of others in neither sweep touches none of them and leaves the set; the next axis is drawn
//! with those that stay. The CPU narrows nothing.

use activity::Event;
use pipeline::{Gpu, PipelineSpec, Viewport};

use super::detect::{MAX_SCALED_COORDINATE, candidates, upscale_factor};
use super::object::Object;
use super::on_gpu::PassesOnGpu;
use super::pair::{CollisionMethod, time_bins};
use super::pass::{
    Comparison, Fit, Fragment, FragmentBudget, Part, Pass, PassBackend, Resources, Scratch, Tiling,
};
use super::{Bounds, TzBox, TzBuffer};
use crate::job::{IMAGE_SIZE, JobError};

/// Work of passes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PassWork {
    /// Number of passes.
    pub passes: u64,
    /// Objects drawn. By depth alone, one drawing serves both directions.
    pub draws: u64,
    /// Triangles of the objects drawn.
    pub triangles: u64,
    /// Fragments: pairs of a triangle and a pixel that it may touch.
    pub fragments: u64,
}

impl PassWork {
    /// Adds other work.
    #[must_use]
    pub fn and(self, other: &Self) -> Self {
        Self {
            passes: self.passes + other.passes,
            draws: self.draws + other.draws,
            triangles: self.triangles + other.triangles,
            fragments: self.fragments + other.fragments,
        }
    }
}

impl PassBackend for PassWork {
    fn begin(&mut self, _: &str, _: &Pass, _: bool) {
        self.passes += 1;
    }

    fn part(&mut self, _: &Pass, _: usize, part: Part<'_>) {
        self.draws += 1;
        self.triangles += part.list.len() as u64;
    }

    fn fragment(&mut self, _: &Pass, _: usize, _: &Fragment) {
        self.fragments += 1;
    }
}

/// Pixels in which both objects of a pair may touch, seen along x, y and z. By depth alone, those of the
/// direction with fewer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Overlaps(pub [u64; 3]);

impl Overlaps {
    /// Whether the pair stays in the potentially colliding set, because no projection separates it.
    pub fn may_collide(&self) -> bool {
        self.fewest() > 0
    }

    /// Pixels of the projection with the fewest.
    pub fn fewest(&self) -> u64 {
        self.0.into_iter().min().unwrap_or(0)
    }
}

/// A pair drawn on the host, without a limit of fragments.
#[derive(Default)]
struct HostPasses {
    work: PassWork,
    /// Fragments by axis and object, once they are drawn. Methods differ in what they compare, and get the same.
    fragments: [[Option<Vec<Fragment>>; 2]; 3],
}

impl PassBackend for HostPasses {
    fn draw(
        &mut self,
        pass: &Pass,
        (which, part): (usize, Part<'_>),
        bins: &[Option<Bounds>],
        budget: &mut FragmentBudget,
        known: Option<&TzBuffer>,
        each: &mut dyn FnMut(&Fragment),
    ) -> bool {
        let Self { work, fragments } = self;
        let fragments = fragments[pass.axis][which].get_or_insert_with(|| {
            let mut fragments = Vec::new();
            work.passes += u64::from(which == 0);
            work.draw(pass, (which, part), bins, budget, known, &mut |fragment| fragments.push(*fragment));
            fragments
        });
        fragments.iter().for_each(each);
        true
    }
}

/// Draws pairs at one resolution, with reused buffers.
pub struct PlainPasses {
    resolution: u32,
    scratch: Scratch,
}

impl PlainPasses {
    /// Makes passes with `resolution` pixels across, 1 to 1024.
    pub fn new(resolution: u32) -> Self {
        Self { resolution, scratch: Scratch::default() }
    }

    /// Draws both objects along each axis, on the host, and compares them by each of the `methods`.
    pub fn pair(&mut self, [a, b]: [&Object; 2], methods: &[CollisionMethod]) -> (Vec<Overlaps>, PassWork) {
        let mut passes = HostPasses::default();
        let overlaps = self.overlaps([a, b], methods, &mut passes);
        (overlaps, passes.work)
    }

    /// The same by one method on a GPU.
    ///
    /// # Errors
    /// [`JobError`] if the GPU or the image cannot be made.
    pub fn pair_on(
        &mut self,
        pair: &[Object; 2],
        method: CollisionMethod,
        hardware: &PipelineSpec,
    ) -> Result<(Overlaps, PassWork), JobError> {
        let viewport = Viewport::new(self.resolution, self.resolution);
        let viewport = viewport.ok_or_else(|| JobError::setting(IMAGE_SIZE))?;
        let mut gpu = Gpu::without_packets(hardware)?;
        let mut passes = PassesOnGpu::new((method, viewport, 1), pair, &mut gpu);
        let overlaps = self.overlaps(pair.each_ref(), &[method], &mut passes)[0];
        let fragments = passes.into_fragments()?;
        let report = gpu.finish();
        let (passes, draws) = (report.passes.len() as u64, report.counts()[Event::Draws]);
        Ok((overlaps, PassWork { passes, draws, triangles: report.triangles() as u64, fragments }))
    }

    /// By method, the pixels in which both objects, drawn by `backend`, may touch.
    fn overlaps(
        &mut self,
        objects: [&Object; 2],
        methods: &[CollisionMethod],
        backend: &mut impl PassBackend,
    ) -> Vec<Overlaps> {
        let largest = objects.iter().map(|object| object.largest()).fold(0.0, f64::max);
        if largest > 0.0 && largest < MAX_SCALED_COORDINATE {
            let scaled = objects.map(|object| object.scaled(upscale_factor(largest)));
            return self.draw_pair(scaled.each_ref(), methods, backend);
        }
        self.draw_pair(objects, methods, backend)
    }

    fn draw_pair(
        &mut self,
        objects: [&Object; 2],
        methods: &[CollisionMethod],
        backend: &mut impl PassBackend,
    ) -> Vec<Overlaps> {
        let mut found = vec![Overlaps([0; 3]); methods.len()];
        if objects.iter().any(|object| object.is_empty()) {
            return found;
        }
        let window = Bounds { time: [0.0, 1.0], ..objects[0].bounds.hull(&objects[1].bounds) };
        let min_width = objects.iter().map(|object| object.uncertainty).fold(window.rounding(), f64::max);
        let lists = objects.map(|object| (0..object.len() as u32).collect::<Vec<_>>());
        let parts = [0, 1].map(|which| Part { object: objects[which], list: &lists[which] });
        for axis in 0..3 {
            let tiling = Tiling { resolution: self.resolution, min_width };
            let pass = Pass::new(axis, &window, tiling, Fit::Edges);
            let comparison = Comparison { pass: &pass, parts, bins: &[Some(window)] };
            for (&method, found) in methods.iter().zip(&mut found) {
                found.0[axis] = self.in_pass(method, &comparison, backend);
            }
        }
        found
    }

    /// Pixels of a pass in which both objects may touch.
    fn in_pass(
        &mut self,
        method: CollisionMethod,
        comparison: &Comparison<'_>,
        backend: &mut impl PassBackend,
    ) -> u64 {
        let (scratch, budget) = (&mut self.scratch, FragmentBudget::unlimited());
        let resources = &mut Resources { scratch, budget, backend };
        // The budget is unlimited, so there always is a result. Without one, the pair would have to stay.
        match method {
            CollisionMethod::DepthOnly => {
                comparison.depths(resources).map_or(1, |[front, behind]| front.min(behind))
            }
            CollisionMethod::BoxBox => {
                comparison.boxes_against_boxes(resources).map_or(1, |overlaps| overlaps.tiles)
            }
            CollisionMethod::FragmentBox => {
                comparison.fragments_against_boxes(resources).map_or(1, |overlaps| overlaps.tiles)
            }
        }
    }
}

/// Parameters of the sweeps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sweeps {
    /// What is compared.
    pub method: CollisionMethod,
    /// Pixels across, 1 to 1024.
    pub resolution: u32,
    /// Time bins per pixel, 1 to 256.
    pub bins: u32,
}

/// Potentially colliding set.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CollidingSet {
    /// Objects that may collide with others, in order.
    pub objects: Vec<usize>,
    /// Work of the sweeps. A pass is a sweep along an axis.
    pub work: PassWork,
}

impl CollidingSet {
    /// Pairs of the set whose swept boxes touch.
    pub fn pairs(&self, objects: &[Object]) -> Vec<(usize, usize)> {
        let is_kept = |object: &usize| self.objects.binary_search(object).is_ok();
        candidates(objects).into_iter().filter(|(a, b)| is_kept(a) && is_kept(b)).collect()
    }
}

impl Sweeps {
    /// The potentially colliding set of `objects`.
    pub fn detect(&self, objects: &[Object]) -> CollidingSet {
        let mut work = PassWork::default();
        let objects = self.detect_on(objects, &mut work);
        CollidingSet { objects, work }
    }

    /// The same, drawn by `backend`.
    pub(super) fn detect_on(&self, objects: &[Object], backend: &mut impl PassBackend) -> Vec<usize> {
        let largest = objects.iter().map(Object::largest).fold(0.0, f64::max);
        if largest > 0.0 && largest < MAX_SCALED_COORDINATE {
            let factor = upscale_factor(largest);
            let scaled: Vec<Object> = objects.iter().map(|object| object.scaled(factor)).collect();
            return self.all_axes(&scaled, backend);
        }
        self.all_axes(objects, backend)
    }

    fn all_axes(&self, objects: &[Object], backend: &mut impl PassBackend) -> Vec<usize> {
        let mut set: Vec<usize> = (0..objects.len()).filter(|&object| !objects[object].is_empty()).collect();
        for axis in 0..3 {
            if set.len() < 2 {
                return Vec::new();
            }
            set = self.along(axis, objects, &set, backend);
        }
        set
    }

    /// The objects of `set` that meet others along `axis`.
    fn along(
        &self,
        axis: usize,
        objects: &[Object],
        set: &[usize],
        backend: &mut impl PassBackend,
    ) -> Vec<usize> {
        let hull = set.iter().fold(Bounds::NOTHING, |hull, &object| hull.hull(objects[object].bounds()));
        let uncertainty = set.iter().map(|&object| objects[object].uncertainty);
        let tiling =
            Tiling { resolution: self.resolution, min_width: uncertainty.fold(hull.rounding(), f64::max) };
        let pass = Pass::new(axis, &hull, tiling, Fit::Edges);
        let bins = time_bins(&hull, self.bins);
        let mut sweep = Sweep {
            pass: &pass,
            bins: &bins,
            method: self.method,
            known: TzBuffer::default(),
            own: TzBuffer::default(),
        };
        let mut meets = vec![[false; 2]; objects.len()];
        let backward: Vec<usize> = set.iter().rev().copied().collect();
        for (order, name, follows) in [(set, NAMES[axis][0], axis > 0), (&backward, NAMES[axis][1], false)] {
            backend.begin(name, &pass, follows);
            sweep.known.clear(pass.tiles() * bins.len());
            for &object in order {
                let found = sweep.object(&objects[object], backend);
                (0..2).for_each(|direction| meets[object][direction] |= found[direction]);
            }
        }
        set.iter().copied().filter(|&object| meets[object] == [true; 2]).collect()
    }
}

/// Names of the sweeps along each axis.
const NAMES: [[&str; 2]; 3] =
    [["x, forward", "x, backward"], ["y, forward", "y, backward"], ["z, forward", "z, backward"]];

/// A sweep along an axis.
struct Sweep<'a> {
    pass: &'a Pass,
    bins: &'a [Option<Bounds>],
    method: CollisionMethod,
    /// Boxes of all objects so far.
    known: TzBuffer,
    /// Boxes of one object.
    own: TzBuffer,
}

impl Sweep<'_> {
    /// Whether an object meets those before it, seen from either direction of the axis; then it is added to
    /// them. Boxes of time and depth need no second direction.
    fn object(&mut self, object: &Object, backend: &mut impl PassBackend) -> [bool; 2] {
        let list: Vec<u32> = (0..object.len() as u32).collect();
        let part = Part { object, list: &list };
        let found = match self.method {
            CollisionMethod::FragmentBox => self.fragments(part, backend),
            _ => self.boxes(part, backend),
        };
        match self.method {
            CollisionMethod::FragmentBox => {
                let (pass, known) = (self.pass, &mut self.known);
                let budget = &mut FragmentBudget::unlimited();
                backend.draw(pass, (0, part), self.bins, budget, None, &mut |fragment| {
                    known.add(pass.place(fragment.tile, fragment.bin), &fragment.inside);
                });
            }
            _ => self.own.used().for_each(|(place, inside)| self.known.add(place, inside)),
        }
        found
    }

    /// Compares each fragment with the boxes so far.
    fn fragments(&self, part: Part<'_>, backend: &mut impl PassBackend) -> [bool; 2] {
        let (pass, mut overlaps) = (self.pass, Vec::new());
        let budget = &mut FragmentBudget::unlimited();
        backend.draw(pass, (1, part), self.bins, budget, Some(&self.known), &mut |fragment| {
            let known = self.known.at(pass.place(fragment.tile, fragment.bin));
            if known.meet(fragment.inside.t, fragment.inside.z).is_some() {
                overlaps.push(fragment.tile);
            }
        });
        overlaps.iter().for_each(|tile| backend.overlap(pass, *tile));
        [!overlaps.is_empty(); 2]
    }

    /// Draws the object into boxes of its own, and compares these with the boxes so far.
    fn boxes(&mut self, part: Part<'_>, backend: &mut impl PassBackend) -> [bool; 2] {
        let (pass, own) = (self.pass, &mut self.own);
        own.clear(pass.tiles() * self.bins.len());
        let budget = &mut FragmentBudget::unlimited();
        backend.draw(pass, (1, part), self.bins, budget, None, &mut |fragment| {
            own.add(pass.place(fragment.tile, fragment.bin), &fragment.inside);
        });
        backend.compare(pass, self.bins.len(), [&self.known, &self.own], true);
        let mut found = [false; 2];
        for (place, own) in self.own.used() {
            let directions = overlaps(self.method, self.known.at(place), own);
            (0..2).for_each(|direction| found[direction] |= directions[direction]);
            if directions == [true; 2] {
                backend.overlap(pass, pass.at(place).0);
            }
        }
        found
    }
}

/// By direction, whether two boxes meet; by depth alone, whether the second is in front of the farthest depth
/// of the first, and whether it is behind the nearest.
fn overlaps(method: CollisionMethod, known: &TzBox, own: &TzBox) -> [bool; 2] {
    if known.z[0] > known.z[1] {
        return [false; 2];
    }
    match method {
        CollisionMethod::DepthOnly => [own.z[0] <= known.z[1], own.z[1] >= known.z[0]],
        _ => [known.meet(own.t, own.z).is_some(); 2],
    }
}

#[cfg(test)]
mod tests {
    use pipeline::random::{mix, unit};

    use super::super::contact_probe::cross;
    use super::super::families::{Case, cases};
    use super::super::{PairSearch, detect};
    use super::*;

    const METHODS: [CollisionMethod; 3] =
        [CollisionMethod::FragmentBox, CollisionMethod::BoxBox, CollisionMethod::DepthOnly];

    #[test]
    fn every_collision_stays_and_every_pass_is_drawn() {
        for case in cases(7, 3) {
            let mut passes = PlainPasses::new(16);
            for &(a, b) in &case.collide {
                let (overlaps, work) = passes.pair([&case.objects[a], &case.objects[b]], &METHODS);
                assert!(overlaps.iter().all(Overlaps::may_collide), "{} {a} {b} {overlaps:?}", case.family);
                assert!(work.fragments > 0);
                assert_eq!((work.passes, work.draws), (3, 6));
            }
        }
    }

    /// Methods that share the drawing say what each says with its own.
    #[test]
    fn methods_do_not_depend_on_each_other() {
        let mut passes = PlainPasses::new(16);
        for Case { objects, .. } in cases(3, 2) {
            let pair = [&objects[0], &objects[1]];
            let (together, work) = passes.pair(pair, &METHODS);
            let each = METHODS.map(|method| passes.pair(pair, &[method]));
            assert!(each.iter().all(|(_, alone)| *alone == work));
            assert_eq!(together, each.map(|(overlaps, _)| overlaps[0]));
        }
    }

    /// A pair that the passes separate is separated with narrowing on the CPU as well.
    #[test]
    fn pairs_that_plain_passes_separate_are_separated_by_the_search() {
        let search =
            PairSearch { resolution: 32, bins: 1, method: CollisionMethod::FragmentBox, zoom: false };
        let (mut alone, mut helped) = (0, 0);
        for case in cases(5, 3).iter().filter(|case| case.objects.len() == 2) {
            let pair = [&case.objects[0], &case.objects[1]];
            let result = PlainPasses::new(32).pair(pair, &[CollisionMethod::FragmentBox]).0[0];
            let answers = detect(&case.objects, &search);
            helped += usize::from(answers.iter().all(|answer| !answer.verdict.may_collide()));
            alone += usize::from(!result.may_collide());
        }
        assert!(alone > 0 && alone <= helped, "{alone} of {helped}");
    }

    /// The modelled hardware, in f32, keeps what the host keeps in f64, and draws each object along each axis.
    #[test]
    fn pairs_are_drawn_on_a_gpu_too() {
        let hardware = crate::job::testing::hardware();
        for case in cases(7, 1) {
            for method in METHODS {
                let mut passes = PlainPasses::new(8);
                for &(a, b) in &case.collide {
                    let pair = [case.objects[a].clone(), case.objects[b].clone()];
                    let (overlaps, work) = passes.pair_on(&pair, method, &hardware).unwrap();
                    assert!(overlaps.may_collide(), "{} {a} {b} {method:?}", case.family);
                    assert_eq!((work.passes, work.draws), (3, 6));
                    assert!(work.fragments > 0 && work.triangles > 0);
                }
            }
        }
    }

    #[test]
    fn empty_objects_are_apart() {
        let none = Object::from_ends(Vec::new(), 0.0).unwrap();
        let (overlaps, work) = PlainPasses::new(8).pair([&none, &none], &[CollisionMethod::BoxBox]);
        assert!(!overlaps[0].may_collide() && work == PassWork::default());
    }

    #[test]
    fn no_object_that_collides_leaves_the_set() {
        let mut left = 0;
        for case in cases(9, 2) {
            for (method, bins) in METHODS.into_iter().flat_map(|method| [(method, 1), (method, 3)]) {
                let set = Sweeps { method, resolution: 12, bins }.detect(&case.objects);
                let pairs = set.pairs(&case.objects);
                assert!(case.collide.iter().all(|pair| pairs.contains(pair)), "{} {method:?}", case.family);
                assert!(case.collide.is_empty() || set.work.fragments > 0);
                left += case.objects.len() - set.objects.len();
            }
        }
        assert!(left > 0);
    }

    /// Random moving triangles, tested at many times pair by pair.
    #[test]
    fn brute_force_finds_no_collision_outside_the_set() {
        let mut found = [0, 0];
        for seed in 0..12 {
            let uniform = |n: u64| unit(mix(mix(seed) ^ n));
            let object = |n: u64| {
                let at = |k: u64| 6.0 * uniform(100 * n + k);
                let corner = |k: u64, from: u64| {
                    [0, 1, 2].map(|axis| at(from + axis) + uniform(100 * n + 9 * k + axis + 10))
                };
                let ends = [0, 3].map(|from| [0, 1, 2].map(|k| corner(k, from)));
                Object::from_ends(vec![ends], 0.0).unwrap()
            };
            let objects: Vec<Object> = (0..16).map(object).collect();
            let collides = |a: usize, b: usize| {
                let [one, other] = [a, b].map(|n| &objects[n].triangles[0]);
                (0..=64).any(|step| cross(one, other, f64::from(step) / 64.0))
            };
            for method in METHODS {
                let set = Sweeps { method, resolution: 32, bins: 2 }.detect(&objects);
                let pairs = set.pairs(&objects);
                for (a, b) in (0..16).flat_map(|a| (a + 1..16).map(move |b| (a, b))) {
                    if collides(a, b) {
                        assert!(pairs.contains(&(a, b)), "{seed} {a} {b} {method:?}");
                        found[0] += 1;
                    }
                }
                found[1] += objects.len() - set.objects.len();
            }
        }
        assert!(found[0] > 20 && found[1] > 20, "{found:?}");
    }

    #[test]
    fn two_objects_are_separated_as_by_plain_passes() {
        for case in cases(5, 3).iter().filter(|case| case.objects.len() == 2) {
            let (alone, _) = PlainPasses::new(16).pair([&case.objects[0], &case.objects[1]], &METHODS);
            for (method, alone) in METHODS.into_iter().zip(alone) {
                let set = Sweeps { method, resolution: 16, bins: 1 }.detect(&case.objects);
                if !alone.may_collide() {
                    assert!(set.objects.is_empty(), "{} {method:?}", case.family);
                }
            }
        }
    }
}
