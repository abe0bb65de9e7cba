//! Passes without triangles. Dispatch of groups: they run in parallel, and their packets follow in the order
//! of the groups. Full-screen passes: a program runs for every pixel of an image, tile by tile.

use std::collections::HashSet;

use activity::{Counts, Event, Packet, PacketCounts, PacketKind, Waits};
use glam::Vec3;
use rayon::prelude::*;

use super::attachments::{PassError, SurfaceId};
use super::gpu::{Gpu, PassReport, Rendered};
use super::heat::Block;
use super::lanes::{LaneWork, Lanes, Run};
use super::uses::Uses;
use crate::buffer::{Access, Buffer, BufferBinding, Stored, Word};
use crate::compute::{self, ComputeError, ComputePass, ComputeSpec, GroupLog, SurfaceView, Touched};
use crate::geometry::Viewport;
use crate::memory::MemorySystem;
use crate::surface::{Format, Layout, SurfaceSpec};

/// Groups that run before their packets are emitted.
const CHUNK: u64 = 1024;

impl Gpu<'_> {
    /// A new buffer with `data`.
    pub fn buffer<T: Word>(&mut self, name: &str, data: &[T]) -> Buffer<T> {
        let region = self.allocate(4 * data.len() as u64);
        self.buffers.add(name, region, data)
    }

    /// What a pass stored in a surface, until another one stores there; `None` while nothing is stored in it.
    pub fn surface_view(&mut self, id: SurfaceId) -> Option<SurfaceView> {
        let state = self.surfaces.get(id)?;
        let words = state.texels.as_ref()?.words(&state.layout, state.region.bytes() as usize / 4);
        let words = self.buffers.add(state.spec().name, state.region, &words);
        Some(SurfaceView::new(words, state.layout, &state.spec()))
    }

    /// The values of a buffer after all passes so far.
    pub fn values<T: Word>(&self, buffer: Buffer<T>) -> Vec<T> {
        self.buffers.values(buffer)
    }

    /// Runs the groups of a pass. It waits for earlier passes that wrote what it uses, or that use what it writes.
    ///
    /// # Errors
    /// [`PassError::Compute`] if the GPU has no compute unit, if groups are too large for it, or if the
    /// program does what it may not; [`PassError::Buffer`] if a buffer is of another frame;
    /// [`PassError::OutdatedView`] if it is a view of what a surface no longer holds;
    /// [`PassError::Memory`] if the buffers of the frame are too large.
    pub fn dispatch(&mut self, pass: &ComputePass<'_>) -> Result<Counts, PassError> {
        let failed = |error| PassError::Compute { pass: pass.name.to_owned(), error };
        let spec = pass.check(self.spec().compute.as_ref()).map_err(failed)?;
        self.check_frame(pass.name)?;
        self.check_buffers(pass.name, pass.bindings)?;
        self.start(PassReport { draws: vec![Counts::default()], ..PassReport::named(pass.name, 0) });
        if pass.bindings.iter().any(|binding| self.conflicts(binding.region, binding.access == Access::Write))
        {
            self.barrier(Waits::Tiles);
        }
        let new = |kind| Packet { draw: 0, ..Packet::new(kind, self.last_pass()) };
        let (mut start, group) = (new(PacketKind::Draw), new(PacketKind::Compute));
        start.counts[Event::Draws] = 1;
        self.push(&start, 0);
        self.groups(pass, &spec, group).map_err(failed)?;
        for binding in pass.bindings {
            match binding.access {
                Access::Read => self.note_read(binding.region.address()),
                Access::Write => self.keep(binding.region),
            }
        }
        Ok(self.counts_of_pass())
    }

    /// Checks that the frame has the bound buffers, and that views are of what surfaces hold.
    pub(super) fn check_buffers<'b>(
        &self,
        pass: &str,
        bindings: impl IntoIterator<Item = &'b BufferBinding>,
    ) -> Result<(), PassError> {
        let pass = || pass.to_owned();
        for binding in bindings {
            let number = binding.number();
            if !self.buffers.has(binding) {
                return Err(PassError::Buffer { pass: pass(), number });
            }
            if self.buffers.is_outdated(number) {
                let surface = self.buffers.name(number).to_owned();
                return Err(PassError::OutdatedView { pass: pass(), surface });
            }
        }
        Ok(())
    }

    fn groups(
        &mut self,
        pass: &ComputePass<'_>,
        spec: &ComputeSpec,
        packet: Packet,
    ) -> Result<(), ComputeError> {
        let mut access = vec![None; self.buffers.len()];
        for binding in pass.bindings {
            let known = &mut access[binding.number() as usize];
            *known = if *known == Some(Access::Write) { *known } else { Some(binding.access) };
        }
        let mut stored: Vec<Stored> = Vec::new();
        for first in (0..pass.count()).step_by(CHUNK as usize) {
            let numbers = first..pass.count().min(first + CHUNK);
            let buffers = &self.buffers;
            let run = |number| compute::run((pass, spec), pass.group(number), buffers, &access);
            let logs: Vec<GroupLog> = numbers.clone().into_par_iter().map(run).collect();
            for (number, log) in numbers.zip(logs) {
                if let Some((lane, fault)) = log.fault {
                    return Err(ComputeError::Fault { group: pass.group(number), lane, fault });
                }
                let mut packet = Packet { counts: log.counts, ..packet };
                log.lines
                    .iter()
                    .for_each(|line| touch(self.memory(), line.address, line.how, &mut packet.counts));
                self.push(&packet, 0);
                stored.extend(log.stored);
            }
        }
        stored.iter().for_each(|stored| self.buffers.apply(stored));
        Ok(())
    }
}

fn touch(memory: &mut MemorySystem, address: u64, how: Touched, counts: &mut PacketCounts) {
    counts[Event::BufferLines] += 1;
    if how != Touched::Written {
        memory.buffer(address, false, counts);
    }
    if how != Touched::Read {
        memory.buffer(address, true, counts);
    }
}

impl Gpu<'_> {
    /// Draws an image in a pass of its own: `pixel` gives the colour of the pixel at a column and row. What
    /// its lanes do is counted as they do it, in quads of 2 x 2 pixels: the n-th programs of the lanes of a
    /// warp run in step, and a lane without one, as beyond an odd side of the image, is a helper. Helpers
    /// read what their neighbours read; they neither read nor write depth and colour. The image lies in memory tile by
    /// tile.
    ///
    /// # Errors
    /// As [`Gpu::begin_conservative`], and [`PassError::Unstated`] if lanes access what `uses` does not state.
    pub fn shade_pixels(
        &mut self,
        name: &str,
        viewport: Viewport,
        uses: Uses,
        pixel: impl Fn(&Lanes, [u32; 2]) -> Vec3 + Sync,
    ) -> Result<Rendered, PassError> {
        let spec = SurfaceSpec::new(name, viewport, Format::Rgba8Srgb);
        let image = self.allocate(Layout::new(&spec, self.spec().tile_px, 0).1);
        let layout = Layout::new(&spec, self.spec().tile_px, image.address()).0;
        let uses = uses.colours([image]);
        self.check_uses(name, &uses)?;
        self.open(name, Some(viewport));
        self.use_memory(uses);
        let colours = self.run_pixels(viewport, &mut HashSet::new(), |lanes, at| {
            let colour = pixel(lanes, at);
            lanes.write(image, layout.at(at, 0) - image.address(), layout.bytes);
            colour
        })?;
        self.keep(image);
        Ok(Rendered {
            images: vec![colours],
            visible: Vec::new(),
            counts: self.counts_of_pass(),
            passed: Vec::new(),
            region: image,
        })
    }

    /// Runs a program for the pixel at every column and row, in the pass that was begun, in quads as
    /// [`Self::shade_pixels`]. Returns its values, row by row. Lines of targets that are not in `written` hold the clear
    /// value, or nothing.
    ///
    /// # Errors
    /// [`PassError::Unstated`] if lanes access memory that the pass does not state.
    pub(super) fn run_pixels<T: Clone + Default + Send>(
        &mut self,
        viewport: Viewport,
        written: &mut HashSet<u64>,
        pixel: impl Fn(&Lanes, [u32; 2]) -> T + Sync,
    ) -> Result<Vec<T>, PassError> {
        self.end_draws();
        let (side, warp_lanes) = (self.spec().tile_px, self.spec().warp_lanes);
        let columns: Vec<u32> = (0..viewport.width()).step_by(side as usize).collect();
        let mut values = vec![T::default(); viewport.pixels()];
        for y0 in (0..viewport.height()).step_by(side as usize) {
            if self.is_stopped() {
                return Ok(values);
            }
            let run = |&x0: &u32| {
                let (lanes, mut runs) = (Lanes::default(), TileRuns::new(side));
                let run = |[x, y]: [u32; 2]| {
                    let value = pixel(&lanes, [x, y]);
                    runs.of([x - x0, y - y0]).extend(lanes.take_runs());
                    value
                };
                let values: Vec<T> = pixels([x0, y0], side, viewport).map(run).collect();
                lanes.count_quads(&runs.quads, warp_lanes);
                (values, lanes.finish(warp_lanes))
            };
            let tiles: Vec<(Vec<T>, LaneWork)> = columns.par_iter().map(run).collect();
            for ((x0, (of_tile, work)), column) in columns.iter().zip(tiles).zip(0..) {
                for ([x, y], value) in pixels([*x0, y0], side, viewport).zip(of_tile) {
                    values[(y * viewport.width() + x) as usize] = value;
                }
                let tile = y0 / side * columns.len() as u32 + column;
                let mut packet = self.packet(PacketKind::Tile, tile, None);
                self.access(&work, &mut packet.counts, written)?;
                let of = [viewport.width(), viewport.height()];
                let end = [(*x0 + side).min(of[0]), (y0 + side).min(of[1])];
                self.push_block(&packet, &Block { first: [*x0, y0], end, of });
            }
        }
        Ok(values)
    }

    /// A packet of the pass that was begun.
    pub(super) fn packet(&self, kind: PacketKind, tile: u32, triangle: Option<u32>) -> Packet {
        let of = triangle.unwrap_or((self.triangles_of_pass() as u32).saturating_sub(1));
        Packet {
            batch: of / self.spec().batch_triangles,
            draw: self.draw_of_packets(),
            tile,
            triangle: triangle.unwrap_or(Packet::NONE),
            ..Packet::new(kind, self.last_pass())
        }
    }
}

/// Programs of the pixels of a tile, by quad and lane.
struct TileRuns {
    /// Quads in a row.
    across: u32,
    quads: Vec<[Vec<Run>; 4]>,
}

impl TileRuns {
    fn new(side: u32) -> Self {
        let across = side.div_ceil(2);
        Self { across, quads: vec![Default::default(); (across * across) as usize] }
    }

    /// Those of a pixel, by its place in the tile.
    fn of(&mut self, [x, y]: [u32; 2]) -> &mut Vec<Run> {
        &mut self.quads[(y / 2 * self.across + x / 2) as usize][(y % 2 * 2 + x % 2) as usize]
    }
}

/// Pixels of the tile with a given first pixel, row by row.
fn pixels([x0, y0]: [u32; 2], side: u32, viewport: Viewport) -> impl Iterator<Item = [u32; 2]> {
    let columns = x0..viewport.width().min(x0 + side);
    (y0..viewport.height().min(y0 + side)).flat_map(move |y| columns.clone().map(move |x| [x, y]))
}
