//! Triangles as PLY and OBJ files give them.

use std::path::Path;

use activity::Warning;
use glam::{Vec2, Vec3};

use crate::error::{LoadError, Source};
use crate::material::Material;
use crate::scene::{Mesh, Normals};

/// Vertices and triangles of one file.
#[derive(Clone, Debug, Default)]
pub(super) struct Soup {
    pub positions: Vec<Vec3>,
    /// One for each vertex, or none.
    pub normals: Vec<Vec3>,
    /// One for each vertex, (0, 0) at the first row of a texture; or none.
    pub uvs: Vec<Vec2>,
    pub triangles: Vec<[u32; 3]>,
    pub warnings: Vec<Warning>,
}

/// What files without materials are made of. Scans often have holes through which back faces show.
pub(super) fn grey() -> Material {
    Material { double_sided: true, ..Material::colored("grey", Vec3::splat(0.55)) }
}

impl Soup {
    /// Adds a polygon as a fan; fewer than three corners are no face.
    pub fn polygon(&mut self, corners: &[u32]) {
        if let [first, rest @ ..] = corners {
            self.triangles.extend(rest.windows(2).map(|pair| [*first, pair[0], pair[1]]));
        }
    }

    pub fn into_mesh(self, path: &Path, material: usize) -> Result<Mesh, LoadError> {
        let name = path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        let source = Source { path };
        let broken = |message: String| source.broken("geometry", format!("{message}; mend the file"));
        if self.normals.iter().any(|normal| !normal.is_finite()) || self.uvs.iter().any(|uv| !uv.is_finite())
        {
            return Err(broken("a normal or texture coordinate is NaN or infinite".to_owned()));
        }
        let count = self.positions.len();
        let mut mesh = Mesh::new(name, self.positions, self.triangles, material).map_err(broken)?;
        mesh.normals =
            if self.normals.len() == count { Normals::Given(self.normals) } else { Normals::Smooth };
        if self.uvs.len() == count {
            mesh.uvs = self.uvs.into();
        }
        Ok(mesh)
    }
}
