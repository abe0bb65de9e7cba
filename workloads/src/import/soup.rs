//! Triangles of PLY, OBJ, OFF and STL files.

use std::path::Path;

use glam::{DVec3, Vec2, Vec3};
use warnings::Warning;

use crate::error::{LoadError, Source};
use crate::material::Material;
use crate::scene::far::Bounds;
use crate::scene::{Mesh, Normals};

/// Vertices and triangles of one file.
#[derive(Clone, Debug, Default)]
pub(super) struct Soup {
    /// Positions in the precision of the file.
    pub positions: Vec<DVec3>,
    /// One for each vertex, or none.
    pub normals: Vec<Vec3>,
    /// One for each vertex, (0, 0) at the first row of a texture; or none.
    pub uvs: Vec<Vec2>,
    /// Linear RGB, one for each vertex, or none.
    pub colors: Vec<Vec3>,
    pub triangles: Vec<[u32; 3]>,
    /// Whether faces are flat where the file gives no normals.
    pub flat: bool,
    pub looks: TriangleMaterials,
    pub warnings: Vec<Warning>,
}

/// Materials of a file's triangles; without materials they are grey, or have their vertex colours.
#[derive(Clone, Debug, Default)]
pub(super) struct TriangleMaterials {
    pub materials: Vec<Paint>,
    /// The material of each triangle, where there are materials.
    pub of_triangle: Vec<u32>,
}

/// A material, and the transform of its texture coordinates.
#[derive(Clone, Debug)]
pub(super) struct Paint {
    pub material: Material,
    /// Texture coordinates are multiplied by this.
    pub scale: Vec2,
    /// And then this is added.
    pub offset: Vec2,
}

/// Material of files without materials. It is double-sided, because scans often have holes.
pub(super) fn grey() -> Material {
    Material { double_sided: true, ..Material::colored("grey", Vec3::splat(0.55)) }
}

/// Material of files with vertex colours and without materials.
pub(super) fn white() -> Material {
    Material { double_sided: true, ..Material::colored("white", Vec3::ONE) }
}

/// A colour as it is shown on a screen, each channel 0 to 1 in sRGB, as linear RGB.
pub(super) fn linear(shown: [f32; 3]) -> Vec3 {
    Vec3::from_array(shown.map(|channel| {
        let channel = f64::from(channel.clamp(0.0, 1.0));
        let linear =
            if channel <= 0.04045 { channel / 12.92 } else { libm::pow((channel + 0.055) / 1.055, 2.4) };
        linear as f32
    }))
}

impl Soup {
    /// Adds a polygon as a fan; fewer than three corners are no face.
    pub fn polygon(&mut self, corners: &[u32]) {
        if let [first, rest @ ..] = corners {
            self.triangles.extend(rest.windows(2).map(|pair| [*first, pair[0], pair[1]]));
        }
    }

    /// Warns where f32, as which the file stores positions, is too coarse for its shape.
    pub fn warn_if_rounded(&mut self, path: &Path) {
        let bounds = Bounds::of(self.positions.iter().copied());
        self.warnings.extend(bounds.rounded(&path.display().to_string()));
    }

    /// What has to be subtracted from positions before they are rounded to f32, so that the shape survives: zero, unless the
    /// file is far from its origin for its size.
    pub fn origin(&self) -> DVec3 {
        Bounds::of(self.positions.iter().copied()).origin()
    }

    /// All of it as one mesh, whose material is still to be chosen, positions relative to `origin`.
    pub fn into_mesh(self, path: &Path, origin: DVec3) -> Result<Mesh, LoadError> {
        let name = path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        let source = Source { path };
        let broken = |message: String| source.broken("geometry", format!("{message}; fix the file"));
        let finite = self.normals.iter().chain(&self.colors).all(|v| v.is_finite());
        if !finite || self.uvs.iter().any(|uv| !uv.is_finite()) {
            return Err(broken("a normal, colour or texture coordinate is NaN or infinite".to_owned()));
        }
        let positions: Vec<Vec3> = self.positions.iter().map(|p| (*p - origin).as_vec3()).collect();
        let count = positions.len();
        let mut mesh = Mesh::new(name, positions, self.triangles, 0).map_err(broken)?;
        mesh.normals = match self.normals.len() == count {
            true => Normals::Given(self.normals),
            false if self.flat => Normals::Flat,
            false => Normals::Smooth,
        };
        if self.uvs.len() == count {
            mesh.uvs = self.uvs.into();
        }
        if self.colors.len() == count {
            mesh.colors = self.colors.into();
        }
        Ok(mesh)
    }
}

impl TriangleMaterials {
    /// A mesh for each material that `whole` uses, with all materials; `first` is the number of the first of these.
    pub fn split(self, mut whole: Mesh, first: usize) -> (Vec<Mesh>, Vec<Material>) {
        if self.materials.is_empty() {
            let material = if whole.colors.is_empty() { grey() } else { white() };
            whole.material = first;
            return (vec![whole], vec![material]);
        }
        let parts = whole.split(&self.of_triangle, self.materials.len());
        let dressed = |((index, mut mesh), paint): ((usize, Mesh), &Paint)| {
            mesh.material = first + index;
            mesh.name = format!("{}: {}", whole.name, paint.material.name);
            if (paint.scale, paint.offset) != (Vec2::ONE, Vec2::ZERO) {
                mesh.uvs = mesh.uvs.iter().map(|uv| *uv * paint.scale + paint.offset).collect();
            }
            mesh
        };
        let meshes = parts.into_iter().enumerate().zip(&self.materials).map(dressed);
        let meshes = meshes.filter(|mesh| !mesh.triangles.is_empty()).collect();
        (meshes, self.materials.into_iter().map(|paint| paint.material).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn screen_colours_are_decoded() {
        let [mid, ends] = [linear([0.5; 3]).x, linear([0.0, 1.0, 7.0]).z];
        assert!((mid - 0.214_041_14).abs() < 1e-6 && ends == 1.0);
    }

    #[test]
    fn each_material_gets_the_vertices_it_uses() {
        let positions = [0.0, 1.0, 2.0, 3.0].map(|x| DVec3::new(x, x * x, 0.0)).to_vec();
        let paint = |scale| Paint {
            material: Material::colored("m", Vec3::ONE),
            scale: Vec2::splat(scale),
            offset: Vec2::ZERO,
        };
        let soup = Soup {
            uvs: positions.iter().map(|p| Vec2::splat(p.x as f32)).collect(),
            positions,
            triangles: vec![[0, 1, 2], [1, 3, 2], [2, 1, 0]],
            looks: TriangleMaterials {
                materials: vec![paint(1.0), paint(2.0), paint(1.0)],
                of_triangle: vec![0, 1, 0],
            },
            ..Soup::default()
        };
        let looks = soup.looks.clone();
        let (meshes, materials) = looks.split(soup.into_mesh(Path::new("a.obj"), DVec3::ZERO).unwrap(), 5);
        assert_eq!((meshes.len(), materials.len()), (2, 3));
        assert_eq!((meshes[0].material, meshes[1].material), (5, 6));
        assert_eq!(meshes[0].triangles[..], [[0, 1, 2], [2, 1, 0]]);
        // In the order in which the part uses them.
        assert_eq!(meshes[1].triangles[..], [[0, 1, 2]]);
        assert_eq!(meshes[1].positions.iter().map(|p| p.x).collect::<Vec<_>>(), [1.0, 3.0, 2.0]);
        assert_eq!(meshes[1].uvs[..], [1.0, 3.0, 2.0].map(|x| Vec2::splat(2.0 * x)));
    }
}
