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

use super::warps::Warps;
use crate::depth::{Numbers, Real};
use crate::geometry::Shear;
use crate::memory::{LINE_BYTES, MemoryRange};
use crate::setup::Triangle;
use crate::shader::Lane;
use crate::tally::{Costs, Kernel};
use crate::traversal::{TimeIntervals, time_interval_counted};

/// Bytes of a word.
const WORD_BYTES: u64 = 4;

/// A line that the texture unit reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Read {
    /// How many loads its program made before, if it is one; `None` for a fetch.
    load: Option<u32>,
    line: u64,
}

/// A line that the units of depth or of colour access.
#[derive(Clone, Copy, Debug)]
pub(super) struct TargetLine {
    /// Address of the line.
    pub line: u64,
    /// Whether anything is written.
    pub write: bool,
}

/// Addresses of the lines of a range.
pub(super) fn lines(address: u64, bytes: u64) -> impl Iterator<Item = u64> {
    let last = address + bytes.max(1) - 1;
    (address / LINE_BYTES..=last / LINE_BYTES).map(|line| line * LINE_BYTES)
}

/// Words of a range, the last of which may be a part of one.
fn words(bytes: u64) -> u32 {
    bytes.div_ceil(WORD_BYTES) as u32
}

/// A program that a lane ran.
#[derive(Clone, Debug)]
pub(super) struct Run {
    /// Where the program is started in the code, which distinguishes programs.
    program: &'static Location<'static>,
    /// Its operations.
    ops: u32,
    /// What it read: the reads since the program before, up to its end.
    reads: Range<usize>,
}

/// The lanes that run for one tile.
#[derive(Debug, Default)]
pub struct Lanes {
    counts: RefCell<PacketCounts>,
    reads: RefCell<Vec<Read>>,
    depths: RefCell<Vec<TargetLine>>,
    colours: RefCell<Vec<TargetLine>>,
    /// Programs that were run and not counted so far.
    runs: RefCell<Vec<Run>>,
    /// Reads up to the end of the last program, and loads since then.
    ended: Cell<usize>,
    loads: Cell<u32>,
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
        self.end_program(Location::caller(), lane.ops());
        result
    }

    /// Ends a program of `ops` operations besides its loads, which are one each.
    fn end_program(&self, program: &'static Location<'static>, ops: u32) {
        let until = self.reads.borrow().len();
        let reads = self.ended.replace(until)..until;
        self.runs.borrow_mut().push(Run { program, ops: ops + self.loads.take(), reads });
    }

    /// The programs since the last call, which are then not counted as those of single lanes. What was read after the
    /// last of them is a program of its own.
    #[track_caller]
    pub(super) fn take_runs(&self) -> Vec<Run> {
        if self.reads.borrow().len() > self.ended.get() {
            self.end_program(Location::caller(), 0);
        }
        self.runs.take()
    }

    /// Counts the lanes of quads, by the programs that each of them ran. Those n-th programs of the lanes of a warp that
    /// are the same run in step, as long as the longest. A lane without an n-th program in a quad that has one is a
    /// helper. Quads read one after the other, as in passes of triangles.
    pub(super) fn count_quads(&self, quads: &[[Vec<Run>; 4]], warp_lanes: u32) {
        let (all, mut read) = (self.reads.take(), Vec::new());
        let steps = quads.as_flattened().iter().map(Vec::len).max().unwrap_or(0);
        let mut programs: Vec<Programs> = (0..steps).map(|_| Programs::default()).collect();
        for quad in quads {
            for (nth, programs) in programs.iter_mut().enumerate() {
                let lanes = quad.each_ref().map(|runs| runs.get(nth));
                let helpers = lanes.iter().filter(|lane| lane.is_none()).count();
                if helpers == lanes.len() {
                    break;
                }
                programs.start(lanes, warp_lanes);
                self.count(Event::PixelInvocations, lanes.len() as u32);
                self.count(Event::HelperInvocations, helpers as u32);
                read.extend(self.read_by_quad(lanes, &all));
            }
        }
        self.count(Event::ShaderOps, programs.into_iter().map(Programs::ops).sum());
        self.ended.set(read.len());
        self.reads.replace(read);
    }

    /// What the lanes of a quad read with a program, as in passes of triangles: the n-th loads of the lanes are one
    /// access, which reads a line once. A helper reads what a neighbour reads, as beyond the image coordinates are
    /// clamped to its border. Depth and colour of helpers are masked.
    fn read_by_quad(&self, lanes: [Option<&Run>; 4], all: &[Read]) -> Vec<Read> {
        let of_run = |run: Option<&Run>| run.map_or(&[][..], |run| &all[run.reads.clone()]);
        let mut read: Vec<Read> = Vec::new();
        for (at, lane) in lanes.iter().enumerate() {
            let neighbour = || [at ^ 1, at ^ 2, at ^ 3].into_iter().find_map(|beside| lanes[beside]);
            if lane.is_none() {
                self.count(Event::TextureFetches, fetches(of_run(neighbour())));
            }
            read.extend(of_run(lane.or_else(neighbour)));
        }
        let (mut loads, mut read): (Vec<Read>, Vec<Read>) =
            read.into_iter().partition(|read| read.load.is_some());
        loads.sort_unstable();
        loads.dedup();
        read.extend(loads);
        read
    }

    /// Fetches a texel of `bytes` at an address. The texture unit does the work: it is no operation of the lane.
    pub fn fetch(&self, address: u64, bytes: u64) {
        self.count(Event::TextureFetches, 1);
        self.read_lines(None, address, bytes);
    }

    /// Loads `bytes` of a buffer at an address, word by word, as [`Lane::load`] does: each is an operation and a fetch.
    pub fn load(&self, address: u64, bytes: u64) {
        let count = words(bytes);
        self.count(Event::TextureFetches, count);
        let first = self.loads.replace(self.loads.get() + count);
        for word in 0..count {
            self.read_lines(Some(first + word), address + u64::from(word) * WORD_BYTES, 1);
        }
    }

    fn read_lines(&self, load: Option<u32>, address: u64, bytes: u64) {
        self.reads.borrow_mut().extend(lines(address, bytes).map(|line| Read { load, line }));
    }

    /// Reads what is stored at the tile, through the depth unit, which works in the order of triangles.
    pub fn read(&self, target: MemoryRange, offset: u64, bytes: u64) {
        self.count(Event::DepthReads, words(bytes));
        access(&self.depths, target.address() + offset, bytes, false);
    }

    /// Combines a result with what is stored at the tile, through the depth unit.
    pub fn merge(&self, target: MemoryRange, offset: u64, bytes: u64) {
        self.count(Event::DepthReads, words(bytes));
        self.count(Event::DepthWrites, words(bytes));
        access(&self.depths, target.address() + offset, bytes, true);
    }

    /// Adds a colour of `bytes` to the stored one.
    pub fn blend(&self, target: MemoryRange, offset: u64, bytes: u64) {
        self.count(Event::ColourWrites, words(bytes));
        self.count(Event::SamplesBlended, words(bytes));
        access(&self.colours, target.address() + offset, bytes, true);
    }

    /// Writes a colour of `bytes`.
    pub fn write(&self, target: MemoryRange, offset: u64, bytes: u64) {
        self.count(Event::ColourWrites, words(bytes));
        access(&self.colours, target.address() + offset, bytes, true);
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

    /// What the lanes did since the last call. Those of a program fill warps of `warp_lanes` lanes in
    /// the order in which they ran.
    pub(super) fn finish(&self, warp_lanes: u32) -> LaneWork {
        let runs = self.take_runs();
        let mut programs = Programs::default();
        runs.iter().for_each(|run| programs.of(run.program, warp_lanes).start(1, run.ops));
        self.count(Event::PixelInvocations, runs.len() as u32);
        self.count(Event::ShaderOps, programs.ops());
        self.ended.set(0);
        LaneWork {
            counts: self.counts.take(),
            reads: self.reads.take().into_iter().map(|read| read.line).collect(),
            depths: merged(self.depths.take()),
            colours: merged(self.colours.take()),
        }
    }
}

/// Warps by program: lanes of different programs do not share any.
#[derive(Default)]
struct Programs(Vec<(&'static Location<'static>, Warps)>);

impl Programs {
    fn of(&mut self, program: &'static Location<'static>, warp_lanes: u32) -> &mut Warps {
        let place = self.0.iter().position(|(known, _)| *known == program).unwrap_or(self.0.len());
        if place == self.0.len() {
            self.0.push((program, Warps::new(warp_lanes)));
        }
        &mut self.0[place].1
    }

    /// Starts a quad in each program that any of its lanes runs.
    fn start(&mut self, lanes: [Option<&Run>; 4], warp_lanes: u32) {
        for (at, run) in lanes.iter().enumerate().filter_map(|(at, run)| Some((at, (*run)?))) {
            let same = |other: &&&Run| other.program == run.program;
            if lanes[..at].iter().flatten().any(|other| same(&other)) {
                continue;
            }
            let longest = lanes.iter().flatten().filter(same).map(|run| run.ops).max().unwrap_or(0);
            self.of(run.program, warp_lanes).start(lanes.len() as u32, longest);
        }
    }

    /// Operations of all lanes.
    fn ops(self) -> u32 {
        self.0.into_iter().map(|(_, warps)| warps.ops()).sum()
    }
}

/// Fetches of the texture unit that made these reads.
fn fetches(reads: &[Read]) -> u32 {
    reads.chunk_by(|a, b| a.load.is_some() && a.load == b.load).count() as u32
}

/// Adds the lines of a range to those of a unit.
fn access(unit: &RefCell<Vec<TargetLine>>, address: u64, bytes: u64, write: bool) {
    unit.borrow_mut().extend(lines(address, bytes).map(|line| TargetLine { line, write }));
}

/// Each line once, by address: a packet accesses a line of a target once, as in passes of triangles.
fn merged(mut lines: Vec<TargetLine>) -> Vec<TargetLine> {
    lines.sort_by_key(|access| access.line);
    lines.dedup_by(|next, kept| {
        let same = next.line == kept.line;
        if same {
            kept.write |= next.write;
        }
        same
    });
    lines
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
    pub counts: PacketCounts,
    /// Lines that the texture unit reads, in order.
    pub reads: Vec<u64>,
    /// Lines that the depth unit accesses.
    pub depths: Vec<TargetLine>,
    /// Lines that the colour unit accesses.
    pub colours: Vec<TargetLine>,
}

impl LaneWork {
    /// Writes these lines through the depth unit, or through the colour unit.
    pub fn writing(lines: &[u64], is_depth: bool) -> Self {
        let lines = lines.iter().map(|&line| TargetLine { line, write: true }).collect();
        let (depths, colours) = if is_depth { (lines, Vec::new()) } else { (Vec::new(), lines) };
        Self { depths, colours, ..Self::default() }
    }
}
