//! OBJ files.
#![no_main]

use libfuzzer_sys::fuzz_target;
use quintile_fuzz::on_disk;

fuzz_target!(|data: &[u8]| {
    on_disk("a.obj", data, |path| {
        let _ = workloads::load(&path.display().to_string());
    });
});
