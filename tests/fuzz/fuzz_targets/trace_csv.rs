//! Traces in CSV.
#![no_main]

use libfuzzer_sys::fuzz_target;
use quintile_fuzz::on_disk;

fuzz_target!(|data: &[u8]| {
    on_disk("a.csv", data, |path| {
        let _ = traces::io::csv::read(path);
    });
});
