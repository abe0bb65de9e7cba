//! Binary glTF files put together for a test, whole or broken on purpose.

use serde_json::{Value, json};

/// Builder of a `.glb` file: a mesh of one primitive, with one buffer.
#[derive(Clone, Debug)]
pub struct Glb {
    /// The JSON chunk.
    pub json: Value,
    /// The binary chunk.
    pub binary: Vec<u8>,
}

impl Glb {
    /// One square in the xy plane, two triangles: positions are accessor 0, indices accessor 1.
    pub fn square() -> Self {
        Self::with_positions(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
    }

    /// The same with other corners.
    pub fn with_positions(corners: &[[f32; 3]; 4]) -> Self {
        let mut glb = Self {
            json: json!({
                "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
                "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
                "accessors": [], "bufferViews": [], "buffers": [{"byteLength": 0}],
            }),
            binary: Vec::new(),
        };
        glb.floats(corners.as_flattened(), 3);
        let indices: Vec<u8> = [0u16, 1, 2, 0, 2, 3].iter().flat_map(|index| index.to_le_bytes()).collect();
        glb.accessor(&indices, 6, "SCALAR", 5123);
        glb
    }

    /// Adds floats as an accessor of vectors of `width` components (1 to 4); returns its index.
    pub fn floats(&mut self, numbers: &[f32], width: usize) -> usize {
        let kind = ["SCALAR", "VEC2", "VEC3", "VEC4"][width - 1];
        let bytes: Vec<u8> = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
        self.accessor(&bytes, numbers.len() / width, kind, 5126)
    }

    /// The primitive, to change it.
    pub fn primitive(&mut self) -> &mut Value {
        &mut self.json["meshes"][0]["primitives"][0]
    }

    /// Adds a material, `described` in glTF, to the square.
    pub fn material(&mut self, described: Value) {
        self.json["materials"] = json!([described]);
        self.primitive()["material"] = json!(0);
    }

    /// Adds texture coordinates.
    pub fn texture_coordinates(&mut self) {
        let accessor = self.floats(&[0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0, 1.0], 2);
        self.primitive()["attributes"]["TEXCOORD_0"] = json!(accessor);
    }

    /// The bytes of the file.
    pub fn bytes(&self) -> Vec<u8> {
        let mut text = self.json.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let mut body = self.binary.clone();
        body.resize(body.len().next_multiple_of(4), 0);
        let size = |bytes: usize| u32::try_from(bytes).unwrap_or(u32::MAX).to_le_bytes();
        let whole = 12 + 8 + text.len() + 8 + body.len();
        [
            b"glTF\x02\0\0\0".as_slice(),
            &size(whole),
            &size(text.len()),
            b"JSON",
            &text,
            &size(body.len()),
            b"BIN\0",
            &body,
        ]
        .concat()
    }

    fn accessor(&mut self, bytes: &[u8], count: usize, kind: &str, component: u32) -> usize {
        self.binary.resize(self.binary.len().next_multiple_of(4), 0);
        let offset = self.binary.len();
        self.binary.extend(bytes);
        self.json["buffers"][0]["byteLength"] = json!(self.binary.len());
        let view = push(
            &mut self.json["bufferViews"],
            json!({"buffer": 0, "byteOffset": offset, "byteLength": bytes.len()}),
        );
        let described = json!({"bufferView": view, "componentType": component, "count": count, "type": kind});
        push(&mut self.json["accessors"], described)
    }
}

/// Appends to a JSON list and returns the index.
fn push(list: &mut Value, item: Value) -> usize {
    let Some(list) = list.as_array_mut() else { return 0 };
    list.push(item);
    list.len() - 1
}
