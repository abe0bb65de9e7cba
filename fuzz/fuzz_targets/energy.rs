//! Energy tables in RON.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|text: &str| {
    let _ = power_model::EnergyTable::parse(text, "a.ron");
});
