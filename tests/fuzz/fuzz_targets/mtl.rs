//! Files of materials, named by an OBJ file with a triangle in each of two materials.
#![no_main]

use libfuzzer_sys::fuzz_target;
use quintile_fuzz::on_disk;

const OBJ: &[u8] =
    b"mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl a\nf 1/1 2/1 3/1\nusemtl b\nf 3/1 2/1 1/1\n";

fuzz_target!(|data: &[u8]| {
    on_disk("m.mtl", data, |_| {
        on_disk("m.obj", OBJ, |path| {
            let _ = workloads::load(&path.display().to_string());
        });
    });
});
