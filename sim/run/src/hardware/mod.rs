//! Hardware of a GPU: the structure that its file describes, its area, and its power beside that of the GPU of the platform.

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

/// Units for which platforms have numbers although their GPU lacks them: the compute unit of the reference GPU, and the levels below the
/// L2 for which the rows are stated.
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

/// Memories of the fixed-function units, of the sizes in the energy table. Shares of events are those of its derivations.
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
    let access = Charge::access;
    let entries = |cache: CacheSpec| f64::from(cache.entries);
    let cache = &gpu.pipeline.memory;
    let quads = entries(gpu.pipeline.shading_cache);
    let [data, tag] = QUAD_BYTES;
    let mut all = vec![
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
        Memory {
            accesses: rate(gpu, Event::QuadsShaded),
            ..memory(
                "shaded_quads",
                Unit::ShadingCache,
                quads * data,
                data,
                vec![access(Event::ShadingHits), access(Event::QuadsShaded)],
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
    ];
    let units = [Unit::Llc, Unit::Edram].into_iter().zip(cache.levels()).zip(gpu.units.levels());
    all.extend(units.filter_map(|((unit, size), spec)| {
        Some(level(unit, entries(size?) * LINE, f64::from(spec?.lines_per_cycle.get())))
    }));
    all
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

#[cfg(test)]
pub(crate) mod tests;
