//! glTF 2.0, as `.gltf` with files or data URIs beside it and as `.glb`.
//!
//! The crate `gltf` parses and checks the JSON; whether accessors fit their buffers it does not check, and some
//! of its readers panic where they do not, so buffers and accessors are read here.
//!
//! Of materials base-colour textures are read; warnings say what is not drawn.

mod nodes;
mod primitive;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use glam::Vec3;
use gltf::json::extensions::ENABLED_EXTENSIONS;
use gltf::json::material::{AlphaMode, Material as Described};
use gltf::json::mesh::Semantic;
use gltf::json::texture::{MagFilter, WrappingMode};
use gltf::json::validation::{Checked, Error, Validate};
use gltf::json::{Path as JsonPath, Root};
use pipeline::{Texture, Wrap};
use warnings::{Code, Warning};

use crate::error::{LoadError, Source};
use crate::import;
use crate::import::{MaterialWarning, reader};
use crate::material::{Alpha, Material};
use crate::scene::Bounds;
use crate::scene::{AnimationClip, Instance, Mesh, Parts};
use nodes::Tree;

/// Source of the materials.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum MaterialSource {
    /// The file's materials.
    Own,
    /// Other materials. Those of the file are not read and cause no warnings.
    Replaced,
}

/// Reads the file at `path` and selects the clip named `clip`, or the first.
pub(super) fn import(path: &Path, clip: Option<&str>, looks: MaterialSource) -> Result<Parts, LoadError> {
    let source = Source { path };
    let document = Document::read(source)?;
    let tree = nodes::tree(&document)?;
    let used = Used::new(&document, &tree, looks);
    let mut parts = Parts::new(path.display().to_string());
    parts.clips = nodes::clips(&document, &tree)?;
    parts.graph.skins = nodes::skins(&document, &tree)?;
    parts.graph.materials = materials(&document, &used, &mut parts.warnings);
    let of_mesh = meshes(&document, &used, &mut parts)?;
    parts.graph.instances = instances(&document, &tree, &of_mesh, &parts.graph)?;
    (parts.cameras, parts.light) = nodes::view(&document, &tree, &mut parts.warnings);
    parts.camera = parts.cameras.first().map(|own| own.camera.clone()).unwrap_or_default();
    parts.graph.nodes = tree.nodes;
    if !parts.clips.is_empty() {
        let chosen = clip.map_or(Ok(0), |wanted| AnimationClip::find(&parts.clips, wanted))?;
        parts.clips[chosen].play(&mut parts.graph.nodes);
    } else if let Some(wanted) = clip {
        AnimationClip::find(&parts.clips, wanted)?;
    }
    Ok(parts)
}

/// Reads all primitives as meshes; returns the range of meshes for each glTF mesh.
fn meshes(
    document: &Document,
    used: &Used,
    parts: &mut Parts,
) -> Result<Vec<std::ops::Range<usize>>, LoadError> {
    let (graph, mut warnings) = (&mut parts.graph, Vec::new());
    let mut alpha = vec![1.0_f32; graph.materials.len()];
    let mut ranges = Vec::new();
    for mesh in 0..document.root.meshes.len() {
        let first = graph.meshes.len();
        for index in 0..document.root.meshes[mesh].primitives.len() {
            let read = primitive::read(document, [mesh, index], &mut graph.materials, &mut warnings)?;
            if let Some(primitive::Read { mesh: made, least_alpha }) = read {
                warnings.extend(rounded(&made));
                if let Some(alpha) = alpha.get_mut(made.material) {
                    *alpha = alpha.min(least_alpha);
                }
                graph.meshes.push(made);
            }
        }
        // Meshes without a node in the scene do not change the image.
        if used.meshes[mesh] {
            parts.warnings.append(&mut warnings);
        }
        warnings.clear();
        ranges.push(first..graph.meshes.len());
    }
    parts.warnings.extend(left_out(document, used, &graph.materials, &alpha));
    Ok(ranges)
}

/// Warns if the coordinates of a mesh are too large for f32 in its local space.
fn rounded(mesh: &Mesh) -> Option<Warning> {
    Bounds::of(mesh.positions.iter().map(|point| point.as_dvec3())).rounded(&mesh.name)
}

fn instances(
    document: &Document,
    tree: &Tree,
    of_mesh: &[std::ops::Range<usize>],
    graph: &crate::scene::Graph,
) -> Result<Vec<Instance>, LoadError> {
    let mut instances = Vec::new();
    for (index, node) in document.root.nodes.iter().enumerate() {
        let (Some(mesh), true) = (node.mesh, tree.in_scene[index]) else { continue };
        for mesh in of_mesh.get(mesh.value()).cloned().unwrap_or_default() {
            let skin = node.skin.map(|skin| skin.value()).filter(|_| graph.meshes[mesh].influences.is_some());
            if let Some(skin) = skin {
                check_joints(document, index, &graph.meshes[mesh], graph.skins[skin].joints.len())?;
            }
            instances.push(Instance { node: tree.place[index], mesh, skin, clip: pipeline::Clip::NONE });
        }
    }
    // Joint influences need a skin.
    Ok(instances)
}

fn check_joints(document: &Document, node: usize, mesh: &Mesh, joints: usize) -> Result<(), LoadError> {
    let highest = mesh.influences.iter().flat_map(|influences| &influences.joints).max();
    match highest {
        Some(&highest) if usize::from(highest) >= joints => Err(document.source.broken(
            format!("node {node}, mesh `{}`", mesh.name),
            format!("a vertex uses joint {highest}, but the skin has only {joints}: export it again"),
        )),
        _ => Ok(()),
    }
}

/// A glTF file whose JSON indices and buffers are checked. Accessors are checked when they are read.
struct Document<'a> {
    pub source: Source<'a>,
    pub root: Root,
    pub buffers: Vec<Vec<u8>>,
}

impl<'a> Document<'a> {
    pub fn read(source: Source<'a>) -> Result<Self, LoadError> {
        let bytes = source.read()?;
        let (json, binary) =
            if bytes.starts_with(b"glTF") { split(source, &bytes)? } else { (&bytes[..], None) };
        let root = Root::from_slice(json).map_err(|error| {
            let message = if error.is_eof() && !json.is_empty() {
                format!(
                    "the file ends at line {}, within its JSON: it is truncated; get the file again",
                    error.line()
                )
            } else {
                format!("not a glTF 2.0 file: {error}; export it again")
            };
            source.broken("JSON", message)
        })?;
        check_positions(source, &root)?;
        validate(source, &root)?;
        let buffers = load(source, &root, binary)?;
        Ok(Self { source, root, buffers })
    }
}

/// JSON and binary chunk of a `.glb` (glTF 2.0, section 4).
fn split<'b>(source: Source, bytes: &'b [u8]) -> Result<(&'b [u8], Option<&'b [u8]>), LoadError> {
    let word =
        |at: usize| bytes.get(at..at + 4).and_then(|word| word.try_into().ok()).map(u32::from_le_bytes);
    let truncated = |what: &str, needed: usize| {
        let message =
            format!("truncated: {needed} bytes are needed, there are {}: get the file again", bytes.len());
        source.broken(what, message)
    };
    let (Some(version), Some(length)) = (word(4), word(8)) else { return Err(truncated("GLB header", 12)) };
    if version != 2 {
        return Err(source.broken("GLB header", format!("version {version}; only version 2 is supported")));
    }
    if (length as usize) > bytes.len() {
        return Err(truncated("GLB header", length as usize));
    }
    let chunk = |at: usize, kind: &[u8; 4], what: &str| {
        let Some(length) = word(at) else { return Err(truncated(what, at + 8)) };
        let (start, end) = (at + 8, (at + 8).saturating_add(length as usize));
        match (bytes.get(at + 4..at + 8), bytes.get(start..end)) {
            (Some(found), Some(body)) if found == kind => Ok((body, end)),
            (Some(found), Some(_)) if found != kind => {
                Err(source.broken(what, format!("a chunk of type {found:?} instead of {kind:?}")))
            }
            _ => Err(truncated(what, end)),
        }
    };
    let (json, end) = chunk(12, b"JSON", "GLB chunk 0")?;
    let binary = if end + 8 <= bytes.len() { Some(chunk(end, b"BIN\0", "GLB chunk 1")?.0) } else { None };
    Ok((json, binary))
}

/// The crate's own check indexes accessors with these before it has checked them.
fn check_positions(source: Source, root: &Root) -> Result<(), LoadError> {
    for (mesh, of_mesh) in root.meshes.iter().enumerate() {
        for (primitive, of_primitive) in of_mesh.primitives.iter().enumerate() {
            let accessor = of_primitive.attributes.get(&Checked::Valid(Semantic::Positions));
            if accessor.is_some_and(|accessor| accessor.value() >= root.accessors.len()) {
                let message = format!(
                    "index out of range: there are {} accessors: export it again",
                    root.accessors.len()
                );
                return Err(source
                    .broken(format!("meshes[{mesh}].primitives[{primitive}].attributes.POSITION"), message));
            }
        }
    }
    Ok(())
}

fn validate(source: Source, root: &Root) -> Result<(), LoadError> {
    let mut first = None;
    root.validate(root, JsonPath::new, &mut |path, error| {
        let path = path();
        if first.is_none() && !is_harmless(path.as_str(), error) {
            first = Some((path.as_str().to_owned(), error));
        }
    });
    let Some((place, error)) = first else { return Ok(()) };
    let message = match error {
        Error::IndexOutOfBounds => "index out of range: export it again".to_owned(),
        Error::Missing => "this is required and missing: export it again".to_owned(),
        Error::Unsupported => {
            let unknown = |name: &&String| !ENABLED_EXTENSIONS.contains(&name.as_str());
            let unknown: Vec<String> =
                root.extensions_required.iter().filter(unknown).map(|name| format!("`{name}`")).collect();
            let (unknown, supported) = (unknown.join(", "), ENABLED_EXTENSIONS.join(", "));
            let message = format!("{unknown} not supported; supported are {supported}: export it without");
            return Err(source.broken("extensionsRequired".to_owned(), message));
        }
        Error::Invalid | Error::Oversize => format!("{error}: export it again"),
    };
    Err(source.broken(place, message))
}

/// Bounds of positions are not used. A texture without a known image is reported as a missing image.
fn is_harmless(path: &str, error: Error) -> bool {
    let bounds = path.contains("POSITION") && (path.ends_with("min") || path.ends_with("max"));
    let source = path.starts_with("textures[") && path.ends_with("].source") && error == Error::Missing;
    bounds || source
}

/// The bytes of every buffer, with the declared length.
fn load(source: Source, root: &Root, binary: Option<&[u8]>) -> Result<Vec<Vec<u8>>, LoadError> {
    let mut buffers = Vec::with_capacity(root.buffers.len());
    for (index, buffer) in root.buffers.iter().enumerate() {
        let place = format!("buffers[{index}]");
        let bytes = match (&buffer.uri, binary) {
            (Some(uri), _) => fetch(source, uri).map_err(|message| source.broken(&place, message))?,
            (None, Some(binary)) if index == 0 => binary.to_vec(),
            (None, _) => {
                return Err(source.broken(place, "it has neither a URI nor a binary chunk: export it again"));
            }
        };
        if (bytes.len() as u64) < buffer.byte_length.0 {
            let message = format!(
                "truncated: {} bytes are needed, there are {}: get the file again",
                buffer.byte_length.0,
                bytes.len()
            );
            return Err(source.broken(place, message));
        }
        buffers.push(bytes);
    }
    Ok(buffers)
}

/// Content of a URI: a data URI, or a file beside the scene's file.
fn fetch(source: Source, uri: &str) -> Result<Vec<u8>, String> {
    if let Some(data) = uri.strip_prefix("data:") {
        let (kind, payload) = data.split_once(',').ok_or("a data URI without a comma")?;
        if !kind.ends_with(";base64") {
            return Err("a data URI that is not base64: export it as a file or in base64".to_owned());
        }
        return STANDARD.decode(payload.trim()).map_err(|error| format!("bad base64: {error}"));
    }
    let path = beside(source, uri)?;
    reader::named(&path).map_err(|error| {
        format!(
            "cannot read {}: {error}; put the file there, or export with everything embedded",
            path.display()
        )
    })
}

fn beside(source: Source, uri: &str) -> Result<PathBuf, String> {
    if uri.contains("://") {
        return Err(format!("{uri}: only files and data URIs are read, nothing is fetched"));
    }
    let name = unescape(uri).ok_or_else(|| format!("{uri}: a bad percent escape"))?;
    Ok(source.path.parent().map_or_else(|| PathBuf::from(&name), |folder| folder.join(&name)))
}

/// Undoes percent escapes.
fn unescape(uri: &str) -> Option<String> {
    let mut bytes = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let [first, tail @ ..] = rest {
        if *first == b'%' {
            let digits = std::str::from_utf8(tail.get(..2)?).ok()?;
            bytes.push(u8::from_str_radix(digits, 16).ok()?);
            rest = &tail[2..];
        } else {
            bytes.push(*first);
            rest = tail;
        }
    }
    String::from_utf8(bytes).ok()
}

/// All materials and, last, the default one for primitives without any (glTF 2.0, 3.9.6). Textures of those
/// that are not in use are not read.
fn materials(document: &Document, used: &Used, warnings: &mut Vec<Warning>) -> Vec<Material> {
    let mut images = Images { document, made: BTreeMap::new() };
    let mut materials = Vec::new();
    for (index, material) in document.root.materials.iter().enumerate() {
        let name = material.name.clone().unwrap_or_else(|| format!("material {index}"));
        let surface = &material.pbr_metallic_roughness;
        let [r, g, b, opacity] = surface.base_color_factor.0.map(|part| part.clamp(0.0, 1.0));
        let texture = surface.base_color_texture.as_ref().filter(|_| used.materials[index]);
        let texture = texture.and_then(|info| images.texture(info.index.value(), &name, warnings));
        let unlit = material.extensions.as_ref().is_some_and(|extensions| extensions.unlit.is_some());
        let base_color = Vec3::new(r, g, b);
        let (alpha, double_sided) = (alpha(material), material.double_sided);
        let made = Material { name, base_color, opacity, alpha, texture, double_sided, unlit };
        materials.push(made.simplified());
    }
    materials.push(Material::colored("default", Vec3::ONE));
    materials
}

fn alpha(material: &Described) -> Alpha {
    match material.alpha_mode {
        Checked::Valid(AlphaMode::Mask) => {
            Alpha::CutOut { cutoff: material.alpha_cutoff.as_ref().map_or(0.5, |cutoff| cutoff.0) }
        }
        Checked::Valid(AlphaMode::Blend) => Alpha::Blended,
        _ => Alpha::Opaque,
    }
}

struct Images<'d, 'a> {
    document: &'d Document<'a>,
    /// Textures by image and wrap, shared between materials.
    made: BTreeMap<(usize, [u8; 2]), Result<Arc<Texture>, String>>,
}

impl Images<'_, '_> {
    fn texture(&mut self, index: usize, material: &str, warnings: &mut Vec<Warning>) -> Option<Arc<Texture>> {
        let texture = self.document.root.textures.get(index)?;
        let (image, wrap) = (texture.source.value(), self.wrap(index));
        if self.is_blocky(index) {
            let what = "without filter drawn with one: magnified texels have soft edges";
            warnings.push(MaterialWarning(Code::TextureFilterIgnored, "texture", what).of(material));
        }
        let document = self.document;
        let key = (image, wrap.map(|wrap| wrap as u8));
        let made = self.made.entry(key).or_insert_with(|| load_texture(document, image, wrap).map(Arc::new));
        match made {
            Ok(texture) => Some(Arc::clone(texture)),
            Err(why) => {
                warnings.push(import::texture(material, &format!("image {why}")));
                None
            }
        }
    }

    /// Whether magnified texels are not filtered.
    fn is_blocky(&self, texture: usize) -> bool {
        let root = &self.document.root;
        let sampler = root.textures[texture].sampler.and_then(|sampler| root.samplers.get(sampler.value()));
        sampler.is_some_and(|sampler| sampler.mag_filter == Some(Checked::Valid(MagFilter::Nearest)))
    }

    fn wrap(&self, texture: usize) -> [Wrap; 2] {
        let root = &self.document.root;
        let sampler = root.textures[texture].sampler.and_then(|sampler| root.samplers.get(sampler.value()));
        let Some(sampler) = sampler else { return [Wrap::Repeat; 2] };
        [&sampler.wrap_s, &sampler.wrap_t].map(|mode| match mode {
            Checked::Valid(WrappingMode::ClampToEdge) => Wrap::Clamp,
            Checked::Valid(WrappingMode::MirroredRepeat) => Wrap::Mirror,
            _ => Wrap::Repeat,
        })
    }
}

fn load_texture(document: &Document, index: usize, wrap: [Wrap; 2]) -> Result<Texture, String> {
    let Some(described) = document.root.images.get(index) else {
        return Err("is of a kind that is not supported".to_owned());
    };
    match (&described.uri, described.buffer_view) {
        (Some(uri), _) => {
            let shown = if uri.starts_with("data:") { "data URI" } else { uri };
            let bytes = fetch(document.source, uri).map_err(|why| format!("`{shown}`: {why}"))?;
            reader::decode_texture(&bytes, wrap).map_err(|why| format!("`{shown}`: {why}"))
        }
        (None, Some(view)) => {
            let bytes = document.view(view.value()).map_err(|why| format!("{index}: {why}"))?;
            reader::decode_texture(bytes, wrap).map_err(|why| format!("{index}: {why}"))
        }
        (None, None) => Err(format!("{index} has neither a URI nor a buffer view")),
    }
}

/// Meshes and materials in use. Errors in others do not change the image.
struct Used {
    pub meshes: Vec<bool>,
    pub materials: Vec<bool>,
}

impl Used {
    pub fn new(document: &Document, tree: &Tree, looks: MaterialSource) -> Self {
        let root = &document.root;
        let mut used =
            Self { meshes: vec![false; root.meshes.len()], materials: vec![false; root.materials.len()] };
        for (index, node) in root.nodes.iter().enumerate() {
            let Some(mesh) = node.mesh.filter(|_| tree.in_scene[index]) else { continue };
            used.meshes[mesh.value()] = true;
            if looks == MaterialSource::Own {
                let primitives = root.meshes[mesh.value()].primitives.iter();
                let named = primitives.filter_map(|primitive| primitive.material);
                named.for_each(|material| used.materials[material.value()] = true);
            }
        }
        used
    }
}

/// Warnings about the materials in use, whose lowest vertex alpha is in `alpha`, and about extensions.
fn left_out(document: &Document, used: &Used, made: &[Material], alpha: &[f32]) -> Vec<Warning> {
    let root = &document.root;
    let mut warnings = Vec::new();
    for (index, described) in root.materials.iter().enumerate().filter(|(index, _)| used.materials[*index]) {
        let name = &made[index].name;
        if !matches!(described.alpha_mode, Checked::Valid(AlphaMode::Opaque)) && alpha[index] < 1.0 {
            warnings.push(import::VERTEX_ALPHA.of(name));
        }
        // Unlit materials have none of these (KHR_materials_unlit).
        if !made[index].unlit {
            warnings.extend(maps(described, name));
        }
    }
    let what = "ignored: what it describes looks or moves in another way";
    let changing = root.extensions_used.iter().filter(|name| changes_the_picture(name));
    warnings.extend(changing.map(|name| Warning::about(Code::ExtensionIgnored, "extension", what, name)));
    warnings
}

fn maps(described: &Described, name: &str) -> impl Iterator<Item = Warning> {
    let surface = &described.pbr_metallic_roughness;
    let normal = described.normal_texture.as_ref().is_some_and(|map| map.scale != 0.0);
    let occlusion = described.occlusion_texture.as_ref().is_some_and(|map| map.strength.0 > 0.0);
    let emissive = described.emissive_factor.0.iter().any(|channel| *channel > 0.0);
    let metallic = surface.metallic_factor.0 > 0.0 && surface.metallic_roughness_texture.is_none();
    let rough = surface.metallic_roughness_texture.is_some();
    let glossy = surface.metallic_factor.0 <= 0.0 && surface.roughness_factor.0 < 1.0 && !rough;
    let gloss = "ignored: every surface has the same faint highlight";
    let shaded = "ignored: ambient occlusion is not drawn";
    let found = [
        (normal, import::NORMAL_MAP),
        (emissive, import::EMISSIVE),
        (occlusion, MaterialWarning(Code::OcclusionMapIgnored, "occlusion map", shaded)),
        (metallic, import::METALLIC),
        (glossy, import::REFLECTION),
        (rough, MaterialWarning(Code::MetallicIgnored, "metallic-roughness map", gloss)),
    ];
    import::material_warnings(found, name)
}

/// Whether an extension that is not read changes the picture. Those of compression and of image formats bring
/// what is due without them, or the file requires them and is refused; variants of materials change nothing
/// until one is chosen.
fn changes_the_picture(name: &str) -> bool {
    let known = ["KHR_materials_unlit", "KHR_lights_punctual", "KHR_materials_variants"];
    let others = ["EXT_mesh_gpu_instancing", "KHR_animation_pointer", "KHR_node_visibility"];
    let kind = ["_materials_", "_lights_"].iter().any(|kind| name.contains(kind));
    !known.contains(&name) && (kind || others.contains(&name))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percent_escapes_are_undone() {
        assert_eq!(unescape("a%20b.bin").as_deref(), Some("a b.bin"));
        assert_eq!(unescape("100%"), None);
        assert_eq!(unescape("%zz"), None);
    }

    #[test]
    fn extensions_count_where_they_change_the_picture() {
        let of = ["KHR_materials_clearcoat", "EXT_lights_image_based", "KHR_animation_pointer"];
        assert!(of.into_iter().all(changes_the_picture));
        let harmless = [
            "KHR_materials_unlit",
            "KHR_texture_transform",
            "KHR_mesh_quantization",
            "EXT_texture_webp",
            "KHR_xmp",
        ];
        assert!(!harmless.into_iter().any(changes_the_picture));
    }
}
