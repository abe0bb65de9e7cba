//! glTF and GLB files.
#![no_main]

use libfuzzer_sys::fuzz_target;
use quintile_fuzz::on_disk;

fuzz_target!(|data: &[u8]| {
    let name = if data.starts_with(b"glTF") { "a.glb" } else { "a.gltf" };
    on_disk(name, data, |path| {
        let _ = workloads::load(&path.display().to_string());
    });
});
