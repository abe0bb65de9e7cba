//! Materials, their base-colour textures, and warnings about content that is not drawn.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::Vec3;
use gltf::json::material::{AlphaMode, Material as Described};
use gltf::json::texture::{MagFilter, WrappingMode};
use gltf::json::validation::Checked;
use pipeline::{Texture, Wrap};
use warnings::{Code, Warning};

use super::nodes::Tree;
use super::{Document, MaterialSource, fetch};
use crate::import::ignored::{self, about_material};
use crate::import::reader;
use crate::material::{Alpha, Material};

/// All materials and, last, the default one for primitives without any (glTF 2.0, 3.9.6). Textures of those that are not in use
/// are not read.
pub(super) fn materials(document: &Document, used: &Used, warnings: &mut Vec<Warning>) -> Vec<Material> {
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
            warnings.push(about_material(Code::TextureFilterIgnored, "texture", what, material));
        }
        let document = self.document;
        let key = (image, wrap.map(|wrap| wrap as u8));
        let made = self.made.entry(key).or_insert_with(|| load(document, image, wrap).map(Arc::new));
        match made {
            Ok(texture) => Some(Arc::clone(texture)),
            Err(why) => {
                warnings.push(ignored::texture(material, &format!("image {why}")));
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

fn load(document: &Document, index: usize, wrap: [Wrap; 2]) -> Result<Texture, String> {
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
pub(super) struct Used {
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
pub(super) fn left_out(document: &Document, used: &Used, made: &[Material], alpha: &[f32]) -> Vec<Warning> {
    let root = &document.root;
    let mut warnings = Vec::new();
    for (index, described) in root.materials.iter().enumerate().filter(|(index, _)| used.materials[*index]) {
        let name = &made[index].name;
        if !matches!(described.alpha_mode, Checked::Valid(AlphaMode::Opaque)) && alpha[index] < 1.0 {
            warnings.push(ignored::vertex_alpha(name));
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

fn maps(described: &Described, name: &str) -> Vec<Warning> {
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
        normal.then(|| ignored::normal_map(name)),
        emissive.then(|| ignored::emissive(name)),
        occlusion.then(|| about_material(Code::OcclusionMapIgnored, "occlusion map", shaded, name)),
        metallic.then(|| ignored::metallic(name)),
        glossy.then(|| ignored::reflection(name)),
        rough.then(|| about_material(Code::MetallicIgnored, "metallic-roughness map", gloss, name)),
    ];
    found.into_iter().flatten().collect()
}

/// Whether an extension that is not read changes the picture. Those of compression and of image formats bring what is due without
/// them, or the file requires them and is refused; variants of materials change nothing until one is chosen.
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
