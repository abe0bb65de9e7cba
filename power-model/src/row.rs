//! Row of an energy table.

use activity::{Event, spec};
use serde::Deserialize;

use crate::quantity::{Basis, Picojoules, Source};

/// Supply of an event, which decides whether the core voltage scales its energy.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
pub enum Supply {
    /// Core: energy scales with (V/V0)^2.
    #[default]
    Core,
    /// Memory and its interface, with a supply voltage independent of the core's.
    Memory,
}

/// Energy of one event at the table's reference voltage, with its source; `low <= nominal <= high`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(try_from = "Written")]
pub struct EnergyRow {
    event: Event,
    pj: [f64; 3],
    per: String,
    supply: Supply,
    basis: Basis,
    source: Source,
}

/// Joules per picojoule.
const J_PER_PJ: f64 = 1e-12;

impl EnergyRow {
    /// Event.
    pub const fn event(&self) -> Event {
        self.event
    }

    /// Smallest energy that the sources allow, in joules.
    pub fn low_j(&self) -> f64 {
        self.pj[0] * J_PER_PJ
    }

    /// Nominal energy in joules.
    pub fn nominal_j(&self) -> f64 {
        self.pj[1] * J_PER_PJ
    }

    /// Largest energy that the sources allow, in joules.
    pub fn high_j(&self) -> f64 {
        self.pj[2] * J_PER_PJ
    }

    /// Operation or access width that the energy refers to.
    pub fn per(&self) -> &str {
        &self.per
    }

    /// Supply.
    pub const fn supply(&self) -> Supply {
        self.supply
    }

    /// Kind of source.
    pub const fn basis(&self) -> Basis {
        self.basis
    }

    /// Source in words.
    pub fn source(&self) -> &str {
        self.source.text()
    }
}

/// An event, deserialized from its name.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(try_from = "String")]
pub(crate) struct EventName(pub(crate) Event);

impl TryFrom<String> for EventName {
    type Error = String;
    fn try_from(name: String) -> Result<Self, String> {
        let unknown = || {
            let known = Event::ALL.map(Event::name);
            format!("unknown event `{name}`, {}", spec::suggestion(&name, &known))
        };
        Event::from_name(&name).map(Self).ok_or_else(unknown)
    }
}

/// A row as written in a file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Written {
    event: EventName,
    low_pj: Picojoules,
    nominal_pj: Picojoules,
    high_pj: Picojoules,
    per: String,
    #[serde(default)]
    supply: Supply,
    basis: Basis,
    source: Source,
}

impl TryFrom<Written> for EnergyRow {
    type Error = String;
    fn try_from(written: Written) -> Result<Self, String> {
        let name = written.event.0.name();
        let pj = [written.low_pj, written.nominal_pj, written.high_pj].map(Picojoules::value);
        if !pj.is_sorted() {
            let [low, nominal, high] = pj;
            return Err(format!(
                "row `{name}`: low {low}, nominal {nominal}, high {high} pJ are not in rising order: sort them"
            ));
        }
        if pj[1] <= 0.0 {
            return Err(format!(
                "row `{name}`: the nominal energy is 0: list the event under `free` instead"
            ));
        }
        if written.per.trim().is_empty() {
            return Err(format!("row `{name}`: `per` is empty: say what operation or width it stands for"));
        }
        let Written { event, per, supply, basis, source, .. } = written;
        Ok(Self { event: event.0, pj, per, supply, basis, source })
    }
}
