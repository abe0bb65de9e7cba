//! Structure of a GPU: its memories and logic, and what more or less of them costs than on the GPU that a platform was made for.

mod logic;
mod scaling;
mod sram;
mod weights;

use activity::{Event, Unit};
use serde::Serialize;

use crate::bound::Bound;

pub use self::logic::{LANE_MADDS, REGISTER_BYTES, madds};
pub use self::scaling::Scaling;
pub use self::sram::{Cost, INTERPOLATION, Sram, SramRun};

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
    /// Its unit.
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

    /// Area in square millimetres on the node `node_nm`: memories, logic and the die of an embedded DRAM. Wires between units and
    /// interfaces to pins and to memory are not in it.
    pub fn area_mm2(&self, node_nm: u32) -> Estimate {
        weights::area_mm2(self, node_nm)
    }
}

/// A number with the ends of its interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Estimate {
    /// Low end.
    pub low: f64,
    /// Nominal value.
    pub nominal: f64,
    /// High end.
    pub high: f64,
}

impl Estimate {
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
