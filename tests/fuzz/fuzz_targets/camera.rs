//! Cameras in RON.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|text: &str| {
    let _ = workloads::visibility::CameraSpec::parse(text, "a.ron");
});
