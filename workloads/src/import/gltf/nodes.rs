//! The node hierarchy, put in an order in which parents come before their children.

use glam::{DAffine3, DMat3, DQuat, DVec3};
use gltf::json;

use super::document::Document;
use crate::error::LoadError;
use crate::scene::{Local, Node, Trs, unit_quat};

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

/// Nodes, parents first; those on a cycle are never reached.
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

/// Without a default scene the first one is shown; without any scene everything is.
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
