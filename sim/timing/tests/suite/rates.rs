//! Rates of the large GPU from outside, against those of the card it is of the class of.

use activity::Unit;
use timing::stepped::{self, Manner, Stream};
use timing::streams::{Packets, failures, rates};
use timing::{Clocks, Jobs, MachineSpec, PacketClock, Recorder, Timed, Totals, bound};

const BATCH: u32 = 512;

/// What a GPU file says of time.
#[derive(serde::Deserialize)]
struct Gpu {
    core_hz: f64,
    memory_hz: f64,
    units: MachineSpec,
}

impl Gpu {
    fn builtin(name: &str) -> Self {
        let path = format!("{}/../gpus/{name}.ron", env!("CARGO_MANIFEST_DIR"));
        activity::spec::load(path.as_ref()).unwrap()
    }

    /// A frame at every level: `stepped`, `packet`, `bound`.
    fn run(&self, units: &MachineSpec, packets: &Packets) -> [Timed; 3] {
        let clocks = Clocks::new(self.core_hz, self.memory_hz).unwrap();
        let recorder = || Recorder::new(1_000_000, 1 << 16);
        let mut makes = Jobs::new(units, BATCH);
        let (mut stream, mut totals) = (Stream::default(), Totals::new(units, &clocks));
        for (packet, lines) in packets {
            stream.push(&mut makes, packet, lines);
            stream.add_last(&makes, &mut totals);
        }
        [
            stepped::run(units, clocks, &makes, &stream, recorder(), &Manner::default()).unwrap(),
            PacketClock::new(units, clocks, BATCH, recorder()).run(&stream),
            bound(units, clocks, &totals, recorder()),
        ]
    }
}

/// Found by `stepped` and `packet`: 1e9 a second, and how busy memory was by the reference.
fn measured(name: &str) -> ([f64; 2], f64) {
    let rate = rates().into_iter().find(|rate| rate.name.starts_with(name)).unwrap();
    let gpu = Gpu::builtin("discrete");
    let [truth, packet, _] = gpu.run(&gpu.units, &rate.packets);
    let memory = truth.timeline.busy_ps()[Unit::Dram as usize] as f64 / truth.timeline.duration_ps as f64;
    ([truth, packet].map(|timed| rate.amount / timed.timeline.duration_s() / 1e9), memory)
}

/// Units alone reach what their rates promise, but for filling the pipeline.
#[test]
fn units_alone_reach_their_rates() {
    for (name, peak) in
        [("colour fill, nothing", 32.0 * 0.925), ("triangles", 2.0 * 0.925), ("texels", 128.0 * 0.925)]
    {
        for found in measured(name).0 {
            assert!((0.97 * peak..=peak).contains(&found), "{name}: {found} of {peak}");
        }
    }
}

/// A client that asks for enough lines a cycle reads as fast as the buses of memory carry.
#[test]
fn one_client_fills_the_buses() {
    let (found, memory) = measured("bandwidth");
    for found in found {
        assert!((0.98 * 264.0..=264.0).contains(&found), "{found} of 264 GB/s");
    }
    assert!(memory > 0.98, "{memory}");
}

/// An HD 7970 fills 13.3 of its 29.6 Gpixel/s where pixels of 8 bytes are blended, because of memory, not of its colour units.
/// So does the model, whose memory loses nothing to turns of the bus and refresh: it fills what 264 GB/s carry, 16.5.
#[test]
fn blended_fill_is_held_up_by_memory() {
    let (found, memory) = measured("colour fill, 8 bytes");
    for found in found {
        assert!((0.98 * 16.5..=16.5).contains(&found), "{found} of 16.5 Gpixel/s");
    }
    assert!(memory > 0.98, "{memory}");
}

/// No stream stalls the reference, events are the same at all levels, and where rows of memory are in dispute levels say so.
#[test]
fn streams_that_break_levels_end() {
    for name in ["mobile", "reference", "discrete"] {
        let gpu = Gpu::builtin(name);
        for case in failures(&gpu.units, BATCH) {
            let [truth, packet, bound] = gpu.run(&case.units, &case.packets);
            for found in [packet, bound] {
                assert_eq!(found.timeline.total(), truth.timeline.total(), "{}", case.name);
                assert_eq!(found.packets, case.packets.len() as u64);
                let rows = found.rows.unwrap();
                match case.name {
                    "row after row" => assert!(rows > 0.9, "{name}: {rows}"),
                    "one giant triangle" => {}
                    _ => assert!(rows < 0.1, "{name}, {}: {rows}", case.name),
                }
            }
        }
    }
}
