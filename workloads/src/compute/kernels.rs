//! Passes of groups: a reduction, a histogram, lists of lights, and the image made of them.

use activity::{Counts, Event};
use glam::Vec3;
use pipeline::{
    Buffer, BufferBinding, Camera, ComputeError, ComputePass, Gpu, PassError, SurfaceView, Viewport,
};

use super::block::{Blocks, Slots};
use super::light_culling::{Cull, ImagePlane, LightBuffer, LightSphere, Lists};
use super::luminance::{BlockSums, Count, Display, Mean, Scan, Show, decoded};
use super::options::ComputeOptions;

/// The passes of groups of a frame.
pub struct Kernels<'a, 'e> {
    gpu: &'a mut Gpu<'e>,
    options: &'a ComputeOptions,
    /// Banks of a shared memory.
    banks: u32,
    /// Events of all passes but the one that writes the image.
    counts: Counts,
}

/// Lists of the lights of tiles.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TileLights {
    /// Tiles across and down.
    pub tiles: [u32; 2],
    /// Number of lights of each tile, row by row.
    pub counts: Vec<u32>,
    /// Numbers of the lights of each tile, as far as its list has them.
    pub lists: Vec<Vec<u32>>,
}

impl<'a, 'e> Kernels<'a, 'e> {
    /// Passes on `gpu`.
    ///
    /// # Errors
    /// [`PassError::Compute`] if the GPU has no compute unit.
    pub fn new(gpu: &'a mut Gpu<'e>, options: &'a ComputeOptions) -> Result<Self, PassError> {
        let missing = || PassError::Compute { pass: "compute".to_owned(), error: ComputeError::Missing };
        let banks = gpu.spec().compute.ok_or_else(missing)?.banks;
        Ok(Self { gpu, options, banks, counts: Counts::default() })
    }

    /// Mean luminance of an image, in a buffer of one word.
    ///
    /// # Errors
    /// [`PassError`] if the GPU does not take the pass.
    pub fn mean_luminance(&mut self, image: &SurfaceView) -> Result<Buffer<f32>, PassError> {
        let ComputeOptions { order, group, .. } = *self.options;
        let (slots, blocks) = (self.slots(), self.blocks(image));
        let shared_bytes = 4 * slots.words(group);
        let groups = blocks.groups();
        let sums = self.gpu.buffer("sums", &vec![0.0_f32; (groups[0] * groups[1]) as usize]);
        let mean = self.gpu.buffer("mean", &[0.0_f32]);
        let shader = BlockSums { image: *image, blocks, slots, order, sums };
        let bindings = [image.reads(), sums.writes()];
        self.dispatch(&ComputePass {
            name: "block sums",
            groups,
            group_size: group,
            shared_bytes,
            bindings: &bindings,
            shader: &shader,
        })?;
        let count = (blocks.count() * u64::from(image.samples())) as f32;
        let shader = Mean { sums, slots, order, count, mean };
        self.dispatch(&ComputePass {
            name: "mean",
            groups: [1; 3],
            group_size: group,
            shared_bytes,
            bindings: &[sums.reads(), mean.writes()],
            shader: &shader,
        })?;
        Ok(mean)
    }

    /// Histogram of the luminance of an image.
    ///
    /// # Errors
    /// [`PassError`] if the GPU does not take the pass.
    pub fn histogram(&mut self, image: &SurfaceView) -> Result<Buffer<u32>, PassError> {
        let ComputeOptions { atomics, copies, bins, group, padded, .. } = *self.options;
        let blocks = self.blocks(image);
        let counts = self.gpu.buffer("histogram", &vec![0_u32; bins as usize]);
        let copy_words = bins + u32::from(padded);
        let shader = Count { image: *image, blocks, atomics, copies, copy_words, counts };
        self.dispatch(&ComputePass {
            name: "histogram",
            groups: blocks.groups(),
            group_size: group,
            shared_bytes: 4 * shader.words(),
            bindings: &[image.reads(), counts.writes()],
            shader: &shader,
        })?;
        Ok(counts)
    }

    /// Sums of a histogram up to each bin.
    ///
    /// # Errors
    /// [`PassError`] if the GPU does not take the pass.
    pub fn sums(&mut self, counts: Buffer<u32>) -> Result<Buffer<u32>, PassError> {
        let bins = counts.len();
        let sums = self.gpu.buffer("sums", &vec![0_u32; bins as usize]);
        self.dispatch(&ComputePass {
            name: "sums",
            groups: [1; 3],
            group_size: bins,
            shared_bytes: Scan::BYTES_PER_BIN * bins,
            bindings: &[counts.reads(), sums.writes()],
            shader: &Scan { counts, sums },
        })?;
        Ok(sums)
    }

    /// Lists of the lights that reach what each tile of a depth surface shows.
    ///
    /// # Errors
    /// [`PassError`] if the GPU does not take the pass.
    pub(super) fn cull(
        &mut self,
        depth: &SurfaceView,
        (camera, viewport): (&Camera, Viewport),
        lights: &[LightSphere],
    ) -> Result<(Lists, Blocks), PassError> {
        let ComputeOptions { depth_bounds, tile_px, group, list: capacity, .. } = *self.options;
        let blocks = Blocks::tiles(depth.size(), tile_px);
        let tiles = blocks.groups()[0] * blocks.groups()[1];
        let words = self.gpu.buffer("lights", &LightBuffer::values(lights, camera));
        let lists = Lists {
            counts: self.gpu.buffer("counts", &vec![0_u32; tiles as usize]),
            lights: self.gpu.buffer("lists", &vec![0_u32; (tiles * capacity) as usize]),
            capacity,
            most: self.gpu.buffer("most", &[0_u32]),
        };
        let lights = LightBuffer { words, count: lights.len() as u32 };
        let plane = ImagePlane::new(camera, viewport);
        let shader = Cull { depth: *depth, depth_bounds, blocks, plane, lights, lists };
        let written = [lists.counts.writes(), lists.lights.writes(), lists.most.writes()];
        let bindings = [&[depth.reads(), words.reads()][..], &written].concat();
        self.dispatch(&ComputePass {
            name: "light culling",
            groups: blocks.groups(),
            group_size: group,
            shared_bytes: 4 * Cull::words(group),
            bindings: &bindings,
            shader: &shader,
        })?;
        Ok((lists, blocks))
    }

    /// The lists as the host reads them.
    pub(super) fn tile_lights(&self, (lists, blocks): &(Lists, Blocks)) -> TileLights {
        let (counts, words) = (self.gpu.values(lists.counts), self.gpu.values(lists.lights));
        let of_tiles = words.chunks(lists.capacity as usize).zip(&counts);
        let lists = of_tiles.map(|(list, count)| list[..list.len().min(*count as usize)].to_vec()).collect();
        let [across, down, _] = blocks.groups();
        TileLights { tiles: [across, down], counts, lists }
    }

    /// Lists of the lights of each tile, on the host.
    ///
    /// # Errors
    /// [`PassError`] if the GPU does not take the pass.
    pub fn light_lists(
        &mut self,
        depth: &SurfaceView,
        view: (&Camera, Viewport),
        lights: &[LightSphere],
    ) -> Result<TileLights, PassError> {
        let lists = self.cull(depth, view, lights)?;
        Ok(self.tile_lights(&lists))
    }

    /// Writes the image, and returns it.
    pub(super) fn display(
        &mut self,
        image: &SurfaceView,
        show: Show,
        reads: &[BufferBinding],
    ) -> Result<Vec<Vec3>, PassError> {
        let ([width, height], group) = (image.size(), self.options.group);
        let out = self.gpu.buffer("image", &vec![0_u32; width as usize * height as usize]);
        let blocks = Blocks::new(image.size(), group, 1, 1);
        let bindings = [&[image.reads(), out.writes()], reads].concat();
        let shader = Display { image: *image, blocks, show, out };
        self.gpu.dispatch(&ComputePass {
            name: "display",
            groups: blocks.groups(),
            group_size: group,
            shared_bytes: 0,
            bindings: &bindings,
            shader: &shader,
        })?;
        Ok(decoded(&self.gpu.values(out)))
    }

    /// The values of a buffer.
    pub fn values<T: pipeline::Word>(&self, buffer: Buffer<T>) -> Vec<T> {
        self.gpu.values(buffer)
    }

    /// Cycles that an access of a warp to shared memory takes on average, with the least it could take as 1; 1 without any.
    pub fn cycles_per_shared_access(&self) -> f64 {
        let cycles = self.counts[Event::SharedCycles];
        ratio(cycles, cycles - self.counts[Event::BankConflicts])
    }

    /// Atomics of a warp on a word of a buffer, on average; 1 without any.
    pub fn atomics_per_word(&self) -> f64 {
        let atomics = self.counts[Event::Atomics];
        ratio(atomics, atomics - self.counts[Event::AtomicConflicts])
    }

    /// Atomics that follow each other in an access of a warp on average, of a histogram of so many values: in shared memory all
    /// conflicts are theirs, as lanes clear and add up words beside each other.
    pub fn atomics_in_line(&self, values: u64) -> f64 {
        let lanes = self.gpu.spec().compute.map_or(1, |spec| spec.warp_lanes.min(self.options.group));
        let accesses = values as f64 / f64::from(lanes);
        let in_shared = 1.0 + self.counts[Event::BankConflicts] as f64 / accesses.max(1.0);
        in_shared.max(self.atomics_per_word())
    }

    /// Events of all passes but the one that writes the image.
    pub fn counts(&self) -> &Counts {
        &self.counts
    }

    /// Whether the sums of a group fit into shared memory with padding.
    pub fn padding_fits(&self) -> bool {
        let padded = Slots { pad_log2: Some(self.banks.ilog2()), ..self.slots() };
        self.gpu.spec().compute.is_some_and(|unit| 4 * padded.words(self.options.group) <= unit.shared_bytes)
    }

    fn slots(&self) -> Slots {
        let pad_log2 = self.options.padded.then(|| self.banks.ilog2());
        Slots { first: 0, stride: self.options.stride, pad_log2 }
    }

    fn blocks(&self, image: &SurfaceView) -> Blocks {
        let ComputeOptions { group, per_lane, step, .. } = *self.options;
        Blocks::new(image.size(), group, per_lane, step)
    }

    fn dispatch(&mut self, pass: &ComputePass<'_>) -> Result<(), PassError> {
        self.counts += &self.gpu.dispatch(pass)?;
        Ok(())
    }
}

fn ratio(all: u64, least: u64) -> f64 {
    if least == 0 { 1.0 } else { all as f64 / least as f64 }
}
