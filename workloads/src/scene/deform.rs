//! Vertices of an instance at one time: morphed, then transformed by its node or by a blend of its joints.

use glam::{DAffine3, DMat3, DVec3};

use super::graph::{Graph, world_poses};
use super::mesh::{Bounds, Influences, Instance, Mesh, Normals, unit};
use super::track::Instant;

/// Poses of all nodes and morph weights at one time.
pub(super) struct Pose {
    at: Instant,
    /// Origin of the transforms, in the coordinates of the scene's files.
    pub origin: DVec3,
    worlds: Vec<DAffine3>,
}

/// Transforms of the vertices of one instance at one time.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct InstanceTransforms {
    /// One matrix for a rigid instance, one for each joint of a skinned one.
    matrices: Vec<DAffine3>,
    weights: Vec<f64>,
}

impl Pose {
    /// The pose of `graph` at time `at`, relative to `origin`.
    pub fn new(graph: &Graph, at: Instant, origin: DVec3) -> Self {
        let mut worlds = world_poses(&graph.nodes, at);
        worlds.iter_mut().for_each(|world| world.translation -= origin);
        Self { at, origin, worlds }
    }

    /// Node to world, relative to the origin of the pose.
    pub fn world(&self, node: usize) -> DAffine3 {
        self.worlds.get(node).copied().unwrap_or(DAffine3::IDENTITY)
    }

    pub fn transforms(&self, graph: &Graph, instance: Instance) -> InstanceTransforms {
        let skin = instance.skin.and_then(|skin| graph.skins.get(skin));
        let matrices = match skin {
            Some(skin) => {
                let joints = skin.joints.iter().zip(&skin.inverse_bind);
                joints.map(|(joint, bind)| self.world(*joint) * *bind).collect()
            }
            None => vec![self.world(instance.node)],
        };
        InstanceTransforms { matrices, weights: self.weights(graph, instance) }
    }

    fn weights(&self, graph: &Graph, instance: Instance) -> Vec<f64> {
        let node = &graph.nodes[instance.node];
        match &node.channels.weights {
            Some(track) => track.sample(self.at),
            None if node.weights.is_empty() => graph.meshes[instance.mesh].weights.clone(),
            None => node.weights.clone(),
        }
    }
}

impl InstanceTransforms {
    /// Whether a rigid transform mirrors the mesh, so that the winding of its triangles has to be reversed.
    pub fn mirrors(&self) -> bool {
        matches!(&self.matrices[..], [matrix] if matrix.matrix3.determinant() < 0.0)
    }

    /// Bounding box of the transformed vertices, from the bounding box `bounded` at rest; morph targets are ignored.
    pub fn place(&self, bounded: &Bounds, into: &mut Bounds) {
        self.matrices.iter().for_each(|matrix| into.add_placed(bounded, matrix));
    }

    /// World position of vertex `index`.
    pub fn position(&self, mesh: &Mesh, index: usize) -> DVec3 {
        let mut place = mesh.positions[index].as_dvec3();
        for (target, weight) in mesh.targets.iter().zip(&self.weights) {
            if let Some(offset) = target.positions.get(index) {
                place += *weight * offset.as_dvec3();
            }
        }
        self.blend(mesh, index, |matrix| matrix.transform_point3(place))
    }

    /// Unit world normal of vertex `index`, if the mesh stores normals.
    pub fn normal(&self, mesh: &Mesh, index: usize, cofactors: &[DMat3]) -> Option<glam::Vec3> {
        let Normals::Given(normals) = &mesh.normals else { return None };
        let mut normal = normals.get(index)?.as_dvec3();
        for (target, weight) in mesh.targets.iter().zip(&self.weights) {
            if let Some(change) = target.normals.get(index) {
                normal += *weight * change.as_dvec3();
            }
        }
        let turned = match &mesh.influences {
            Some(influences) => influences.sum(index, cofactors.len(), |joint| cofactors[joint] * normal),
            None => cofactors.first().map_or(normal, |cofactor| *cofactor * normal),
        };
        Some(unit(turned))
    }

    /// For each transform, the matrix of normals.
    pub fn cofactors(&self) -> Vec<DMat3> {
        self.matrices.iter().map(|matrix| cofactor(matrix.matrix3)).collect()
    }

    fn blend(&self, mesh: &Mesh, index: usize, place: impl Fn(&DAffine3) -> DVec3) -> DVec3 {
        match &mesh.influences {
            Some(influences) => {
                influences.sum(index, self.matrices.len(), |joint| place(&self.matrices[joint]))
            }
            None => self.matrices.first().map_or(DVec3::ZERO, place),
        }
    }
}

impl Influences {
    /// Sum over the joints of vertex `index`. Importers check that every joint is below `joints`; an instance
    /// whose skin has fewer ignores the others.
    fn sum(&self, index: usize, joints: usize, of: impl Fn(usize) -> DVec3) -> DVec3 {
        let span = index * self.per_vertex..(index + 1) * self.per_vertex;
        let mut total = DVec3::ZERO;
        for (joint, weight) in self.joints[span.clone()].iter().zip(&self.weights[span]) {
            let joint = usize::from(*joint);
            if *weight != 0.0 && joint < joints {
                total += f64::from(*weight) * of(joint);
            }
        }
        total
    }
}

/// The transpose of the inverse up to a positive factor, without division, so that flat meshes work, too.
fn cofactor(m: DMat3) -> DMat3 {
    let sign = if m.determinant() < 0.0 { -1.0 } else { 1.0 };
    DMat3::from_cols(
        sign * m.y_axis.cross(m.z_axis),
        sign * m.z_axis.cross(m.x_axis),
        sign * m.x_axis.cross(m.y_axis),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DQuat;

    #[test]
    fn normals_stay_normal_under_uneven_scale_and_mirrors() {
        let tangent = DVec3::new(1.0, -1.0, 0.0);
        let normal = DVec3::new(1.0, 1.0, 0.0);
        for scale in [DVec3::new(2.0, 0.5, 3.0), DVec3::new(-1.0, 1.0, 1.0), DVec3::new(1.0, 0.0, 1.0)] {
            let m = DMat3::from_quat(DQuat::from_xyzw(0.5, 0.5, 0.5, 0.5)) * DMat3::from_diagonal(scale);
            let turned = cofactor(m) * normal;
            assert!((m * tangent).dot(turned).abs() < 1e-12);
            assert!(scale.y == 0.0 || (m * normal).dot(turned) > 0.0);
        }
    }
}
