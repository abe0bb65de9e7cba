//! Recorded frames, timed where they can be read.
#![no_main]

use libfuzzer_sys::fuzz_target;
use quintile_fuzz::on_disk;
use run::{RecordedRun, RunOptions};

fuzz_target!(|data: &[u8]| {
    on_disk("frames.rec", data, |path| {
        let Ok(recorded) = RecordedRun::read(path) else { return };
        let Ok(plan) = recorded.plan(RunOptions::default()) else { return };
        let _ = recorded.timed(&[&plan]);
    });
});
