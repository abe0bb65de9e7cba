//! Deferred rendering: a pass writes what light meets at the visible surface of every sample (the G-buffer;
//! Saito and Takahashi, Comprehensible rendering of 3-D shapes, SIGGRAPH 1990), a second one lights it, and a
//! third one makes the image. Forward rendering of the same surfaces under the same lights stands beside it.
//!
//! Positions are not stored: they follow from depth and the ray of a sample. The camera is a still pinhole;
//! objects may move, as every sample has a surface of its own.
//!
//! Shaders light surfaces forward, or from the G-buffer by a quad over the screen or by a light volume. Point
//! lights have fixed positions.

mod job;

use glam::{Vec3, Vec4};
use pipeline::{
    Attachment, Attachments, Binding, Buffer, Camera, Clear, Format, Gpu, Lane, Outputs, Shader,
    ShadingPoint, SurfaceId, SurfaceSpec, Texture, Viewport,
};
use serde::{Deserialize, Serialize};

use crate::material::{Lighting, LitPoint, PointLight, SurfaceShader};
use crate::scene::Frame;

pub use job::{Deferred, DeferredOptions, LightPass, LightingMethod, LightingRate};
pub(crate) use job::{FACTS, FLAGS, job};

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
struct GBuffer {
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
struct Writer<'a> {
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
struct Reader {
    normals: NormalFormat,
    per_sample: bool,
}

/// What a G-buffer has at a sample.
struct Stored {
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

/// Steps of the low-discrepancy sequence in three dimensions (the generalized golden ratio, Roberts 2018).
const STEPS: [f64; 3] = [0.819_172_513_396_164_5, 0.671_043_606_703_789_3, 0.549_700_477_901_970_3];
/// Radiance of a white surface next to a light, all channels together.
const BRIGHTNESS: f32 = 1.5;

/// `count` lights of `range` scene units within `bounds`. Colours go around the hues; the first lights of
/// more are the same.
pub fn point_lights([low, high]: [Vec3; 2], count: u32, range: f32) -> Vec<PointLight> {
    let part = |number: u32, axis: usize| {
        let at = 0.5 + STEPS[axis] * f64::from(number);
        (at - libm::floor(at)) as f32
    };
    let light = |number| {
        let place = Vec3::from_array([0, 1, 2].map(|axis| part(number, axis)));
        let color = Vec3::from_array([0, 1, 2].map(|axis| 0.2 + part(number, axis)));
        let color = color * (BRIGHTNESS / (color.x + color.y + color.z));
        PointLight { position: low + place * (high - low), color, range }
    };
    (1..=count).map(light).collect()
}

/// Box around the visible meshes of a frame, by the middle four fifths of their vertices along each axis: a
/// few far ones (a floor to the horizon) do not take the lights away from the rest.
fn bounds(frame: &Frame) -> [Vec3; 2] {
    let mut along = [0, 1, 2].map(|axis| {
        let all = frame.meshes.iter().flat_map(|mesh| mesh.open.iter());
        all.map(|point| point[axis]).collect::<Vec<f32>>()
    });
    let [low, high] = [0.1, 0.9].map(|share| {
        Vec3::from_array(along.each_mut().map(|values| {
            let place = (share * values.len() as f64) as usize;
            let place = place.min(values.len().saturating_sub(1));
            if values.is_empty() { 0.0 } else { *values.select_nth_unstable_by(place, f32::total_cmp).1 }
        }))
    });
    [low, high]
}

/// Words of a light in memory: position, colour and range.
const LIGHT_WORDS: u32 = 7;

/// Point lights in memory, one after another.
#[derive(Clone, Copy, Debug)]
struct LightBuffer(Buffer<f32>);

impl LightBuffer {
    pub fn new(gpu: &mut Gpu<'_>, lights: &[PointLight]) -> Self {
        let words = |light: &PointLight| {
            let ([x, y, z], [r, g, b]) = (light.position.to_array(), light.color.to_array());
            [x, y, z, r, g, b, light.range]
        };
        Self(gpu.buffer("lights", &lights.iter().flat_map(words).collect::<Vec<f32>>()))
    }

    /// What the passes that read it bind.
    pub fn binding(&self) -> Binding<'static> {
        Binding::Buffer(self.0.reads())
    }

    pub fn get(&self, lane: &Lane, light: u32) -> PointLight {
        let [x, y, z, r, g, b, range] =
            [0, 1, 2, 3, 4, 5, 6].map(|word| lane.load(self.0, LIGHT_WORDS * light + word));
        PointLight { position: Vec3::new(x, y, z), color: Vec3::new(r, g, b), range }
    }

    /// Radiance of a point under all lights on top of that under the `scene`'s.
    pub fn add(&self, lane: &Lane, scene: Vec3, at: &LitPoint, position: Vec3) -> Vec3 {
        let lights = (0..self.0.len() / LIGHT_WORDS).map(|light| self.get(lane, light));
        lights.fold(scene, |sum, light| lane.add(sum, light.radiance(lane, at, position)))
    }
}

/// A surface under the light of its scene and point lights.
struct Forward<'a> {
    pub surface: &'a SurfaceShader,
    pub lights: LightBuffer,
}

impl Shader for Forward<'_> {
    fn texture(&self) -> Option<&Texture> {
        self.surface.texture()
    }

    fn shade(&self, lane: &Lane, at: &ShadingPoint, texel: Vec4) -> Vec4 {
        let (point, opacity) = self.surface.surface(lane, at, texel);
        if !self.surface.is_lit() {
            return point.base.extend(opacity);
        }
        let scene = self.surface.lighting().radiance(lane, &point);
        self.lights.add(lane, scene, &point, at.position).extend(opacity)
    }

    fn may_discard(&self) -> bool {
        self.surface.may_discard()
    }
}

/// The rays of a still pinhole or orthographic camera.
#[derive(Clone, Copy, Debug)]
struct CameraRays {
    eye: Vec3,
    forward: Vec3,
    is_orthographic: bool,
}

impl CameraRays {
    /// The rays when the shutter opens.
    pub fn new(camera: &Camera) -> Self {
        let world = camera.open().inverse();
        let (eye, forward) = (world.translation.into(), world.matrix3.z_axis.into());
        Self { eye, forward, is_orthographic: camera.is_orthographic() }
    }

    /// The point at `depth` on the ray through `through`.
    pub fn at(&self, lane: &Lane, through: Vec3, depth: f32) -> Vec3 {
        let from_eye = lane.sub(through, self.eye);
        let own = lane.dot(from_eye, self.forward);
        let ray = if self.is_orthographic { self.forward } else { lane.scale(from_eye, lane.recip(own)) };
        lane.madd(ray, Vec3::splat(lane.sub(depth, own)), through)
    }
}

/// Lights a G-buffer: the light of the scene and `lights`, if there are any.
struct Screen {
    pub reader: Reader,
    pub rays: CameraRays,
    pub scene: Lighting,
    pub lights: Option<LightBuffer>,
}

impl Shader for Screen {
    fn shade(&self, lane: &Lane, at: &ShadingPoint, _: Vec4) -> Vec4 {
        let Some(stored) = self.reader.read(lane, at) else { return Vec4::ZERO };
        let point = stored.point;
        if !stored.is_lit {
            return point.base.extend(1.0);
        }
        let scene = self.scene.radiance(lane, &point);
        let Some(lights) = self.lights else { return scene.extend(1.0) };
        let position = self.rays.at(lane, at.position, stored.depth);
        lights.add(lane, scene, &point, position).extend(1.0)
    }
}

/// Light of one point light on a G-buffer, for the pixels of its volume.
struct Volume {
    pub reader: Reader,
    pub rays: CameraRays,
    pub lights: LightBuffer,
    /// Number of the light.
    pub light: u32,
}

impl Shader for Volume {
    fn shade(&self, lane: &Lane, at: &ShadingPoint, _: Vec4) -> Vec4 {
        let stored = self.reader.read(lane, at).filter(|stored| stored.is_lit);
        let Some(stored) = stored else { return Vec4::ZERO };
        let position = self.rays.at(lane, at.position, stored.depth);
        self.lights.get(lane, self.light).radiance(lane, &stored.point, position).extend(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_lights_leave_the_first_where_they_are() {
        let bounds = [Vec3::new(-1.0, 0.0, 2.0), Vec3::new(3.0, 1.0, 4.0)];
        let [few, many] = [4, 64].map(|count| point_lights(bounds, count, 2.0));
        assert_eq!(few[..], many[..4]);
        assert!(many.iter().all(|light| light.position.cmpge(bounds[0]).all()));
        assert!(many.iter().all(|light| light.position.cmple(bounds[1]).all()));
        let sum = |light: &PointLight| light.color.x + light.color.y + light.color.z;
        assert!(many.iter().all(|light| (sum(light) - BRIGHTNESS).abs() < 1e-5));
    }
}
