//! Resolve as a pass: the colour unit reads all samples of a surface and writes one colour for each pixel,
//! tile by tile. Mip chains are made by passes, too: each level is drawn from the one before.

use activity::{Counts, Packet, PacketKind, Waits};
use glam::{IVec2, UVec2, Vec2, Vec3, Vec4};

use super::attachments::{
    Attachment, Attachments, Binding, Load, PassError, PassPart, Store, SurfaceId, SurfaceProblem,
};
use super::bin::tile_pixels;
use super::pass::{Draw, RasterPass, Target};
use super::resolve::{SampleLine, TileResolve, mean_values, tile_lines};
use super::{Gpu, Rendered, Settings};
use crate::geometry::{Camera, Cull, Geometry, Viewport};
use crate::memory::LINE_BYTES;
use crate::sampling::{Sample, SampleSource};
use crate::shader::{Lane, Shader, ShadingPoint};
use crate::state::{DepthState, DrawState};
use crate::surface::{Format, Layout, SurfaceSpec, Texels};

/// A pass that takes the mean of the samples of each pixel of a surface.
#[derive(Clone, Copy, Debug)]
pub struct ResolvePass<'a> {
    /// Name in reports.
    pub name: &'a str,
    /// The samples, which an earlier pass stored. One a pixel is a copy.
    pub from: SurfaceId,
    /// What becomes of the samples.
    pub store: Store,
}

impl<'a> ResolvePass<'a> {
    /// A pass that leaves the samples as they are.
    pub fn new(name: &'a str, from: SurfaceId) -> Self {
        Self { name, from, store: Store::Store }
    }

    /// The pass with samples that are not needed after it: they are not written to memory.
    #[must_use]
    pub fn dropping(self) -> Self {
        Self { store: Store::Discard, ..self }
    }
}

/// Where samples are, and where their pixels go.
struct Places {
    spec: SurfaceSpec<'static>,
    from: Layout,
    to: Layout,
    /// Words of a pixel.
    words: u32,
}

/// Formats whose values have a mean.
const AVERAGED: &str = "those of colours other than integers, which have a mean";

impl Gpu<'_> {
    /// Resolves samples into the pixels of another surface, whose format may differ. The pass waits for those
    /// that read what it overwrites; the samples need no wait, as the colour unit works in order.
    ///
    /// # Errors
    /// [`PassError::Surface`] if nothing is stored in the samples, if the surfaces differ in size or are one,
    /// if the second has several samples, or if values of a format have no mean; [`PassError::Memory`] if the
    /// memory of the frame is too large.
    pub fn resolve(&mut self, pass: &ResolvePass<'_>, to: SurfaceId) -> Result<Counts, PassError> {
        let (texels, from) = self.samples_of(pass)?;
        let refused = |problem| Err(self.surfaces.refused(pass.name, to, problem));
        let Some(state) = self.surfaces.get(to) else { return refused(SurfaceProblem::Unknown) };
        let (target, layout, region) = (state.spec(), state.layout, state.region);
        let size = |[width, height]: [u32; 2]| format!("{width} x {height}");
        let of_target = [target.viewport.width(), target.viewport.height()];
        if to == pass.from {
            return refused(SurfaceProblem::Feedback { reader: PassPart::Whole, writer: PassPart::Whole });
        }
        if !target.format.can_blend() {
            return refused(SurfaceProblem::Format(target.format, AVERAGED));
        }
        if of_target != texels.size() {
            return refused(SurfaceProblem::Size(size(of_target), size(texels.size())));
        }
        if target.samples != 1 {
            return refused(SurfaceProblem::Samples(target.samples, 1));
        }
        let spec = SurfaceSpec { name: "", ..target };
        let mut pixels = Texels::filled(&spec, Vec4::ZERO);
        mean_values(&texels).into_iter().enumerate().for_each(|(at, mean)| pixels.set(at, mean));
        self.open(pass.name, Some(spec.viewport));
        if self.is_read(region) {
            self.barrier(Waits::Tiles);
        }
        self.resolve_tiles(pass, &Places { spec, from, to: layout, words: spec.format.words() });
        self.replace(to, Some(pixels));
        Ok(self.counts_of_pass())
    }

    /// Resolves samples into an image, the result of the pass. The part of a pixel that they leave open, by
    /// their opacity, shows the linear colour `background`.
    ///
    /// # Errors
    /// As [`Self::resolve`].
    pub fn resolve_image(&mut self, pass: &ResolvePass<'_>, background: Vec3) -> Result<Rendered, PassError> {
        let (texels, from) = self.samples_of(pass)?;
        let spec = SurfaceSpec::new("", texels.viewport(), Format::Rgba8Srgb);
        let tile_px = self.spec().tile_px;
        let region = self.allocate(Layout::new(&spec, tile_px, 0).1);
        self.check_frame(pass.name)?;
        let to = Layout::new(&spec, tile_px, region.address()).0;
        let shown = |mean: Vec4| Vec3::splat(1.0 - mean.w) * background + mean.truncate();
        let image = mean_values(&texels).into_iter().map(shown).collect();
        self.open(pass.name, Some(spec.viewport));
        self.resolve_tiles(pass, &Places { spec, from, to, words: spec.format.words() });
        self.keep(region);
        Ok(Rendered {
            images: vec![image],
            visible: Vec::new(),
            counts: self.counts_of_pass(),
            passed: Vec::new(),
            region,
        })
    }

    /// The stored samples of a pass, and where they are.
    fn samples_of(&self, pass: &ResolvePass<'_>) -> Result<(std::sync::Arc<Texels>, Layout), PassError> {
        self.check_frame(pass.name)?;
        let refused = |problem| self.surfaces.refused(pass.name, pass.from, problem);
        let state = self.surfaces.get(pass.from).ok_or_else(|| refused(SurfaceProblem::Unknown))?;
        let format = state.spec().format;
        if !format.can_blend() {
            return Err(refused(SurfaceProblem::Format(format, AVERAGED)));
        }
        let texels = state.texels.as_ref().ok_or_else(|| refused(SurfaceProblem::Unwritten))?;
        Ok((texels.clone(), state.layout))
    }

    /// The packets of a pass, tile by tile in rows.
    fn resolve_tiles(&mut self, pass: &ResolvePass<'_>, places: &Places) {
        let Places { spec, from, to, words } = places;
        let side = from.tile_px;
        let origins = (0..spec.viewport.height())
            .step_by(side as usize)
            .flat_map(|y| (0..spec.viewport.width()).step_by(side as usize).map(move |x| [x, y]));
        for (tile, origin) in (0..).zip(origins) {
            let pixels = tile_pixels(spec.viewport, origin, side);
            let count = pixels.count_ones();
            let samples = count * from.samples * (from.bytes / 4) as u32;
            let mut work = TileResolve { samples, pixels: count * words, ..TileResolve::default() };
            lines(from, tile, pixels, |line| {
                let address = line * LINE_BYTES;
                let dropped = [(pass.store == Store::Discard).then_some(address), None];
                work.reads.push(SampleLine { address, is_fresh: false, dropped });
            });
            lines(to, tile, pixels, |line| work.writes.push(line));
            let mut packet = Packet { tile, ..Packet::new(PacketKind::Resolve, self.last_pass()) };
            work.count(self.memory(), &mut packet.counts);
            self.push(&packet, 0);
        }
        if pass.store == Store::Discard {
            self.replace(pass.from, None);
        }
    }
}

/// Numbers of the lines that hold `pixels` of a tile.
fn lines(of: &Layout, tile: u32, pixels: u64, mut each: impl FnMut(u64)) {
    let pixel_bytes = u64::from(of.samples) * of.bytes;
    let first = of.address + u64::from(tile) * u64::from(of.tile_px * of.tile_px) * pixel_bytes;
    tile_lines([first, pixel_bytes], pixels, |line, _| each(line));
}

/// One sample in the middle of each pixel.
#[derive(Debug)]
struct Middle;

impl SampleSource for Middle {
    fn per_pixel(&self) -> u32 {
        1
    }

    fn pixel_into(&self, _: u32, _: u32, into: &mut [Sample]) {
        into.fill(Sample { x: 0.5, y: 0.5, t: 0.5, ..Sample::default() });
    }
}

/// Mean of 2 x 2 texels of the level before, by one fetch in the middle of them.
struct Halve {
    /// Size of a texel of the level before in texture coordinates.
    texel: Vec2,
}

impl Shader for Halve {
    fn shade(&self, lane: &Lane, at: &ShadingPoint, _: Vec4) -> Vec4 {
        let pixel = IVec2::from(at.pixel).as_vec2();
        lane.fetch(0, lane.madd(pixel, 2.0 * self.texel, self.texel), 0.0)
    }
}

impl Gpu<'_> {
    /// Draws every level of a surface but the finest, each in a pass of its own that reads the level before.
    /// A texel is the mean of 2 x 2; the last column or row of an odd size is left out, as in the chains of
    /// textures. Returns the events of all passes.
    ///
    /// # Errors
    /// [`PassError::Surface`] if nothing is stored in the finest level, or values of its format have no mean.
    pub fn make_levels(&mut self, name: &str, id: SurfaceId) -> Result<Counts, PassError> {
        let (levels, mut counts) = (self.surfaces.levels(id), Counts::default());
        if levels == 0 {
            return Err(self.surfaces.refused(name, id, SurfaceProblem::Unknown));
        }
        for level in 1..levels {
            counts += &self.halve(&format!("{name} level {level}"), id.level(level - 1), id.level(level))?;
        }
        Ok(counts)
    }

    fn halve(&mut self, name: &str, from: SurfaceId, to: SurfaceId) -> Result<Counts, PassError> {
        let spec = |id| self.surfaces.get(id).map(|state| state.spec());
        let refused = |id, problem| Err(self.surfaces.refused(name, id, problem));
        let Some(source) = spec(from) else { return refused(from, SurfaceProblem::Unknown) };
        let Some(target) = spec(to) else { return refused(to, SurfaceProblem::Unknown) };
        if !source.format.can_blend() {
            return refused(from, SurfaceProblem::Format(source.format, AVERAGED));
        }
        let size = |of: Viewport| UVec2::new(of.width(), of.height()).as_vec2();
        let (shader, viewport) = (Halve { texel: size(source.viewport).recip() }, target.viewport);
        let wide = size(viewport).x / size(viewport).y;
        // Larger than the screen, so that no sample is on an edge.
        let corners = [[-1.0, -1.0], [4.0, -1.0], [-1.0, 4.0]]
            .map(|[x, y]: [f32; 2]| Vec3::new(1.1 * wide * x, 1.1 * y, 1.0));
        let bindings = [Binding::Surface(from)];
        let state = DrawState { depth: DepthState::NONE, ..DrawState::new(Cull::None) };
        let draw = Draw::new(Geometry::triangle(&corners), &shader, Cull::None);
        let draws = [draw.with_state(state).binding(&bindings)];
        let colours = vec![Attachment { surface: to, load: Load::Discard, store: Store::Store }];
        let targets = Attachments { colours, depth: None };
        let settings = Settings { spec: self.spec(), viewport, samples: &Middle, background: Vec3::ZERO };
        let camera = Camera::of_screen();
        let pass = RasterPass::new(&camera, &draws, &settings).named(name).without_image();
        Ok(self.draw(&pass.onto(Target::Surfaces(&targets)))?.counts)
    }
}
