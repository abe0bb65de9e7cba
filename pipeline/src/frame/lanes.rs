//! Lanes of a shader that runs on the tiles of conservative mode or of a full-screen pass. Everything a lane does is
//! counted as it is done: operations, accesses to memory and tests of points.
//!
//! A full-screen pass is drawn as a triangle over the image, so its lanes run in quads of pixels, with
//! helpers. Lanes of conservative mode have none: quads are there for the differences between neighbours, and
//! a tile shader has intervals in place of interpolated values. Each of its lanes stands alone and may be in
//! a warp with any others of its packet.

use std::cell::{Cell, RefCell};
use std::ops::Range;
use std::panic::Location;

use activity::{Event, PacketCounts};

use crate::depth::{Numbers, Real};
use crate::geometry::Shear;
use crate::memory::{LINE_BYTES, MemoryRange, MemorySystem};
use crate::setup::Triangle;
use crate::shader::Lane;
use crate::tally::{Costs, Kernel};
use crate::traversal::{TimeIntervals, time_interval_counted};

/// Bytes of a word of depth.
const WORD_BYTES: u64 = 4;

/// Unit that accesses memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Client {
    Depth,
    Colour,
    Texture,
}

/// An access to a range of a surface.
#[derive(Clone, Copy, Debug)]
struct Touch {
    client: Client,
    address: u64,
    bytes: u64,
    write: bool,
    /// Whether the range is overwritten whole, so that nothing is fetched.
    whole: bool,
}

impl Touch {
    fn lines(&self) -> impl Iterator<Item = u64> + use<> {
        let last = self.address + self.bytes.max(1) - 1;
        (self.address / LINE_BYTES..=last / LINE_BYTES).map(|line| line * LINE_BYTES)
    }
}

/// A program that a lane ran.
#[derive(Clone, Debug)]
pub(super) struct Run {
    /// Where the program is started in the code, which distinguishes programs.
    program: &'static Location<'static>,
    /// Its operations.
    ops: u32,
    /// Which accesses of the tile were made since the program before, up to its end.
    touches: Range<usize>,
}

/// The lanes that run for one tile.
#[derive(Debug, Default)]
pub struct Lanes {
    counts: RefCell<PacketCounts>,
    touches: RefCell<Vec<Touch>>,
    /// Programs that were run and not counted so far.
    runs: RefCell<Vec<Run>>,
    /// Accesses up to the end of the last program.
    touched: Cell<usize>,
    costs: Costs,
}

impl Lanes {
    /// Lanes that remember the costs of kernels.
    pub(super) fn remembering() -> Self {
        Self { costs: Costs::remembered(), ..Self::default() }
    }

    /// Costs of kernels that ran before.
    pub(super) fn costs(&self) -> &Costs {
        &self.costs
    }

    /// Runs a program on a lane. Only lanes that are started at one place in the code, and so run one
    /// program, share a warp.
    #[track_caller]
    pub fn run<T>(&self, program: impl FnOnce(&Lane) -> T) -> T {
        let lane = Lane::knowing(&self.costs);
        let result = program(&lane);
        let until = self.touches.borrow().len();
        let touches = self.touched.replace(until)..until;
        self.runs.borrow_mut().push(Run { program: Location::caller(), ops: lane.ops(), touches });
        result
    }

    /// The programs since the last call, which are then not counted as those of single lanes.
    pub(super) fn take_runs(&self) -> Vec<Run> {
        self.runs.take()
    }

    /// Counts the lanes of quads, by the programs that each of them ran. The n-th programs of the lanes of a
    /// warp run in step, and each takes as long as the longest. A lane without an n-th program in a quad that
    /// has one is a helper.
    pub(super) fn count_quads(&self, quads: &[[Vec<Run>; 4]], warp_lanes: u32) {
        for nth in 0..quads.as_flattened().iter().map(Vec::len).max().unwrap_or(0) {
            let mut warps = Warps::new(warp_lanes);
            for quad in quads {
                let lanes = quad.each_ref().map(|runs| runs.get(nth));
                let Some(longest) = lanes.iter().flatten().map(|run| run.ops).max() else { continue };
                warps.start(lanes.len() as u32, longest);
                self.count(Event::PixelInvocations, lanes.len() as u32);
                let helpers = (0..lanes.len()).filter(|lane| lanes[*lane].is_none());
                helpers.for_each(|lane| self.help(lane, lanes));
            }
            self.count(Event::ShaderOps, warps.ops());
        }
    }

    /// Counts a helper lane. Its fetches are those of a neighbour, as beyond the image coordinates are
    /// clamped to its border. Depth and colour of helpers are masked.
    fn help(&self, lane: usize, lanes: [Option<&Run>; 4]) {
        self.count(Event::HelperInvocations, 1);
        let neighbour = [lane ^ 1, lane ^ 2, lane ^ 3].into_iter().find_map(|beside| lanes[beside]);
        let Some(Run { touches, .. }) = neighbour else { return };
        let mut all = self.touches.borrow_mut();
        let fetched: Vec<Touch> =
            all[touches.clone()].iter().filter(|touch| touch.client == Client::Texture).copied().collect();
        self.count(Event::TextureFetches, fetched.len() as u32);
        all.extend(fetched);
    }

    /// Fetches `bytes` at an address through the texture unit.
    pub fn fetch(&self, address: u64, bytes: u64) {
        self.count(Event::TextureFetches, 1);
        self.touch(Touch { client: Client::Texture, address, bytes, write: false, whole: false });
    }

    /// Reads what is stored at the tile, through the depth unit, which works in the order of triangles.
    pub fn read(&self, target: MemoryRange, offset: u64, bytes: u64) {
        self.count(Event::DepthReads, bytes.div_ceil(WORD_BYTES) as u32);
        let address = target.address() + offset;
        self.touch(Touch { client: Client::Depth, address, bytes, write: false, whole: false });
    }

    /// Combines a result with what is stored at the tile, through the depth unit.
    pub fn merge(&self, target: MemoryRange, offset: u64, bytes: u64) {
        let words = bytes.div_ceil(WORD_BYTES) as u32;
        self.count(Event::DepthReads, words);
        self.count(Event::DepthWrites, words);
        let address = target.address() + offset;
        self.touch(Touch { client: Client::Depth, address, bytes, write: true, whole: false });
    }

    /// Adds a colour of `bytes` to the stored one.
    pub fn blend(&self, target: MemoryRange, offset: u64, bytes: u64) {
        self.count(Event::ColourWrites, 1);
        self.count(Event::SamplesBlended, 1);
        let address = target.address() + offset;
        self.touch(Touch { client: Client::Colour, address, bytes, write: true, whole: false });
    }

    /// Writes a pixel of `bytes` of an image.
    pub fn write(&self, image: MemoryRange, offset: u64, bytes: u64) {
        self.count(Event::PixelsResolved, 1);
        let address = image.address() + offset;
        self.touch(Touch { client: Client::Colour, address, bytes, write: true, whole: true });
    }

    /// Times at which a point of the image is inside a moving triangle, by face: the sample test of all times
    /// at once.
    pub fn times_at(&self, triangle: &Triangle, shear: &Shear, at: [f64; 2]) -> [TimeIntervals; 2] {
        let (times, madds) = time_interval_counted(triangle, shear, at, &self.costs);
        self.tested(madds, times.iter().any(|face| !face.as_slice().is_empty()));
        times
    }

    /// Whether a point of the image is inside a still triangle whose edges are not negative there, or off by `slack`
    /// at most.
    pub fn is_inside(&self, corners: &[[f64; 2]; 3], at: [f64; 2], slack: f64) -> bool {
        let (is_inside, madds) = self.costs.run(
            Kernel::Inside,
            |path| is_inside(path, corners, at, slack),
            |tally| _ = is_inside(tally, corners, at, slack),
        );
        self.tested(madds, is_inside);
        is_inside
    }

    fn tested(&self, madds: u32, is_inside: bool) {
        self.count(Event::SamplesTested, 1);
        self.count(Event::SampleMadds, madds);
        self.count(Event::SamplesHit, u32::from(is_inside));
    }

    fn count(&self, event: Event, count: u32) {
        self.counts.borrow_mut()[event] += count;
    }

    fn touch(&self, touch: Touch) {
        self.touches.borrow_mut().push(touch);
    }

    /// What the lanes did since the last call. Those of a program fill warps of `warp_lanes` lanes in
    /// the order in which they ran.
    pub(super) fn finish(&self, warp_lanes: u32) -> LaneWork {
        let runs = self.runs.take();
        let mut programs: Vec<(&Location<'_>, Warps)> = Vec::new();
        for Run { program, ops, .. } in &runs {
            let place = programs.iter().position(|(known, _)| known == program).unwrap_or(programs.len());
            if place == programs.len() {
                programs.push((*program, Warps::new(warp_lanes)));
            }
            programs[place].1.start(1, *ops);
        }
        self.count(Event::PixelInvocations, runs.len() as u32);
        self.count(Event::ShaderOps, programs.into_iter().map(|(_, warps)| warps.ops()).sum());
        self.touched.set(0);
        LaneWork { counts: self.counts.take(), touches: self.touches.take() }
    }
}

/// Whether a point is on the inner side of each edge of a triangle, or off by `slack` at most.
fn is_inside<N: Numbers>(numbers: N, corners: &[[f64; 2]; 3], at: [f64; 2], slack: f64) -> bool {
    let [x, y] = at.map(|value| numbers.number(value));
    let seen = corners.map(|corner| {
        let [a, b] = corner.map(|value| numbers.number(value));
        [a - x, b - y]
    });
    [(0, 1), (1, 2), (2, 0)].iter().all(|&(i, j): &(usize, usize)| {
        let edge = seen[i][0] * seen[j][1] - seen[j][0] * seen[i][1];
        numbers.branch(edge.value() >= -slack)
    })
}

/// What the lanes of some tiles did.
#[derive(Clone, Debug, Default)]
pub(super) struct LaneWork {
    counts: PacketCounts,
    touches: Vec<Touch>,
}

impl LaneWork {
    /// Adds the counts, and the accesses in order. `is_cleared` says whether a line has held nothing but the
    /// clear value so far.
    pub fn add_to(
        &self,
        counts: &mut PacketCounts,
        memory: &mut MemorySystem,
        mut is_cleared: impl FnMut(u64) -> bool,
    ) {
        *counts += &self.counts;
        for touch in &self.touches {
            touch.lines().for_each(|line| match touch.client {
                Client::Texture => memory.texture(line, counts),
                Client::Depth => memory.depth(line, touch.write, is_cleared(line), counts),
                Client::Colour => {
                    memory.colour(line, touch.write, touch.whole || is_cleared(line), counts);
                }
            });
        }
    }
}

/// Lanes of one packet, put into warps in the order in which they start. Each lane of a warp takes as long as
/// the longest. A warp that is not full has no other lanes: warps of other packets issue beside it.
#[derive(Debug)]
pub(super) struct Warps {
    /// Lanes of a full warp.
    lanes: u32,
    /// Lanes of the warp that is being filled, and operations of its longest.
    filled: u32,
    longest: u32,
    /// Operations of the warps before it.
    ops: u32,
}

impl Warps {
    /// No warps so far, of up to `lanes` lanes.
    pub fn new(lanes: u32) -> Self {
        Self { lanes, filled: 0, longest: 0, ops: 0 }
    }

    /// Starts some lanes in one warp, the longest of which takes `ops`. More than a warp has are a warp of their own.
    pub fn start(&mut self, lanes: u32, ops: u32) {
        if self.filled + lanes > self.lanes {
            self.end();
        }
        self.filled += lanes;
        self.longest = self.longest.max(ops);
    }

    fn end(&mut self) {
        self.ops += self.filled * self.longest;
        (self.filled, self.longest) = (0, 0);
    }

    /// Operations of all lanes.
    pub fn ops(mut self) -> u32 {
        self.end();
        self.ops
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ops(lanes: u32, started: &[(u32, u32)]) -> u32 {
        let mut warps = Warps::new(lanes);
        started.iter().for_each(|&(lanes, ops)| warps.start(lanes, ops));
        warps.ops()
    }

    #[test]
    fn a_warp_takes_as_long_as_its_longest_lane() {
        assert_eq!(ops(8, &[(4, 3), (4, 10), (4, 5)]), 8 * 10 + 4 * 5);
        assert_eq!(ops(8, &[(1, 3), (1, 4), (1, 1)]), 3 * 4);
        // Quads are not torn apart.
        assert_eq!(ops(6, &[(4, 3), (4, 10)]), 4 * 3 + 4 * 10);
        // A warp of fewer lanes than a quad runs quads one by one.
        assert_eq!(ops(2, &[(4, 3), (4, 10)]), 4 * 3 + 4 * 10);
        assert_eq!(ops(32, &[]), 0);
    }
}
