//! Oracle: every row of the 28 nm table is recomputed from the published numbers that its `source` names.
//!
//! The table holds three digits; a row that differs from its derivation fails here.

use activity::{Bin, Event, Timeline};
use power_model::Bound;

use super::common::{model, reference, table};

type Interval = [f64; 3];

/// Energy of 28 nm over 45 nm at equal voltage (Stillmaker & Baas 2017).
const NODE: f64 = 0.51;
// Horowitz, ISSCC 2014: picojoules at 45 nm and 0.9 V.
const FADD: f64 = 0.9 * NODE;
const FMUL: f64 = 3.7 * NODE;
const HADD: f64 = 0.4 * NODE;
const HMUL: f64 = 1.1 * NODE;
const IADD: f64 = 0.1 * NODE;
const IMUL: f64 = 3.1 * NODE;
/// 40 nm to 28 nm, by the same polynomials (0.51 / 0.86).
const FROM_40: f64 = NODE / 0.86;
/// Aladdin's FP32 add and multiply per cycle at 40 nm, over Horowitz's.
const ALADDIN: f64 = (5.56 + 11.8) * FROM_40 / (FADD + FMUL);
/// A flip-flop read, per bit (Aladdin, 40 nm).
const FLOP_BIT: f64 = 0.009 * FROM_40;
/// One 32-bit word of a register file: 5.5 pJ for 3 accesses of 64 bits at 30 nm (DARPA 2008).
const REGISTER: f64 = 5.5 / 6.0;

/// CACTI 7 at 28 nm: KB, port bytes, pJ per read and write, for high-performance and low-power cells.
const CACTI: [(u32, f64, [f64; 2], [f64; 2]); 7] = [
    (1, 16.0, [1.11, 1.69], [0.67, 1.41]),
    (4, 16.0, [1.58, 4.10], [1.53, 2.70]),
    (8, 32.0, [3.99, 9.04], [2.75, 8.75]),
    (16, 32.0, [5.25, 15.48], [5.24, 9.95]),
    (32, 32.0, [9.93, 17.77], [7.29, 12.00]),
    (256, 64.0, [62.11, 93.76], [42.66, 46.92]),
    (4096, 64.0, [328.84, 341.48], [187.10, 175.33]),
];

/// Fraction of an access that is a write.
const READ: f64 = 0.0;
const HALF: f64 = 0.5;
const WRITE: f64 = 1.0;

/// Rule S of the table: an access of `bytes` to an SRAM of `kb` kilobytes.
fn sram(kb: u32, bytes: f64, writes: f64) -> Interval {
    let (_, port_bytes, fast, low_power) = CACTI.into_iter().find(|row| row.0 == kb).unwrap();
    let blend = |[read, write]: [f64; 2]| read + writes * (write - read);
    let published = 50.0 * (fast[0] / 3.99);
    let accesses = bytes / port_bytes;
    [blend(low_power), (blend(fast) * published).sqrt(), published].map(|pj| pj * accesses)
}

fn wire(bits: f64, mm: f64) -> Interval {
    [0.018 * 0.5, 0.2 * 0.5, 0.2 * 2.0].map(|pj| pj * bits * mm)
}

fn float(pj: f64) -> Interval {
    [pj, pj, pj * ALADDIN]
}

fn times(n: f64, interval: Interval) -> Interval {
    interval.map(|pj| n * pj)
}

fn sum<const N: usize>(parts: [Interval; N]) -> Interval {
    std::array::from_fn(|end| parts.iter().map(|part| part[end]).sum())
}

/// An integer compare; high: the 28 nm integer ALU.
const COMPARE: Interval = [IADD, IADD, 0.4];
/// A register word written; low: 2 pJ for the four words of an instruction.
const WORD: Interval = [0.5, REGISTER, REGISTER * ALADDIN];

fn madd() -> Interval {
    let operands = 4.0 * 32.0 * FLOP_BIT;
    [FMUL, FADD + FMUL + operands, (FADD + FMUL) * ALADDIN + operands]
}

fn shader_op() -> Interval {
    let built = FADD + FMUL + 4.0 * REGISTER + sram(32, 32.0, READ)[1] / 64.0 + 1.0;
    let with_overhead = 31.0 * 0.9 * 0.9;
    [FMUL + 2.0, (built * with_overhead).sqrt(), with_overhead]
}

fn dram(device: f64) -> Interval {
    [device, 2.0 * (device + 1410.0 / 256.0), 3.0 * (device + 1410.0 / 64.0)]
}

/// The on-package link of an eDRAM, and its array as an SRAM.
fn edram(writes: f64) -> Interval {
    let link = [1.0, 1.11, 1.22].map(|pj| 512.0 * pj);
    sum([link, sram(4096, 64.0, writes), wire(512.0, 8.0)])
}

fn front(event: Event) -> Option<Interval> {
    let address = IMUL + 4.0 * IADD;
    Some(match event {
        Event::Draws => [100.0, 600.0, 6000.0],
        Event::Indices => sum([sram(1, 16.0, READ), times(32.0, COMPARE)]),
        Event::VerticesFetched => [address, address + 8.0 * FADD, (address + 8.0 * FADD) * ALADDIN],
        Event::VertexBytes => sum([sram(4, 1.0, WRITE), sram(4, 1.0, READ), wire(8.0, 1.0)]),
        Event::VertexInvocations => sum([sram(32, 64.0, WRITE), times(8.0, WORD)]),
        Event::PixelInvocations => sum([sram(4, 16.0, WRITE), sram(4, 16.0, READ), times(8.0, WORD)]),
        Event::ShaderOps => shader_op(),
        Event::TrianglesIn => sram(32, 96.0, READ),
        Event::TrianglesSetUp => sram(32, 128.0, WRITE),
        Event::BinEntries => sram(32, 32.0, WRITE),
        Event::BinMisses => sum([sram(32, 64.0, WRITE), sram(32, 64.0, READ)]),
        Event::SetupMadds
        | Event::TileMadds
        | Event::DepthIntervalMadds
        | Event::ScreenMadds
        | Event::SampleMadds => madd(),
        Event::CoarseTilesVisited => sram(32, 128.0, READ),
        Event::TilesVisited => sum([sram(4, 32.0, WRITE), sram(4, 32.0, READ)]),
        Event::ZCullTests => sum([sram(8, 32.0, READ), times(2.0, COMPARE)]),
        Event::ZMaxUpdates => sum([sram(8, 32.0, WRITE), times(64.0, COMPARE)]),
        Event::ZMinUpdates => sum([sram(8, 32.0, WRITE), COMPARE]),
        _ => return None,
    })
}

fn back(event: Event) -> Option<Interval> {
    let queue = [128.0 * FLOP_BIT; 3];
    let hash = [IMUL + 4.0 * IADD, IMUL + 4.0 * IADD, 12.7 * FROM_40];
    let filter = 12.0 * (HMUL + 2.0 * HADD) + 4.0 * (FADD + FMUL);
    let gamma = sram(1, 48.0, READ);
    Some(match event {
        Event::SampleReads => sram(4, 16.0, READ),
        Event::SamplesHit => sum([queue, wire(64.0, 0.25)]),
        Event::DepthReads => sum([wire(32.0, 0.5), COMPARE]),
        Event::DepthWrites => wire(32.0, 0.5),
        Event::DepthLines | Event::ColourLines => sram(16, 64.0, HALF),
        Event::DepthMisses | Event::ColourMisses => sum([sram(16, 64.0, WRITE), sram(16, 64.0, READ)]),
        Event::ShadingLookups => sum([sram(8, 32.0, READ), times(4.0, COMPARE), hash]),
        Event::ShadingHits => sram(32, 32.0, READ),
        Event::QuadsShaded => sum([sram(32, 32.0, WRITE), sram(8, 32.0, WRITE)]),
        Event::TextureFetches => [filter / 2.0, filter, filter * ALADDIN],
        Event::TextureLines => sram(16, 64.0, READ),
        Event::TextureMisses => sram(16, 64.0, WRITE),
        Event::SamplesBlended => sum([wire(32.0, 0.5), float(4.0 * HADD + 4.0 * (2.0 * HMUL + HADD))]),
        Event::ColourWrites | Event::SamplesResolved => sum([wire(32.0, 0.5), float(4.0 * HADD)]),
        Event::PixelsResolved => [4.0 * HMUL, 4.0 * HMUL + gamma[1], 4.0 * HMUL * ALADDIN + gamma[2]],
        Event::Groups => sum([sram(4, 64.0, WRITE), sram(4, 64.0, READ)]),
        Event::GroupLanes => times(3.0, WORD),
        Event::GroupBarriers => sum([sram(1, 16.0, WRITE), sram(1, 16.0, READ), COMPARE]),
        Event::SharedAccesses => sum([sram(1, 16.0, HALF), wire(32.0, 1.0), COMPARE]),
        Event::Atomics => sum([wire(64.0, 2.0), queue, COMPARE]),
        Event::BufferLines => sum([times(16.0, COMPARE), times(8.0, queue), wire(512.0, 0.5)]),
        Event::L2Reads => sum([sram(256, 64.0, READ), wire(512.0, 2.0)]),
        Event::L2Writes => sum([sram(256, 64.0, WRITE), wire(512.0, 2.0)]),
        Event::L2Misses => sram(256, 64.0, WRITE),
        Event::LlcReads => sum([sram(4096, 64.0, READ), wire(512.0, 8.0)]),
        Event::LlcWrites => sum([sram(4096, 64.0, WRITE), wire(512.0, 8.0)]),
        Event::LlcWritebacks => sram(4096, 64.0, READ),
        Event::EdramReads | Event::EdramWritebacks => edram(READ),
        Event::EdramWrites => edram(WRITE),
        Event::DramReadBytes => dram(43.0),
        Event::DramWriteBytes => dram(42.0),
        _ => return None,
    })
}

#[test]
fn every_row_follows_from_its_ingredients() {
    for row in table().rows() {
        let expected = front(row.event()).or_else(|| back(row.event()));
        let expected = expected.unwrap_or_else(|| panic!("{:?} is not derived here", row.event()));
        let written = Bound::ALL.map(|bound| row.joules(bound) * 1e12);
        let agrees = |(written_pj, expected_pj): (f64, f64)| (written_pj / expected_pj - 1.0).abs() < 6e-3;
        let all = written.into_iter().zip(expected).all(agrees);
        assert!(
            all,
            "{:?}: low, nominal, high: {written:?} pJ written, {expected:?} pJ derived",
            row.event()
        );
    }
}

/// An independent check of the multiply-add. Its components bound it from below. Two independent numbers
/// bound it from above: the FP64 one of 40 pJ at 28 nm over four (a multiplier grows with the square of its
/// width), and the shader core's.
#[test]
fn a_multiply_add_lies_between_published_figures() {
    let madd_pj = table().joules(Bound::Nominal)[Event::SampleMadds as usize] * 1e12;
    let shader_pj = table().joules(Bound::Nominal)[Event::ShaderOps as usize] * 1e12;
    assert!(FMUL < madd_pj && madd_pj < 40.0 / 4.0, "{madd_pj} pJ");
    assert!(madd_pj < shader_pj && shader_pj < 31.0, "{shader_pj} pJ");
}

/// Energy per byte grows with the distance from the arithmetic: cache line, L2 line, DRAM.
#[test]
fn energy_per_byte_grows_with_distance() {
    for joules in Bound::ALL.map(|bound| table().joules(bound)) {
        let per_byte = [
            joules[Event::TextureLines as usize] / 64.0,
            joules[Event::L2Reads as usize] / 64.0,
            joules[Event::DramReadBytes as usize],
        ];
        assert!(per_byte.windows(2).all(|pair| 3.0 * pair[0] < pair[1]), "{per_byte:?}");
    }
}

/// A line costs more in each level on the way to memory, so that a hit saves energy.
#[test]
fn energy_per_line_grows_from_level_to_level() {
    for joules in Bound::ALL.map(|bound| table().joules(bound)) {
        let dram = 64.0 * joules[Event::DramReadBytes as usize];
        let levels = [Event::L2Reads, Event::LlcReads, Event::EdramReads].map(|event| joules[event as usize]);
        assert!(levels.is_sorted() && levels[2] < 0.55 * dram, "{levels:?}, {dram}");
    }
}

/// An LPDDR3 channel pair at its peak of 12.8 GB/s draws about 1 W (43 pJ/B in the device alone: 0.55 W).
#[test]
fn memory_at_its_peak_draws_between_the_device_and_three_times_it() {
    let peak_w = 12.8e9 * table().joules(Bound::Nominal)[Event::DramReadBytes as usize];
    assert!((0.55..3.0 * 0.55).contains(&peak_w), "{peak_w} W");
}

/// Design target of the reference platform, with the rates of its file at 400 MHz.
#[test]
fn the_reference_draws_about_a_watt_when_idle_and_a_few_at_full_load() {
    let platform = reference();
    let millisecond_ps = 1_000_000_000;
    let mut bin = Bin { busy_ps: [millisecond_ps; activity::Unit::COUNT], ..Bin::default() };
    for (event, per_clock) in [
        (Event::ShaderOps, 64),
        (Event::SampleReads, 16),
        (Event::SampleMadds, 240),
        (Event::TileMadds, 40),
        (Event::SetupMadds, 12),
        (Event::DepthLines, 1),
        (Event::ColourLines, 1),
        (Event::ShadingLookups, 4),
        (Event::TextureFetches, 8),
        (Event::TextureLines, 8),
        (Event::L2Reads, 1),
        (Event::DramReadBytes, 32),
    ] {
        bin.counts[event] = per_clock * 400_000;
    }
    let timeline = Timeline { bin_ps: millisecond_ps, duration_ps: millisecond_ps, bins: vec![bin] };
    let full_w = model(&platform).frame(&timeline).unwrap().peak_w();
    assert!((3.0..6.0).contains(&full_w), "{full_w} W");
    let idle_w = platform.idle_w.value();
    let powered_w = platform.constant_w.value() + platform.leakage_w();
    assert!((0.8..1.2).contains(&idle_w) && idle_w < powered_w, "{idle_w} W at rest, {powered_w} W powered");
    println!("{full_w:.3} W at full load, {powered_w:.3} W powered and doing nothing, {idle_w:.3} W at rest");
}
