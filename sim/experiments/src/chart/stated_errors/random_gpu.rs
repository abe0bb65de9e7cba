//! GPUs drawn at random around the reference one, to see how far timing levels are off away from GPUs that they were developed on.

use activity::Bounded;
use run::GpuSpec;
use timing::Rates;
use traces::random::Random;

/// Factors of rates, and clocks in hertz. Numbers between are drawn evenly by their logarithm.
const RATE_FACTORS: [f64; 2] = [0.25, 16.0];
const CLOCKS_HZ: [f64; 2] = [200e6, 1375e6];
/// Sizes to choose from.
const CORES: [u32; 5] = [1, 2, 4, 8, 16];
const LINES: [u32; 3] = [1, 2, 4];
const QUEUES: [u32; 5] = [2, 4, 8, 16, 32];
const CHANNELS: [u32; 6] = [1, 2, 3, 4, 6, 8];
const BANKS: [u32; 3] = [4, 8, 16];
const ROWS_BYTES: [u32; 3] = [1024, 2048, 4096];

/// A GPU, and how far it is from the reference one.
#[derive(Clone, Debug)]
pub(super) struct RandomGpu {
    pub spec: GpuSpec,
    /// Root mean square of the binary logarithms of its numbers over those of the reference GPU.
    pub distance: f64,
}

impl RandomGpu {
    /// The GPU `number` of a seed: another one than `home` in clocks, rates, queues, cores and memory.
    pub fn new(home: &GpuSpec, seed: u64, number: u64) -> Self {
        let mut draw = Draw { random: Random::new(seed, number), squares: 0.0, count: 0 };
        let mut gpu = home.clone();
        gpu.name = format!("random {seed}.{number}");
        gpu.core_hz = draw.between(gpu.core_hz, CLOCKS_HZ);
        gpu.memory_hz = draw.between(gpu.memory_hz, CLOCKS_HZ);
        let units = &mut gpu.units;
        for unit in [
            &mut units.setup,
            &mut units.traversal,
            &mut units.z_cull,
            &mut units.sample_test,
            &mut units.shading_cache,
        ] {
            unit.rates = draw.rates(&unit.rates);
            unit.queue = draw.one_of(unit.queue, &QUEUES);
        }
        let clients = [&mut units.command, &mut units.depth, &mut units.texture, &mut units.colour];
        for client in clients.into_iter().chain(&mut units.compute) {
            client.rates = draw.rates(&client.rates);
            client.queue = draw.one_of(client.queue, &QUEUES);
            client.lines_per_cycle = draw.one_of(client.lines_per_cycle, &LINES);
        }
        units.shader.cores = draw.one_of(units.shader.cores, &CORES);
        units.shader.queue = draw.one_of(units.shader.queue, &QUEUES);
        units.l2.queue = draw.one_of(units.l2.queue, &QUEUES);
        units.l2.lines_per_cycle = draw.one_of(units.l2.lines_per_cycle, &LINES);
        let dram = &mut units.dram;
        dram.queue = draw.one_of(dram.queue, &QUEUES);
        dram.channels = draw.one_of(dram.channels, &CHANNELS);
        dram.banks = draw.one_of(dram.banks, &BANKS);
        dram.row_bytes = draw.one_of(dram.row_bytes, &ROWS_BYTES);
        Self { spec: gpu, distance: (draw.squares / draw.count as f64).sqrt() }
    }
}

/// Numbers drawn one after another, and how far they are from those they replace.
struct Draw {
    random: Random,
    squares: f64,
    /// Numbers drawn so far.
    count: u64,
}

impl Draw {
    /// The next number that `of` makes of an even one in (0, 1), in place of `home`.
    fn next(&mut self, home: f64, of: impl FnOnce(f64) -> f64) -> f64 {
        let drawn = of(self.random.uniform(self.count));
        self.squares += libm::log2(drawn / home).powi(2);
        self.count += 1;
        drawn
    }

    fn between(&mut self, home: f64, [low, high]: [f64; 2]) -> f64 {
        self.next(home, |even| low * libm::pow(high / low, even))
    }

    /// All rates of a unit times the same number.
    fn rates(&mut self, home: &Rates) -> Rates {
        home.scaled(self.between(1.0, RATE_FACTORS))
    }

    fn one_of<const MIN: u32, const MAX: u32>(
        &mut self,
        home: Bounded<MIN, MAX>,
        values: &[u32],
    ) -> Bounded<MIN, MAX> {
        let of = |even: f64| values[(even * values.len() as f64) as usize].into();
        let drawn = self.next(home.get().into(), of) as u32;
        // All values are within the limits of the fields that they are drawn for.
        Bounded::new(drawn).unwrap_or(home)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gpus_are_valid_different_and_the_same_again() {
        let home = GpuSpec::load("reference").unwrap();
        let of = |seed, number| RandomGpu::new(&home, seed, number);
        for number in 0..200 {
            let RandomGpu { spec, distance } = of(7, number);
            spec.units.validate().unwrap();
            spec.machine().unwrap();
            assert!((0.5..4.0).contains(&distance), "{distance}");
            assert!(spec == of(7, number).spec && spec.units != of(7, number + 1).spec.units);
            assert!(spec.units != of(8, number).spec.units);
            assert!(
                QUEUES.contains(&spec.units.dram.queue.get()) && BANKS.contains(&spec.units.dram.banks.get())
            );
        }
    }
}
