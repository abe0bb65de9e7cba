//! Surfaces: passes onto any of them, with any formats, states, load and store operations, resolves and mip
//! chains between them, leave what storing every sample of every triangle in order, and plain loops over
//! samples and texels, leave.

use std::ops::Range;
use std::slice;

use activity::{Event, Packet, PacketKind, Waits};
use glam::{Vec2, Vec3, Vec4};
use pipeline::texture::srgb8_to_linear;
use pipeline::*;
use proptest::prelude::*;

use crate::common::stage::*;
use crate::common::*;
use crate::levels::{PlainLevel, chain, mixed_levels};
use crate::state::{changed, mixed, passes, pick, state};

const COLOURS: [Format; 6] =
    [Format::Rgba8Srgb, Format::Rgba8, Format::Rgba16f, Format::R32f, Format::Rg32f, Format::R32u];

/// Constant colours for all targets.
struct Tints([Vec4; 4]);

impl Shader for Tints {
    fn shade(&self, _: &Lane, _: &ShadingPoint, _: Vec4) -> Vec4 {
        self.0[0]
    }

    fn outputs(&self, _: &Lane, _: &ShadingPoint, _: Vec4) -> Outputs {
        self.0
    }
}

/// Adds the sample to the right in slot 0 to a colour.
struct Neighbour(Vec4);

impl Shader for Neighbour {
    fn shade(&self, lane: &Lane, at: &ShadingPoint, _: Vec4) -> Vec4 {
        lane.add(lane.load_sample(0, [at.pixel[0] + 1, at.pixel[1]], at.sample), self.0)
    }
}

/// Adds a fetch from the levels in slot 0 to a colour.
struct Coarse {
    colour: Vec4,
    lod: f32,
}

impl Coarse {
    /// Off the middle of the pixel, so that texels have different weights.
    fn uv(pixel: [i32; 2]) -> Vec2 {
        let size = [viewport().width(), viewport().height()].map(|side| side as f32);
        Vec2::new((pixel[0] as f32 + 0.3) / size[0], (pixel[1] as f32 + 0.9) / size[1])
    }
}

impl Shader for Coarse {
    fn shade(&self, lane: &Lane, at: &ShadingPoint, _: Vec4) -> Vec4 {
        lane.add(lane.fetch(0, Self::uv(at.pixel), self.lod), self.colour)
    }
}

/// What draws of a pass read, by number of the surface.
#[derive(Clone, Copy)]
enum Read {
    Neighbour(usize),
    /// All levels of a resolved surface, at a level of detail.
    Levels(usize, f32),
}

/// Samples that are resolved into a surface with levels, by number.
#[derive(Clone, Copy)]
struct Resolving {
    from: usize,
    to: usize,
    drops: bool,
}

/// Triangles of a soup with a state and colours.
struct Part {
    triangles: Range<usize>,
    state: DrawState,
    tints: Tints,
}

/// One pass: its targets by number of the surface, and what it draws.
struct Step {
    colours: Vec<(usize, Load<Vec4>, Store)>,
    depth: Option<(usize, Load<Clear>, Store)>,
    parts: Vec<Part>,
    reads: Option<Read>,
    resolves: Option<Resolving>,
}

/// Random passes over the same triangles.
struct PassSequence {
    soup: Soup,
    optics: Optics,
    table: SampleTable,
    formats: Vec<Format>,
    /// Formats of the surfaces with levels.
    resolved: [Format; 2],
    steps: Vec<Step>,
}

/// Contents of all samples and of all levels.
type Contents = (Vec<Option<Vec<Vec4>>>, Vec<Option<Vec<PlainLevel>>>);

fn viewport() -> Viewport {
    Viewport::new(40, 26).unwrap()
}

fn colour(r: &mut Uniform) -> Vec4 {
    // Some are beyond 1, some below 0.
    Vec4::new(r.within(-0.2, 1.4), r.next(), r.next(), r.next())
}

fn store(r: &mut Uniform) -> Store {
    if r.next() < 0.2 { Store::Discard } else { Store::Store }
}

fn load<V>(r: &mut Uniform, is_written: bool, clear: V) -> Load<V> {
    match r.next() {
        x if x < 0.4 && is_written => Load::Load,
        x if x < 0.5 => Load::Discard,
        _ => Load::Clear(clear),
    }
}

impl PassSequence {
    fn new(kind: SoupKind, optics: Optics, per_pixel: u32, count: usize, seed: u64) -> Self {
        let mut r = Uniform::new(seed ^ 11);
        let mut formats: Vec<Format> = (0..5).map(|_| pick(&mut r, &COLOURS)).collect();
        formats.extend([Format::D32, Format::D24S8]);
        let (mut written, mut filled) = ([false; 7], [false; 2]);
        let resolved = [0, 1].map(|_| pick(&mut r, &COLOURS[..5]));
        let steps = (0..4).map(|_| Step::new(&mut r, &formats, (&mut written, &mut filled), count)).collect();
        let table = SampleTable::low_discrepancy(per_pixel, seed, LensShape::Disk).unwrap();
        Self { soup: Soup::new(kind, count as u32, seed), optics, table, formats, resolved, steps }
    }

    /// Contents of all surfaces after all passes.
    fn drawn(&self, spec: &PipelineSpec) -> Contents {
        let settings =
            Settings { spec, viewport: viewport(), samples: &self.table, background: Vec3::splat(0.5) };
        let mut gpu = Gpu::without_packets(spec).unwrap();
        let samples = self.table.per_pixel();
        let surface = |gpu: &mut Gpu<'_>, format: Format| {
            gpu.create_surface(&SurfaceSpec::new("any", viewport(), format).sampled(samples))
        };
        let ids: Vec<SurfaceId> = self.formats.iter().map(|format| surface(&mut gpu, *format)).collect();
        let mipped = |format| SurfaceSpec::new("levels", viewport(), format).mipmapped();
        let chains = self.resolved.map(|format| gpu.create_surface(&mipped(format)));
        let camera = camera(self.optics);
        for step in &self.steps {
            let targets = step.attachments(&ids);
            let binding = step.reads.map(|read| match read {
                Read::Neighbour(surface) => Binding::Surface(ids[surface]),
                Read::Levels(surface, _) => Binding::Levels(chains[surface]),
            });
            let bindings: Vec<Binding<'_>> = binding.into_iter().collect();
            let reader = |part: &Part| -> Box<dyn Shader> {
                let colour = part.tints.0[0];
                match step.reads {
                    Some(Read::Levels(_, lod)) => Box::new(Coarse { colour, lod }),
                    _ => Box::new(Neighbour(colour)),
                }
            };
            let readers: Vec<Box<dyn Shader>> = step.parts.iter().map(reader).collect();
            let draws: Vec<Draw<'_>> = step
                .parts
                .iter()
                .zip(&readers)
                .map(|(part, reader)| {
                    let Soup { open, close, triangles } = &self.soup;
                    let geometry = Geometry::new(open, close, &triangles[part.triangles.clone()]).unwrap();
                    let shader: &dyn Shader = if bindings.is_empty() { &part.tints } else { &**reader };
                    Draw::new(geometry, shader, Cull::None).with_state(part.state).binding(&bindings)
                })
                .collect();
            let pass = RasterPass::new(&camera, &draws, &settings).onto(Target::Surfaces(&targets));
            let pass = if step.reads.is_some() { pass.shaded_per_sample() } else { pass };
            gpu.draw(&pass).unwrap();
            if let Some(Resolving { from, to, drops }) = step.resolves {
                let pass = ResolvePass::new("resolve", ids[from]);
                gpu.resolve(&if drops { pass.dropping() } else { pass }, chains[to]).unwrap();
                gpu.make_levels("chain", chains[to]).unwrap();
            }
        }
        let levels =
            |id: &SurfaceId| (0..6).map(|level| PlainLevel::of(&gpu, *id, viewport(), level)).collect();
        (ids.iter().map(|id| gpu.contents(*id)).collect(), chains.iter().map(levels).collect())
    }

    fn reference(&self) -> Contents {
        let mut chains: Vec<Option<Vec<PlainLevel>>> = vec![None; 2];
        let count = viewport().pixels() * self.table.per_pixel() as usize;
        let mut stored: Vec<Option<Vec<Vec4>>> = vec![None; self.formats.len()];
        for step in &self.steps {
            let first = |surface: usize, value: Option<Vec4>, stored: &[Option<Vec<Vec4>>]| match value {
                Some(value) => vec![rounded(self.formats[surface], value); count],
                None => stored[surface].clone().unwrap(),
            };
            let mut colours: Vec<Vec<Vec4>> = step
                .colours
                .iter()
                .map(|(surface, load, _)| first(*surface, cleared(*load, |value| value), &stored))
                .collect();
            let value = |clear: Clear| Vec4::new(clear.depth, f32::from(clear.stencil), 0.0, 1.0);
            let depth =
                step.depth.map(|(surface, load, _)| (surface, first(surface, cleared(load, value), &stored)));
            let (depth_of, mut depths) = depth.unwrap_or((usize::MAX, vec![Vec4::ZERO; count]));
            every_tile(&self.soup, self.optics, viewport(), &self.table, |tile| {
                let place: Vec<usize> = (0..tile.samples.len)
                    .map(|slot| {
                        tile.samples.in_image(slot, tile.origin, 8, viewport(), self.table.per_pixel())
                    })
                    .collect();
                for part in &step.parts {
                    let read = |index: usize| match step.reads? {
                        Read::Neighbour(surface) => self.neighbour(stored[surface].as_ref()?, index),
                        Read::Levels(surface, lod) => {
                            let (pixel, width) =
                                (index / self.table.per_pixel() as usize, viewport().width());
                            let at = [pixel as u32 % width, pixel as u32 / width].map(|part| part as i32);
                            Some(mixed_levels(chains[surface].as_ref()?, Coarse::uv(at), lod))
                        }
                    };
                    let round = |depth: f32| {
                        self.formats
                            .get(depth_of)
                            .map_or(depth, |format| rounded(*format, Vec4::splat(depth)).x)
                    };
                    for (slot, depth, front) in part.hits(tile) {
                        let at = place[slot];
                        if !part.passes(&mut depths[at], round(depth), front) {
                            continue;
                        }
                        for (number, (target, values)) in step.colours.iter().zip(&mut colours).enumerate() {
                            let new = match step.reads {
                                None => part.tints.0[number],
                                Some(_) if number > 0 => Vec4::ZERO,
                                Some(_) => read(at).unwrap_or_default() + part.tints.0[0],
                            };
                            let ColourState { blend, mask } = part.state.target(number);
                            let both = mixed(blend, new, values[at]);
                            (0..4).filter(|k| mask[*k]).for_each(|k| values[at][k] = both[k]);
                            values[at] = rounded(self.formats[target.0], values[at]);
                        }
                    }
                }
            });
            let stores = step.colours.iter().map(|to| (to.0, to.2)).zip(colours);
            let depth = step.depth.map(|to| ((to.0, to.2), depths));
            for ((surface, store), values) in stores.chain(depth) {
                stored[surface] = (store == Store::Store).then_some(values);
            }
            if let Some(Resolving { from, to, drops }) = step.resolves {
                let samples = self.table.per_pixel() as usize;
                let all = stored[from].as_ref().unwrap();
                let mean = |pixel: &[Vec4]| {
                    let mut sum = Vec4::ZERO;
                    pixel.iter().for_each(|sample| sum += *sample);
                    rounded(self.resolved[to], sum / samples as f32)
                };
                let size = [viewport().width(), viewport().height()].map(|side| side as usize);
                let finest = PlainLevel { size, values: all.chunks(samples).map(mean).collect() };
                chains[to] = Some(chain(finest, |value| rounded(self.resolved[to], value)));
                if drops {
                    stored[from] = None;
                }
            }
        }
        (stored, chains)
    }

    /// Sample to the right of the one with this index.
    fn neighbour(&self, values: &[Vec4], index: usize) -> Option<Vec4> {
        let (per_pixel, width) = (self.table.per_pixel() as usize, viewport().width() as usize);
        (index / per_pixel % width + 1 < width).then(|| values[index + per_pixel])
    }
}

fn cleared<V>(load: Load<V>, value: impl Fn(V) -> Vec4) -> Option<Vec4> {
    match load {
        Load::Clear(clear) => Some(value(clear)),
        Load::Load => None,
        Load::Discard => Some(Vec4::ZERO),
    }
}

impl Step {
    fn new(
        r: &mut Uniform,
        formats: &[Format],
        (written, filled): (&mut [bool; 7], &mut [bool; 2]),
        count: usize,
    ) -> Self {
        let mut free: Vec<usize> = (0..5).collect();
        let targets = pick(r, &[0, 1, 1, 2, 3, 4]);
        let mut chosen = Vec::new();
        for _ in 0..targets {
            chosen.push(free.remove((r.next() * free.len() as f32) as usize));
        }
        // A pass of a reader has one colour.
        let neighbour = free.iter().copied().find(|surface| written[*surface]).map(Read::Neighbour);
        let levels =
            (0..2).find(|surface| filled[*surface]).map(|surface| Read::Levels(surface, 5.5 * r.next()));
        let reads = (if r.next() < 0.5 { levels.or(neighbour) } else { neighbour.or(levels) })
            .filter(|_| chosen.len() == 1);
        let clear = Clear { depth: pick(r, &[f32::INFINITY, 6.0, 0.0]), stencil: pick(r, &[0, 1, 255]) };
        let depth = pick(r, &[None, Some(5), Some(6), Some(6)]);
        let depth = depth.map(|surface| (surface, load(r, written[surface], clear), store(r)));
        let colours: Vec<_> = chosen
            .into_iter()
            .map(|surface| {
                let value = colour(r);
                (surface, load(r, written[surface], value), store(r))
            })
            .collect();
        let stores = colours.iter().map(|to| (to.0, to.2)).chain(depth.map(|to| (to.0, to.2)));
        stores.for_each(|(surface, store)| written[surface] = store == Store::Store);
        let (mut parts, mut first) = (Vec::new(), 0);
        while first < count {
            let triangles = first..count.min(first + 1 + (r.next() * 12.0) as usize);
            first = triangles.end;
            let tints = Tints(std::array::from_fn(|_| colour(r)));
            parts.push(Part {
                triangles,
                state: fitting(r, &colours, depth.map(|to| formats[to.0]), formats),
                tints,
            });
        }
        let from = (0..5).rfind(|surface| written[*surface] && formats[*surface].can_blend());
        let resolves =
            from.map(|from| Resolving { from, to: usize::from(r.next() < 0.5), drops: r.next() < 0.3 });
        if let Some(Resolving { from, to, drops }) = resolves {
            (written[from], filled[to]) = (!drops, true);
        }
        Self { colours, depth, parts, reads, resolves }
    }

    fn attachments(&self, ids: &[SurfaceId]) -> Attachments {
        let colours = self.colours.iter();
        let colours =
            colours.map(|&(to, load, store)| Attachment { surface: ids[to], load, store }).collect();
        let depth = self.depth.map(|(to, load, store)| Attachment { surface: ids[to], load, store });
        Attachments { colours, depth }
    }
}

/// A random state that the targets allow.
fn fitting(
    r: &mut Uniform,
    colours: &[(usize, Load<Vec4>, Store)],
    depth: Option<Format>,
    formats: &[Format],
) -> DrawState {
    let mut any = state(r);
    let mut target = |number: usize| {
        let DrawState { blend, colour_mask: mask, .. } = state(r);
        let can_blend = colours.get(number).is_none_or(|to| formats[to.0].can_blend());
        ColourState { blend: if can_blend { blend } else { Blend::Replace }, mask }
    };
    let first = target(0);
    (any.blend, any.colour_mask) = (first.blend, first.mask);
    any.others = [1, 2, 3].map(|number| Some(target(number)));
    if depth != Some(Format::D24S8) {
        any.stencil = None;
    }
    if depth.is_none() {
        any.depth = DepthState::NONE;
    }
    any
}

impl Part {
    /// Covered samples of a tile in order: slot, depth, and whether the face is seen from the front.
    fn hits(&self, tile: &TileOfSoup<'_>) -> Vec<(usize, f32, bool)> {
        let mut hits = Vec::new();
        for id in self.triangles.clone() {
            for culled in [Cull::Back, Cull::Front] {
                if self.state.cull != Cull::None && self.state.cull != culled {
                    continue;
                }
                let count = tile.samples.len;
                let (mut depth, mut owner) = (vec![f32::INFINITY; count], vec![u32::MAX; count]);
                for slot in tile.test(id, culled, &mut depth, &mut owner) {
                    hits.push((usize::from(slot), depth[usize::from(slot)], culled == Cull::Back));
                }
            }
        }
        hits
    }

    /// Tests a sample, and changes depth and stencil.
    fn passes(&self, at: &mut Vec4, depth: f32, front: bool) -> bool {
        let nearer = passes(self.state.depth.test, depth, at.x);
        let mut inside = true;
        if let Some(both) = self.state.stencil {
            let (face, stored) = (if front { both.front } else { both.back }, at.y as u8);
            inside = passes(face.test, face.reference & face.read_mask, stored & face.read_mask);
            let op = match (inside, nearer) {
                (false, _) => face.fail,
                (true, false) => face.depth_fail,
                (true, true) => face.pass,
            };
            let new = stored ^ (stored ^ changed(op, stored, face.reference)) & face.write_mask;
            at.y = f32::from(new);
        }
        if inside && nearer && self.state.depth.write {
            at.x = depth;
        }
        inside && nearer
    }
}

/// What a format keeps of a value.
fn rounded(format: Format, value: Vec4) -> Vec4 {
    let [r, g, b, a] = value.to_array();
    // The nearest code, of two as near the larger: means of codes lie between them.
    let unorm = |x: f32| {
        let error = |code: &u8| (f64::from(*code) - 255.0 * f64::from(x.clamp(0.0, 1.0))).abs();
        let code = (0..=255_u8).min_by(|p, q| error(p).total_cmp(&error(q)).then(q.cmp(p)));
        f32::from(code.unwrap()) / 255.0
    };
    let srgb = |x: f32| srgb8_to_linear(linear_to_srgb8(x));
    match format {
        Format::Rgba8Srgb => Vec4::new(srgb(r), srgb(g), srgb(b), unorm(a)),
        Format::Rgba8 => Vec4::new(unorm(r), unorm(g), unorm(b), unorm(a)),
        Format::Rgba16f => Vec4::from_array(value.to_array().map(half)),
        Format::R32f => Vec4::new(r, 0.0, 0.0, 1.0),
        Format::Rg32f => Vec4::new(r, g, 0.0, 1.0),
        Format::R32u => Vec4::new(r.max(0.0).trunc(), 0.0, 0.0, 1.0),
        Format::D32 => Vec4::new(r, 0.0, 0.0, 1.0),
        Format::D24S8 => Vec4::new(fraction(r, 16, -126), g, 0.0, 1.0),
    }
}

fn half(x: f32) -> f32 {
    let rounded = fraction(x, 10, -14);
    if rounded.abs() > 65504.0 { f32::INFINITY.copysign(x) } else { rounded }
}

/// The nearest number with `bits` of fraction and exponents from `least` on.
fn fraction(x: f32, bits: i32, least: i32) -> f32 {
    if x == 0.0 || x.is_infinite() {
        return x;
    }
    let exponent = f64::from(x.abs()).log2().floor().max(f64::from(least));
    let step = 2.0_f64.powi(exponent as i32 - bits);
    // Halves round to even, depths of 24 bits away from zero.
    let steps = f64::from(x) / step;
    let steps = if bits == 10 { steps.round_ties_even() } else { steps.round() };
    (steps * step) as f32
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 120, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn every_pass_leaves_what_storing_samples_in_order_leaves(
        kind in kinds(), lens: bool, switches in 0..SWITCHES, auto: bool, waits: bool, z_min: bool, per_pixel in prop::sample::select(&[1_u32, 2, 4][..]),
        batch_triangles in 1..40_u32, sizes in 0..4_usize, threads in 1..4_usize, count in 1..40_usize, seed: u64,
    ) {
        let (tile_px, coarse_tile_px) = [(8, 32), (4, 16), (2, 64), (1, 1)][sizes];
        let depth = depth::DepthSpec { z_min, ..depth::DepthSpec::default() };
        let spec = PipelineSpec {
            tile_px, coarse_tile_px, batch_triangles, depth, ..spec(Features { auto, hidden_surface_removal: waits, ..switched(switches) })
        };
        let sequence = PassSequence::new(kind, lens.into(), per_pixel, count, seed);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let ((ours, levels), (reference, wanted)) = (pool.install(|| sequence.drawn(&spec)), sequence.reference());
        let bits = |all: &[Option<Vec<Vec4>>]| -> Vec<Option<Vec<[u32; 4]>>> {
            all.iter().map(|one| Some(one.as_ref()?.iter().map(|v| v.to_array().map(f32::to_bits)).collect())).collect()
        };
        for (number, (ours, theirs)) in bits(&ours).iter().zip(bits(&reference)).enumerate() {
            prop_assert!(*ours == theirs, "surface {number} of {:?} differs", sequence.formats[number]);
        }
        for (number, (ours, theirs)) in levels.iter().zip(&wanted).enumerate() {
            let ours: Option<Vec<_>> = ours.as_ref().map(|levels| levels.iter().map(PlainLevel::bits).collect());
            let theirs: Option<Vec<_>> = theirs.as_ref().map(|levels| levels.iter().map(PlainLevel::bits).collect());
            prop_assert!(ours == theirs, "levels {number} of {:?} differ", sequence.resolved[number]);
        }
    }
}

/// Calls `run` with settings of an image of 16 x 16 pixels and one sample in the middle of each.
fn with<T>(run: impl FnOnce(&Stage, &Settings<'_>) -> T) -> T {
    let stage = Stage::sampled(16, 16, 1);
    let spec = spec(Features::ALL);
    run(
        &stage,
        &Settings { spec: &spec, viewport: stage.viewport, samples: &stage.table, background: Vec3::ZERO },
    )
}

fn screen(z: f32) -> [Vec3; 4] {
    rectangle([-8.0, 8.0], [-8.0, 8.0], z)
}

fn flat() -> DrawState {
    DrawState { depth: DepthState::NONE, ..DrawState::default() }
}

/// Every word and line of two targets and a depth buffer, by hand.
#[test]
fn loads_stores_and_clears_are_counted() {
    with(|stage, settings| {
        let corners = screen(1.0);
        // One of four tiles is covered.
        let tile = rectangle([-8.0, 0.0], [0.0, 8.0], 1.0);
        let count = |load: bool, store: Store| {
            let mut gpu = Gpu::without_packets(settings.spec).unwrap();
            let surface = |gpu: &mut Gpu<'_>, format| {
                gpu.create_surface(&SurfaceSpec::new("s", stage.viewport, format))
            };
            let [wide, narrow, depth] =
                [Format::Rgba16f, Format::Rgba8, Format::D32].map(|format| surface(&mut gpu, format));
            let targets = |load: bool, store| {
                let colour = |surface| Attachment {
                    surface,
                    load: if load { Load::Load } else { Load::Clear(Vec4::ONE) },
                    store,
                };
                let to = if load { Load::Load } else { Load::Clear(Clear::default()) };
                let depth = Some(Attachment { surface: depth, load: to, store });
                Attachments { colours: vec![colour(wide), colour(narrow)], depth }
            };
            if load {
                let all = [still(&corners, &RED)];
                let first = targets(false, Store::Store);
                let pass = RasterPass::new(&stage.camera, &all, settings).onto(Target::Surfaces(&first));
                gpu.draw(&pass).unwrap();
                gpu.wait();
            }
            let closer = DrawState {
                depth: DepthState { test: Compare::LessEqual, write: true },
                blend: Blend::Add,
                ..DrawState::default()
            };
            let second = targets(load, store);
            let draws = [still(&tile, &RED).with_state(closer)];
            let drawn = gpu
                .draw(&RasterPass::new(&stage.camera, &draws, settings).onto(Target::Surfaces(&second)))
                .unwrap();
            let report = gpu.finish();
            let events = [
                Event::ColourWrites,
                Event::SamplesBlended,
                Event::ColourLines,
                Event::DepthLines,
                Event::L2Reads,
            ];
            // A line of vertices for each of four, and one of indices.
            let vertices = 4 + 1;
            let counts = events.map(|event| drawn.counts[event]);
            let mut written = [counts[0], counts[1], counts[2], counts[3], counts[4] - vertices].to_vec();
            written.push(report.counts()[Event::DramWriteBytes]);
            written
        };
        // A tile of 64 pixels has 8 lines of halves, 4 of bytes and 4 of depths, as 3 words of colour a
        // pixel. The two triangles of the square have 4 x 4 blocks of pixels in common: the lines along the
        // diagonal count twice.
        let cleared = count(false, Store::Store);
        assert_eq!(cleared[..2], [64 * 3, 64 * 3]);
        // Three tiles are stored as they were cleared: 3 (8 + 4) lines of colour and 3 x 4 of depth.
        let (colour, depth) = (cleared[2] - 3 * 12, cleared[3] - 3 * 4);
        assert!((12..=24).contains(&colour) && (4..=8).contains(&depth), "{cleared:?}");
        assert_eq!(cleared[4..], [0, 4 * 16 * 64], "cleared tiles are not read, and all lines are written");
        // The square ends at the borders of the other tiles, so these are tested, too: the 4 lines of depth
        // of every tile are read to bound it. Of colour the lines drawn to are read; the others stay.
        let loaded = count(true, Store::Store);
        assert_eq!(loaded[2..], [colour, depth + 4 * 4, 8 + 4 + 4 * 4, 4 * 16 * 64]);
        assert_eq!(count(false, Store::Discard)[2..], [colour, depth, 0, 0], "nothing is written");
    });
}

/// A pass reads what another one drew: its fetches and lines are those that its lanes execute, after a barrier.
#[test]
fn fetches_are_counted_as_lanes_execute_them() {
    struct Twice(bool);
    impl Shader for Twice {
        fn shade(&self, lane: &Lane, at: &ShadingPoint, _: Vec4) -> Vec4 {
            let one = lane.load_sample(0, at.pixel, 0);
            if lane.branch(self.0 && at.pixel[0] >= 8) {
                return lane.add(
                    one,
                    lane.fetch(0, Vec2::new(at.pixel[0] as f32 + 1.0, at.pixel[1] as f32 + 0.5) / 16.0, 0.0),
                );
            }
            one
        }
    }
    with(|stage, settings| {
        let drawn = |shader: &Twice| {
            let mut packets = Vec::new();
            let mut gpu = Gpu::new(settings.spec, |packet, _| packets.push(*packet)).unwrap();
            let [from, to] = ["from", "to"]
                .map(|name| gpu.create_surface(&SurfaceSpec::new(name, stage.viewport, Format::R32f)));
            let targets = |surface| Attachments {
                colours: vec![Attachment::cleared(surface, Vec4::ZERO)],
                depth: None,
            };
            let (first, second) = (targets(from), targets(to));
            let left = rectangle([-8.0, 4.0], [-8.0, 8.0], 1.0);
            let one = [still(&left, &RED).with_state(flat())];
            gpu.draw(&RasterPass::new(&stage.camera, &one, settings).onto(Target::Surfaces(&first))).unwrap();
            let bindings = [Binding::Surface(from)];
            // One triangle covers the image.
            let large = [Vec3::new(-8.0, -8.0, 1.0), Vec3::new(40.0, -8.0, 1.0), Vec3::new(-8.0, 40.0, 1.0)];
            let draw = Draw::new(Geometry::new(&large, &large, &[[0, 1, 2]]).unwrap(), shader, Cull::None);
            let two = [draw.with_state(flat()).binding(&bindings)];
            let drawn = gpu
                .draw(&RasterPass::new(&stage.camera, &two, settings).onto(Target::Surfaces(&second)))
                .unwrap();
            let values: Vec<f32> = gpu.contents(to).unwrap().iter().map(|value| value.x).collect();
            drop(gpu);
            let barriers =
                packets.iter().filter(|packet: &&Packet| packet.kind == PacketKind::Barrier(Waits::Tiles));
            (drawn.counts, values, barriers.count())
        };
        let (counts, values, barriers) = drawn(&Twice(false));
        let ops = counts[Event::ShaderOps];
        assert!(values.iter().enumerate().all(|(at, value)| *value == if at % 16 < 12 { 1.0 } else { 0.0 }));
        assert_eq!(
            [counts[Event::TextureFetches], counts[Event::TextureLines], counts[Event::PixelInvocations]],
            [256; 3]
        );
        assert_eq!(
            (counts[Event::TextureMisses], barriers),
            (16, 1),
            "each line of the surface is read once"
        );
        let (counts, values, _) = drawn(&Twice(true));
        // Half of the lanes fetch as well, between two texels; lanes of a quad take one path here.
        assert_eq!(counts[Event::TextureFetches], 256 + 128);
        assert_eq!(counts[Event::ShaderOps] - ops, 128 * 4);
        let expected = |x: usize| {
            if !(8..12).contains(&x) {
                (x < 12) as u32 as f32
            } else if x == 11 {
                1.5
            } else {
                2.0
            }
        };
        assert!(values.iter().enumerate().all(|(at, value)| *value == expected(at % 16)), "{values:?}");
    });
}

/// Draws to `targets` with a shader that reads `read`, and returns the message.
fn refusal(
    prepare: impl FnOnce(&mut Gpu<'_>, Viewport) -> (Attachments, Vec<SurfaceId>),
    state: DrawState,
) -> String {
    with(|stage, settings| {
        let mut gpu = Gpu::without_packets(settings.spec).unwrap();
        let (targets, read) = prepare(&mut gpu, stage.viewport);
        let bindings: Vec<Binding<'_>> = read.into_iter().map(Binding::Surface).collect();
        let corners = screen(1.0);
        let draws = [still(&corners, &RED).with_state(state).binding(&bindings)];
        let pass =
            RasterPass::new(&stage.camera, &draws, settings).named("light").onto(Target::Surfaces(&targets));
        gpu.draw(&pass).unwrap_err().to_string()
    })
}

fn to(colours: &[SurfaceId]) -> Attachments {
    Attachments {
        colours: colours.iter().map(|id| Attachment::cleared(*id, Vec4::ZERO)).collect(),
        depth: None,
    }
}

#[test]
fn what_surfaces_cannot_do_is_refused_by_name() {
    let named = |name, format| {
        move |gpu: &mut Gpu<'_>, size| gpu.create_surface(&SurfaceSpec::new(name, size, format))
    };
    let albedo = named("albedo", Format::Rgba8);
    let starts = |message: String, start: &str| {
        assert!(message.starts_with(&format!("pass `light`, surface `{start}")), "{message}");
    };
    let feedback = refusal(
        |gpu, size| {
            let id = albedo(gpu, size);
            (to(&[id]), vec![id])
        },
        flat(),
    );
    starts(feedback, "albedo`: it is read and written in the same pass");
    let unwritten =
        refusal(|gpu, size| (to(&[albedo(gpu, size)]), vec![named("map", Format::R32f)(gpu, size)]), flat());
    starts(unwritten, "map`: it is read, but no earlier pass of the frame stored anything");
    let loaded = refusal(
        |gpu, size| {
            let colours = vec![Attachment::loaded(albedo(gpu, size))];
            (Attachments { colours, depth: None }, vec![])
        },
        flat(),
    );
    starts(loaded, "albedo`: it is read, but no earlier pass");
    let small = Viewport::new(8, 4).unwrap();
    let size = refusal(|gpu, _| (to(&[albedo(gpu, small)]), vec![]), flat());
    starts(size, "albedo`: it has 8 x 4 pixels, but the pass has 16 x 16");
    let samples = refusal(
        |gpu, size| {
            let ids = [1, 4]
                .map(|n| gpu.create_surface(&SurfaceSpec::new("albedo", size, Format::Rgba8).sampled(n)));
            (to(&ids), vec![])
        },
        flat(),
    );
    starts(samples, "albedo`: it has 4 samples per pixel, but the pass has 1");
    let blend = refusal(
        |gpu, size| (to(&[named("ids", Format::R32u)(gpu, size)]), vec![]),
        DrawState { blend: Blend::Add, ..flat() },
    );
    starts(blend, "ids`: draw 0 blends, but values of format R32u cannot be combined");
    let depth = refusal(|gpu, size| (to(&[named("depth", Format::D32)(gpu, size)]), vec![]), flat());
    starts(depth, "depth`: its format D32 is not one of those for colours");
    let colour = refusal(
        |gpu, size| {
            let depth = Some(Attachment::cleared(albedo(gpu, size), Clear::default()));
            (Attachments { colours: vec![], depth }, vec![])
        },
        flat(),
    );
    starts(colour, "albedo`: its format Rgba8 is not one of D32 and D24S8");
    let twice = refusal(
        |gpu, size| {
            let id = albedo(gpu, size);
            (to(&[id, id]), vec![])
        },
        flat(),
    );
    starts(twice, "albedo`: it is a target of the pass twice");
    let many = refusal(
        |gpu, size| {
            let ids = [0; 5].map(|_| albedo(gpu, size));
            (to(&ids), vec![])
        },
        flat(),
    );
    starts(many, "albedo`: it is one colour target too many; a pass has up to 4");
    let stencil = refusal(
        |gpu, size| {
            let depth = Some(Attachment::cleared(named("depth", Format::D32)(gpu, size), Clear::default()));
            (Attachments { colours: vec![], depth }, vec![])
        },
        DrawState { stencil: Some(Stencil::default()), ..DrawState::default() },
    );
    starts(stencil, "depth`: draw 0 has a stencil test, but format D32 has no stencil values");
    let none = refusal(|gpu, size| (to(&[albedo(gpu, size)]), vec![]), DrawState::default());
    assert!(
        none.starts_with("pass `light`: draw 0 has a depth or stencil test, but the pass has no depths"),
        "{none}"
    );
    let dropped = refusal(
        |gpu, size| {
            let other = with(|stage, settings| {
                let mut gpu = Gpu::without_packets(settings.spec).unwrap();
                (0..9).map(|_| albedo(&mut gpu, stage.viewport)).last().unwrap()
            });
            (to(&[albedo(gpu, size)]), vec![other])
        },
        flat(),
    );
    starts(dropped, "number 8`: the frame has no such surface");
    let large = Viewport::new(16_384, 16_384).unwrap();
    let memory = refusal(
        |gpu, size| {
            (0..129).for_each(|_| {
                gpu.create_surface(&SurfaceSpec::new("huge", large, Format::Rg32f).sampled(256));
            });
            (to(&[albedo(gpu, size)]), vec![])
        },
        flat(),
    );
    assert!(memory.starts_with("pass `light`: the memory of the frame takes "), "{memory}");
}

/// The error names the surface, the first draw that reads it, also as a buffer, and the first that writes it.
#[test]
fn feedback_names_both_draws() {
    let masked = DrawState { colour_mask: [false; 4], ..flat() };
    let message = |states: [DrawState; 3], is_depth: bool, is_viewed: bool| {
        with(|stage, settings| {
            let mut gpu = Gpu::without_packets(settings.spec).unwrap();
            let [colour, depth] = [("albedo", Format::Rgba8), ("depth", Format::D32)]
                .map(|(name, format)| gpu.create_surface(&SurfaceSpec::new(name, stage.viewport, format)));
            let mut targets = to(&[colour]);
            targets.depth = Some(Attachment::cleared(depth, Clear::default()));
            let (corners, read) = (screen(1.0), if is_depth { depth } else { colour });
            let mut bindings = [Binding::Surface(read)];
            if is_viewed {
                let before = still(&corners, &RED);
                let pass = RasterPass::new(&stage.camera, slice::from_ref(&before), settings);
                gpu.draw(&pass.onto(Target::Surfaces(&targets))).unwrap();
                bindings = [Binding::Buffer(gpu.surface_view(read).unwrap().reads())];
            }
            let draws = [0, 1, 2].map(|number| {
                let draw = still(&corners, &RED).with_state(states[number]);
                if number == 0 { draw } else { draw.binding(&bindings) }
            });
            let pass = RasterPass::new(&stage.camera, &draws, settings).named("light");
            gpu.draw(&pass.onto(Target::Surfaces(&targets))).unwrap_err().to_string()
        })
    };
    let start = |surface, reader, writer| {
        format!(
            "pass `light`, surface `{surface}`: it is read and written in the same pass: {reader} reads it, and {writer} writes it;"
        )
    };
    let cases = [
        ([flat(); 3], false, start("albedo", "draw 1", "draw 0")),
        ([masked, masked, flat()], false, start("albedo", "draw 1", "draw 2")),
        ([masked; 3], false, start("albedo", "draw 1", "the pass as a whole")),
        ([flat(), DrawState::default(), flat()], true, start("depth", "draw 1", "draw 1")),
    ];
    for (states, is_depth, start) in cases {
        for is_viewed in [false, true] {
            let message = message(states, is_depth, is_viewed);
            assert!(message.starts_with(&start), "{is_viewed}: {message}");
        }
    }
}

/// What a pass drops cannot be read, and costs no memory traffic.
#[test]
fn dropped_contents_are_gone() {
    with(|stage, settings| {
        let mut gpu = Gpu::without_packets(settings.spec).unwrap();
        let id = gpu.create_surface(&SurfaceSpec::new("s", stage.viewport, Format::Rgba8));
        let corners = screen(1.0);
        let draws = [still(&corners, &RED).with_state(flat())];
        let stored = to(&[id]);
        let dropped = Attachments { colours: vec![Attachment::loaded(id).dropped()], depth: None };
        let pass = RasterPass::new(&stage.camera, &draws, settings);
        gpu.draw(&pass.onto(Target::Surfaces(&stored))).unwrap();
        assert_eq!(gpu.contents(id).unwrap(), vec![Vec4::new(1.0, 0.0, 0.0, 1.0); 256]);
        gpu.draw(&pass.onto(Target::Surfaces(&dropped))).unwrap();
        assert_eq!(gpu.contents(id), None);
        assert_eq!(gpu.finish().counts()[Event::DramWriteBytes], 0);
    });
}

/// Passes are drawn in the order in which they are requested, and read what earlier ones stored, so no cycle
/// of them can be requested: one that reads what a later pass is to write is refused, or reads what was there
/// before.
#[test]
fn a_pass_reads_what_earlier_passes_stored_and_never_what_later_ones_will() {
    with(|stage, settings| {
        let mut gpu = Gpu::without_packets(settings.spec).unwrap();
        let [one, two] = ["one", "two"]
            .map(|name| gpu.create_surface(&SurfaceSpec::new(name, stage.viewport, Format::R32f)));
        let corners = screen(1.0);
        let add = Neighbour(Vec4::splat(1.0));
        let draw = |gpu: &mut Gpu<'_>, name: &str, [from, into]: [SurfaceId; 2]| {
            let (bindings, targets) = ([Binding::Surface(from)], to(&[into]));
            let geometry = Geometry::new(&corners, &corners, &QUAD).unwrap();
            let draws = [Draw::new(geometry, &add, Cull::None).with_state(flat()).binding(&bindings)];
            let pass = RasterPass::new(&stage.camera, &draws, settings).named(name);
            gpu.draw(&pass.onto(Target::Surfaces(&targets)).without_image()).map(|_| ())
        };
        let error = draw(&mut gpu, "there", [two, one]).unwrap_err().to_string();
        assert!(error.starts_with("pass `there`, surface `two`: it is read, but no earlier pass"), "{error}");
        let error = draw(&mut gpu, "both", [one, one]).unwrap_err().to_string();
        assert!(
            error.starts_with("pass `both`, surface `one`: it is read and written in the same pass"),
            "{error}"
        );

        // With something in it, each pass adds one to what the last one left.
        let draws = [still(&corners, &RED).with_state(flat())];
        let (clear, start) = (to(&[two]), RasterPass::new(&stage.camera, &draws, settings));
        gpu.draw(&start.onto(Target::Surfaces(&clear))).unwrap();
        for (number, [from, into]) in (2_u8..).zip([[two, one], [one, two], [two, one]]) {
            draw(&mut gpu, "step", [from, into]).unwrap();
            assert_eq!(gpu.contents(into).unwrap()[0].x, f32::from(number));
        }
    });
}
