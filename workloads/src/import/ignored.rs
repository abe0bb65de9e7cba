//! Warnings about content that is not drawn, the same for all formats.

use std::path::Path;

use warnings::{Code, Warning};

/// A material with a normal or bump map.
pub(super) fn normal_map(material: &str) -> Warning {
    about_material(
        Code::NormalMapIgnored,
        "normal map",
        "ignored: surfaces keep the normals of their vertices",
        material,
    )
}

/// An emissive material.
pub(super) fn emissive(material: &str) -> Warning {
    about_material(Code::EmissiveIgnored, "emissive material", "drawn without emitting light", material)
}

/// A material with a map of its opacity alone.
pub(super) fn opacity_map(material: &str) -> Warning {
    let what = "ignored: the opacity of the material is the same everywhere";
    about_material(Code::AlphaIgnored, "opacity map", what, material)
}

/// A material that filters the light behind it.
pub(super) fn filter(material: &str) -> Warning {
    let what = "drawn without filtering the light of what is behind";
    about_material(Code::AlphaIgnored, "transmissive material", what, material)
}

/// A material whose opacity is that of its vertices.
pub(super) fn vertex_alpha(material: &str) -> Warning {
    let what = "with opacities of vertices, which are ignored";
    about_material(Code::AlphaIgnored, "material", what, material)
}

/// A texture that cannot be read, for the reason `why`.
pub(super) fn texture(material: &str, why: &str) -> Warning {
    let detail = format!("material `{material}`: {why}");
    Warning::about(Code::MissingImage, "texture", "not read: the material's colour is used alone", detail)
}

/// A material that is metallic.
pub(super) fn metallic(material: &str) -> Warning {
    let what = "drawn as diffuse ones with a faint highlight";
    about_material(Code::MetallicIgnored, "metallic material", what, material)
}

/// A material with its own highlight, roughness or reflections.
pub(super) fn reflection(material: &str) -> Warning {
    let what = "with a highlight or reflections of its own: every surface has the same faint highlight";
    about_material(Code::ReflectionIgnored, "material", what, material)
}

/// A material with a displacement map.
pub(super) fn displacement(material: &str) -> Warning {
    let what = "ignored: surfaces stay where they are";
    about_material(Code::DisplacementIgnored, "displacement map", what, material)
}

/// A file with face colours.
pub(super) fn face_colors(path: &Path) -> Warning {
    let what = "with colours for faces, which are drawn without them";
    Warning::about(Code::FaceColorsIgnored, "file", what, path.display().to_string())
}

/// A warning about a material.
pub(super) fn about_material(code: Code, thing: &'static str, what: &'static str, material: &str) -> Warning {
    Warning::about(code, thing, what, format!("material `{material}`"))
}
