//! Traces of any format, by their first bytes, with repairs.
#![no_main]

use libfuzzer_sys::fuzz_target;
use quintile_fuzz::on_disk;

fuzz_target!(
    init: std::panic::set_hook(Box::new(|_| ())),
    |data: &[u8]| {
        on_disk("a.trace", data, |path| {
            let options = traces::io::ReadOptions { repair: true, rate_hz: Some(1e3), ..Default::default() };
            let _ = traces::io::read(path, &options);
        });
    }
);
