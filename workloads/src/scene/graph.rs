//! The scene graph: nodes and their motion, meshes, skins, materials, instances and animation clips.

use glam::{DAffine3, DQuat, DVec3};

use super::mesh::{Instance, Mesh, Skin};
use super::track::{Instant, Track, rotation};
use crate::error::LoadError;
use crate::material::Material;

/// Nodes, parents first, and their meshes, skins and materials.
#[derive(Clone, Debug, Default)]
pub struct Graph {
    /// Nodes; a parent comes before its children.
    pub nodes: Vec<Node>,
    /// Meshes.
    pub meshes: Vec<Mesh>,
    /// Instances: meshes on nodes.
    pub instances: Vec<Instance>,
    /// Skins.
    pub skins: Vec<Skin>,
    /// Materials.
    pub materials: Vec<Material>,
}

impl Graph {
    /// Adds a node and returns its index.
    pub fn push_node(&mut self, node: Node) -> usize {
        self.nodes.push(node);
        self.nodes.len() - 1
    }

    /// Adds a material and returns its index.
    pub fn push_material(&mut self, material: Material) -> usize {
        self.materials.push(material);
        self.materials.len() - 1
    }

    /// Adds a mesh as an instance on a node.
    pub fn attach(&mut self, mesh: Mesh, node: usize) {
        self.meshes.push(mesh);
        self.instances.push(Instance {
            node,
            mesh: self.meshes.len() - 1,
            skin: None,
            clip: pipeline::Clip::NONE,
        });
    }

    /// Adds all of `other` as children of `parent`.
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
            ..instance
        }));
        self.skins.extend(other.skins.into_iter().map(|mut skin| {
            skin.joints.iter_mut().for_each(|joint| *joint += nodes);
            skin
        }));
        self.materials.extend(other.materials);
    }

    /// Checks every index, once for all later uses.
    ///
    /// # Errors
    /// A message about the first index out of range, or about lists of joints and weights of wrong length.
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
                format!("{instance:?} has an index out of range")
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

    /// For each instance, whether its vertices depend on time.
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

    /// Time of the last key of any track, in seconds; zero without keys.
    pub fn last_key_s(&self) -> f64 {
        let tracks = self.nodes.iter().flat_map(|node| {
            let channels = &node.channels;
            [&channels.translation, &channels.rotation, &channels.scale, &channels.weights]
                .into_iter()
                .flatten()
        });
        tracks.map(Track::end_s).fold(0.0, f64::max)
    }
}

fn ensure(holds: bool, message: impl FnOnce() -> String) -> Result<(), String> {
    if holds { Ok(()) } else { Err(message()) }
}

/// Translation, rotation and scale, applied to a point in the opposite order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trs {
    /// Translation in scene units.
    pub translation: DVec3,
    /// Rotation, a unit quaternion.
    pub rotation: DQuat,
    /// Scale along each axis.
    pub scale: DVec3,
}

impl Default for Trs {
    fn default() -> Self {
        Self { translation: DVec3::ZERO, rotation: DQuat::IDENTITY, scale: DVec3::ONE }
    }
}

/// Transform of a node to its parent, without animation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Local {
    /// Any affine map; such a node takes no channels.
    Matrix(DAffine3),
    /// Translation, rotation and scale, each of which a channel can replace.
    Trs(Trs),
}

/// Tracks that replace parts of a node's transform.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Channels {
    /// Translation in scene units.
    pub translation: Option<Track>,
    /// Rotation, quaternions `x, y, z, w`.
    pub rotation: Option<Track>,
    /// Scale.
    pub scale: Option<Track>,
    /// Weights of the morph targets of the node's mesh.
    pub weights: Option<Track>,
}

/// Constant motion, in addition to the channels.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Motion {
    /// Scene units per second, in the parent's axes.
    pub velocity: DVec3,
    /// Rotation about an axis of the node itself.
    pub spin: Option<Spin>,
}

/// Constant rotation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spin {
    axis: DVec3,
    rate_hz: f64,
}

impl Spin {
    /// Turning about `axis` at `rate_hz` turns a second, right-handed; `None` where the axis has no length or
    /// something is not finite.
    pub fn new(axis: DVec3, rate_hz: f64) -> Option<Self> {
        let length = axis.length();
        let usable = length.is_finite() && length > 0.0 && rate_hz.is_finite();
        usable.then(|| Self { axis: axis / length, rate_hz })
    }
}

/// A node: a transform to its parent that may depend on time, and morph weights for the meshes on it.
#[derive(Clone, Debug, PartialEq)]
pub struct Node {
    /// Name for messages.
    pub name: String,
    /// Index of the parent, always smaller than the node's own.
    pub parent: Option<usize>,
    /// Transform without animation.
    pub local: Local,
    /// Tracks that replace parts of the transform.
    pub channels: Channels,
    /// Constant motion, in addition.
    pub motion: Motion,
    /// Weights of the morph targets where no track gives them; empty for the mesh's own.
    pub weights: Vec<f64>,
}

impl Node {
    /// A still node with the transform `local` in `parent`.
    pub fn new(name: impl Into<String>, parent: Option<usize>, local: Local) -> Self {
        Self {
            name: name.into(),
            parent,
            local,
            channels: Channels::default(),
            motion: Motion::default(),
            weights: Vec::new(),
        }
    }

    /// Whether the transform depends on time.
    pub fn moves(&self) -> bool {
        let channels = &self.channels;
        let animated =
            [&channels.translation, &channels.rotation, &channels.scale].iter().any(|track| track.is_some());
        animated || self.motion != Motion::default()
    }

    /// Node to parent at `at`.
    pub fn to_parent(&self, at: Instant) -> DAffine3 {
        let mut trs = match self.local {
            Local::Matrix(matrix) if !self.moves() => return matrix,
            Local::Matrix(matrix) => {
                return DAffine3::from_translation(self.drift(at)) * matrix * self.spun(at);
            }
            Local::Trs(trs) => trs,
        };
        if let Some(track) = &self.channels.translation {
            trs.translation = track.vec3(at);
        }
        if let Some(track) = &self.channels.rotation {
            trs.rotation = track.quat(at);
        }
        if let Some(track) = &self.channels.scale {
            trs.scale = track.vec3(at);
        }
        trs.translation += self.drift(at);
        if let Some(spin) = self.motion.spin {
            trs.rotation *= rotation(spin.axis, spin.rate_hz * at.time_s());
        }
        DAffine3::from_scale_rotation_translation(trs.scale, trs.rotation, trs.translation)
    }

    fn drift(&self, at: Instant) -> DVec3 {
        self.motion.velocity * at.time_s()
    }

    fn spun(&self, at: Instant) -> DAffine3 {
        let turn = |spin: Spin| DAffine3::from_quat(rotation(spin.axis, spin.rate_hz * at.time_s()));
        self.motion.spin.map_or(DAffine3::IDENTITY, turn)
    }
}

/// Node to world for every node at `at`; parents come before their children.
pub fn world_poses(nodes: &[Node], at: Instant) -> Vec<DAffine3> {
    let mut worlds: Vec<DAffine3> = Vec::with_capacity(nodes.len());
    for node in nodes {
        let local = node.to_parent(at);
        let parent = node.parent.and_then(|parent| worlds.get(parent));
        worlds.push(parent.map_or(local, |parent| *parent * local));
    }
    worlds
}

/// For every node, whether it moves in the world, by itself or with an ancestor.
pub fn movers(nodes: &[Node]) -> Vec<bool> {
    let mut moving: Vec<bool> = Vec::with_capacity(nodes.len());
    for node in nodes {
        let carried = node.parent.and_then(|parent| moving.get(parent)).copied().unwrap_or(false);
        moving.push(carried || node.moves());
    }
    moving
}

/// Property that a track drives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Property {
    /// Translation of a node.
    Translation,
    /// Rotation of a node.
    Rotation,
    /// Scale of a node.
    Scale,
    /// Weights of the morph targets of the node's mesh.
    Weights,
}

/// An animation clip: tracks that play together in a loop.
#[derive(Clone, Debug, PartialEq)]
pub struct AnimationClip {
    /// Name; `clip 0` and so on if the file has none.
    pub name: String,
    /// Time in seconds of the last key of any track, where the clip repeats.
    pub duration_s: f64,
    /// Node, property and track.
    pub tracks: Vec<(usize, Property, Track)>,
}

impl AnimationClip {
    /// Index of the clip with the name or the number `wanted`.
    pub(crate) fn find(clips: &[Self], wanted: &str) -> Result<usize, LoadError> {
        let by_name = clips.iter().position(|clip| clip.name == wanted);
        let by_number = || wanted.parse().ok().filter(|index: &usize| *index < clips.len());
        by_name.or_else(by_number).ok_or_else(|| {
            let names: Vec<&str> = clips.iter().map(|clip| clip.name.as_str()).collect();
            let known = if names.is_empty() {
                "the scene has no animation clips; leave it out".to_owned()
            } else {
                activity::spec::suggestion(wanted, &names)
            };
            LoadError::Setting { setting: "clip", message: format!("unknown clip `{wanted}`: {known}") }
        })
    }

    /// Makes the clip drive the nodes, instead of any other.
    pub(crate) fn play(&self, nodes: &mut [Node]) {
        nodes.iter_mut().for_each(|node| node.channels = Channels::default());
        for (node, property, track) in &self.tracks {
            let Some(node) = nodes.get_mut(*node) else { continue };
            let track = Some(track.clone().looping(self.duration_s));
            let fixed = matches!(node.local, Local::Matrix(_));
            match property {
                Property::Weights => node.channels.weights = track,
                _ if fixed => {}
                Property::Translation => node.channels.translation = track,
                Property::Rotation => node.channels.rotation = track,
                Property::Scale => node.channels.scale = track,
            }
        }
    }
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
        graph.attach(mesh(), node);
        assert!(graph.check().unwrap_err().contains("material 0"));
        graph.push_material(Material::colored("grey", glam::Vec3::ONE));
        assert!(graph.check().is_ok());
        graph.attach(mesh(), 7);
        assert!(graph.check().is_err());
        graph.instances.pop();
        graph.nodes[0].parent = Some(0);
        assert!(graph.check().is_err());
    }

    fn at(open_s: f64) -> Instant {
        Instant { open_s, offset_s: 0.0 }
    }

    #[test]
    fn a_spinning_node_on_an_arm_describes_a_circle() {
        let mut hub = Node::new("hub", None, Local::Trs(Trs::default()));
        hub.motion.spin = Spin::new(DVec3::new(0.0, 3.0, 0.0), 2.0);
        let arm = Trs { translation: DVec3::new(1.5, 0.0, 0.0), ..Trs::default() };
        let nodes = [hub, Node::new("tip", Some(0), Local::Trs(arm))];
        for step in 0..10 {
            let time = f64::from(step) * 0.037;
            let angle = std::f64::consts::TAU * 2.0 * time;
            let expected = DVec3::new(1.5 * angle.cos(), 0.0, -1.5 * angle.sin());
            let tip = world_poses(&nodes, at(time))[1].translation;
            assert!((tip - expected).length() < 1e-12);
        }
        assert_eq!(movers(&nodes), [true, true]);
    }

    #[test]
    fn a_drifting_node_goes_straight_and_a_still_one_stays_to_the_bit() {
        let mut drifting = Node::new("d", None, Local::Trs(Trs::default()));
        drifting.motion.velocity = DVec3::new(4.0, 0.0, -2.0);
        let nodes =
            [drifting, Node::new("still", None, Local::Matrix(DAffine3::from_scale(DVec3::splat(0.1))))];
        assert_eq!(world_poses(&nodes, at(0.5))[0].translation, DVec3::new(2.0, 0.0, -1.0));
        assert_eq!(world_poses(&nodes, at(0.1))[1], world_poses(&nodes, at(7.3))[1]);
        assert_eq!(movers(&nodes), [true, false]);
    }

    #[test]
    fn a_spin_without_an_axis_cannot_be_built() {
        assert!(Spin::new(DVec3::ZERO, 1.0).is_none());
        assert!(Spin::new(DVec3::X, f64::NAN).is_none());
    }
}
