//! Compared methods, named sets of tests, and all of them for one value of a family: lost samples, cost, and
//! the boxes of tile tests compared with the true ones.

use activity::{Counts, Event};
use glam::Vec3;
use pipeline::geometry::Projection;
use pipeline::random::mix;
use pipeline::sampling::SampleSource;
use pipeline::setup::{Triangle, bounds};
use pipeline::traversal::{
    Box5, EdgeBounds, Edges, Facing, LensLines, Piece, TileRect, TileView, TimePieces, narrow,
};
use pipeline::{Camera, Draw, Features, PassError, PipelineSpec, RasterPass, Settings, Shear, Viewport};
use run::{GpuSpec, RunError};
use serde::Serialize;
use workloads::stress::{Family, Size, brute_force, set_up_all};
use workloads::visibility::Unshaded;

use super::truth::{Hulls, Truth};

/// Result of one method for one value of a family.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StressRow {
    /// The family.
    pub family: &'static str,
    /// The value of its parameter.
    pub value: f64,
    /// The method.
    pub method: &'static str,
    /// Triangles drawn.
    pub triangles: u64,
    /// Samples that do not see what they have to: must be none.
    pub samples_lost: u64,
    /// Source of the reference: `brute force` or `no tests`.
    pub compared_with: &'static str,
    /// Cost of the method.
    pub work: MethodWork,
    /// Multiply-adds of the method over those of the best method at this value.
    pub over_best: f64,
    /// Source of the true intervals: `exact roots` or `dense sampling`.
    pub truth: &'static str,
    /// Width of its boxes.
    pub intervals: Intervals,
}

/// Counted work of a method.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct MethodWork {
    /// Samples tested.
    pub samples_tested: u64,
    /// Samples found inside.
    pub samples_hit: u64,
    /// Multiply-adds of tile tests and depth intervals.
    pub tile_madds: u64,
    /// Multiply-adds of screens and sample tests.
    pub sample_madds: u64,
}

impl MethodWork {
    /// The work in `counts`.
    pub fn new(counts: &Counts) -> Self {
        Self {
            samples_tested: counts[Event::SamplesTested],
            samples_hit: counts[Event::SamplesHit],
            tile_madds: counts[Event::TileMadds] + counts[Event::DepthIntervalMadds],
            sample_madds: counts[Event::ScreenMadds] + counts[Event::SampleMadds],
        }
    }

    /// All multiply-adds of tests.
    pub fn madds(&self) -> u64 {
        self.tile_madds + self.sample_madds
    }

    /// Samples hit over samples tested, where any was.
    pub fn efficiency(&self) -> Option<f64> {
        (self.samples_tested > 0).then(|| self.samples_hit as f64 / self.samples_tested as f64)
    }
}

/// Pairs of triangle and tile whose true interval is found, at full size and where time is short.
const PAIRS: [u64; 2] = [400, 60];

/// Every method on `family` at `value`.
///
/// # Errors
/// When the scene cannot be made or the hardware cannot be built.
pub fn measure(
    family: &'static Family,
    value: f64,
    size: Size,
    gpu: &GpuSpec,
    methods: &[TestMethod],
) -> Result<Vec<StressRow>, RunError> {
    on_subject(family, value, size, super::SEED, gpu, |subject| {
        let pairs = Pairs::of(subject, PAIRS[usize::from(size != Size::FULL)]);
        let (reference, brute) = subject.reference()?;
        let row = |method: &TestMethod| -> Result<_, PassError> {
            let seen = subject.seen(method.features)?;
            Ok(StressRow {
                family: family.name,
                value,
                method: method.name,
                triangles: subject.triangles(),
                samples_lost: differing(&seen, &reference),
                compared_with: if brute { "brute force" } else { "no tests" },
                work: MethodWork::new(&subject.counts(method.features)?),
                over_best: 1.0,
                truth: pairs.source(),
                intervals: pairs.under(&method.features),
            })
        };
        Ok(compared(methods.iter().map(row).collect::<Result<_, _>>()?))
    })
}

/// With the cost of each over that of the best.
fn compared(mut rows: Vec<StressRow>) -> Vec<StressRow> {
    let best = rows.iter().map(|row| row.work.madds()).min().unwrap_or(0).max(1) as f64;
    rows.iter_mut().for_each(|row| row.over_best = row.work.madds().max(1) as f64 / best);
    rows
}

/// Pairs of a triangle and a tile, with what is true of each.
pub struct Pairs {
    pairs: Vec<Pair>,
    shear: Shear,
    exact: bool,
}

struct Pair {
    triangle: Triangle,
    place: TileAndCamera,
    truth: Option<Hulls>,
}

/// Intervals of the pairs under a set of tests. Widths are shares of the whole lens and shutter, means over
/// pairs that truly touch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Intervals {
    /// Pairs looked at, those of the bounding box.
    pub pairs: u64,
    /// Pairs of these that truly touch.
    pub pairs_touching: u64,
    /// Pairs the tests keep.
    pub pairs_kept: u64,
    /// Pairs that truly touch and are not kept, or whose box leaves out what truly touches: must be none.
    pub pairs_wrong: u64,
    /// Mean width in u, v, t of the boxes of pairs that touch.
    pub u_width: f64,
    /// See `u_width`.
    pub v_width: f64,
    /// See `u_width`.
    pub t_width: f64,
    /// Mean true width.
    pub u_true: f64,
    /// Mean true width.
    pub v_true: f64,
    /// Mean true width.
    pub t_true: f64,
    /// Volume of the true boxes over the volume of those that the tests keep: 1 is as tight as a box can be.
    pub tightness: f64,
}

/// Largest part of the true box that a box may leave out: the rounding error of the true box itself.
const TOLERANCE: f64 = 1e-6;

impl Pairs {
    /// About `most` of the pairs of `subject` that pass the bounding box, spread evenly, tiles as in its spec.
    pub fn of(subject: &Subject<'_>, most: u64) -> Self {
        let projection = Projection::new(subject.camera, subject.viewport);
        let side = subject.spec.tile_px;
        let triangles: Vec<_> = set_up_all(subject.camera, subject.draws, subject.viewport).collect();
        let rects: Vec<_> = triangles
            .iter()
            .map(|triangle| bounds(triangle, &projection.shear, subject.viewport).tiles(side))
            .collect();
        let count = |rect: &pipeline::setup::PixelRect| {
            u64::from(rect.x1.saturating_sub(rect.x0)) * u64::from(rect.y1.saturating_sub(rect.y0))
        };
        let stride = rects.iter().map(count).sum::<u64>().div_ceil(most).max(1);
        let (mut pairs, mut passed) = (Vec::new(), 0);
        for (triangle, rect) in triangles.iter().zip(&rects) {
            let (across, here) = (u64::from(rect.x1.saturating_sub(rect.x0)), count(rect));
            for tile in (0..here).filter(|tile| chosen(passed + tile, stride)) {
                let [column, row] = [tile % across, tile / across].map(|step| step as u32);
                let origin = [(rect.x0 + column) * side, (rect.y0 + row) * side];
                let place =
                    TileAndCamera::new(subject.viewport, projection.shear, projection.near, origin, side);
                let truth = Truth::new(triangle, &projection.shear, &place.tile, projection.near);
                // The truth asks where a triangle is, not which face it shows; so must the tests.
                let triangle = Triangle { faces: [true; 2], ..*triangle };
                pairs.push((truth.is_exact(), Pair { triangle, place, truth: truth.hulls() }));
            }
            passed += here;
        }
        let exact = pairs.iter().all(|(exact, _)| *exact);
        let pairs = pairs.into_iter().map(|(_, pair)| pair).collect();
        Self { pairs, shear: projection.shear, exact }
    }

    /// Source of the true intervals.
    pub fn source(&self) -> &'static str {
        if self.exact { "exact roots" } else { "dense sampling" }
    }

    /// Intervals under the tests of `features`.
    pub fn under(&self, features: &Features) -> Intervals {
        self.bounded(|place, triangle| place.bound(features, triangle))
    }

    /// Intervals under `bound`.
    pub fn bounded(&self, bound: impl Fn(&TileAndCamera, &Triangle) -> Option<Box5>) -> Intervals {
        let mut sum = Intervals { pairs: self.pairs.len() as u64, ..Intervals::default() };
        let (mut volume, mut true_volume) = (0.0, 0.0);
        for pair in &self.pairs {
            let found = bound(&pair.place, &pair.triangle).map(|within| self.hulls(&within));
            sum.pairs_kept += u64::from(found.is_some());
            volume += found.map_or(0.0, |hulls| widths(&hulls).iter().product());
            let Some(truth) = pair.truth else { continue };
            true_volume += widths(&truth).iter().product::<f64>();
            sum.pairs_touching += 1;
            sum.pairs_wrong += u64::from(found.is_none_or(|found| !holds(&found, &truth)));
            sum.add_widths(&found.map_or([0.0; 3], |found| widths(&found)), &widths(&truth));
        }
        sum.divide(volume, true_volume)
    }

    fn hulls(&self, within: &Box5) -> Hulls {
        let whole = [-1.0, 1.0];
        let lens = if self.shear.is_none() { [whole; 2] } else { [within.u, within.v].map(wide) };
        [lens[0], lens[1], wide(within.t)]
    }
}

impl Intervals {
    fn add_widths(&mut self, found: &[f64; 3], truth: &[f64; 3]) {
        for (sum, width) in [&mut self.u_width, &mut self.v_width, &mut self.t_width].into_iter().zip(found) {
            *sum += width;
        }
        for (sum, width) in [&mut self.u_true, &mut self.v_true, &mut self.t_true].into_iter().zip(truth) {
            *sum += width;
        }
    }

    fn divide(mut self, volume: f64, true_volume: f64) -> Self {
        let touching = self.pairs_touching.max(1) as f64;
        let Self { u_width, v_width, t_width, u_true, v_true, t_true, .. } = &mut self;
        [u_width, v_width, t_width, u_true, v_true, t_true].into_iter().for_each(|sum| *sum /= touching);
        self.tightness = if volume > 0.0 { true_volume / volume } else { 1.0 };
        self
    }
}

/// Spreads the choice over triangles and tiles, in which a plain stride would fall into step.
fn chosen(pair: u64, stride: u64) -> bool {
    mix(pair).is_multiple_of(stride)
}

fn wide(range: [f32; 2]) -> [f64; 2] {
    range.map(f64::from)
}

/// Shares of the whole lens and shutter.
fn widths(hulls: &Hulls) -> [f64; 3] {
    let [u, v, t] = hulls.map(|[low, high]| (high - low).max(0.0));
    [0.5 * u, 0.5 * v, t]
}

fn holds(found: &Hulls, truth: &Hulls) -> bool {
    found.iter().zip(truth).all(|([low, high], t)| *low <= t[0] + TOLERANCE && *high >= t[1] - TOLERANCE)
}

/// A named set of tests.
#[derive(Clone, Copy, Debug)]
pub struct TestMethod {
    /// Name of the method in tables and charts.
    pub name: &'static str,
    /// The tests that are on.
    pub features: Features,
}

const NONE: Features = Features::NONE;
const SIDES: Features = Features { side_planes: true, ..NONE };
const EDGES: Features = Features { edges: true, ..NONE };
const FACING: Features = Features { facing: true, facing_splits: Features::ALL.facing_splits, ..NONE };

/// The sets that `quintile stress` compares, each a line.
pub const METHODS: [TestMethod; 14] = [
    TestMethod { name: "box only", features: NONE },
    TestMethod { name: "lens lines", features: Features { lens_lines: true, ..NONE } },
    TestMethod { name: "sides", features: SIDES },
    TestMethod { name: "facing", features: FACING },
    TestMethod { name: "edges", features: EDGES },
    TestMethod { name: "screen", features: Features { screen: true, ..NONE } },
    TestMethod { name: "sides+edges", features: Features { edges: true, ..SIDES } },
    TestMethod { name: "facing+edges", features: Features { edges: true, ..FACING } },
    TestMethod { name: "edges+screen", features: Features { screen: true, ..EDGES } },
    TestMethod { name: "sides+edges+screen", features: Features { edges: true, screen: true, ..SIDES } },
    TestMethod { name: "z_max", features: Features { z_max: true, ..NONE } },
    TestMethod { name: "all but coarse", features: Features { coarse: false, ..Features::ALL } },
    TestMethod { name: "all", features: Features::ALL },
    TestMethod { name: "auto", features: Features { auto: true, ..Features::ALL } },
];

/// A test that can be switched on: its letter in charts, its name, and how.
#[derive(Clone, Copy, Debug)]
pub struct Switch {
    /// Letter of the switch in charts.
    pub letter: char,
    /// Name of the switch, as in a GPU file.
    pub name: &'static str,
    /// Switches it on.
    pub on: fn(&mut Features),
}

/// Every test that can be switched on, each a line.
pub const SWITCHES: [Switch; 7] = [
    Switch { letter: 'l', name: "lens_lines", on: |features| features.lens_lines = true },
    Switch { letter: 's', name: "side_planes", on: |features| features.side_planes = true },
    Switch { letter: 'f', name: "facing", on: |features| *features = with_facing(features) },
    Switch { letter: 'e', name: "edges", on: |features| features.edges = true },
    Switch { letter: 'o', name: "coarse", on: |features| features.coarse = true },
    Switch { letter: 'c', name: "screen", on: |features| features.screen = true },
    Switch { letter: 'z', name: "z_max", on: |features| features.z_max = true },
];

fn with_facing(features: &Features) -> Features {
    Features { facing: true, facing_splits: Features::ALL.facing_splits, ..*features }
}

/// Every combination of switches, with the letters of those that are on (`-` for none).
pub fn combinations() -> Vec<(String, Features)> {
    (0..1_u32 << SWITCHES.len())
        .map(|mask| {
            let on = SWITCHES.iter().enumerate().filter(|(bit, _)| mask >> bit & 1 == 1);
            let (mut letters, mut features) = (String::new(), NONE);
            for (_, switch) in on {
                letters.push(switch.letter);
                (switch.on)(&mut features);
            }
            (if letters.is_empty() { "-".to_owned() } else { letters }, features)
        })
        .collect()
}

/// A tile with what the tests need to know of the camera.
#[derive(Clone, Copy, Debug)]
pub struct TileAndCamera {
    /// The tile.
    pub tile: TileRect,
    /// The lens.
    pub shear: Shear,
    /// The near depth.
    pub near: f32,
}

impl TileAndCamera {
    /// The tile of `side_px` pixels whose first pixel is `origin`.
    pub fn new(viewport: Viewport, shear: Shear, near: f32, origin: [u32; 2], side_px: u32) -> Self {
        Self { tile: TileRect::new(viewport, origin, side_px), shear, near }
    }

    /// The box of lens and time that the tests in `features` leave for `triangle`, or `None` where they cull
    /// the tile. A test that bounds lens or time has its line here.
    pub fn bound(&self, features: &Features, triangle: &Triangle) -> Option<Box5> {
        let lens = !self.shear.is_none();
        let mut within = Box5::whole(lens);
        if features.lens_lines && lens {
            within = LensLines::<f64>::new(triangle, &self.shear, self.near).narrow(&self.tile, &within).0?;
        }
        // As in traversal: a still triangle before a pinhole has nothing to narrow.
        if features.side_planes && (triangle.moving || lens || triangle.behind) {
            within = narrow(triangle, &self.shear, &self.tile, &within)?;
        }
        if features.facing || features.edges {
            within.t = self.times(features, triangle, &within).hull()?;
        }
        Some(within)
    }

    /// The times at which facing and edges let the triangle be seen.
    fn times(&self, features: &Features, triangle: &Triangle, within: &Box5) -> TimePieces {
        let edges = Edges::<f64>::new(TileView::new(triangle, &self.shear, &self.tile, within));
        let mut times = TimePieces::one(Piece { t: within.t, faces: [true; 2] });
        if features.facing {
            times = Facing::new(&edges).timeline(within.t, triangle.faces, features.facing_splits).0;
        }
        if features.edges {
            times = EdgeBounds::new(&edges).timeline(&edges, &times, triangle.faces).0;
        }
        times
    }
}

/// Draws with what looks at them.
#[derive(Clone, Copy)]
pub struct Subject<'a> {
    /// The camera.
    pub camera: &'a Camera,
    /// Size of the image.
    pub viewport: Viewport,
    /// Where and when each pixel looks.
    pub samples: &'a dyn SampleSource,
    /// The draws.
    pub draws: &'a [Draw<'a>],
    /// The hardware; its features are those of each method in turn.
    pub spec: &'a PipelineSpec,
}

/// Calls `run` with the scene of `family` at `value`.
///
/// # Errors
/// When the scene cannot be made or the hardware cannot be built.
pub fn on_subject<T>(
    family: &Family,
    value: f64,
    size: Size,
    seed: u64,
    gpu: &GpuSpec,
    run: impl FnOnce(&Subject<'_>) -> Result<T, PassError>,
) -> Result<T, RunError> {
    let name = format!("{} at {value}", family.name);
    let scene = family.scene(value, size, seed).map_err(|error| RunError::invalid(&name, error))?;
    let draws = [scene.draw(&Unshaded).map_err(|error| RunError::invalid(&name, error))?];
    let (camera, viewport, samples) = (&scene.camera, scene.viewport, &scene.samples);
    let subject = Subject { camera, viewport, samples, draws: &draws, spec: &gpu.pipeline };
    run(&subject).map_err(|error| RunError::invalid(&name, error))
}

/// The triangle of each sample and the bits of its depth.
pub type SeenSamples = Vec<(u32, u32)>;

/// The most tests of a sample against a triangle that brute force may take.
const MAX_TESTS: u64 = 200_000_000;

impl Subject<'_> {
    /// Triangles that are drawn.
    pub fn triangles(&self) -> u64 {
        self.draws.iter().map(|draw| draw.geometry.triangles().len() as u64).sum()
    }

    /// The triangle that every sample sees with the tests of `features`.
    pub fn seen(&self, features: Features) -> Result<SeenSamples, PassError> {
        self.with(features, |settings| RasterPass::new(self.camera, self.draws, settings).visibility())
    }

    /// How often each event happens with the tests of `features`.
    pub fn counts(&self, features: Features) -> Result<Counts, PassError> {
        self.with(features, |settings| {
            Ok(RasterPass::new(self.camera, self.draws, settings).render(|_, _| ())?.counts)
        })
    }

    /// The triangle that every sample has to see: from all triangles against all samples where that is not
    /// too much, else from the pipeline with every test off. Also returns whether it was brute force.
    pub fn reference(&self) -> Result<(SeenSamples, bool), PassError> {
        let samples = self.viewport.pixels() as u64 * u64::from(self.samples.per_pixel());
        if samples * self.triangles() <= MAX_TESTS {
            Ok((brute_force(self.camera, self.draws, self.viewport, self.samples), true))
        } else {
            Ok((self.seen(Features::NONE)?, false))
        }
    }

    fn with<T>(&self, features: Features, run: impl FnOnce(&Settings<'_>) -> T) -> T {
        let spec = PipelineSpec { features, ..*self.spec };
        let (viewport, samples) = (self.viewport, self.samples);
        run(&Settings { spec: &spec, viewport, samples, background: Vec3::ZERO })
    }
}

/// Samples that differ: lost to another triangle, to none, or gained.
pub fn differing(a: &SeenSamples, b: &SeenSamples) -> u64 {
    a.iter().zip(b).filter(|(a, b)| a != b).count() as u64 + a.len().abs_diff(b.len()) as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_combination_is_there_once() {
        let all = combinations();
        assert_eq!(all.len(), 128);
        assert_eq!(all[0], ("-".to_owned(), Features::NONE));
        assert_eq!(all[127], ("lsfeocz".to_owned(), Features::ALL));
        for (place, one) in all.iter().enumerate() {
            assert!(all[place + 1..].iter().all(|other| other.0 != one.0 && other.1 != one.1));
        }
    }
}
