//! Dispatch of groups: they run in parallel, and their packets follow in the order of the groups.

use activity::{Counts, Event, Packet, PacketCounts, PacketKind, Waits};
use rayon::prelude::*;

use super::attachments::SurfaceId;
use super::error::PassError;
use super::gpu::{Gpu, PassReport};
use crate::buffer::{Access, Buffer, BufferBinding, Stored, Word};
use crate::compute::{self, ComputeError, ComputePass, ComputeSpec, GroupLog, SurfaceView, Touched};
use crate::memory::MemorySystem;

/// Groups that run before their packets are emitted.
const CHUNK: u64 = 1024;

impl Gpu<'_> {
    /// A new buffer with `data`.
    pub fn buffer<T: Word>(&mut self, name: &str, data: &[T]) -> Buffer<T> {
        let region = self.allocate(4 * data.len() as u64);
        self.buffers.add(name, region, data)
    }

    /// What a pass stored in a surface; `None` while nothing is stored in it.
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
    /// [`PassError::Compute`] if the GPU has no compute unit, if groups are too large for it, or if the program does
    /// what it may not; [`PassError::Buffer`] if a buffer is of another frame; [`PassError::Memory`] if the buffers of the
    /// frame are too large.
    pub fn dispatch(&mut self, pass: &ComputePass<'_>) -> Result<Counts, PassError> {
        let failed = |error| PassError::Compute { pass: pass.name.to_owned(), error };
        let spec = pass.check(self.spec().compute.as_ref()).map_err(failed)?;
        self.check_memory(pass.name)?;
        self.check_buffers(pass.name, pass.bindings)?;
        let (name, draws, others) = (pass.name.to_owned(), vec![Counts::default()], Counts::default());
        self.start(PassReport { name, triangles: 0, draws, others });
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

    /// Checks that the frame has the bound buffers.
    pub(super) fn check_buffers<'b>(
        &self,
        pass: &str,
        bindings: impl IntoIterator<Item = &'b BufferBinding>,
    ) -> Result<(), PassError> {
        let missing = bindings.into_iter().find(|binding| !self.buffers.has(binding));
        let refused =
            |binding: &BufferBinding| PassError::Buffer { pass: pass.to_owned(), number: binding.number() };
        missing.map_or(Ok(()), |binding| Err(refused(binding)))
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
