//! Occlusion queries, by intervals and by samples.

use activity::Event;
use glam::Vec3;
use pipeline::depth::{Bounder, DepthBound, interval_madds, set_up_madds};
use pipeline::geometry::Projection;
use pipeline::setup::{Outcome, Triangle, bounds, madds, set_up};
use pipeline::traversal::{Box5, TileRect, narrow_counted};
use pipeline::{
    Camera, Cull, Draw, Features, Geometry, PassError, PipelineSpec, RasterPass, Rendered, Settings, Target,
};

use super::Pyramid;
use crate::visibility::Unshaded;

/// An axis-aligned box whose corners move linearly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MovingBox {
    /// Lowest and highest corner at shutter open.
    pub open: [Vec3; 2],
    /// Lowest and highest corner at shutter close.
    pub close: [Vec3; 2],
}

/// Faces of a box, two triangles each; the bits of a corner index select the upper coordinate of an axis.
const FACES: [[u32; 3]; 12] = [
    [0, 2, 3],
    [0, 3, 1],
    [4, 5, 7],
    [4, 7, 6],
    [0, 1, 5],
    [0, 5, 4],
    [2, 6, 7],
    [2, 7, 3],
    [0, 4, 6],
    [0, 6, 2],
    [1, 3, 7],
    [1, 7, 5],
];

impl MovingBox {
    /// Triangles, by corner index.
    pub const TRIANGLES: [[u32; 3]; 12] = FACES;

    /// Corners at shutter open and at shutter close.
    pub fn corners(&self) -> [[Vec3; 8]; 2] {
        [self.open, self.close].map(|[low, high]| {
            std::array::from_fn(|corner| {
                let pick = |axis: usize| if corner >> axis & 1 == 0 { low[axis] } else { high[axis] };
                Vec3::new(pick(0), pick(1), pick(2))
            })
        })
    }
}

/// Result and cost of an interval query.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Answer {
    /// Whether the object is hidden from all samples.
    pub hidden: bool,
    /// Triangles set up.
    pub triangles: u64,
    /// Tiles tested, on all levels.
    pub tiles: u64,
    /// Depth intervals compared with a farthest depth of four bytes.
    pub compared: u64,
    /// Multiply-adds of the whole query.
    pub madds: u64,
}

impl Answer {
    /// Number of tests.
    pub fn tests(&self) -> u64 {
        self.tiles + self.compared
    }

    /// Bytes of stored depth read.
    pub fn bytes(&self) -> u64 {
        4 * self.compared
    }
}

/// Interval queries against one pyramid.
#[derive(Clone, Copy, Debug)]
pub struct Queries<'a> {
    pyramid: &'a Pyramid,
    projection: &'a Projection,
    bound: DepthBound,
}

/// A triangle of a box, after set-up.
struct Side {
    triangle: Triangle,
    bounder: Bounder,
}

impl<'a> Queries<'a> {
    /// Makes queries against `pyramid`, whose depths were drawn through `projection`.
    pub fn new(pyramid: &'a Pyramid, projection: &'a Projection) -> Self {
        Self { pyramid, projection, bound: DepthBound::LocalPlanes }
    }

    /// Whether the box, and everything inside, is hidden. Ends at the first tile of the first level that may
    /// see it.
    pub fn ask(&self, object: &MovingBox) -> Answer {
        let mut answer = Answer::default();
        let [open, close] = object.corners();
        let vertices: [_; 8] = std::array::from_fn(|n| self.projection.vertex(open[n], close[n]));
        // If the near plane clips the box, its content may be visible without its sides.
        let near = self.projection.near;
        if vertices.iter().any(|vertex| vertex.open[2] <= near || vertex.close[2] <= near) {
            return answer;
        }
        let shear = &self.projection.shear;
        let half_px = self.pyramid.viewport().half_px();
        answer.hidden = (0..).zip(FACES).all(|(id, corners)| {
            let three = corners.map(|corner| &vertices[corner as usize]);
            let Outcome::Ready(triangle) = set_up(id, three, Cull::None, shear, near, half_px) else {
                // A triangle without area is invisible.
                return true;
            };
            answer.triangles += 1;
            answer.madds +=
                u64::from(madds(triangle.moving, Cull::None) + set_up_madds(self.bound, triangle.moving));
            let bounder = Bounder::new(&triangle, shear, self.bound);
            self.triangle(&Side { triangle, bounder }, &mut answer)
        });
        answer
    }

    /// Whether a triangle is hidden, starting at the level where it touches four tiles at most.
    fn triangle(&self, side: &Side, answer: &mut Answer) -> bool {
        let pixels = bounds(&side.triangle, &self.projection.shear, self.pyramid.viewport());
        if pixels.is_empty() {
            return true;
        }
        let tiles = |level: usize| pixels.tiles(self.pyramid.side_px(level));
        let few = |level: &usize| {
            tiles(*level).x1 - tiles(*level).x0 <= 2 && tiles(*level).y1 - tiles(*level).y0 <= 2
        };
        let level = (0..self.pyramid.levels()).find(few).unwrap_or(self.pyramid.levels() - 1);
        let (tiles, whole) = (tiles(level), Box5::whole(!self.projection.shear.is_none()));
        (tiles.y0..tiles.y1).all(|row| {
            (tiles.x0..tiles.x1).all(|column| self.tile(side, level, [column, row], &whole, answer))
        })
    }

    /// Whether the triangle is hidden in a tile, directly or in all of its child tiles.
    fn tile(
        &self,
        side: &Side,
        level: usize,
        [column, row]: [u32; 2],
        within: &Box5,
        answer: &mut Answer,
    ) -> bool {
        let (shear, px) = (&self.projection.shear, self.pyramid.side_px(level));
        let rect = TileRect::new(self.pyramid.viewport(), [column * px, row * px], px);
        answer.tiles += 1;
        let (narrowed, madds) = narrow_counted::<f64>(&side.triangle, shear, &rect, within);
        answer.madds += u64::from(madds);
        let Some(narrowed) = narrowed else { return true };
        if self.behind(side, level, [column, row], &rect, &narrowed, answer) {
            return true;
        }
        if level == 0 {
            return false;
        }
        let [columns, rows] = self.pyramid.size(level - 1);
        (2 * row..(2 * row + 2).min(rows)).all(|row| {
            (2 * column..(2 * column + 2).min(columns))
                .all(|column| self.tile(side, level - 1, [column, row], &narrowed, answer))
        })
    }

    /// Whether the triangle is behind the stored depths in every box of lens and time that it may touch.
    fn behind(
        &self,
        side: &Side,
        level: usize,
        tile: [u32; 2],
        rect: &TileRect,
        within: &Box5,
        answer: &mut Answer,
    ) -> bool {
        let madds = interval_madds(self.bound, side.triangle.moving, within.lens);
        self.pyramid.grid().overlapping(within).all(|(index, part)| {
            answer.compared += 1;
            answer.madds += u64::from(madds);
            side.bounder.over(rect, &part)[0] > self.pyramid.farthest(level, tile, index)
        })
    }
}

/// The depth buffer that sampled queries are compared with.
#[derive(Clone, Copy, Debug)]
pub struct Samples<'a> {
    /// The camera.
    pub camera: &'a Camera,
    /// The hardware and the samples.
    pub settings: &'a Settings<'a>,
    /// Depth of every sample in the order `(y width + x) per_pixel + index`, infinite for no hit.
    pub depths: &'a [f32],
}

/// Result and cost of a sampled query.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SampledAnswer {
    /// Samples that pass the depth test.
    pub passed: u64,
    /// Samples tested.
    pub tested: u64,
    /// Tiles tested.
    pub tiles: u64,
    /// Samples inside the box, each of which reads a stored depth of four bytes.
    pub hit: u64,
    /// Multiply-adds of the whole query.
    pub madds: u64,
}

impl SampledAnswer {
    /// Number of tests, including depth tests.
    pub fn tests(&self) -> u64 {
        self.tested + self.tiles + self.hit
    }

    /// Bytes of stored depth read.
    pub fn bytes(&self) -> u64 {
        4 * self.hit
    }
}

/// Depth of every sample of `draws`, as [`Samples`] needs it.
///
/// # Errors
/// [`PassError`] if the hardware cannot draw it.
pub fn depths(camera: &Camera, draws: &[Draw<'_>], settings: &Settings<'_>) -> Result<Vec<f32>, PassError> {
    Ok(RasterPass::new(camera, draws, settings).visibility()?.into_iter().map(depth).collect())
}

/// Depth of a visible sample.
fn depth((_, bits): (u32, u32)) -> f32 {
    f32::from_bits(bits)
}

impl Samples<'_> {
    /// Counts the samples that see the box, by drawing it alone.
    ///
    /// # Errors
    /// [`PassError`] if the hardware cannot draw it.
    pub fn ask(&self, object: &MovingBox) -> Result<SampledAnswer, PassError> {
        let [open, close] = object.corners();
        // A geometry is refused only for values that are not finite, which are invisible.
        let Ok(geometry) = Geometry::new(&open, &close, &MovingBox::TRIANGLES) else {
            return Ok(SampledAnswer::default());
        };
        let draws = [Draw::new(geometry, &Unshaded, Cull::None)];
        // A sampled query has no stored depths of tiles.
        let features = Features { z_max: false, ..self.settings.spec.features };
        let spec = PipelineSpec { features, ..*self.settings.spec };
        let settings = Settings { spec: &spec, ..*self.settings };
        let pass = RasterPass::new(self.camera, &draws, &settings).onto(Target::Depth).with_visible();
        let Rendered { visible: own, counts, .. } = pass.render(|_, _| ())?;
        let passes = |(own, stored): &(f32, &f32)| own.is_finite() && own <= stored;
        let passed = own.into_iter().map(depth).zip(self.depths).filter(passes).count() as u64;
        let all = |events: &[Event]| events.iter().map(|event| counts[*event]).sum();
        Ok(SampledAnswer {
            passed,
            tested: counts[Event::SamplesTested] + counts[Event::SamplesScreened],
            tiles: all(&[Event::TilesVisited, Event::CoarseTilesVisited]),
            hit: counts[Event::SamplesHit],
            madds: all(&[Event::SetupMadds, Event::TileMadds, Event::ScreenMadds, Event::SampleMadds]),
        })
    }
}
