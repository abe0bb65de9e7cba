//! The file's camera and light.

use glam::{DVec3, Vec3};
use gltf::json::camera::{Camera, Type as CameraType};
use gltf::json::extensions::scene::khr_lights_punctual::Type as LightType;
use gltf::json::validation::Checked;
use warnings::{Code, Warning};

use super::document::Document;
use super::nodes::Tree;
use crate::material::Light;
use crate::scene::{Instant, OwnCamera, Rig, SceneCamera, View, world_poses};

/// The usable cameras of the default scene, of which the first sees it, and the first directional light or what stands in.
pub(super) fn view(document: &Document, tree: &Tree, warnings: &mut Vec<Warning>) -> (Vec<OwnCamera>, Light) {
    (cameras(document, tree, warnings), light(document, tree, warnings))
}

fn at_node(index: usize, node: &gltf::json::Node) -> String {
    node.name.as_ref().map_or_else(|| format!("node {index}"), |name| format!("node {index} `{name}`"))
}

fn cameras(document: &Document, tree: &Tree, warnings: &mut Vec<Warning>) -> Vec<OwnCamera> {
    let (root, mut cameras) = (&document.root, Vec::new());
    for (index, node) in root.nodes.iter().enumerate() {
        let Some(camera) = node.camera.and_then(|camera| root.cameras.get(camera.value())) else { continue };
        if !tree.in_scene[index] {
            continue;
        }
        if let Some((view, near)) = seen(camera) {
            let name = camera.name.clone().or_else(|| node.name.clone());
            let name = name.unwrap_or_else(|| format!("camera {}", cameras.len()));
            let camera = SceneCamera { rig: Rig::Node(tree.place[index]), view: Some(view), near };
            cameras.push(OwnCamera { name, camera });
            continue;
        }
        let what = "without a usable field of view, height or near plane ignored: it cannot be used";
        warnings.push(Warning::about(Code::CameraIgnored, "camera", what, at_node(index, node)));
    }
    cameras
}

/// How much the camera sees and its near depth. The image has its own width, so the file's aspect ratio or `xmag` does not count
/// (glTF 2.0, 3.10.3); an orthographic near plane at zero, which it allows, is left to the scene.
fn seen(camera: &Camera) -> Option<(View, Option<f64>)> {
    match (&camera.type_, &camera.perspective, &camera.orthographic) {
        (Checked::Valid(CameraType::Perspective), Some(lens), _) => {
            let usable = lens.yfov > 0.0 && lens.yfov < 3.1 && lens.znear > 0.0;
            let tan_half_height = libm::tan(f64::from(lens.yfov) / 2.0);
            usable.then_some((View::Perspective { tan_half_height }, Some(f64::from(lens.znear))))
        }
        (Checked::Valid(CameraType::Orthographic), _, Some(lens)) => {
            let usable = lens.ymag > 0.0 && lens.ymag.is_finite() && lens.znear >= 0.0;
            let near = (lens.znear > 0.0).then_some(f64::from(lens.znear));
            usable.then_some((View::Orthographic { half_height: f64::from(lens.ymag) }, near))
        }
        _ => None,
    }
}

fn light(document: &Document, tree: &Tree, warnings: &mut Vec<Warning>) -> Light {
    let root = &document.root;
    let lights = root.extensions.as_ref().and_then(|extensions| extensions.khr_lights_punctual.as_ref());
    let lights = lights.map_or(&[][..], |lights| &lights.lights);
    let worlds = world_poses(&tree.nodes, Instant { open_s: 0.0, offset_s: 0.0 });
    let mut found = None;
    for (index, node) in root.nodes.iter().enumerate() {
        let hung = node.extensions.as_ref().and_then(|extensions| extensions.khr_lights_punctual.as_ref());
        let Some(light) = hung.and_then(|hung| lights.get(hung.light.value())) else { continue };
        if !tree.in_scene[index] {
            continue;
        }
        // A directional light shines along its node's -z (KHR_lights_punctual).
        let toward = worlds[tree.place[index]].matrix3.z_axis;
        let directional = matches!(light.type_, Checked::Valid(LightType::Directional));
        if directional && found.is_none() && toward.length() > 0.0 && toward.is_finite() {
            found = Some((toward, light.color));
        } else if light.intensity > 0.0 && light.color.iter().any(|channel| *channel > 0.0) {
            let what = "ignored: only one directional light is used";
            let kind = match light.type_ {
                Checked::Valid(LightType::Point) => "point light",
                Checked::Valid(LightType::Spot) => "spot light",
                _ => "further directional light",
            };
            warnings.push(Warning::about(Code::LightIgnored, kind, what, at_node(index, node)));
        }
    }
    found.map_or_else(Light::default, |(toward, color)| lamp(toward, color))
}

/// The lamp keeps the file's direction and hue, but not its intensity: there is no exposure to go with it.
fn lamp(toward: DVec3, color: [f32; 3]) -> Light {
    let plain = Light::default();
    let hue = Vec3::from_array(color.map(|part| if part.is_finite() { part.clamp(0.0, 1.0) } else { 1.0 }));
    let brightest = hue.max_element();
    let hue = if brightest > 0.0 { hue * (1.0 / brightest) } else { Vec3::ONE };
    let toward = toward * (1.0 / toward.length());
    Light { toward: Some(toward.as_vec3()), color: hue * plain.color.max_element(), ..plain }
}
