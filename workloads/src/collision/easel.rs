//! Passes as packets of work, and as a picture.

use activity::{Counts, Event, PacketCounts};
use glam::Vec3;
use pipeline::PipelineSpec;

use super::compare::Watch;
use super::object::Object;
use super::pass::{Fragment, Part, Pass};
use super::picture::Picture;
use super::{Method, Search};
use crate::job::{FrontEnd, Passes, TileWork, Touch};

/// Bytes of a vertex at both ends, its transformation, and the set-up of a triangle with conservative edges that move.
const FRONT_END: FrontEnd = FrontEnd { vertex_bytes: 24, vertex_ops: 24, setup_madds: 77 };
/// Multiply-adds of a conservative test of a triangle in a tile: three edges by four corners at both ends, and the depths.
const TEST_MADDS: u32 = 3 * 4 * 2 * 2 + 18;
/// Bytes of a box of time and depth: four numbers of 16 bits.
const BOX_BYTES: u64 = 8;
/// Where vertices, boxes of the first and the second object, and the image lie.
const VERTICES: u64 = 0;
const BOXES: [u64; 2] = [1 << 32, 1 << 33];
const IMAGE: u64 = 1 << 34;

/// The boxes that fragments of an object are held against.
#[derive(Clone, Copy)]
struct Target {
    address: u64,
    /// Whether they grow by that.
    write: bool,
}

/// Those of the first and of the second object: both have boxes of their own where boxes are compared with boxes, else the second
/// only reads those of the first.
fn targets(method: Method) -> [Target; 2] {
    let first = Target { address: BOXES[0], write: true };
    let second = Target { address: BOXES[1], write: true };
    [first, if method == Method::BoxBox { second } else { Target { write: false, ..first } }]
}

/// Draws what is told of passes: as packets, and as a picture.
pub(super) struct Easel<'a> {
    passes: Passes<'a>,
    spec: &'a PipelineSpec,
    picture: Picture,
    side: usize,
    bins: u32,
    targets: [Target; 2],
    fragments: u64,
    /// The fragments of one triangle in one tile of the hardware that are not told yet.
    drawn: Option<Pending>,
}

/// Fragments that travel in one packet.
struct Pending {
    tile: u32,
    item: u32,
    which: usize,
    fragments: u32,
    /// Pixels of the tile that are touched.
    pixels: u64,
    first_place: u64,
}

/// What was drawn.
pub(super) struct Sheet {
    pub image: Vec<Vec3>,
    pub counts: Counts,
    pub triangles: usize,
    pub fragments: u64,
}

impl<'a> Easel<'a> {
    /// For passes over `objects` as `search` asks for them on the hardware `spec`.
    pub fn new(search: &Search, objects: &[Object], spec: &'a PipelineSpec, passes: Passes<'a>) -> Self {
        let side = search.resolution as usize;
        let (picture, targets) = (Picture::new(objects, side), targets(search.method));
        Self { passes, spec, picture, side, bins: search.bins, targets, fragments: 0, drawn: None }
    }

    /// Writes the image.
    pub fn finish(mut self) -> Sheet {
        self.flush();
        let image = self.picture.image();
        self.passes.resolve(IMAGE, image.len() as u64, self.spec.tile_px.pow(2));
        let (counts, triangles) = self.passes.finish();
        Sheet { image, counts, triangles, fragments: self.fragments }
    }

    /// The hardware's tile of a pixel, and the pixel's place in it.
    fn tile(&self, [x, y]: [u32; 2]) -> (u32, u32) {
        let side = self.spec.tile_px;
        (y / side * (self.side as u32).div_ceil(side) + x / side, y % side * side + x % side)
    }

    /// Tells the packet that is being put together.
    pub fn flush(&mut self) {
        let Some(pending) = self.drawn.take() else { return };
        let mut counts = PacketCounts::default();
        let pixels = pending.pixels.count_ones();
        counts[Event::TilesVisited] = 1;
        counts[Event::EdgeBoundMadds] = pixels * TEST_MADDS;
        counts[Event::TileMadds] = pixels * TEST_MADDS;
        counts[Event::DepthReads] = pending.fragments;
        let target = self.targets[pending.which];
        counts[Event::DepthWrites] = if target.write { pending.fragments } else { 0 };
        counts[Event::SamplesHit] = pending.fragments;
        let bytes = u64::from(pixels) * u64::from(self.bins) * BOX_BYTES;
        let address = target.address + pending.first_place * u64::from(self.bins) * BOX_BYTES;
        let touch = Touch { address, bytes, write: target.write, fresh: false };
        let work = TileWork { tile: pending.tile, triangle: pending.item, counts };
        self.passes.tile(&work, &[touch], &[]);
    }
}

impl Watch for Easel<'_> {
    fn part(&mut self, _: &Pass, which: usize, part: Part<'_>) {
        self.flush();
        if which == 0 {
            self.passes.next();
        }
        self.passes.draw(part.list.len(), VERTICES, &FRONT_END);
    }

    fn fragment(&mut self, pass: &Pass, which: usize, fragment: &Fragment) {
        self.fragments += 1;
        let (tile, place) = self.tile(fragment.tile);
        let known = self.drawn.as_ref().map(|pending| (pending.tile, pending.item, pending.which));
        if known != Some((tile, fragment.item, which)) {
            self.flush();
        }
        let first_place = u64::from(tile) * u64::from(self.spec.tile_px.pow(2)) + u64::from(place);
        let pending = self.drawn.get_or_insert(Pending {
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

    fn left(&mut self, pass: &Pass, tile: [u32; 2]) {
        self.picture.left(pass, tile);
    }
}
