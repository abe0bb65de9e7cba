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

    /// Checks every index, so that nothing later has to.
    ///
    /// # Errors
    /// In words, the first one that is out of range, or lists of joints and weights that do not fit.
    pub fn check(&self) -> Result<(), String> {
        let nodes = self.nodes.len();
        for (index, node) in self.nodes.iter().enumerate() {
            ensure(node.parent.is_none_or(|parent| parent < index), || {
                format!("node {index} does not come after its parent")
            })?;
        }
        for instance in &self.instances {
            let skinned = instance.skin.is_none_or(|skin| skin < self.skins.len());
            ensure(instance.node < nodes && instance.mesh < self.meshes.len() && skinned, || {
                format!("{instance:?} names something that is not there")
            })?;
        }
        for mesh in &self.meshes {
            ensure(mesh.material < self.materials.len(), || {
                format!("mesh `{}` has no material {}", mesh.name, mesh.material)
            })?;
            let fits = mesh.influences.as_ref().is_none_or(|influences| {
                let due = mesh.positions.len() * influences.per_vertex;
                influences.joints.len() == due && influences.weights.len() == due
            });
            ensure(fits, || format!("mesh `{}` has joints or weights for other vertices", mesh.name))?;
        }
        Ok(())
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
            [&channels.translation, &channels.rotation, &channels.scale, &channels.weights]
                .into_iter()
                .flatten()
        });
        tracks.map(super::track::Track::end_s).fold(0.0, f64::max)
    }
}

fn ensure(holds: bool, message: impl FnOnce() -> String) -> Result<(), String> {
    if holds { Ok(()) } else { Err(message()) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Local, Trs};

    #[test]
    fn graphs_with_loose_ends_are_refused() {
        let mesh = || Mesh::new("m", vec![glam::Vec3::ZERO; 3], vec![[0, 1, 2]], 0).unwrap();
        let mut graph = Graph::default();
        let node = graph.push_node(Node::new("n", None, Local::Trs(Trs::default())));
        graph.hang(mesh(), node);
        assert!(graph.check().unwrap_err().contains("material 0"));
        graph.push_material(Material::colored("grey", glam::Vec3::ONE));
        assert!(graph.check().is_ok());
        graph.hang(mesh(), 7);
        assert!(graph.check().is_err());
        graph.instances.pop();
        graph.nodes[0].parent = Some(0);
        assert!(graph.check().is_err());
    }
}
