//! State of draws: with any states, clip planes, discarding shaders, culling and batches, image and samples
//! are those of storing every sample of every triangle in order.

use std::ops::Range;

use activity::Event;
use glam::{Vec3, Vec4};
use pipeline::depth::{DepthBound, DepthSpec};
use pipeline::sampling::Sample;
use pipeline::*;
use proptest::prelude::*;

use crate::common::stage::*;
use crate::common::*;

/// What a shader discards.
#[derive(Clone, Copy, PartialEq)]
enum Discards {
    Nothing,
    /// Every other triangle of a draw.
    Triangles,
    /// A chequerboard of samples, in passes that shade each at its own position; triangles in others.
    Samples,
}

/// One colour for all points that are not discarded.
struct Tint {
    colour: Vec4,
    discards: Discards,
    per_sample: bool,
}

impl Tint {
    /// Below 1 for points that are discarded.
    fn kept(&self, triangle: u32, [x, y]: [i32; 2], sample: u32) -> f32 {
        match self.discards {
            Discards::Nothing => 1.0,
            Discards::Samples if self.per_sample => ((x + y + sample as i32) % 2) as f32,
            _ => (triangle % 2) as f32,
        }
    }
}

impl Shader for Tint {
    fn shade(&self, lane: &Lane, at: &ShadingPoint, _: Vec4) -> Vec4 {
        lane.discard_below(self.kept(at.triangle, at.pixel, at.sample), 1.0);
        self.colour
    }

    fn may_discard(&self) -> bool {
        self.discards != Discards::Nothing
    }
}

/// Triangles of a soup with a state, clip planes and a colour.
struct Part {
    triangles: Range<usize>,
    state: DrawState,
    planes: Planes,
    tint: Tint,
}

/// A range of an axis from `low` to `high`, or all of it.
fn range(r: &mut Uniform, [low, high]: [f32; 2]) -> [f32; 2] {
    let (a, b) = (r.within(low, high), r.within(low, high));
    match (r.next() * 8.0) as u32 {
        0 => [a.min(b), a.max(b)],
        1 => [a, f32::INFINITY],
        2 => [f32::NEG_INFINITY, a],
        _ => ALL,
    }
}

/// Clip planes across u, v and t, and across the image.
struct Planes {
    uvt: [[f32; 2]; 3],
    image: [[f32; 2]; 2],
}

impl Planes {
    /// None, or mostly few.
    fn new(r: &mut Uniform, chance: f32) -> Self {
        let is_there = r.next() < chance;
        let mut range = |whole| if is_there { range(r, whole) } else { ALL };
        let (lens, unit) = ([-1.0, 1.0], [0.0, 1.0]);
        Self { uvt: [range(lens), range(lens), range(unit)], image: [range(unit), range(unit)] }
    }

    fn clip(&self) -> Clip {
        let ([u, v, t], [x, y]) = (self.uvt, self.image);
        Clip::new(u, v, t).unwrap().across_image(x, y).unwrap()
    }

    /// Whether a sample of a pixel is between them.
    fn have_inside(&self, pixel: [u32; 2], sample: &Sample) -> bool {
        let within = |[low, high]: [f32; 2], at: f32| low <= at && at < high;
        let sides = [viewport().width(), viewport().height()].map(|side| side as f32);
        let in_image = |(axis, at): (usize, f32)| {
            let edge = |share: f32| ((f64::from(share) - 0.5) * f64::from(sides[axis])) as f32;
            within(self.image[axis].map(edge), (pixel[axis] as f32 - 0.5 * sides[axis]) + at)
        };
        let uvt = [sample.u, sample.v, sample.t];
        [sample.x, sample.y].into_iter().enumerate().all(in_image)
            && self.uvt.iter().zip(uvt).all(|(range, at)| within(*range, at))
    }
}

const ALL: [f32; 2] = [f32::NEG_INFINITY, f32::INFINITY];

struct Scene {
    soup: Soup,
    optics: Optics,
    table: SampleTable,
    parts: Vec<Part>,
    clear: Clear,
    /// Planes of the whole pass.
    planes: Planes,
    per_sample: bool,
}

const BACKGROUND: Vec3 = Vec3::new(0.125, 0.5, 0.25);

fn viewport() -> Viewport {
    Viewport::new(40, 26).unwrap()
}

pub(crate) fn pick<T: Copy>(r: &mut Uniform, choices: &[T]) -> T {
    choices[(r.next() * choices.len() as f32) as usize]
}

pub(crate) fn byte(r: &mut Uniform) -> u8 {
    (r.next() * 256.0) as u8
}

/// An operation that is mostly [`StencilOp::Keep`], so that failing samples may be culled.
fn rarely(r: &mut Uniform) -> StencilOp {
    if r.next() < 0.3 { pick(r, &StencilOp::ALL) } else { StencilOp::Keep }
}

fn stencil_face(r: &mut Uniform) -> StencilFace {
    StencilFace {
        test: pick(r, &Compare::ALL),
        // Few values, so that tests for equality hold now and then.
        reference: pick(r, &[0, 1, 2, 255]),
        read_mask: pick(r, &[255, 255, 3]),
        write_mask: pick(r, &[255, 255, 15]),
        fail: rarely(r),
        depth_fail: rarely(r),
        pass: pick(r, &StencilOp::ALL),
    }
}

pub(crate) fn state(r: &mut Uniform) -> DrawState {
    let mask = std::array::from_fn(|_| r.next() < 0.5);
    DrawState {
        cull: pick(r, &[Cull::None, Cull::None, Cull::Back, Cull::Front]),
        depth: DepthState { test: pick(r, &Compare::ALL), write: r.next() < 0.7 },
        stencil: (r.next() < 0.4).then(|| Stencil { front: stencil_face(r), back: stencil_face(r) }),
        blend: pick(r, &Blend::ALL),
        colour_mask: pick(r, &[[true; 4], [true; 4], [false; 4], mask]),
        others: [None; 3],
        centroid: r.next() < 0.2,
    }
}

impl Scene {
    fn new(kind: SoupKind, optics: Optics, per_sample: bool, count: usize, seed: u64) -> Self {
        let mut r = Uniform::new(seed ^ 7);
        let mut parts = Vec::new();
        let mut first = 0;
        while first < count {
            let triangles = first..count.min(first + 1 + byte(&mut r) as usize % 9);
            first = triangles.end;
            let colour = Vec4::new(r.next(), r.next(), r.next(), r.next());
            let discards = [Discards::Nothing, Discards::Nothing, Discards::Triangles, Discards::Samples];
            let tint = Tint { colour, discards: pick(&mut r, &discards), per_sample };
            parts.push(Part { triangles, state: state(&mut r), planes: Planes::new(&mut r, 0.5), tint });
        }
        let clear =
            Clear { depth: pick(&mut r, &[f32::INFINITY, 6.0, 0.0]), stencil: pick(&mut r, &[0, 1, 255]) };
        let table = SampleTable::low_discrepancy(4, seed, LensShape::Disk).unwrap();
        let planes = Planes::new(&mut r, 0.3);
        Self { soup: Soup::new(kind, count as u32, seed), optics, table, parts, clear, planes, per_sample }
    }

    fn render(&self, spec: &PipelineSpec) -> Rendered {
        let settings = Settings { spec, viewport: viewport(), samples: &self.table, background: BACKGROUND };
        let draws: Vec<Draw<'_>> = self.parts.iter().map(|part| self.draw(part)).collect();
        let camera = camera(self.optics).with_clip(self.planes.clip());
        let pass = RasterPass { clear: self.clear, ..RasterPass::new(&camera, &draws, &settings) };
        let pass = if self.per_sample { pass.shaded_per_sample() } else { pass };
        pass.with_visible().render(|_, _| ()).unwrap()
    }

    fn draw<'a>(&'a self, part: &'a Part) -> Draw<'a> {
        let Soup { open, close, triangles } = &self.soup;
        let geometry = Geometry::new(open, close, &triangles[part.triangles.clone()]).unwrap();
        Draw::new(geometry.with_clip(part.planes.clip()), &part.tint, Cull::None).with_state(part.state)
    }

    /// Triangle and depth of every sample, and the image.
    fn reference(&self) -> (Vec<(u32, u32)>, Vec<Vec3>) {
        let per_pixel = self.table.per_pixel();
        let mut seen = vec![(u32::MAX, 0); viewport().pixels() * per_pixel as usize];
        let mut image = vec![Vec3::ZERO; viewport().pixels()];
        let places = sample_positions(&self.table, viewport());
        every_tile(&self.soup, self.optics, viewport(), &self.table, |tile| {
            let mut stored = vec![Stored::cleared(self.clear); tile.samples.len];
            let place = |slot| tile.samples.in_image(slot, tile.origin, 8, viewport(), per_pixel);
            for part in &self.parts {
                let is_kept = |id: usize, slot: usize| {
                    let (pixel, sample) = &places[place(slot)];
                    let (number, index) = (id - part.triangles.start, place(slot) as u32 % per_pixel);
                    [&self.planes, &part.planes].iter().all(|planes| planes.have_inside(*pixel, sample))
                        && part.tint.kept(number as u32, pixel.map(|at| at as i32), index) >= 1.0
                };
                part.triangles
                    .clone()
                    .for_each(|id| part.store(tile, id, &mut stored, |slot| is_kept(id, slot)));
            }
            for (slot, sample) in stored.iter().enumerate() {
                let index = place(slot);
                seen[index] = (sample.triangle, sample.depth.to_bits());
                image[index / per_pixel as usize] += sample.colour.truncate();
            }
        });
        (seen, image.into_iter().map(|sum| sum / per_pixel as f32).collect())
    }
}

/// Stored values of a sample.
#[derive(Clone, Copy)]
struct Stored {
    depth: f32,
    stencil: u8,
    colour: Vec4,
    triangle: u32,
}

impl Stored {
    fn cleared(Clear { depth, stencil }: Clear) -> Self {
        Self { depth, stencil, colour: BACKGROUND.extend(1.0), triangle: u32::MAX }
    }
}

impl Part {
    /// Stores the samples of a tile that are inside triangle `id` and are kept, front faces and back faces by
    /// themselves.
    fn store(
        &self,
        tile: &TileOfSoup<'_>,
        id: usize,
        stored: &mut [Stored],
        is_kept: impl Fn(usize) -> bool,
    ) {
        for culled in [Cull::Back, Cull::Front]
            .into_iter()
            .filter(|&culled| self.state.cull == Cull::None || self.state.cull == culled)
        {
            let (mut depth, mut owner) = (vec![f32::INFINITY; stored.len()], vec![u32::MAX; stored.len()]);
            let hits = tile.test(id, culled, &mut depth, &mut owner).into_iter().map(usize::from);
            for slot in hits.filter(|slot| is_kept(*slot)) {
                self.sample(&mut stored[slot], depth[slot], culled == Cull::Back, id as u32);
            }
        }
    }

    fn sample(&self, at: &mut Stored, depth: f32, front: bool, id: u32) {
        let DrawState { depth: rule, stencil, blend, colour_mask, .. } = self.state;
        let nearer = passes(rule.test, depth, at.depth);
        let mut inside = true;
        if let Some(both) = stencil {
            let face = if front { both.front } else { both.back };
            inside = passes(face.test, face.reference & face.read_mask, at.stencil & face.read_mask);
            let op = if !inside {
                face.fail
            } else if nearer {
                face.pass
            } else {
                face.depth_fail
            };
            at.stencil ^= (at.stencil ^ changed(op, at.stencil, face.reference)) & face.write_mask;
        }
        if !(inside && nearer) {
            return;
        }
        if rule.write {
            at.depth = depth;
        }
        if rule.write || colour_mask != [false; 4] {
            at.triangle = id;
        }
        let mixed = mixed(blend, self.tint.colour, at.colour);
        (0..4)
            .filter(|&channel| colour_mask[channel])
            .for_each(|channel| at.colour[channel] = mixed[channel]);
    }
}

pub(crate) fn passes<T: PartialOrd>(test: Compare, new: T, stored: T) -> bool {
    let order = new.partial_cmp(&stored).unwrap();
    match test {
        Compare::Never => false,
        Compare::Less => order.is_lt(),
        Compare::Equal => order.is_eq(),
        Compare::LessEqual => order.is_le(),
        Compare::Greater => order.is_gt(),
        Compare::NotEqual => order.is_ne(),
        Compare::GreaterEqual => order.is_ge(),
        Compare::Always => true,
    }
}

pub(crate) fn changed(op: StencilOp, stored: u8, reference: u8) -> u8 {
    let by = |step: i32| i32::from(stored) + step;
    let value = match op {
        StencilOp::Keep => by(0),
        StencilOp::Zero => 0,
        StencilOp::Replace => i32::from(reference),
        StencilOp::Increment => by(1).min(255),
        StencilOp::Decrement => by(-1).max(0),
        StencilOp::IncrementWrap => by(1).rem_euclid(256),
        StencilOp::DecrementWrap => by(-1).rem_euclid(256),
        StencilOp::Invert => 255 - by(0),
    };
    value as u8
}

pub(crate) fn mixed(blend: Blend, new: Vec4, stored: Vec4) -> Vec4 {
    let channel = |k: usize| match blend {
        Blend::Replace => new[k],
        Blend::Over => new[k] * if k < 3 { new.w } else { 1.0 } + stored[k] * (1.0 - new.w),
        Blend::Add => new[k] + stored[k],
        Blend::Multiply => new[k] * stored[k],
        Blend::Min => new[k].min(stored[k]),
        Blend::Max => new[k].max(stored[k]),
    };
    Vec4::from_array(std::array::from_fn(channel))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn every_state_gives_the_image_of_storing_samples_in_order(
        kind in kinds(), lens: bool, parallel: bool, switches in 0..SWITCHES, auto: bool, waits: bool, z_min: bool, bound in 0..4_usize,
        boxes in prop::sample::select(&[[1, 1, 1], [1, 1, 4], [2, 2, 2]][..]), batch_triangles in 1..40_u32,
        sizes in 0..3_usize, count in 1..60_usize, per_sample: bool, seed: u64,
    ) {
        let (tile_px, coarse_tile_px) = [(8, 32), (4, 16), (2, 64)][sizes];
        let depth = DepthSpec { bound: DepthBound::ALL[bound], boxes, z_min };
        let spec = PipelineSpec {
            tile_px, coarse_tile_px, batch_triangles, depth, ..spec(Features { auto, hidden_surface_removal: waits, ..switched(switches) })
        };
        let scene = Scene::new(kind, Optics { lens, parallel }, per_sample, count, seed);
        let (ours, (seen, image)) = (scene.render(&spec), scene.reference());
        prop_assert!(ours.visible == seen, "samples differ");
        prop_assert!(ours.images[0] == image, "images differ");
    }
}

fn settings<'a>(stage: &'a Stage, spec: &'a PipelineSpec) -> Settings<'a> {
    Settings { spec, viewport: stage.viewport, samples: &stage.table, background: BACKGROUND }
}

fn full_spec() -> PipelineSpec {
    spec(Features::ALL)
}

/// Discards the cells of a chequerboard.
struct Chequered;

impl Shader for Chequered {
    fn shade(&self, lane: &Lane, at: &ShadingPoint, _: Vec4) -> Vec4 {
        let [x, y] = [at.position.x / at.position.z, at.position.y / at.position.z].map(|c| c.floor() as i32);
        lane.discard_below((x + y).rem_euclid(2) as f32, 1.0);
        Vec4::ONE
    }

    fn may_discard(&self) -> bool {
        true
    }
}

/// What a shader discards shows what is behind it, and hides nothing drawn later.
#[test]
fn discarded_cells_store_nothing() {
    let stage = Stage::sampled(16, 16, 4);
    let [near, middle, far] = [1.0, 2.0, 3.0].map(|z| rectangle([-9.0, 9.0], [-9.0, 9.0], z));
    let grille = Draw::new(Geometry::new(&near, &near, &QUAD).unwrap(), &Chequered, Cull::None);
    let (spec, behind) = (full_spec(), still(&far, &RED));
    let settings = settings(&stage, &spec);
    for draws in [[grille, behind], [behind, grille]] {
        let drawn = RasterPass::new(&stage.camera, &draws, &settings).render(|_, _| ()).unwrap();
        for (i, &pixel) in (0..).zip(&drawn.images[0]) {
            let discarded = (i % 16 + i / 16) % 2 == 1;
            assert_eq!(pixel, if discarded { RED.0 } else { Vec3::ONE }, "pixel {i}");
        }
        // Half of the grille's samples are stored, all of them are shaded.
        assert_eq!(drawn.counts[Event::SamplesHit], 2 * 256 * 4);
        let stored = drawn.counts[Event::DepthWrites];
        assert_eq!(stored, 128 * 4 + if draws[0].shader.may_discard() { 128 * 4 } else { 256 * 4 });
    }
    // In a depth pass the shader runs for its opacity alone. Both triangles shade the quads of the diagonal.
    let draws = [grille, still(&middle, &BLUE)];
    let depths = RasterPass::new(&stage.camera, &draws, &settings).onto(Target::Depth).with_visible();
    let drawn = depths.render(|_, _| ()).unwrap();
    assert_eq!(drawn.visible.iter().filter(|(triangle, _)| *triangle < 2).count(), 128 * 4);
    assert_eq!((drawn.counts[Event::ColourWrites], drawn.counts[Event::PixelInvocations]), (0, 4 * (64 + 8)));
}

/// A first pass over depth alone leaves one sample of each pixel to shade (early z).
#[test]
fn after_depths_alone_only_visible_samples_are_shaded() {
    let stage = Stage::sampled(32, 32, 4);
    let layers: Vec<_> = (1..6).rev().map(|z| rectangle([-16.0, 16.0], [-16.0, 16.0], z as f32)).collect();
    let draws = |state: DrawState| layers.iter().map(move |layer| still(layer, &RED).with_state(state));
    let depth_only = DrawState { colour_mask: [false; 4], ..DrawState::default() };
    let depth = DepthState { test: Compare::Equal, write: false };
    let shaded = DrawState { depth, ..DrawState::default() };
    let (spec, both) = (full_spec(), draws(depth_only).chain(draws(shaded)).collect::<Vec<_>>());
    let settings = settings(&stage, &spec);
    let counts = |draws: &[Draw<'_>]| {
        RasterPass::new(&stage.camera, draws, &settings).render(|_, _| ()).unwrap().counts
    };
    let (plain, early) = (counts(&draws(DrawState::default()).collect::<Vec<_>>()), counts(&both));
    let samples = 32 * 32 * 4;
    assert_eq!([plain[Event::ColourWrites], early[Event::ColourWrites]], [5 * samples, samples]);
    // Both triangles of a layer shade the quads of the diagonal.
    let lanes = 4 * (16 * 16 + 16);
    assert_eq!([plain[Event::PixelInvocations], early[Event::PixelInvocations]], [5 * lanes, lanes]);
    assert_eq!(early[Event::DepthWrites], 5 * samples);
    // The second time all layers but the nearest are behind the stored depths, and Hi-Z culls their tiles.
    assert_eq!(early[Event::SamplesHit], 6 * samples);
}

/// A shadow volume counted where depth fails (Everitt and Kilgard 2002): inside are points behind one more
/// back face than front faces. Tiles in which all of it is hidden must not be culled.
#[test]
fn a_stencil_volume_counts_hidden_faces() {
    let stage = Stage::sampled(32, 32, 4);
    let wall = |x: [f32; 2], z: f32| rectangle(x, [-16.0, 16.0], z);
    // The left half of the floor is inside the box, the right half is in front of it.
    let (left, right) = (wall([-16.0, 0.0], 4.0), wall([0.0, 16.0], 2.0));
    let (front, back) = (wall([-20.0, 20.0], 3.0), wall([-20.0, 20.0], 5.0));
    let mut away = back;
    away.swap(1, 3);
    let op = |depth_fail| StencilFace { depth_fail, ..StencilFace::default() };
    let volume = DrawState {
        depth: DepthState { test: Compare::Less, write: false },
        stencil: Some(Stencil { front: op(StencilOp::DecrementWrap), back: op(StencilOp::IncrementWrap) }),
        colour_mask: [false; 4],
        ..DrawState::default()
    };
    let lit = StencilFace { test: Compare::Equal, ..StencilFace::default() };
    let second = DrawState {
        depth: DepthState { test: Compare::Equal, write: false },
        stencil: Some(Stencil { front: lit, back: lit }),
        blend: Blend::Add,
        ..DrawState::default()
    };
    let floor = [still(&left, &RED), still(&right, &RED)];
    let draws = [
        floor[0],
        floor[1],
        still(&front, &BLUE).with_state(volume),
        still(&away, &BLUE).with_state(volume),
        still(&left, &BLUE).with_state(second),
        still(&right, &BLUE).with_state(second),
    ];
    let spec = full_spec();
    let settings = settings(&stage, &spec);
    let drawn = RasterPass::new(&stage.camera, &draws, &settings).render(|_, _| ()).unwrap();
    for (i, &pixel) in (0..).zip(&drawn.images[0]) {
        assert_eq!(pixel, if i % 32 < 16 { RED.0 } else { RED.0 + BLUE.0 }, "pixel {i}");
    }
    assert_eq!(drawn.counts[Event::SamplesBlended], 32 * 16 * 4);
}

/// A stencil counter of eight bits forgets the 256th layer if it wraps, and keeps 255 if it saturates.
#[test]
fn stencils_overflow_as_their_operation_says() {
    let stage = Stage::sampled(8, 8, 1);
    let card = rectangle([-4.0, 4.0], [-4.0, 4.0], 2.0);
    for (op, count, value) in [
        (StencilOp::Increment, 255, 255),
        (StencilOp::Increment, 256, 255),
        (StencilOp::IncrementWrap, 255, 255),
        (StencilOp::IncrementWrap, 256, 0),
    ] {
        let always = DepthState { test: Compare::Always, write: false };
        let face = StencilFace { pass: op, ..StencilFace::default() };
        let counting = DrawState {
            depth: always,
            stencil: Some(Stencil { front: face, back: face }),
            colour_mask: [false; 4],
            ..DrawState::default()
        };
        let is = StencilFace { test: Compare::Equal, reference: value, ..StencilFace::default() };
        let shown = DrawState {
            depth: always,
            stencil: Some(Stencil { front: is, back: is }),
            ..DrawState::default()
        };
        let mut draws = vec![still(&card, &BLUE).with_state(counting); count];
        draws.push(still(&card, &RED).with_state(shown));
        let spec = full_spec();
        let settings = settings(&stage, &spec);
        let image = RasterPass::new(&stage.camera, &draws, &settings).render(|_, _| ()).unwrap().into_image();
        assert!(image.iter().all(|&pixel| pixel == RED.0), "{op:?} {count}");
    }
}

/// With depths reversed, far tiles are culled as well, and without a test nothing is read.
#[test]
fn hi_z_serves_other_depth_tests() {
    let stage = Stage::sampled(32, 32, 4);
    let cards = [1.0, 2.0, 3.0].map(|z| rectangle([-16.0, 16.0], [-16.0, 16.0], z));
    let spec = full_spec();
    let settings = settings(&stage, &spec);
    let counts = |test, order: [usize; 3]| {
        let depth = DepthState { test, write: true };
        let state = DrawState { depth, ..DrawState::default() };
        let draws = order.map(|index| still(&cards[index], &RED).with_state(state));
        let is_reversed = matches!(test, Compare::Greater | Compare::GreaterEqual);
        let clear = Clear { depth: if is_reversed { 0.0 } else { f32::INFINITY }, stencil: 0 };
        let pass = RasterPass { clear, ..RasterPass::new(&stage.camera, &draws, &settings) };
        pass.render(|_, _| ()).unwrap().counts
    };
    let hits = |test, order| counts(test, order)[Event::SamplesHit];
    let samples = 32 * 32 * 4;
    for (test, reversed) in [(Compare::Less, Compare::Greater), (Compare::LessEqual, Compare::GreaterEqual)] {
        assert_eq!([hits(test, [0, 1, 2]), hits(reversed, [2, 1, 0])], [samples; 2], "{test:?}");
        assert_eq!([hits(test, [2, 1, 0]), hits(reversed, [0, 1, 2])], [3 * samples; 2], "{test:?}");
    }
    let all = counts(Compare::Always, [0, 1, 2]);
    assert_eq!([all[Event::DepthReads], all[Event::ZCullTests]], [0; 2]);
    assert_eq!(all[Event::DepthWrites], 3 * samples);
}

/// Hidden-surface removal shades what is visible and nothing else; the image is the same.
#[test]
fn hidden_surfaces_are_not_shaded_if_shading_waits() {
    let stage = Stage::sampled(32, 32, 4);
    let layers: Vec<_> = (1..6).rev().map(|z| rectangle([-16.0, 16.0], [-16.0, 16.0], z as f32)).collect();
    let render = |waits, state: DrawState, batch_triangles| {
        let features = Features { hidden_surface_removal: waits, ..Features::ALL };
        let spec = PipelineSpec { batch_triangles, ..spec(features) };
        let draws: Vec<_> = layers.iter().map(|layer| still(layer, &RED).with_state(state)).collect();
        RasterPass::new(&stage.camera, &draws, &settings(&stage, &spec)).render(|_, _| ()).unwrap()
    };
    let shaded = |drawn: &Rendered| {
        [Event::ColourWrites, Event::PixelInvocations, Event::SamplesTested].map(|event| drawn.counts[event])
    };
    for batch in [1, 100] {
        let [now, last] = [false, true].map(|waits| render(waits, DrawState::default(), batch));
        assert_eq!(now.images, last.images);
        let ([colours, lanes, tested], [colours_now, lanes_now, tested_now]) = (shaded(&last), shaded(&now));
        assert_eq!((5 * colours, 5 * lanes, tested), (colours_now, lanes_now, tested_now));
        // Draws that all blend leave nothing to remove.
        let blend = DrawState { blend: Blend::Add, ..DrawState::default() };
        let [now, last] = [false, true].map(|waits| render(waits, blend, batch));
        assert_eq!((now.images, now.counts), (last.images, last.counts));
    }
}

/// A draw that blends ends the removal of hidden surfaces before it, in its bin alone, and those after it are
/// removed again. A draw that shades nothing ends nothing.
#[test]
fn hidden_surfaces_are_removed_before_and_after_blending() {
    // Three bins, the middle one without cards.
    let stage = Stage::sampled(96, 32, 4);
    let card = |x, z| rectangle(x, [-16.0, 16.0], z);
    let (left, right) = ([-48.0, -16.0], [16.0, 48.0]);
    let layers = [9.0, 8.0, 7.0, 6.0, 5.0, 3.0, 2.0].map(|z| [card(left, z), card(right, z)]);
    let (glass, between) = (card(left, 4.0), card(left, 2.5));
    let blends = DrawState { blend: Blend::Add, ..DrawState::default() };
    let depths = DrawState { colour_mask: [false; 4], ..DrawState::default() };
    let opaque = |layers: Range<usize>| layers.flat_map(|at| [0, 1].map(|side| (at, side)));
    let layer = |(at, side): (usize, usize)| still(&layers[at][side], &RED);
    let draws: Vec<_> = opaque(0..5)
        .map(layer)
        .chain([still(&glass, &BLUE).with_state(blends)])
        .chain(opaque(5..6).map(layer))
        .chain([still(&between, &BLUE).with_state(depths)])
        .chain(opaque(6..7).map(layer))
        .collect();
    let shaded = |hidden_surface_removal, batch_triangles| {
        let spec =
            PipelineSpec { batch_triangles, ..spec(Features { hidden_surface_removal, ..Features::ALL }) };
        let drawn =
            RasterPass::new(&stage.camera, &draws, &settings(&stage, &spec)).render(|_, _| ()).unwrap();
        let events = [Event::ColourWrites, Event::SamplesBlended, Event::PixelInvocations];
        (drawn.images, events.map(|event| drawn.counts[event]))
    };
    // Of a card that fills a bin. Both triangles shade the quads of the diagonal.
    let (samples, lanes) = (32 * 32 * 4, 4 * (16 * 16 + 16));
    for batch in [1, 100] {
        let [(image, now), (same, last)] = [false, true].map(|waits| shaded(waits, batch));
        assert_eq!(image, same);
        // On the left the visible card, the glass and the visible card; on the right one card.
        assert_eq!(last, [4 * samples, samples, 4 * lanes]);
        assert_eq!(now, [15 * samples, samples, 15 * lanes]);
    }
}
