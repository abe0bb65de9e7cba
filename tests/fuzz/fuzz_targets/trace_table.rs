//! Tables of settings.
#![no_main]

use libfuzzer_sys::fuzz_target;
use quintile_fuzz::on_disk;

fuzz_target!(
    init: std::panic::set_hook(Box::new(|_| ())),
    |data: &[u8]| {
        on_disk("a.table", data, |path| {
            if let Ok(table) = traces::table::InputTable::read(path) {
                let _ = table.numbers("time_ms");
            }
        });
    }
);
