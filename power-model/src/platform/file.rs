//! File format of a platform.

use activity::{Event, Unit, spec};
use serde::Deserialize;

use super::{Leakage, Platform, Rail, ScaledFrom, System, UnitPower};
use crate::PlatformError;
use crate::quantity::{Nanometres, RecordedIdle, Seconds, Source, Sourced, Volts, Watts};
use crate::row::EnergyRow;

/// A platform as written in a file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Written {
    name: String,
    doc: Source,
    node_nm: Nanometres,
    #[serde(default)]
    energy_from: Option<ScaledFrom>,
    rail: Rail,
    v0_v: Sourced<Volts>,
    v_v: Sourced<Volts>,
    constant_w: Sourced<Watts>,
    leakage: Leakage,
    units: Vec<UnitRow>,
    idle_w: Sourced<Watts>,
    submit_gap_s: Sourced<Seconds>,
    lead_in_s: Sourced<RecordedIdle>,
    tail_s: Sourced<RecordedIdle>,
    #[serde(default)]
    system: System,
    #[serde(default)]
    energy_rows: Vec<EnergyRow>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct UnitRow {
    unit: UnitName,
    clock_tree_w: Sourced<Watts>,
    idle_unit_w: Sourced<Watts>,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(try_from = "String")]
struct UnitName(Unit);

impl TryFrom<String> for UnitName {
    type Error = String;
    fn try_from(name: String) -> Result<Self, String> {
        let unknown =
            || format!("unknown unit `{name}`, {}", spec::suggestion(&name, &Unit::ALL.map(Unit::name)));
        Unit::from_name(&name).map(Self).ok_or_else(unknown)
    }
}

impl Written {
    /// Check the file and build the platform. The error names a duplicate or missing entry.
    pub(super) fn check(self, file: &str) -> Result<Platform, PlatformError> {
        refuse_repeated_rows(&self.energy_rows, file)?;
        refuse_repeated_names(&self.system, file)?;
        Ok(Platform {
            name: self.name,
            doc: self.doc.text().to_owned(),
            node_nm: self.node_nm.get(),
            energy_from: self.energy_from,
            rail: self.rail,
            v0_v: self.v0_v,
            v_v: self.v_v,
            constant_w: self.constant_w,
            leakage: self.leakage,
            units: complete(self.units, file)?,
            idle_w: self.idle_w,
            submit_gap_s: self.submit_gap_s,
            lead_in_s: self.lead_in_s,
            tail_s: self.tail_s,
            system: self.system,
            energy_rows: self.energy_rows,
        })
    }
}

fn refuse_repeated_rows(rows: &[EnergyRow], file: &str) -> Result<(), PlatformError> {
    let mut seen = [false; Event::COUNT];
    for row in rows {
        if std::mem::replace(&mut seen[row.event() as usize], true) {
            return Err(PlatformError::DuplicateRow { path: file.to_owned(), event: row.event().name() });
        }
    }
    Ok(())
}

fn refuse_repeated_names(system: &System, file: &str) -> Result<(), PlatformError> {
    for (at, disturbance) in system.disturbances.iter().enumerate() {
        if system.disturbances[..at].iter().any(|other| other.name() == disturbance.name()) {
            let name = disturbance.name().to_owned();
            return Err(PlatformError::DuplicateDisturbance { path: file.to_owned(), name });
        }
    }
    Ok(())
}

/// One row per unit in the order of [`Unit::ALL`]. The error names a duplicate or missing unit.
fn complete(rows: Vec<UnitRow>, file: &str) -> Result<Vec<UnitPower>, PlatformError> {
    let mut units: Vec<Option<UnitPower>> = vec![None; Unit::COUNT];
    for UnitRow { unit: UnitName(unit), clock_tree_w, idle_unit_w } in rows {
        if units[unit as usize].replace(UnitPower { unit, clock_tree_w, idle_unit_w }).is_some() {
            return Err(PlatformError::DuplicateUnit { path: file.to_owned(), unit: unit.name() });
        }
    }
    let pairs = Unit::ALL.into_iter().zip(units);
    pairs
        .map(|(unit, row)| {
            row.ok_or_else(|| PlatformError::MissingUnit { path: file.to_owned(), unit: unit.name() })
        })
        .collect()
}
