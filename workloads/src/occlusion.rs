//! Occlusion queries in 5D (thesis, Paper VI, section 3).
//!
//! A query tests whether an object is hidden behind the drawn scene, at all times and from all of the lens. A
//! *sampled* query draws the object's bounding box and counts the samples that pass the depth test. An
//! *interval* query uses no samples. In each tile, the tile test gives a box of lens and time and a depth
//! interval, which is compared with the farthest stored depths of the tile. Both answer for the samples of
//! the image.
//!
//! The queries are in the pipeline ([`pipeline::IntervalQueries`], [`pipeline::SampledQueries`]), which counts their
//! work. *An interval query never reports a visible object as hidden.*
//!
//! - [`depths_of`]: depths of samples, of which a [`pipeline::depth::Pyramid`] is made.
//! - [`WallScene`]: walls, solid or slatted, with boxes behind them; [`job()`]: `quintile run occlusion`.

use std::sync::Arc;

use glam::{Affine3A, Vec3, Vec4};
use pipeline::depth::{BoxGrid, Pyramid};
use pipeline::geometry::Projection;
use pipeline::random::{mix, unit_single};
use pipeline::sampling::SampleSource;
use pipeline::{
    Camera, Cull, Draw, DrawError, Geometry, Gpu, IntervalAnswer, IntervalQueries, Lane, Lens, MovingBox,
    Query, RasterPass, SampledAnswer, Shader, ShadingPoint, Target, Viewport,
};
use serde::{Deserialize, Serialize};
use warnings::{Code, Warning};

use crate::error::LoadError;
use crate::job::{
    Drawn, Draws, Fact, Flag, Flags, Job, JobError, JobOptions, JobRequest, Need, OptionSource, facts,
    must_hold,
};
use crate::samples::SampleChoice;
use crate::scene::SceneSettings;

/// Kind of the queries.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum QueryKind {
    /// Intervals of lens, time and depth.
    #[default]
    Intervals,
    /// Whether any sample passes.
    Any,
    /// How many samples pass.
    Samples,
}

/// Options of the job: walls, boxes behind them, and the queries.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct OcclusionOptions {
    /// Number of walls, 0 to 1000.
    pub walls: u32,
    /// Slats per wall, 1 to 1000.
    pub slats: u32,
    /// Share of a wall that is gaps between slats, 0 to 1.
    pub gaps: f32,
    /// Number of boxes, 0 to 100000.
    pub objects: u32,
    /// Motion of walls during the shutter, in metres; a wall is 3 wide.
    pub motion: f32,
    /// Radius of the lens in metres, 0 to 1; it is focused in front of everything.
    pub lens: f32,
    /// Kind of the queries.
    pub query: QueryKind,
    /// Side of a tile of the first level in pixels, 1 to 256.
    pub tile_px: u32,
    /// Boxes of lens and time per tile, along u, v and t, 1 to 16 each.
    pub boxes: [u32; 3],
}

impl JobOptions for OcclusionOptions {
    const NEEDS: &'static [Need] =
        &[Need::new("tile_px", "query", &["intervals"]), Need::new("boxes", "query", &["intervals"])];
}

impl Default for OcclusionOptions {
    fn default() -> Self {
        Self {
            walls: 12,
            slats: 1,
            gaps: 0.0,
            objects: 96,
            motion: 1.0,
            lens: 0.0,
            query: QueryKind::default(),
            tile_px: 8,
            boxes: [1, 1, 8],
        }
    }
}

impl OcclusionOptions {
    fn check(&self) -> Result<(), LoadError> {
        must_hold([
            ("walls", &self.walls, self.walls <= 1000, "0 to 1000"),
            ("slats", &self.slats, (1..=1000).contains(&self.slats), "1 to 1000"),
            ("gaps", &self.gaps, (0.0..=1.0).contains(&self.gaps), "0 to 1"),
            ("objects", &self.objects, self.objects <= 100_000, "0 to 100000"),
            ("motion", &self.motion, (0.0..=100.0).contains(&self.motion), "0 to 100 metres"),
            ("lens", &self.lens, (0.0..=1.0).contains(&self.lens), "0 to 1 metre"),
            ("tile_px", &self.tile_px, (1..=256).contains(&self.tile_px), "1 to 256 pixels"),
            (
                "boxes",
                &self.boxes,
                BoxGrid::new(self.boxes, true).is_some(),
                "1 to 16 along each of u, v and t",
            ),
        ])
    }
}

/// The job and its scene.
struct Occlusion {
    options: OcclusionOptions,
    settings: SceneSettings,
    samples: Arc<dyn SampleSource>,
    wall_scene: WallScene,
}

facts! {
    objects "count" "boxes that are queried"
    objects_hidden "count" "of these, those that their query finds hidden"
    tests "count" "tests of all queries: of tiles, samples and depths"
    depth_bytes "bytes" "stored depths that the queries read"
}

/// Run options in use. The scene has its own lens and motion.
pub(crate) const FLAGS: Flags = Flags {
    uses: &[Flag::Size, Flag::Samples, Flag::Table],
    instead: &[(Flag::Lens, "lens"), (Flag::Shutter, "motion")],
};

/// Makes the job `occlusion`.
///
/// # Errors
/// [`LoadError`] for an invalid option or setting.
pub fn job(options: &OptionSource, request: &JobRequest<'_>) -> Result<Box<dyn Job>, LoadError> {
    let options: OcclusionOptions = options.read()?;
    options.check()?;
    let settings = SceneSettings { width: 512, height: 288, samples: 16, ..SceneSettings::default() };
    let settings = settings.with(request.overrides)?;
    let samples = SampleChoice::load(&settings.table)?.source(settings.samples, request.seed)?.into();
    let OcclusionOptions { walls, slats, gaps, objects, motion, lens, .. } = options;
    let spec = WallSceneSpec { walls, slats, gaps, boxes: objects, motion, lens, seed: request.seed };
    let refused =
        || LoadError::Setting { setting: "lens", message: format!("{lens}: it has to be 0 to 1 metre") };
    let wall_scene = spec.wall_scene().ok_or_else(refused)?;
    Ok(Box::new(Occlusion { options, settings, samples, wall_scene }))
}

/// Share of half-covered tiles above which a warning is given. Small occluders hide objects together, which a
/// farthest depth per tile cannot detect.
pub const MAX_HALF_COVERED_SHARE: f64 = 0.25;

impl Draws for Occlusion {
    /// All frames show the same shutter interval.
    type Input = ();

    fn settings(&self) -> &SceneSettings {
        &self.settings
    }

    fn input(&self, _: u32) -> Result<(), JobError> {
        Ok(())
    }

    fn draw(&self, (): &(), gpu: &mut Gpu<'_>) -> Result<Drawn, JobError> {
        let viewport = Viewport::new(self.settings.width, self.settings.height)
            .ok_or_else(|| JobError::setting("the image has no area"))?;
        let background = Vec3::new(0.02, 0.03, 0.05);
        let settings = pipeline::Settings { spec: gpu.spec(), viewport, samples: &*self.samples, background };
        let walls = gpu.resident(&[self.wall_scene.walls(&WALL).map_err(JobError::setting)?]);
        let camera = &self.wall_scene.camera;
        let occluders = RasterPass::new(camera, &walls, &settings).named("occluders").onto(Target::Depth);
        let answers = match self.options.query {
            QueryKind::Intervals => self.by_intervals(gpu, &occluders.with_visible())?,
            QueryKind::Any => self.by_samples(gpu, &occluders, Query::Any)?,
            QueryKind::Samples => self.by_samples(gpu, &occluders, Query::Count)?,
        };
        // The host draws what is not hidden.
        gpu.wait();
        let seen = self.wall_scene.boxes.iter().zip(&answers.hidden).filter(|(_, hidden)| !**hidden);
        let Mesh { open, close, triangles } = mesh(&seen.map(|(object, _)| object).collect::<Vec<_>>());
        let boxes = Geometry::new(&open, &close, &triangles).map_err(JobError::setting)?;
        let draws = [walls[0], Draw::new(boxes, &BOX, Cull::None)];
        let image = gpu.draw(&RasterPass::new(camera, &draws, &settings).named("image"))?.into_image();
        Ok(Drawn {
            image,
            moving: self.options.motion > 0.0,
            lens: camera.lens().is_some(),
            facts: answers.facts(),
            warnings: answers.warnings,
        })
    }
}

impl Occlusion {
    fn by_intervals(&self, gpu: &mut Gpu<'_>, occluders: &RasterPass<'_>) -> Result<Answers, JobError> {
        let viewport = occluders.settings.viewport;
        let drawn = gpu.draw(occluders)?;
        let pyramid = self.pyramid(&depths_of(&drawn.visible), viewport)?;
        gpu.gather_farthest_depths("farthest depths", &pyramid, drawn.region)?;
        let projection = Projection::new(&self.wall_scene.camera, viewport);
        let queries = IntervalQueries::new(&pyramid, &projection);
        let answers = gpu.query_boxes("queries", &queries, &self.wall_scene.boxes)?;
        Ok(Answers::of_intervals(&answers, pyramid.half_covered()))
    }

    /// The boxes follow the occluders in one pass.
    fn by_samples(
        &self,
        gpu: &mut Gpu<'_>,
        occluders: &RasterPass<'_>,
        query: Query,
    ) -> Result<Answers, JobError> {
        let pass = occluders.named("occluders and queries");
        Ok(Answers::of_samples(&gpu.query_samples(&pass, query, &self.wall_scene.boxes)?))
    }

    fn pyramid(&self, depths: &[f32], viewport: Viewport) -> Result<Pyramid, JobError> {
        let grid = BoxGrid::new(self.options.boxes, self.wall_scene.camera.lens().is_some())
            .ok_or_else(|| JobError::setting("boxes: 1 to 16 along each axis"))?;
        Ok(Pyramid::new(viewport, &*self.samples, depths, self.options.tile_px, grid))
    }
}

struct Mesh {
    open: Vec<Vec3>,
    close: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
}

fn mesh(boxes: &[&MovingBox]) -> Mesh {
    let mut mesh = Mesh { open: Vec::new(), close: Vec::new(), triangles: Vec::new() };
    for object in boxes {
        let (first, [open, close]) = (mesh.open.len() as u32, object.corners());
        mesh.open.extend(open);
        mesh.close.extend(close);
        mesh.triangles.extend(MovingBox::TRIANGLES.map(|three| three.map(|corner| first + corner)));
    }
    mesh
}

/// Answers of all queries.
struct Answers {
    hidden: Vec<bool>,
    tests: u64,
    depth_bytes: u64,
    warnings: Vec<Warning>,
}

impl Answers {
    fn of_intervals(answers: &[IntervalAnswer], half_covered: f64) -> Self {
        Self {
            hidden: answers.iter().map(|answer| answer.hidden).collect(),
            tests: answers.iter().map(IntervalAnswer::tests).sum(),
            depth_bytes: answers.iter().map(IntervalAnswer::bytes).sum(),
            warnings: warnings(answers, half_covered),
        }
    }

    fn of_samples(answers: &[SampledAnswer]) -> Self {
        Self {
            hidden: answers.iter().map(|answer| answer.passed == 0).collect(),
            tests: answers.iter().map(SampledAnswer::tests).sum(),
            depth_bytes: answers.iter().map(SampledAnswer::bytes).sum(),
            warnings: Vec::new(),
        }
    }

    fn facts(&self) -> Vec<Fact> {
        let hidden = self.hidden.iter().filter(|hidden| **hidden).count();
        Fact::all([
            (fact::objects, self.hidden.len() as f64),
            (fact::objects_hidden, hidden as f64),
            (fact::tests, self.tests as f64),
            (fact::depth_bytes, self.depth_bytes as f64),
        ])
    }
}

fn warnings(answers: &[IntervalAnswer], half_covered: f64) -> Vec<Warning> {
    let message = || {
        format!(
            "{:.0} % of the tiles are covered for most of their samples, but not for all (a warning from {:.0} % on): many small occluders hide \
             objects together, and a farthest depth for each tile does not know it; smaller tiles and more boxes of lens and time help",
            100.0 * half_covered,
            100.0 * MAX_HALF_COVERED_SHARE
        )
    };
    // Without queries there are no false positives.
    (half_covered > MAX_HALF_COVERED_SHARE && !answers.is_empty())
        .then(|| Warning::new(Code::OcclusionSmallOccluders, message()))
        .into_iter()
        .collect()
}

/// A diffuse colour, lit from the camera.
struct Headlight(Vec3);

const WALL: Headlight = Headlight(Vec3::new(0.55, 0.5, 0.42));
const BOX: Headlight = Headlight(Vec3::new(0.75, 0.25, 0.12));

impl Shader for Headlight {
    fn shade(&self, lane: &Lane, at: &ShadingPoint, _: Vec4) -> Vec4 {
        let facing = lane.dot(at.normal, at.to_camera).abs();
        lane.scale(self.0, lane.madd(0.75, facing, 0.25)).extend(1.0)
    }
}

/// Parameters of a wall scene. Lengths are in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WallSceneSpec {
    /// Number of walls, 8 metres away.
    pub walls: u32,
    /// Slats per wall.
    pub slats: u32,
    /// Share of a wall that is gaps between slats.
    pub gaps: f32,
    /// Number of boxes, most of them behind a wall.
    pub boxes: u32,
    /// Motion of walls during the shutter, to either side. The boxes behind a wall follow it in the image.
    pub motion: f32,
    /// Radius of the lens, which is focused at 2 metres; 0 is a pinhole.
    pub lens: f32,
    /// Seed of all positions.
    pub seed: u64,
}

/// A wall scene.
#[derive(Clone, Debug)]
pub struct WallScene {
    /// The camera.
    pub camera: Camera,
    /// Corners of the walls at shutter open.
    pub open: Arc<[Vec3]>,
    /// Corners of the walls at shutter close.
    pub close: Arc<[Vec3]>,
    /// Triangles of the walls.
    pub triangles: Vec<[u32; 3]>,
    /// The boxes.
    pub boxes: Vec<MovingBox>,
}

/// Distance of the walls.
const DISTANCE: f32 = 8.0;
/// Half the side of a wall.
const HALF_SIDE: f32 = 1.5;
/// Focus depth of the lens.
const FOCUS: f32 = 2.0;

impl WallScene {
    /// The draw of the walls with `shader`.
    ///
    /// # Errors
    /// [`DrawError`] if a coordinate is not finite.
    pub fn walls<'a>(&'a self, shader: &'a dyn Shader) -> Result<Draw<'a>, DrawError> {
        Ok(Draw::new(Geometry::new(&self.open, &self.close, &self.triangles)?, shader, Cull::None))
    }
}

impl WallSceneSpec {
    /// Makes the scene; `None` if the lens or the gaps are invalid.
    pub fn wall_scene(&self) -> Option<WallScene> {
        let finite = self.motion.is_finite() && (0.0..=1.0).contains(&self.gaps);
        let lens = match self.lens {
            0.0 => None,
            radius => Some(Lens::new(radius, FOCUS).ok()?),
        };
        let camera = Camera::new(Affine3A::IDENTITY, 0.5, 0.1).ok()?.with_lens(lens);
        let (mut open, mut close, mut triangles) = (Vec::new(), Vec::new(), Vec::new());
        for wall in 0..self.walls {
            let (middle, half_motion) = self.wall(wall);
            for slat in 0..self.slats.max(1) {
                let width = 2.0 * HALF_SIDE / self.slats.max(1) as f32;
                let left = middle.x - HALF_SIDE + slat as f32 * width;
                let (right, first) = (left + width * (1.0 - self.gaps), open.len() as u32);
                let corner = |x: f32, y: f32| Vec3::new(x, y, middle.z);
                let [low, high] = [middle.y - HALF_SIDE, middle.y + HALF_SIDE];
                let four = [corner(left, low), corner(right, low), corner(left, high), corner(right, high)];
                open.extend(four.map(|p| p - half_motion));
                close.extend(four.map(|p| p + half_motion));
                triangles.extend([[first, first + 1, first + 3], [first, first + 3, first + 2]]);
            }
        }
        let boxes = (0..self.boxes).map(|n| self.moving_box(n)).collect();
        finite.then_some(WallScene { camera, open: open.into(), close: close.into(), triangles, boxes })
    }

    fn uniform(&self, of: u64, n: u32, low: f32, high: f32) -> f32 {
        let word = mix(mix(self.seed ^ of << 32) ^ u64::from(n));
        low + (high - low) * unit_single(word)
    }

    /// Centre of a wall, and half of its motion.
    fn wall(&self, n: u32) -> (Vec3, Vec3) {
        let middle = Vec3::new(self.uniform(1, n, -6.0, 6.0), self.uniform(2, n, -2.5, 2.5), DISTANCE);
        let side = if n.is_multiple_of(2) { 1.0 } else { -1.0 };
        (middle, Vec3::X * 0.5 * self.motion * side)
    }

    /// A box near the line from the camera through a wall, up to twice as far. It follows the wall in the
    /// image and does not rotate.
    fn moving_box(&self, n: u32) -> MovingBox {
        let (middle, half_motion) =
            if self.walls > 0 { self.wall(n % self.walls) } else { (Vec3::Z * DISTANCE, Vec3::ZERO) };
        let farther = self.uniform(3, n, 1.3, 2.0);
        let aside = Vec3::new(self.uniform(4, n, -1.6, 1.6), self.uniform(5, n, -1.6, 1.6), 0.0);
        let half = Vec3::splat(self.uniform(6, n, 0.1, 0.6));
        let (at, half_motion) = ((middle + aside) * farther, half_motion * farther);
        let about = |at: Vec3| [at - half, at + half];
        MovingBox { open: about(at - half_motion), close: about(at + half_motion) }
    }
}

/// Depths of visible samples, as [`pipeline::Rendered::visible`] has them.
pub fn depths_of(visible: &[(u32, u32)]) -> Vec<f32> {
    visible.iter().map(|(_, bits)| f32::from_bits(*bits)).collect()
}
