//! Logic beside memories, in FP32 multiply-adds.

use activity::Event;

// Horowitz (ISSCC 2014, 45 nm): energies over those of an FP32 multiply and add. Logic that does more has more gates that switch.
const MADD_PJ: f64 = 0.9 + 3.7;
const FADD: f64 = 0.9 / MADD_PJ;
const HADD: f64 = 0.4 / MADD_PJ;
const HMUL: f64 = 1.1 / MADD_PJ;
const IADD: f64 = 0.1 / MADD_PJ;
const IMUL: f64 = 3.1 / MADD_PJ;

/// Multiply-adds that a shader lane has gates for. Built up from parts, an operation takes 1.66 times the energy of its multiply-add
/// beside registers (instruction and scheduling), with a pipeline's overhead 10.7 times (GPUWattch); their geometric mean, as in the
/// energy table's row `shader_ops`.
pub const LANE_MADDS: f64 = 4.2;

/// Bytes of registers of a thread: 256 KB for 40 warps of 64 threads, as a core of a Tahiti has them.
pub const REGISTER_BYTES: f64 = 102.4;

/// Area of an FP32 multiply-add in squares of the node's length. Low: the multiplier of Aladdin's 40 nm library alone, 8970 um2, as a fused
/// unit shares the adder; nominal: with its adder, 4360 um2; high: 0.045 mm2 at 32 nm, laid out and with variable precision (Kaul et al.,
/// ISSCC 2012).
pub(super) const MADD_SQUARES: [f64; 3] = [8970e6 / 1600.0, 13_330e6 / 1600.0, 45_000e6 / 1024.0];

/// Leakage of an FP32 adder and multiplier of Aladdin's 40 nm library, in milliwatts.
pub(super) const MADD_LEAKAGE_MW: f64 = 0.053 + 0.120;
/// Node of that library, in nanometres.
pub(super) const MADD_LEAKAGE_NM: u32 = 40;

/// Energy of an FP32 multiply-add in picojoules by node: Horowitz at 45 nm, and Stillmaker and Baas (2017) at equal voltage.
pub(super) fn madd_pj(node_nm: u32) -> f64 {
    let ratio = match node_nm {
        ..=24 => 0.315,
        25..=29 => 0.51,
        30..=35 => 0.63,
        36..=42 => 0.86,
        _ => 1.0,
    };
    MADD_PJ * ratio
}

/// Multiply-adds' worth of logic for one `event` a cycle: the operations that its row of the energy table counts. 0 for events that
/// only access a memory.
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
