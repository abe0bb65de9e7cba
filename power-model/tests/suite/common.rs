//! Helpers shared by the tests.

use activity::{Bin, Event, Timeline, Unit};
use power_model::{EnergyTable, Platform, PowerModel, Source, Sourced, Volts, Watts};

/// The built-in table.
pub fn table() -> EnergyTable {
    EnergyTable::builtin("28nm").unwrap()
}

/// The built-in platform.
pub fn reference() -> Platform {
    Platform::builtin("reference").unwrap()
}

/// An arbitrary power for a test.
pub fn watts(watts: f64) -> Sourced<Watts> {
    Sourced::Assumed(Watts::new(watts).unwrap(), source())
}

/// An arbitrary voltage for a test.
pub fn volts(volts: f64) -> Sourced<Volts> {
    Sourced::Assumed(Volts::new(volts).unwrap(), source())
}

/// The source of an arbitrary number.
pub fn source() -> Source {
    Source::try_from("for this test".to_owned()).unwrap()
}

/// A platform whose power comes from events only.
pub fn bare() -> Platform {
    let text = include_str!("bare.ron");
    Platform::parse(text, "bare.ron").unwrap()
}

/// The built-in table on `platform`.
pub fn model(platform: &Platform) -> PowerModel {
    PowerModel::new(&table(), platform).unwrap()
}

/// A timeline with the same counts and busy time in each of `bins` bins.
pub fn steady(bin_ps: u64, bins: usize, event: Event, count: u64, busy_ps: u64) -> Timeline {
    let mut bin = Bin::default();
    bin.counts[event] = count;
    bin.busy_ps[event.unit() as usize] = busy_ps;
    Timeline { bin_ps, duration_ps: bin_ps * bins as u64, bins: vec![bin; bins] }
}

/// Index of `unit` in an array by unit.
pub fn at(unit: Unit) -> usize {
    unit as usize
}
