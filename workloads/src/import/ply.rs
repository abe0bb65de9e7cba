//! PLY files: vertices with optional normals, colours and texture coordinates, and faces of any number of corners.

use std::io::BufRead;
use std::path::Path;

use glam::{DVec3, Vec2, Vec3};
use ply_rs_bw::parser::{ParseError, Parser, Reader};
use ply_rs_bw::ply::{
    ElementDef, Header, Property, PropertyAccess, PropertyAccessResult, PropertyType, ScalarType,
};
use warnings::{Code, Warning};

use super::super::import;
use super::reader;
use super::reader::{MAX_ELEMENTS, Soup, linear};
use crate::error::{LoadError, Source};

/// What to do about a header that cannot be used.
const REMEDY: &str = "export it again as a PLY file of vertices and faces";

/// Most characters of a line that are quoted.
const MAX_QUOTED: usize = 40;

#[derive(Default)]
struct Vertex {
    position: DVec3,
    normal: Vec3,
    uv: Vec2,
    /// As shown on a screen, 0 to 1.
    color: [f32; 3],
}

#[derive(Default)]
struct Face {
    corners: Option<Vec<u32>>,
}

/// An element that is read past.
struct Skipped;

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        let axis = match name {
            "x" => Some(&mut self.position.x),
            "y" => Some(&mut self.position.y),
            "z" => Some(&mut self.position.z),
            _ => None,
        };
        if let (Some(axis), Some(value)) = (axis, number(&property)) {
            *axis = value;
            return PropertyAccessResult::Set;
        }
        let slot = match name {
            "red" => &mut self.color[0],
            "green" => &mut self.color[1],
            "blue" => &mut self.color[2],
            "nx" => &mut self.normal.x,
            "ny" => &mut self.normal.y,
            "nz" => &mut self.normal.z,
            "s" | "u" | "texture_u" => &mut self.uv.x,
            "t" | "v" | "texture_v" => &mut self.uv.y,
            _ => return PropertyAccessResult::Ignored,
        };
        let most = if matches!(name, "red" | "green" | "blue") { brightest(&property) } else { 1.0 };
        match number(&property) {
            Some(value) => {
                *slot = (value / most) as f32;
                PropertyAccessResult::Set
            }
            None => PropertyAccessResult::UnsupportedType,
        }
    }
}

/// A property that is one number.
fn number(property: &Property) -> Option<f64> {
    Some(match property {
        Property::Char(value) => f64::from(*value),
        Property::UChar(value) => f64::from(*value),
        Property::Short(value) => f64::from(*value),
        Property::UShort(value) => f64::from(*value),
        Property::Int(value) => f64::from(*value),
        Property::UInt(value) => f64::from(*value),
        Property::Float(value) => f64::from(*value),
        Property::Double(value) => *value,
        _ => return None,
    })
}

/// The value of a channel of a colour at full brightness.
fn brightest(property: &Property) -> f64 {
    match property {
        Property::Float(_) | Property::Double(_) => 1.0,
        Property::Short(_) | Property::UShort(_) => 65_535.0,
        _ => 255.0,
    }
}

impl PropertyAccess for Face {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        if !is_corners(name) {
            return PropertyAccessResult::Ignored;
        }
        self.corners = property.to_u32_list();
        if self.corners.is_some() { PropertyAccessResult::Set } else { PropertyAccessResult::UnsupportedType }
    }
}

impl PropertyAccess for Skipped {
    fn new() -> Self {
        Self
    }
}

fn is_corners(name: &str) -> bool {
    matches!(name, "vertex_indices" | "vertex_index")
}

/// Reads the PLY file at `path`, gzipped or not.
pub(super) fn read(path: &Path) -> Result<Soup, LoadError> {
    let source = Source { path };
    let mut input = Reader::new(reader::open(path)?);
    let header = Parser::<Skipped>::new().read_header(&mut input);
    let header =
        header.map_err(|error| source.broken("header", wrong_header(path, &error, input.get_mut())))?;
    check(&header).map_err(|message| source.broken("header", message))?;
    let mut soup = Soup { warnings: left_out(&header, path), ..Soup::default() };
    for element in header.elements.values() {
        let damaged = |error: ParseError| {
            if let Some(error) = not_finite(source, element, &error) {
                return error;
            }
            let place = format!("element {}", element.name);
            source.broken(place, format!("{}; the file may be truncated: get it again", in_one_line(&error)))
        };
        match element.name.as_str() {
            "vertex" => {
                let read = Parser::<Vertex>::new().read_payload_for_element(&mut input, element, &header);
                take_vertices(&mut soup, element, read.map_err(damaged)?);
                if stored_single(element) {
                    soup.warn_if_rounded(path);
                }
            }
            "face" => {
                let read = Parser::<Face>::new().read_payload_for_element(&mut input, element, &header);
                read.map_err(damaged)?
                    .iter()
                    .for_each(|face| soup.polygon(face.corners.as_deref().unwrap_or(&[])));
            }
            _ => {
                let read = Parser::<Skipped>::new().read_payload_for_element(&mut input, element, &header);
                read.map_err(damaged)?;
            }
        }
    }
    Ok(soup)
}

/// What is wrong with a header that cannot be read, and what to do; `rest` follows it in the file at `path`.
fn wrong_header(path: &Path, error: &ParseError, rest: &mut impl BufRead) -> String {
    let is_truncated = rest.fill_buf().is_ok_and(<[u8]>::is_empty);
    match error.line() {
        Some(number) if number > 1 && is_truncated => {
            format!("the file ends at line {number}, before `end_header`: it is truncated; get it again")
        }
        Some(number) => {
            let line: String = line(path, number).unwrap_or_default().chars().take(MAX_QUOTED).collect();
            format!("not a PLY file: line {number} cannot be read: `{line}`; {REMEDY}")
        }
        None => format!("not a PLY file: {}; {REMEDY}", in_one_line(error)),
    }
}

/// Line `number`, from 1, of the file at `path`, if it can be read.
fn line(path: &Path, number: usize) -> Option<String> {
    reader::open(path).ok()?.lines().nth(number.checked_sub(1)?)?.ok()
}

/// What is wrong with the line where reading stopped, if that is a number that is not finite: the parser has
/// no word for it.
fn not_finite(source: Source<'_>, element: &ElementDef, error: &ParseError) -> Option<LoadError> {
    let number = error.line()?;
    let line = line(source.path, number)?;
    let names = element.properties.values().map(|property| &property.name);
    let mut named = names.zip(line.split_whitespace());
    let (name, bad) = named.find(|(_, word)| word.parse().is_ok_and(|value: f64| !value.is_finite()))?;
    let message = format!("the coordinate `{name}` is `{bad}`, which is not finite; fix the file");
    Some(source.broken(format!("line {number}"), message))
}

/// The parser's messages spread over several lines.
fn in_one_line(error: &impl std::fmt::Display) -> String {
    error.to_string().split_whitespace().collect::<Vec<_>>().join(" ")
}

fn take_vertices(soup: &mut Soup, element: &ElementDef, vertices: Vec<Vertex>) {
    let has = |names: &[&str]| names.iter().any(|name| element.properties.contains_key(*name));
    soup.positions = vertices.iter().map(|vertex| vertex.position).collect();
    if has(&["nx"]) && has(&["ny"]) && has(&["nz"]) {
        soup.normals = vertices.iter().map(|vertex| vertex.normal).collect();
    }
    if has(&["s", "u", "texture_u"]) && has(&["t", "v", "texture_v"]) {
        // PLY and OBJ count v upwards from the last row.
        soup.uvs = vertices.iter().map(|vertex| Vec2::new(vertex.uv.x, 1.0 - vertex.uv.y)).collect();
    }
    if has(&["red"]) && has(&["green"]) && has(&["blue"]) {
        soup.colors = vertices.iter().map(|vertex| linear(vertex.color)).collect();
    }
}

/// Whether positions are stored as f32.
fn stored_single(vertex: &ElementDef) -> bool {
    let is_single = |name: &str| {
        let kind = vertex.properties.get(name).map(|property| &property.data_type);
        matches!(kind, Some(PropertyType::Scalar(ScalarType::Float)))
    };
    ["x", "y", "z"].into_iter().any(is_single)
}

/// What the header says of the look and is not drawn.
fn left_out(header: &Header, path: &Path) -> Vec<Warning> {
    let mut warnings = Vec::new();
    if header.elements.get("face").is_some_and(|face| face.properties.contains_key("red")) {
        warnings.push(import::face_colors(path));
    }
    for texture in header.comments.iter().filter_map(|comment| comment.strip_prefix("TextureFile ")) {
        let (what, detail) =
            ("ignored: textures that PLY files name are not read", texture.trim().to_owned());
        warnings.push(Warning::about(Code::TextureIgnored, "texture", what, detail));
    }
    warnings
}

fn check(header: &Header) -> Result<(), String> {
    let element = |name: &str| {
        let missing = || format!("it has no element `{name}`: the file holds no triangles; {REMEDY}");
        header.elements.get(name).ok_or_else(missing)
    };
    let vertex = element("vertex")?;
    if let Some(missing) = ["x", "y", "z"].iter().find(|name| !vertex.properties.contains_key(**name)) {
        return Err(format!("its vertices have no property `{missing}`; {REMEDY}"));
    }
    if !element("face")?.properties.values().any(|property| is_corners(&property.name)) {
        return Err(format!("its faces have no property `vertex_indices`; {REMEDY}"));
    }
    for element in header.elements.values() {
        if element.count > MAX_ELEMENTS {
            return Err(format!(
                "{} {} elements; up to {MAX_ELEMENTS} are taken",
                element.count, element.name
            ));
        }
        if element.properties.values().next().is_none() && element.count > 0 {
            return Err(format!("element `{}` has no properties; {REMEDY}", element.name));
        }
    }
    Ok(())
}
