//! Rates of the large GPU, compared with those of a real card of its class.

use activity::Unit;
use timing::stepped::{self, StepOptions, Stream};
use timing::streams::{Packets, failures, rates};
use timing::{Clocks, DemandBuilder, MachineSpec, PacketClock, Recorder, Timed, Totals, bound};

const BATCH: u32 = 512;

/// The timing part of a GPU file.
#[derive(serde::Deserialize)]
struct Gpu {
    core_hz: f64,
    memory_hz: f64,
    units: MachineSpec,
}

impl Gpu {
    fn builtin(name: &str) -> Self {
        let path = format!("{}/../run/gpus/{name}.ron", env!("CARGO_MANIFEST_DIR"));
        activity::spec::load(path.as_ref()).unwrap()
    }

    /// A frame at the levels `stepped`, `packet` and `bound`.
    fn run(&self, units: &MachineSpec, packets: &Packets) -> [Timed; 3] {
        let clocks = Clocks::new(self.core_hz, self.memory_hz).unwrap();
        let recorder = || Recorder::new(1_000_000, 1 << 16);
        let mut builder = DemandBuilder::new(units);
        let (mut stream, mut totals) = (Stream::default(), Totals::new(units, &clocks));
        for (packet, lines) in packets {
            stream.push(&mut builder, packet, lines);
            stream.add_last(&builder, &mut totals);
        }
        [
            stepped::run(units, clocks, &builder, &stream, recorder(), &StepOptions::default()).unwrap(),
            PacketClock::new(units, clocks, recorder()).run(&stream),
            bound(units, clocks, &totals, recorder()),
        ]
    }
}

/// Rate at `stepped` and `packet` in 1e9 per second, and utilization of memory at `stepped`.
fn measured(name: &str) -> ([f64; 2], f64) {
    let rate = rates().into_iter().find(|rate| rate.name.starts_with(name)).unwrap();
    let gpu = Gpu::builtin("discrete");
    let [truth, packet, _] = gpu.run(&gpu.units, &rate.packets);
    let memory = truth.timeline.busy_ps()[Unit::Dram as usize] as f64 / truth.timeline.duration_ps as f64;
    ([truth, packet].map(|timed| rate.amount / timed.timeline.duration_s() / 1e9), memory)
}

/// Single units reach their nominal rates, except for pipeline fill.
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

/// A client with enough requests per cycle reads at the bandwidth of the memory buses.
#[test]
fn one_client_fills_the_buses() {
    let (found, memory) = measured("bandwidth");
    for found in found {
        assert!((0.98 * 264.0..=264.0).contains(&found), "{found} of 264 GB/s");
    }
    assert!(memory > 0.98, "{memory}");
}

/// An HD 7970 reaches 13.3 of its 29.6 Gpixel/s when blending pixels of 8 bytes; memory is the bottleneck,
/// not the colour units. The model reaches 16.5, the limit of 264 GB/s, as its memory has no bus turnaround
/// and no refresh.
#[test]
fn blended_fill_is_limited_by_memory() {
    let (found, memory) = measured("colour fill, 8 bytes");
    for found in found {
        assert!((0.98 * 16.5..=16.5).contains(&found), "{found} of 16.5 Gpixel/s");
    }
    assert!(memory > 0.98, "{memory}");
}

/// No stream stalls the reference, events are the same at all levels, and conflicting memory rows give a
/// warning.
#[test]
fn challenging_streams_end() {
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
