//! Everything in a scene that has a shape: nodes, meshes, skins, materials and what hangs where.

use super::mesh::{Instance, Mesh, Skin};
use super::node::{Node, movers};
use crate::material::Material;

/// Nodes in order (parents first), and what they carry.
#[derive(Clone, Debug, Default)]
pub struct Graph {
    /// Nodes; a parent comes before its children.
    pub nodes: Vec<Node>,
    /// Meshes.
    pub meshes: Vec<Mesh>,
    /// Which mesh hangs on which node.
    pub instances: Vec<Instance>,
    /// Skins.
    pub skins: Vec<Skin>,
    /// Materials.
    pub materials: Vec<Material>,
}

impl Graph {
    /// Adds a node and gives its index.
    pub fn push_node(&mut self, node: Node) -> usize {
        self.nodes.push(node);
        self.nodes.len() - 1
    }

    /// Adds a material and gives its index.
    pub fn push_material(&mut self, material: Material) -> usize {
        self.materials.push(material);
        self.materials.len() - 1
    }

    /// Hangs a mesh on a node.
    pub fn hang(&mut self, mesh: Mesh, node: usize) {
        self.meshes.push(mesh);
        self.instances.push(Instance { node, mesh: self.meshes.len() - 1, skin: None });
    }

    /// Takes in all of `other` as children of `parent`.
    pub fn adopt(&mut self, other: Self, parent: usize) {
        let (nodes, meshes) = (self.nodes.len(), self.meshes.len());
        let (skins, materials) = (self.skins.len(), self.materials.len());
        self.nodes.extend(other.nodes.into_iter().map(|mut node| {
            node.parent = Some(node.parent.map_or(parent, |index| index + nodes));
            node
        }));
        self.meshes.extend(other.meshes.into_iter().map(|mut mesh| {
            mesh.material += materials;
            mesh
        }));
        self.instances.extend(other.instances.into_iter().map(|instance| Instance {
            node: instance.node + nodes,
            mesh: instance.mesh + meshes,
            skin: instance.skin.map(|skin| skin + skins),
        }));
        self.skins.extend(other.skins.into_iter().map(|mut skin| {
            skin.joints.iter_mut().for_each(|joint| *joint += nodes);
            skin
        }));
        self.materials.extend(other.materials);
    }

    /// Triangles of all instances.
    pub fn triangle_count(&self) -> usize {
        self.instances.iter().map(|instance| self.meshes[instance.mesh].triangles.len()).sum()
    }

    /// Vertices of all instances.
    pub fn vertex_count(&self) -> usize {
        self.instances.iter().map(|instance| self.meshes[instance.mesh].positions.len()).sum()
    }

    /// For each instance whether its vertices depend on time.
    pub fn moving_instances(&self) -> Vec<bool> {
        let moving = movers(&self.nodes);
        let moves = |node: &usize| moving.get(*node).copied().unwrap_or(false);
        let of = |instance: &Instance| {
            let carried = match instance.skin.and_then(|skin| self.skins.get(skin)) {
                Some(skin) => skin.joints.iter().any(moves),
                None => moves(&instance.node),
            };
            carried || self.nodes[instance.node].channels.weights.is_some()
        };
        self.instances.iter().map(of).collect()
    }

    /// Time of the last key of any track, in seconds; zero where there is none.
    pub fn last_key_s(&self) -> f64 {
        let tracks = self.nodes.iter().flat_map(|node| {
            let channels = &node.channels;
            [&channels.translation, &channels.rotation, &channels.scale, &channels.weights].into_iter().flatten()
        });
        tracks.map(super::track::Track::end_s).fold(0.0, f64::max)
    }
}
