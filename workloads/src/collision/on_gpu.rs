//! The passes of collision detection on the modelled hardware, in conservative mode, and a picture of them.

use glam::Vec3;
use pipeline::memory::MemoryRange;
use pipeline::{
    ConservativeDraw, ConservativePass, Gpu, Lane, Lanes, PassError, Placement, Primitive, TileIntervals,
    TileShader, Uses, Viewport,
};

use super::object::Object;
use super::pass::{BinnedPrimitive, Fragment, FragmentBudget, Part, Pass, PassBackend};
use super::{Bounds, CollisionMethod, TzBox, TzBuffer};

/// Bytes of a vertex at both times.
const VERTEX_BYTES: u32 = 24;
/// Bytes of an interval of time or depth: two numbers of 64 bits, in which conservative mode clips its intervals.
const INTERVAL_BYTES: u64 = 16;
/// Bytes of the answer about an object: whether it meets others, by direction.
const ANSWER_BYTES: u64 = 4;

/// Places of boxes in a buffer: tile by tile of the hardware, the boxes of a pixel side by side.
#[derive(Clone, Copy)]
struct BoxLayout {
    /// Pixels along a side of a tile.
    side: u32,
    /// Tiles in a row.
    across: u32,
    /// Boxes of a pixel.
    bins: u64,
    /// Bytes of a box.
    box_bytes: u64,
}

impl BoxLayout {
    fn new(viewport: Viewport, tile_px: u32, bins: u32, method: CollisionMethod) -> Self {
        // By depth alone there are no times.
        let intervals = if method == CollisionMethod::DepthOnly { 1 } else { 2 };
        Self {
            side: tile_px,
            across: viewport.width().div_ceil(tile_px),
            bins: u64::from(bins),
            box_bytes: intervals * INTERVAL_BYTES,
        }
    }

    /// Bytes of the boxes of all pixels of a square image.
    fn bytes(&self) -> u64 {
        u64::from(self.across * self.side).pow(2) * self.bins * self.box_bytes
    }

    /// Where the box of a pixel and a time bin begins.
    fn offset(&self, [x, y]: [u32; 2], bin: usize) -> u64 {
        let Self { side, across, bins, box_bytes } = *self;
        let pixel = u64::from((y / side * across + x / side) * side * side + y % side * side + x % side);
        (pixel * bins + bin as u64) * box_bytes
    }
}

/// Draws the passes on a GPU, with a picture of them.
pub(super) struct PassesOnGpu<'a, 'e> {
    gpu: &'a mut Gpu<'e>,
    pass: ConservativePass,
    objects: &'a [Object],
    /// Vertices of each object.
    vertices: Vec<MemoryRange>,
    picture: Picture,
    layout: BoxLayout,
    /// Boxes of the first and of the second object.
    boxes: [MemoryRange; 2],
    /// Answers about the objects of a pass, and how many there are so far.
    answers: MemoryRange,
    answered: u64,
    method: CollisionMethod,
    fragments: u64,
    /// Why the GPU refused a pass; nothing is drawn after that.
    refused: Option<PassError>,
}

/// Picture and number of fragments of the passes.
pub(super) struct Emitted {
    pub image: Vec<Vec3>,
    pub fragments: u64,
}

impl<'a, 'e> PassesOnGpu<'a, 'e> {
    /// Makes passes of the size of `viewport`, a square, with `bins` boxes in a pixel.
    pub fn new(
        (method, viewport, bins): (CollisionMethod, Viewport, u32),
        objects: &'a [Object],
        gpu: &'a mut Gpu<'e>,
    ) -> Self {
        let layout = BoxLayout::new(viewport, gpu.spec().tile_px, bins, method);
        let bytes = |object: &Object| 3 * object.len() as u64 * u64::from(VERTEX_BYTES);
        let vertices = objects.iter().map(|object| gpu.allocate(bytes(object))).collect();
        let boxes = [(); 2].map(|()| gpu.allocate(layout.bytes()));
        let picture = Picture::new(objects, viewport.width() as usize);
        let answers = gpu.allocate(objects.len() as u64 * ANSWER_BYTES);
        let (pass, answered, fragments, refused) = Default::default();
        Self {
            gpu,
            pass,
            objects,
            vertices,
            picture,
            layout,
            boxes,
            answers,
            answered,
            method,
            fragments,
            refused,
        }
    }

    /// The answers of a pass are in memory when it ends, for the host to read.
    fn end_pass(&mut self) {
        if std::mem::take(&mut self.answered) > 0 && self.refused.is_none() {
            let stored = self.pass.store(self.gpu, self.answers);
            self.is_drawn(stored);
            self.gpu.keep(self.answers);
        }
    }

    /// Vertices of an object in memory. Objects that are scaled are copies; they are charged as the first.
    fn vertices_of(&self, object: &Object) -> Option<MemoryRange> {
        let at = self.objects.iter().position(|known| std::ptr::eq(known, object));
        self.vertices.get(at.unwrap_or(0)).copied()
    }

    /// Where the next answer is.
    fn next_answer(&mut self) -> u64 {
        self.answered += 1;
        (self.answered - 1) * ANSWER_BYTES
    }

    /// The totals, with a picture of them for people, which is no work of the GPU.
    ///
    /// # Errors
    /// [`PassError`] if the GPU refused a pass.
    pub fn finish(self) -> Result<Emitted, PassError> {
        let image = self.picture.image();
        Ok(Emitted { image, fragments: self.into_fragments()? })
    }

    /// The number of fragments, without an image.
    ///
    /// # Errors
    /// As [`Self::finish`].
    pub fn into_fragments(self) -> Result<u64, PassError> {
        Ok(self.drawn()?.fragments)
    }

    /// These passes after the last of them, if the GPU refused none.
    fn drawn(mut self) -> Result<Self, PassError> {
        self.end_pass();
        match self.refused.take() {
            Some(error) => Err(error),
            None => Ok(self),
        }
    }

    /// Notes why the GPU refused a pass. Returns whether it did not.
    fn is_drawn(&mut self, result: Result<(), PassError>) -> bool {
        let is_drawn = result.is_ok();
        self.refused = self.refused.take().or(result.err());
        is_drawn
    }

    /// Where the boxes of a part are. The second part only reads those of the first unless boxes are compared.
    fn target(&self, which: usize, is_test: bool) -> MemoryRange {
        self.boxes[if is_test || self.method == CollisionMethod::FragmentBox { 0 } else { which }]
    }
}

/// Compares a box with the times and depths of a fragment, or with another box.
fn meets(lane: &Lane, known: &TzBox, t: [f64; 2], z: [f64; 2]) -> bool {
    let apart = |a: [f64; 2], b: [f64; 2]| lane.max(a[0], b[0]) > lane.min(a[1], b[1]);
    !lane.branch(apart(known.t, t)) && !lane.branch(apart(known.z, z))
}

/// The same by depth alone, from either direction.
fn meets_in_depth(lane: &Lane, known: &TzBox, z: [f64; 2]) -> bool {
    let [in_front, behind] = [z[0] <= known.z[1], z[1] >= known.z[0]].map(|is| lane.branch(is));
    in_front || behind
}

/// The shader of a pass: a fragment is compared with a box, or enlarges it. One that meets its box marks the
/// answer of its object.
struct BoxShader<'a> {
    primitives: &'a [BinnedPrimitive],
    pass: &'a Pass,
    target: MemoryRange,
    known: Option<&'a TzBuffer>,
    layout: BoxLayout,
    answers: MemoryRange,
    /// Where the answer of the object is.
    answer: u64,
}

impl TileShader for BoxShader<'_> {
    type BodyState = ();
    type Output = Fragment;

    fn run(&self, (): &mut (), lanes: &Lanes, tile: &TileIntervals<'_>) -> Option<Fragment> {
        let fragment = self.primitives[tile.primitive].fragment(tile.tile, tile.touch);
        let offset = self.layout.offset(tile.tile, fragment.bin);
        let Some(known) = self.known else {
            lanes.run(|_| ());
            lanes.merge(self.target, offset, self.layout.box_bytes);
            return Some(fragment);
        };
        lanes.read(self.target, offset, self.layout.box_bytes);
        let place = self.pass.place(fragment.tile, fragment.bin);
        if lanes.run(|lane| meets(lane, known.at(place), tile.touch.t, tile.touch.z)) {
            lanes.merge(self.answers, self.answer, ANSWER_BYTES);
        }
        Some(fragment)
    }
}

impl PassBackend for PassesOnGpu<'_, '_> {
    fn begin(&mut self, name: &str, pass: &Pass, follows: bool) {
        self.end_pass();
        if follows {
            self.gpu.wait();
        }
        let uses = Uses::default().depths(self.boxes).depths([self.answers]);
        let begun = self.gpu.begin_conservative(name, Some(self.picture.placement(pass)), uses);
        let begun = begun.map(|pass| self.pass = pass);
        self.is_drawn(begun);
    }

    fn draw(
        &mut self,
        pass: &Pass,
        (which, part): (usize, Part<'_>),
        bins: &[Option<Bounds>],
        _: &mut FragmentBudget,
        known: Option<&TzBuffer>,
        each: &mut dyn FnMut(&Fragment),
    ) -> bool {
        // There is a part, so there are objects.
        let Some(vertices) = self.vertices_of(part.object) else { return false };
        if self.refused.is_some() {
            return false;
        }
        let binned = pass.primitives(part, bins);
        let primitives: Vec<Primitive> = binned.iter().map(|binned| binned.primitive.clone()).collect();
        let draw = ConservativeDraw {
            primitives: &primitives,
            grid: pass.grid(),
            block: self.layout.side,
            vertices,
            vertex_bytes: VERTEX_BYTES,
            projection: None,
        };
        let answer = if known.is_some() { self.next_answer() } else { 0 };
        let shader = BoxShader {
            primitives: &binned,
            pass,
            target: self.target(which, known.is_some()),
            known,
            layout: self.layout,
            answers: self.answers,
            answer,
        };
        let (picture, fragments) = (&mut self.picture, &mut self.fragments);
        let drawn = self.pass.draw(self.gpu, &draw, &shader, |tile, fragment| {
            *fragments += 1;
            picture.fragment(pass, tile);
            each(&fragment);
        });
        self.is_drawn(drawn)
    }

    fn compare(&mut self, pass: &Pass, bins: usize, [first, second]: [&TzBuffer; 2], merges: bool) {
        let [columns, rows] = [pass.grid().columns, pass.grid().rows];
        let Some(viewport) = Viewport::new(columns, rows) else { return };
        let (targets, layout) = (self.boxes, self.layout);
        let (answers, answer, method) = (self.answers, self.next_answer(), self.method);
        let compared = self.pass.run_pixels(self.gpu, viewport, |lanes, tile| {
            for bin in 0..bins {
                let place = pass.place(tile, bin);
                let offset = layout.offset(tile, bin);
                targets.iter().for_each(|target| lanes.read(*target, offset, layout.box_bytes));
                let (one, other) = (first.at(place), second.at(place));
                let met = lanes.run(|lane| match method {
                    CollisionMethod::DepthOnly => meets_in_depth(lane, one, other.z),
                    _ => meets(lane, one, other.t, other.z),
                });
                if met {
                    lanes.merge(answers, answer, ANSWER_BYTES);
                }
                if merges {
                    lanes.merge(targets[0], offset, layout.box_bytes);
                }
            }
        });
        self.is_drawn(compared.map(|_: Vec<()>| ()));
    }

    fn overlap(&mut self, pass: &Pass, tile: [u32; 2]) {
        self.picture.overlap(pass, tile);
    }
}

/// Linear RGB of pixels with one fragment, and with the most fragments.
const DRAWN: [Vec3; 2] = [Vec3::new(0.60, 0.72, 0.84), Vec3::new(0.0, 0.06, 0.28)];
/// Linear RGB of pixels with one overlapping tile, and with the most.
const OVERLAPPING: [Vec3; 2] = [Vec3::new(0.90, 0.42, 0.15), Vec3::new(0.62, 0.06, 0.0)];

/// Counts of fragments and overlapping tiles of all pairs, by pixel.
pub(super) struct Picture {
    space: [[f64; 2]; 3],
    side: usize,
    /// Fragments, and tiles in which a pair may collide.
    pixels: Vec<[u32; 2]>,
}

impl Picture {
    /// Makes three empty views of `side` by `side` pixels around the swept boxes of all `objects`.
    pub fn new(objects: &[Object], side: usize) -> Self {
        let whole = objects.iter().fold(Bounds::NOTHING, |whole, object| whole.hull(object.bounds()));
        Self { space: whole.space, side, pixels: vec![[0; 2]; 3 * side * side] }
    }

    /// Counts a fragment in a tile of `pass`.
    pub fn fragment(&mut self, pass: &Pass, tile: [u32; 2]) {
        self.pixel(pass, tile)[0] += 1;
    }

    /// Counts a tile of `pass` in which a pair may collide.
    pub fn overlap(&mut self, pass: &Pass, tile: [u32; 2]) {
        self.pixel(pass, tile)[1] += 1;
    }

    /// Shares of a view, across and up, at both ends of a tile of `pass`; NaN in a flat scene.
    fn shares(&self, pass: &Pass, tile: [u32; 2]) -> [[f64; 2]; 2] {
        let inside = pass.bounds(tile, [0.0; 2], [0.0; 2]).space;
        [1, 2].map(|across| {
            let axis = (pass.axis + across) % 3;
            let [low, high] = self.space[axis];
            inside[axis].map(|at| (at - low) / (high - low))
        })
    }

    /// Where the tiles of `pass` are: in the view along its axis, of three side by side.
    fn placement(&self, pass: &Pass) -> Placement {
        let last = [pass.grid().columns - 1, pass.grid().rows - 1];
        let (first, last) = (self.shares(pass, [0; 2]), self.shares(pass, last));
        let in_image = |[across, up]: [f64; 2]| [(pass.axis as f64 + across.clamp(0.0, 1.0)) / 3.0, 1.0 - up];
        Placement { first: in_image(first.map(|ends| ends[0])), last: in_image(last.map(|ends| ends[1])) }
    }

    /// Pixel at the middle of a tile. The larger coordinate is on the right and above.
    fn pixel(&mut self, pass: &Pass, tile: [u32; 2]) -> &mut [u32; 2] {
        let middle = pass.bounds(tile, [0.0; 2], [0.0; 2]).space;
        let [column, row] = [1, 2].map(|across| {
            let axis = (pass.axis + across) % 3;
            let ([low, high], [from, to]) = (self.space[axis], middle[axis]);
            let share = (0.5 * (from + to) - low) / (high - low);
            // A flat scene divides by zero. The NaN saturates to 0.
            ((share * self.side as f64) as usize).min(self.side - 1)
        });
        &mut self.pixels[(self.side - 1 - row) * 3 * self.side + pass.axis * self.side + column]
    }

    /// White background, blue for fragments, red for overlapping tiles; both on a logarithmic scale.
    pub fn image(&self) -> Vec<Vec3> {
        let greatest = [0, 1].map(|which| self.pixels.iter().map(|pixel| pixel[which]).max().unwrap_or(0));
        let shade = |[first, last]: [Vec3; 2], count: u32, greatest: u32| {
            let log = |count: u32| libm::logf(count as f32);
            first.lerp(last, if greatest > 1 { log(count) / log(greatest) } else { 1.0 })
        };
        let colour = |&[drawn, overlap]: &[u32; 2]| match (drawn, overlap) {
            (0, 0) => Vec3::ONE,
            (_, 0) => shade(DRAWN, drawn, greatest[0]),
            _ => shade(OVERLAPPING, overlap, greatest[1]),
        };
        self.pixels.iter().map(colour).collect()
    }
}

#[cfg(test)]
mod tests {
    use activity::Event;

    use super::*;

    #[test]
    fn every_box_has_a_place_of_its_own_in_the_buffer() {
        let of = |method| BoxLayout::new(Viewport::new(19, 19).unwrap(), 8, 3, method);
        let layout = of(CollisionMethod::BoxBox);
        assert_eq!(layout.bytes(), 2 * of(CollisionMethod::DepthOnly).bytes());
        let places = (0..19 * 19 * 3).map(|n| layout.offset([n % 19, n / 19 % 19], (n / (19 * 19)) as usize));
        let mut places: Vec<u64> = places.collect();
        assert_eq!(layout.offset([8, 0], 1), (64 * 3 + 1) * layout.box_bytes);
        places.sort_unstable();
        assert!(places.windows(2).all(|pair| pair[1] - pair[0] >= layout.box_bytes));
        assert!(places[places.len() - 1] + layout.box_bytes <= layout.bytes());
    }

    /// By every method, fragments or pixels that meet mark the answer of their object, and the answers of all
    /// passes reach memory.
    #[test]
    fn answers_are_in_memory() {
        let objects = super::super::families::swarm_of(6, 1);
        let hardware = crate::job::testing::hardware();
        for method in [CollisionMethod::FragmentBox, CollisionMethod::BoxBox, CollisionMethod::DepthOnly] {
            let (viewport, mut lines) = (Viewport::new(16, 16).unwrap(), std::collections::HashSet::new());
            let mut gpu = Gpu::new(&hardware, |_, of_packet| {
                of_packet.iter().for_each(|access| lines.extend(access.written()));
            })
            .unwrap();
            let mut passes = PassesOnGpu::new((method, viewport, 1), &objects, &mut gpu);
            let answers = passes.answers;
            let set =
                super::super::Sweeps { method, resolution: 16, bins: 1 }.detect_on(&objects, &mut passes);
            assert!(!set.is_empty());
            let marks: u32 = passes.picture.pixels.iter().map(|pixel| pixel[1]).sum();
            let Emitted { fragments, .. } = passes.finish().unwrap();
            let counts = gpu.finish().counts();
            // A box is eight words, an answer one; by depth alone, one direction is enough for a mark.
            let words = counts[Event::DepthWrites] % 8;
            assert!(method == CollisionMethod::DepthOnly || words == u64::from(marks % 8), "{method:?}");
            assert!(fragments > 0 && marks > 0);
            assert!(lines.contains(&((answers.address() / 64) as u32)), "{method:?}");
        }
    }

    #[test]
    fn counts_become_colours() {
        let object =
            |x: f64| Object::from_ends(vec![[[[x, 0.0, 0.0], [x, 1.0, 0.0], [x, 0.0, 1.0]]; 2]], 0.0);
        let objects: Vec<Object> = [0.0, 4.0].into_iter().filter_map(object).collect();
        let mut picture = Picture::new(&objects, 2);
        assert_eq!(picture.image(), [Vec3::ONE; 12]);
        picture.pixels[0] = [1, 0];
        picture.pixels[1] = [9, 0];
        picture.pixels[2] = [9, 1];
        assert_eq!(picture.image()[..4], [DRAWN[0], DRAWN[1], OVERLAPPING[1], Vec3::ONE]);
    }
}
