//! Dividing the samples of a bin into cells and packets.

use super::bin::{BinSamples, Boxes, CellBoxes, CellRange, NOTHING, Packet};
use super::plan::{Axis, Plan};
use crate::geometry::{Clip, Shear, Viewport};
use crate::sampling::{Sample, SampleSource};
use crate::simd::LANES;

/// A sample on its way into a packet.
#[derive(Clone, Copy, Debug, Default)]
struct Placed {
    x: f32,
    y: f32,
    u: f32,
    v: f32,
    t: f32,
    place: u32,
}

impl Placed {
    fn along(&self, axis: Axis) -> f32 {
        match axis {
            Axis::X => self.x,
            Axis::Y => self.y,
            Axis::U => self.u,
            Axis::V => self.v,
            Axis::T => self.t,
        }
    }
}

/// Sorts the samples of a bin.
pub(super) struct Sorter<'a> {
    pub viewport: Viewport,
    pub source: &'a dyn SampleSource,
    pub shear: &'a Shear,
    pub plan: &'a Plan,
    pub clip: Clip,
}

impl Sorter<'_> {
    /// The samples of the bin whose first pixel is `origin`.
    pub fn bin(&self, origin: [u32; 2]) -> BinSamples {
        let [across, down] = self.plan.blocks();
        let (blocks, cells) = ((across * down) as usize, self.plan.cells());
        let mut bin = BinSamples {
            origin,
            top: Viewport::edge(origin[1], self.viewport.height()),
            rect: [NOTHING; 2],
            cells: CellBoxes { u: CellRange::nothing(), v: CellRange::nothing(), t: CellRange::nothing() },
            blocks: vec![Boxes::nothing(); blocks.div_ceil(LANES)],
            boxes: vec![Boxes::nothing(); blocks * cells],
            partial: Vec::new(),
            places: vec![[BinSamples::NO_SAMPLE; LANES]; blocks * cells * LANES],
            packets: vec![Packet::NOWHERE; blocks * cells * LANES],
        };
        let (mut samples, mut pixel) =
            (Vec::new(), vec![Sample::default(); self.source.per_pixel() as usize]);
        for block in 0..blocks {
            let [column, row] = [block as u32 % across, block as u32 / across];
            let first = [column * self.plan.block_px[0], row * self.plan.block_px[1]];
            self.gather(origin, first, &mut pixel, &mut samples);
            self.split_cells(&mut bin, block * cells, cells, &mut samples, self.plan.cell_axes);
        }
        bin.cells.finish();
        let partial = |places: &[u32; LANES]| places.contains(&BinSamples::NO_SAMPLE);
        bin.partial =
            (0..).zip(&bin.places).filter(|(_, places)| partial(places)).map(|(at, _)| at).collect();
        bin
    }

    /// The samples of the pixels of a block that lie in the image.
    fn gather(&self, origin: [u32; 2], first: [u32; 2], pixel: &mut [Sample], samples: &mut Vec<Placed>) {
        let (viewport, [width, height]) = (self.viewport, self.plan.block_px);
        samples.clear();
        for (row, column) in (0..height).flat_map(|row| (0..width).map(move |column| (row, column))) {
            let [bx, by] = [first[0] + column, first[1] + row];
            let [px, py] = [origin[0] + bx, origin[1] + by];
            if px >= viewport.width() || py >= viewport.height() {
                continue;
            }
            self.source.pixel_into(px, py, pixel);
            let place = (by * self.plan.bin_px + bx) * pixel.len() as u32;
            let drawn = pixel.iter().zip(place..).filter(|(sample, _)| self.is_drawn(sample));
            samples.extend(drawn.map(|(s, place)| Placed {
                x: Viewport::edge(px, viewport.width()) + s.x,
                y: Viewport::edge(py, viewport.height()) + s.y,
                u: s.u,
                v: s.v,
                t: s.t,
                place,
            }));
        }
    }

    /// Whether a sample lies between the clip planes.
    fn is_drawn(&self, sample: &Sample) -> bool {
        let places = [sample.u, sample.v, sample.t];
        places.iter().zip(self.clip.half_open()).all(|(at, [lo, hi])| (lo..=hi).contains(at))
    }

    /// Halves `samples` along each axis, down to cells.
    fn split_cells(
        &self,
        bin: &mut BinSamples,
        first: usize,
        count: usize,
        samples: &mut [Placed],
        axes: &[Axis],
    ) {
        let Some((&axis, rest)) = axes.split_first() else {
            self.cell(bin, first, samples);
            return;
        };
        let (low, high) = halve(samples, axis, samples.len().div_ceil(2));
        self.split_cells(bin, first, count / 2, low, rest);
        self.split_cells(bin, first + count / 2, count / 2, high, rest);
    }

    fn cell(&self, bin: &mut BinSamples, block_cell: usize, samples: &mut [Placed]) {
        let (block, cell) = (block_cell / self.plan.cells(), block_cell % self.plan.cells());
        for sample in &*samples {
            bin.blocks[block / LANES].include(block % LANES, sample.x, sample.y);
            for (range, at) in bin.rect.iter_mut().zip([sample.x, sample.y]) {
                *range = [range[0].min(at), range[1].max(at)];
            }
            bin.cells.u.include(cell, sample.u);
            bin.cells.v.include(cell, sample.v);
            bin.cells.t.include(cell, sample.t);
        }
        self.split_packets(bin, block_cell, 0, LANES, samples, &Plan::PACKET_AXES);
    }

    /// Halves the samples of a cell along each axis, down to packets; full ones first, so that few are tested in vain.
    fn split_packets(
        &self,
        bin: &mut BinSamples,
        block_cell: usize,
        first: usize,
        count: usize,
        samples: &mut [Placed],
        axes: &[Axis],
    ) {
        if samples.is_empty() {
            return;
        }
        let Some((&axis, rest)) = axes.split_first() else {
            self.packet(bin, block_cell, first, samples);
            return;
        };
        let half = samples.len().div_ceil(2).next_multiple_of(LANES).min(samples.len());
        let (low, high) = halve(samples, axis, half);
        self.split_packets(bin, block_cell, first, count / 2, low, rest);
        self.split_packets(bin, block_cell, first + count / 2, count / 2, high, rest);
    }

    fn packet(&self, bin: &mut BinSamples, block_cell: usize, lane_in_cell: usize, samples: &[Placed]) {
        let number = block_cell * LANES + lane_in_cell;
        let packet = &mut bin.packets[number];
        let boxes = &mut bin.boxes[block_cell];
        for (lane, s) in samples.iter().enumerate() {
            bin.places[number][lane] = s.place;
            for (axis, (at, lens)) in [(s.x, s.u), (s.y, s.v)].into_iter().enumerate() {
                [packet.slope[axis].0[lane], packet.lens[axis].0[lane]] = self.shear.ray(axis, at, lens);
            }
            packet.t.0[lane] = s.t;
            boxes.include(lane_in_cell, s.x, s.y);
        }
    }
}

/// The samples lowest along the axis, `count` of them, and the rest. Ties go by place, so that the division is a function of the
/// samples alone.
fn halve(samples: &mut [Placed], axis: Axis, count: usize) -> (&mut [Placed], &mut [Placed]) {
    if count > 0 && count < samples.len() {
        samples.select_nth_unstable_by(count, |a, b| {
            a.along(axis).total_cmp(&b.along(axis)).then(a.place.cmp(&b.place))
        });
    }
    samples.split_at_mut(count)
}
