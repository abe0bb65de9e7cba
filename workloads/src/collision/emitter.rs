//! Emitter of the passes of collision detection, as packets of work and as an image.

use glam::Vec3;
use pipeline::memory::Surface;
use pipeline::{Client, Gpu, TileWork, Touch, TriangleStream};

use super::bounds::Bounds;
use super::object::Object;
use super::pass::{Fragment, Observer, Part, Pass};
use super::{Method, Search};

/// Bytes of a vertex at both times.
const VERTEX_BYTES: u32 = 24;
/// Operations of its transformation.
const VERTEX_OPS: u32 = 24;
/// Multiply-adds of the set-up of a triangle with moving conservative edges.
const SETUP_MADDS: u32 = 77;
/// Bytes of a pixel of the image.
const PIXEL_BYTES: u64 = 4;
/// Multiply-adds of the conservative test of a triangle in a tile: three edges by four corners at both times,
/// and the depths.
const TEST_MADDS: u32 = 3 * 4 * 2 * 2 + 18;
/// Bytes of a box of time and depth: four numbers of 16 bits.
const BOX_BYTES: u64 = 8;

/// Boxes that the fragments of an object are compared with.
#[derive(Clone, Copy)]
struct Target {
    address: u64,
    /// Whether the fragments enlarge the boxes.
    write: bool,
}

/// Boxes of the first and of the second object. Each has its own when boxes are compared with boxes;
/// otherwise the second only reads those of the first.
fn targets(method: Method, boxes: [Surface; 2]) -> [Target; 2] {
    let [first, second] = boxes.map(|boxes| Target { address: boxes.address(), write: true });
    [first, if method == Method::BoxBox { second } else { Target { write: false, ..first } }]
}

/// Observer that emits packets and draws the image.
pub(super) struct PacketEmitter<'a, 'e> {
    gpu: &'a mut Gpu<'e>,
    tile_px: u32,
    stream: TriangleStream,
    picture: Picture,
    side: usize,
    bins: u32,
    targets: [Target; 2],
    fragments: u64,
    /// Fragments of one triangle in one hardware tile, not yet emitted.
    pending: Option<Pending>,
}

/// Fragments of one packet.
struct Pending {
    tile: u32,
    item: u32,
    which: usize,
    fragments: u32,
    /// Bit mask of the touched pixels of the tile.
    pixels: u64,
    first_place: u64,
}

/// Image and number of fragments of the emitted work.
pub(super) struct Emitted {
    pub image: Vec<Vec3>,
    pub fragments: u64,
}

impl<'a, 'e> PacketEmitter<'a, 'e> {
    /// Makes an emitter for the passes of `search` over `objects` on `gpu`.
    pub fn new(search: &Search, objects: &[Object], gpu: &'a mut Gpu<'e>) -> Self {
        let side = search.resolution as usize;
        let tile_px = gpu.spec().tile_px;
        let most = objects.iter().map(Object::len).max().unwrap_or(0) as u64;
        let vertices = gpu.surface(3 * most * u64::from(VERTEX_BYTES));
        let stream = TriangleStream {
            vertices,
            vertex_bytes: VERTEX_BYTES,
            vertex_ops: VERTEX_OPS,
            setup_madds: SETUP_MADDS,
        };
        let pixels = u64::from(search.resolution.next_multiple_of(tile_px)).pow(2);
        let boxes = [(); 2].map(|()| gpu.surface(pixels * u64::from(search.bins) * BOX_BYTES));
        let (picture, targets) = (Picture::new(objects, side), targets(search.method, boxes));
        let (bins, fragments, pending) = (search.bins, 0, None);
        Self { gpu, tile_px, stream, picture, side, bins, targets, fragments, pending }
    }

    /// Emits the writes of the image and returns the totals.
    pub fn finish(mut self) -> Emitted {
        self.flush();
        let image = self.picture.image();
        let surface = self.gpu.surface(image.len() as u64 * PIXEL_BYTES);
        self.gpu.begin("image", None);
        self.gpu.write_image(surface, self.tile_px.pow(2));
        Emitted { image, fragments: self.fragments }
    }

    /// Hardware tile of a pixel, and the pixel's position in it.
    fn tile(&self, [x, y]: [u32; 2]) -> (u32, u32) {
        let side = self.tile_px;
        (y / side * (self.side as u32).div_ceil(side) + x / side, y % side * side + x % side)
    }

    /// Emits the pending packet.
    pub fn flush(&mut self) {
        let Some(pending) = self.pending.take() else { return };
        let pixels = pending.pixels.count_ones();
        let target = self.targets[pending.which];
        let work = TileWork {
            tile: pending.tile,
            triangle: Some(pending.item),
            tiles: 1,
            tile_madds: pixels * TEST_MADDS,
            hits: pending.fragments,
            depths_read: pending.fragments,
            depths_written: if target.write { pending.fragments } else { 0 },
            ..TileWork::default()
        };
        let bytes = u64::from(pixels) * u64::from(self.bins) * BOX_BYTES;
        let address = target.address + pending.first_place * u64::from(self.bins) * BOX_BYTES;
        let client = Client::Depth;
        self.gpu.tile(&work, [Touch { client, address, bytes, write: target.write, fresh: false }]);
    }
}

impl Observer for PacketEmitter<'_, '_> {
    fn part(&mut self, _: &Pass, which: usize, part: Part<'_>) {
        self.flush();
        if which == 0 {
            self.gpu.begin("pair", None);
        }
        self.gpu.draw_stream(part.list.len(), &self.stream);
    }

    fn fragment(&mut self, pass: &Pass, which: usize, fragment: &Fragment) {
        self.fragments += 1;
        let (tile, place) = self.tile(fragment.tile);
        let known = self.pending.as_ref().map(|pending| (pending.tile, pending.item, pending.which));
        if known != Some((tile, fragment.item, which)) {
            self.flush();
        }
        let first_place = u64::from(tile) * u64::from(self.tile_px.pow(2)) + u64::from(place);
        let pending = self.pending.get_or_insert(Pending {
            tile,
            item: fragment.item,
            which,
            fragments: 0,
            pixels: 0,
            first_place,
        });
        pending.fragments += 1;
        pending.pixels |= 1 << place;
        self.picture.fragment(pass, fragment.tile);
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
    use super::*;

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
