//! Passes of groups: a reduction, a histogram, lists of lights, and the image made of them.
//!
//! Lights of each tile: bounding spheres against the side planes of the tile and its depths (Harada, McKee and Yang
//! 2012, "Forward+").

use activity::{Counts, Event};
use glam::Vec3;
use pipeline::memory::AddressSpace;
use pipeline::{
    Atomic, Buffer, BufferBinding, Camera, ComputeError, ComputePass, Gpu, Group, GroupLane, GroupShader,
    PassError, SurfaceView, Viewport,
};

use super::luminance::{BlockSums, Count, Display, Mean, Scan, Show, decoded};
use super::{Blocks, ComputeOptions, Order, Slots, tree};

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
        let bytes = 4 * u64::from(tiles) * u64::from(capacity);
        if bytes > AddressSpace::MAX_BYTES {
            return Err(PassError::Memory { pass: "light culling".to_owned(), bytes });
        }
        let words = self.gpu.buffer("lights", &LightBuffer::values(lights, camera));
        let lists = Lists {
            counts: self.gpu.buffer("counts", &vec![0_u32; tiles as usize]),
            lights: self.gpu.buffer("lists", &vec![0_u32; bytes as usize / 4]),
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

    /// Cycles that an access of a warp to shared memory takes on average, with the least it could take as 1;
    /// 1 without any.
    pub fn cycles_per_shared_access(&self) -> f64 {
        let cycles = self.counts[Event::SharedCycles];
        ratio(cycles, cycles - self.counts[Event::BankConflicts])
    }

    /// Atomics of a warp on a word of a buffer, on average; 1 without any.
    pub fn atomics_per_word(&self) -> f64 {
        let atomics = self.counts[Event::Atomics];
        ratio(atomics, atomics - self.counts[Event::AtomicConflicts])
    }

    /// Atomics that follow each other in an access of a warp on average, of a histogram of so many values: in
    /// shared memory all conflicts are theirs, as lanes clear and add up words beside each other.
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

/// Bounding sphere of what a light reaches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightSphere {
    /// Centre.
    pub centre: Vec3,
    /// Radius.
    pub radius: f32,
}

/// The image plane of a still camera without a lens, for planes through columns and rows of pixels.
#[derive(Clone, Copy, Debug)]
pub(super) struct ImagePlane {
    /// Pixels of a length of 1 at depth 1; at any depth for parallel rays.
    scale_px: f32,
    /// Column and row at which view coordinates are 0.
    middle_px: [f32; 2],
    is_parallel: bool,
}

impl ImagePlane {
    pub fn new(camera: &Camera, viewport: Viewport) -> Self {
        let [width, height] = [viewport.width(), viewport.height()].map(|side| side as f32);
        let shift = camera.shift() * height;
        Self {
            scale_px: 0.5 * height / camera.half_height(),
            middle_px: [0.5 * width + shift.x, 0.5 * height + shift.y],
            is_parallel: camera.is_orthographic(),
        }
    }

    /// Distance of a point in view coordinates, with `along` to the right (or down) and `depth`, from the
    /// plane through the camera and a column (or row) of pixels; positive to the right of it (or below). Six
    /// operations.
    fn beyond(&self, lane: &GroupLane<'_, '_>, axis: usize, px: f32, [along, depth]: [f32; 2]) -> f32 {
        let slope = lane.sub(self.middle_px[axis], px);
        if self.is_parallel {
            return lane.madd(slope, 1.0 / self.scale_px, along);
        }
        let length = lane.sqrt(lane.madd(slope, slope, self.scale_px * self.scale_px));
        lane.mul(lane.madd(slope, depth, lane.mul(self.scale_px, along)), lane.recip(length))
    }
}

/// Lights in view coordinates: `x` of all, then `y` (down), then depths, then radii.
#[derive(Clone, Copy, Debug)]
pub(super) struct LightBuffer {
    pub words: Buffer<f32>,
    pub count: u32,
}

impl LightBuffer {
    /// Values of the buffer of `lights` as `camera` sees them.
    pub fn values(lights: &[LightSphere], camera: &Camera) -> Vec<f32> {
        let pose = camera.open();
        let seen: Vec<Vec3> = lights.iter().map(|light| pose.transform_point3(light.centre)).collect();
        let parts: [fn(&Vec3) -> f32; 3] = [|at| at.x, |at| -at.y, |at| at.z];
        let places = parts.into_iter().flat_map(|part| seen.iter().map(part));
        places.chain(lights.iter().map(|light| light.radius)).collect()
    }

    fn get(&self, lane: &GroupLane<'_, '_>, light: u32) -> [f32; 4] {
        [0, 1, 2, 3].map(|part| lane.load(self.words, lane.add(part * self.count, light)))
    }
}

/// Lists of the lights of all tiles.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lists {
    /// Lights of each tile, also of those whose list is full.
    pub counts: Buffer<u32>,
    /// Numbers of lights, `capacity` words for each tile.
    pub lights: Buffer<u32>,
    pub capacity: u32,
    /// A word: the largest of the counts.
    pub most: Buffer<u32>,
}

/// A group for each tile.
pub(super) struct Cull {
    pub depth: SurfaceView,
    /// Whether the depths of the tile bound its lights.
    pub depth_bounds: bool,
    pub blocks: Blocks,
    pub plane: ImagePlane,
    pub lights: LightBuffer,
    pub lists: Lists,
}

/// Values of each lane in shared memory.
struct DepthSlots {
    nearest: Slots,
    farthest: Slots,
    /// Word of the number of lights.
    found: u32,
}

impl DepthSlots {
    fn new(lanes: u32) -> Self {
        let nearest = Slots { first: 0, stride: 1, pad_log2: None };
        Self { nearest, farthest: Slots { first: lanes, ..nearest }, found: 2 * lanes }
    }
}

impl GroupShader for Cull {
    fn run(&self, group: &mut Group<'_>) {
        let slots = DepthSlots::new(group.size());
        if self.depth_bounds {
            self.bound_depths(group, &slots);
        }
        self.find(group, &slots);
        let (id, groups) = (group.id(), group.groups());
        group.lanes(|lane| {
            if lane.branch(lane.index() == 0) {
                let (tile, found) = (lane.madd(id[1], groups[0], id[0]), lane.shared(slots.found));
                lane.store(self.lists.counts, tile, found);
                lane.atomic(self.lists.most, 0, Atomic::Max, found);
            }
        });
    }
}

impl Cull {
    /// Words of shared memory of a group of `lanes`.
    pub fn words(lanes: u32) -> u32 {
        DepthSlots::new(lanes).found + 1
    }

    /// Nearest and farthest depth of the tile, without the background.
    fn bound_depths(&self, group: &mut Group<'_>, slots: &DepthSlots) {
        let (id, size) = (group.id(), group.size());
        group.lanes(|lane| {
            let (mut nearest, mut farthest) = (f32::INFINITY, 0.0);
            self.blocks.pixels(lane, id, size, |pixel| {
                for sample in 0..self.depth.samples() {
                    let depth = lane.texel(&self.depth, pixel, sample).x;
                    nearest = lane.min(nearest, depth);
                    farthest = lane.max(farthest, lane.select_greater([f32::INFINITY, depth], depth, 0.0));
                }
            });
            lane.set_shared(slots.nearest.word(lane, lane.index()), nearest);
            lane.set_shared(slots.farthest.word(lane, lane.index()), farthest);
        });
        tree(group, Order::Sequential, |lane, pair| {
            let [a, b] = pair.map(|index| slots.nearest.word(lane, index));
            lane.set_shared(a, lane.min(lane.shared::<f32>(a), lane.shared::<f32>(b)));
            let [a, b] = pair.map(|index| slots.farthest.word(lane, index));
            lane.set_shared(a, lane.max(lane.shared::<f32>(a), lane.shared::<f32>(b)));
        });
    }

    /// Tests the lights, a lane for each, and appends those that reach the tile.
    fn find(&self, group: &mut Group<'_>, slots: &DepthSlots) {
        let (id, size, groups) = (group.id(), group.size(), group.groups());
        group.lanes(|lane| {
            if lane.branch(lane.index() == 0) {
                lane.set_shared(slots.found, 0_u32);
            }
        });
        group.barrier();
        group.lanes(|lane| {
            let depths = if self.depth_bounds {
                [slots.nearest.first, slots.farthest.first].map(|word| lane.shared::<f32>(word))
            } else {
                [0.0, f32::INFINITY]
            };
            let edges = self.edges(lane, id);
            let first = lane.mul(lane.madd(id[1], groups[0], id[0]), self.lists.capacity);
            for light in (lane.index()..self.lights.count).step_by(size as usize) {
                if lane.branch(self.reaches(lane, light, edges, depths)) {
                    let slot = lane.add_shared(slots.found, 1);
                    if lane.branch(slot < self.lists.capacity) {
                        lane.store(self.lists.lights, lane.add(first, slot), light);
                    }
                }
            }
        });
        group.barrier();
    }

    /// First and last column, and first and last row, of a tile.
    fn edges(&self, lane: &GroupLane<'_, '_>, id: [u32; 3]) -> [[f32; 2]; 2] {
        [0, 1].map(|axis| {
            let first = lane.mul(id[axis], self.blocks.block[axis]);
            let last = lane.min(lane.add(first, self.blocks.block[axis]), self.blocks.grid[axis]);
            [first as f32, last as f32]
        })
    }

    fn reaches(
        &self,
        lane: &GroupLane<'_, '_>,
        light: u32,
        edges: [[f32; 2]; 2],
        [nearest, farthest]: [f32; 2],
    ) -> bool {
        let [x, y, depth, radius] = self.lights.get(lane, light);
        let mut outside = lane.max(lane.sub(nearest, depth), lane.sub(depth, farthest));
        for (axis, along) in [x, y].into_iter().enumerate() {
            let [first, last] = edges[axis].map(|px| self.plane.beyond(lane, axis, px, [along, depth]));
            outside = lane.max(outside, lane.max(-first, last));
        }
        outside <= radius
    }
}
