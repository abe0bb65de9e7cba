//! Platform files in RON, and one frame on those that are accepted.
#![no_main]

use libfuzzer_sys::fuzz_target;
use run::MachineTexts;
use timing::Level;

fuzz_target!(|text: &str| {
    let machine = MachineTexts { platform: Some(text), ..MachineTexts::default() };
    let _ = machine.one_frame(Level::Packet);
});
