//! Loading of scenes by name or path. Importers: one folder or file for each format; each returns [`Parts`].
//! Warnings about content that is not drawn are the same for all formats.

mod gltf;
mod obj;
mod off;
mod ply;
pub(crate) mod reader;
pub(crate) mod ron;
mod stl;

use std::path::Path;

use activity::spec::suggestion;
use glam::DVec3;
use warnings::{Code, Warning};

use crate::builtin::{builtin, builtin_names};
use crate::error::LoadError;
use crate::scene::{Local, Node, Parts, Scene, Trs};
pub(crate) use obj::{Face, statements};
use reader::{Soup, TriangleMaterials};

/// Name extensions of scene files, for messages.
const ENDINGS: &str = ".ron, .gltf, .glb, .obj, .ply, .off or .stl";

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

/// What a warning says of a material: the code, what it is about, and what becomes of that.
#[derive(Clone, Copy)]
struct MaterialWarning(Code, &'static str, &'static str);

const NORMAL_MAP: MaterialWarning = MaterialWarning(
    Code::NormalMapIgnored,
    "normal map",
    "ignored: surfaces keep the normals of their vertices",
);
const EMISSIVE: MaterialWarning =
    MaterialWarning(Code::EmissiveIgnored, "emissive material", "drawn without emitting light");
const OPACITY_MAP: MaterialWarning = MaterialWarning(
    Code::AlphaIgnored,
    "opacity map",
    "ignored: the opacity of the material is the same everywhere",
);
const FILTER: MaterialWarning = MaterialWarning(
    Code::AlphaIgnored,
    "transmissive material",
    "drawn without filtering the light of what is behind",
);
const VERTEX_ALPHA: MaterialWarning =
    MaterialWarning(Code::AlphaIgnored, "material", "with opacities of vertices, which are ignored");
const METALLIC: MaterialWarning = MaterialWarning(
    Code::MetallicIgnored,
    "metallic material",
    "drawn as diffuse ones with a faint highlight",
);
const REFLECTION: MaterialWarning = MaterialWarning(
    Code::ReflectionIgnored,
    "material",
    "with a highlight or reflections of its own: every surface has the same faint highlight",
);
const DISPLACEMENT: MaterialWarning =
    MaterialWarning(Code::DisplacementIgnored, "displacement map", "ignored: surfaces stay where they are");

impl MaterialWarning {
    fn of(self, material: &str) -> Warning {
        Warning::about(self.0, self.1, self.2, format!("material `{material}`"))
    }
}

/// The warnings that hold for a material.
fn material_warnings<const N: usize>(
    found: [(bool, MaterialWarning); N],
    material: &str,
) -> impl Iterator<Item = Warning> {
    found.into_iter().filter(|(holds, _)| *holds).map(move |(_, warning)| warning.of(material))
}

/// A texture that cannot be read, for the reason `why`.
fn texture(material: &str, why: &str) -> Warning {
    let detail = format!("material `{material}`: {why}");
    Warning::about(Code::MissingImage, "texture", "not read: the material's colour is used alone", detail)
}

/// A file with face colours.
fn face_colors(path: &Path) -> Warning {
    let what = "with colours for faces, which are drawn without them";
    Warning::about(Code::FaceColorsIgnored, "file", what, path.display().to_string())
}

/// Loads a scene: a built-in one by name, or a `.ron`, `.gltf`, `.glb`, `.obj`, `.ply`, `.off` or `.stl` file
/// (the last four also gzipped, as `.ply.gz`). A geometry file gets a fitted camera and default settings.
///
/// # Errors
/// [`LoadError`]; [`LoadError::is_usage`] distinguishes mistakes of the caller from broken files.
pub fn load(name_or_path: impl AsRef<Path>) -> Result<Scene, LoadError> {
    let path = name_or_path.as_ref();
    if let Some(scene) = path.to_str().and_then(builtin) {
        return scene;
    }
    match Format::of(path) {
        Some(format) => {
            Scene::new(import(path, format)?).map_err(|error| error.in_file(&path.display().to_string()))
        }
        None => Err(unreadable(path).unwrap_or_else(|| unknown(&path.to_string_lossy(), &[]))),
    }
}

/// Parses the RON scene in `text` as if the file at `path` held it: other files are relative to its folder.
///
/// # Errors
/// As [`load`].
pub fn load_text(text: &str, path: &Path) -> Result<Scene, LoadError> {
    Scene::new(ron::parse(text, path)?).map_err(|error| error.in_file(&path.display().to_string()))
}

/// Error for a path that is not a scene.
fn unreadable(path: &Path) -> Option<LoadError> {
    let message = foreign(path).or_else(|| {
        let message = if path.is_dir() { "it is a folder" } else { "its ending is not one of a scene file" };
        path.exists().then(|| format!("{message}; give a {} file", ENDINGS))
    })?;
    Some(LoadError::Format { file: path.display().to_string(), message })
}

/// Error for an unknown name; `workloads` are listed if they are accepted.
pub(crate) fn unknown(name: &str, workloads: &[&str]) -> LoadError {
    let mut names: Vec<&str> = builtin_names().map(|(name, _)| name).collect();
    let mut known = format!("built in: {}; ", names.join(", "));
    if !workloads.is_empty() {
        known += &format!("workloads: {}; ", workloads.join(", "));
    }
    known += &format!("or a path to a {} file", ENDINGS);
    names.extend(workloads);
    let near = suggestion(name, &names);
    if near.starts_with("did you mean") {
        known = format!("{near} {known}");
    }
    LoadError::Unknown { name: name.to_owned(), known }
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

    #[test]
    fn an_unknown_name_lists_known_names_and_suggests() {
        let error = load("defualt").unwrap_err();
        assert!(error.is_usage());
        let text = error.to_string();
        assert!(
            text.starts_with("no scene called `defualt`; did you mean `default`? built in: default, tiny;"),
            "{text}"
        );
        assert!(load("nothing-like-it").unwrap_err().to_string().contains("built in: default, tiny"));
    }

    #[test]
    fn files_that_are_no_scenes_say_why() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name).display().to_string();
        std::fs::write(path("a.txt"), "text").unwrap();
        std::fs::write(path("bare"), "text").unwrap();
        let cases = [
            (path("."), "it is a folder; give a .ron, .gltf"),
            (path("a.txt"), "its ending is not one of a scene file; give a .ron, .gltf"),
            (path("bare"), "its ending is not one"),
            (path("a.usdz"), "it is a USD file, which is not read; convert it to glTF"),
        ];
        for (name, expected) in cases {
            let error = load(&name).unwrap_err();
            assert!(error.is_usage() && error.to_string().contains(expected), "{error}");
        }
        assert!(load(path("nothing")).unwrap_err().to_string().starts_with("no scene called"));
    }

    #[test]
    fn a_missing_file_is_a_failure_that_names_it() {
        for name in
            ["/nowhere/a.gltf", "/nowhere/a.glb", "/nowhere/a.ply", "/nowhere/a.obj.gz", "/nowhere/a.ron"]
        {
            let error = load(name).unwrap_err();
            assert!(!error.is_usage() && error.to_string().contains(name), "{error}");
        }
    }
}
