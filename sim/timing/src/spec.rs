//! The machine as its file describes it. `docs/gpu.md` documents every field.

use activity::{Bounded, Unit};
use serde::Deserialize;

use crate::Rates;

/// Cycles that something takes at least 1 of: 65,536 are 65 us at 1 GHz, a hundred times what memory takes.
pub type Cycles = Bounded<1, 65_536>;
/// Cycles that something may take none of.
pub type WaitCycles = Bounded<0, 65_536>;
/// Packets, warps, requests or lines that may wait or be under way: more than the largest machines have, and so deep that a
/// queue never fills.
pub type Entries = Bounded<1, 65_536>;
/// Things of which a unit does some in each cycle, and hardware that is there that often.
pub type Width = Bounded<1, 4096>;
/// Channels of memory, or banks of a channel.
pub type Chips = Bounded<1, 1024>;
/// Bytes of a row or of an interleaving step, from a line to 1 MiB.
pub type RowBytes = Bounded<{ crate::LINE_BYTES }, 1_048_576>;

/// A clock domain.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
pub enum Clock {
    /// That of everything but memory.
    #[default]
    Core,
    /// That of memory.
    Memory,
}

/// A unit that works on one packet after another and asks no memory.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct UnitSpec {
    /// The clock its cycles are counted in.
    #[serde(default)]
    pub clock: Clock,
    /// Cycles from the moment a packet leaves until the next unit sees it.
    pub latency_cycles: Cycles,
    /// Packets that may be in front of it or on their way to it, at least 1.
    pub queue: Entries,
    /// Events per cycle. The parts of a unit work side by side: the slowest sets the pace.
    pub rates: Rates,
}

/// A unit that works on one packet after another and asks the L2 for lines.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClientSpec {
    /// The clock its cycles are counted in.
    #[serde(default)]
    pub clock: Clock,
    /// Cycles from the moment a packet leaves until the next unit sees it.
    pub latency_cycles: Cycles,
    /// Packets that may be in front of it or on their way to it, at least 1; warps at the texture units.
    pub queue: Entries,
    /// Packets (warps) that may wait behind it for their lines, at least 1.
    pub in_flight: Entries,
    /// Lines it can ask the L2 for in a cycle.
    #[serde(default = "one")]
    pub lines_per_cycle: Width,
    /// Events per cycle.
    pub rates: Rates,
}

fn one() -> Width {
    Width::MIN
}

/// The shader cores.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ShaderSpec {
    /// The clock its cycles are counted in.
    #[serde(default)]
    pub clock: Clock,
    /// Cycles from the end of a packet's last warp until the next unit sees it, at least 1.
    pub latency_cycles: Cycles,
    /// Packets of vertices, and as many of pixels, that may wait in front.
    pub queue: Entries,
    /// Packets of vertices, and as many of pixels, whose warps may be on the cores.
    pub in_flight: Entries,
    /// Cores.
    pub cores: Width,
    /// Lanes of a core: operations per cycle.
    pub lanes: Width,
    /// Threads that go through a shader together, at most.
    pub warp_lanes: Width,
    /// Warps a core can hold.
    pub warps: Width,
    /// Cycles from an operation of a warp to its next.
    pub alu_latency_cycles: Cycles,
}

/// The cache shared by all.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct L2Spec {
    /// The clock its cycles are counted in.
    #[serde(default)]
    pub clock: Clock,
    /// Cycles from the moment a request is taken, or its line has come from memory, until the client has it; at least 1.
    pub latency_cycles: Cycles,
    /// Requests that may wait in front of it, of each client.
    pub queue: Entries,
    /// Lines it takes in a cycle.
    pub lines_per_cycle: Width,
}

/// Memory chips.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DramSpec {
    /// The clock its cycles are counted in.
    #[serde(default)]
    pub clock: Clock,
    /// Cycles a request spends in the controller and on the way, beside what the chips take; at least 1.
    pub latency_cycles: Cycles,
    /// Lines that may wait at a channel, at least 2.
    pub queue: Bounded<2, 65_536>,
    /// Channels; any number, not only powers of two.
    pub channels: Chips,
    /// Banks of a channel.
    pub banks: Chips,
    /// Bytes of a row in a channel.
    pub row_bytes: RowBytes,
    /// Bytes after which addresses go on in the next channel.
    pub interleave_bytes: RowBytes,
    /// Cycles for which a line occupies the data bus of its channel.
    pub burst_cycles: Cycles,
    /// Cycles from a column command to the first data (CL).
    pub cas_cycles: WaitCycles,
    /// Cycles from opening a row to the first column command (tRCD).
    pub activate_cycles: WaitCycles,
    /// Cycles to close a row (tRP).
    pub precharge_cycles: WaitCycles,
}

/// Every unit of the block diagram.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs, reason = "the fields are the units, documented there")]
pub struct MachineSpec {
    pub command: ClientSpec,
    pub shader: ShaderSpec,
    pub setup: UnitSpec,
    pub traversal: UnitSpec,
    pub z_cull: UnitSpec,
    pub sample_test: UnitSpec,
    pub depth: ClientSpec,
    pub shading_cache: UnitSpec,
    pub texture: ClientSpec,
    pub colour: ClientSpec,
    pub l2: L2Spec,
    pub dram: DramSpec,
}

/// What a unit has in common with every other that takes one packet after another.
#[derive(Clone, Copy, Debug)]
pub struct Common<'a> {
    /// Its clock.
    pub clock: Clock,
    /// Cycles until the next unit sees a packet.
    pub latency_cycles: u32,
    /// Packets in front.
    pub queue: u32,
    /// Packets that may wait for lines; 0 where it asks for none.
    pub in_flight: u32,
    /// Lines it asks for in a cycle; 0 where it asks for none.
    pub lines_per_cycle: u32,
    /// Events per cycle.
    pub rates: Option<&'a Rates>,
}

impl UnitSpec {
    fn common(&self) -> Common<'_> {
        let Self { clock, latency_cycles, queue, ref rates } = *self;
        let (latency_cycles, queue) = (latency_cycles.get(), queue.get());
        Common { clock, latency_cycles, queue, in_flight: 0, lines_per_cycle: 0, rates: Some(rates) }
    }
}

impl ClientSpec {
    fn common(&self) -> Common<'_> {
        Common {
            clock: self.clock,
            latency_cycles: self.latency_cycles.get(),
            queue: self.queue.get(),
            in_flight: self.in_flight.get(),
            lines_per_cycle: self.lines_per_cycle.get(),
            rates: Some(&self.rates),
        }
    }
}

impl MachineSpec {
    /// What `unit` has in common with the others.
    pub fn common(&self, unit: Unit) -> Common<'_> {
        let bare = |clock, latency_cycles: Cycles, queue, in_flight| Common {
            clock,
            latency_cycles: latency_cycles.get(),
            queue,
            in_flight,
            lines_per_cycle: 0,
            rates: None,
        };
        match unit {
            Unit::Command => self.command.common(),
            Unit::Shader => {
                let s = &self.shader;
                bare(s.clock, s.latency_cycles, s.queue.get(), s.in_flight.get())
            }
            Unit::Setup => self.setup.common(),
            Unit::Traversal => self.traversal.common(),
            Unit::ZCull => self.z_cull.common(),
            Unit::SampleTest => self.sample_test.common(),
            Unit::Depth => self.depth.common(),
            Unit::ShadingCache => self.shading_cache.common(),
            Unit::Texture => self.texture.common(),
            Unit::Colour => self.colour.common(),
            Unit::L2 => bare(self.l2.clock, self.l2.latency_cycles, self.l2.queue.get(), 0),
            Unit::Dram => bare(self.dram.clock, self.dram.latency_cycles, self.dram.queue.get(), 0),
        }
    }

    /// Checks what the types of single fields do not: that every rate is that of the unit it is written for.
    ///
    /// # Errors
    /// The first that is not: its field, such as `depth.rates`, and what is wrong with it.
    pub fn validate(&self) -> Result<(), (String, String)> {
        for unit in Unit::ALL {
            let foreign = |rates: &Rates| rates.iter().find(|(event, _)| event.unit() != unit);
            if let Some((event, _)) = self.common(unit).rates.and_then(foreign) {
                let (unit, event, owner) = (unit.name(), event.name(), event.unit().name());
                let message = format!("`units.{unit}.rates` has `{event}`; it belongs in `units.{owner}`");
                return Err((format!("{unit}.rates"), message));
            }
        }
        Ok(())
    }
}
