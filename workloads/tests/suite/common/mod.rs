//! Helpers that make small files for tests.

pub mod meshes;

use std::path::PathBuf;

use activity::Packet;
use glam::Vec3;
use pipeline::{ComputeSpec, FrameReport, Gpu, PipelineSpec};
use serde_json::{Value, json};
use workloads::LoadError;
use workloads::job::{Drawn, Job};

/// A `.glb` of JSON and a binary chunk.
pub fn glb(json: &Value, binary: &[u8]) -> Vec<u8> {
    let mut text = json.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut body = binary.to_vec();
    body.resize(body.len().next_multiple_of(4), 0);
    let mut file = b"glTF\x02\0\0\0".to_vec();
    file.extend((12 + 8 + text.len() as u32 + 8 + body.len() as u32).to_le_bytes());
    file.extend((text.len() as u32).to_le_bytes());
    file.extend(b"JSON");
    file.extend(text);
    file.extend((body.len() as u32).to_le_bytes());
    file.extend(b"BIN\0");
    file.extend(body);
    file
}

/// A glTF under construction: numbers go to one buffer, each list with its own accessor.
pub struct Builder {
    pub json: Value,
    pub binary: Vec<u8>,
}

impl Builder {
    pub fn new() -> Self {
        let json = json!({
            "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
            "nodes": [], "meshes": [], "accessors": [], "bufferViews": [], "buffers": [{"byteLength": 0}]
        });
        Self { json, binary: Vec::new() }
    }

    /// Adds bytes as an accessor and returns its index.
    pub fn accessor(&mut self, bytes: &[u8], count: usize, kind: &str, component: u32) -> usize {
        self.binary.resize(self.binary.len().next_multiple_of(4), 0);
        let view = self.list("bufferViews").len();
        let offset = self.binary.len();
        self.list("bufferViews").push(json!({"buffer": 0, "byteOffset": offset, "byteLength": bytes.len()}));
        self.binary.extend(bytes);
        self.json["buffers"][0]["byteLength"] = json!(self.binary.len());
        let accessors = self.list("accessors");
        accessors.push(json!({"bufferView": view, "componentType": component, "count": count, "type": kind}));
        accessors.len() - 1
    }

    pub fn floats(&mut self, numbers: &[f32], kind: &str) -> usize {
        let width = match kind {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            _ => 16,
        };
        let bytes: Vec<u8> = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
        self.accessor(&bytes, numbers.len() / width, kind, 5126)
    }

    pub fn shorts(&mut self, numbers: &[u16]) -> usize {
        let bytes: Vec<u8> = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
        self.accessor(&bytes, numbers.len(), "SCALAR", 5123)
    }

    pub fn list(&mut self, name: &str) -> &mut Vec<Value> {
        if self.json[name].is_null() {
            self.json[name] = json!([]);
        }
        self.json[name].as_array_mut().unwrap()
    }

    /// One right-angled triangle in the xy plane as mesh 0; positions are accessor 0, indices 1.
    pub fn triangle() -> Self {
        let mut builder = Self::new();
        builder.floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0], "VEC3");
        builder.shorts(&[0, 1, 2]);
        builder.list("meshes").push(json!({"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}));
        builder.list("nodes").push(json!({"mesh": 0}));
        builder
    }

    /// Adds a channel of clip 0 that drives node 0.
    pub fn animate(&mut self, path: &str, times: &[f32], values: (&[f32], &str), interpolation: &str) {
        let input = self.floats(times, "SCALAR");
        let output = self.floats(values.0, values.1);
        if self.json["animations"].is_null() {
            self.json["animations"] = json!([{"channels": [], "samplers": []}]);
        }
        let clip = &mut self.json["animations"][0];
        let sampler = clip["samplers"].as_array().unwrap().len();
        let described = json!({"input": input, "output": output, "interpolation": interpolation});
        clip["samplers"].as_array_mut().unwrap().push(described);
        let channel = json!({"sampler": sampler, "target": {"node": 0, "path": path}});
        clip["channels"].as_array_mut().unwrap().push(channel);
    }

    pub fn bytes(&self) -> Vec<u8> {
        glb(&self.json, &self.binary)
    }
}

/// A temporary folder of files.
pub struct Files(tempfile::TempDir);

impl Files {
    pub fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    pub fn put(&self, name: &str, bytes: impl AsRef<[u8]>) -> String {
        let path = self.0.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        path.display().to_string()
    }
}

/// Loads bytes as a `.glb`.
pub fn load_glb(bytes: &[u8]) -> Result<workloads::Scene, LoadError> {
    workloads::load(Files::new().put("scene.glb", bytes))
}

/// The folder of real scenes. A test that calls this is ignored unless `cfg(real_scenes)`.
pub fn real_scenes() -> PathBuf {
    std::env::var_os("QUINTILE_SCENES").map(PathBuf::from).expect("the folder of real scenes")
}

/// The message of an error, which must be a failure (not a mistake of usage).
pub fn failure(error: LoadError) -> String {
    assert!(!error.is_usage(), "{error}");
    error.to_string()
}

/// Checks that `text` contains every part.
pub fn expect(text: &str, parts: &[&str]) {
    for part in parts {
        assert!(text.contains(part), "`{part}` is not in: {text}");
    }
}

/// Hardware for tests: all features on, caches of the reference GPU.
pub fn spec() -> PipelineSpec {
    let lines = pipeline::CacheSpec::lru(256, 4);
    PipelineSpec {
        tile_px: 8,
        coarse_tile_px: 64,
        batch_triangles: 65_536,
        vertex_reuse: 32,
        shading: pipeline::Shading::Cached,
        shading_cache: pipeline::CacheSpec::lru(1024, 8),
        memory: pipeline::MemorySpec {
            depth: lines,
            colour: lines,
            texture: lines,
            bins: None,
            l2: pipeline::CacheSpec::lru(4096, 16),
            llc: None,
            edram: None,
            compression: Default::default(),
        },
        features: pipeline::Features::ALL,
        depth: Default::default(),
        compute: None,
        warp_lanes: 32,
    }
}

/// The same with a compute unit.
pub fn hardware() -> PipelineSpec {
    let compute =
        ComputeSpec { warp_lanes: 32, group_lanes: 256, shared_bytes: 32768, banks: 32, atomic_units: 1 };
    PipelineSpec { compute: Some(compute), ..spec() }
}

/// The bits of an image.
pub fn bits(image: &[Vec3]) -> Vec<[u32; 3]> {
    image.iter().map(|pixel| pixel.to_array().map(f32::to_bits)).collect()
}

/// A white shader, independent of the viewer.
pub struct White;

impl pipeline::Shader for White {
    fn shade(&self, _lane: &pipeline::Lane, _at: &pipeline::ShadingPoint, _texel: glam::Vec4) -> glam::Vec4 {
        glam::Vec4::ONE
    }
}

/// Frame `number` of a job with the work of the GPU, which is the sum of its packets.
pub fn drawn_on(spec: &PipelineSpec, job: &dyn Job, number: u32) -> (Drawn, FrameReport) {
    let mut sum = activity::Counts::default();
    let mut gpu = Gpu::new(spec, |packet: &Packet, _| sum += &packet.counts).unwrap();
    let drawn = job.frame(number, &mut gpu).unwrap();
    let report = gpu.finish();
    assert_eq!(sum, report.counts());
    (drawn, report)
}

/// Root mean square of the difference of two images, over all channels.
pub fn rmse(a: &[Vec3], b: &[Vec3]) -> f64 {
    let sum: f64 = a.iter().zip(b).map(|(a, b)| f64::from((*a - *b).length_squared())).sum();
    (sum / (3.0 * a.len() as f64)).sqrt()
}
