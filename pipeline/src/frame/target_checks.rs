//! Checks of the targets and bindings of a pass, before it is drawn, and which surfaces it reads.

use super::attachments::{Attachments, Binding, PassError, PassPart, SurfaceId, SurfaceProblem, Surfaces};
use super::pass::{Draw, RasterPass, Target};
use crate::buffer::BufferBinding;
use crate::geometry::Viewport;
use crate::state::{Blend, Compare};
use crate::surface::{MAX_TARGETS, SurfaceSpec};

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
        let read = |binding: &Binding<'_>| match binding {
            Binding::Buffer(buffer) => self.viewed(buffer, targets),
            _ => self.read_by(binding),
        };
        for (draw, id) in bindings.flat_map(|(draw, b)| read(b).into_iter().map(move |id| (draw, id))) {
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

    /// Target that a buffer is a view of, if any.
    fn viewed(&self, buffer: &BufferBinding, targets: &Attachments) -> Vec<SurfaceId> {
        let is_viewed = |id: &SurfaceId| self.get(*id).is_some_and(|state| state.region == buffer.region);
        targets.all().map(|(id, ..)| id).filter(is_viewed).collect()
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
