//! Compute: groups of lanes that share memory and barriers, and work on buffers.
//!
//! A [`GroupShader`] is code that computes its results and counts its work as it runs: operations on a
//! [`Lane`], accesses to shared memory and to buffers, atomics and barriers. Lanes run one after another
//! between barriers, and the accesses of a warp are put side by side: the n-th load of a buffer by each lane
//! is one access of the warp, and so on for each kind. Where lanes leave a loop at different times this is
//! what happens; where they take different sides of a branch it is an approximation.
//!
//! What depends on order:
//!
//! - A group sees the buffers as they were before the pass. Stores and atomics of all groups take effect in
//!   the order of the groups when the pass ends. So groups run in parallel, and results are the same for any
//!   number of threads.
//! - For the same reason no atomic on a buffer returns the word before it, and a group may not load a word that it
//!   has written.
//! - Caches see the lines in the order of the groups.
//!
//! Programs read surfaces through a [`SurfaceView`].

mod warp;

use std::cell::RefCell;
use std::ops::Deref;

use activity::{Event, PacketCounts};
use glam::Vec4;
use serde::{Deserialize, Serialize};

use crate::buffer::{Access, Atomic, Buffer, BufferBinding, Buffers, Stored, Word};
use crate::memory::MemoryRange;
use crate::shader::Lane;
use crate::surface::{Format, Layout, SurfaceSpec};
pub(crate) use warp::Touched;
use warp::{AccessKind, LaneAccess, LineTouch, SharedAccess, SharedMemory, account};

/// Sizes of the hardware for groups.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ComputeSpec {
    /// Lanes of a warp, 1 to 128.
    pub warp_lanes: u32,
    /// Most lanes of a group, 1 to 4096.
    pub group_lanes: u32,
    /// Most bytes of shared memory of a group, up to 1 MiB.
    pub shared_bytes: u32,
    /// Banks of a shared memory, 1 to 128; words of four bytes lie in them in turn.
    pub banks: u32,
    /// Atomic units, 1 to 128; lines belong to them in turn.
    pub atomic_units: u32,
}

impl ComputeSpec {
    /// The first invalid field, with its value and the allowed values.
    pub(crate) fn invalid(&self) -> Option<(&'static str, u32, &'static str)> {
        let few = "it has to be 1 to 128";
        let fields = [
            ("compute.warp_lanes", self.warp_lanes, 1..=128, few),
            ("compute.group_lanes", self.group_lanes, 1..=4096, "it has to be 1 to 4096"),
            ("compute.shared_bytes", self.shared_bytes, 0..=1 << 20, "it has to be 0 to 1048576"),
            ("compute.banks", self.banks, 1..=128, few),
            ("compute.atomic_units", self.atomic_units, 1..=128, few),
        ];
        let mut wrong = fields.into_iter().filter(|(_, value, range, _)| !range.contains(value));
        wrong.next().map(|(field, value, _, allowed)| (field, value, allowed))
    }
}

/// Program of a group.
pub trait GroupShader: Sync {
    /// Runs the group: lanes with [`Group::lanes`], and barriers between them.
    fn run(&self, group: &mut Group<'_>);
}

/// A dispatch of groups.
#[derive(Clone, Copy)]
pub struct ComputePass<'a> {
    /// Name in reports.
    pub name: &'a str,
    /// Groups along x, y and z, each at least 1.
    pub groups: [u32; 3],
    /// Lanes of a group, at least 1.
    pub group_size: u32,
    /// Bytes of shared memory of a group, a multiple of four.
    pub shared_bytes: u32,
    /// Buffers that it reads and writes.
    pub bindings: &'a [BufferBinding],
    /// Program.
    pub shader: &'a dyn GroupShader,
}

/// Why groups cannot run.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ComputeError {
    /// The GPU has no compute unit.
    #[error("the GPU has no compute unit; choose one with `compute` in its file, such as `reference`")]
    Missing,
    /// There are no groups, or too many.
    #[error("{groups:?} groups; there have to be 1 to 16777216 of them")]
    Groups {
        /// Groups along each axis.
        groups: [u32; 3],
    },
    /// A group is empty or too large.
    #[error(
        "a group of {lanes} lanes; the GPU runs groups of 1 to {most}: raise `pipeline.compute.group_lanes` in its file"
    )]
    Lanes {
        /// Lanes of a group.
        lanes: u32,
        /// Most lanes of a group.
        most: u32,
    },
    /// A group has too much shared memory.
    #[error(
        "{bytes} bytes of shared memory; the GPU gives a group up to {most}, in words of 4: raise \
         `pipeline.compute.shared_bytes` in its file"
    )]
    Shared {
        /// Bytes of a group.
        bytes: u32,
        /// Most bytes of a group.
        most: u32,
    },
    /// A program did what the hardware forbids.
    #[error("group {group:?}, lane {lane}: {fault}")]
    Fault {
        /// The group.
        group: [u32; 3],
        /// Lane in the group.
        lane: u32,
        /// What it did.
        fault: Fault,
    },
}

/// Most groups of a pass.
const MAX_GROUPS: u64 = 1 << 24;

impl ComputePass<'_> {
    /// Number of groups.
    pub fn count(&self) -> u64 {
        self.groups.iter().map(|&count| u64::from(count)).product()
    }

    /// Place of group `number` along x, y and z.
    pub(crate) fn group(&self, number: u64) -> [u32; 3] {
        let [x, y] = [u64::from(self.groups[0]), u64::from(self.groups[1])];
        [number % x, number / x % y, number / x / y].map(|at| at as u32)
    }

    /// Checks the sizes against the hardware.
    pub(crate) fn check(&self, spec: Option<&ComputeSpec>) -> Result<ComputeSpec, ComputeError> {
        let spec = spec.ok_or(ComputeError::Missing)?;
        if self.groups.contains(&0)
            || self.groups.iter().any(|&n| u64::from(n) > MAX_GROUPS)
            || self.count() > MAX_GROUPS
        {
            return Err(ComputeError::Groups { groups: self.groups });
        }
        if !(1..=spec.group_lanes).contains(&self.group_size) {
            return Err(ComputeError::Lanes { lanes: self.group_size, most: spec.group_lanes });
        }
        if self.shared_bytes > spec.shared_bytes || !self.shared_bytes.is_multiple_of(4) {
            return Err(ComputeError::Shared { bytes: self.shared_bytes, most: spec.shared_bytes });
        }
        Ok(*spec)
    }
}

/// A surface that a pass stored, for programs of groups. Its words are where the pass wrote them, so that
/// caches see the same lines. Fixed functions decode values, as for the typed views of Direct3D 11.
#[derive(Clone, Copy, Debug)]
pub struct SurfaceView {
    words: Buffer<u32>,
    layout: Layout,
    format: Format,
    size: [u32; 2],
}

impl SurfaceView {
    /// A view of `words`, which are those of a surface with this layout.
    pub(crate) fn new(words: Buffer<u32>, layout: Layout, spec: &SurfaceSpec<'_>) -> Self {
        let size = [spec.viewport.width(), spec.viewport.height()];
        Self { words, layout, format: spec.format, size }
    }

    /// The surface, for a pass that reads it.
    pub fn reads(&self) -> BufferBinding {
        self.words.reads()
    }

    /// Where the surface lies in memory.
    pub fn region(&self) -> MemoryRange {
        self.words.region()
    }

    /// Width and height in pixels.
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// Samples per pixel.
    pub fn samples(&self) -> u32 {
        self.layout.samples
    }

    /// Address of a sample of a pixel; `None` outside of the image.
    pub fn address(&self, pixel: [u32; 2], sample: u32) -> Option<u64> {
        let is_inside = self.is_inside(pixel, sample);
        is_inside.then(|| self.layout.at(pixel, sample))
    }

    fn is_inside(&self, pixel: [u32; 2], sample: u32) -> bool {
        pixel[0] < self.size[0] && pixel[1] < self.size[1] && sample < self.samples()
    }

    /// First word of a sample; beyond all words outside of the image.
    fn index(&self, pixel: [u32; 2], sample: u32) -> u32 {
        if self.is_inside(pixel, sample) { self.layout.word(pixel, sample) } else { u32::MAX - 1 }
    }
}

impl GroupLane<'_, '_> {
    /// Value of a sample of a pixel, by a load of each of its words; 0 after a fault, as outside of the image.
    pub fn texel(&self, view: &SurfaceView, pixel: [u32; 2], sample: u32) -> Vec4 {
        let first = view.index(pixel, sample);
        let mut bytes = [0; Format::MAX_BYTES];
        for (word, to) in (first..).zip(bytes.chunks_exact_mut(4)).take(view.format.words() as usize) {
            to.copy_from_slice(&self.load(view.words, word).to_le_bytes());
        }
        view.format.decode(&bytes)
    }
}

/// What a program may not do.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Fault {
    /// A buffer is not bound, or only for reading.
    #[error("buffer `{0}` is not bound for this access; add it to the bindings of the pass")]
    Binding(String),
    /// An index is beyond a buffer.
    #[error("index {index} of buffer `{buffer}`, which has {words} words")]
    Range {
        /// The buffer.
        buffer: String,
        /// The index.
        index: u32,
        /// Words of the buffer.
        words: u32,
    },
    /// A group loads a word that it has written, which the model does not see before the pass ends.
    #[error(
        "index {index} of buffer `{buffer}` is loaded after the group wrote it; load it in a later pass, or use shared memory"
    )]
    Written {
        /// The buffer.
        buffer: String,
        /// The index.
        index: u32,
    },
    /// An index is beyond the shared memory.
    #[error("word {index} of the shared memory, which has {words}")]
    SharedRange {
        /// The index.
        index: u32,
        /// Words of the group.
        words: u32,
    },
    /// Two lanes use a word of shared memory without a barrier between them, and one of them writes it.
    #[error(
        "word {0} of the shared memory is used by another lane, too, and written; put a barrier between them"
    )]
    Race(u32),
}

/// What a group did.
#[derive(Debug)]
pub(crate) struct GroupLog {
    /// Events of the group, without those of lines.
    pub counts: PacketCounts,
    pub lines: Vec<LineTouch>,
    /// Stores and atomics that have yet to take effect.
    pub stored: Vec<Stored>,
    /// What it did wrong first, and the lane.
    pub fault: Option<(u32, Fault)>,
}

/// State of a running group.
struct State<'a> {
    /// As they were before the pass.
    buffers: &'a Buffers,
    /// What the pass does with each buffer.
    access: &'a [Option<Access>],
    shared: SharedMemory,
    log: GroupLog,
    /// Accesses of the current warp, and how many of each kind the current lane made.
    warp: Vec<LaneAccess>,
    made: Vec<(AccessKind, u32, u32)>,
}

/// A group of lanes.
pub struct Group<'a> {
    spec: &'a ComputeSpec,
    pass: &'a ComputePass<'a>,
    id: [u32; 3],
    state: RefCell<State<'a>>,
    /// Operations of each warp since the last barrier.
    since_barrier: Vec<u32>,
}

/// A lane of a group. Operations and branches are those of its [`Lane`]; each access is an operation, too.
pub struct GroupLane<'g, 'a> {
    lane: Lane<'static>,
    index: u32,
    state: &'g RefCell<State<'a>>,
}

/// Runs the group at `id`. `buffers` are as they were before the pass.
pub(crate) fn run<'a>(
    (pass, spec): (&'a ComputePass<'a>, &'a ComputeSpec),
    id: [u32; 3],
    buffers: &'a Buffers,
    access: &'a [Option<Access>],
) -> GroupLog {
    let warps = pass.group_size.div_ceil(spec.warp_lanes);
    let mut counts = PacketCounts::default();
    counts[Event::Groups] = 1;
    counts[Event::GroupLanes] = warps * spec.warp_lanes;
    counts[Event::GroupHelperLanes] = warps * spec.warp_lanes - pass.group_size;
    counts[Event::SharedBytes] = pass.shared_bytes;
    let log = GroupLog { counts, lines: Vec::new(), stored: Vec::new(), fault: None };
    let shared = SharedMemory::new(pass.shared_bytes);
    let state = State { buffers, access, shared, log, warp: Vec::new(), made: Vec::new() };
    let since_barrier = vec![0; warps as usize];
    let mut group = Group { spec, pass, id, state: RefCell::new(state), since_barrier };
    pass.shader.run(&mut group);
    group.meet();
    group.state.into_inner().log
}

impl<'a> Group<'a> {
    /// Place of the group along x, y and z.
    pub fn id(&self) -> [u32; 3] {
        self.id
    }

    /// Groups of the pass along x, y and z.
    pub fn groups(&self) -> [u32; 3] {
        self.pass.groups
    }

    /// Number of lanes.
    pub fn size(&self) -> u32 {
        self.pass.group_size
    }

    /// Runs `program` on all lanes, one after another. A warp takes as long as its longest lane.
    pub fn lanes(&mut self, mut program: impl FnMut(&GroupLane<'_, 'a>)) {
        let warp_lanes = self.spec.warp_lanes;
        for (warp, first) in (0..).zip((0..self.size()).step_by(warp_lanes as usize)) {
            let mut longest = 0;
            for index in first..self.size().min(first + warp_lanes) {
                self.state.get_mut().made.clear();
                let lane = GroupLane { lane: Lane::default(), index, state: &self.state };
                program(&lane);
                longest = longest.max(lane.lane.ops());
            }
            self.since_barrier[warp as usize] += longest;
            let State { warp: accesses, log, .. } = self.state.get_mut();
            log.counts[Event::ShaderOps] += longest * warp_lanes;
            account(accesses, self.spec, &mut log.counts, &mut log.lines);
        }
    }

    /// Lets all lanes wait for each other: an operation of each. What was written to shared memory before may
    /// be used by other lanes after it.
    pub fn barrier(&mut self) {
        let warps = self.since_barrier.len() as u32;
        self.since_barrier.iter_mut().for_each(|ops| *ops += 1);
        self.meet();
        let state = self.state.get_mut();
        state.shared.barrier();
        state.log.counts[Event::GroupBarriers] += warps;
        state.log.counts[Event::ShaderOps] += warps * self.spec.warp_lanes;
    }

    /// The longest warp since the last barrier sets the pace.
    fn meet(&mut self) {
        let longest = self.since_barrier.iter().copied().max().unwrap_or(0);
        self.since_barrier.fill(0);
        self.state.get_mut().log.counts[Event::GroupSteps] += longest;
    }
}

impl Deref for GroupLane<'_, '_> {
    type Target = Lane<'static>;
    fn deref(&self) -> &Lane<'static> {
        &self.lane
    }
}

impl GroupLane<'_, '_> {
    /// Number of the lane in its group.
    pub fn index(&self) -> u32 {
        self.index
    }

    /// The value of a buffer at `index`; 0 after a fault.
    pub fn load<T: Word>(&self, buffer: Buffer<T>, index: u32) -> T {
        self.lane.count(1);
        let mut state = self.state.borrow_mut();
        let is_there = state.reach(self.index, (buffer.number(), index), AccessKind::Load);
        T::of(if is_there { state.buffers.word(buffer.number(), index) } else { 0 })
    }

    /// Stores a value in a buffer. Of stores of several lanes to one word the last lane's stays.
    pub fn store<T: Word>(&self, buffer: Buffer<T>, index: u32, value: T) {
        let stored = Stored { buffer: buffer.number(), index, atomic: None, bits: value.bits() };
        self.write(stored, AccessKind::Store);
    }

    /// Changes a word of a buffer.
    pub fn atomic(&self, buffer: Buffer<u32>, index: u32, atomic: Atomic, value: u32) {
        self.write(
            Stored { buffer: buffer.number(), index, atomic: Some(atomic), bits: value },
            AccessKind::Atomic,
        );
    }

    fn write(&self, stored: Stored, kind: AccessKind) {
        self.lane.count(1);
        let mut state = self.state.borrow_mut();
        if state.reach(self.index, (stored.buffer, stored.index), kind) {
            state.log.stored.push(stored);
        }
    }

    /// Word `index` of the shared memory; 0 after a fault.
    pub fn shared<T: Word>(&self, index: u32) -> T {
        T::of(self.access_shared(index, SharedAccess::Load, AccessKind::SharedLoad))
    }

    /// Stores a value in word `index` of the shared memory.
    pub fn set_shared<T: Word>(&self, index: u32, value: T) {
        self.access_shared(index, SharedAccess::Store(value.bits()), AccessKind::SharedStore);
    }

    /// Adds to word `index` of the shared memory and returns what it was. Lanes add in their order.
    pub fn add_shared(&self, index: u32, value: u32) -> u32 {
        self.access_shared(index, SharedAccess::Add(value), AccessKind::SharedAtomic)
    }

    fn access_shared(&self, index: u32, access: SharedAccess, kind: AccessKind) -> u32 {
        self.lane.count(1);
        let mut state = self.state.borrow_mut();
        let words = state.shared.len();
        if index >= words {
            state.fault(self.index, Fault::SharedRange { index, words });
            return 0;
        }
        state.note(kind, 0, 4 * u64::from(index));
        match state.shared.access(index, self.index, access) {
            Ok(before) => before,
            Err(_) => {
                state.fault(self.index, Fault::Race(index));
                0
            }
        }
    }
}

impl State<'_> {
    /// Notes an access of `lane` to a word of a buffer, if the pass may make it.
    fn reach(&mut self, lane: u32, (buffer, index): (u32, u32), kind: AccessKind) -> bool {
        let buffers = self.buffers;
        let bound = self.access.get(buffer as usize).copied().flatten();
        let fault = match bound {
            Some(access) if kind == AccessKind::Load || access == Access::Write => {
                let (words, name) = (buffers.words(buffer), || buffers.name(buffer).to_owned());
                if index >= words {
                    Some(Fault::Range { buffer: name(), index, words })
                } else if kind == AccessKind::Load && self.has_written(buffer, index) {
                    Some(Fault::Written { buffer: name(), index })
                } else {
                    None
                }
            }
            _ => Some(Fault::Binding(buffers.name(buffer).to_owned())),
        };
        let address = buffers.address(buffer, index);
        match fault {
            Some(fault) => self.fault(lane, fault),
            None => {
                self.note(kind, buffer, address);
                return true;
            }
        }
        false
    }

    /// Whether the group wrote a word of a buffer. Few groups load buffers that they write.
    fn has_written(&self, buffer: u32, index: u32) -> bool {
        self.access[buffer as usize] == Some(Access::Write)
            && self.log.stored.iter().any(|stored| (stored.buffer, stored.index) == (buffer, index))
    }

    fn note(&mut self, kind: AccessKind, buffer: u32, address: u64) {
        let made = self.made.iter_mut().find(|(known, of, _)| (*known, *of) == (kind, buffer));
        let nth = match made {
            Some((.., count)) => {
                *count += 1;
                *count - 1
            }
            None => {
                self.made.push((kind, buffer, 1));
                0
            }
        };
        self.warp.push(LaneAccess { nth, kind, buffer, address });
    }

    fn fault(&mut self, lane: u32, fault: Fault) {
        self.log.fault.get_or_insert((lane, fault));
    }
}
