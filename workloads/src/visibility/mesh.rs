//! Triangles whose vertices move on straight lines while the shutter is open.

use glam::DVec3;

/// A mesh at both ends of the shutter (or at both ends of a step of a simulation), as precise as its file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MovingMesh {
    /// Vertices at time zero, when the shutter opens.
    pub open: Vec<DVec3>,
    /// The same vertices at time one, when it closes.
    pub close: Vec<DVec3>,
    /// Vertex indices of each triangle, all in range.
    pub triangles: Vec<[u32; 3]>,
}

impl MovingMesh {
    /// Both ends of every corner of every triangle.
    pub(super) fn corners(&self) -> impl Iterator<Item = [DVec3; 2]> {
        self.triangles
            .as_flattened()
            .iter()
            .map(|&vertex| [&self.open, &self.close].map(|end| end[vertex as usize]))
    }
}
