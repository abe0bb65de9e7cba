//! Energy tables: energy per event on one process node at one voltage, with a source in each row.

use std::path::Path;

use activity::{Event, spec};
use serde::Deserialize;

use crate::EnergyTableError;
use crate::quantity::{Basis, Bound, Nanometres, Picojoules, Source, Volts};
use crate::structure::Scaling;

/// Built-in tables by name.
const BUILTIN: [(&str, &str); 1] = [("28nm", include_str!("../tables/28nm.ron"))];

/// Entry of one event.
#[derive(Clone, Debug, PartialEq)]
pub enum TableEntry {
    /// The event has an energy.
    Costs(EnergyRow),
    /// The event has no energy of its own, for the given reason.
    Free(Source),
}

/// Energy per event on one process node, with an entry for every event.
#[derive(Clone, Debug, PartialEq)]
pub struct EnergyTable {
    name: String,
    doc: String,
    node_nm: u32,
    v0_v: Volts,
    valid_v: [Volts; 2],
    /// Indexed by event.
    entries: Vec<TableEntry>,
}

/// A table as written in a file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Written {
    name: String,
    doc: String,
    node_nm: Nanometres,
    v0_v: Volts,
    v_min_v: Volts,
    v_max_v: Volts,
    rows: Vec<EnergyRow>,
    free: Vec<FreeRow>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FreeRow {
    event: EventName,
    reason: Source,
}

impl EnergyTable {
    /// Names of the built-in tables.
    pub fn names() -> impl Iterator<Item = &'static str> {
        BUILTIN.into_iter().map(|(name, _)| name)
    }

    /// RON text of the built-in table `name`.
    pub fn builtin_text(name: &str) -> Option<&'static str> {
        BUILTIN.into_iter().find(|(known, _)| *known == name).map(|(_, text)| text)
    }

    /// The built-in table `name`.
    ///
    /// # Errors
    /// [`EnergyTableError::Unknown`] with the nearest known name.
    pub fn builtin(name: &str) -> Result<Self, EnergyTableError> {
        let Some(text) = Self::builtin_text(name) else {
            let suggestion = spec::suggestion(name, &BUILTIN.map(|(known, _)| known));
            return Err(EnergyTableError::Unknown { name: name.to_owned(), suggestion });
        };
        Self::parse(text, &format!("power-model/tables/{name}.ron"))
    }

    /// Read the table in the RON file at `path`.
    ///
    /// # Errors
    /// [`EnergyTableError`] if the file cannot be read, a row is invalid, or an event is missing.
    pub fn load(path: &Path) -> Result<Self, EnergyTableError> {
        Self::check(spec::load(path)?, &path.display().to_string())
    }

    /// Parse RON `text`; `file` is the file name in messages.
    ///
    /// # Errors
    /// As for [`Self::load`].
    pub fn parse(text: &str, file: &str) -> Result<Self, EnergyTableError> {
        Self::check(spec::parse(text, file)?, file)
    }

    fn check(written: Written, file: &str) -> Result<Self, EnergyTableError> {
        let Written { name, doc, node_nm, v0_v, v_min_v, v_max_v, rows, free } = written;
        if !(v_min_v <= v0_v && v0_v <= v_max_v) {
            return Err(EnergyTableError::Voltages { path: file.to_owned() });
        }
        let costs = rows.into_iter().map(|row| (row.event(), TableEntry::Costs(row)));
        let free = free.into_iter().map(|row| (row.event.0, TableEntry::Free(row.reason)));
        let entries = complete(costs.chain(free), file)?;
        let node_nm = node_nm.get();
        Ok(Self { name, doc, node_nm, v0_v, valid_v: [v_min_v, v_max_v], entries })
    }

    /// Name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Description.
    pub fn doc(&self) -> &str {
        &self.doc
    }

    /// Process node in nanometres.
    pub const fn node_nm(&self) -> u32 {
        self.node_nm
    }

    /// Core voltage of the energies, in volts.
    pub const fn v0_v(&self) -> f64 {
        self.v0_v.value()
    }

    /// Range of core voltages in which the source supports scaling with (V/V0)^2.
    pub fn valid_v(&self) -> [f64; 2] {
        self.valid_v.map(Volts::value)
    }

    /// Rows with energies, in the order of [`Event::ALL`].
    pub fn rows(&self) -> impl Iterator<Item = &EnergyRow> {
        self.entries.iter().filter_map(|entry| match entry {
            TableEntry::Costs(row) => Some(row),
            TableEntry::Free(_) => None,
        })
    }

    /// The table for a GPU that differs from that of the platform by `scaling`.
    #[must_use]
    pub fn on(&self, scaling: &Scaling) -> Self {
        let entry = |entry: &TableEntry| match entry {
            TableEntry::Costs(row) => TableEntry::Costs(row.on(scaling)),
            TableEntry::Free(reason) => TableEntry::Free(reason.clone()),
        };
        Self { entries: self.entries.iter().map(entry).collect(), ..self.clone() }
    }

    /// Energy per event at V0 in joules, at one end of every interval.
    pub fn joules(&self, bound: Bound) -> [f64; Event::COUNT] {
        let mut joules = [0.0; Event::COUNT];
        for row in self.rows() {
            joules[row.event() as usize] = row.joules(bound);
        }
        joules
    }
}

/// One entry per event in the order of [`Event::ALL`]. The error names a duplicate or missing event.
fn complete(
    given: impl Iterator<Item = (Event, TableEntry)>,
    file: &str,
) -> Result<Vec<TableEntry>, EnergyTableError> {
    let mut entries: Vec<Option<TableEntry>> = vec![None; Event::COUNT];
    for (event, entry) in given {
        if entries[event as usize].replace(entry).is_some() {
            return Err(EnergyTableError::Duplicate { path: file.to_owned(), event: event.name() });
        }
    }
    let pairs = Event::ALL.into_iter().zip(entries);
    pairs
        .map(|(event, entry)| {
            entry.ok_or_else(|| EnergyTableError::Missing { path: file.to_owned(), event: event.name() })
        })
        .collect()
}

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
#[serde(try_from = "WrittenRow")]
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

    /// Energy at one end of the interval, in joules.
    pub fn joules(&self, bound: Bound) -> f64 {
        self.pj[bound as usize] * J_PER_PJ
    }

    /// The row for a GPU that differs from that of the platform by `scaling`.
    #[must_use]
    pub(crate) fn on(&self, scaling: &Scaling) -> Self {
        let ratio = scaling.event(self.event);
        let [low, nominal, high] = self.pj;
        Self { pj: [low * ratio.low, nominal * ratio.nominal, high * ratio.high], ..self.clone() }
    }

    /// Supply.
    pub const fn supply(&self) -> Supply {
        self.supply
    }
}

/// An event, deserialized from its name.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(try_from = "String")]
struct EventName(Event);

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
struct WrittenRow {
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

impl TryFrom<WrittenRow> for EnergyRow {
    type Error = String;
    fn try_from(written: WrittenRow) -> Result<Self, String> {
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
        let WrittenRow { event, per, supply, basis, source, .. } = written;
        Ok(Self { event: event.0, pj, per, supply, basis, source })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_event_costs_or_is_free_for_a_stated_reason() {
        let table = EnergyTable::builtin("28nm").unwrap();
        for (event, entry) in Event::ALL.into_iter().zip(&table.entries) {
            let text = match entry {
                TableEntry::Costs(row) => row.source.text(),
                TableEntry::Free(reason) => reason.text(),
            };
            assert!(text.len() > 20, "{event:?}: `{text}` is no source");
        }
    }

    #[test]
    fn every_builtin_parses_under_its_own_name() {
        for name in EnergyTable::names() {
            assert_eq!(EnergyTable::builtin(name).unwrap().name(), name);
        }
    }

    #[test]
    fn bounds_enclose_the_nominal() {
        let table = EnergyTable::builtin("28nm").unwrap();
        let [low, nominal, high] = Bound::ALL.map(|bound| table.joules(bound));
        for event in Event::ALL {
            let at = event as usize;
            assert!(low[at] <= nominal[at] && nominal[at] <= high[at], "{event:?}");
        }
        assert!(nominal.iter().any(|&joules| joules > 0.0));
    }
}
