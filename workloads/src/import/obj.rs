//! OBJ files: positions, normals, texture coordinates and polygons. Materials are not read.

use std::io::BufReader;
use std::path::Path;

use activity::Warning;
use glam::{Vec2, Vec3};
use tobj::{LoadOptions, Mesh};

use super::reader;
use super::soup::Soup;
use super::statements::Statements;
use crate::error::{LoadError, Source};

/// Reads the OBJ file at `path`, gzipped or not.
pub(super) fn read(path: &Path) -> Result<Soup, LoadError> {
    let source = Source { path };
    let mut input = BufReader::new(Statements::new(reader::open(path)?));
    // Points and lines are no surfaces; every other face becomes a fan.
    let options =
        LoadOptions { triangulate: true, single_index: true, ignore_points: true, ignore_lines: true };
    let (models, _) =
        tobj::load_obj_buf(&mut input, &options, |_| Ok(Default::default())).map_err(|error| {
            source.broken("contents", format!("not an OBJ file as it should be: {error}; mend the file"))
        })?;
    let mut soup = Soup::default();
    let whole = |part: fn(&Mesh) -> &[f32]| models.iter().all(|model| !part(&model.mesh).is_empty());
    let (normals, uvs) = (whole(|mesh| &mesh.normals), whole(|mesh| &mesh.texcoords));
    for model in &models {
        append(&mut soup, &model.mesh, normals, uvs);
    }
    if input.get_ref().names_materials() {
        let message =
            format!("{}: the materials of OBJ files are not read; the object's own is used", path.display());
        soup.warnings.push(Warning::new("obj-materials-ignored", message));
    }
    Ok(soup)
}

fn append(soup: &mut Soup, mesh: &Mesh, normals: bool, uvs: bool) {
    let first = soup.positions.len() as u32;
    let triples = |values: &[f32]| values.chunks_exact(3).map(Vec3::from_slice).collect::<Vec<_>>();
    soup.positions.extend(triples(&mesh.positions));
    if normals {
        soup.normals.extend(triples(&mesh.normals));
    }
    if uvs {
        // OBJ counts v upwards from the last row.
        soup.uvs.extend(mesh.texcoords.chunks_exact(2).map(|uv| Vec2::new(uv[0], 1.0 - uv[1])));
    }
    let corners = mesh.indices.chunks_exact(3);
    soup.triangles.extend(corners.map(|corner| [first + corner[0], first + corner[1], first + corner[2]]));
}
