//! GPU during a frame: passes follow each other through one address space and one set of caches.

use std::cell::Cell;
use std::sync::Arc;

use activity::{Counts, Event, LineAccess, Packet, PacketCounts, PacketKind, Waits};
use glam::{Vec3, Vec4};
use serde::{Deserialize, Serialize};

use super::attachments::{Attachments, PassError, Store, SurfaceId, Surfaces};
use super::heat::{Block, FrameHeat, HeatMap, Placement};
use super::order::{Emit, PacketOrder};
use super::pass::{AddressMap, Draw, Pass, RasterPass, Resident, Target, resident};
use super::replay::Replay;
use super::seen::Seen;
use super::uses::{Uses, Writer};
use super::{Finished, PipelineSpec, rasterize, resolve, seen};
use crate::buffer::Buffers;
use crate::geometry::Viewport;
use crate::memory::{AddressSpace, MemoryRange, MemorySystem};
use crate::surface::{SurfaceSpec, Texels};

/// The modelled GPU during a frame. It draws passes in order and emits every work packet, in the order of the
/// hardware, with the lines that the packet requests from the L2. The front end of a pass comes before the tiles of
/// the pass before unless a barrier is between them, as it works beside them. The last packets are emitted
/// when it is dropped or finished. Results and packets are the same for any number of threads.
pub struct Gpu<'e> {
    spec: &'e PipelineSpec,
    pub(super) memory: MemorySystem,
    space: AddressSpace,
    order: PacketOrder<'e>,
    passes: Vec<PassReport>,
    /// Results of passes, which are in memory when the frame ends.
    results: Vec<MemoryRange>,
    /// Results since the last barrier: other units cannot read them yet.
    pub(super) pending: Vec<(MemoryRange, Writer)>,
    /// Surfaces that passes may write and read.
    pub(super) surfaces: Surfaces,
    /// First addresses of what passes since the last barrier read: the reads may still be going on.
    pub(super) reads: Vec<u64>,
    /// What the shaders of the pass that was begun access, if it has no samples.
    pub(super) uses: Uses,
    pub(super) buffers: Buffers,
    heat: FrameHeat,
    /// Whether the tiles of the pass that was begun are those of the heat maps.
    is_on_map: bool,
    /// Where other tiles of the pass that was begun are on the heat maps, if anywhere.
    placement: Option<Placement>,
    /// The draw that was begun, if any.
    draw: Option<u32>,
    /// Whether packets are made wherever a pass can be drawn without them, too.
    is_counted: bool,
    /// Set once the rest of the frame is not needed.
    stop: Option<&'e Cell<bool>>,
}

/// First addresses of what a pass of triangles reads.
struct Reads {
    /// Vertices of its draws.
    vertices: Vec<u64>,
    /// Textures, surfaces and buffers.
    tiles: Vec<u64>,
}

/// Result of a pass.
#[derive(Clone, Debug)]
pub struct Rendered {
    /// Linear RGB radiance of every pixel of each image, row by row from the top left; empty unless requested.
    pub images: Vec<Vec<Vec3>>,
    /// Triangle stored last (`u32::MAX` for none) and bits of the depth of every sample, in the order
    /// `(y width + x) per_pixel + index`; empty unless requested.
    pub visible: Vec<(u32, u32)>,
    /// Count of every event of the pass.
    pub counts: Counts,
    /// Samples that passed, by draw; 0 for draws that are no [`Query`](crate::Query), and those up to the end
    /// of one that ends early.
    pub passed: Vec<u64>,
    /// Images or depths in memory.
    pub region: MemoryRange,
}

impl Rendered {
    /// The result with the work of writing it back to memory, when it is the only pass of a frame.
    fn with_write_back(mut self, report: &FrameReport) -> Self {
        self.counts += &report.write_back;
        self
    }

    /// The first image; empty without images.
    pub fn into_image(self) -> Vec<Vec3> {
        self.images.into_iter().next().unwrap_or_default()
    }
}

/// Work of a pass.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PassReport {
    /// Name of the pass.
    pub name: String,
    /// Triangles of its draws.
    pub triangles: usize,
    /// Events of each draw; those of a dispatch of groups are one.
    pub draws: Vec<Counts>,
    /// Number of draws whose events are among the others, as [`Self::forget_draws`] was called.
    #[serde(default)]
    pub forgotten_draws: usize,
    /// Events of no single draw: resolving, and the barrier before the pass.
    pub others: Counts,
}

impl PassReport {
    fn new(pass: &RasterPass<'_>) -> Self {
        let draws = vec![Counts::default(); pass.draws.len()];
        Self { draws, ..Self::named(pass.name, pass.triangles()) }
    }

    /// A pass without draws so far.
    pub fn named(name: &str, triangles: usize) -> Self {
        let (name, others) = (name.to_owned(), Counts::default());
        Self { name, triangles, draws: Vec::new(), forgotten_draws: 0, others }
    }

    fn add(&mut self, packet: &Packet) {
        *self.draws.get_mut(packet.draw as usize).unwrap_or(&mut self.others) += &packet.counts;
    }

    /// Keeps the events, but not of which draw they are.
    pub fn forget_draws(&mut self) {
        self.others = self.counts();
        self.forgotten_draws += self.draws.len();
        self.draws.clear();
    }

    /// Events of the pass.
    pub fn counts(&self) -> Counts {
        let mut all = self.others;
        self.draws.iter().for_each(|draw| all += draw);
        all
    }
}

/// Work of a frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FrameReport {
    /// The passes, in order.
    pub passes: Vec<PassReport>,
    /// Events of writing results back to memory when the frame ends.
    pub write_back: Counts,
    /// Heat map of each requested event; they are pictures, and not part of a report in a file.
    #[serde(skip)]
    pub heat: Vec<HeatMap>,
}

impl FrameReport {
    /// Events of the frame.
    pub fn counts(&self) -> Counts {
        let mut all = self.write_back;
        self.passes.iter().for_each(|pass| all += &pass.counts());
        all
    }

    /// Triangles drawn in all passes.
    pub fn triangles(&self) -> usize {
        self.passes.iter().map(|pass| pass.triangles).sum()
    }
}

impl<'e> Gpu<'e> {
    /// A GPU with empty caches.
    ///
    /// # Errors
    /// [`PassError::Cache`] if a cache of `spec` is invalid.
    pub fn new(
        spec: &'e PipelineSpec,
        emit: impl FnMut(&Packet, &[LineAccess]) + 'e,
    ) -> Result<Self, PassError> {
        Self::receiving(spec, Some(Box::new(emit)))
    }

    fn receiving(spec: &'e PipelineSpec, emit: Option<Emit<'e>>) -> Result<Self, PassError> {
        let memory = MemorySystem::new(&spec.memory)?;
        let (passes, results, pending, reads, buffers, heat) = Default::default();
        Ok(Self {
            spec,
            memory,
            space: AddressSpace::default(),
            order: PacketOrder::new(emit),
            passes,
            results,
            pending,
            surfaces: Surfaces::default(),
            reads,
            uses: Uses::default(),
            buffers,
            heat,
            is_on_map: false,
            placement: None,
            draw: None,
            is_counted: true,
            stop: None,
        })
    }

    /// The GPU with heat maps of `events` over images of the size of `viewport`. Events of passes of another
    /// size have no position.
    #[must_use]
    pub fn with_heat(self, events: &[Event], viewport: Viewport) -> Self {
        Self { heat: self.heat.with(None, events, self.spec, viewport), ..self }
    }

    /// The same of the passes of one name alone.
    #[must_use]
    pub fn with_heat_of_pass(self, pass: &str, events: &[Event], viewport: Viewport) -> Self {
        Self { heat: self.heat.with(Some(pass), events, self.spec, viewport), ..self }
    }

    /// The GPU, which draws no further once `stop` is set, for example by the code that receives its packets. Raster
    /// and compute passes are then refused; others end early, with no result for the rest.
    #[must_use]
    pub fn stopping(self, stop: &'e Cell<bool>) -> Self {
        Self { stop: Some(stop), ..self }
    }

    /// Whether it draws no further.
    pub(super) fn is_stopped(&self) -> bool {
        self.stop.is_some_and(Cell::get)
    }

    /// A GPU whose packets are only counted.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn without_packets(spec: &'e PipelineSpec) -> Result<Self, PassError> {
        Self::receiving(spec, None)
    }

    /// A GPU for images alone. The visibility engine finds what samples see, faster than the model of the
    /// hardware and to the same bytes; such passes have no counts and no packets. Passes into surfaces, with
    /// state that depends on the order of triangles (blending, discarding shaders, depth and stencil state,
    /// queries), with clip planes of a geometry, of orthographic cameras and with the thresholds of
    /// [`Features`](super::Features) are drawn as on other GPUs.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn images_only(spec: &'e PipelineSpec) -> Result<Self, PassError> {
        Ok(Self { is_counted: false, ..Self::without_packets(spec)? })
    }

    /// Functional parameters.
    pub fn spec(&self) -> &'e PipelineSpec {
        self.spec
    }

    /// The draws with addresses for their vertices and textures, so that several passes read the same data.
    pub fn resident<'a>(&mut self, draws: &[Draw<'a>]) -> Vec<Draw<'a>> {
        let at: Vec<Resident> = resident(draws, &mut self.space)
            .map(|(vertices, texture)| Resident { vertices: Some(vertices), texture })
            .collect();
        draws.iter().zip(at).map(|(draw, resident)| Draw { resident, ..*draw }).collect()
    }

    /// A new region of memory.
    pub fn allocate(&mut self, bytes: u64) -> MemoryRange {
        self.space.take(bytes)
    }

    /// A new surface that passes may write and read. Nothing is stored in it yet.
    pub fn create_surface(&mut self, spec: &SurfaceSpec<'_>) -> SurfaceId {
        self.surfaces.create(spec, self.spec.tile_px, &mut self.space)
    }

    /// Values of all samples of a surface as its format keeps them, in the order `(y width + x) samples +
    /// index`; `None` while nothing is stored in it. Depths are in `x`, stencil values in `y`.
    pub fn contents(&self, id: SurfaceId) -> Option<Vec<Vec4>> {
        Some(self.surfaces.get(id)?.texels.as_ref()?.values())
    }

    /// Starts a pass whose packets are made outside of rasterization. Their tiles are those of an image of
    /// the size of `viewport`, if any.
    pub(super) fn open(&mut self, name: &str, viewport: Option<Viewport>) {
        self.start(PassReport::named(name, 0));
        self.is_on_map = viewport.is_some_and(|viewport| self.heat.is_of(viewport));
    }

    /// Whether there are heat maps over images of this size.
    pub(super) fn has_heat_of(&self, viewport: Viewport) -> bool {
        self.heat.is_of(viewport)
    }

    /// Starts a pass over tiles of the caller, whose place in the image of the frame is given, if they are there.
    pub(super) fn open_placed(&mut self, name: &str, placement: Option<Placement>) {
        self.open(name, None);
        self.placement = placement;
    }

    /// Starts a pass whose packets have no place in an image.
    pub(super) fn start(&mut self, report: PassReport) {
        self.heat.begin(Some(&report.name));
        self.passes.push(report);
        self.is_on_map = false;
        self.placement = None;
        self.draw = None;
        self.uses = Uses::default();
    }

    /// What follows in the pass that was begun is of draw `number`.
    pub(super) fn begin_draw(&mut self, number: u32) {
        if let Some(pass) = self.passes.last_mut() {
            pass.draws.resize(pass.draws.len().max(number as usize + 1), Counts::default());
        }
        self.draw = Some(number);
    }

    /// What follows in the pass is of no single draw.
    pub(super) fn end_draws(&mut self) {
        self.draw = None;
    }

    /// The draw that packets are of. A pass without draws is as one of a single draw.
    pub(super) fn draw_of_packets(&self) -> u32 {
        self.draw.unwrap_or(if self.draws_of_pass().is_empty() { 0 } else { Packet::NONE })
    }

    /// Whether a pass that reads or writes `region` has to wait for earlier ones.
    pub(super) fn conflicts(&self, region: MemoryRange, writes: bool) -> bool {
        self.pending.iter().any(|(pending, _)| pending.overlaps(region)) || (writes && self.is_read(region))
    }

    /// Whether what is at `address` was written since the last barrier.
    fn is_pending(&self, address: u64) -> bool {
        self.pending.iter().any(|(region, _)| region.contains(address))
    }

    /// Whether a pass since the last barrier reads `region`.
    pub(super) fn is_read(&self, region: MemoryRange) -> bool {
        self.reads.iter().any(|&address| region.contains(address))
    }

    /// Records that the last pass reads what is at `address`.
    pub(super) fn note_read(&mut self, address: u64) {
        self.reads.push(address);
    }

    /// Checks that the frame goes on, and that all its surfaces fit into memory.
    pub(super) fn check_frame(&self, pass: &str) -> Result<(), PassError> {
        if self.is_stopped() {
            return Err(PassError::Stopped { pass: pass.to_owned() });
        }
        if self.space.fits() {
            return Ok(());
        }
        Err(PassError::Memory { pass: pass.to_owned(), bytes: self.space.bytes() })
    }

    /// Triangles of the last pass so far.
    pub(super) fn triangles_of_pass(&self) -> usize {
        self.passes.last().map_or(0, |pass| pass.triangles)
    }

    /// Events of each draw of the last pass so far.
    pub(super) fn draws_of_pass(&self) -> &[Counts] {
        self.passes.last().map_or(&[], |pass| &pass.draws)
    }

    /// Name of the last pass.
    pub(super) fn name_of_pass(&self) -> &str {
        self.passes.last().map_or("", |pass| &pass.name)
    }

    /// Events of the last pass so far.
    pub fn counts_of_pass(&self) -> Counts {
        self.passes.last().map_or_else(Counts::default, PassReport::counts)
    }

    /// Caches, for the packets of a pass that was begun.
    pub(super) fn memory(&mut self) -> &mut MemorySystem {
        &mut self.memory
    }

    /// Emits a packet of a pass that was begun, which sets up `triangles`, with the lines requested since the
    /// one before.
    pub(super) fn push(&mut self, packet: &Packet, triangles: usize) {
        self.heat.add(packet, self.is_on_map);
        self.emit(packet, triangles);
    }

    /// The same for work on a block of tiles of the caller.
    pub(super) fn push_block(&mut self, packet: &Packet, block: &Block) {
        match self.placement {
            Some(placement) => self.heat.add_block(packet, &placement, block),
            None => self.heat.add(packet, self.is_on_map),
        }
        self.emit(packet, 0);
    }

    fn emit(&mut self, packet: &Packet, triangles: usize) {
        if let Some(report) = self.passes.last_mut() {
            report.triangles += triangles;
            report.add(packet);
        }
        self.order.push(packet, self.memory.log());
        self.memory.clear_log();
    }

    /// Marks a region as a result of the last pass.
    pub fn keep(&mut self, region: MemoryRange) {
        self.results.push(region);
        if !self.pending.iter().any(|(known, _)| *known == region) {
            self.pending.push((region, Writer::Other));
        }
    }

    /// Lets all later work wait for the work so far, and makes its results readable.
    pub fn wait(&mut self) {
        self.barrier(Waits::All);
    }

    /// Draws a pass.
    ///
    /// # Errors
    /// [`PassError`] if a cache of the settings is invalid, if a surface or buffer cannot be used as it is,
    /// or if the memory of the frame is too large.
    pub fn draw(&mut self, pass: &RasterPass<'_>) -> Result<Rendered, PassError> {
        let number = self.passes.len() as u32;
        let has_heat = self.has_heat_of(pass.settings.viewport);
        self.check_frame(pass.name)?;
        pass.check_queries()?;
        self.check_buffers(pass.name, pass.buffers())?;
        self.surfaces.check(pass)?;
        let stored = (&self.surfaces, &self.buffers);
        let prepared = Pass::new(pass, (number, has_heat), stored, &mut self.space);
        self.check_frame(pass.name)?;
        self.start(PassReport::new(pass));
        let reads = self.reads_of(&prepared.addresses, pass);
        if let Some(waits) = self.waits(&reads, pass) {
            self.barrier(waits);
        }
        let seen = if self.is_counted { None } else { seen::draw(&prepared, pass) };
        let mut drawn = match seen {
            Some(Seen { images, visible }) => {
                let (counts, passed) = (Counts::default(), vec![0; prepared.draws.len()]);
                Rendered { images, visible, counts, passed, region: prepared.result() }
            }
            None => self.pass(&prepared, pass)?,
        };
        if self.write_answers(pass.draws) {
            drawn.counts = self.counts_of_pass();
        }
        if !prepared.is_attached {
            self.keep(drawn.region);
        }
        self.reads.extend(reads.vertices.iter().chain(&reads.tiles));
        Ok(drawn)
    }

    fn pass(&mut self, prepared: &Pass<'_>, pass: &RasterPass<'_>) -> Result<Rendered, PassError> {
        let (order, report) = (&mut self.order, &mut self.passes[prepared.number as usize]);
        let heat = &mut self.heat;
        let mut done = |work: Finished<'_>| match work {
            Finished::Packet(packet, lines) => {
                report.add(packet);
                if prepared.heat || pass.places.is_empty() {
                    heat.drawn(packet, prepared.heat);
                } else {
                    heat.drawn_at(packet, || pass.places_of(packet.tile));
                }
                order.push(packet, lines);
            }
            Finished::Tests(number, bin, log) if prepared.heat => heat.tests(prepared, number, bin, log),
            Finished::Tests(..) => {}
        };
        let mut replay = Replay::new(prepared, &mut self.memory)?;
        let is_empty = matches!(pass.target, Target::Views(_)) && prepared.is_depth_only();
        let bins = if is_empty { Vec::new() } else { rasterize(prepared, &mut replay, &mut done) };
        let passed = std::mem::take(&mut replay.passed);
        let visible = if pass.visible { resolve::visible(prepared, &bins) } else { Vec::new() };
        let report = report.counts();
        if let Target::Surfaces(targets) = pass.target {
            self.store(targets, resolve::stored(prepared, &bins));
        }
        Ok(Rendered {
            images: if pass.image { resolve::resolve(prepared, &bins) } else { Vec::new() },
            visible,
            counts: report,
            passed,
            region: prepared.result(),
        })
    }

    /// Keeps the contents of the targets of a pass, the depths last.
    fn store(&mut self, targets: &Attachments, contents: Vec<Texels>) {
        for ((id, _, store), texels) in targets.all().zip(contents) {
            self.replace(id, (store == Store::Store).then_some(texels));
        }
    }

    /// Replaces the contents of a surface by those that a pass stored; `None` drops them.
    pub(super) fn replace(&mut self, id: SurfaceId, texels: Option<Texels>) {
        let Some(state) = self.surfaces.get_mut(id) else { return };
        let (place, is_stored) = (state.region, texels.is_some());
        state.texels = texels.map(Arc::new);
        self.buffers.outdate(place);
        // What was stored before is no longer a result either.
        self.results.retain(|result| *result != place);
        self.pending.retain(|(result, _)| *result != place);
        if is_stored {
            self.keep(place);
        }
    }

    /// Packets that have to wait for earlier passes, if any: those that read their results, or write what
    /// they read. A target of several passes needs no wait, as the units of depth and colour work in order.
    fn waits(&self, reads: &Reads, pass: &RasterPass<'_>) -> Option<Waits> {
        let is_pending = |address: &u64| self.is_pending(*address);
        if reads.vertices.iter().any(is_pending) {
            return Some(Waits::All);
        }
        let is_read = |id: SurfaceId| self.surfaces.get(id).is_some_and(|state| self.is_read(state.region));
        let overwrites =
            matches!(pass.target, Target::Surfaces(targets) if targets.all().any(|(id, ..)| is_read(id)));
        (reads.tiles.iter().any(is_pending) || overwrites).then_some(Waits::Tiles)
    }

    fn reads_of(&self, at: &AddressMap, pass: &RasterPass<'_>) -> Reads {
        let surfaces =
            self.surfaces.read_in(pass).filter_map(|id| Some(self.surfaces.get(id)?.region.address()));
        let buffers = pass.buffers().map(|binding| binding.region.address());
        Reads {
            vertices: at.vertices.iter().map(|buffer| buffer.vertices.address()).collect(),
            tiles: at.textures.iter().flatten().copied().chain(surfaces).chain(buffers).collect(),
        }
    }

    /// Lets packets wait for all earlier ones, and makes results readable.
    pub(super) fn barrier(&mut self, waits: Waits) {
        let mut packet = Packet::new(PacketKind::Barrier(waits), self.last_pass());
        self.memory.flush(&mut packet.counts);
        self.pending.clear();
        self.reads.clear();
        self.push(&packet, 0);
    }

    /// Number of the last pass; 0 before the first.
    pub(super) fn last_pass(&self) -> u32 {
        self.passes.len().saturating_sub(1) as u32
    }

    /// Ends the frame: the results of all passes are written back to memory.
    pub fn finish(mut self) -> FrameReport {
        let mut counts = PacketCounts::default();
        self.memory.finish(&self.results, &mut counts);
        let packet = Packet { counts, ..Packet::new(PacketKind::Resolve, self.passes.len() as u32) };
        self.order.push(&packet, self.memory.log());
        self.heat.begin(None);
        self.heat.add(&packet, false);
        let mut write_back = Counts::default();
        write_back += &counts;
        FrameReport { passes: self.passes, write_back, heat: self.heat.into_maps() }
    }
}

// In `pass` it would make the two modules depend on each other.
impl RasterPass<'_> {
    /// Visible triangle and bits of its depth of every sample, as in [`Rendered::visible`].
    ///
    /// # Errors
    /// As [`Gpu::draw`].
    pub fn visibility(&self) -> Result<Vec<(u32, u32)>, PassError> {
        Ok(self.onto(Target::Depth).with_visible().render(|_, _| ())?.visible)
    }

    /// Draws the pass for its images and what its samples see alone, as a [`Gpu::images_only`] does. Whether it
    /// was counted depends on the pass, so its counts mean nothing.
    ///
    /// # Errors
    /// As [`Gpu::draw`].
    pub fn uncounted(&self) -> Result<Rendered, PassError> {
        Gpu::images_only(self.settings.spec)?.draw(self)
    }

    /// Draws the pass as the only one of a frame. The counts include writing the result back to memory.
    ///
    /// # Errors
    /// As [`Gpu::draw`].
    pub fn render(&self, emit: impl FnMut(&Packet, &[LineAccess])) -> Result<Rendered, PassError> {
        let mut gpu = Gpu::new(self.settings.spec, emit)?;
        let drawn = gpu.draw(self)?;
        Ok(drawn.with_write_back(&gpu.finish()))
    }
}
