//! glTF 2.0, as `.gltf` with files or data URIs beside it and as `.glb`.
//!
//! The crate `gltf` parses and checks the JSON; whether accessors fit their buffers it does not check, and some
//! of its readers panic where they do not, so buffers and accessors are read here.

mod document;
mod materials;
mod nodes;
mod primitive;

use std::path::Path;

use warnings::Warning;

use crate::error::{LoadError, Source};
use crate::scene::far::Bounds;
use crate::scene::{Clip, Instance, Mesh, Parts};
use document::Document;
use materials::Used;

/// Source of the materials.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Looks {
    /// The file's materials.
    Own,
    /// Other materials. Those of the file are not read and cause no warnings.
    Replaced,
}

/// Reads the file at `path` and selects the clip named `clip`, or the first.
pub(super) fn import(path: &Path, clip: Option<&str>, looks: Looks) -> Result<Parts, LoadError> {
    let source = Source { path };
    let document = Document::read(source)?;
    let tree = nodes::tree(&document)?;
    let used = Used::new(&document, &tree, looks);
    let mut parts = Parts::new(path.display().to_string());
    parts.clips = nodes::clips(&document, &tree)?;
    parts.graph.skins = nodes::skins(&document, &tree)?;
    parts.graph.materials = materials::materials(&document, &used, &mut parts.warnings);
    let of_mesh = meshes(&document, &used, &mut parts)?;
    parts.graph.instances = instances(&document, &tree, &of_mesh, &parts.graph)?;
    (parts.cameras, parts.light) = nodes::view(&document, &tree, &mut parts.warnings);
    parts.camera = parts.cameras.first().map(|own| own.camera.clone()).unwrap_or_default();
    parts.graph.nodes = tree.nodes;
    if !parts.clips.is_empty() {
        let chosen = clip.map_or(Ok(0), |wanted| Clip::find(&parts.clips, wanted))?;
        parts.clips[chosen].play(&mut parts.graph.nodes);
    } else if let Some(wanted) = clip {
        Clip::find(&parts.clips, wanted)?;
    }
    Ok(parts)
}

/// Reads all primitives as meshes; returns the range of meshes for each glTF mesh.
fn meshes(
    document: &Document,
    used: &Used,
    parts: &mut Parts,
) -> Result<Vec<std::ops::Range<usize>>, LoadError> {
    let (graph, mut warnings) = (&mut parts.graph, Vec::new());
    let mut alpha = vec![1.0_f32; graph.materials.len()];
    let mut ranges = Vec::new();
    for mesh in 0..document.root.meshes.len() {
        let first = graph.meshes.len();
        for index in 0..document.root.meshes[mesh].primitives.len() {
            let read = primitive::read(document, [mesh, index], &mut graph.materials, &mut warnings)?;
            if let Some(primitive::Read { mesh: made, least_alpha }) = read {
                warnings.extend(rounded(&made));
                if let Some(alpha) = alpha.get_mut(made.material) {
                    *alpha = alpha.min(least_alpha);
                }
                graph.meshes.push(made);
            }
        }
        // Meshes without a node in the scene do not change the image.
        if used.meshes[mesh] {
            parts.warnings.append(&mut warnings);
        }
        warnings.clear();
        ranges.push(first..graph.meshes.len());
    }
    parts.warnings.extend(materials::left_out(document, used, &graph.materials, &alpha));
    Ok(ranges)
}

/// Warns if the coordinates of a mesh are too large for f32 in its local space.
fn rounded(mesh: &Mesh) -> Option<Warning> {
    Bounds::of(mesh.positions.iter().map(|point| point.as_dvec3())).rounded(&mesh.name)
}

fn instances(
    document: &Document,
    tree: &nodes::Tree,
    of_mesh: &[std::ops::Range<usize>],
    graph: &crate::scene::Graph,
) -> Result<Vec<Instance>, LoadError> {
    let mut instances = Vec::new();
    for (index, node) in document.root.nodes.iter().enumerate() {
        let (Some(mesh), true) = (node.mesh, tree.in_scene[index]) else { continue };
        for mesh in of_mesh.get(mesh.value()).cloned().unwrap_or_default() {
            let skin = node.skin.map(|skin| skin.value()).filter(|_| graph.meshes[mesh].influences.is_some());
            if let Some(skin) = skin {
                check_joints(document, index, &graph.meshes[mesh], graph.skins[skin].joints.len())?;
            }
            instances.push(Instance { node: tree.place[index], mesh, skin, clip: pipeline::Clip::NONE });
        }
    }
    // Joint influences need a skin.
    Ok(instances)
}

fn check_joints(document: &Document, node: usize, mesh: &Mesh, joints: usize) -> Result<(), LoadError> {
    let highest = mesh.influences.iter().flat_map(|influences| &influences.joints).max();
    match highest {
        Some(&highest) if usize::from(highest) >= joints => Err(document.source.broken(
            format!("node {node}, mesh `{}`", mesh.name),
            format!("a vertex uses joint {highest}, but the skin has only {joints}: export it again"),
        )),
        _ => Ok(()),
    }
}
