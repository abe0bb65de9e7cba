//! STL files, binary and ASCII.
#![no_main]

use libfuzzer_sys::fuzz_target;
use quintile_fuzz::on_disk;

fuzz_target!(|data: &[u8]| {
    on_disk("a.stl", data, |path| {
        let _ = workloads::load(&path.display().to_string());
    });
});
