//! The materials that an OBJ file names, from the files that describe them.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{Vec2, Vec3};
use pipeline::{Texture, Wrap};
use warnings::{Code, Warning};

use super::{Statements, broken, lines};
use crate::error::{LoadError, Source};
use crate::import;
use crate::import::reader::{Paint, Soup, TriangleMaterials, grey, linear};
use crate::import::{MaterialWarning, reader};
use crate::material::{Alpha, Material};

/// Gives each triangle of `soup` the material that the file at `path` names for it.
pub(super) fn dress(soup: &mut Soup, found: &Statements, path: &Path) -> Result<(), LoadError> {
    let library = Library::read(found, path, &mut soup.warnings)?;
    let mut textures = Textures::default();
    // All materials without a description are one grey material.
    let described = |name: u32| library.described.get(&found.materials[name as usize]);
    let mut numbers: BTreeMap<Option<u32>, u32> = BTreeMap::new();
    let mut looks = TriangleMaterials::default();
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

/// Contents of the material files.
struct Library {
    /// By name, each with the folder of its file.
    described: BTreeMap<String, (Described, PathBuf)>,
    /// Whether all named files were read.
    whole: bool,
}

impl Library {
    fn read(found: &Statements, path: &Path, warnings: &mut Vec<Warning>) -> Result<Self, LoadError> {
        let folder = path.parent().unwrap_or(Path::new(""));
        let mut library = Self { described: BTreeMap::new(), whole: true };
        for file in files(&found.libraries, folder) {
            let there = reader::check_named(&file).map_err(|error| Source { path: &file }.unreadable(error));
            match there.and_then(|()| read(&file)) {
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

    /// Warns about materials in use without a description, unless a material file is missing, too.
    fn undescribed(&self, found: &Statements) -> Vec<Warning> {
        let mut used = vec![false; found.materials.len()];
        found.faces.iter().filter_map(|face| face.material).for_each(|name| used[name as usize] = true);
        let names = found.materials.iter().zip(used).filter(|(_, used)| *used && self.whole);
        let names = names.map(|(name, _)| name).filter(|name| !self.described.contains_key(*name));
        let missing =
            MaterialWarning(Code::MissingMaterial, "material", "missing from the material files: drawn grey");
        names.map(|name| missing.of(name)).collect()
    }
}

/// Files named by `mtllib` statements, beside the OBJ file: one name, or several without spaces.
fn files(libraries: &[String], folder: &Path) -> Vec<PathBuf> {
    let beside = |name: &str| folder.join(name.replace('\\', "/"));
    let of_one = |name: &String| match beside(name) {
        whole if whole.is_file() || !name.contains(' ') => vec![whole],
        _ => name.split_ascii_whitespace().map(beside).collect(),
    };
    libraries.iter().flat_map(of_one).collect()
}

/// Textures that were read, shared between materials.
#[derive(Default)]
struct Textures {
    known: BTreeMap<(PathBuf, bool), Result<Arc<Texture>, String>>,
}

impl Textures {
    /// The drawn material, and warnings about its ignored parts.
    fn paint(&mut self, described: &Described, folder: &Path, warnings: &mut Vec<Warning>) -> Paint {
        let name = &described.name;
        let left_out = [
            (described.opacity_map, import::OPACITY_MAP),
            (described.shine.filters, import::FILTER),
            (described.bumpy, import::NORMAL_MAP),
            (described.displaced, import::DISPLACEMENT),
            (described.metallic > 0.0, import::METALLIC),
            (described.shines(), import::REFLECTION),
            (described.emissive, import::EMISSIVE),
        ];
        warnings.extend(import::material_warnings(left_out, name));
        let map = described.texture.as_ref();
        let texture = map.map(|map| self.texture(map, folder)).and_then(|read| match read {
            Ok(texture) => Some(texture),
            Err(why) => {
                warnings.push(import::texture(name, &why));
                None
            }
        });
        let plain = if texture.is_some() { Vec3::ONE } else { grey().base_color };
        let base_color = described.color.map_or(plain, linear);
        let [scale, offset] = map.map_or([Vec2::ONE, Vec2::ZERO], placed);
        let (name, opacity) = (name.clone(), described.opacity.clamp(0.0, 1.0));
        let alpha = if opacity < 1.0 { Alpha::Blended } else { Alpha::Opaque };
        let material = Material { name, base_color, opacity, alpha, texture, ..grey() };
        Paint { material, scale, offset }
    }

    fn texture(&mut self, map: &Map, folder: &Path) -> Result<Arc<Texture>, String> {
        let wrap = [if map.clamped { Wrap::Clamp } else { Wrap::Repeat }; 2];
        let file = found_beside(&map.file, folder);
        let read = || {
            reader::load_texture(&file, wrap).map(Arc::new).map_err(|why| format!("`{}`: {why}", map.file))
        };
        self.known.entry((file.clone(), map.clamped)).or_insert_with(read).clone()
    }
}

/// The file `name`, beside the material file; where it is not there, as with the full path of another
/// machine, the file of that name in the same folder.
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
fn untextured(found: &Statements, looks: &TriangleMaterials) -> Vec<Warning> {
    let mut bare = vec![false; looks.materials.len()];
    for (face, material) in found.faces.iter().zip(&looks.of_triangle) {
        bare[*material as usize] |= face.corners.iter().any(|corner| corner.uv.is_none());
    }
    let materials = looks.materials.iter().map(|paint| &paint.material).zip(bare);
    let materials = materials.filter(|(material, bare)| *bare && material.texture.is_some());
    let what = "on faces without texture coordinates: these show one texel, or the base colour where no face has any";
    let untextured = MaterialWarning(Code::MissingTexcoord, "textured material", what);
    materials.map(|(material, _)| untextured.of(&material.name)).collect()
}

/// A material of the file.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Described {
    pub name: String,
    /// `Kd`, as shown on a screen.
    pub color: Option<[f32; 3]>,
    /// `map_Kd`.
    pub texture: Option<Map>,
    /// `d`, or `1 - Tr`; 1 is opaque.
    pub opacity: f32,
    /// Whether there is a `map_d`.
    pub opacity_map: bool,
    /// Whether there is a normal or bump map.
    pub bumpy: bool,
    /// Whether there is a displacement map.
    pub displaced: bool,
    /// Whether it is emissive (`Ke`, `map_Ke`).
    pub emissive: bool,
    /// `Pm`: metalness.
    pub metallic: f32,
    shine: Shine,
}

/// Highlight, reflections and transmission of a material.
#[derive(Clone, Debug, Default, PartialEq)]
struct Shine {
    /// Whether `Ks` is not black; `None` if it is not given.
    specular: Option<bool>,
    /// Whether there is a `map_Ks` or `map_Ns`.
    mapped: bool,
    /// `refl`, or a coat.
    reflects: bool,
    /// `Pr`.
    roughness: Option<f32>,
    /// `Tf` is neither white, which filters nothing, nor black.
    filters: bool,
    /// `illum`: 0 and 1 have no highlight.
    model: Option<u8>,
}

/// A texture and its options.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Map {
    /// The file as named, with slashes.
    pub file: String,
    /// `-s`.
    pub scale: Vec2,
    /// `-o`.
    pub offset: Vec2,
    /// `-clamp on`.
    pub clamped: bool,
}

/// Reads the materials in the file at `path`.
pub(super) fn read(path: &Path) -> Result<Vec<Described>, LoadError> {
    let mut found: Vec<Described> = Vec::new();
    for (number, line) in lines(path)? {
        let line = line?;
        let line = line.trim_start();
        let (word, rest) = line.split_once(|c: char| c.is_ascii_whitespace()).unwrap_or((line, ""));
        let rest = rest.trim();
        if word == "newmtl" {
            found.push(Described { name: rest.to_owned(), opacity: 1.0, ..Described::default() });
        } else if let Some(material) = found.last_mut() {
            material.statement(word, rest).map_err(|what| broken(path, number, &what))?;
        }
    }
    Ok(found)
}

impl Described {
    fn statement(&mut self, word: &str, rest: &str) -> Result<(), String> {
        match word {
            "Kd" => self.color = color(rest)?,
            "Ke" => self.emissive = color(rest)?.is_some_and(is_bright),
            "Ks" => self.shine.specular = Some(color(rest)?.is_some_and(is_bright)),
            "Tf" => self.shine.filters = color(rest)?.is_some_and(|c| is_bright(c) && c != [1.0; 3]),
            "illum" => self.shine.model = rest.parse().ok(),
            "Pm" => self.metallic = number(rest)?,
            "Pr" => self.shine.roughness = Some(number(rest)?),
            "Pc" | "Ps" => self.shine.reflects |= color(rest)?.is_some_and(is_bright),
            "d" => self.opacity = opacity(rest)?,
            "Tr" => self.opacity = 1.0 - opacity(rest)?,
            "map_Kd" => self.texture = Some(Map::new(rest)?),
            "map_d" => self.opacity_map = true,
            "map_Ke" => self.emissive = true,
            "map_Ks" | "map_Ns" | "map_Pr" => self.shine.mapped = true,
            "map_Pm" => self.metallic = 1.0,
            "refl" => self.shine.reflects = true,
            "disp" => self.displaced = true,
            "bump" | "norm" => self.bumpy = true,
            _ if word.eq_ignore_ascii_case("map_bump") => self.bumpy = true,
            _ => {}
        }
        Ok(())
    }

    /// Whether the highlight or reflections differ from those drawn.
    pub fn shines(&self) -> bool {
        let Shine { specular, mapped, reflects, roughness, model, .. } = self.shine;
        let has_highlight = !matches!(model, Some(0 | 1)) && specular.unwrap_or(mapped);
        has_highlight || reflects || self.metallic <= 0.0 && roughness.is_some_and(|rough| rough < 1.0)
    }
}

fn is_bright(color: [f32; 3]) -> bool {
    color.iter().any(|channel| *channel > 0.0)
}

/// One number for grey, or three; nothing for a spectrum or another colour space.
fn color(text: &str) -> Result<Option<[f32; 3]>, String> {
    if text.starts_with("spectral") || text.starts_with("xyz") {
        return Ok(None);
    }
    let numbers: Vec<f32> = text.split_ascii_whitespace().map(number).collect::<Result<_, _>>()?;
    match numbers[..] {
        [grey] => Ok(Some([grey; 3])),
        [red, green, blue, ..] => Ok(Some([red, green, blue])),
        _ => Err(format!("a colour of {} numbers instead of 1 or 3", numbers.len())),
    }
}

/// `d` may be `-halo 0.5`.
fn opacity(text: &str) -> Result<f32, String> {
    number(text.split_ascii_whitespace().next_back().unwrap_or_default())
}

fn number(word: &str) -> Result<f32, String> {
    let number = word.parse().ok().filter(|number: &f32| number.is_finite());
    number.ok_or_else(|| format!("`{word}` is not a number"))
}

impl Map {
    /// Options, each with its values, and then a name that may have spaces.
    fn new(text: &str) -> Result<Self, String> {
        let mut map = Self { file: String::new(), scale: Vec2::ONE, offset: Vec2::ZERO, clamped: false };
        let mut rest = text;
        while let Some((option, after)) = rest.split_once(|c: char| c.is_ascii_whitespace()) {
            let Some(most) = values_of(option) else { break };
            let mut values = Vec::new();
            rest = after.trim_start();
            while values.len() < most {
                let (word, after) = rest.split_once(|c: char| c.is_ascii_whitespace()).unwrap_or((rest, ""));
                let is_number = word.parse::<f32>().is_ok_and(f32::is_finite);
                // Vectors may have fewer values; a word is always present.
                if most > 1 && !is_number || after.trim().is_empty() {
                    break;
                }
                values.push(word);
                rest = after.trim_start();
            }
            map.option(option, &values);
        }
        map.file = rest.trim().replace('\\', "/");
        if map.file.is_empty() { Err("a map without a file".to_owned()) } else { Ok(map) }
    }

    fn option(&mut self, option: &str, values: &[&str]) {
        let value = |index: usize| values.get(index).and_then(|word| word.parse().ok());
        match option {
            "-s" => self.scale = Vec2::new(value(0).unwrap_or(1.0), value(1).unwrap_or(1.0)),
            "-o" => self.offset = Vec2::new(value(0).unwrap_or(0.0), value(1).unwrap_or(0.0)),
            "-clamp" => self.clamped = values == ["on"],
            _ => {}
        }
    }
}

/// Largest number of values of an option; `None` for an unknown option.
fn values_of(option: &str) -> Option<usize> {
    match option {
        "-s" | "-o" | "-t" => Some(3),
        "-mm" => Some(2),
        "-blendu" | "-blendv" | "-clamp" | "-cc" | "-bm" | "-boost" | "-texres" | "-imfchan" | "-type" => {
            Some(1)
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A red and a textured face, one of an unknown material and one before any is named.
    const OBJ: &str = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/1\nusemtl red\nf 1/1 2/1 3/1\nusemtl wall\n\
                       f 1/1 2/1 3/1\nusemtl gone\nf 1/1 2/1 3/1\nusemtl red\nf 1/1 2/1 3/1\n";

    const MTL: &str = "newmtl red\nKd 1 0 0\nbump n.png\nnewmtl wall\nKd 0.5 0.5 0.5\nmap_Kd -s 2 2 C:\\there\\wall.png\nd 0.5\n\
                       newmtl unused\nmap_Kd nothing.png\nbump n.png\n";

    fn dressed(mtl: Option<&str>, image: bool) -> (TriangleMaterials, Vec<String>) {
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
        assert_eq!((wall.material.alpha, wall.material.opacity), (Alpha::Blended, 0.5));
        let [missing, bump] = &warnings[..] else { panic!("{warnings:#?}") };
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

    fn parse(text: &str) -> Result<Vec<Described>, String> {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), text).unwrap();
        read(file.path()).map_err(|error| error.to_string())
    }

    #[test]
    fn materials_are_read_as_exporters_write_them() {
        let text = "# a comment\nNs 10\nnewmtl red paint\n  Kd 1 0 0\n\tTr 0.25\nillum 2\n\nnewmtl wall\nmap_Kd -s 2 4 -o 0.5 -clamp on \
                    dir\\a b.png\nmap_bump n.png\nmap_d -imfchan m a.png\nKe 0 0 0\nKd 0.5\nnewmtl lamp\nKe 1 1 1\nd -halo 0.5\nKd spectral a.rfl\n";
        let found = parse(text).unwrap();
        assert_eq!(found.len(), 3);
        assert_eq!(
            (found[0].name.as_str(), found[0].color, found[0].opacity),
            ("red paint", Some([1.0, 0.0, 0.0]), 0.75)
        );
        let map = Map {
            file: "dir/a b.png".to_owned(),
            scale: Vec2::new(2.0, 4.0),
            offset: Vec2::new(0.5, 0.0),
            clamped: true,
        };
        assert_eq!((&found[1].texture, found[1].color), (&Some(map), Some([0.5; 3])));
        assert_eq!(
            (found[1].bumpy, found[1].opacity_map, found[1].emissive, found[1].opacity),
            (true, true, false, 1.0)
        );
        assert_eq!((found[2].emissive, found[2].opacity, found[2].color), (true, 0.5, None));
    }

    #[test]
    fn only_what_changes_the_picture_shines_or_shows_what_is_behind() {
        let of = |text: &str| {
            let found = parse(&format!("newmtl a\n{text}\n")).unwrap();
            (found[0].shines(), found[0].opacity < 1.0 || found[0].shine.filters)
        };
        for harmless in [
            "Ks 0 0 0\nNs 500\nillum 2",
            "Ks 1 1 1\nillum 1",
            "Ns 10",
            "Tf 1 1 1",
            "Tf 0 0 0",
            "Pr 1",
            "illum 2",
        ] {
            assert_eq!(of(harmless), (false, false), "{harmless}");
        }
        for shiny in [
            "Ks 1 1 1",
            "Ks 0.5\nNs 10\nillum 2",
            "map_Ks a.png",
            "refl -type sphere a.png",
            "Pr 0.2",
            "Pc 0.5",
        ] {
            assert_eq!(of(shiny), (true, false), "{shiny}");
        }
        for clear in ["d 0.5", "Tr 0.5", "Tf 0.2 0.9 0.2"] {
            assert_eq!(of(clear), (false, true), "{clear}");
        }
    }

    #[test]
    fn maps_are_files_with_options_before_them() {
        let file = |text| Map::new(text).map(|map| map.file);
        for (text, expected) in [
            ("a.png", "a.png"),
            ("-bm 0.2 a b.png", "a b.png"),
            ("-s 1 1 1 2.png", "2.png"),
            ("-s 1 1 2", "2"),
            ("-mm 0 1 c:\\x\\y.png", "c:/x/y.png"),
            ("-texres 512 a.png", "a.png"),
            ("-unknown a.png", "-unknown a.png"),
        ] {
            assert_eq!(file(text).as_deref(), Ok(expected), "{text}");
        }
        assert!(file("").is_err());
    }

    #[test]
    fn broken_lines_are_named() {
        for (text, expected) in [
            ("newmtl a\nKd 1 2\n", "line 2: a colour of 2 numbers"),
            ("newmtl a\n\nKd\n", "line 3: a colour of 0 numbers"),
            ("newmtl a\nd x\n", "line 2: `x` is not a number"),
            ("newmtl a\nKd 1 nan 0\n", "line 2: `nan` is not a number"),
            ("newmtl a\nmap_Kd\n", "line 2: a map without a file"),
        ] {
            let error = parse(text).unwrap_err();
            assert!(error.contains(expected), "{text:?}: {error}");
        }
        assert_eq!(parse("").unwrap(), []);
    }
}
