//! A group as it runs: its lanes, its shared memory and its barriers, and what they count.

use std::cell::RefCell;
use std::ops::Deref;

use activity::{Event, PacketCounts};

use super::warp::{AccessKind, LaneAccess, LineTouch, SharedAccess, SharedMemory, account};
use super::{ComputePass, ComputeSpec};
use crate::buffer::{Access, Atomic, Buffer, Buffers, Stored, Word};
use crate::shader::Lane;

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
    /// Its events, without those of lines.
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

    /// Lets all lanes wait for each other: an operation of each. What was written to shared memory before may be used by
    /// other lanes after it.
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
                let words = buffers.words(buffer);
                let range = || Fault::Range { buffer: buffers.name(buffer).to_owned(), index, words };
                (index >= words).then(range)
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
