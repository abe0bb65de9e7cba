//! What is added up while a stream is written.

use activity::{Counts, Event, LineAccess, PacketCounts, Unit};

use super::alone::Alone;
use super::banks::Banks;
use crate::LINE_BYTES;
use crate::clock::{Clocks, Time};
use crate::job::{CLIENTS, Job, Jobs, Place, TEXTURE_PORT, port};
use crate::spec::MachineSpec;

/// What the units owe, in their own cycles; the cores in operations, the L2 and memory in lines.
pub(super) type Owed = [u64; Unit::COUNT];

/// The packets of one path that are in the queues together.
#[derive(Clone, Debug, Default)]
pub(super) struct Stretch {
    pub path: usize,
    pub phase: usize,
    pub owed: Owed,
    /// Grains for which the cores are full, if each packet stays as long as it takes alone: by packets and by warps.
    pub full: [f64; 2],
    pub packets: u32,
}

/// What is known of a frame when its stream is written: what its stretches owe, and the events of its phases. It does not grow
/// with packets but with stretches.
#[derive(Clone, Debug)]
pub struct Totals {
    /// Packets in a stretch of the front end and of the tiles' way.
    reach: [u32; 2],
    /// Lines that each client of the L2 asks for in a cycle.
    lines_per_cycle: [u32; CLIENTS.len()],
    alone: Alone,
    open: [Stretch; 2],
    closed: Vec<Stretch>,
    /// Of each phase and path, what the packet that takes longest alone takes.
    pub(super) longest: Vec<[Time; 2]>,
    banks: Banks,
    /// Of each phase before the last, the time of the bank that opens rows for longest.
    rows: Vec<Time>,
    /// Events of each phase. Phase 0 is the front end of batch 0; phase `b + 1` the tiles of batch `b` and the front end of batch
    /// `b + 1`.
    pub(super) phases: Vec<Counts>,
}

pub(super) const PATHS: [&[Place]; 2] = [
    &[Place::Command, Place::Vertex, Place::Setup],
    &[
        Place::Traversal,
        Place::ZCull,
        Place::SampleTest,
        Place::Depth,
        Place::ShadingCache,
        Place::Pixel,
        Place::Colour,
    ],
];

impl Totals {
    /// Nothing, so far.
    pub fn new(machine: &MachineSpec, clocks: &Clocks) -> Self {
        let queue = |place: &Place| machine.common(place.unit()).queue;
        let open = |path| Stretch { path, phase: path, ..Stretch::default() };
        Self {
            reach: PATHS.map(|path| path.iter().map(queue).sum()),
            lines_per_cycle: CLIENTS.map(|unit| machine.common(unit).lines_per_cycle),
            alone: Alone::new(machine, clocks),
            open: [open(0), open(1)],
            closed: Vec::new(),
            longest: Vec::new(),
            banks: Banks::new(machine, clocks),
            rows: Vec::new(),
            phases: Vec::new(),
        }
    }

    /// The next packet of the stream, as a job made by `makes`, with its lines.
    pub fn add(&mut self, makes: &Jobs, job: &Job, counts: &PacketCounts, lines: &[LineAccess]) {
        let path = usize::from(!job.front);
        let phase = job.batch as usize + path;
        let open = &mut self.open[path];
        if phase != open.phase || open.packets == self.reach[path] {
            let full = std::mem::replace(open, Stretch { path, phase, ..Stretch::default() });
            self.closed.push(full);
        }
        let owed = &mut open.owed;
        // A client is busy until it has asked for its last line.
        let asks = |port: usize| job.lines[port].div_ceil(self.lines_per_cycle[port]);
        for &place in PATHS[path] {
            let asks = port(place.unit()).map_or(0, asks);
            owed[place.unit() as usize] += u64::from(job.service[place as usize].max(asks));
        }
        owed[Unit::Shader as usize] += u64::from(counts[Event::ShaderOps]);
        if job.is_textured() {
            let cycles = makes.texture_cycles(job.texels[0], job.texels[1]);
            owed[Unit::Texture as usize] += u64::from(cycles.max(asks(TEXTURE_PORT)));
        }
        owed[Unit::L2 as usize] += job.lines.iter().map(|&lines| u64::from(lines)).sum::<u64>();
        let bytes = counts[Event::DramReadBytes] + counts[Event::DramWriteBytes];
        owed[Unit::Dram as usize] += u64::from(bytes / LINE_BYTES);
        let program = self.alone.program(job);
        open.full.iter_mut().zip(self.alone.full(job, program)).for_each(|(sum, part)| *sum += part);
        open.packets += 1;
        if self.phases.len() <= phase {
            self.rows.resize(phase, 0);
            if let Some(last) = self.rows.last_mut() {
                *last += self.banks.take_longest();
            }
            self.phases.resize(phase + 1, Counts::default());
            self.longest.resize(phase + 1, [0; 2]);
        }
        self.phases[phase] += counts;
        self.banks.add(lines);
        let longest = &mut self.longest[phase][path];
        *longest = (*longest).max(self.alone.packet(job, program, counts));
    }

    /// Of each phase, the time of the bank that opens rows for longest.
    pub(super) fn rows(&self) -> Vec<Time> {
        let mut rows = self.rows.clone();
        rows.resize(self.phases.len(), 0);
        if let Some(last) = rows.last_mut() {
            *last += self.banks.clone().take_longest();
        }
        rows
    }

    pub(super) fn stretches(&self) -> impl Iterator<Item = &Stretch> {
        self.closed.iter().chain(&self.open)
    }
}
