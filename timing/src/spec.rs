//! The machine as its file describes it. `docs/gpu.md` documents every field.

use activity::Unit;
use serde::Deserialize;

use crate::Rates;

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
    /// Cycles from the moment a packet leaves until the next unit sees it, at least 1.
    pub latency_cycles: u32,
    /// Packets that may be in front of it or on their way to it, at least 1.
    pub queue: u32,
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
    /// Cycles from the moment a packet leaves until the next unit sees it, at least 1.
    pub latency_cycles: u32,
    /// Packets that may be in front of it or on their way to it, at least 1; warps at the texture units.
    pub queue: u32,
    /// Packets (warps) that may wait behind it for their lines, at least 1.
    pub in_flight: u32,
    /// Lines it can ask the L2 for in a cycle.
    #[serde(default = "one")]
    pub lines_per_cycle: u32,
    /// Events per cycle.
    pub rates: Rates,
}

/// The most of anything: more is a slip of the pen, and would take for ever.
const MOST: u32 = 1 << 20;
/// The fewest events of a cycle.
const SLOWEST: f64 = 1e-6;

fn one() -> u32 {
    1
}

/// The shader cores.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ShaderSpec {
    /// The clock its cycles are counted in.
    #[serde(default)]
    pub clock: Clock,
    /// Cycles from the end of a packet's last warp until the next unit sees it, at least 1.
    pub latency_cycles: u32,
    /// Packets of vertices, and as many of pixels, that may wait in front.
    pub queue: u32,
    /// Packets of vertices, and as many of pixels, whose warps may be on the cores.
    pub in_flight: u32,
    /// Cores.
    pub cores: u32,
    /// Lanes of a core: operations per cycle.
    pub lanes: u32,
    /// Threads that go through a shader together, at most.
    pub warp_lanes: u32,
    /// Warps a core can hold.
    pub warps: u32,
    /// Cycles from an operation of a warp to its next.
    pub alu_latency_cycles: u32,
}

/// The cache shared by all.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct L2Spec {
    /// The clock its cycles are counted in.
    #[serde(default)]
    pub clock: Clock,
    /// Cycles from the moment a request is taken, or its line has come from memory, until the client has it; at least 1.
    pub latency_cycles: u32,
    /// Requests that may wait in front of it, of each client.
    pub queue: u32,
    /// Lines it takes in a cycle.
    pub lines_per_cycle: u32,
}

/// Memory chips.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DramSpec {
    /// The clock its cycles are counted in.
    #[serde(default)]
    pub clock: Clock,
    /// Cycles a request spends in the controller and on the way, beside what the chips take; at least 1.
    pub latency_cycles: u32,
    /// Lines that may wait at a channel, at least 2.
    pub queue: u32,
    /// Channels, a power of two not asked for.
    pub channels: u32,
    /// Banks of a channel.
    pub banks: u32,
    /// Bytes of a row in a channel.
    pub row_bytes: u32,
    /// Bytes after which addresses go on in the next channel.
    pub interleave_bytes: u32,
    /// Cycles for which a line occupies the data bus of its channel.
    pub burst_cycles: u32,
    /// Cycles from a column command to the first data (CL).
    pub cas_cycles: u32,
    /// Cycles from opening a row to the first column command (tRCD).
    pub activate_cycles: u32,
    /// Cycles to close a row (tRP).
    pub precharge_cycles: u32,
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
        Common { clock, latency_cycles, queue, in_flight: 0, lines_per_cycle: 0, rates: Some(rates) }
    }
}

impl ClientSpec {
    fn common(&self) -> Common<'_> {
        let Self { clock, latency_cycles, queue, in_flight, lines_per_cycle, ref rates } = *self;
        Common { clock, latency_cycles, queue, in_flight, lines_per_cycle, rates: Some(rates) }
    }
}

impl MachineSpec {
    /// What `unit` has in common with the others.
    pub fn common(&self, unit: Unit) -> Common<'_> {
        let bare = |clock, latency_cycles, queue, in_flight| Common {
            clock,
            latency_cycles,
            queue,
            in_flight,
            lines_per_cycle: 0,
            rates: None,
        };
        match unit {
            Unit::Command => self.command.common(),
            Unit::Shader => {
                let s = &self.shader;
                bare(s.clock, s.latency_cycles, s.queue, s.in_flight)
            }
            Unit::Setup => self.setup.common(),
            Unit::Traversal => self.traversal.common(),
            Unit::ZCull => self.z_cull.common(),
            Unit::SampleTest => self.sample_test.common(),
            Unit::Depth => self.depth.common(),
            Unit::ShadingCache => self.shading_cache.common(),
            Unit::Texture => self.texture.common(),
            Unit::Colour => self.colour.common(),
            Unit::L2 => bare(self.l2.clock, self.l2.latency_cycles, self.l2.queue, 0),
            Unit::Dram => bare(self.dram.clock, self.dram.latency_cycles, self.dram.queue, 0),
        }
    }

    /// The first value that cannot be, and what would do.
    ///
    /// # Errors
    /// That, in words that name the field below `units`.
    pub fn validate(&self) -> Result<(), String> {
        for unit in Unit::ALL {
            let common = self.common(unit);
            let name = unit.name();
            if common.queue == 0 {
                return Err(format!("`units.{name}.queue` is 0; a queue holds at least 1 packet"));
            }
            if common.latency_cycles == 0 {
                return Err(format!(
                    "`units.{name}.latency_cycles` is 0; nothing is seen before the next cycle, so it is at least 1"
                ));
            }
            if common.latency_cycles > MOST {
                return Err(format!(
                    "`units.{name}.latency_cycles` is {}; it has to be 1 to {MOST}",
                    common.latency_cycles
                ));
            }
            let slow = common.rates.and_then(|rates| rates.iter().find(|(_, rate)| *rate < SLOWEST));
            if let Some((event, rate)) = slow {
                let event = event.name();
                return Err(format!(
                    "`units.{name}.rates` has {rate:e} `{event}` a cycle; it has to be at least {SLOWEST:e}"
                ));
            }
            let foreign = common.rates.and_then(|rates| rates.iter().find(|(event, _)| event.unit() != unit));
            if let Some((event, _)) = foreign {
                let (event, owner) = (event.name(), event.unit().name());
                return Err(format!("`units.{name}.rates` has `{event}`; it belongs in `units.{owner}`"));
            }
        }
        self.validate_sizes()
    }

    fn validate_sizes(&self) -> Result<(), String> {
        let (shader, dram) = (&self.shader, &self.dram);
        let sizes = [
            ("command.in_flight", self.command.in_flight, 1),
            ("depth.in_flight", self.depth.in_flight, 1),
            ("texture.in_flight", self.texture.in_flight, 1),
            ("colour.in_flight", self.colour.in_flight, 1),
            ("command.lines_per_cycle", self.command.lines_per_cycle, 1),
            ("depth.lines_per_cycle", self.depth.lines_per_cycle, 1),
            ("texture.lines_per_cycle", self.texture.lines_per_cycle, 1),
            ("colour.lines_per_cycle", self.colour.lines_per_cycle, 1),
            ("shader.in_flight", shader.in_flight, 1),
            ("shader.cores", shader.cores, 1),
            ("shader.lanes", shader.lanes, 1),
            ("shader.warp_lanes", shader.warp_lanes, 1),
            ("shader.warps", shader.warps, 1),
            ("shader.alu_latency_cycles", shader.alu_latency_cycles, 1),
            ("l2.lines_per_cycle", self.l2.lines_per_cycle, 1),
            ("dram.queue", dram.queue, 2),
            ("dram.channels", dram.channels, 1),
            ("dram.banks", dram.banks, 1),
            ("dram.burst_cycles", dram.burst_cycles, 1),
            ("dram.cas_cycles", dram.cas_cycles, 0),
            ("dram.activate_cycles", dram.activate_cycles, 0),
            ("dram.precharge_cycles", dram.precharge_cycles, 0),
            ("dram.row_bytes", dram.row_bytes, crate::LINE_BYTES),
            ("dram.interleave_bytes", dram.interleave_bytes, crate::LINE_BYTES),
        ];
        match sizes.iter().find(|(_, value, least)| !(*least..=MOST).contains(value)) {
            Some((field, value, least)) => {
                Err(format!("`units.{field}` is {value}; it has to be {least} to {MOST}"))
            }
            None => Ok(()),
        }
    }
}
