//! Mip chains made by passes: each level is drawn from the one before.

use activity::Counts;
use glam::{IVec2, UVec2, Vec2, Vec3, Vec4};

use super::attachments::{Attachment, Attachments, Binding, Load, Store, SurfaceId};
use super::error::{PassError, SurfaceProblem};
use super::pass::{Draw, RasterPass, Target};
use super::resolve_pass::AVERAGED;
use super::{Gpu, Settings};
use crate::geometry::{Camera, Cull, Geometry, Viewport};
use crate::sampling::{Sample, SampleSource};
use crate::shader::{Lane, Shader, ShadingPoint};
use crate::state::{DepthState, DrawState};

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
    /// Draws every level of a surface but the finest, each in a pass of its own that reads the level before. A texel is the mean
    /// of 2 x 2; the last column or row of an odd size is left out, as in the chains of textures. Returns the events of all passes.
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
