//! The G-buffer: its surfaces, and what a lighting pass reads of it.

use glam::{Vec3, Vec4};
use pipeline::{
    Attachment, Attachments, Binding, Clear, Format, Gpu, Lane, Outputs, Shader, ShadingPoint, SurfaceId,
    SurfaceSpec, Texture, Viewport,
};
use serde::{Deserialize, Serialize};

use crate::lighting::LitPoint;
use crate::material::SurfaceShader;

/// Format of normals and gloss.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum NormalFormat {
    /// Four halves: 8 bytes.
    #[default]
    Rgba16f,
    /// Four bytes, -1 to 1 as 0 to 1.
    Rgba8,
}

impl NormalFormat {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Rgba16f, Self::Rgba8];

    /// As the pipeline names it.
    pub const fn format(self) -> Format {
        match self {
            Self::Rgba16f => Format::Rgba16f,
            Self::Rgba8 => Format::Rgba8,
        }
    }

    fn encode(self, lane: &Lane, normal: Vec3) -> Vec3 {
        match self {
            Self::Rgba16f => normal,
            Self::Rgba8 => lane.madd(normal, Vec3::splat(0.5), Vec3::splat(0.5)),
        }
    }

    fn decode(self, lane: &Lane, stored: Vec3) -> Vec3 {
        match self {
            Self::Rgba16f => stored,
            Self::Rgba8 => lane.madd(stored, Vec3::splat(2.0), Vec3::splat(-1.0)),
        }
    }
}

/// Colour format of base colours.
const BASE: Format = Format::Rgba8Srgb;
/// Format of depths.
const DEPTH: Format = Format::D32;

/// Surfaces of a G-buffer.
#[derive(Clone, Copy, Debug)]
pub(super) struct GBuffer {
    base: SurfaceId,
    normal: SurfaceId,
    pub depth: SurfaceId,
    normals: NormalFormat,
}

/// Slots of a lighting pass.
const BASE_SLOT: usize = 0;
const NORMAL_SLOT: usize = 1;
const DEPTH_SLOT: usize = 2;

impl GBuffer {
    pub fn new(gpu: &mut Gpu<'_>, viewport: Viewport, samples: u32, normals: NormalFormat) -> Self {
        let mut surface =
            |name, format| gpu.create_surface(&SurfaceSpec::new(name, viewport, format).sampled(samples));
        let (base, normal) = (surface("base colours", BASE), surface("normals", normals.format()));
        Self { base, normal, depth: surface("depths", DEPTH), normals }
    }

    /// Bytes of a sample.
    pub fn bytes(normals: NormalFormat) -> u64 {
        BASE.bytes() + normals.format().bytes() + DEPTH.bytes()
    }

    /// Targets of the pass that writes it.
    pub fn targets(&self) -> Attachments {
        let clear = |surface| Attachment::cleared(surface, Vec4::ZERO);
        let depth = Some(Attachment::cleared(self.depth, Clear::default()));
        Attachments { colours: vec![clear(self.base), clear(self.normal)], depth }
    }

    /// What lighting passes bind.
    pub fn bindings(&self) -> [Binding<'static>; 3] {
        [self.base, self.normal, self.depth].map(Binding::Surface)
    }

    /// A reader for lighting passes: of every sample, or of the first of a pixel for all of them.
    pub fn reader(&self, per_sample: bool) -> Reader {
        Reader { normals: self.normals, per_sample }
    }
}

/// Shader that writes a surface into a G-buffer.
pub(super) struct Writer<'a> {
    pub surface: &'a SurfaceShader,
    pub normals: NormalFormat,
}

impl Shader for Writer<'_> {
    fn texture(&self) -> Option<&Texture> {
        self.surface.texture()
    }

    /// The base colour, after all of the work.
    fn shade(&self, lane: &Lane, at: &ShadingPoint, texel: Vec4) -> Vec4 {
        self.outputs(lane, at, texel)[0]
    }

    fn outputs(&self, lane: &Lane, at: &ShadingPoint, texel: Vec4) -> Outputs {
        let (point, _) = self.surface.surface(lane, at, texel);
        let is_lit = if self.surface.is_lit() { 1.0 } else { 0.0 };
        let normal = self.normals.encode(lane, point.normal);
        [point.base.extend(is_lit), normal.extend(point.gloss), Vec4::ZERO, Vec4::ZERO]
    }

    fn may_discard(&self) -> bool {
        self.surface.may_discard()
    }
}

/// Reads a G-buffer in a lighting pass.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reader {
    normals: NormalFormat,
    per_sample: bool,
}

/// What a G-buffer has at a sample.
pub(super) struct Stored {
    pub point: LitPoint,
    pub depth: f32,
    pub is_lit: bool,
}

impl Reader {
    /// The surface at a sample of a full-screen quad or light volume; `None` where there is none.
    pub fn read(&self, lane: &Lane, at: &ShadingPoint) -> Option<Stored> {
        let sample = if self.per_sample { at.sample } else { 0 };
        let load = |slot| lane.load_sample(slot, at.pixel, sample);
        let depth = load(DEPTH_SLOT).x;
        if !lane.branch(depth < f32::INFINITY) {
            return None;
        }
        let (base, stored) = (load(BASE_SLOT), load(NORMAL_SLOT));
        let normal = lane.normalize(self.normals.decode(lane, stored.truncate()));
        let point = LitPoint { base: base.truncate(), normal, to_camera: at.to_camera, gloss: stored.w };
        Some(Stored { point, depth, is_lit: lane.branch(base.w > 0.5) })
    }
}
