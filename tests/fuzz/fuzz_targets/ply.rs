//! PLY files.
#![no_main]

use libfuzzer_sys::fuzz_target;
use quintile_fuzz::on_disk;

fuzz_target!(|data: &[u8]| {
    on_disk("a.ply", data, |path| {
        let _ = workloads::visibility::load(&[path], None);
    });
});
