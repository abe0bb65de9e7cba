//! Surfaces between passes. Checks of the targets and bindings of a pass, before it is drawn. Resolve as a
//! pass: the colour unit reads all samples of a surface and writes one colour for each pixel, tile by tile.
//! Mip chains are made by passes, too: each level is drawn from the one before.

use activity::{Counts, Packet, PacketKind, Waits};
use glam::{IVec2, UVec2, Vec2, Vec3, Vec4};

use super::attachments::{
    Attachment, Attachments, Binding, Load, PassError, PassPart, Store, SurfaceId, SurfaceProblem, Surfaces,
};
use super::bin::tile_pixels;
use super::pass::{Draw, RasterPass, Target};
use super::resolve::{SampleLine, TileResolve, mean_values, tile_lines};
use super::{Gpu, Rendered, Settings};
use crate::geometry::{Camera, Cull, Geometry, Viewport};
use crate::memory::LINE_BYTES;
use crate::sampling::{Sample, SampleSource};
use crate::shader::{Lane, Shader, ShadingPoint};
use crate::state::{Blend, Compare, DepthState, DrawState};
use crate::surface::{Format, Layout, MAX_TARGETS, SurfaceSpec, Texels};

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
    /// surfaces of the frame are too large.
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
        self.check_memory(pass.name)?;
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
        self.check_memory(pass.name)?;
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

impl Surfaces {
    /// Checks the targets and bindings of a pass.
    pub fn check(&self, pass: &RasterPass<'_>) -> Result<(), PassError> {
        let none = Attachments::default();
        let targets = if let Target::Surfaces(targets) = pass.target { targets } else { &none };
        self.check_targets(pass, targets)?;
        self.check_bindings(pass, targets)?;
        if let Target::Surfaces(targets) = pass.target { self.check_states(pass, targets) } else { Ok(()) }
    }

    /// What a pass reads.
    pub fn read_in<'s>(&'s self, pass: &'s RasterPass<'_>) -> impl Iterator<Item = SurfaceId> + 's {
        pass.draws.iter().flat_map(|draw| draw.bindings).flat_map(|binding| self.read_by(binding))
    }

    fn check_targets(&self, pass: &RasterPass<'_>, targets: &Attachments) -> Result<(), PassError> {
        let refused = |id, problem| Err(self.refused(pass.name, id, problem));
        if let Some(extra) = targets.colours.get(MAX_TARGETS) {
            return refused(extra.surface, SurfaceProblem::TooMany);
        }
        for (number, (id, is_loaded, _)) in targets.all().enumerate() {
            let Some(state) = self.get(id) else { return refused(id, SurfaceProblem::Unknown) };
            if let Some(problem) = misfit(pass, &state.spec(), number >= targets.colours.len()) {
                return refused(id, problem);
            }
            if targets.all().take(number).any(|(other, ..)| other == id) {
                return refused(id, SurfaceProblem::Twice);
            }
            if is_loaded && state.texels.is_none() {
                return refused(id, SurfaceProblem::Unwritten);
            }
        }
        Ok(())
    }

    fn check_bindings(&self, pass: &RasterPass<'_>, targets: &Attachments) -> Result<(), PassError> {
        let bindings =
            pass.draws.iter().enumerate().flat_map(|(draw, of)| of.bindings.iter().map(move |b| (draw, b)));
        for (draw, id) in bindings.flat_map(|(draw, b)| self.read_by(b).into_iter().map(move |id| (draw, id)))
        {
            let target = targets.all().position(|(target, ..)| target == id);
            let problem = match (self.get(id), target) {
                (None, _) => SurfaceProblem::Unknown,
                (Some(_), Some(target)) => SurfaceProblem::Feedback {
                    reader: PassPart::Draw(draw),
                    writer: writer(pass, targets, target),
                },
                (Some(state), None) if state.texels.is_none() => SurfaceProblem::Unwritten,
                (Some(_), None) => continue,
            };
            return Err(self.refused(pass.name, id, problem));
        }
        Ok(())
    }

    fn check_states(&self, pass: &RasterPass<'_>, targets: &Attachments) -> Result<(), PassError> {
        let format = |id| self.get(id).map(|state| state.spec().format);
        for (draw, state) in pass.draws.iter().map(|draw| &draw.state).enumerate() {
            for (number, to) in targets.colours.iter().enumerate() {
                let blends = state.target(number).blend != Blend::Replace;
                if let Some(format) = format(to.surface).filter(|format| blends && !format.can_blend()) {
                    return Err(self.refused(pass.name, to.surface, SurfaceProblem::Blend { draw, format }));
                }
            }
            let tests_depth =
                state.depth.test != Compare::Always || state.depth.write || state.stencil.is_some();
            let Some(depth) = targets.depth else {
                let pass = pass.name.to_owned();
                return if tests_depth { Err(PassError::NoDepths { pass, draw }) } else { continue };
            };
            let lacks =
                format(depth.surface).filter(|format| state.stencil.is_some() && !format.has_stencil());
            if let Some(format) = lacks {
                return Err(self.refused(pass.name, depth.surface, SurfaceProblem::Stencil { draw, format }));
            }
        }
        Ok(())
    }
}

/// What writes first to the target of this number, the depths last.
fn writer(pass: &RasterPass<'_>, targets: &Attachments, target: usize) -> PassPart {
    let writes = |draw: &Draw<'_>| match targets.colours.get(target) {
        Some(_) => draw.state.target(target).writes(),
        None => draw.state.depth.write || draw.state.stencil.is_some(),
    };
    pass.draws.iter().position(writes).map_or(PassPart::Whole, PassPart::Draw)
}

/// Why a surface is no target of a pass, for depths or for colours.
fn misfit(pass: &RasterPass<'_>, spec: &SurfaceSpec<'_>, is_depth: bool) -> Option<SurfaceProblem> {
    let (viewport, samples) = (pass.settings.viewport, pass.settings.samples.per_pixel());
    let size = |of: Viewport| format!("{} x {}", of.width(), of.height());
    if spec.format.is_depth() != is_depth {
        let allowed = if is_depth { "D32 and D24S8, which keep depths" } else { "those for colours" };
        return Some(SurfaceProblem::Format(spec.format, allowed));
    }
    if spec.viewport != viewport {
        return Some(SurfaceProblem::Size(size(spec.viewport), size(viewport)));
    }
    if spec.levels > 1 && spec.samples > 1 {
        return Some(SurfaceProblem::Levels(spec.levels, spec.samples));
    }
    (spec.samples != samples).then_some(SurfaceProblem::Samples(spec.samples, samples))
}
