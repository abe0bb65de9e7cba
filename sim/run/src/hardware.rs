//! Hardware of a GPU: the structure that its file describes, its area, and its power beside that of the GPU
//! of the platform.

use activity::{Event, Unit};
use pipeline::CacheSpec;
use power_model::{Charge, LANE_MADDS, Memory, Platform, REGISTER_BYTES, Scaling, Structure, madds};
use timing::{Clock, Common, LINE_BYTES};

use crate::{GpuError, GpuSpec};

/// Bytes of a line.
const LINE: f64 = LINE_BYTES as f64;
/// Bytes of a packet in a queue, with its place and state, as the energy table's row `groups` has them.
const PACKET_BYTES: f64 = 64.0;
/// Bytes of the shaded vertices of the reference GPU, 32 KB for 32 of them in the energy table.
const VERTEX_BYTES: f64 = 1024.0;
/// Bytes of a shaded quad, and of its tag.
const QUAD_BYTES: [f64; 2] = [32.0, 8.0];
/// Kibibyte.
const KB: f64 = 1024.0;
/// Last-level cache for which the rows of platforms and energy tables are stated.
const STATED_LLC_BYTES: f64 = 4096.0 * KB;
/// The same of the embedded DRAM.
const STATED_EDRAM_BYTES: f64 = 131_072.0 * KB;

/// What `gpu` costs over the GPU that `platform` was made for.
///
/// # Errors
/// If that GPU cannot be loaded.
pub fn scaling(gpu: &GpuSpec, platform: &Platform) -> Result<Scaling, GpuError> {
    let of_platform = |source| GpuError::Home { platform: platform.name.clone(), source: Box::new(source) };
    let home = GpuSpec::load(&platform.made_for).map_err(of_platform)?;
    Ok(Scaling::new(&structure(gpu), &structure(&home), &stated()?, platform.node_nm))
}

/// Units for which platforms have numbers although their GPU lacks them: the compute unit of the reference
/// GPU, and the levels below the L2 for which the rows are stated.
fn stated() -> Result<Structure, GpuError> {
    let mut stated = structure(&GpuSpec::load("reference")?);
    stated
        .memories
        .extend([level(Unit::Llc, STATED_LLC_BYTES, 1.0), level(Unit::Edram, STATED_EDRAM_BYTES, 1.0)]);
    Ok(stated)
}

/// Memories and logic of a GPU.
pub fn structure(gpu: &GpuSpec) -> Structure {
    let mut memories = fixed(gpu);
    memories.extend(caches(gpu));
    memories.extend(cores(gpu));
    memories
        .extend(Unit::ALL.into_iter().filter(|&unit| gpu.units.has(unit)).flat_map(|unit| queues(gpu, unit)));
    let hertz = |unit: Unit| match gpu.units.common(unit).clock {
        Clock::Core => gpu.core_hz,
        Clock::Memory => gpu.memory_hz,
    };
    Structure {
        memories,
        madds: Unit::ALL.map(|unit| if gpu.units.has(unit) { logic(gpu, unit) } else { 0.0 }),
        clocks_hz: Unit::ALL.map(hertz),
        channels: f64::from(gpu.units.dram.channels.get()),
    }
}

/// Logic of a unit in multiply-adds: what each rate takes, and the lanes of the cores.
fn logic(gpu: &GpuSpec, unit: Unit) -> f64 {
    let rates = gpu.units.common(unit).rates;
    let of_rates: f64 =
        rates.map_or(0.0, |rates| rates.iter().map(|(event, rate)| rate * madds(event)).sum());
    let shader = &gpu.units.shader;
    let atomic_units = gpu.pipeline.compute.as_ref().map_or(0, |compute| compute.atomic_units);
    of_rates
        + match unit {
            Unit::Shader => f64::from(shader.cores.get()) * f64::from(shader.lanes.get()) * LANE_MADDS,
            Unit::Compute => f64::from(atomic_units) * madds(Event::AtomicSteps),
            _ => 0.0,
        }
}

/// Rate of an event, 1 where it has none.
fn rate(gpu: &GpuSpec, event: Event) -> f64 {
    let rates = gpu.units.common(event.unit()).rates;
    let found = rates.and_then(|rates| rates.iter().find(|(known, _)| *known == event));
    found.map_or(1.0, |(_, rate)| rate)
}

/// A memory with one copy.
fn memory(name: &'static str, unit: Unit, bytes: f64, width_bytes: f64, charges: Vec<Charge>) -> Memory {
    Memory { name, unit, bytes, width_bytes, accesses: 1.0, copies: 1.0, charges }
}

/// Memories of the fixed-function units, of the sizes in the energy table. Shares of events are those of its
/// derivations.
fn fixed(gpu: &GpuSpec) -> Vec<Memory> {
    let access = Charge::access;
    let vertices = f64::from(gpu.pipeline.vertex_reuse) * VERTEX_BYTES;
    let vertices_read = vec![Charge::shares(Event::VertexInvocations, 0.93, 0.0), access(Event::TrianglesIn)];
    let triangles = gpu.pipeline.memory.bins.map_or(32.0 * KB, |buffer| f64::from(buffer.entries) * LINE);
    let triangles_read =
        [Event::CoarseTilesVisited, Event::TrianglesSetUp, Event::BinEntries, Event::BinMisses]
            .map(access)
            .to_vec();
    let depth = &gpu.pipeline.depth;
    let boxes: f64 = depth.boxes.iter().map(|&count| f64::from(count)).product();
    let kept = if depth.z_min { 2.0 } else { 1.0 };
    let z_culled = vec![
        access(Event::ZCullTests),
        Charge::shares(Event::ZMaxUpdates, 0.87, 0.0),
        access(Event::ZMinUpdates),
    ];
    vec![
        Memory {
            accesses: rate(gpu, Event::VerticesFetched),
            ..memory("vertex_fetch", Unit::Command, 5.0 * KB, 16.0, Vec::new())
        },
        Memory {
            accesses: 3.0 * rate(gpu, Event::TrianglesIn),
            ..memory("vertex_store", Unit::Setup, vertices, 32.0, vertices_read)
        },
        Memory {
            accesses: rate(gpu, Event::CoarseTilesVisited),
            ..memory("triangles", Unit::Traversal, triangles, 128.0, triangles_read)
        },
        Memory {
            accesses: rate(gpu, Event::TilesVisited),
            ..memory("tile_stack", Unit::Traversal, 4.0 * KB, 32.0, vec![access(Event::TilesVisited)])
        },
        Memory {
            accesses: rate(gpu, Event::ZCullTests),
            ..memory("z_cull", Unit::ZCull, 8.0 * KB * boxes * kept, 32.0, z_culled)
        },
        Memory {
            accesses: rate(gpu, Event::SamplesTested),
            ..memory("sample_table", Unit::SampleTest, 4.0 * KB, 16.0, vec![access(Event::SampleReads)])
        },
    ]
}

/// Caches above memory.
fn caches(gpu: &GpuSpec) -> Vec<Memory> {
    let mut all = Vec::from(line_caches(gpu));
    all.extend(shaded_quads(gpu));
    let cache = &gpu.pipeline.memory;
    let units = [Unit::Llc, Unit::Edram].into_iter().zip(cache.levels()).zip(gpu.units.levels());
    all.extend(units.filter_map(|((unit, size), spec)| {
        Some(level(unit, f64::from(size?.entries) * LINE, f64::from(spec?.lines_per_cycle.get())))
    }));
    all
}

/// Caches of lines, the L2 among them.
fn line_caches(gpu: &GpuSpec) -> [Memory; 4] {
    let access = Charge::access;
    let cache = &gpu.pipeline.memory;
    [
        of_lines(
            "depth_cache",
            cache.depth,
            rate(gpu, Event::DepthLines),
            vec![
                access(Event::DepthLines),
                access(Event::DepthMisses),
                Charge::shares(Event::DepthReads, 0.0, 0.97),
                Charge::shares(Event::DepthWrites, 0.0, 1.0),
            ],
        ),
        of_lines(
            "colour_cache",
            cache.colour,
            rate(gpu, Event::ColourLines),
            vec![
                access(Event::ColourLines),
                access(Event::ColourMisses),
                Charge::shares(Event::ColourWrites, 0.0, 0.66),
                Charge::shares(Event::SamplesBlended, 0.0, 0.21),
                Charge::shares(Event::SamplesResolved, 0.0, 0.66),
            ],
        ),
        of_lines(
            "texture_cache",
            cache.texture,
            rate(gpu, Event::TextureLines),
            vec![access(Event::TextureLines), access(Event::TextureMisses)],
        ),
        of_lines(
            "l2",
            cache.l2,
            f64::from(gpu.units.l2.lines_per_cycle.get()),
            vec![
                Charge::shares(Event::L2Reads, 0.68, 0.32),
                Charge::shares(Event::L2Writes, 0.73, 0.27),
                access(Event::L2Misses),
            ],
        ),
    ]
}

/// The cache of shaded quads, their colours and their tags.
fn shaded_quads(gpu: &GpuSpec) -> [Memory; 2] {
    let quads = f64::from(gpu.pipeline.shading_cache.entries);
    let [data, tag] = QUAD_BYTES;
    [
        Memory {
            accesses: rate(gpu, Event::QuadsShaded),
            ..memory(
                "shaded_quads",
                Unit::ShadingCache,
                quads * data,
                data,
                vec![Charge::access(Event::ShadingHits), Charge::access(Event::QuadsShaded)],
            )
        },
        Memory {
            accesses: rate(gpu, Event::ShadingLookups),
            ..memory(
                "quad_tags",
                Unit::ShadingCache,
                quads * tag,
                32.0,
                vec![Charge::shares(Event::ShadingLookups, 0.88, 0.0)],
            )
        },
    ]
}

/// A cache of lines of 64 bytes. Its unit is that of the first event it is charged for.
fn of_lines(name: &'static str, cache: CacheSpec, accesses: f64, charges: Vec<Charge>) -> Memory {
    let unit = charges.first().map_or(Unit::L2, |charge| charge.event.unit());
    Memory { accesses, ..memory(name, unit, f64::from(cache.entries) * LINE, LINE, charges) }
}

/// A level below the L2.
fn level(unit: Unit, bytes: f64, accesses: f64) -> Memory {
    let (name, charges) = match unit {
        Unit::Llc => (
            "llc",
            [
                Charge::shares(Event::LlcReads, 0.74, 0.26),
                Charge::shares(Event::LlcWrites, 0.74, 0.26),
                Charge::access(Event::LlcWritebacks),
            ],
        ),
        // The rest is the link over the package.
        _ => (
            "edram",
            [
                Charge::shares(Event::EdramReads, 0.54, 0.19),
                Charge::shares(Event::EdramWrites, 0.54, 0.19),
                Charge::shares(Event::EdramWritebacks, 0.54, 0.19),
            ],
        ),
    };
    Memory { accesses, ..memory(name, unit, bytes, LINE, charges.to_vec()) }
}

/// Registers and shared memories of the cores.
fn cores(gpu: &GpuSpec) -> [Memory; 2] {
    let shader = &gpu.units.shader;
    let copies = f64::from(shader.cores.get());
    let threads = f64::from(shader.warps.get()) * f64::from(shader.warp_lanes.get());
    // Four words of an operation in each lane. They are half of its energy in the table's derivation.
    let width_bytes = 16.0 * f64::from(shader.lanes.get());
    let operands = vec![Charge::shares(Event::ShaderOps, 0.48, 0.0)];
    let registers = memory("registers", Unit::Shader, threads * REGISTER_BYTES, width_bytes, operands);
    let banks = gpu.pipeline.compute.as_ref().map_or(1, |compute| compute.banks);
    let words = vec![Charge::shares(Event::SharedAccesses, 0.58, 0.42)];
    let shared = memory("shared_memory", Unit::Compute, f64::from(shader.shared_bytes.get()), 4.0, words);
    let accesses = f64::from(banks) * (rate(gpu, Event::SharedCycles) / copies).max(1.0);
    [Memory { copies, ..registers }, Memory { copies, accesses, ..shared }]
}

/// Queues in front of a unit, and what waits behind it for lines.
fn queues(gpu: &GpuSpec, unit: Unit) -> [Memory; 2] {
    let Common { queue, in_flight, .. } = gpu.units.common(unit);
    let copies = match unit {
        Unit::Dram => f64::from(gpu.units.dram.channels.get()),
        // A queue for each client.
        Unit::L2 => 5.0,
        _ => 1.0,
    };
    let writes = gpu.units.dram.write_queue.filter(|_| unit == Unit::Dram).map_or(0, |queue| queue.get());
    let [waiting, in_flight] =
        [("queue", queue + writes), ("in_flight", in_flight)].map(|(name, entries)| Memory {
            copies,
            ..memory(name, unit, f64::from(entries) * PACKET_BYTES, PACKET_BYTES, Vec::new())
        });
    [waiting, in_flight]
}

/// More hardware costs more, and the GPU of a platform keeps its numbers.
#[cfg(test)]
pub(crate) mod tests {
    use power_model::{Bound, EnergyTable, PowerModel, UncertainValue};
    use proptest::prelude::*;

    use super::*;

    const CORES: &str = "units.shader.cores";

    /// Numbers of a GPU file that add hardware where they grow: path from `gpu`, and where drawing starts.
    pub(crate) const GROW: [(&str, f64); 40] = [
        ("pipeline.vertex_reuse", 32.0),
        ("pipeline.shading_cache.entries", 1024.0),
        ("pipeline.memory.depth.entries", 256.0),
        ("pipeline.memory.colour.entries", 256.0),
        ("pipeline.memory.texture.entries", 256.0),
        ("pipeline.memory.bins.entries", 512.0),
        ("pipeline.memory.l2.entries", 4096.0),
        ("pipeline.compute.banks", 2.0),
        ("pipeline.compute.atomic_units", 1.0),
        ("units.command.queue", 16.0),
        ("units.command.in_flight", 16.0),
        ("units.command.rates.indices", 1.0),
        ("units.command.rates.vertices_fetched", 1.0),
        ("units.shader.queue", 32.0),
        ("units.shader.in_flight", 32.0),
        (CORES, 2.0),
        ("units.shader.lanes", 32.0),
        ("units.shader.warps", 16.0),
        ("units.shader.shared_bytes", 16384.0),
        ("units.setup.rates.triangles_in", 0.25),
        ("units.traversal.rates.tile_madds", 48.0),
        ("units.traversal.rates.tiles_visited", 1.0),
        ("units.traversal.rates.coarse_tiles_visited", 1.0),
        ("units.z_cull.rates.z_cull_tests", 1.0),
        ("units.z_cull.rates.depth_interval_madds", 8.0),
        ("units.sample_test.rates.screen_madds", 480.0),
        ("units.sample_test.rates.sample_madds", 432.0),
        ("units.sample_test.rates.samples_tested", 24.0),
        ("units.depth.rates.depth_lines", 1.0),
        ("units.depth.rates.depth_reads", 16.0),
        ("units.shading_cache.rates.shading_lookups", 16.0),
        ("units.shading_cache.rates.quads_shaded", 1.0),
        ("units.texture.rates.texture_fetches", 4.0),
        ("units.texture.rates.texture_lines", 2.0),
        ("units.colour.rates.colour_writes", 16.0),
        ("units.colour.rates.colour_lines", 1.0),
        ("units.compute.rates.shared_cycles", 2.0),
        ("units.compute.rates.buffer_lines", 1.0),
        ("units.l2.lines_per_cycle", 1.0),
        ("units.dram.channels", 2.0),
    ];

    /// Changes of values in the GPU file.
    pub(crate) fn set(values: &[(&str, f64)]) -> Vec<crate::Change> {
        let change = |&(path, value): &(&str, f64)| crate::Change {
            path: format!("gpu.{path}"),
            value: format!("{value}"),
        };
        values.iter().map(change).collect()
    }

    /// The GPU `name` with changes.
    fn changed(name: &str, values: &[(&str, f64)]) -> GpuSpec {
        let changes = set(values);
        let mut changes = crate::changes::Changes::new(&changes).unwrap();
        changes.gpu(name.as_ref()).unwrap().unwrap()
    }

    /// Area, leakage, idle power and the watts of each unit, which must not fall.
    fn costs(gpu: &GpuSpec, platform: &Platform, bound: Bound) -> Vec<(String, f64)> {
        let scaling = scaling(gpu, platform).unwrap();
        let on = platform.on(&scaling, bound);
        let area = structure(gpu).area_mm2(platform.node_nm).at(bound);
        let mut costs = vec![
            ("area".to_owned(), area),
            ("leakage".to_owned(), on.leakage_w()),
            ("idle".to_owned(), on.idle_w.value()),
        ];
        for row in on.units() {
            costs.push((format!("{} busy", row.unit.name()), row.clock_tree_w.value()));
            costs.push((format!("{} idle", row.unit.name()), row.idle_unit_w.value()));
        }
        costs
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(96))]

        /// From a machine drawn at random, none of its numbers that adds hardware lowers area, leakage, idle
        /// power, or the power of a busy unit: but for the shared memories of more cores, which have the same
        /// accesses together.
        #[test]
        fn no_number_that_adds_hardware_makes_anything_cheaper(
            start in prop::collection::vec(0..3_u32, GROW.len()),
            which in 0..GROW.len(),
            by in 1..5_u32,
            bound in prop::sample::select(Bound::ALL.to_vec()),
        ) {
            let at = |index: usize, doublings: u32| (GROW[index].0, GROW[index].1 * f64::from(1 << doublings));
            let few: Vec<_> = (0..GROW.len()).map(|index| at(index, start[index])).collect();
            let mut more = few.clone();
            more[which] = at(which, start[which] + by);
            let platform = Platform::builtin("reference").unwrap();
            let [few, more] = [few, more].map(|changes| costs(&changed("reference", &changes), &platform, bound));
            for ((what, few), (_, more)) in few.iter().zip(&more) {
                if GROW[which].0 == CORES && what == "compute busy" {
                    continue;
                }
                prop_assert!(more >= &(few * (1.0 - 1e-12)), "{} by {}: {} from {} to {}", GROW[which].0, by, what, few, more);
            }
        }
    }

    /// `shared_cycles` counts accesses to the shared memories of all cores. With more cores each memory has
    /// fewer in a cycle, so it needs fewer ports, and an access costs less energy. Cores that keep their
    /// accesses cost more.
    #[test]
    fn cores_that_keep_their_accesses_to_shared_memory_cost_more() {
        let platform = Platform::builtin("reference").unwrap();
        let busy = |cores: f64, shared_cycles: f64| {
            let gpu =
                changed("reference", &[(CORES, cores), ("units.compute.rates.shared_cycles", shared_cycles)]);
            let costs = costs(&gpu, &platform, Bound::Nominal);
            costs.into_iter().find(|(what, _)| what == "compute busy").unwrap().1
        };
        for (cores, shared_cycles) in [(2.0, 2.0), (2.0, 8.0), (8.0, 2.0), (4.0, 16.0)] {
            let [few, more] = [1.0, 2.0].map(|by| busy(by * cores, by * shared_cycles));
            assert!(more > 1.5 * few, "{cores} cores, {shared_cycles} accesses: {few} W, {more} W");
        }
        let [few, more] = [2.0, 4.0].map(|cores| busy(cores, 8.0));
        assert!(0.8 * few < more && more < few, "{few} W, {more} W");
    }

    #[test]
    fn every_number_that_adds_hardware_is_paid_for() {
        let platform = Platform::builtin("reference").unwrap();
        let home = costs(&GpuSpec::load("reference").unwrap(), &platform, Bound::Nominal);
        for (path, start) in GROW {
            let grown = changed("reference", &[(path, 32.0 * start)]);
            let grown = costs(&grown, &platform, Bound::Nominal);
            let dearer =
                home.iter().zip(&grown).filter(|((_, few), (_, more))| *more > 1.000_01 * few).count();
            assert!(dearer > 0, "{path} times 32 costs nothing");
        }
    }

    #[test]
    fn the_gpu_of_a_platform_keeps_its_numbers_to_the_last_bit() {
        for name in Platform::names() {
            let platform = Platform::builtin(name).unwrap();
            let gpu = GpuSpec::load(&platform.made_for).unwrap();
            let scaling = scaling(&gpu, &platform).unwrap();
            let table = EnergyTable::builtin("28nm").unwrap();
            for bound in Bound::ALL {
                assert_eq!(platform.on(&scaling, bound), platform.at(bound), "{name}");
                let [plain, scaled] = [
                    PowerModel::at(&table, &platform, bound),
                    PowerModel::on(&table, &platform, bound, &scaling),
                ]
                .map(Result::unwrap);
                assert_eq!(plain, scaled, "{name}");
            }
        }
    }

    #[test]
    fn what_is_the_same_in_another_gpu_costs_the_same() {
        let platform = Platform::builtin("reference").unwrap();
        let larger = changed("reference", &[("pipeline.memory.texture.entries", 4096.0)]);
        let scaling = scaling(&larger, &platform).unwrap();
        assert_eq!(scaling.event(Event::DepthLines), UncertainValue::ONE);
        assert_eq!(scaling.clock_tree(Unit::Depth), UncertainValue::ONE);
        let lines = scaling.event(Event::TextureLines);
        assert!(1.5 < lines.low && lines.low <= lines.nominal && lines.nominal <= lines.high, "{lines:?}");
        assert_eq!(lines, scaling.event(Event::TextureMisses));
    }

    #[test]
    fn clock_trees_follow_the_clock_and_leakage_does_not() {
        let platform = Platform::builtin("reference").unwrap();
        let fast = changed("reference", &[("core_hz", 800e6)]);
        let scaling = scaling(&fast, &platform).unwrap();
        assert_eq!(scaling.leakage, UncertainValue::ONE);
        for unit in Unit::ALL.into_iter().filter(|unit| !unit.is_optional()) {
            let ratio = if unit == Unit::Dram { 1.0 } else { 2.0 };
            assert_eq!(scaling.clock_tree(unit).nominal, ratio, "{}", unit.name());
        }
    }

    /// Areas beside those of products: they have what is not modelled (interfaces, video, displays, wires),
    /// and not the 5D units.
    #[test]
    fn areas_are_below_those_of_products() {
        // Tahiti: 365 mm2 (HotHardware, HD 7970 review). Ivy Bridge: 160 mm2, 113 mm2 without graphics
        // (AnandTech, i7 3770K review).
        for (name, node_nm, product_mm2) in [("discrete", 28, 365.0), ("hd_4000", 22, 47.0)] {
            let area = structure(&GpuSpec::load(name).unwrap()).area_mm2(node_nm);
            println!("{name}: {area:?}, product {product_mm2} mm2");
            assert!(area.nominal < product_mm2 && product_mm2 < 2.0 * area.high, "{name}: {area:?}");
        }
    }

    /// The reference platform, as if it was made for `gpu`.
    fn made_for(gpu: &str) -> Platform {
        let mut platform = Platform::builtin("reference").unwrap();
        gpu.clone_into(&mut platform.made_for);
        platform
    }

    /// Levels below the L2, from those of a GPU that has them.
    #[test]
    fn larger_levels_below_the_l2_are_dearer() {
        let platform = made_for("iris_pro");
        let home = costs(&GpuSpec::load("iris_pro").unwrap(), &platform, Bound::Nominal);
        for (path, value) in [
            ("pipeline.memory.llc.entries", 393_216.0),
            ("pipeline.memory.edram.entries", 8_388_608.0),
            ("units.llc.lines_per_cycle", 8.0),
        ] {
            let grown = costs(&changed("iris_pro", &[(path, value)]), &platform, Bound::Nominal);
            assert!(home.iter().zip(&grown).all(|((_, few), (_, more))| more >= few), "{path}");
            let level = if path.contains("edram") { "edram idle" } else { "llc idle" };
            let watts = |costs: &[(String, f64)]| costs.iter().find(|(what, _)| what == level).unwrap().1;
            assert!(watts(&grown) > 1.5 * watts(&home), "{path}: {} W, {} W", watts(&home), watts(&grown));
        }
    }

    #[test]
    fn a_platform_of_a_gpu_that_is_not_there_is_refused() {
        let platform = made_for("referense");
        let error = scaling(&GpuSpec::load("reference").unwrap(), &platform).unwrap_err().to_string();
        assert!(
            error.contains("`made_for` of platform `reference`") && error.contains("`reference`?"),
            "{error}"
        );
    }
}
