//! What a structure weighs in area, leakage and clocks, under each assumption about transistors and ports.
//! The cost of an SRAM lies between sizes that CACTI was run for; logic beside memories is counted in FP32
//! multiply-adds.

use activity::{Event, Unit};

use super::{Memory, Structure, UncertainValue};

/// Powers of the accesses a cycle by which the bytes of a memory grow to have room for them: 0 where banks
/// serve them, which only needs luck and a switch, and 1 for a copy for each. Between, a true multi-port
/// memory of 8 ports takes 2.2 times the leakage, 2.8 times the energy and 10.9 times the area of one with
/// one port (CACTI 7, 256 KB at 28 nm).
const PORT_POWERS: [f64; 3] = [0.0, 0.5, 1.0];
/// The power of nominal costs.
const NOMINAL_POWER: f64 = 0.5;

/// Area of the die of an embedded DRAM for each byte, in square millimetres: its cells of 0.029 um2 alone,
/// and 77 mm2 for 128 MB with its periphery (Hamzaoglu et al., JSSC 50(1), 2015).
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
        let published_mw = published.map_or(1.0, |sram| sram.cost(MemoryCost::LeakageMw, COMPARED_BYTES));
        let case = |sram: &Sram, ports: f64| Self {
            madd_leakage_mw: MADD_LEAKAGE_MW * sram.cost(MemoryCost::LeakageMw, COMPARED_BYTES)
                / published_mw,
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
        self.sram.cost(MemoryCost::ReadPj, self.bytes(memory))
    }

    /// Leakage of `memory` in milliwatts.
    pub fn memory_leakage_mw(&self, memory: &Memory) -> f64 {
        memory.copies * self.sram.cost(MemoryCost::LeakageMw, self.bytes(memory))
    }

    /// Leakage of the core in milliwatts. Levels below the L2 have theirs in the platform's rows of units.
    pub fn leakage_mw(&self, structure: &Structure) -> f64 {
        let memories: f64 = on_core(structure).map(|memory| self.memory_leakage_mw(memory)).sum();
        memories + self.madd_leakage_mw * structure.madds.iter().sum::<f64>()
    }

    /// What the clock tree of `unit` drives: the energy of a cycle at full rate in picojoules. A platform's
    /// clock trees are a share of that. For the off-chip memory it is the number of its channels.
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
        let mm2 = |memory: &Memory| memory.copies * self.sram.cost(MemoryCost::AreaMm2, self.bytes(memory));
        let memories = structure.memories.iter().filter(|memory| memory.unit != Unit::Edram);
        length * length * memories.map(mm2).sum::<f64>()
    }
}

/// The memories whose leakage is the core's.
fn on_core(structure: &Structure) -> impl Iterator<Item = &Memory> {
    structure.memories.iter().filter(|memory| !matches!(memory.unit, Unit::Llc | Unit::Edram))
}

/// Area of `structure` in square millimetres on the node `node_nm`.
pub(super) fn area_mm2(structure: &Structure, node_nm: u32) -> UncertainValue {
    let cases: Vec<Case> = Case::all().into_iter().filter(|case| case.is_nearest(node_nm)).collect();
    let nominal = cases.iter().find(|case| case.is_nominal(node_nm));
    let mm2 = |case: &Case| case.memories_mm2(structure, node_nm);
    let memories = UncertainValue::over(nominal.map_or(0.0, mm2), cases.iter().map(mm2));
    let square_mm2 = f64::from(node_nm) * f64::from(node_nm) * 1e-12;
    let logic = structure.madds.iter().sum::<f64>() * square_mm2;
    let edram: f64 =
        structure.memories.iter().filter(|m| m.unit == Unit::Edram).map(|m| m.bytes * m.copies).sum();
    let [low, middle, high] = MADD_SQUARES.map(|squares| squares * logic);
    let [edram_low, edram_middle, edram_high] = EDRAM_MM2_PER_BYTE.map(|mm2| mm2 * edram);
    memories.plus(UncertainValue { low, nominal: middle, high }).plus(UncertainValue {
        low: edram_low,
        nominal: edram_middle,
        high: edram_high,
    })
}

// Horowitz (ISSCC 2014, 45 nm): energies over those of an FP32 multiply and add. Logic that does more has
// more gates that switch.
const MADD_PJ: f64 = 0.9 + 3.7;
const FADD: f64 = 0.9 / MADD_PJ;
const HADD: f64 = 0.4 / MADD_PJ;
const HMUL: f64 = 1.1 / MADD_PJ;
const IADD: f64 = 0.1 / MADD_PJ;
const IMUL: f64 = 3.1 / MADD_PJ;

/// Multiply-adds that a shader lane has gates for. Built up from parts, an operation takes 1.66 times the
/// energy of its multiply-add beside registers (instruction and scheduling), with a pipeline's overhead 10.7
/// times (GPUWattch); their geometric mean, as in the energy table's row `shader_ops`.
pub const LANE_MADDS: f64 = 4.2;

/// Bytes of registers of a thread: 256 KB for 40 warps of 64 threads, as a core of a Tahiti has them.
pub const REGISTER_BYTES: f64 = 102.4;

/// Area of an FP32 multiply-add in squares of the node's length. Low: the multiplier of Aladdin's 40 nm
/// library alone, 8970 um2, as a fused unit shares the adder; nominal: with its adder, 4360 um2; high: 0.045
/// mm2 at 32 nm, laid out and with variable precision (Kaul et al., ISSCC 2012).
const MADD_SQUARES: [f64; 3] = [8970e6 / 1600.0, 13_330e6 / 1600.0, 45_000e6 / 1024.0];

/// Leakage of an FP32 adder and multiplier of Aladdin's 40 nm library, in milliwatts.
const MADD_LEAKAGE_MW: f64 = 0.053 + 0.120;
/// Node of that library, in nanometres.
const MADD_LEAKAGE_NM: u32 = 40;

/// Energy of an FP32 multiply-add in picojoules by node: Horowitz at 45 nm, and Stillmaker and Baas (2017) at
/// equal voltage.
fn madd_pj(node_nm: u32) -> f64 {
    let ratio = match node_nm {
        ..=24 => 0.315,
        25..=29 => 0.51,
        30..=35 => 0.63,
        36..=42 => 0.86,
        _ => 1.0,
    };
    MADD_PJ * ratio
}

/// Multiply-adds' worth of logic for one `event` a cycle: the operations that its row of the energy table
/// counts. 0 for events that only access a memory.
pub fn madds(event: Event) -> f64 {
    match event {
        Event::Draws => 1000.0 * IADD,
        Event::Indices | Event::SharedCycles => 32.0 * IADD,
        Event::VerticesFetched => IMUL + 4.0 * IADD + 8.0 * FADD,
        // A dozen for the quarter of a triangle a clock of the reference GPU, as its platform counts them.
        Event::TrianglesIn => 48.0,
        Event::SetupMadds
        | Event::TileMadds
        | Event::DepthIntervalMadds
        | Event::ScreenMadds
        | Event::SampleMadds => 1.0,
        Event::ZCullTests => 2.0 * IADD,
        Event::DepthReads => IADD,
        Event::ShadingLookups => IMUL + 8.0 * IADD,
        Event::TextureFetches => 12.0 * (HMUL + 2.0 * HADD) + 4.0,
        Event::ColourWrites | Event::SamplesResolved => 4.0 * HADD,
        Event::SamplesBlended => 4.0 * HADD + 4.0 * (2.0 * HMUL + HADD),
        Event::PixelsResolved => 4.0 * HMUL,
        Event::AtomicSteps | Event::BufferLines => 16.0 * IADD,
        _ => 0.0,
    }
}

/// Runs of CACTI 7. The file says how they were made.
const RUNS: &str = include_str!("../../tables/cacti.csv");

/// Ratio within which a cost between two runs lies on either side of the interpolated one: the worst error
/// where a run is left out and found from its neighbours. CACTI changes the organisation of a memory from
/// size to size, so that costs are no smooth curve.
pub const INTERPOLATION: f64 = 1.5;

/// A cost of a memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MemoryCost {
    /// Energy of a read for each byte of the port, in picojoules.
    ReadPj,
    /// Leakage in milliwatts.
    LeakageMw,
    /// Area in square millimetres.
    AreaMm2,
}

impl MemoryCost {
    /// All costs.
    pub const ALL: [Self; 3] = [Self::ReadPj, Self::LeakageMw, Self::AreaMm2];
}

/// One run: a memory with one port for reads and writes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SramRun {
    /// Whether cells and periphery are of fast transistors, as opposed to transistors of low leakage.
    pub fast: bool,
    /// Process node in nanometres.
    pub node_nm: u32,
    /// Size in bytes.
    pub bytes: f64,
    /// Costs, in the order of [`MemoryCost::ALL`].
    pub costs: [f64; 3],
}

impl SramRun {
    /// All runs, by kind of transistor, node and size.
    pub fn all() -> Vec<Self> {
        RUNS.lines().filter_map(Self::parse).collect()
    }

    /// A line of the table; `None` for its comments and head.
    fn parse(line: &str) -> Option<Self> {
        let (cells, numbers) = line.split_once(',')?;
        let numbers: Vec<f64> = numbers.split(',').map(|text| text.parse().ok()).collect::<Option<_>>()?;
        let &[node_nm, size_kb, port_bytes, read_pj, leakage_mw, area_mm2] = numbers.as_slice() else {
            return None;
        };
        let costs = [read_pj / port_bytes, leakage_mw, area_mm2];
        Some(Self { fast: cells == "fast", node_nm: node_nm as u32, bytes: 1024.0 * size_kb, costs })
    }
}

/// Costs over the size of memories of one kind of transistor on one node. They never fall with size.
#[derive(Clone, Debug, PartialEq)]
pub struct Sram {
    /// Whether transistors are fast.
    pub fast: bool,
    /// Process node in nanometres.
    pub node_nm: u32,
    /// Logarithm of the size of each run, rising.
    ln_bytes: Vec<f64>,
    /// Logarithms of the costs of each run, in the order of [`MemoryCost::ALL`].
    ln_costs: [Vec<f64>; 3],
}

impl Sram {
    /// All kinds and nodes.
    pub fn all() -> Vec<Self> {
        Self::of(&SramRun::all())
    }

    /// The kinds and nodes of `runs`, which are in the order of [`SramRun::all`] with two or more of each.
    pub fn of(runs: &[SramRun]) -> Vec<Self> {
        runs.chunk_by(|a, b| (a.fast, a.node_nm) == (b.fast, b.node_nm)).map(Self::of_kind).collect()
    }

    fn of_kind(runs: &[SramRun]) -> Self {
        let ln_costs = MemoryCost::ALL
            .map(|cost| never_falling(runs.iter().map(|run| libm::log(run.costs[cost as usize]))));
        let ln_bytes = runs.iter().map(|run| libm::log(run.bytes)).collect();
        Self { fast: runs[0].fast, node_nm: runs[0].node_nm, ln_bytes, ln_costs }
    }

    /// Cost of a memory of `bytes` with one port: a straight line between runs in logarithms, the nearest of
    /// these lines beyond the runs. Nothing costs nothing.
    pub fn cost(&self, cost: MemoryCost, bytes: f64) -> f64 {
        if bytes <= 0.0 {
            return 0.0;
        }
        let (at, sizes, costs) = (libm::log(bytes), &self.ln_bytes, &self.ln_costs[cost as usize]);
        let above = sizes.partition_point(|&size| size < at).clamp(1, sizes.len() - 1);
        let share = (at - sizes[above - 1]) / (sizes[above] - sizes[above - 1]);
        libm::exp(costs[above - 1] + share * (costs[above] - costs[above - 1]))
    }
}

/// The values with those that fall replaced by means of neighbours, the closest such series (pool adjacent
/// violators; Ayer et al., Ann. Math. Statist. 26, 1955).
fn never_falling(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut pools: Vec<(f64, usize)> = Vec::new();
    for value in values {
        let mut pool = (value, 1);
        while let Some(&(before, count)) = pools.last().filter(|before| before.0 > pool.0) {
            let all = count + pool.1;
            pool = ((before * count as f64 + pool.0 * pool.1 as f64) / all as f64, all);
            pools.pop();
        }
        pools.push(pool);
    }
    pools.into_iter().flat_map(|(value, count)| std::iter::repeat_n(value, count)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_run_is_read() {
        let all = Sram::all();
        assert_eq!((SramRun::all().len(), all.len()), (110, 10));
        assert!(all.iter().all(|sram| sram.ln_bytes.len() == 11 && sram.ln_bytes.is_sorted()));
    }

    #[test]
    fn a_size_that_was_run_has_its_cost_and_nothing_costs_nothing() {
        let runs = SramRun::all();
        let run = runs.iter().find(|run| run.fast && run.node_nm == 28 && run.bytes == 8192.0).unwrap();
        let sram = Sram::all().into_iter().find(|sram| sram.fast && sram.node_nm == 28).unwrap();
        for cost in MemoryCost::ALL {
            assert!((sram.cost(cost, 8192.0) / run.costs[cost as usize] - 1.0).abs() < 1e-12, "{cost:?}");
            assert_eq!(sram.cost(cost, 0.0), 0.0);
        }
    }

    #[test]
    fn no_cost_falls_with_size() {
        for sram in Sram::all() {
            for cost in MemoryCost::ALL {
                let costs: Vec<f64> =
                    (0..400).map(|at| sram.cost(cost, libm::exp(0.06 * f64::from(at)))).collect();
                assert!(costs.is_sorted() && costs[0] > 0.0, "{cost:?} of {sram:?}");
            }
        }
    }

    #[test]
    fn falling_values_are_pooled() {
        let pooled = |values: &[f64]| never_falling(values.iter().copied());
        assert_eq!(pooled(&[1.0, 2.0, 2.0, 5.0]), [1.0, 2.0, 2.0, 5.0]);
        assert_eq!(pooled(&[1.0, 4.0, 2.0, 5.0]), [1.0, 3.0, 3.0, 5.0]);
        assert_eq!(pooled(&[3.0, 2.0, 1.0]), [2.0, 2.0, 2.0]);
    }
}
