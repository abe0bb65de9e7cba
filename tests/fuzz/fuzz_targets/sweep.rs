//! Sweep files in RON.
#![no_main]

use libfuzzer_sys::fuzz_target;
use sweep::SweepSpec;

fuzz_target!(|text: &str| {
    let _ = SweepSpec::parse(text, "sweep.ron");
});
