//! Traces in JLS. The checksums are made right first, so that what is behind them is reached.
#![no_main]

#[path = "../../../traces/tests/suite/common/jls.rs"]
mod jls;

use jls::sealed;
use libfuzzer_sys::fuzz_target;
use quintile_fuzz::on_disk;
use traces::io::ReadOptions;

fuzz_target!(|data: &[u8]| {
    on_disk("a.jls", &sealed(data), |path| {
        let _ = traces::io::read(path, &ReadOptions { repair: true, ..ReadOptions::default() });
        let _ = traces::stream::clock(path, &ReadOptions::default());
    });
});
