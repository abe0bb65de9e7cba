//! The node hierarchy with parents before children, and its clips, skins, cameras and light.

use glam::{DAffine3, DMat3, DQuat, DVec3, Vec3};
use gltf::json;
use gltf::json::accessor::Type;
use gltf::json::animation::{
    Animation, Channel, Interpolation as JsonInterpolation, Property as JsonProperty,
};
use gltf::json::camera::{Camera, Type as CameraType};
use gltf::json::extensions::scene::khr_lights_punctual::Type as LightType;
use gltf::json::validation::Checked;
use warnings::{Code, Warning};

use super::Document;
use crate::error::LoadError;
use crate::material::Light;
use crate::scene::{
    AnimationClip, Frustum, Instant, Interpolation, Local, Node, OwnCamera, Property, Rig, SceneCamera, Skin,
    Track, Trs, unit_quat, world_poses,
};

/// The file's nodes, reordered.
pub(super) struct Tree {
    pub nodes: Vec<Node>,
    /// For each node of the file its index in `nodes`.
    pub place: Vec<usize>,
    /// For each node of the file whether the default scene shows it.
    pub in_scene: Vec<bool>,
}

pub(super) fn tree(document: &Document) -> Result<Tree, LoadError> {
    let nodes = &document.root.nodes;
    let parents = parents(document)?;
    let order = order(document, &parents)?;
    let mut place = vec![0; nodes.len()];
    order.iter().enumerate().for_each(|(at, node)| place[*node] = at);
    let mut ordered = Vec::with_capacity(nodes.len());
    for &index in &order {
        let node = &nodes[index];
        let local = local(node).ok_or_else(|| {
            let message = "its transform has a value that is NaN or infinite, or a matrix that is not affine";
            document.source.broken(format!("nodes[{index}]"), format!("{message}: export it again"))
        })?;
        let name = node.name.clone().unwrap_or_else(|| format!("node {index}"));
        let mut made = Node::new(name, parents[index].map(|parent| place[parent]), local);
        made.weights = node.weights.iter().flatten().map(|weight| f64::from(*weight)).collect();
        ordered.push(made);
    }
    let in_scene = in_scene(document, &parents, &order);
    Ok(Tree { nodes: ordered, place, in_scene })
}

fn children(node: &json::Node) -> impl Iterator<Item = usize> {
    node.children.iter().flatten().map(|child| child.value())
}

fn parents(document: &Document) -> Result<Vec<Option<usize>>, LoadError> {
    let mut parents = vec![None; document.root.nodes.len()];
    for (index, node) in document.root.nodes.iter().enumerate() {
        for child in children(node) {
            if let Some(first) = parents[child].replace(index) {
                let message = format!(
                    "it is a child of nodes {first} and {index}; a node has one parent: export it again"
                );
                return Err(document.source.broken(format!("nodes[{child}]"), message));
            }
        }
    }
    Ok(parents)
}

/// Nodes, parents first. Nodes on a cycle are not reached.
fn order(document: &Document, parents: &[Option<usize>]) -> Result<Vec<usize>, LoadError> {
    let nodes = &document.root.nodes;
    let mut order: Vec<usize> = (0..nodes.len()).filter(|node| parents[*node].is_none()).collect();
    let mut next = 0;
    while let Some(&node) = order.get(next) {
        order.extend(children(&nodes[node]));
        next += 1;
    }
    if order.len() == nodes.len() {
        return Ok(order);
    }
    let mut reached = vec![false; nodes.len()];
    order.iter().for_each(|node| reached[*node] = true);
    let lost = reached.iter().position(|reached| !reached).unwrap_or(0);
    Err(document.source.broken(format!("nodes[{lost}]"), "it is its own ancestor: export it again"))
}

/// The nodes of the default scene, or of the first scene, or all nodes if there is no scene.
fn in_scene(document: &Document, parents: &[Option<usize>], order: &[usize]) -> Vec<bool> {
    let root = &document.root;
    let scene = root.scene.map_or(0, |scene| scene.value());
    let Some(scene) = root.scenes.get(scene) else { return vec![true; root.nodes.len()] };
    let mut shown = vec![false; root.nodes.len()];
    scene.nodes.iter().for_each(|node| shown[node.value()] = true);
    for &node in order {
        shown[node] |= parents[node].is_some_and(|parent| shown[parent]);
    }
    shown
}

fn local(node: &json::Node) -> Option<Local> {
    if let Some(matrix) = &node.matrix {
        let columns = matrix.map(f64::from);
        let column = |at: usize| DVec3::new(columns[4 * at], columns[4 * at + 1], columns[4 * at + 2]);
        let affine = [3, 7, 11, 15].map(|at| columns[at]) == [0.0, 0.0, 0.0, 1.0];
        let map =
            DAffine3 { matrix3: DMat3::from_cols(column(0), column(1), column(2)), translation: column(3) };
        return (affine && map.is_finite()).then_some(Local::Matrix(map));
    }
    let vector = |value: Option<[f32; 3]>, otherwise: DVec3| {
        value.map_or(otherwise, |value| DVec3::from_array(value.map(f64::from)))
    };
    let rotation =
        node.rotation.map_or(DQuat::IDENTITY, |rotation| DQuat::from_array(rotation.0.map(f64::from)));
    let trs = Trs {
        translation: vector(node.translation, DVec3::ZERO),
        rotation: unit_quat(rotation),
        scale: vector(node.scale, DVec3::ONE),
    };
    (trs.translation.is_finite() && rotation.is_finite() && trs.scale.is_finite()).then_some(Local::Trs(trs))
}

pub(super) fn clips(document: &Document, tree: &Tree) -> Result<Vec<AnimationClip>, LoadError> {
    let mut clips = Vec::new();
    for (index, animation) in document.root.animations.iter().enumerate() {
        let mut tracks = Vec::new();
        for number in 0..animation.channels.len() {
            tracks.push(channel(document, tree, [index, number], animation)?);
        }
        let duration_s = tracks.iter().map(|(.., track)| track.end_s()).fold(0.0, f64::max);
        let name = animation.name.clone().unwrap_or_else(|| format!("clip {index}"));
        clips.push(AnimationClip { name, duration_s, tracks });
    }
    Ok(clips)
}

fn channel(
    document: &Document,
    tree: &Tree,
    [clip, number]: [usize; 2],
    animation: &Animation,
) -> Result<(usize, Property, Track), LoadError> {
    let place = format!("animations[{clip}].channels[{number}]");
    let fail = |message: &str| document.source.broken(place.clone(), format!("{message}: export it again"));
    let channel: &Channel = &animation.channels[number];
    let (node, sampler) = (channel.target.node.value(), channel.sampler.value());
    let unknown = |what: &str, index: usize, count: usize| {
        fail(&format!("{what} {index} does not exist (there are {count})"))
    };
    let node = *tree.place.get(node).ok_or_else(|| unknown("node", node, tree.place.len()))?;
    let samplers = &animation.samplers;
    let sampler = samplers.get(sampler).ok_or_else(|| unknown("sampler", sampler, samplers.len()))?;
    let Checked::Valid(path) = channel.target.path else { return Err(fail("it drives an unknown property")) };
    let (property, kind) = match path {
        JsonProperty::Translation => (Property::Translation, Type::Vec3),
        JsonProperty::Rotation => (Property::Rotation, Type::Vec4),
        JsonProperty::Scale => (Property::Scale, Type::Vec3),
        JsonProperty::MorphTargetWeights => (Property::Weights, Type::Scalar),
    };
    let interpolation = match sampler.interpolation {
        Checked::Valid(JsonInterpolation::Step) => Interpolation::Step,
        Checked::Valid(JsonInterpolation::CubicSpline) => Interpolation::CubicSpline,
        Checked::Valid(JsonInterpolation::Linear) => Interpolation::Linear,
        Checked::Invalid => return Err(fail("its interpolation is not known")),
    };
    let times = document.values(sampler.input.value(), &[Type::Scalar], &format!("{place} input"))?;
    let values = document.values(sampler.output.value(), &[kind], &format!("{place} output"))?;
    let parts = if interpolation == Interpolation::CubicSpline { 3 } else { 1 };
    let width = match property {
        // One weight for each target and key, in one long list.
        Property::Weights => values.numbers.len() / (times.count() * parts).max(1),
        _ => values.width,
    };
    let track =
        Track::new(times.numbers, values.numbers, width, interpolation).map_err(|what| fail(&what))?;
    Ok((node, property, track))
}

pub(super) fn skins(document: &Document, tree: &Tree) -> Result<Vec<Skin>, LoadError> {
    let mut skins = Vec::new();
    for (index, skin) in document.root.skins.iter().enumerate() {
        let place = format!("skins[{index}]");
        let fail =
            |message: String| document.source.broken(place.clone(), format!("{message}: export it again"));
        let joints: Vec<usize> = skin.joints.iter().map(|joint| tree.place[joint.value()]).collect();
        let inverse_bind = match skin.inverse_bind_matrices {
            Some(accessor) => {
                let values = document.values(
                    accessor.value(),
                    &[Type::Mat4],
                    &format!("{place} inverse bind matrices"),
                )?;
                values.elements().map(affine).collect()
            }
            None => vec![DAffine3::IDENTITY; joints.len()],
        };
        if inverse_bind.len() < joints.len() {
            return Err(fail(format!(
                "{} inverse bind matrices for {} joints",
                inverse_bind.len(),
                joints.len()
            )));
        }
        if let Some(bad) = inverse_bind.iter().position(|matrix| !matrix.is_finite()) {
            return Err(fail(format!("inverse bind matrix {bad} has a value that is NaN or infinite")));
        }
        skins.push(Skin { joints, inverse_bind });
    }
    Ok(skins)
}

/// A column-major 4x4 matrix whose last row is known to be 0, 0, 0, 1 (glTF 2.0, 3.7.3.1).
fn affine(columns: &[f64]) -> DAffine3 {
    let number = |at: usize| columns.get(at).copied().unwrap_or(0.0);
    let column = |at: usize| DVec3::new(number(4 * at), number(4 * at + 1), number(4 * at + 2));
    DAffine3 { matrix3: DMat3::from_cols(column(0), column(1), column(2)), translation: column(3) }
}

/// The usable cameras of the default scene, and its first directional light or a default one.
pub(super) fn view(document: &Document, tree: &Tree, warnings: &mut Vec<Warning>) -> (Vec<OwnCamera>, Light) {
    (cameras(document, tree, warnings), light(document, tree, warnings))
}

fn at_node(index: usize, node: &json::Node) -> String {
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

/// How much the camera sees and its near depth. The image has its own width, so the file's aspect ratio or
/// `xmag` does not count (glTF 2.0, 3.10.3); an orthographic near plane at zero, which it allows, is left to
/// the scene.
fn seen(camera: &Camera) -> Option<(Frustum, Option<f64>)> {
    match (&camera.type_, &camera.perspective, &camera.orthographic) {
        (Checked::Valid(CameraType::Perspective), Some(lens), _) => {
            let usable = lens.yfov > 0.0 && lens.yfov < 3.1 && lens.znear > 0.0;
            let tan_half_height = libm::tan(f64::from(lens.yfov) / 2.0);
            usable.then_some((Frustum::Perspective { tan_half_height }, Some(f64::from(lens.znear))))
        }
        (Checked::Valid(CameraType::Orthographic), _, Some(lens)) => {
            let usable = lens.ymag > 0.0 && lens.ymag.is_finite() && lens.znear >= 0.0;
            let near = (lens.znear > 0.0).then_some(f64::from(lens.znear));
            usable.then_some((Frustum::Orthographic { half_height: f64::from(lens.ymag) }, near))
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

/// The lamp has the file's direction and hue. Its intensity is ignored, because there is no exposure.
fn lamp(toward: DVec3, color: [f32; 3]) -> Light {
    let plain = Light::default();
    let hue = Vec3::from_array(color.map(|part| if part.is_finite() { part.clamp(0.0, 1.0) } else { 1.0 }));
    let brightest = hue.max_element();
    let hue = if brightest > 0.0 { hue * (1.0 / brightest) } else { Vec3::ONE };
    let toward = toward * (1.0 / toward.length());
    Light { toward: Some(toward.as_vec3()), color: hue * plain.color.max_element(), ..plain }
}
