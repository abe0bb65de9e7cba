//! Importers: one folder or file for each format, all of them giving [`Parts`].

mod faces;
mod gltf;
mod image;
mod obj;
mod ply;
pub(crate) mod reader;
pub(crate) mod ron;
mod soup;
mod statements;

use std::path::Path;

use crate::error::LoadError;
use crate::scene::{Local, Mesh, Node, Parts, Trs};
pub(crate) use faces::faces;
use soup::Soup;

/// File formats, told by the end of the name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Format {
    Gltf,
    Ply,
    Obj,
    Ron,
}

impl Format {
    /// The format of `path`, whatever the case of its ending; `.gz` after `.ply` and `.obj` is fine.
    pub fn of(path: &Path) -> Option<Self> {
        let name = path.file_name()?.to_str()?.to_ascii_lowercase();
        let bare = name.strip_suffix(".gz").unwrap_or(&name);
        match bare.rsplit_once('.')?.1 {
            "gltf" | "glb" if bare == name => Some(Self::Gltf),
            "ron" if bare == name => Some(Self::Ron),
            "ply" => Some(Self::Ply),
            "obj" => Some(Self::Obj),
            _ => None,
        }
    }
}

/// Frames of a still file that says nothing of frames.
const STILL_FRAMES: u32 = 4;

/// Most frames of an animated file that says nothing of frames.
const MOST_FRAMES: u32 = 36;

/// Reads the file at `path`.
pub(crate) fn import(path: &Path, format: Format) -> Result<Parts, LoadError> {
    let mut parts = match format {
        Format::Ron => return ron::import(path),
        Format::Gltf => gltf::import(path, None)?,
        Format::Ply | Format::Obj => solid(path, soup(path, format)?)?,
    };
    let frames = libm::ceil(parts.graph.last_key_s() * parts.settings.frame_rate_hz);
    parts.settings.frames =
        if frames >= 1.0 { 0..frames.min(f64::from(MOST_FRAMES)) as u32 } else { 0..STILL_FRAMES };
    Ok(parts)
}

/// The triangles of a PLY or OBJ file.
fn soup(path: &Path, format: Format) -> Result<Soup, LoadError> {
    if format == Format::Ply { ply::read(path) } else { obj::read(path) }
}

/// The positions and triangles of a PLY or OBJ file.
pub(crate) fn surface(path: &Path, format: Format) -> Result<Mesh, LoadError> {
    let soup = soup(path, format)?;
    Soup { positions: soup.positions, triangles: soup.triangles, ..Soup::default() }.into_mesh(path, 0)
}

fn solid(path: &Path, soup: Soup) -> Result<Parts, LoadError> {
    let mut parts = Parts::new(path.display().to_string());
    let node = parts.graph.push_node(Node::new("root", None, Local::Trs(Trs::default())));
    let material = parts.graph.push_material(soup::grey());
    parts.warnings = soup.warnings.clone();
    let mesh = soup.into_mesh(path, material)?;
    parts.graph.hang(mesh, node);
    Ok(parts)
}
