//! Traces in Parquet.
#![no_main]

use libfuzzer_sys::fuzz_target;
use quintile_fuzz::on_disk;

// The reader turns panics of the decoder into errors. libFuzzer's hook would end the process at each of them; without
// it only a panic that gets out does.
fuzz_target!(
    init: std::panic::set_hook(Box::new(|_| ())),
    |data: &[u8]| {
        on_disk("a.parquet", data, |path| {
            let _ = traces::io::parquet::read(path);
        });
    }
);
