//! The query by intervals.

use glam::Vec3;
use pipeline::Cull;
use pipeline::depth::{Bounder, DepthBound, interval_madds, set_up_madds};
use pipeline::geometry::Projection;
use pipeline::setup::{Outcome, Triangle, bounds, madds, set_up};
use pipeline::traversal::{Box5, TileRect, narrow_counted};

use super::Pyramid;

/// A box along the axes whose corners move on straight lines.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MovingBox {
    /// Its lowest and highest corner when the shutter opens.
    pub open: [Vec3; 2],
    /// When it closes.
    pub close: [Vec3; 2],
}

/// The faces of a box, two triangles each, by the bits of its corners.
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
    /// Its triangles, by number of corner.
    pub const TRIANGLES: [[u32; 3]; 12] = FACES;

    /// The corners when the shutter opens, and when it closes.
    pub fn corners(&self) -> [[Vec3; 8]; 2] {
        [self.open, self.close].map(|[low, high]| {
            std::array::from_fn(|corner| {
                let pick = |axis: usize| if corner >> axis & 1 == 0 { low[axis] } else { high[axis] };
                Vec3::new(pick(0), pick(1), pick(2))
            })
        })
    }
}

/// What a query found, and what it took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Answer {
    /// Whether no sample can see the object.
    pub hidden: bool,
    /// Triangles set up.
    pub triangles: u64,
    /// Tiles tested, on all levels.
    pub tiles: u64,
    /// Depth intervals compared with a farthest depth, of four bytes.
    pub compared: u64,
    /// Multiply-adds of all that.
    pub madds: u64,
}

impl Answer {
    /// Tests of any kind.
    pub fn tests(&self) -> u64 {
        self.tiles + self.compared
    }

    /// Bytes of stored depth that were read.
    pub fn bytes(&self) -> u64 {
        4 * self.compared
    }
}

/// Queries against one pyramid.
#[derive(Clone, Copy, Debug)]
pub struct Queries<'a> {
    pyramid: &'a Pyramid,
    projection: &'a Projection,
    bound: DepthBound,
}

/// A triangle of a box, ready to be looked for.
struct Side {
    triangle: Triangle,
    bounder: Bounder,
}

impl<'a> Queries<'a> {
    /// Against `pyramid`, whose depths were drawn through `projection`.
    pub fn new(pyramid: &'a Pyramid, projection: &'a Projection) -> Self {
        Self { pyramid, projection, bound: DepthBound::LocalPlanes }
    }

    /// Whether the box, and with it all that is inside, is hidden. Ends as soon as a tile of the first level says no.
    pub fn ask(&self, object: &MovingBox) -> Answer {
        let mut answer = Answer::default();
        let [open, close] = object.corners();
        let vertices: [_; 8] = std::array::from_fn(|n| self.projection.vertex(open[n], close[n]));
        // Where the near plane cuts the box open, what is inside may be seen without any of its sides.
        let near = self.projection.near;
        if vertices.iter().any(|vertex| vertex.open[2] <= near || vertex.close[2] <= near) {
            return answer;
        }
        let shear = &self.projection.shear;
        let half_px = self.pyramid.viewport().half_px();
        answer.hidden = (0..).zip(FACES).all(|(id, corners)| {
            let three = corners.map(|corner| &vertices[corner as usize]);
            let Outcome::Ready(triangle) = set_up(id, three, Cull::None, shear, near, half_px) else {
                // No sample sees a triangle without area.
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

    /// Whether a triangle is hidden, beginning at the level where it touches four tiles at most.
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

    /// Whether it is hidden in a tile: there, or in all tiles in it.
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
        let (left, madds) = narrow_counted::<f64>(&side.triangle, shear, &rect, within);
        answer.madds += u64::from(madds);
        let Some(left) = left else { return true };
        if self.behind(side, level, [column, row], &rect, &left, answer) {
            return true;
        }
        if level == 0 {
            return false;
        }
        let [columns, rows] = self.pyramid.size(level - 1);
        (2 * row..(2 * row + 2).min(rows)).all(|row| {
            (2 * column..(2 * column + 2).min(columns))
                .all(|column| self.tile(side, level - 1, [column, row], &left, answer))
        })
    }

    /// Whether it lies behind all that is stored in every box of lens and time that it may touch.
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
