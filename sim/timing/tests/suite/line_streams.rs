//! Line streams that load a channel in known ways, timed as another simulator of memory times them.
//!
//! `tests/dramsim3.csv` has the cycles of DRAMsim3; `docs/validation.md` says how they were made.

use timing::{DramSpec, MachineSpec, RefreshSpec};

use crate::common::{Packets, bound_level, clocks, packet_level, plain, size, stepped};
use crate::dram::stream;

/// A line and whether it is written.
type Line = (u32, bool);

/// Address map of a GPU: channels, and lines in a row in a channel.
const MAPS: [(&str, u32); 2] = [("discrete", 12), ("reference", 2)];
const CHUNK: u32 = 4;

/// Tiles of depth, texture and colour lines, `stride` lines apart, with victims, and `apart` between these five.
fn with_victims(stride: u32, apart: u32) -> Vec<Line> {
    let mut lines = Vec::new();
    for n in 0..1500 {
        for (base, victim) in [(0, Some(77)), (33, None), (55, Some(99))] {
            for k in 0..4 {
                let line = base * apart + (n * 4 + k) * stride;
                lines.extend(victim.map(|far: u32| (line + far * apart, true)));
                lines.push((line, false));
            }
        }
    }
    lines
}

fn streams() -> [(&'static str, Vec<Line>); 6] {
    let pairs = |count: u32, first: u32, far: u32| {
        (0..count).flat_map(move |n| [(first + n + far, true), (first + n, false)]).collect()
    };
    [
        ("reads-side-by-side", (0..3000 * 64).map(|n| (n, false)).collect()),
        ("blended-fill", pairs(3000 * 32, 0, 1 << 22)),
        ("giant-triangle", pairs(4000 * 8, 1 << 20, 1 << 18)),
        ("thrashing-caches", with_victims(1, 1)),
        ("thrashing-apart", with_victims(1, 640)),
        ("row-after-row", with_victims(4096, 4096)),
    ]
}

/// The lines of channel 0, numbered through it.
fn of_channel(lines: &[Line], channels: u32) -> Vec<Line> {
    let chunks = lines.iter().map(|&(line, is_write)| (line / CHUNK, line % CHUNK, is_write));
    let own = chunks.filter(|(chunk, ..)| chunk % channels == 0);
    own.map(|(chunk, rest, is_write)| (chunk / channels * CHUNK + rest, is_write)).collect()
}

/// Chips as the configuration of that name, in cycles of its clock; a line is two requests.
fn chips(name: &str) -> DramSpec {
    let mut dram = plain().dram;
    (dram.channels, dram.interleave_bytes) = (size(1), size(64));
    let is_bare = name.ends_with("bare");
    let [cas, cas_write, activate, close, row, to_close, recovery, spacing, four, to_read] =
        match (name.trim_end_matches("_bare"), is_bare) {
            ("gddr5", false) => [24, 7, 18, 18, 42, 3, 18, 9, 35, 8],
            ("gddr5", true) => [17, 17, 17, 17, 1, 1, 1, 1, 1, 0],
            (_, false) => [12, 9, 15, 15, 34, 6, 12, 8, 40, 6],
            (_, true) => [14, 14, 14, 14, 1, 1, 1, 1, 1, 0],
        };
    let is_gddr5 = name.starts_with("gddr5");
    let (request, places) = if is_gddr5 { (2, 32) } else { (4, 16) };
    (dram.banks, dram.row_bytes) = if is_gddr5 { (size(16), size(2048)) } else { (size(8), size(4096)) };
    dram.burst_cycles = size(2 * request);
    // A bank queues four lines more.
    (dram.queue, dram.write_queue) = (size(places + 4), Some(size(places)));
    (dram.cas_cycles, dram.activate_cycles, dram.precharge_cycles) = (size(cas), size(activate), size(close));
    dram.activate_write_cycles = (name == "gddr5").then(|| size(15));
    dram.row_cycles = size(row);
    dram.read_to_precharge_cycles = size(request + to_close);
    dram.write_to_precharge_cycles = size(2 * request + cas_write + recovery);
    (dram.activate_to_activate_cycles, dram.four_activates_cycles) = (size(spacing), size(four));
    dram.write_to_read_cycles = size(cas_write + to_read);
    let turn = u32::from(!is_gddr5 && !is_bare);
    dram.read_to_write_cycles = size(cas - cas_write + turn);
    let refresh = |interval, busy| RefreshSpec { interval_cycles: size(interval), busy_cycles: size(busy) };
    dram.refresh = match (is_gddr5, is_bare) {
        (_, true) => None,
        (true, _) => Some(refresh(5362, 98)),
        (false, _) => Some(refresh(3120, 168)),
    };
    dram
}

/// A machine that memory alone limits.
fn machine(dram: DramSpec) -> MachineSpec {
    let mut machine = plain();
    (machine.depth.lines_per_cycle, machine.l2.lines_per_cycle) = (size(4), size(4));
    (machine.depth.in_flight, machine.l2.queue) = (size(1024), size(64));
    machine.dram = dram;
    machine
}

/// Cycles of DRAMsim3 for a stream.
fn of_dramsim3(map: &str, stream: &str, chips: &str) -> u64 {
    let rows = include_str!("../dramsim3.csv").lines().filter(|line| !line.starts_with('#'));
    let row = rows.map(|row| row.split(',').collect::<Vec<_>>()).find(|row| row[..3] == [map, stream, chips]);
    row.unwrap_or_else(|| panic!("{map} {stream} {chips}"))[3].parse().unwrap()
}

/// Cycles of every level for a stream, and those of DRAMsim3.
struct Compared {
    name: [&'static str; 3],
    truth: u64,
    /// At `stepped`, `packet` and `bound`.
    found: [u64; 3],
}

impl Compared {
    fn new(map: &'static str, chip: &'static str, (name, packets): (&'static str, &Packets)) -> Self {
        let machine = machine(chips(chip));
        let found = [
            stepped(&machine, packets).cycles,
            packet_level(&machine, clocks(), packets).cycles,
            bound_level(&machine, clocks(), packets).cycles,
        ];
        Self { name: [map, name, chip], truth: of_dramsim3(map, name, chip), found }
    }

    /// Error of a level in percent, over DRAMsim3.
    fn percent(&self, level: usize) -> f64 {
        100.0 * (self.found[level] as f64 / self.truth as f64 - 1.0)
    }
}

/// Streams on which `stepped` is more than 5 % from DRAMsim3: see `docs/validation.md`.
const FAR: [[&str; 3]; 4] = [
    ["discrete", "thrashing-caches", "gddr5"],
    ["discrete", "thrashing-caches", "gddr5_bare"],
    ["discrete", "thrashing-apart", "gddr5"],
    ["discrete", "thrashing-apart", "gddr5_bare"],
];

#[test]
fn line_streams_are_as_long_as_in_dramsim3() {
    let mut all = Vec::new();
    for (map, channels) in MAPS {
        let parts = if map == "discrete" { ["gddr5_bare", "gddr5"] } else { ["lpddr3_bare", "lpddr3"] };
        for (name, lines) in streams() {
            let packets: Packets = stream(of_channel(&lines, channels));
            all.extend(parts.map(|part| Compared::new(map, part, (name, &packets))));
        }
    }
    all.sort_by(|one, other| other.percent(0).abs().total_cmp(&one.percent(0).abs()));
    for compared in &all {
        let errors = [0, 1, 2].map(|level| format!("{:+.1} %", compared.percent(level))).join(" | ");
        println!("| {} | {} | {} | {errors} |", compared.name.join(" | "), compared.truth, compared.found[0]);
    }
    let far: Vec<_> = all.iter().filter(|compared| compared.percent(0).abs() > 5.0).collect();
    assert_eq!(far.iter().map(|compared| compared.name).collect::<Vec<_>>(), FAR);
    // As docs/validation.md says.
    for Compared { name, found, .. } in &all {
        let ratio = found[1] as f64 / found[0] as f64;
        assert!((1.0 / 1.03..1.03).contains(&ratio), "{name:?}: {ratio}");
    }
}
