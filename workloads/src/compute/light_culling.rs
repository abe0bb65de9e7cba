//! Lights of each tile of the image: bounding spheres against the side planes of the tile and its depths (Harada, McKee and Yang
//! 2012, "Forward+").

use glam::Vec3;
use pipeline::{Atomic, Buffer, Camera, Group, GroupLane, GroupShader, SurfaceView, Viewport};

use super::block::{Blocks, Order, Slots, tree};

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

    /// Distance of a point in view coordinates, with `along` to the right (or down) and `depth`, from the plane through the
    /// camera and a column (or row) of pixels; positive to the right of it (or below). Six operations.
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
