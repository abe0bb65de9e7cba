//! Fragments: covered samples of passes whose result depends on the order of triangles. Each is tested,
//! shaded and stored before the next triangle; other passes store the nearest triangle and shade what is
//! visible in the end.

use glam::Vec4;

use super::cells::{Grid, own_pixel};
use super::pass::Pass;
use super::resolve::ByCell;
use super::shaded::{SampleView, ShadedTriangle};
use super::{Settings, Shading};
use crate::depth::DepthTile;
use crate::sample_test::{Covered, Hits};
use crate::sampling::TileSamples;
use crate::setup::Triangle;
use crate::shader::{Lane, Outputs};
use crate::state::DrawState;

/// What became of the covered samples of a triangle in a tile, besides their depths.
#[derive(Default)]
pub(super) struct Fragments {
    /// Slots of samples that were shaded.
    pub shaded: Vec<u16>,
    /// Samples with a new stencil value and the depth of before.
    pub stencils: u32,
    /// Samples with a new colour.
    pub coloured: u32,
    /// Pixels of these.
    pub coloured_pixels: u64,
    /// Samples of a query that pass all tests.
    pub passed: u32,
}

impl Fragments {
    fn clear(&mut self) {
        self.shaded.clear();
        *self = Self { shaded: std::mem::take(&mut self.shaded), ..Self::default() };
    }

    /// The nearest samples in `hits`, which were stored by the sample test, get the colour of their triangle.
    pub fn nearest(&mut self, hits: &mut Hits) {
        self.clear();
        self.shaded.extend_from_slice(&hits.written);
        (self.coloured, self.coloured_pixels) = (hits.written.len() as u32, hits.written_pixels);
        if let Some(pixels) = &mut hits.by_pixel {
            pixels.coloured = pixels.written;
        }
    }

    /// The shaded samples wait for the colour of `triangle` instead.
    pub fn wait(&mut self, triangle: u32, tile: &mut DepthTile, hits: &mut Hits) {
        self.shaded.drain(..).for_each(|slot| tile.waiting[usize::from(slot)] = triangle);
        (self.coloured, self.coloured_pixels) = (0, 0);
        if let Some(pixels) = &mut hits.by_pixel {
            pixels.coloured = [0; 64];
        }
    }
}

/// A triangle and a tile whose covered samples are stored.
pub(super) struct FragmentTests<'a> {
    pass: &'a Pass<'a>,
    writes_colour: bool,
    triangle: &'a Triangle,
    state: &'a DrawState,
    may_discard: bool,
    is_query: bool,
    samples: &'a TileSamples,
    /// First pixel of the tile.
    origin: [u32; 2],
    surface: ShadedTriangle<'a>,
    grid: Grid<'a>,
    /// Outputs of cells shaded so far, without any where the shader discards.
    shaded: ByCell<Option<Outputs>>,
}

impl<'a> FragmentTests<'a> {
    pub fn new(
        pass: &'a Pass<'a>,
        triangle: &'a Triangle,
        samples: &'a TileSamples,
        origin: [u32; 2],
    ) -> Self {
        let number = pass.locate(triangle.id).0;
        let draw = &pass.draws[number];
        Self {
            pass,
            writes_colour: pass.written_by(number as u32).next().is_some(),
            triangle,
            state: &draw.state,
            may_discard: draw.shader.may_discard(),
            is_query: draw.query.is_some(),
            samples,
            origin,
            surface: ShadedTriangle::new(pass, triangle.id),
            grid: Grid::new(pass, (&triangle.corners, triangle.moving), samples, origin),
            shaded: ByCell::default(),
        }
    }

    /// Tests and stores the covered samples in `hits`.
    pub fn store(&mut self, tile: &mut DepthTile, hits: &mut Hits, fragments: &mut Fragments) {
        fragments.clear();
        let Some(mut covered) = hits.covered.take() else { return };
        // A sample at the time where two pieces of the shutter meet is in both.
        covered.sort_unstable_by_key(|sample| sample.slot);
        covered.dedup_by_key(|sample| sample.slot);
        for sample in &covered {
            self.sample(sample, tile, hits, fragments);
        }
        hits.covered = Some(covered);
    }

    fn sample(&mut self, sample: &Covered, tile: &mut DepthTile, hits: &mut Hits, fragments: &mut Fragments) {
        let slot = usize::from(sample.slot);
        let stencil = tile.stencil.get(slot).copied().unwrap_or(0);
        let depth = self.pass.depth.round_depth(sample.depth);
        let depths = [depth, tile.depth[slot]];
        let outcome = self.state.test(sample.counter_clockwise, depths, stencil);
        let writes_depth = outcome.passes && self.state.depth.write;
        let writes_colour = outcome.passes && self.writes_colour;
        let writes_stencil = outcome.stencil != stencil;
        let is_asked = outcome.passes && self.is_query;
        if !(writes_depth || writes_colour || writes_stencil || is_asked) {
            return;
        }
        let mut outputs = Outputs::default();
        if writes_colour || self.may_discard {
            fragments.shaded.push(sample.slot);
            let Some(shaded) = self.shade(slot) else { return };
            outputs = shaded;
        }
        fragments.passed += u32::from(is_asked);
        let pixel = usize::from(self.samples.pixel[slot]);
        if writes_depth {
            tile.depth[slot] = depth;
            hits.written.push(sample.slot);
        }
        if writes_stencil {
            tile.stencil[slot] = outcome.stencil;
            fragments.stencils += u32::from(!writes_depth);
        }
        if writes_colour {
            self.store_colours(slot, &outputs, tile);
            fragments.coloured += 1;
            fragments.coloured_pixels |= 1 << pixel;
        }
        if writes_depth || writes_colour {
            tile.triangle[slot] = self.triangle.id;
        }
        if writes_depth || writes_stencil {
            hits.written_pixels |= 1 << pixel;
        }
        if let Some(pixels) = &mut hits.by_pixel {
            pixels.written[pixel] += u32::from(writes_depth || writes_stencil);
            pixels.coloured[pixel] += u32::from(writes_colour);
        }
    }

    /// Combines the outputs of the shader with what the targets hold.
    fn store_colours(&self, slot: usize, outputs: &Outputs, tile: &mut DepthTile) {
        let targets = self.pass.colours.iter().zip(&mut tile.colours).zip(outputs);
        for (number, ((plane, stored), colour)) in targets.enumerate() {
            let state = self.state.target(number);
            if state.writes() {
                stored[slot] = plane.round(state.colour(*colour, stored[slot]));
            }
        }
    }

    /// Outputs of the shader for the sample in `slot`, or `None` if it discards it.
    fn shade(&mut self, slot: usize) -> Option<Outputs> {
        let Settings { spec, samples: source, .. } = *self.pass.settings;
        let (lane, surface) = (self.surface.lane(), &self.surface);
        let is_single = self.pass.colours.len() < 2;
        let kept = |lane: &Lane, outputs| (!self.may_discard || !lane.is_discarded()).then_some(outputs);
        if self.pass.shading == Shading::PerSample {
            let pixel = own_pixel(self.samples, slot, self.origin, spec.tile_px);
            let at = (pixel, self.samples.in_pixel(slot, source.per_pixel()));
            let view = SampleView::of_slot(&self.triangle.corners, self.samples, slot, at);
            let single = || only(surface.shade_at(&lane, &view));
            return kept(&lane, if is_single { single() } else { surface.outputs_at(&lane, &view) });
        }
        let cell = self.grid.cell(slot);
        let single = || only(surface.shade(&lane, cell));
        let outputs = || if is_single { single() } else { surface.outputs(&lane, cell) };
        *self.shaded.entry(cell).or_insert_with(|| {
            let outputs = outputs();
            kept(&lane, outputs)
        })
    }
}

/// Outputs of a shader of one colour.
fn only(colour: Vec4) -> Outputs {
    let mut outputs = Outputs::default();
    outputs[0] = colour;
    outputs
}
