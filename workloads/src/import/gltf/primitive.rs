//! One primitive of a mesh: its vertices, triangles, morph targets and joints, read from checked accessors.

use glam::{Vec2, Vec3};
use gltf::json::accessor::{ComponentType, Type};
use gltf::json::mesh::{Mode, Primitive, Semantic};
use gltf::json::validation::Checked;
use warnings::{Code, Warning};

use super::Document;
use crate::error::LoadError;
use crate::material::Material;
use crate::scene::{Influences, Mesh, MorphTarget, Normals};

/// The primitive being read, and its place for error messages.
struct Reading<'d, 'a> {
    document: &'d Document<'a>,
    primitive: &'d Primitive,
    place: String,
}

/// A primitive as a mesh.
pub(super) struct Read {
    pub mesh: Mesh,
    /// Lowest alpha of the vertex colours; 1 without vertex colours.
    pub least_alpha: f32,
}

/// Reads a primitive; `None` for points and lines.
pub(super) fn read(
    document: &Document,
    [mesh, index]: [usize; 2],
    materials: &mut Vec<Material>,
    warnings: &mut Vec<Warning>,
) -> Result<Option<Read>, LoadError> {
    let described = &document.root.meshes[mesh];
    let primitive = &described.primitives[index];
    let place = format!("meshes[{mesh}].primitives[{index}]");
    let reading = Reading { document, primitive, place };
    if reading.dropped(warnings) {
        return Ok(None);
    }
    let Some(positions) = reading.attribute(Semantic::Positions, &[Type::Vec3])? else {
        warnings.push(dropped(format!("{} has no positions", reading.place)));
        return Ok(None);
    };
    let positions: Vec<Vec3> = positions.vectors().map(Vec3::from_array).collect();
    let triangles = reading.triangles(positions.len())?;
    let name = described.name.clone().unwrap_or_else(|| format!("mesh {mesh}"));
    let count = positions.len();
    let material = primitive.material.map_or(document.root.materials.len(), |material| material.value());
    let made = Mesh::new(name, positions, triangles, material);
    let mut made = made.map_err(|what| reading.broken(&what))?;
    made.normals = reading.normals(count)?;
    let least_alpha = reading.colors(&mut made)?;
    reading.texture_coordinates(&mut made, materials, warnings)?;
    made.targets = reading.targets(count)?;
    made.weights = described.weights.iter().flatten().map(|weight| f64::from(*weight)).collect();
    made.influences = reading.influences(count)?;
    Ok(Some(Read { mesh: made, least_alpha }))
}

fn dropped(detail: String) -> Warning {
    Warning::about(Code::PrimitiveDropped, "primitive", "not drawn: only triangles are", detail)
}

impl Reading<'_, '_> {
    fn broken(&self, what: &str) -> LoadError {
        self.document.source.broken(self.place.clone(), format!("{what}: export it again"))
    }

    fn mode(&self) -> Mode {
        match self.primitive.mode {
            Checked::Valid(mode) => mode,
            Checked::Invalid => Mode::Triangles,
        }
    }

    fn dropped(&self, warnings: &mut Vec<Warning>) -> bool {
        let surface = matches!(self.mode(), Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan);
        if !surface {
            warnings.push(dropped(format!("{} is made of points or lines", self.place)));
        }
        !surface
    }

    fn accessor(&self, index: usize, kinds: &[Type], what: &str) -> Result<Values, LoadError> {
        self.document.values(index, kinds, &format!("{} {what}", self.place))
    }

    fn attribute(&self, semantic: Semantic, kinds: &[Type]) -> Result<Option<Values>, LoadError> {
        let what = format!("{semantic:?}");
        let accessor = self.primitive.attributes.get(&Checked::Valid(semantic));
        accessor.map(|accessor| self.accessor(accessor.value(), kinds, &what)).transpose()
    }

    /// `values` as vectors, one for each of `count` vertices, all finite.
    fn vectors<const N: usize>(
        &self,
        values: &Values,
        count: usize,
        what: &str,
    ) -> Result<Vec<[f32; N]>, LoadError> {
        let vectors: Vec<[f32; N]> = values.vectors().collect();
        if vectors.len() != count {
            return Err(self.broken(&format!("{} {what} for {count} vertices", vectors.len())));
        }
        match vectors.iter().position(|vector| vector.iter().any(|part| !part.is_finite())) {
            Some(vertex) => Err(self.broken(&format!("{what} of vertex {vertex} is NaN or infinite"))),
            None => Ok(vectors),
        }
    }

    /// Vertex indices of triangles; strips and fans unrolled (glTF 2.0, 3.7.2.1).
    fn triangles(&self, vertices: usize) -> Result<Vec<[u32; 3]>, LoadError> {
        let indices: Vec<u32> = match self.primitive.indices {
            Some(accessor) => {
                let values = self.accessor(accessor.value(), &[Type::Scalar], "indices")?;
                values.numbers.iter().map(|index| *index as u32).collect()
            }
            None => (0..vertices as u32).collect(),
        };
        Ok(match self.mode() {
            Mode::TriangleStrip => strip(&indices),
            Mode::TriangleFan => fan(&indices),
            _ => indices.chunks_exact(3).map(|corner| [corner[0], corner[1], corner[2]]).collect(),
        })
    }

    fn normals(&self, count: usize) -> Result<Normals, LoadError> {
        let Some(values) = self.attribute(Semantic::Normals, &[Type::Vec3])? else {
            return Ok(Normals::Flat);
        };
        let normals = self.vectors(&values, count, "normal")?;
        Ok(Normals::Given(normals.into_iter().map(Vec3::from_array).collect()))
    }

    /// Sets the vertex colours of `mesh`, unless all are white; returns their lowest alpha.
    fn colors(&self, mesh: &mut Mesh) -> Result<f32, LoadError> {
        let Some(values) = self.attribute(Semantic::Colors(0), &[Type::Vec3, Type::Vec4])? else {
            return Ok(1.0);
        };
        let count = mesh.positions.len();
        let colors: Vec<[f32; 4]> = self.vectors(&values, count, "colour")?;
        let rgb = colors.iter().map(|[r, g, b, _]| Vec3::new(*r, *g, *b).clamp(Vec3::ZERO, Vec3::ONE));
        let rgb: Vec<Vec3> = rgb.collect();
        if rgb.iter().any(|color| *color != Vec3::ONE) {
            mesh.colors = rgb.into();
        }
        let alpha = colors.iter().map(|[.., alpha]| alpha.clamp(0.0, 1.0));
        Ok(if values.width == 4 { alpha.fold(1.0, f32::min) } else { 1.0 })
    }

    fn texture_coordinates(
        &self,
        mesh: &mut Mesh,
        materials: &mut Vec<Material>,
        warnings: &mut Vec<Warning>,
    ) -> Result<(), LoadError> {
        if materials.get(mesh.material).is_none_or(|material| material.texture.is_none()) {
            return Ok(());
        }
        let described = &self.document.root.materials[mesh.material];
        let Some(info) = &described.pbr_metallic_roughness.base_color_texture else { return Ok(()) };
        let transform = info.extensions.as_ref().and_then(|extensions| extensions.texture_transform.as_ref());
        let set = transform.and_then(|transform| transform.tex_coord).unwrap_or(info.tex_coord);
        let Some(values) = self.attribute(Semantic::TexCoords(set), &[Type::Vec2])? else {
            let what = "without the coordinates that its texture needs: the base colour is used alone";
            let detail = format!("{}: no texture coordinates {set}", self.place);
            warnings.push(Warning::about(Code::MissingTexcoord, "primitive", what, detail));
            materials.push(Material { texture: None, ..materials[mesh.material].clone() });
            mesh.material = materials.len() - 1;
            return Ok(());
        };
        let uvs = self.vectors(&values, mesh.positions.len(), "texture coordinate")?;
        let placed = |uv: [f32; 2]| transform.map_or(Vec2::from_array(uv), |transform| place(uv, transform));
        mesh.uvs = uvs.into_iter().map(placed).collect();
        Ok(())
    }

    fn targets(&self, count: usize) -> Result<Vec<MorphTarget>, LoadError> {
        let mut targets = Vec::new();
        for (index, target) in self.primitive.targets.iter().flatten().enumerate() {
            let read = |accessor: Option<gltf::json::Index<_>>, what: &str| -> Result<Vec<Vec3>, LoadError> {
                let Some(accessor) = accessor else { return Ok(Vec::new()) };
                let what = format!("{what} of target {index}");
                let values = self.accessor(accessor.value(), &[Type::Vec3], &what)?;
                Ok(self.vectors(&values, count, &what)?.into_iter().map(Vec3::from_array).collect())
            };
            targets.push(MorphTarget {
                positions: read(target.positions, "position")?,
                normals: read(target.normals, "normal")?,
            });
        }
        Ok(targets)
    }

    /// Joints and weights of all sets, with weights normalized to a sum of one.
    fn influences(&self, count: usize) -> Result<Option<Influences>, LoadError> {
        let mut sets: Vec<[Vec<[f32; 4]>; 2]> = Vec::new();
        for set in 0.. {
            let joints = self.attribute(Semantic::Joints(set), &[Type::Vec4])?;
            let weights = self.attribute(Semantic::Weights(set), &[Type::Vec4])?;
            let (Some(joints), Some(weights)) = (joints, weights) else { break };
            sets.push([self.vectors(&joints, count, "joint")?, self.vectors(&weights, count, "weight")?]);
        }
        if sets.is_empty() {
            return Ok(None);
        }
        let mut influences = Influences { per_vertex: 4 * sets.len(), ..Influences::default() };
        for vertex in 0..count {
            let sum: f32 = sets.iter().flat_map(|[_, weights]| weights[vertex]).sum();
            let scale = if sum > 0.0 { 1.0 / sum } else { 0.0 };
            for [joints, weights] in &sets {
                influences.joints.extend(joints[vertex].map(|joint| joint as u16));
                influences.weights.extend(weights[vertex].map(|weight| weight * scale));
            }
            // A vertex without weights follows the first joint instead of collapsing to the origin.
            if sum <= 0.0 {
                influences.weights[vertex * 4 * sets.len()] = 1.0;
            }
        }
        Ok(Some(influences))
    }
}

fn strip(indices: &[u32]) -> Vec<[u32; 3]> {
    let turned = |(at, corner): (usize, &[u32])| {
        if at % 2 == 0 { [corner[0], corner[1], corner[2]] } else { [corner[0], corner[2], corner[1]] }
    };
    indices.windows(3).enumerate().map(turned).collect()
}

fn fan(indices: &[u32]) -> Vec<[u32; 3]> {
    let [first, rest @ ..] = indices else { return Vec::new() };
    rest.windows(2).map(|pair| [pair[0], pair[1], *first]).collect()
}

/// KHR_texture_transform: scale, then rotate, then offset.
fn place(uv: [f32; 2], transform: &gltf::json::extensions::texture::TextureTransform) -> Vec2 {
    let angle = f64::from(transform.rotation.0);
    let (sin, cos) = (libm::sin(angle) as f32, libm::cos(angle) as f32);
    let scaled = Vec2::from_array(uv) * Vec2::from_array(transform.scale.0);
    let turned = Vec2::new(cos * scaled.x + sin * scaled.y, cos * scaled.y - sin * scaled.x);
    turned + Vec2::from_array(transform.offset.0)
}

/// Numbers of an accessor. Every integer of glTF is exact in f64.
#[derive(Clone, Debug)]
pub(super) struct Values {
    /// `width` numbers for each element.
    pub numbers: Vec<f64>,
    pub width: usize,
}

/// Most elements of a sparse accessor without a base, which needs no bytes for its zeros.
const MAX_ZEROS: u64 = 1 << 22;

/// Most numbers in one accessor.
const MAX_NUMBERS: u64 = 1 << 28;

impl Values {
    pub fn count(&self) -> usize {
        self.numbers.len() / self.width.max(1)
    }

    pub fn elements(&self) -> impl Iterator<Item = &[f64]> {
        self.numbers.chunks_exact(self.width.max(1))
    }

    /// Elements as vectors of `f32`, missing components zero.
    pub fn vectors<const N: usize>(&self) -> impl Iterator<Item = [f32; N]> {
        self.elements().map(|element| std::array::from_fn(|i| element.get(i).copied().unwrap_or(0.0) as f32))
    }
}

impl Document<'_> {
    /// The numbers of accessor `index`, of one of `kinds`; `role` names its use in messages.
    pub fn values(&self, index: usize, kinds: &[Type], role: &str) -> Result<Values, LoadError> {
        let fail = |message: String| {
            let place = format!("{role}, accessor {index}");
            self.source.broken(place, format!("{message}: export it again"))
        };
        self.numbers(index, kinds).map_err(fail)
    }

    fn numbers(&self, index: usize, kinds: &[Type]) -> Result<Values, String> {
        let accessor = self.root.accessors.get(index).ok_or_else(|| missing("it", &self.root.accessors))?;
        let (Checked::Valid(kind), Checked::Valid(component)) = (&accessor.type_, &accessor.component_type)
        else {
            return Err("its type is not known".to_owned());
        };
        if !kinds.contains(kind) {
            return Err(format!("it has the type {kind:?} instead of {kinds:?}"));
        }
        let (width, count) = (kind.multiplicity(), accessor.count.0);
        if count.saturating_mul(width as u64) > MAX_NUMBERS {
            return Err(format!("{count} elements are too many"));
        }
        let layout = Layout { width, component: component.0, normalized: accessor.normalized };
        let mut numbers = match accessor.buffer_view {
            Some(view) => {
                let offset = accessor.byte_offset.map_or(0, |offset| offset.0);
                layout.read(self.bytes(view.value(), offset, count, layout.size())?)
            }
            None if count <= MAX_ZEROS => vec![0.0; count as usize * width],
            None => return Err(format!("{count} elements without a buffer are too many")),
        };
        if let Some(sparse) = &accessor.sparse {
            self.overlay(sparse, layout, &mut numbers)?;
        }
        Ok(Values { numbers, width })
    }

    fn overlay(
        &self,
        sparse: &gltf::json::accessor::sparse::Sparse,
        layout: Layout,
        numbers: &mut [f64],
    ) -> Result<(), String> {
        let Checked::Valid(component) = &sparse.indices.component_type else {
            return Err("the type of its sparse indices is not known".to_owned());
        };
        let count = sparse.count.0;
        let places = Layout { width: 1, component: component.0, normalized: false };
        let at = self.bytes(
            sparse.indices.buffer_view.value(),
            sparse.indices.byte_offset.0,
            count,
            places.size(),
        )?;
        let new =
            self.bytes(sparse.values.buffer_view.value(), sparse.values.byte_offset.0, count, layout.size())?;
        let new = layout.read(new);
        for (place, value) in places.read(at).into_iter().zip(new.chunks_exact(layout.width)) {
            let start = place as usize * layout.width;
            let slot = numbers.get_mut(start..start + layout.width);
            slot.ok_or_else(|| format!("its sparse index {place} is out of range"))?.copy_from_slice(value);
        }
        Ok(())
    }

    /// `count` elements of `size` bytes, all inside the buffer view.
    fn bytes(&self, view: usize, offset: u64, count: u64, size: usize) -> Result<Strided<'_>, String> {
        let body = self.view(view)?;
        let described = self.root.buffer_views.get(view).and_then(|view| view.byte_stride.as_ref());
        let stride = described.map_or(size, |stride| stride.0);
        if stride < size {
            return Err(format!("its elements of {size} bytes overlap at a stride of {stride}"));
        }
        let last = count.saturating_sub(1).saturating_mul(stride as u64);
        let needed = if count == 0 { 0 } else { offset.saturating_add(last).saturating_add(size as u64) };
        if needed > body.len() as u64 {
            return Err(format!("it needs {needed} bytes of buffer view {view}, which has {}", body.len()));
        }
        let start = if count == 0 { 0 } else { offset as usize };
        Ok(Strided { bytes: &body[start..], count: count as usize, stride, size })
    }

    /// The bytes of a buffer view.
    pub fn view(&self, index: usize) -> Result<&[u8], String> {
        let views = &self.root.buffer_views;
        let view = views.get(index).ok_or_else(|| missing(&format!("buffer view {index}"), views))?;
        let buffer = view.buffer.value();
        let buffer =
            self.buffers.get(buffer).ok_or_else(|| missing(&format!("buffer {buffer}"), &self.buffers))?;
        let start = view.byte_offset.map_or(0, |offset| offset.0);
        let end = start.saturating_add(view.byte_length.0);
        let range = usize::try_from(start).ok().zip(usize::try_from(end).ok());
        range.and_then(|(start, end)| buffer.get(start..end)).ok_or_else(|| {
            format!("buffer view {index} ends at byte {end} of a buffer of {} bytes", buffer.len())
        })
    }
}

struct Strided<'a> {
    bytes: &'a [u8],
    count: usize,
    stride: usize,
    size: usize,
}

#[derive(Clone, Copy)]
struct Layout {
    width: usize,
    component: ComponentType,
    normalized: bool,
}

impl Layout {
    fn size(self) -> usize {
        self.width * self.component.size()
    }

    fn read(self, from: Strided) -> Vec<f64> {
        let elements = from.bytes.chunks(from.stride.max(1)).take(from.count);
        let numbers = elements.flat_map(|element| {
            let element = element.get(..from.size).unwrap_or(&[]);
            element.chunks_exact(self.component.size()).map(move |bytes| self.number(bytes))
        });
        numbers.collect()
    }

    /// One component; normalized integers as in glTF 2.0, 3.11.
    fn number(self, bytes: &[u8]) -> f64 {
        let [a, b, c, d] = std::array::from_fn(|i| bytes.get(i).copied().unwrap_or(0));
        let (value, most) = match self.component {
            ComponentType::I8 => (f64::from(i8::from_le_bytes([a])), 127.0),
            ComponentType::U8 => (f64::from(a), 255.0),
            ComponentType::I16 => (f64::from(i16::from_le_bytes([a, b])), 32_767.0),
            ComponentType::U16 => (f64::from(u16::from_le_bytes([a, b])), 65_535.0),
            ComponentType::U32 => (f64::from(u32::from_le_bytes([a, b, c, d])), 4_294_967_295.0),
            ComponentType::F32 => return f64::from(f32::from_le_bytes([a, b, c, d])),
        };
        if self.normalized { (value / most).max(-1.0) } else { value }
    }
}

/// Message about an index beyond a list.
fn missing<T>(what: &str, list: &[T]) -> String {
    format!("{what} does not exist (there are {})", list.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strips_keep_their_facing_and_fans_their_centre() {
        assert_eq!(strip(&[0, 1, 2, 3]), [[0, 1, 2], [1, 3, 2]]);
        assert_eq!(fan(&[0, 1, 2, 3]), [[1, 2, 0], [2, 3, 0]]);
        assert!(strip(&[0, 1]).is_empty() && fan(&[]).is_empty());
    }
}
