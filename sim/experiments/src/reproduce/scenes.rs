//! Workloads of the papers, as far as the papers describe them.

use std::f64::consts::{FRAC_1_SQRT_2, TAU};
use std::sync::Arc;

use glam::{DQuat, DVec3, Mat4, Vec3, Vec4};
use pipeline::{Lane, Shader, ShadingPoint, Texture, Wrap};
use workloads::Material;
use workloads::scene::{Frustum, Graph, Local, Node, Parts, Rig, SceneCamera, Settings, Trs};
use workloads::{LoadError, Overrides, Scene, shapes};

/// Frames in the phone's sequence (Paper III, section 4).
pub(super) const PHONE_FRAMES: u32 = 24;
/// Objects of a frame, fewest and most (Paper III, section 4).
const OBJECTS: [u32; 2] = [23, 62];
/// Quads along an edge of an object: 2048 triangles (Paper III, section 4).
const CELLS: u32 = 32;

/// The phone's shaders (Paper III, section 4): three matrices times a vector for a vertex, of which the pipeline does one; a
/// normalization, a dot product and a mix of two texels for a fragment. A draw has one texture here, but its look-up is trilinear:
/// two fetches, as many as their two without mipmaps.
pub(super) struct Grids<'a>(pub &'a dyn Shader);

impl Shader for Grids<'_> {
    fn texture(&self) -> Option<&Texture> {
        self.0.texture()
    }

    fn vertex(&self, lane: &Lane, position: Vec3) {
        let turned = lane.transform4(&Mat4::from_rotation_y(0.5), position.extend(1.0));
        lane.transform4(&Mat4::from_rotation_x(0.5), turned);
    }

    fn shade(&self, lane: &Lane, at: &ShadingPoint, texel: Vec4) -> Vec4 {
        let facing = lane.dot(lane.normalize(at.normal), Vec3::Y);
        let other = Vec4::ONE;
        lane.madd(lane.sub(other, texel), Vec4::splat(facing), texel)
    }
}

/// Number of objects in a frame of the phone's sequence: from fewest to most and back.
pub(super) fn objects(frame: u32) -> u32 {
    let [fewest, most] = OBJECTS.map(f64::from);
    let wave = 0.5 - 0.5 * libm::cos(TAU * f64::from(frame) / f64::from(PHONE_FRAMES));
    libm::round(fewest + (most - fewest) * wave) as u32
}

/// The synthetic scene of Paper III for the phone, 960x640: textured grids, the nearest drawn last. `edge` is that of an object where
/// the image is 2 high and 3 wide; the paper does not say.
pub(super) fn phone(frame: u32, edge: f64) -> Result<Scene, LoadError> {
    let mut parts = Parts::new("grids of Paper III");
    let white = Material::colored("white", Vec3::ONE);
    let material = Material { double_sided: true, texture: texture().map(Arc::new), ..white };
    let material = parts.graph.push_material(material);
    for object in 0..objects(frame) {
        grid(&mut parts.graph, object, edge, material);
    }
    parts.camera = SceneCamera {
        rig: Rig::look_at(DVec3::new(0.0, 0.0, 10.0), DVec3::ZERO),
        view: Some(Frustum::Orthographic { half_height: 1.0 }),
        near: None,
    };
    parts.settings = Settings {
        width: 960,
        height: 640,
        samples: 1,
        frame_rate_hz: 30.0,
        shutter: 0.0,
        ..Settings::default()
    };
    Scene::new(parts)
}

/// 256 x 256 texels (Paper III, section 4), in stripes.
fn texture() -> Option<Texture> {
    const SIDE: u32 = 256;
    let texel = |at: u32| if (at / 16).is_multiple_of(2) { [210, 200, 180, 255] } else { [60, 90, 140, 255] };
    let texels = (0..SIDE).flat_map(|y| (0..SIDE).map(move |x| texel(x + y))).collect();
    Texture::from_srgb8(SIDE, SIDE, texels, [Wrap::Repeat; 2]).ok()
}

/// An object that faces the camera, wholly inside the image, at a place of a low-discrepancy sequence (the generalized golden
/// ratio in two dimensions, Roberts 2018).
fn grid(graph: &mut Graph, object: u32, edge: f64, material: usize) {
    const STEPS: [f64; 2] = [0.754_877_666_246_692_8, 0.569_840_290_998_053_2];
    let place = |step: f64, room: f64| {
        let at = 0.5 + step * f64::from(object);
        room * (2.0 * (at - libm::floor(at)) - 1.0)
    };
    let at = DVec3::new(
        place(STEPS[0], 1.5 - 0.5 * edge),
        place(STEPS[1], 1.0 - 0.5 * edge),
        0.01 * f64::from(object),
    );
    // A plane looks up; a quarter of a turn makes it look at the camera.
    let rotation = DQuat::from_xyzw(FRAC_1_SQRT_2, 0.0, 0.0, FRAC_1_SQRT_2);
    let trs = Trs { translation: at, rotation, ..Trs::default() };
    let node = graph.push_node(Node::new("grid", None, Local::Trs(trs)));
    graph.attach(shapes::plane(edge, CELLS, 1.0, material), node);
}

/// Spotlights of the PC's animation (Paper III, section 4).
const LIGHTS: u16 = 32;

/// The PC's shader: 32 spotlights in one forward pass on top of the surface's own. The paper has their number; each is a usual one with
/// a cone, a range and a highlight (Blinn 1977).
pub(super) struct Spotlights<'a>(pub &'a dyn Shader);

impl Spotlights<'_> {
    /// Light `number` at `position`, towards which the surface faces by `normal`: diffuse light and highlight.
    fn light(lane: &Lane, number: u16, at: &ShadingPoint, [normal, to_camera]: [Vec3; 2]) -> f32 {
        let [cone, hardness, range, exponent] = [0.7, 1.0 / (1.0 - 0.7), 0.01, 24.0];
        let place = Vec3::new(f32::from(number % 8) - 3.5, 4.0, f32::from(number / 8) - 1.5);
        let to_light = lane.sub(place, at.position);
        let square = lane.dot(to_light, to_light);
        let to_light = lane.scale(to_light, lane.recip(lane.sqrt(square)));
        let edge = lane.sub(lane.dot(to_light, Vec3::Y), cone);
        let edge = lane.saturate(lane.mul(edge, hardness));
        let cone = lane.mul(lane.mul(edge, edge), lane.madd(-2.0, edge, 3.0));
        let fading = lane.max(lane.madd(square, -range, 1.0), 0.0);
        let half = lane.normalize(lane.add(to_light, to_camera));
        let glint = lane.max(lane.dot(normal, half), 0.0);
        let glint = lane.exp2(lane.mul(exponent, lane.log2(glint)));
        let reflected = lane.add(lane.max(lane.dot(normal, to_light), 0.0), glint);
        lane.mul(lane.mul(reflected, cone), fading)
    }
}

impl Shader for Spotlights<'_> {
    fn texture(&self) -> Option<&Texture> {
        self.0.texture()
    }

    fn shade(&self, lane: &Lane, at: &ShadingPoint, texel: Vec4) -> Vec4 {
        let looks = self.0.shade(lane, at, texel);
        let seen = [lane.normalize(at.normal), lane.normalize(at.to_camera)];
        (0..LIGHTS).fold(looks, |sum, number| {
            let light = Self::light(lane, number, at, seen);
            lane.madd(Vec3::splat(light), looks.truncate(), sum.truncate()).extend(1.0)
        })
    }
}

/// The PC's animation: the built-in scene without motion blur and lens, as their GPUs drew it, at 30 frames a second.
/// (Theirs is a path through Sponza, which does not come with this program.)
pub(super) fn pc() -> Result<Scene, LoadError> {
    workloads::load("default")?.with_overrides(&Overrides {
        size: Some((1280, 720)),
        samples: Some(1),
        frame_rate_hz: Some(30.0),
        shutter: Some(0.0),
        lens_radius: Some(0.0),
        ..Overrides::default()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_phones_sequence_is_the_papers() {
        let counts: Vec<u32> = (0..PHONE_FRAMES).map(objects).collect();
        assert_eq!((counts.iter().min(), counts.iter().max()), (Some(&23), Some(&62)));
        let scene = phone(9, 0.28).unwrap();
        assert_eq!(scene.triangle_count(), 2048 * objects(9) as usize);
    }

    /// Nothing is drawn outside the image, where it would cost nothing.
    #[test]
    fn every_object_lies_in_the_image() {
        let scene = phone(12, 0.28).unwrap();
        for mesh in scene.frame(0).unwrap().meshes {
            assert!(
                mesh.open.iter().all(|p| p.x.abs() <= 1.5001 && p.y.abs() <= 1.0001 && p.z < 1.0),
                "{:?}",
                mesh.open[0]
            );
            let facing = mesh.open.iter().map(|p| p.z).fold(f32::NEG_INFINITY, f32::max) - mesh.open[0].z;
            assert!(facing.abs() < 1e-3);
        }
    }
}
