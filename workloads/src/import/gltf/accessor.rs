//! Accessors: numbers in buffers, every byte of them checked to be there.

use gltf::json::accessor::{ComponentType, Type};
use gltf::json::validation::Checked;

use super::document::Document;
use crate::error::LoadError;

/// Numbers read from an accessor; every integer of glTF is exact in f64.
#[derive(Clone, Debug)]
pub(super) struct Values {
    /// `width` numbers for each element.
    pub numbers: Vec<f64>,
    pub width: usize,
}

/// Most elements of a sparse accessor without a base, which needs no bytes for its zeros.
const MOST_ZEROS: u64 = 1 << 22;

/// Most numbers in one accessor.
const MOST_NUMBERS: u64 = 1 << 28;

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
    /// The numbers of accessor `index`, which has to be of one of `kinds`; `role` says whose it is.
    pub fn values(&self, index: usize, kinds: &[Type], role: &str) -> Result<Values, LoadError> {
        let fail = |message: String| {
            let place = format!("{role}, accessor {index}");
            self.source.broken(place, format!("{message}: export it again"))
        };
        self.numbers(index, kinds).map_err(fail)
    }

    fn numbers(&self, index: usize, kinds: &[Type]) -> Result<Values, String> {
        let accessor = self.root.accessors.get(index).ok_or("there is no such accessor")?;
        let (Checked::Valid(kind), Checked::Valid(component)) = (&accessor.type_, &accessor.component_type)
        else {
            return Err("its type is not known".to_owned());
        };
        if !kinds.contains(kind) {
            return Err(format!("it holds {kind:?}, {kinds:?} is due"));
        }
        let (width, count) = (kind.multiplicity(), accessor.count.0);
        if count.saturating_mul(width as u64) > MOST_NUMBERS {
            return Err(format!("{count} elements are absurdly many"));
        }
        let layout = Layout { width, component: component.0, normalized: accessor.normalized };
        let mut numbers = match accessor.buffer_view {
            Some(view) => {
                let offset = accessor.byte_offset.map_or(0, |offset| offset.0);
                layout.read(self.bytes(view.value(), offset, count, layout.size())?)
            }
            None if count <= MOST_ZEROS => vec![0.0; count as usize * width],
            None => return Err(format!("{count} elements without a buffer are absurdly many")),
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

    /// `count` elements of `size` bytes in a buffer view, all of which have to lie inside it.
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
        let view =
            self.root.buffer_views.get(index).ok_or_else(|| format!("there is no buffer view {index}"))?;
        let buffer = self.buffers.get(view.buffer.value()).ok_or("there is no such buffer")?;
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
