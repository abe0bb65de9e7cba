//! Cost of an SRAM by its size, between sizes that CACTI was run for.

/// Runs of CACTI 7. The file says how they were made.
const RUNS: &str = include_str!("../../tables/cacti.csv");

/// Ratio within which a cost between two runs lies on either side of the interpolated one: the worst error where a run is left out
/// and found from its neighbours. CACTI changes the organisation of a memory from size to size, so that costs are no smooth curve.
pub const INTERPOLATION: f64 = 1.5;

/// A cost of a memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cost {
    /// Energy of a read for each byte of the port, in picojoules.
    ReadPj,
    /// Leakage in milliwatts.
    LeakageMw,
    /// Area in square millimetres.
    AreaMm2,
}

impl Cost {
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
    /// Costs, in the order of [`Cost::ALL`].
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
    /// Logarithms of the costs of each run, in the order of [`Cost::ALL`].
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
        let ln_costs =
            Cost::ALL.map(|cost| never_falling(runs.iter().map(|run| libm::log(run.costs[cost as usize]))));
        let ln_bytes = runs.iter().map(|run| libm::log(run.bytes)).collect();
        Self { fast: runs[0].fast, node_nm: runs[0].node_nm, ln_bytes, ln_costs }
    }

    /// Cost of a memory of `bytes` with one port: a straight line between runs in logarithms, the nearest of these lines beyond the
    /// runs. Nothing costs nothing.
    pub fn cost(&self, cost: Cost, bytes: f64) -> f64 {
        if bytes <= 0.0 {
            return 0.0;
        }
        let (at, sizes, costs) = (libm::log(bytes), &self.ln_bytes, &self.ln_costs[cost as usize]);
        let above = sizes.partition_point(|&size| size < at).clamp(1, sizes.len() - 1);
        let share = (at - sizes[above - 1]) / (sizes[above] - sizes[above - 1]);
        libm::exp(costs[above - 1] + share * (costs[above] - costs[above - 1]))
    }
}

/// The values with those that fall replaced by means of neighbours, the closest such series (pool adjacent violators; Ayer et al., Ann.
/// Math. Statist. 26, 1955).
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
        for cost in Cost::ALL {
            assert!((sram.cost(cost, 8192.0) / run.costs[cost as usize] - 1.0).abs() < 1e-12, "{cost:?}");
            assert_eq!(sram.cost(cost, 0.0), 0.0);
        }
    }

    #[test]
    fn no_cost_falls_with_size() {
        for sram in Sram::all() {
            for cost in Cost::ALL {
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
