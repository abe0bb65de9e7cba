//! What a structure weighs in area, leakage and clocks, under each assumption about transistors and ports.

use activity::Unit;

use super::logic::{MADD_LEAKAGE_MW, MADD_LEAKAGE_NM, MADD_SQUARES, madd_pj};
use super::sram::{Cost, Sram};
use super::{Estimate, Memory, Structure};

/// Powers of the accesses a cycle by which the bytes of a memory grow to have room for them: 0 where banks serve them, which only needs
/// luck and a switch, and 1 for a copy for each. Between, a true multi-port memory of 8 ports takes 2.2 times the leakage, 2.8 times the
/// energy and 10.9 times the area of one with one port (CACTI 7, 256 KB at 28 nm).
const PORT_POWERS: [f64; 3] = [0.0, 0.5, 1.0];
/// The power of nominal costs.
const NOMINAL_POWER: f64 = 0.5;

/// Area of the die of an embedded DRAM for each byte, in square millimetres: its cells of 0.029 um2 alone, and 77 mm2 for 128 MB with its
/// periphery (Hamzaoglu et al., JSSC 50(1), 2015).
const EDRAM_MM2_PER_BYTE: [f64; 3] = [8.0 * 0.029e-6, 77.0 / EDRAM_BYTES, 77.0 / EDRAM_BYTES];
const EDRAM_BYTES: f64 = 134_217_728.0;
/// Size of the memory to which the leakage of logic is compared from node to node.
const COMPARED_BYTES: f64 = 4096.0;

/// One assumption about transistors and ports.
#[derive(Clone, Debug)]
pub(super) struct Case {
    sram: Sram,
    ports: f64,
    madd_leakage_mw: f64,
}

impl Case {
    /// All assumptions.
    pub fn all() -> Vec<Self> {
        let all = Sram::all();
        let at =
            |fast: bool, node_nm: u32| all.iter().find(|sram| sram.fast == fast && sram.node_nm == node_nm);
        let published = at(true, MADD_LEAKAGE_NM);
        let published_mw = published.map_or(1.0, |sram| sram.cost(Cost::LeakageMw, COMPARED_BYTES));
        let case = |sram: &Sram, ports: f64| Self {
            madd_leakage_mw: MADD_LEAKAGE_MW * sram.cost(Cost::LeakageMw, COMPARED_BYTES) / published_mw,
            sram: sram.clone(),
            ports,
        };
        all.iter().flat_map(|sram| PORT_POWERS.map(|ports| case(sram, ports))).collect()
    }

    /// Whether it is the nominal one for the node `node_nm`: fast transistors on the nearest node that was run.
    pub fn is_nominal(&self, node_nm: u32) -> bool {
        self.ports == NOMINAL_POWER && self.sram.fast && self.is_nearest(node_nm)
    }

    fn is_nearest(&self, node_nm: u32) -> bool {
        let nearest = [22, 28, 32, 40, 45_u32].into_iter().min_by_key(|node| node.abs_diff(node_nm));
        Some(self.sram.node_nm) == nearest
    }

    /// Bytes of a memory with one port that costs as much as a copy of `memory`.
    pub fn bytes(&self, memory: &Memory) -> f64 {
        memory.bytes * libm::pow(memory.accesses.max(1.0), self.ports)
    }

    /// Energy of an access of `memory` for each of its bytes, in picojoules.
    pub fn pj_per_byte(&self, memory: &Memory) -> f64 {
        self.sram.cost(Cost::ReadPj, self.bytes(memory))
    }

    /// Leakage of `memory` in milliwatts.
    pub fn memory_leakage_mw(&self, memory: &Memory) -> f64 {
        memory.copies * self.sram.cost(Cost::LeakageMw, self.bytes(memory))
    }

    /// Leakage of the core in milliwatts. Levels below the L2 have theirs in the platform's rows of units.
    pub fn leakage_mw(&self, structure: &Structure) -> f64 {
        let memories: f64 = on_core(structure).map(|memory| self.memory_leakage_mw(memory)).sum();
        memories + self.madd_leakage_mw * structure.madds.iter().sum::<f64>()
    }

    /// What the clock tree of `unit` drives: the energy of a cycle at full rate in picojoules. A platform's clock trees are a share of
    /// that. For the off-chip memory it is the number of its channels.
    pub fn clock_load(&self, structure: &Structure, unit: Unit) -> f64 {
        if unit == Unit::Dram {
            return structure.channels;
        }
        let memories = structure.memories.iter().filter(|memory| memory.unit == unit && memory.bytes > 0.0);
        let memories_pj: f64 = memories
            .map(|memory| {
                memory.copies * memory.accesses.max(1.0) * memory.width_bytes * self.pj_per_byte(memory)
            })
            .sum();
        memories_pj + madd_pj(self.sram.node_nm) * structure.madds[unit as usize]
    }

    /// Area of all memories on the core's die in square millimetres on the node `node_nm`.
    fn memories_mm2(&self, structure: &Structure, node_nm: u32) -> f64 {
        let length = f64::from(node_nm) / f64::from(self.sram.node_nm);
        let mm2 = |memory: &Memory| memory.copies * self.sram.cost(Cost::AreaMm2, self.bytes(memory));
        let memories = structure.memories.iter().filter(|memory| memory.unit != Unit::Edram);
        length * length * memories.map(mm2).sum::<f64>()
    }
}

/// The memories whose leakage is the core's.
fn on_core(structure: &Structure) -> impl Iterator<Item = &Memory> {
    structure.memories.iter().filter(|memory| !matches!(memory.unit, Unit::Llc | Unit::Edram))
}

/// Area of `structure` in square millimetres on the node `node_nm`.
pub(super) fn area_mm2(structure: &Structure, node_nm: u32) -> Estimate {
    let cases: Vec<Case> = Case::all().into_iter().filter(|case| case.is_nearest(node_nm)).collect();
    let nominal = cases.iter().find(|case| case.is_nominal(node_nm));
    let mm2 = |case: &Case| case.memories_mm2(structure, node_nm);
    let memories = Estimate::over(nominal.map_or(0.0, mm2), cases.iter().map(mm2));
    let square_mm2 = f64::from(node_nm) * f64::from(node_nm) * 1e-12;
    let logic = structure.madds.iter().sum::<f64>() * square_mm2;
    let edram: f64 =
        structure.memories.iter().filter(|m| m.unit == Unit::Edram).map(|m| m.bytes * m.copies).sum();
    let [low, middle, high] = MADD_SQUARES.map(|squares| squares * logic);
    let [edram_low, edram_middle, edram_high] = EDRAM_MM2_PER_BYTE.map(|mm2| mm2 * edram);
    memories.plus(Estimate { low, nominal: middle, high }).plus(Estimate {
        low: edram_low,
        nominal: edram_middle,
        high: edram_high,
    })
}
