//! The node hierarchy: where things are and how they move.

use glam::{DAffine3, DQuat, DVec3};

use super::track::{Instant, Track, rotation};

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

/// A node's transform to its parent where nothing animates it.
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

/// Endless motion on top of the channels.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Motion {
    /// Scene units per second, in the parent's axes.
    pub velocity: DVec3,
    /// Turning about an axis of the node itself.
    pub spin: Option<Spin>,
}

/// Steady turning.
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

/// A node: a place in its parent that may move, and weights for a mesh that hangs there.
#[derive(Clone, Debug, PartialEq)]
pub struct Node {
    /// Name for messages.
    pub name: String,
    /// Index of the parent, always smaller than the node's own.
    pub parent: Option<usize>,
    /// The transform where nothing animates it.
    pub local: Local,
    /// Tracks that replace parts of it.
    pub channels: Channels,
    /// Endless motion on top.
    pub motion: Motion,
    /// Weights of the morph targets where no track gives them; empty for the mesh's own.
    pub weights: Vec<f64>,
}

impl Node {
    /// A node that rests at `local` in `parent`.
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

/// For every node whether it moves in the world, by itself or with an ancestor.
pub fn movers(nodes: &[Node]) -> Vec<bool> {
    let mut moving: Vec<bool> = Vec::with_capacity(nodes.len());
    for node in nodes {
        let carried = node.parent.and_then(|parent| moving.get(parent)).copied().unwrap_or(false);
        moving.push(carried || node.moves());
    }
    moving
}

#[cfg(test)]
mod tests {
    use super::*;

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
