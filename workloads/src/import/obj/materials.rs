//! The materials that an OBJ file names, from the files that describe them.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{Vec2, Vec3};
use pipeline::{Texture, Wrap};
use warnings::{Code, Warning};

use super::mtl::{self, Described, Map};
use super::statements::Statements;
use crate::error::{LoadError, Source};
use crate::import::soup::{Looks, Paint, Soup, grey, linear};
use crate::import::{ignored, image, reader};
use crate::material::Material;

/// Gives each triangle of `soup` the material that the file at `path` names for it.
pub(super) fn dress(soup: &mut Soup, found: &Statements, path: &Path) -> Result<(), LoadError> {
    let library = Library::read(found, path, &mut soup.warnings)?;
    let mut textures = Textures::default();
    // What is not described is grey, all of it one material.
    let described = |name: u32| library.described.get(&found.materials[name as usize]);
    let mut numbers: BTreeMap<Option<u32>, u32> = BTreeMap::new();
    let mut looks = Looks::default();
    for face in &found.faces {
        let key = face.material.filter(|name| described(*name).is_some());
        let number = *numbers.entry(key).or_insert_with(|| {
            looks.materials.push(match key.and_then(described) {
                Some((material, folder)) => textures.paint(material, folder, &mut soup.warnings),
                None => Paint { material: grey(), scale: Vec2::ONE, offset: Vec2::ZERO },
            });
            looks.materials.len() as u32 - 1
        });
        looks.of_triangle.push(number);
    }
    soup.warnings.extend(library.undescribed(found));
    soup.warnings.extend(untextured(found, &looks));
    soup.looks = looks;
    Ok(())
}

/// What the files of materials describe.
struct Library {
    /// By name, each with the folder of its file.
    described: BTreeMap<String, (Described, PathBuf)>,
    /// Whether every file that is named was read.
    whole: bool,
}

impl Library {
    fn read(found: &Statements, path: &Path, warnings: &mut Vec<Warning>) -> Result<Self, LoadError> {
        let folder = path.parent().unwrap_or(Path::new(""));
        let mut library = Self { described: BTreeMap::new(), whole: true };
        for file in files(&found.libraries, folder) {
            let there = reader::check_named(&file).map_err(|error| Source { path: &file }.unreadable(error));
            match there.and_then(|()| mtl::read(&file)) {
                Ok(materials) => {
                    let folder = file.parent().unwrap_or(Path::new("")).to_owned();
                    let named = materials.into_iter().map(|one| (one.name.clone(), (one, folder.clone())));
                    library.described.extend(named);
                }
                Err(LoadError::Read { file, source }) => {
                    library.whole = false;
                    let what = "not read: what it describes is grey";
                    let detail = format!("{file}: {source}");
                    warnings.push(Warning::about(Code::MissingMaterial, "material file", what, detail));
                }
                Err(error) => return Err(error),
            }
        }
        Ok(library)
    }

    /// Materials that faces use and no file describes. Where a file is missing they are most likely in it.
    fn undescribed(&self, found: &Statements) -> Vec<Warning> {
        let mut used = vec![false; found.materials.len()];
        found.faces.iter().filter_map(|face| face.material).for_each(|name| used[name as usize] = true);
        let names = found.materials.iter().zip(used).filter(|(_, used)| *used && self.whole);
        let names = names.map(|(name, _)| name).filter(|name| !self.described.contains_key(*name));
        let what = "described in no material file: drawn grey";
        names.map(|name| ignored::about_material(Code::MissingMaterial, "material", what, name)).collect()
    }
}

/// The files that `mtllib` statements name, beside the OBJ file: each one name, or several without spaces in them.
fn files(libraries: &[String], folder: &Path) -> Vec<PathBuf> {
    let beside = |name: &str| folder.join(name.replace('\\', "/"));
    let of_one = |name: &String| match beside(name) {
        whole if whole.is_file() || !name.contains(' ') => vec![whole],
        _ => name.split_ascii_whitespace().map(beside).collect(),
    };
    libraries.iter().flat_map(of_one).collect()
}

/// Textures that have been read, so that materials share them.
#[derive(Default)]
struct Textures {
    known: BTreeMap<(PathBuf, bool), Result<Arc<Texture>, String>>,
}

impl Textures {
    /// The material as it is drawn; what is left out of it becomes a warning.
    fn paint(&mut self, described: &Described, folder: &Path, warnings: &mut Vec<Warning>) -> Paint {
        let name = &described.name;
        let left_out = [
            described.cut_out.then(|| ignored::cut_out(name)),
            (described.is_see_through() && !described.cut_out).then(|| ignored::blended(name)),
            described.bumpy.then(|| ignored::normal_map(name)),
            described.displaced.then(|| ignored::displacement(name)),
            (described.metallic > 0.0).then(|| ignored::metallic(name)),
            described.shines().then(|| ignored::reflection(name)),
            described.emissive.then(|| ignored::emissive(name)),
        ];
        warnings.extend(left_out.into_iter().flatten());
        let map = described.texture.as_ref();
        let texture = map.map(|map| self.texture(map, folder)).and_then(|read| match read {
            Ok(texture) => Some(texture),
            Err(why) => {
                warnings.push(ignored::texture(name, &why));
                None
            }
        });
        let plain = if texture.is_some() { Vec3::ONE } else { grey().base_color };
        let base_color = described.color.map_or(plain, linear);
        let [scale, offset] = map.map_or([Vec2::ONE, Vec2::ZERO], placed);
        Paint { material: Material { name: name.clone(), base_color, texture, ..grey() }, scale, offset }
    }

    fn texture(&mut self, map: &Map, folder: &Path) -> Result<Arc<Texture>, String> {
        let wrap = [if map.clamped { Wrap::Clamp } else { Wrap::Repeat }; 2];
        let file = found_beside(&map.file, folder);
        let read = || image::load(&file, wrap).map(Arc::new).map_err(|why| format!("`{}`: {why}", map.file));
        self.known.entry((file.clone(), map.clamped)).or_insert_with(read).clone()
    }
}

/// The file `name`, beside the material file; where it is not there, as with the full path of another machine, the file of that
/// name in the same folder.
fn found_beside(name: &str, folder: &Path) -> PathBuf {
    let named = folder.join(name);
    let bare = name.rsplit('/').next().map(|bare| folder.join(bare)).filter(|bare| bare.is_file());
    if named.is_file() { named } else { bare.unwrap_or(named) }
}

/// Scale and offset for coordinates whose `v` counts downwards.
fn placed(map: &Map) -> [Vec2; 2] {
    [map.scale, Vec2::new(map.offset.x, 1.0 - map.scale.y - map.offset.y)]
}

/// Materials with a texture on faces without texture coordinates.
fn untextured(found: &Statements, looks: &Looks) -> Vec<Warning> {
    let mut bare = vec![false; looks.materials.len()];
    for (face, material) in found.faces.iter().zip(&looks.of_triangle) {
        bare[*material as usize] |= face.corners.iter().any(|corner| corner.uv.is_none());
    }
    let materials = looks.materials.iter().map(|paint| &paint.material).zip(bare);
    let materials = materials.filter(|(material, bare)| *bare && material.texture.is_some());
    let what = "on faces without texture coordinates: these show one texel, or the base colour where no face has any";
    materials
        .map(|(material, _)| {
            ignored::about_material(Code::MissingTexcoord, "textured material", what, &material.name)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A red and a textured face, one of an unknown material and one before any is named.
    const OBJ: &str = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/1\nusemtl red\nf 1/1 2/1 3/1\nusemtl wall\n\
                       f 1/1 2/1 3/1\nusemtl gone\nf 1/1 2/1 3/1\nusemtl red\nf 1/1 2/1 3/1\n";

    const MTL: &str = "newmtl red\nKd 1 0 0\nbump n.png\nnewmtl wall\nKd 0.5 0.5 0.5\nmap_Kd -s 2 2 C:\\there\\wall.png\nd 0.5\n\
                       newmtl unused\nmap_Kd nothing.png\nbump n.png\n";

    fn dressed(mtl: Option<&str>, image: bool) -> (Looks, Vec<String>) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.obj");
        std::fs::write(&path, OBJ).unwrap();
        mtl.iter().for_each(|text| std::fs::write(folder.path().join("a.mtl"), text).unwrap());
        if image {
            ::image::RgbImage::new(2, 2).save(folder.path().join("wall.png")).unwrap();
        }
        let soup = super::super::read(&path).unwrap();
        let warnings = Warning::fold(soup.warnings).iter().map(Warning::to_string).collect();
        (soup.looks, warnings)
    }

    #[test]
    fn faces_get_their_materials() {
        let (looks, warnings) = dressed(Some(MTL), true);
        assert_eq!(looks.of_triangle, [0, 1, 2, 0, 1]);
        let [none, red, wall] = &looks.materials[..] else { panic!("{looks:?}") };
        assert_eq!((none.material.base_color, red.material.base_color), (grey().base_color, Vec3::X));
        assert!(wall.material.texture.is_some() && wall.material.double_sided);
        assert_eq!((wall.scale, wall.offset), (Vec2::splat(2.0), Vec2::new(0.0, -1.0)));
        let [alpha, missing, bump] = &warnings[..] else { panic!("{warnings:#?}") };
        assert!(alpha.starts_with("[alpha-ignored] 1 see-through material"), "{alpha}");
        assert!(missing.contains("missing-material") && missing.contains("`gone`"), "{missing}");
        assert!(bump.contains("1 normal map ignored") && bump.contains("`red`"), "{bump}");
    }

    #[test]
    fn what_is_missing_is_named() {
        let (looks, warnings) = dressed(None, true);
        assert_eq!((looks.materials.len(), &looks.of_triangle[..]), (1, &[0; 5][..]));
        let [missing] = &warnings[..] else { panic!("{warnings:#?}") };
        assert!(missing.contains("1 material file not read") && missing.contains("a.mtl"), "{missing}");
        let (looks, warnings) = dressed(Some(MTL), false);
        assert!(looks.materials[2].material.texture.is_none());
        assert!(
            warnings.iter().any(|warning| warning.contains("missing-image") && warning.contains("wall.png"))
        );
    }
}
