//! Structure of a GPU: its memories and logic, and its energies and watts over those of the GPU that a
//! platform was made for.

mod weights;

use activity::{Event, Unit};
use serde::Serialize;
use weights::Case;

use crate::quantity::Bound;

pub use self::weights::{INTERPOLATION, LANE_MADDS, MemoryCost, REGISTER_BYTES, Sram, SramRun, madds};

/// Memories and logic of a GPU. Equal structures have equal costs.
#[derive(Clone, Debug, PartialEq)]
pub struct Structure {
    /// Memories.
    pub memories: Vec<Memory>,
    /// Logic of each unit in FP32 multiply-adds, indexed by unit.
    pub madds: [f64; Unit::COUNT],
    /// Clock of each unit in hertz, indexed by unit.
    pub clocks_hz: [f64; Unit::COUNT],
    /// Channels of the off-chip memory.
    pub channels: f64,
}

/// A memory of a unit.
#[derive(Clone, Debug, PartialEq)]
pub struct Memory {
    /// Name, one of its unit. A memory is compared with the one of its name on another GPU.
    pub name: &'static str,
    /// Unit of the memory.
    pub unit: Unit,
    /// Bytes of one copy.
    pub bytes: f64,
    /// Bytes of one access.
    pub width_bytes: f64,
    /// Accesses to one copy that can begin in a cycle. Below 1 it costs as 1.
    pub accesses: f64,
    /// Copies, such as one for each core.
    pub copies: f64,
    /// Events whose energy depends on it.
    pub charges: Vec<Charge>,
}

/// Part of the energy of an event that depends on the size of a memory.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Charge {
    /// Event.
    pub event: Event,
    /// Share of its energy that is an access of the memory.
    pub array: f64,
    /// Share that is the way to or from the memory, which grows with the memory's side.
    pub way: f64,
}

impl Charge {
    /// An event that is an access alone.
    pub const fn access(event: Event) -> Self {
        Self { event, array: 1.0, way: 0.0 }
    }

    /// An event of which the given shares are access and way.
    pub const fn shares(event: Event, array: f64, way: f64) -> Self {
        Self { event, array, way }
    }
}

impl Structure {
    /// The memory of the same unit and name as `other`, unless it has no bytes.
    pub fn like(&self, other: &Memory) -> Option<&Memory> {
        let mut found = self.memories.iter().filter(|memory| memory.bytes > 0.0);
        found.find(|memory| (memory.unit, memory.name) == (other.unit, other.name))
    }

    /// Area in square millimetres on the node `node_nm`: memories, logic and the die of an embedded DRAM.
    /// Wires between units and interfaces to pins and to memory are not in it.
    pub fn area_mm2(&self, node_nm: u32) -> UncertainValue {
        weights::area_mm2(self, node_nm)
    }
}

/// A number with the ends of its interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct UncertainValue {
    /// Low end.
    pub low: f64,
    /// Nominal value.
    pub nominal: f64,
    /// High end.
    pub high: f64,
}

impl UncertainValue {
    /// The number 1, known exactly.
    pub const ONE: Self = Self { low: 1.0, nominal: 1.0, high: 1.0 };

    /// Value at `bound`.
    pub const fn at(&self, bound: Bound) -> f64 {
        match bound {
            Bound::Low => self.low,
            Bound::Nominal => self.nominal,
            Bound::High => self.high,
        }
    }

    /// Nominal value, and the ends of all `values`.
    fn over(nominal: f64, values: impl Iterator<Item = f64>) -> Self {
        let start = Self { low: nominal, nominal, high: nominal };
        values.fold(start, |all, value| Self { low: all.low.min(value), high: all.high.max(value), ..all })
    }

    /// Each of its three values changed by `change`, which keeps their order.
    fn map(self, change: impl Fn(f64) -> f64) -> Self {
        Self { low: change(self.low), nominal: change(self.nominal), high: change(self.high) }
    }

    /// Sum of the values at each end.
    fn plus(self, other: Self) -> Self {
        Self {
            low: self.low + other.low,
            nominal: self.nominal + other.nominal,
            high: self.high + other.high,
        }
    }
}

/// Ratios of what a GPU costs to what another costs. All are 1 for equal structures, to the last bit.
#[derive(Clone, Debug, PartialEq)]
pub struct Scaling {
    /// Energy of each event, indexed by event.
    events: Vec<UncertainValue>,
    /// Leakage of the core.
    pub leakage: UncertainValue,
    /// What the clock tree of each unit drives, at one clock; indexed by unit.
    clock_trees: Vec<UncertainValue>,
    /// Leakage or refresh of the last-level cache and of the eDRAM, indexed by unit.
    retention: Vec<UncertainValue>,
    /// Clock of each unit, indexed by unit.
    clocks: [f64; Unit::COUNT],
    /// Channels of the off-chip memory.
    pub channels: f64,
}

impl Default for Scaling {
    /// That of a GPU over itself.
    fn default() -> Self {
        Self {
            events: vec![UncertainValue::ONE; Event::COUNT],
            leakage: UncertainValue::ONE,
            clock_trees: vec![UncertainValue::ONE; Unit::COUNT],
            retention: vec![UncertainValue::ONE; Unit::COUNT],
            clocks: [1.0; Unit::COUNT],
            channels: 1.0,
        }
    }
}

impl Scaling {
    /// What `own` costs over `home`, on the node `node_nm`. Where `home` lacks a memory or a unit, the
    /// platform's numbers are for those of `stated`.
    pub fn new(own: &Structure, home: &Structure, stated: &Structure, node_nm: u32) -> Self {
        if own == home {
            return Self::default();
        }
        let ratio = Ratio { own, home, stated, cases: Case::all(), node_nm };
        Self {
            events: ratio.events(),
            leakage: ratio.of(|case, structure| case.leakage_mw(structure)),
            clock_trees: Unit::ALL.map(|unit| ratio.clock_tree(unit)).to_vec(),
            retention: Unit::ALL.map(|unit| ratio.retention(unit)).to_vec(),
            clocks: Unit::ALL.map(|unit| own.clocks_hz[unit as usize] / home.clocks_hz[unit as usize]),
            channels: own.channels / home.channels,
        }
    }

    /// Energy of `event`.
    pub fn event(&self, event: Event) -> UncertainValue {
        self.events[event as usize]
    }

    /// Watts of the clock tree of `unit`, which follow its clock.
    pub fn clock_tree(&self, unit: Unit) -> UncertainValue {
        self.clock_trees[unit as usize].map(|ratio| ratio * self.clocks[unit as usize])
    }

    /// Leakage or refresh of `unit`, if it is a level below the L2.
    pub fn retention(&self, unit: Unit) -> UncertainValue {
        self.retention[unit as usize]
    }

    /// The nominal ratio that is farthest from 1 of leakage, clock trees and energies, and what it is of.
    pub fn farthest(&self) -> (f64, String) {
        let far = |ratio: f64| libm::fabs(libm::log(ratio));
        let units = Unit::ALL
            .into_iter()
            .map(|unit| (self.clock_tree(unit).nominal, format!("the clock tree of `{}`", unit.name())));
        let events = Event::ALL
            .into_iter()
            .map(|event| (self.event(event).nominal, format!("the energy of `{}`", event.name())));
        let leakage = std::iter::once((self.leakage.nominal, "leakage".to_owned()));
        let all = leakage.chain(units).chain(events).filter(|(ratio, _)| *ratio > 0.0);
        all.fold(
            (1.0, "nothing".to_owned()),
            |most, next| if far(next.0) > far(most.0) { next } else { most },
        )
    }
}

/// Two structures, compared under every assumption.
struct Ratio<'a> {
    own: &'a Structure,
    home: &'a Structure,
    stated: &'a Structure,
    cases: Vec<Case>,
    node_nm: u32,
}

impl<'a> Ratio<'a> {
    /// Ratio of what `weigh` gives for both: nominal, and over all assumptions.
    fn of(&self, weigh: impl Fn(&Case, &Structure) -> f64) -> UncertainValue {
        self.over(|case| weigh(case, self.own) / weigh(case, self.home))
    }

    fn over(&self, ratio: impl Fn(&Case) -> f64) -> UncertainValue {
        let nominal = self.cases.iter().find(|case| case.is_nominal(self.node_nm)).map_or(1.0, &ratio);
        UncertainValue::over(nominal, self.cases.iter().map(ratio))
    }

    /// Pairs of a memory and the one that the platform's numbers are for.
    fn pairs(&self) -> impl Iterator<Item = (&'a Memory, &'a Memory)> {
        let own = self.own.memories.iter().filter(|memory| memory.bytes > 0.0);
        own.filter_map(|memory| Some((memory, self.home.like(memory).or_else(|| self.stated.like(memory))?)))
    }

    fn events(&self) -> Vec<UncertainValue> {
        let mut events = vec![UncertainValue::ONE; Event::COUNT];
        for (own, home) in self.pairs() {
            for &charge in &own.charges {
                events[charge.event as usize] = self.over(|case| charged(case, charge, own, home));
            }
        }
        events
    }

    fn clock_tree(&self, unit: Unit) -> UncertainValue {
        let is_there = |structure: &Structure| self.cases[0].clock_load(structure, unit) > 0.0;
        match (is_there(self.own), is_there(self.home), is_there(self.stated)) {
            (true, true, _) => self.of(|case, structure| case.clock_load(structure, unit)),
            (true, false, true) => {
                self.over(|case| case.clock_load(self.own, unit) / case.clock_load(self.stated, unit))
            }
            _ => UncertainValue::ONE,
        }
    }

    fn retention(&self, unit: Unit) -> UncertainValue {
        match self.pairs().find(|(own, _)| own.unit == unit) {
            Some((own, home)) if unit == Unit::Llc => {
                self.over(|case| case.memory_leakage_mw(own) / case.memory_leakage_mw(home))
            }
            Some((own, home)) if unit == Unit::Edram => UncertainValue::ONE.map(|_| own.bytes / home.bytes),
            _ => UncertainValue::ONE,
        }
    }
}

/// Energy of an event that accesses `own` over that of one that accesses `home`.
fn charged(case: &Case, charge: Charge, own: &Memory, home: &Memory) -> f64 {
    let array = case.pj_per_byte(own) / case.pj_per_byte(home);
    let way = libm::sqrt(case.bytes(own) / case.bytes(home));
    1.0 + charge.array * (array - 1.0) + charge.way * (way - 1.0)
}
