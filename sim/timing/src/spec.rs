//! The machine description, as its file gives it. `docs/gpu.md` documents every field.

use std::collections::BTreeMap;
use std::fmt;

use activity::spec::suggestion;
use activity::{Bounded, Event, LEVELS, Unit};
use serde::de::{self, MapAccess, Visitor};
use serde::{Deserialize, Deserializer};

/// Cycles, at least 1. The maximum is 65 us at 1 GHz, a hundred times the latency of memory.
pub type Cycles = Bounded<1, 65_536>;
/// Cycles, possibly none.
pub type WaitCycles = Bounded<0, 65_536>;
/// Entries of a queue: packets, warps, requests or lines. The maximum exceeds the largest machines, so such a
/// queue never fills.
pub type Entries = Bounded<1, 65_536>;
/// Actions per cycle, or copies of a piece of hardware.
pub type Width = Bounded<1, 4096>;
/// Memory channels, or banks of a channel.
pub type Chips = Bounded<1, 1024>;
/// Bytes of a row or of an interleaving step, from one line to 1 MiB.
pub type RowBytes = Bounded<{ crate::LINE_BYTES }, 1_048_576>;

/// Clock domain.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
pub enum Clock {
    /// Clock of all units but memory.
    #[default]
    Core,
    /// Clock of memory.
    Memory,
}

/// A unit that serves packets one after another and requests no lines.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct UnitSpec {
    /// Clock of its cycles.
    #[serde(default)]
    pub clock: Clock,
    /// Cycles from the departure of a packet until the next unit sees it.
    pub latency_cycles: Cycles,
    /// Packets that may wait in front of it or be on their way to it, at least 1.
    pub queue: Entries,
    /// Events per cycle. The parts of a unit work in parallel, so the slowest one sets the pace.
    pub rates: Rates,
}

/// A unit that serves packets one after another and requests lines from the L2.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClientSpec {
    /// Clock of its cycles.
    #[serde(default)]
    pub clock: Clock,
    /// Cycles from the departure of a packet until the next unit sees it.
    pub latency_cycles: Cycles,
    /// Packets that may wait in front of it or be on their way to it, at least 1; warps at the texture units.
    pub queue: Entries,
    /// Packets (warps) that may wait for their lines after service, at least 1.
    pub in_flight: Entries,
    /// Lines it can request from the L2 per cycle.
    #[serde(default = "least")]
    pub lines_per_cycle: Width,
    /// Events per cycle.
    pub rates: Rates,
}

/// What a field is that a file leaves out: one copy, no cycles, no bytes.
fn least<const MIN: u32, const MAX: u32>() -> Bounded<MIN, MAX> {
    Bounded::MIN
}

/// Shader cores.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ShaderSpec {
    /// Clock of their cycles.
    #[serde(default)]
    pub clock: Clock,
    /// Cycles from the end of a packet's last warp until the next unit sees the packet, at least 1.
    pub latency_cycles: Cycles,
    /// Packets of each kind (vertices and pixels) that may wait in front.
    pub queue: Entries,
    /// Packets of each kind whose warps may be on the cores.
    pub in_flight: Entries,
    /// Number of cores.
    pub cores: Width,
    /// Lanes per core, each one operation per cycle.
    pub lanes: Width,
    /// Largest number of threads in a warp.
    pub warp_lanes: Width,
    /// Warps that fit on a core.
    pub warps: Width,
    /// Warps that are sent to the cores in a cycle.
    #[serde(default = "least")]
    pub warps_per_cycle: Width,
    /// Cycles between consecutive operations of a warp.
    pub alu_latency_cycles: Cycles,
    /// Bytes of memory in each core that the lanes of a group share.
    #[serde(default = "least")]
    pub shared_bytes: Bounded<0, 1_048_576>,
}

/// How set-up writes bins to memory and the tile loop reads them.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BinsSpec {
    /// Packets of the tile loop that may wait for their triangles after service, at least 1.
    pub in_flight: Entries,
    /// Lines that each of both can request from the L2 per cycle.
    #[serde(default = "least")]
    pub lines_per_cycle: Width,
}

/// A cache that all clients share: the L2 or a level below it.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SharedCacheSpec {
    /// Clock of its cycles.
    #[serde(default)]
    pub clock: Clock,
    /// Cycles from the acceptance of a hit, or from the arrival of a line from below, until the client or the level
    /// above has the line; at least 1.
    pub latency_cycles: Cycles,
    /// Requests of each client that may wait in front of the L2, or requests of the L2 in front of a level below
    /// it.
    pub queue: Entries,
    /// Lines it accepts per cycle.
    pub lines_per_cycle: Width,
}

/// Refresh of the chips: every `interval_cycles` all banks of a rank close and are out of use for `busy_cycles`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RefreshSpec {
    /// Cycles between the refreshes of a rank (tREFI); ranks take turns.
    pub interval_cycles: Cycles,
    /// Cycles until a row can open again (tRFC).
    pub busy_cycles: Cycles,
}

/// Memory chips. Constraints of the chips that a file leaves out are not modelled: they are 0, and there is one rank
/// without refresh.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DramSpec {
    /// Clock of their cycles.
    #[serde(default)]
    pub clock: Clock,
    /// Cycles of a request in the controller and on the way, in addition to the time of the chips; at least
    /// 1.
    pub latency_cycles: Cycles,
    /// Lines that may wait at a channel, at least 2; lines to read if there is a `write_queue`.
    pub queue: Bounded<2, 65_536>,
    /// Lines to write that may wait at a channel. Reads go first until it is full or no read waits; then all
    /// writes in it go. Without it reads and writes share `queue`, and any line may go first.
    #[serde(default)]
    pub write_queue: Option<Entries>,
    /// Channels; not necessarily a power of two.
    pub channels: Chips,
    /// Ranks per channel: sets of chips that share its bus.
    #[serde(default = "least")]
    pub ranks: Chips,
    /// Banks per rank.
    pub banks: Chips,
    /// Bytes per row of a channel.
    pub row_bytes: RowBytes,
    /// Consecutive bytes in a channel before addresses move on to the next one.
    pub interleave_bytes: RowBytes,
    /// Cycles of a line on the data bus of its channel.
    pub burst_cycles: Cycles,
    /// Cycles from a column command to the first data (CL).
    pub cas_cycles: WaitCycles,
    /// Cycles from the activation of a row to the first column command (tRCD).
    pub activate_cycles: WaitCycles,
    /// The same to a first column command that writes (tRCDWR), if that is another time.
    #[serde(default)]
    pub activate_write_cycles: Option<WaitCycles>,
    /// Cycles to close a row (tRP).
    pub precharge_cycles: WaitCycles,
    /// Cycles from the activation of a row until it may close (tRAS).
    #[serde(default = "least")]
    pub row_cycles: WaitCycles,
    /// Cycles from the column command that reads a line until its row may close (tRTP, after the last burst).
    #[serde(default = "least")]
    pub read_to_precharge_cycles: WaitCycles,
    /// Cycles from the column command that writes a line until its row may close (CWL, burst and tWR).
    #[serde(default = "least")]
    pub write_to_precharge_cycles: WaitCycles,
    /// Cycles between the activations of rows in a rank (tRRD).
    #[serde(default = "least")]
    pub activate_to_activate_cycles: WaitCycles,
    /// Cycles in which a rank opens at most four rows (tFAW).
    #[serde(default = "least")]
    pub four_activates_cycles: WaitCycles,
    /// Cycles without commands for lines from a write to a read of the same rank (CWL + tWTR).
    #[serde(default = "least")]
    pub write_to_read_cycles: WaitCycles,
    /// Cycles without commands for lines from a read to a write (CL - CWL and the turn of the bus).
    #[serde(default = "least")]
    pub read_to_write_cycles: WaitCycles,
    /// Cycles for which the bus idles between lines of different ranks (tRTRS).
    #[serde(default = "least")]
    pub rank_to_rank_cycles: WaitCycles,
    /// Refresh; none if missing.
    #[serde(default)]
    pub refresh: Option<RefreshSpec>,
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
    #[serde(default)]
    pub bins: Option<BinsSpec>,
    #[serde(default)]
    pub compute: Option<ClientSpec>,
    pub l2: SharedCacheSpec,
    #[serde(default)]
    pub llc: Option<SharedCacheSpec>,
    #[serde(default)]
    pub edram: Option<SharedCacheSpec>,
    pub dram: DramSpec,
}

/// Properties that all units with packets share.
#[derive(Clone, Copy, Debug)]
pub struct Common<'a> {
    /// Clock domain.
    pub clock: Clock,
    /// Cycles until the next unit sees a packet.
    pub latency_cycles: u32,
    /// Packets in the input queue.
    pub queue: u32,
    /// Packets that may wait for lines; 0 for units without lines.
    pub in_flight: u32,
    /// Lines requested per cycle; 0 for units without lines.
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

impl SharedCacheSpec {
    fn common(&self) -> Common<'_> {
        Common {
            clock: self.clock,
            latency_cycles: self.latency_cycles.get(),
            queue: self.queue.get(),
            in_flight: 0,
            lines_per_cycle: 0,
            rates: None,
        }
    }
}

impl MachineSpec {
    /// The levels below the L2, in the order of [`LEVELS`].
    pub fn levels(&self) -> [Option<&SharedCacheSpec>; LEVELS.len()] {
        [self.llc.as_ref(), self.edram.as_ref()]
    }

    /// Groups of `warps` warps and `shared_bytes` bytes that fit on a core at once.
    pub fn groups_per_core(&self, warps: u32, shared_bytes: u32) -> u32 {
        let by_memory = self.shader.shared_bytes.get().checked_div(shared_bytes).unwrap_or(u32::MAX);
        by_memory.min(self.shader.warps.get() / warps.max(1))
    }

    /// Whether it has `unit`; only the compute unit and the levels below the L2 can be missing.
    pub fn has(&self, unit: Unit) -> bool {
        match unit {
            Unit::Compute => self.compute.is_some(),
            Unit::Llc => self.llc.is_some(),
            Unit::Edram => self.edram.is_some(),
            _ => true,
        }
    }

    /// Shared properties of `unit`; for one that is missing, those of the L2, or of the texture units for compute.
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
            Unit::Setup => self.with_bins(self.setup.common(), false),
            Unit::Traversal => self.with_bins(self.traversal.common(), true),
            Unit::ZCull => self.z_cull.common(),
            Unit::SampleTest => self.sample_test.common(),
            Unit::Depth => self.depth.common(),
            Unit::ShadingCache => self.shading_cache.common(),
            Unit::Texture => self.texture.common(),
            Unit::Colour => self.colour.common(),
            Unit::Compute => self.compute.as_ref().unwrap_or(&self.texture).common(),
            Unit::L2 => self.l2.common(),
            Unit::Llc => self.llc.as_ref().unwrap_or(&self.l2).common(),
            Unit::Edram => self.edram.as_ref().unwrap_or(&self.l2).common(),
            Unit::Dram => bare(self.dram.clock, self.dram.latency_cycles, self.dram.queue.get(), 0),
        }
    }

    /// A unit that reads or writes bins. Nothing waits for what is written.
    fn with_bins<'a>(&self, common: Common<'a>, reads: bool) -> Common<'a> {
        let Some(bins) = self.bins else { return common };
        let in_flight = if reads { bins.in_flight.get() } else { 0 };
        Common { in_flight, lines_per_cycle: bins.lines_per_cycle.get(), ..common }
    }

    /// Check that every rate belongs to the unit it is written for, and that a channel of memory can queue
    /// all lines of a request. Types check all single fields.
    ///
    /// # Errors
    /// The first wrong value: its field, such as `depth.rates`, and the message.
    pub fn validate(&self) -> Result<(), (String, String)> {
        if let Some(compute) = &self.compute {
            let timed = DataUnit::Compute.events();
            let mut rates = compute.rates.iter().filter(|(event, _)| event.unit() == Unit::Compute);
            if let Some((event, _)) = rates.find(|(event, _)| !timed.contains(event)) {
                let [first, second, third] = timed.map(Event::name);
                let message = format!(
                    "`units.compute.rates` has `{}`, which takes no time; it may have `{first}`, `{second}` and `{third}`",
                    event.name()
                );
                return Err(("compute.rates".to_owned(), message));
            }
        }
        for unit in Unit::ALL.into_iter().filter(|&unit| self.has(unit)) {
            let foreign = |rates: &Rates| rates.iter().find(|(event, _)| event.unit() != unit);
            if let Some((event, _)) = self.common(unit).rates.and_then(foreign) {
                let (unit, event, owner) = (unit.name(), event.name(), event.unit().name());
                let message = format!("`units.{unit}.rates` has `{event}`; it belongs in `units.{owner}`");
                return Err((format!("{unit}.rates"), message));
            }
        }
        let levels = self.levels().into_iter().flatten().count() as u32;
        let (queue, least) = (self.dram.queue.get(), 2 + levels);
        if queue < least {
            let message = format!(
                "`queue` of `units.dram` is {queue}; below the L2 and {levels} more levels it has to be at least {least}, as a \
                 request reads a line and each level may write one back"
            );
            return Err(("dram.queue".to_owned(), message));
        }
        self.dram.validate(1 + levels)
    }
}

impl DramSpec {
    /// Check what single fields cannot: a request may write `most_written` lines to a channel, and chips work
    /// between refreshes.
    fn validate(&self, most_written: u32) -> Result<(), (String, String)> {
        if let Some(queue) = self.write_queue.map(|queue| queue.get()).filter(|&queue| queue < most_written) {
            let message = format!(
                "`write_queue` of `units.dram` is {queue}; it has to be at least {most_written}, as the L2 and each level below it \
                 may write a line back for one request"
            );
            return Err(("dram.write_queue".to_owned(), message));
        }
        let Some(refresh) = self.refresh else { return Ok(()) };
        let [interval, busy] = [refresh.interval_cycles, refresh.busy_cycles].map(|cycles| cycles.get());
        let least = 2 * (busy + self.precharge_cycles.get() + self.activate_cycles.get());
        if interval < least {
            let message = format!(
                "`refresh.interval_cycles` of `units.dram` is {interval}; it has to be at least {least}, twice the time to close the \
                 rows, refresh and open one again, or memory does little else"
            );
            return Err(("dram.refresh.interval_cycles".to_owned(), message));
        }
        Ok(())
    }
}

/// Smallest rate in events per cycle: one in 10,000 cycles.
const MIN_RATE: f64 = 1e-4;
/// Largest rate in events per cycle, practically unlimited.
const MAX_RATE: f64 = 1e9;

/// Events per cycle of one unit, each 1e-4 to 1e9. Events without a rate take no time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Rates(BTreeMap<Event, f64>);

impl Rates {
    /// Every event with its rate, in declaration order.
    pub fn iter(&self) -> impl Iterator<Item = (Event, f64)> + '_ {
        self.0.iter().map(|(&event, &rate)| (event, rate))
    }

    /// All of them times `factor`, within their limits.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        Self(self.iter().map(|(event, rate)| (event, (rate * factor).clamp(MIN_RATE, MAX_RATE))).collect())
    }
}

impl<'de> Deserialize<'de> for Rates {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(RatesVisitor)
    }
}

struct RatesVisitor;

impl<'de> Visitor<'de> for RatesVisitor {
    type Value = Rates;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a map from event names to events per cycle")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Rates, A::Error> {
        let mut rates = BTreeMap::new();
        while let Some(name) = map.next_key::<String>()? {
            let event = Event::from_name(&name).ok_or_else(|| {
                let known = Event::ALL.map(Event::name);
                de::Error::custom(format!("unknown event `{name}`, {}", suggestion(&name, &known)))
            })?;
            let rate = map.next_value::<f64>()?;
            if !(MIN_RATE..=MAX_RATE).contains(&rate) {
                let message = format!(
                    "`{name}`: {rate:?} is out of range; a rate has to be {MIN_RATE:e} to {MAX_RATE:e} events per cycle"
                );
                return Err(de::Error::custom(message));
            }
            if rates.insert(event, rate).is_some() {
                return Err(de::Error::custom(format!("`{name}` has two rates")));
            }
        }
        Ok(Rates(rates))
    }
}

/// Events of a [`DataUnit`] that may have a rate.
pub const DATA_EVENTS: usize = 3;

/// A unit that works for warps on the cores before their operations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DataUnit {
    /// The texture units, for pixels.
    Texture,
    /// Shared memory, atomic units and buffers, for groups.
    Compute,
}

impl DataUnit {
    /// Both, in the order of their numbers.
    pub const ALL: [Self; 2] = [Self::Texture, Self::Compute];

    /// The unit.
    pub const fn unit(self) -> Unit {
        match self {
            Self::Texture => Unit::Texture,
            Self::Compute => Unit::Compute,
        }
    }

    /// Port of the unit at the L2.
    pub const fn port(self) -> usize {
        match self {
            Self::Texture => 2,
            Self::Compute => 4,
        }
    }

    /// Events of the unit that may have a rate.
    pub const fn events(self) -> [Event; DATA_EVENTS] {
        match self {
            Self::Texture => [Event::TextureFetches, Event::TextureLines, Event::TextureMisses],
            Self::Compute => [Event::SharedCycles, Event::AtomicSteps, Event::BufferLines],
        }
    }
}

#[cfg(test)]
impl MachineSpec {
    /// The units of the built-in GPU `reference`.
    pub(crate) fn reference() -> Self {
        #[derive(Deserialize)]
        struct Gpu {
            units: MachineSpec,
        }
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../run/gpus/reference.ron");
        activity::spec::load::<Gpu>(path.as_ref()).unwrap().units
    }
}
