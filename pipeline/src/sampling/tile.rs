//! Samples of one tile, in the layout of the sample test.

use super::{Sample, SampleSource, SampleTable};
use crate::geometry::{Shear, Viewport};

/// Samples of one tile as arrays, sorted by time so that a time interval is a contiguous range. Arrays are
/// padded to whole blocks of [`TileSamples::LANES`]; the time of padding is outside all intervals.
#[derive(Clone, Debug, Default)]
pub struct TileSamples {
    /// Samples without padding.
    pub len: usize,
    /// Image position in pixels from the centre of the image.
    pub x: Vec<f32>,
    /// Image position in pixels from the centre of the image, downwards.
    pub y: Vec<f32>,
    /// Image position from the middle of the part of the tile in the image, as the sample table of the hardware keeps it.
    pub from_middle: [Vec<f32>; 2],
    /// Lens position.
    pub u: Vec<f32>,
    /// Lens position.
    pub v: Vec<f32>,
    /// Time over the shutter.
    pub t: Vec<f32>,
    /// Depth-independent offset of a vertex: `u s.x` and `v s.y`, in an orthographic view `x + u s.x` and `y
    /// + v s.y`.
    pub lens: [Vec<f32>; 2],
    /// Factor of a vertex's depth: `x - u a.x` and `y - v a.y`, in an orthographic view `-u a.x` and `-v
    /// a.y`.
    pub slope: [Vec<f32>; 2],
    /// Whether the view is orthographic.
    pub parallel: bool,
    /// Pixel in the tile, row by row.
    pub pixel: Vec<u8>,
    order: Vec<u16>,
    gathered: Vec<Sample>,
}

impl TileSamples {
    /// Samples tested together.
    pub const LANES: usize = 16;
    /// Time of padding.
    const PADDING_TIME: f32 = f32::INFINITY;

    /// Fill the arrays for the tile of `side_px` pixels (at most 8) whose first pixel is `(px, py)`. Pixels
    /// outside the viewport have no samples.
    pub fn fill(
        &mut self,
        source: &dyn SampleSource,
        viewport: Viewport,
        shear: &Shear,
        [px, py]: [u32; 2],
        side_px: u32,
    ) {
        let per_pixel = source.per_pixel();
        let inside = [side_px.min(viewport.width() - px), side_px.min(viewport.height() - py)];
        self.gather(source, [px, py], inside, side_px);
        self.sort_by_time(source, [px, py], inside, side_px);
        (self.len, self.parallel) = (self.order.len(), shear.parallel);
        self.resize(self.len.next_multiple_of(Self::LANES));
        let sides = [viewport.width(), viewport.height()];
        let middle = [(px, inside[0], sides[0]), (py, inside[1], sides[1])].map(|(first, count, side)| {
            0.5 * (Viewport::edge(first, side) + Viewport::edge(first + count, side))
        });
        for slot in 0..self.len {
            let index = u32::from(self.order[slot]);
            let (pixel, s) = (index / per_pixel, self.gathered[index as usize]);
            let x = Viewport::edge(px + pixel % side_px, viewport.width()) + s.x;
            let y = Viewport::edge(py + pixel / side_px, viewport.height()) + s.y;
            (self.x[slot], self.y[slot]) = (x, y);
            [self.from_middle[0][slot], self.from_middle[1][slot]] = [x - middle[0], y - middle[1]];
            (self.u[slot], self.v[slot], self.t[slot]) = (s.u, s.v, s.t);
            for (axis, at, place) in [(0, x, s.u), (1, y, s.v)] {
                [self.slope[axis][slot], self.lens[axis][slot]] = shear.ray(axis, at, place);
            }
            self.pixel[slot] = pixel as u8;
        }
    }

    /// Samples of the tile's pixels inside the image, each at its pixel times `per_pixel` plus its index.
    fn gather(
        &mut self,
        source: &dyn SampleSource,
        [px, py]: [u32; 2],
        [columns, rows]: [u32; 2],
        side_px: u32,
    ) {
        let per_pixel = source.per_pixel() as usize;
        self.gathered.resize((side_px * side_px) as usize * per_pixel, Sample::default());
        for row in 0..rows {
            for column in 0..columns {
                let first = (row * side_px + column) as usize * per_pixel;
                source.pixel_into(px + column, py + row, &mut self.gathered[first..first + per_pixel]);
            }
        }
    }

    fn sort_by_time(
        &mut self,
        source: &dyn SampleSource,
        [px, py]: [u32; 2],
        inside: [u32; 2],
        side_px: u32,
    ) {
        self.order.clear();
        if [side_px; 2] == inside
            && side_px == SampleTable::SHIFT_PX
            && let Some(order) = source.block_by_time(px, py)
        {
            self.order.extend(order);
            return;
        }
        let per_pixel = source.per_pixel();
        for row in 0..inside[1] {
            for column in 0..inside[0] {
                let first = (row * side_px + column) * per_pixel;
                self.order.extend((first..first + per_pixel).map(|index| index as u16));
            }
        }
        // Times are not negative, so their bits sort as they do; the sort is stable, so the index breaks
        // ties.
        self.order.sort_by_key(|&index| self.gathered[index as usize].t.to_bits());
    }

    /// Index in the whole image of the sample in `slot` of the tile of `side_px` pixels whose first pixel is
    /// `(px, py)`: `(y width + x) per_pixel + index`.
    pub fn in_image(
        &self,
        slot: usize,
        [px, py]: [u32; 2],
        side_px: u32,
        viewport: Viewport,
        per_pixel: u32,
    ) -> usize {
        let index = u32::from(self.order[slot]);
        let (pixel, sample) = (index / per_pixel, index % per_pixel);
        let [x, y] = [px + pixel % side_px, py + pixel / side_px].map(|c| c as usize);
        (y * viewport.width() as usize + x) * per_pixel as usize + sample as usize
    }

    /// Index in its pixel of the sample in `slot`, of `per_pixel`.
    pub fn in_pixel(&self, slot: usize, per_pixel: u32) -> u32 {
        u32::from(self.order[slot]) % per_pixel
    }

    fn resize(&mut self, padded: usize) {
        let [lens_x, lens_y] = &mut self.lens;
        let [slope_x, slope_y] = &mut self.slope;
        let [near_x, near_y] = &mut self.from_middle;
        let of_image = [&mut self.x, &mut self.y, near_x, near_y, slope_x, slope_y];
        for array in of_image.into_iter().chain([&mut self.u, &mut self.v, lens_x, lens_y]) {
            array.clear();
            array.resize(padded, 0.0);
        }
        self.t.clear();
        self.t.resize(padded, Self::PADDING_TIME);
        self.pixel.clear();
        self.pixel.resize(padded, 0);
    }

    /// Range of samples with `lo <= t <= hi`.
    pub fn between(&self, lo: f32, hi: f32) -> std::ops::Range<usize> {
        let times = &self.t[..self.len];
        times.partition_point(|&t| t < lo)..times.partition_point(|&t| t <= hi)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::LensShape;

    #[test]
    fn a_tile_holds_each_sample_of_its_pixels_once() {
        let table = SampleTable::low_discrepancy(5, 1, LensShape::Disk).unwrap();
        let viewport = Viewport::new(20, 11).unwrap();
        let mut tile = TileSamples::default();
        tile.fill(&table, viewport, &Shear::default(), [16, 8], 8);
        assert_eq!(tile.len, 4 * 3 * 5);
        assert_eq!(tile.t.len() % TileSamples::LANES, 0);
        assert!(tile.t[..tile.len].is_sorted());
        for slot in 0..tile.len {
            let (column, row) = (16 + u32::from(tile.pixel[slot]) % 8, 8 + u32::from(tile.pixel[slot]) / 8);
            let here = table.pixel(column, row);
            assert!(here.iter().any(|s| s.t == tile.t[slot] && column as f32 - 10.0 + s.x == tile.x[slot]));
        }
    }

    #[test]
    fn a_time_interval_is_a_run() {
        let table = SampleTable::low_discrepancy(8, 1, LensShape::Disk).unwrap();
        let mut tile = TileSamples::default();
        tile.fill(&table, Viewport::new(64, 64).unwrap(), &Shear::default(), [8, 8], 8);
        let run = tile.between(0.25, 0.5);
        let inside = tile.t[..tile.len].iter().filter(|t| (0.25..=0.5).contains(*t)).count();
        assert_eq!(run.len(), inside);
        assert!(tile.t[run].iter().all(|t| (0.25..=0.5).contains(t)));
    }
}
