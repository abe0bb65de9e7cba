//! Materials and their base-colour textures.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::Vec3;
use gltf::json::texture::{MagFilter, WrappingMode};
use gltf::json::validation::Checked;
use pipeline::{Texture, Wrap};
use warnings::{Code, Warning};

use super::buffers;
use super::document::Document;
use super::left_out::Used;
use crate::import::{ignored, image};
use crate::material::Material;

/// All materials and, last, the default one for primitives without any (glTF 2.0, 3.9.6). Textures of those that are not in use
/// are not read.
pub(super) fn materials(document: &Document, used: &Used, warnings: &mut Vec<Warning>) -> Vec<Material> {
    let mut images = Images { document, made: BTreeMap::new() };
    let mut materials = Vec::new();
    for (index, material) in document.root.materials.iter().enumerate() {
        let name = material.name.clone().unwrap_or_else(|| format!("material {index}"));
        let surface = &material.pbr_metallic_roughness;
        let [r, g, b, _] = surface.base_color_factor.0.map(|part| part.clamp(0.0, 1.0));
        let texture = surface.base_color_texture.as_ref().filter(|_| used.materials[index]);
        let texture = texture.and_then(|info| images.texture(info.index.value(), &name, warnings));
        let unlit = material.extensions.as_ref().is_some_and(|extensions| extensions.unlit.is_some());
        let base_color = Vec3::new(r, g, b);
        materials.push(Material { name, base_color, texture, double_sided: material.double_sided, unlit });
    }
    materials.push(Material::colored("default", Vec3::ONE));
    materials
}

struct Images<'d, 'a> {
    document: &'d Document<'a>,
    /// By image and wrap, so that materials that share an image share its texture.
    made: BTreeMap<(usize, [u8; 2]), Result<Arc<Texture>, String>>,
}

impl Images<'_, '_> {
    fn texture(&mut self, index: usize, material: &str, warnings: &mut Vec<Warning>) -> Option<Arc<Texture>> {
        let texture = self.document.root.textures.get(index)?;
        let (image, wrap) = (texture.source.value(), self.wrap(index));
        if self.is_blocky(index) {
            let what = "without filter drawn with one: magnified texels have soft edges";
            warnings.push(ignored::about_material(Code::TextureFilterIgnored, "texture", what, material));
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

    /// Whether texels should show as squares.
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
            let bytes = buffers::fetch(document.source, uri).map_err(|why| format!("`{shown}`: {why}"))?;
            image::decode(&bytes, wrap).map_err(|why| format!("`{shown}`: {why}"))
        }
        (None, Some(view)) => {
            let bytes = document.view(view.value()).map_err(|why| format!("{index}: {why}"))?;
            image::decode(bytes, wrap).map_err(|why| format!("{index}: {why}"))
        }
        (None, None) => Err(format!("{index} has neither a URI nor a buffer view")),
    }
}
