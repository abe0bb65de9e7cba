//! The passes of the paper alone (thesis, Paper VI, section 3). Both objects are drawn whole along each of
//! the three axes, over all of the space that either sweeps, with one box of time and depth per pixel. The
//! CPU narrows nothing, the passes are independent, and all of them are drawn.

use activity::Event;
use pipeline::{Gpu, PipelineSpec, Viewport};

use super::bounds::Bounds;
use super::detect::{MAX_SCALED_COORDINATE, upscale_factor};
use super::object::Object;
use super::on_gpu::PassesOnGpu;
use super::pair::Method;
use super::pass::{
    Comparison, Fit, Fragment, FragmentBudget, Part, Pass, PassBackend, Resources, Scratch, Tiling,
};
use crate::job::{IMAGE_SIZE, JobError};

/// Work of the passes, and the overlapping pixels of a pair.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PlainResult {
    /// Number of passes: three with boxes of time and depth, six by depth alone.
    pub passes: u64,
    /// Objects drawn. By depth alone, one drawing serves both directions.
    pub draws: u64,
    /// Triangles of the objects drawn.
    pub triangles: u64,
    /// Fragments: pairs of a triangle and a pixel that it may touch.
    pub fragments: u64,
    /// Pixels in which both objects may touch, seen along x, y and z. By depth alone, those of the direction
    /// with fewer.
    pub overlaps: [u64; 3],
}

impl PlainResult {
    /// Whether the pair stays in the potentially colliding set, because no projection separates it.
    pub fn may_collide(&self) -> bool {
        self.overlaps.iter().all(|pixels| *pixels > 0)
    }

    /// Adds the work of another pair; keeps the overlapping pixels of this one.
    #[must_use]
    pub fn and(self, other: &Self) -> Self {
        Self {
            passes: self.passes + other.passes,
            draws: self.draws + other.draws,
            triangles: self.triangles + other.triangles,
            fragments: self.fragments + other.fragments,
            overlaps: self.overlaps,
        }
    }
}

impl PassBackend for PlainResult {
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

/// Draws pairs by one method at one resolution, with reused buffers.
pub struct PlainPasses {
    method: Method,
    resolution: u32,
    scratch: Scratch,
}

impl PlainPasses {
    /// Makes passes with `resolution` pixels across, 1 to 1024.
    pub fn new(method: Method, resolution: u32) -> Self {
        Self { method, resolution, scratch: Scratch::default() }
    }

    /// Draws both objects in every pass, on the host.
    pub fn pair(&mut self, a: &Object, b: &Object) -> PlainResult {
        let mut drawn = PlainResult::default();
        let overlaps = self.overlaps(a, b, &mut drawn);
        let passes = match self.method {
            // The other direction is another pass.
            Method::DepthOnly => 2 * drawn.passes,
            _ => drawn.passes,
        };
        PlainResult { overlaps, passes, ..drawn }
    }

    /// The same on a GPU, where a pass by depth alone has both directions.
    ///
    /// # Errors
    /// [`JobError`] if the GPU or the image cannot be made.
    pub fn pair_on(
        &mut self,
        a: &Object,
        b: &Object,
        hardware: &PipelineSpec,
    ) -> Result<PlainResult, JobError> {
        let viewport = Viewport::new(self.resolution, self.resolution);
        let viewport = viewport.ok_or_else(|| JobError::setting(IMAGE_SIZE))?;
        let mut gpu = Gpu::quiet(hardware)?;
        let objects = [a.clone(), b.clone()];
        let mut passes = PassesOnGpu::new((self.method, viewport, 1), &objects, &mut gpu);
        let overlaps = self.overlaps(a, b, &mut passes);
        let fragments = passes.into_fragments();
        let report = gpu.finish();
        let (passes, draws) = (report.passes.len() as u64, report.counts()[Event::Draws]);
        Ok(PlainResult { passes, draws, triangles: report.triangles() as u64, fragments, overlaps })
    }

    /// Pixels along x, y and z in which both objects, drawn by `backend`, may touch.
    fn overlaps(&mut self, a: &Object, b: &Object, backend: &mut impl PassBackend) -> [u64; 3] {
        let largest = a.largest().max(b.largest());
        if largest > 0.0 && largest < MAX_SCALED_COORDINATE {
            let factor = upscale_factor(largest);
            return self.draw_pair([&a.scaled(factor), &b.scaled(factor)], backend);
        }
        self.draw_pair([a, b], backend)
    }

    fn draw_pair(&mut self, objects: [&Object; 2], backend: &mut impl PassBackend) -> [u64; 3] {
        if objects.iter().any(|object| object.is_empty()) {
            return [0; 3];
        }
        let window = Bounds { time: [0.0, 1.0], ..objects[0].bounds.hull(&objects[1].bounds) };
        let min_width = objects.iter().map(|object| object.uncertainty).fold(window.rounding(), f64::max);
        let lists = objects.map(|object| (0..object.len() as u32).collect::<Vec<_>>());
        let parts = [0, 1].map(|which| Part { object: objects[which], list: &lists[which] });
        [0, 1, 2].map(|axis| {
            let tiling = Tiling { resolution: self.resolution, min_width };
            let pass = Pass::new(axis, &window, tiling, Fit::Edges);
            let comparison = Comparison { pass: &pass, parts, bins: &[Some(window)] };
            self.in_pass(&comparison, backend)
        })
    }

    /// Pixels of a pass in which both objects may touch.
    fn in_pass(&mut self, comparison: &Comparison<'_>, backend: &mut impl PassBackend) -> u64 {
        let (scratch, budget) = (&mut self.scratch, FragmentBudget::unlimited());
        let resources = &mut Resources { scratch, budget, backend };
        // The budget is unlimited, so there always is a result. Without one, the pair would have to stay.
        match self.method {
            Method::DepthOnly => comparison.depths(resources).map_or(1, |[front, behind]| front.min(behind)),
            Method::BoxBox => comparison.boxes_against_boxes(resources).map_or(1, |overlaps| overlaps.tiles),
            Method::FragmentBox => {
                comparison.fragments_against_boxes(resources).map_or(1, |overlaps| overlaps.tiles)
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
                    let result = passes.pair(&case.objects[a], &case.objects[b]);
                    assert!(result.may_collide(), "{} {a} {b} {method:?}", case.family);
                    assert!(result.fragments > 0 && result.draws == 6);
                    assert_eq!(result.passes, if method == Method::DepthOnly { 6 } else { 3 });
                }
            }
        }
    }

    /// A pair that the passes separate is separated with narrowing on the CPU as well.
    #[test]
    fn pairs_that_plain_passes_separate_are_separated_by_the_search() {
        let search = Search { resolution: 32, bins: 1, method: Method::FragmentBox, zoom: false };
        let (mut alone, mut helped) = (0, 0);
        for case in cases(5, 3).iter().filter(|case| case.objects.len() == 2) {
            let result = PlainPasses::new(Method::FragmentBox, 32).pair(&case.objects[0], &case.objects[1]);
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
            for method in [Method::FragmentBox, Method::BoxBox, Method::DepthOnly] {
                let mut passes = PlainPasses::new(method, 8);
                for &(a, b) in &case.collide {
                    let on_gpu = passes.pair_on(&case.objects[a], &case.objects[b], &hardware).unwrap();
                    assert!(on_gpu.may_collide(), "{} {a} {b} {method:?}", case.family);
                    assert_eq!((on_gpu.passes, on_gpu.draws), (3, 6));
                    assert!(on_gpu.fragments > 0 && on_gpu.triangles > 0);
                }
            }
        }
    }

    #[test]
    fn empty_objects_are_apart() {
        let none = Object::from_ends(Vec::new(), 0.0).unwrap();
        let result = PlainPasses::new(Method::BoxBox, 8).pair(&none, &none);
        assert!(!result.may_collide() && result.draws == 0);
    }
}
