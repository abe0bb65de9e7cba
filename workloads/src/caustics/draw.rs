//! Drawing of beams into an image, and the pixels whose centre a method covers.

use std::ops::Range;

use glam::DVec3;
use pipeline::Lane;
use pipeline::conservative::{Grid, MovingTriangle, Rasterizer, Touch, View};
use pipeline::traversal::{TimeIntervals, time_interval};
use rayon::prelude::*;

use super::bound::BoundingVolume;
use super::light::{PixelInBeam, Seen};
use super::{Beam, BeamMethod, Eye, LightQuantity};

/// An image of light with its work; pixels row by row from the top left.
#[derive(Clone, Debug, PartialEq)]
pub struct LightPicture {
    /// Light of each pixel, in the unit of the requested [`LightQuantity`]; empty if none was requested.
    pub light: Vec<f64>,
    /// Shader executions of each pixel.
    pub runs: Vec<u32>,
    /// Shader executions that found light.
    pub useful: u64,
    /// Tiles of 8x8 pixels touched, by beams or faces of bounding volumes.
    pub tiles: u64,
    /// Pixels tested.
    pub tests: u64,
    /// Beams that were skipped, because they have no volume or reach behind the camera.
    pub skipped: u64,
}

/// One tile of one beam, in the order in which hardware processes it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Covered {
    /// Index of the beam.
    pub beam: u32,
    /// Tile of 8x8 pixels, row by row from the top left.
    pub tile: u32,
    /// Mask of shaded pixels, row by row.
    pub pixels: u64,
}

/// Rows of tiles per parallel task.
const BAND_TILES: u32 = 2;

impl LightPicture {
    /// Total shader executions.
    pub fn total_runs(&self) -> u64 {
        self.runs.iter().map(|runs| u64::from(*runs)).sum()
    }

    /// Share of shader executions that find light; 0 if there are none.
    pub fn useful_share(&self) -> f64 {
        self.useful as f64 / self.total_runs().max(1) as f64
    }

    /// Largest difference of a pixel's light from that in another image of the same view.
    pub fn farthest(&self, other: &Self) -> f64 {
        self.light.iter().zip(&other.light).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }
}

/// Draws `beams` by `method`. With `light`, sums the light in the order of the beams; otherwise counts
/// executions only.
pub fn draw(beams: &[Beam], eye: &Eye, method: BeamMethod, light: Option<LightQuantity>) -> LightPicture {
    draw_with_work(beams, eye, method, light, false).0
}

/// The same, with the work of every tile if `log`, sorted by beam and tile.
pub(super) fn draw_with_work(
    beams: &[Beam],
    eye: &Eye,
    method: BeamMethod,
    light: Option<LightQuantity>,
    log: bool,
) -> (LightPicture, Vec<Covered>) {
    let seen: Vec<Option<Seen>> = beams.par_iter().map(|beam| eye.see(beam)).collect();
    let rows = eye.viewport().height().div_ceil(TILE_PX);
    let bands: Vec<Band> = (0..rows.div_ceil(BAND_TILES))
        .into_par_iter()
        .map(|band| {
            let mut band =
                Band::new(eye, light.is_some(), [band * BAND_TILES, ((band + 1) * BAND_TILES).min(rows)]);
            band.draw(&seen, eye, method, light, log);
            band
        })
        .collect();
    let skipped = seen.iter().filter(|seen| seen.is_none()).count() as u64;
    let mut all =
        LightPicture { light: Vec::new(), runs: Vec::new(), useful: 0, tiles: 0, tests: 0, skipped };
    let mut work = Vec::new();
    for band in bands {
        all.light.extend(band.light);
        all.runs.extend(band.runs);
        (all.useful, all.tiles, all.tests) =
            (all.useful + band.useful, all.tiles + band.tiles, all.tests + band.tests);
        work.extend(band.work);
    }
    work.sort_by_key(|work| (work.beam, work.tile));
    (all, work)
}

/// A band of rows of tiles.
struct Band {
    rows: [u32; 2],
    light: Vec<f64>,
    runs: Vec<u32>,
    useful: u64,
    tiles: u64,
    tests: u64,
    work: Vec<Covered>,
}

impl Band {
    fn new(eye: &Eye, lit: bool, rows: [u32; 2]) -> Self {
        let height = (rows[1] * TILE_PX).min(eye.viewport().height()) - rows[0] * TILE_PX;
        let pixels = (height * eye.viewport().width()) as usize;
        let light = if lit { vec![0.0; pixels] } else { Vec::new() };
        Self { rows, light, runs: vec![0; pixels], useful: 0, tiles: 0, tests: 0, work: Vec::new() }
    }

    fn draw(
        &mut self,
        seen: &[Option<Seen>],
        eye: &Eye,
        method: BeamMethod,
        light: Option<LightQuantity>,
        log: bool,
    ) {
        let mut cover = Cover::new(eye, method, self.rows[0]..self.rows[1]);
        let columns = eye.viewport().width().div_ceil(TILE_PX);
        for (number, seen) in (0..).zip(seen) {
            let Some(seen) = seen else { continue };
            cover.each(seen, |first, pixels| {
                self.shade(eye, seen, light, first, pixels);
                if log {
                    let tile = first[1] / TILE_PX * columns + first[0] / TILE_PX;
                    self.work.push(Covered { beam: number, tile, pixels });
                }
            });
        }
        (self.tiles, self.tests) = (cover.tiles, cover.tests);
    }

    fn shade(&mut self, eye: &Eye, seen: &Seen, light: Option<LightQuantity>, first: [u32; 2], pixels: u64) {
        let mut unshaded = pixels;
        while unshaded != 0 {
            let bit = unshaded.trailing_zeros();
            unshaded &= unshaded - 1;
            let pixel = [first[0] + bit % TILE_PX, first[1] + bit / TILE_PX];
            let place = ((pixel[1] - self.rows[0] * TILE_PX) * eye.viewport().width() + pixel[0]) as usize;
            self.runs[place] += 1;
            if let Some(light) = light {
                let at = eye.pixel_centre(pixel);
                let times = Some(times(eye, seen, at));
                let found = light.shade(&Lane::default(), &PixelInBeam { eye, seen, at, times });
                self.light[place] += found;
                self.useful += u64::from(found > 0.0);
            }
        }
    }
}

/// Side of a tile in pixels.
pub(super) const TILE_PX: u32 = 8;

/// Coverage masks of rows of tiles, filled by one beam at a time.
pub(super) struct Cover<'a> {
    eye: &'a Eye,
    method: BeamMethod,
    grid: Grid,
    /// First row of pixels.
    first_row: u32,
    /// Per tile, the pixels that the current beam covers.
    masks: Vec<u64>,
    used: Vec<u32>,
    volume: BoundingVolume,
    /// Tiles tested.
    pub tiles: u64,
    /// Pixels tested.
    pub tests: u64,
}

/// Times at which the centre of a pixel is in a beam, per visible face.
pub(super) fn times(eye: &Eye, seen: &Seen, at: [f64; 2]) -> [TimeIntervals; 2] {
    time_interval(&seen.triangle, eye.shear(), at[0], at[1])
}

impl<'a> Cover<'a> {
    /// Masks for these rows of tiles of the image.
    pub fn new(eye: &'a Eye, method: BeamMethod, rows: Range<u32>) -> Self {
        let [half_width, half_height] = eye.viewport().half_px().map(f64::from);
        let (side, first_row) = (f64::from(TILE_PX), rows.start * TILE_PX);
        let columns = eye.viewport().width().div_ceil(TILE_PX);
        let count = rows.end - rows.start;
        let origin = [-half_width, f64::from(first_row) - half_height];
        let grid = Grid { origin, tile: [side; 2], columns, rows: count };
        let masks = vec![0; (columns * count) as usize];
        Self {
            eye,
            method,
            grid,
            first_row,
            masks,
            used: Vec::new(),
            volume: BoundingVolume::new(),
            tiles: 0,
            tests: 0,
        }
    }

    /// Passes every tile that the method covers to `each`, as its first pixel and a mask of 8 by 8 pixels.
    pub fn each(&mut self, seen: &Seen, mut each: impl FnMut([u32; 2], u64)) {
        match self.method {
            BeamMethod::Moving => self.moving(seen),
            method => {
                let mut volume = std::mem::take(&mut self.volume);
                method.bounding_volumes(&Lane::default(), &seen.image, &mut volume);
                volume.iter().for_each(|face| self.face(face));
                self.volume = volume;
            }
        }
        let mut used = std::mem::take(&mut self.used);
        used.sort_unstable();
        for tile in used.drain(..) {
            each(self.first_pixel(tile), std::mem::take(&mut self.masks[tile as usize]));
        }
        self.used = used;
    }

    fn first_pixel(&self, tile: u32) -> [u32; 2] {
        let [column, row] = [tile % self.grid.columns, tile / self.grid.columns];
        [column * TILE_PX, self.first_row + row * TILE_PX]
    }

    /// Rasterizes the moving triangle.
    fn moving(&mut self, seen: &Seen) {
        let [open, close] = [seen.image.open, seen.image.close].map(|end| end.map(|p| p.to_array()));
        let Some(triangle) = MovingTriangle::new(open, close) else { return };
        let rasterizer = Rasterizer::new(View::orthographic()).halving(MAX_HALVINGS).without_depths();
        let (eye, grid) = (self.eye, self.grid);
        rasterizer.rasterize(&triangle, &grid, |tile, touch| {
            let reach = reach(&Lane::default(), seen, touch);
            self.test(tile, &reach, |at| times(eye, seen, at).iter().any(|face| !face.as_slice().is_empty()));
        });
    }

    /// Rasterizes a back face of a bounding volume. A convex volume has one at each pixel that it covers; a
    /// volume that winds around a point has one behind it.
    fn face(&mut self, face: &[DVec3; 3]) {
        let edge = |i: usize, j: usize, [x, y]: [f64; 2]| {
            let (a, b) = (face[i], face[j]);
            (a.x - x) * (b.y - y) - (b.x - x) * (a.y - y)
        };
        let slack = slack(&Lane::default(), self.eye, face);
        let reach = reach_of_face(&Lane::default(), face);
        let corners = face.map(|p| p.to_array());
        // Depth increases away from the camera.
        if (face[1] - face[0]).cross(face[2] - face[0]).z <= 0.0 {
            return;
        }
        let Some(triangle) = MovingTriangle::new(corners, corners) else { return };
        let grid = self.grid;
        Rasterizer::new(View::orthographic()).without_depths().rasterize(&triangle, &grid, |tile, _| {
            self.test(tile, &reach, |at| {
                [(0, 1), (1, 2), (2, 0)].iter().all(|&(i, j)| edge(i, j, at) >= -slack)
            });
        });
    }

    /// Tests the pixels of a tile that are within reach and not yet covered.
    fn test(&mut self, [column, row]: [u32; 2], reach: &Reach, covered: impl Fn([f64; 2]) -> bool) {
        self.tiles += 1;
        let tile = row * self.grid.columns + column;
        let first = self.first_pixel(tile);
        let near = within_reach(&Lane::default(), reach, self.eye.pixel_centre(first));
        let before = self.masks[tile as usize];
        let mut mask = before;
        for bit in set_bits(near & !before & in_image(self.eye, first)) {
            self.tests += 1;
            mask |= u64::from(covered(self.eye.pixel_centre(pixel_of(first, bit)))) << bit;
        }
        if before == 0 && mask != 0 {
            self.used.push(tile);
        }
        self.masks[tile as usize] = mask;
    }
}

/// Positions of the bits of a mask, from the lowest.
pub(super) fn set_bits(mut mask: u64) -> impl Iterator<Item = u32> {
    std::iter::from_fn(move || {
        let bit = mask.trailing_zeros();
        mask &= mask.wrapping_sub(1);
        (bit < u64::BITS).then_some(bit)
    })
}

/// The pixel of a bit in the mask of a tile whose first pixel is `first`.
pub(super) fn pixel_of([x, y]: [u32; 2], bit: u32) -> [u32; 2] {
    [x + bit % TILE_PX, y + bit / TILE_PX]
}

/// Pixels of a tile that are in the image: the scissor of the pass.
pub(super) fn in_image(eye: &Eye, first: [u32; 2]) -> u64 {
    let size = [eye.viewport().width(), eye.viewport().height()];
    if (0..2).all(|axis| first[axis] + TILE_PX <= size[axis]) {
        return u64::MAX;
    }
    let is_inside = |bit: &u32| (0..2).all(|axis| pixel_of(first, *bit)[axis] < size[axis]);
    (0..u64::BITS).filter(is_inside).fold(0, |mask, bit| mask | 1 << bit)
}

/// Error of the edges of a face at a pixel by rounding.
pub(super) fn slack(lane: &Lane, eye: &Eye, face: &[DVec3; 3]) -> f64 {
    let largest = face.iter().flat_map(|p| p.abs().to_array()).fold(0.0, |most, at| lane.max(most, at));
    let side = f64::from(eye.viewport().width().max(eye.viewport().height()));
    let sum = lane.add(largest, side);
    lane.mul(lane.mul(16.0 * f64::EPSILON, sum), sum)
}

/// Most halvings of a tile's time.
pub(super) const MAX_HALVINGS: u32 = 2;

/// Bounds along x and y.
pub(super) type Reach = [[f64; 2]; 2];

/// Bounding box of the corners while a tile may be touched, with a margin for rounding.
pub(super) fn reach(lane: &Lane, seen: &Seen, touch: &Touch) -> Reach {
    let Beam { open, close, .. } = &seen.image;
    [0, 1].map(|axis| {
        let places = open.iter().zip(close).flat_map(|(open, close)| {
            let path = lane.sub(close[axis], open[axis]);
            touch.t.map(|t| lane.madd(t, path, open[axis]))
        });
        around(lane, places)
    })
}

/// Bounding box of the corners of a face, with the same margin.
pub(super) fn reach_of_face(lane: &Lane, face: &[DVec3; 3]) -> Reach {
    [0, 1].map(|axis| around(lane, face.iter().map(|corner| corner[axis])))
}

/// Least and greatest of some places, with a margin.
fn around(lane: &Lane, places: impl Iterator<Item = f64>) -> [f64; 2] {
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for at in places {
        (low, high) = (lane.min(low, at), lane.max(high, at));
    }
    let slack = lane.mul(1e-9, lane.add(1.0, lane.max(low.abs(), high.abs())));
    [lane.sub(low, slack), lane.add(high, slack)]
}

/// Pixels of a tile whose centres are within reach; `first` is the centre of its first pixel. Columns and
/// rows are compared apart, and the columns are repeated in every row that is within by a product.
pub(super) fn within_reach(lane: &Lane, reach: &Reach, first: [f64; 2]) -> u64 {
    let is_within = |axis: usize, number: u32| {
        let at = first[axis] + f64::from(number);
        let [low, high] = reach[axis];
        // Both are compared, as lanes of other tiles in the warp wait for either.
        let [is_after, is_before] = [lane.branch(at >= low), lane.branch(at <= high)];
        is_after && is_before
    };
    let bits = |axis: usize, step: u32, numbers: Range<u32>| {
        let start = numbers.start;
        let within = numbers.filter(|number| is_within(axis, *number));
        within.fold(0_u32, |mask, number| mask | 1 << ((number - start) * step))
    };
    let columns = bits(0, 1, 0..TILE_PX);
    let [upper, lower] = [0..TILE_PX / 2, TILE_PX / 2..TILE_PX]
        .map(|rows| u64::from(lane.mul_low(columns, bits(1, TILE_PX, rows))));
    lower << 32 | upper
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::caustics::generator::tests::{hit, uniform, warped};

    /// Any point of any beam is within the times found at its pixel, and in a tile that is found.
    #[test]
    fn every_point_of_a_beam_is_covered() {
        let view = [DVec3::new(0.0, 0.0, -9.0), DVec3::ZERO, DVec3::new(0.3, 1.0, 0.0)];
        let eye = Eye::new([view[0] + 4.0 * DVec3::X, view[1], view[2]], 4.0, [96, 96]).unwrap();
        let mut random = uniform(21);
        for round in 0..400 {
            let Some(seen) = eye.see(&warped(&mut random, [0.0, 0.3, 0.8, 1.5][round % 4])) else { continue };
            let mut cover = Cover::new(&eye, BeamMethod::Moving, 0..12);
            let mut tiles = Vec::new();
            let [open, close] = [seen.image.open, seen.image.close].map(|end| end.map(|p| p.to_array()));
            let triangle = MovingTriangle::new(open, close).unwrap();
            Rasterizer::new(View::orthographic())
                .rasterize(&triangle, &cover.grid, |tile, _| tiles.push(tile));
            cover.each(&seen, |_, _| ());
            for _ in 0..50 {
                let hit = hit(&mut random);
                let point = seen.image.point(&hit);
                let found = times(&eye, &seen, [point.x, point.y]);
                let near = |t: f64| {
                    found.iter().any(|set| set.as_slice().iter().any(|[lo, hi]| (lo..=hi).contains(&&t)))
                };
                assert!(
                    near(hit.t) || near(hit.t - 1e-9) || near(hit.t + 1e-9),
                    "{round}: {hit:?} {found:?}"
                );
                let tile = [point.x, point.y].map(|c| ((c + 48.0) / 8.0).floor());
                let inside = tile.iter().all(|c| (0.0..12.0).contains(c));
                assert!(!inside || tiles.contains(&tile.map(|c| c as u32)), "{round}");
            }
        }
    }

    /// Pixels within reach are those of a comparison of every centre, for boxes that hold all, some or none
    /// of a tile.
    #[test]
    fn pixels_within_reach_are_those_between_its_bounds() {
        let (first, mut some) = ([-3.5, 12.5], 0);
        let mut random = uniform(5);
        for _ in 0..500 {
            let reach = first.map(|from| {
                let ends = [(); 2].map(|()| random.within(from - 3.0, from + 10.0));
                [ends[0].min(ends[1]), ends[0].max(ends[1])]
            });
            let found = within_reach(&Lane::default(), &reach, first);
            for bit in 0..u64::BITS {
                let at = pixel_of([0, 0], bit).map(f64::from);
                let is_near =
                    (0..2).all(|axis| (reach[axis][0]..=reach[axis][1]).contains(&(first[axis] + at[axis])));
                assert_eq!(found >> bit & 1 == 1, is_near, "{reach:?} {bit}");
            }
            some += u32::from(found != 0 && found != u64::MAX);
        }
        assert!(some > 100, "{some}");
    }
}
