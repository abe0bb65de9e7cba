//! glTF 2.0, as `.gltf` with files or data URIs beside it and as `.glb`.
//!
//! The crate `gltf` parses and checks the JSON; whether accessors fit their buffers it does not check, and some
//! of its readers panic where they do not, so buffers and accessors are read here.

mod accessor;
mod buffers;
mod clips;
mod document;
mod materials;
mod nodes;
mod primitive;
mod view;

use std::path::Path;

use activity::Warning;

use crate::error::{LoadError, Source};
use crate::scene::{Instance, Mesh, Parts, clip};
use document::Document;

/// Reads the file at `path` and plays the clip called `clip`, or the first.
pub(super) fn import(path: &Path, clip: Option<&str>) -> Result<Parts, LoadError> {
    let source = Source { path };
    let document = Document::read(source)?;
    let mut warnings = Vec::new();
    let tree = nodes::tree(&document)?;
    let mut parts = Parts::new(path.display().to_string());
    parts.clips = clips::clips(&document, &tree)?;
    parts.graph.skins = clips::skins(&document, &tree)?;
    parts.graph.materials = materials::materials(&document, &mut warnings);
    let (meshes, of_mesh) = meshes(&document, &mut parts.graph.materials, &mut warnings)?;
    parts.graph.meshes = meshes;
    parts.graph.instances = instances(&document, &tree, &of_mesh, &parts.graph)?;
    (parts.camera, parts.light) = view::view(&document, &tree, &mut warnings);
    parts.graph.nodes = tree.nodes;
    if !parts.clips.is_empty() {
        let chosen = clip.map_or(Ok(0), |wanted| clip::find(&parts.clips, wanted))?;
        clip::play(&mut parts.graph.nodes, &parts.clips[chosen]);
    } else if let Some(wanted) = clip {
        clip::find(&parts.clips, wanted)?;
    }
    warnings.dedup();
    parts.warnings = warnings;
    Ok(parts)
}

/// All primitives as meshes, and for each glTF mesh the range of its own.
fn meshes(
    document: &Document,
    materials: &mut Vec<crate::Material>,
    warnings: &mut Vec<Warning>,
) -> Result<(Vec<Mesh>, Vec<std::ops::Range<usize>>), LoadError> {
    let mut all = Vec::new();
    let mut ranges = Vec::new();
    for mesh in 0..document.root.meshes.len() {
        let first = all.len();
        for index in 0..document.root.meshes[mesh].primitives.len() {
            all.extend(primitive::read(document, [mesh, index], materials, warnings)?);
        }
        ranges.push(first..all.len());
    }
    Ok((all, ranges))
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
            instances.push(Instance { node: tree.place[index], mesh, skin });
        }
    }
    // Without a skin, joint influences mean nothing.
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
