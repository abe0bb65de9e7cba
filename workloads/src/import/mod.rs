//! Importers: one folder or file for each format. Each returns [`Parts`].
//! Warnings about content that is not drawn are the same for all formats.

mod gltf;
mod obj;
mod off;
mod ply;
pub(crate) mod reader;
pub(crate) mod ron;
mod soup;
mod stl;

use std::path::Path;

use glam::DVec3;
use soup::{Soup, TriangleMaterials};
use warnings::{Code, Warning};

use crate::error::LoadError;
use crate::scene::{Local, Node, Parts, Trs};

pub(crate) use obj::{Face, statements};

/// Name extensions of scene files, for messages.
pub(crate) const ENDINGS: &str = ".ron, .gltf, .glb, .obj, .ply, .off or .stl";

/// File formats, by the end of the name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Format {
    Gltf,
    Ply,
    Obj,
    Off,
    Stl,
    Ron,
}

impl Format {
    /// The format of `path`, whatever the case of its ending; `.gz` after the formats that hold one surface is fine.
    pub fn of(path: &Path) -> Option<Self> {
        let name = path.file_name()?.to_string_lossy().to_ascii_lowercase();
        let bare = name.strip_suffix(".gz").unwrap_or(&name);
        match bare.rsplit_once('.')?.1 {
            "gltf" | "glb" if bare == name => Some(Self::Gltf),
            "ron" if bare == name => Some(Self::Ron),
            "ply" => Some(Self::Ply),
            "obj" => Some(Self::Obj),
            "off" => Some(Self::Off),
            "stl" => Some(Self::Stl),
            _ => None,
        }
    }

    /// Whether files of this format hold one surface and nothing else.
    pub fn is_surface(self) -> bool {
        matches!(self, Self::Ply | Self::Obj | Self::Off | Self::Stl)
    }
}

/// Frames of a still file that says nothing of frames.
const STILL_FRAMES: u32 = 4;

/// Most frames of an animated file that says nothing of frames.
const MAX_FRAMES: u32 = 36;

/// Reads the file at `path`.
pub(crate) fn import(path: &Path, format: Format) -> Result<Parts, LoadError> {
    let mut parts = match format {
        Format::Ron => return ron::import(path),
        Format::Gltf => gltf::import(path, None, gltf::MaterialSource::Own)?,
        Format::Ply | Format::Obj | Format::Off | Format::Stl => solid(path, soup(path, format)?)?,
    };
    let frames = libm::ceil(parts.graph.last_key_s() * parts.settings.frame_rate_hz);
    parts.settings.frames =
        if frames >= 1.0 { 0..frames.min(f64::from(MAX_FRAMES)) as u32 } else { 0..STILL_FRAMES };
    Ok(parts)
}

/// The surface in a file of a format that holds one.
fn soup(path: &Path, format: Format) -> Result<Soup, LoadError> {
    match format {
        Format::Obj => obj::read(path),
        Format::Off => off::read(path),
        Format::Stl => stl::read(path),
        _ => ply::read(path),
    }
}

/// The same without what it looks like, for surfaces that get a material from elsewhere.
fn bare(path: &Path, format: Format) -> Result<Soup, LoadError> {
    let mut soup = if format == Format::Obj { obj::surface(path)? } else { soup(path, format)? };
    soup.colors.clear();
    soup.looks = TriangleMaterials::default();
    soup.warnings.retain(|warning| warning.code == Code::CoordinatesFarFromOrigin);
    Ok(soup)
}

/// Positions and triangles.
pub(crate) struct Surface {
    /// As precise as the file gives them, all finite.
    pub positions: Vec<DVec3>,
    /// Vertex indices, all in range.
    pub triangles: Vec<[u32; 3]>,
}

/// The positions and triangles of a file of a format that holds a surface.
pub(crate) fn surface(path: &Path, format: Format) -> Result<Surface, LoadError> {
    let soup = bare(path, format)?;
    let (positions, triangles) = (soup.positions.clone(), soup.triangles.clone());
    // The mesh checks what it is made from.
    soup.into_mesh(path, DVec3::ZERO)?;
    Ok(Surface { positions, triangles })
}

fn solid(path: &Path, mut soup: Soup) -> Result<Parts, LoadError> {
    let mut parts = Parts::new(path.display().to_string());
    let origin = soup.origin();
    let place = Trs { translation: origin, ..Trs::default() };
    let node = parts.graph.push_node(Node::new("root", None, Local::Trs(place)));
    parts.warnings = std::mem::take(&mut soup.warnings);
    let looks = std::mem::take(&mut soup.looks);
    let (meshes, materials) = looks.split(soup.into_mesh(path, origin)?, 0);
    parts.graph.materials = materials;
    meshes.into_iter().for_each(|mesh| parts.graph.attach(mesh, node));
    Ok(parts)
}

/// Name extensions and names of scene formats that are not supported.
const FORMATS: &[(&[&str], &str)] = &[
    (&["3dm"], "a Rhino"),
    (&["3ds"], "a 3DS"),
    (&["3mf"], "a 3MF"),
    (&["abc"], "an Alembic"),
    (&["blend"], "a Blender"),
    (&["c4d"], "a Cinema 4D"),
    (&["dae"], "a COLLADA"),
    (&["dwg", "dxf"], "an AutoCAD"),
    (&["fbx"], "an FBX"),
    (&["ifc"], "an IFC"),
    (&["igs", "iges"], "an IGES"),
    (&["lwo", "lws"], "a LightWave"),
    (&["ma", "mb"], "a Maya"),
    (&["max"], "a 3ds Max"),
    (&["pbrt"], "a PBRT"),
    (&["skp"], "a SketchUp"),
    (&["step", "stp"], "a STEP"),
    (&["usd", "usda", "usdc", "usdz"], "a USD"),
    (&["vtk", "vtp", "vtu"], "a VTK"),
    (&["wrl", "vrml"], "a VRML"),
    (&["x3d", "x3dv"], "an X3D"),
];

/// The message about the file at `path`, if its extension is that of a known, unsupported format.
pub(crate) fn foreign(path: &Path) -> Option<String> {
    let ending = path.extension()?.to_str()?.to_ascii_lowercase();
    let (_, name) = FORMATS.iter().find(|(endings, _)| endings.contains(&ending.as_str()))?;
    let convert = "convert it to glTF, for example with Blender: File > Export > glTF 2.0";
    Some(format!("it is {name} file, which is not read; {convert}"))
}

/// A material with a normal or bump map.
fn normal_map(material: &str) -> Warning {
    about_material(
        Code::NormalMapIgnored,
        "normal map",
        "ignored: surfaces keep the normals of their vertices",
        material,
    )
}

/// An emissive material.
fn emissive(material: &str) -> Warning {
    about_material(Code::EmissiveIgnored, "emissive material", "drawn without emitting light", material)
}

/// A material with a map of its opacity alone.
fn opacity_map(material: &str) -> Warning {
    let what = "ignored: the opacity of the material is the same everywhere";
    about_material(Code::AlphaIgnored, "opacity map", what, material)
}

/// A material that filters the light behind it.
fn filter(material: &str) -> Warning {
    let what = "drawn without filtering the light of what is behind";
    about_material(Code::AlphaIgnored, "transmissive material", what, material)
}

/// A material whose opacity is that of its vertices.
fn vertex_alpha(material: &str) -> Warning {
    let what = "with opacities of vertices, which are ignored";
    about_material(Code::AlphaIgnored, "material", what, material)
}

/// A texture that cannot be read, for the reason `why`.
fn texture(material: &str, why: &str) -> Warning {
    let detail = format!("material `{material}`: {why}");
    Warning::about(Code::MissingImage, "texture", "not read: the material's colour is used alone", detail)
}

/// A material that is metallic.
fn metallic(material: &str) -> Warning {
    let what = "drawn as diffuse ones with a faint highlight";
    about_material(Code::MetallicIgnored, "metallic material", what, material)
}

/// A material with its own highlight, roughness or reflections.
fn reflection(material: &str) -> Warning {
    let what = "with a highlight or reflections of its own: every surface has the same faint highlight";
    about_material(Code::ReflectionIgnored, "material", what, material)
}

/// A material with a displacement map.
fn displacement(material: &str) -> Warning {
    let what = "ignored: surfaces stay where they are";
    about_material(Code::DisplacementIgnored, "displacement map", what, material)
}

/// A file with face colours.
fn face_colors(path: &Path) -> Warning {
    let what = "with colours for faces, which are drawn without them";
    Warning::about(Code::FaceColorsIgnored, "file", what, path.display().to_string())
}

/// A warning about a material.
fn about_material(code: Code, thing: &'static str, what: &'static str, material: &str) -> Warning {
    Warning::about(code, thing, what, format!("material `{material}`"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formats_are_named_with_the_way_out() {
        let text = foreign(Path::new("dir/Car.FBX")).unwrap();
        assert!(text.contains("an FBX file, which is not read") && text.contains("glTF 2.0"), "{text}");
        for known in ["a.obj", "a.gltf", "fbx", "a.txt", ""] {
            assert_eq!(foreign(Path::new(known)), None, "{known}");
        }
    }
}
