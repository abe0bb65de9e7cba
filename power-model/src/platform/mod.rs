//! Platforms and their files: all power that is not caused by events, such as voltages, constant power, leakage,
//! clock trees and idle power. A platform is scaled for another GPU than the one that it was made for.

mod sections;

use std::path::Path;

use activity::{Event, Unit, spec};
use serde::Deserialize;

use crate::PlatformError;
use crate::quantity::{
    Basis, Bound, Celsius, Exponent, Nanometres, Quantity, Ratio, RecordedIdle, Seconds, Share, Source,
    Sourced, Volts, Watts,
};
use crate::structure::Scaling;
use crate::table::EnergyRow;

pub use sections::{Disturbance, Finish, Launch, Range, Ranges, System};

/// Built-in platforms by name.
const BUILTIN: [(&str, &str); 3] = [
    ("reference", include_str!("../../platforms/reference.ron")),
    ("iphone_4s", include_str!("../../platforms/iphone_4s.ron")),
    ("hd_4000", include_str!("../../platforms/hd_4000.ron")),
];

/// The supply where a power meter is attached.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rail {
    /// Name in a trace.
    pub name: String,
    /// Voltage of the rail, which converts watts to amperes. It differs from the core voltage.
    pub voltage_v: Sourced<Volts>,
}

/// Conversion of energies from the node of another table.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ScaledFrom {
    /// Node of the table.
    pub node_nm: Nanometres,
    /// Energy of a core event on the platform's node over that on the table's node, at equal voltage. Memory
    /// has separate nodes and is not scaled.
    pub core_scale: Sourced<Ratio>,
}

/// Leakage of the powered core: `P = reference_w (V/V0)^voltage_exponent 2^((T - T0) / doubling)`, with V0
/// the platform's [`Platform::v0_v`].
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Leakage {
    /// Leakage at V0 and `reference_c`.
    pub reference_w: Sourced<Watts>,
    /// Exponent of the voltage: 1 for a constant leakage current (Butts and Sohi, MICRO 2000), more with
    /// drain-induced barrier lowering.
    pub voltage_exponent: Sourced<Exponent>,
    /// Junction temperature, constant for the whole run.
    pub temperature_c: Sourced<Celsius>,
    /// Junction temperature of `reference_w`.
    pub reference_c: Sourced<Celsius>,
    /// Temperature difference that doubles the leakage; 0 or less makes it independent of temperature.
    pub doubling_c: Sourced<Celsius>,
    /// Share of the leakage that is left between frames, with the core power-gated, and is in [`Platform::idle_w`]. A
    /// GPU with more leakage draws as much more of it. Half if a file does not say it.
    pub idle_share: Option<Sourced<Share>>,
}

/// Power of one unit apart from its events, at [`Platform::v0_v`] and the clock of the GPU of the platform. Both
/// values scale with (V/V0)^2 and apply only in frames that use the unit.
#[derive(Clone, Debug, PartialEq)]
pub struct UnitPower {
    /// Unit.
    pub unit: Unit,
    /// Power while busy: its clock tree and registers that toggle with any work.
    pub clock_tree_w: Sourced<Watts>,
    /// Power while powered but idle, which clock gating does not remove.
    pub idle_unit_w: Sourced<Watts>,
}

/// A platform: everything about the power of a machine that is not an event.
#[derive(Clone, Debug, PartialEq)]
pub struct Platform {
    /// Name.
    pub name: String,
    /// Description.
    pub doc: String,
    /// GPU for which its numbers hold: a name, or a file that ends in `.ron`. On another GPU they are scaled.
    pub made_for: String,
    /// Process node in nanometres. It has to match the energy table's, or `energy_from` gives the table's
    /// node.
    pub node_nm: u32,
    /// Conversion from a table of another node.
    pub energy_from: Option<ScaledFrom>,
    /// The supply that a meter measures.
    pub rail: Rail,
    /// Core voltage for which the watts of this platform are stated.
    pub v0_v: Sourced<Volts>,
    /// Core voltage in operation.
    pub v_v: Sourced<Volts>,
    /// Constant power during a frame.
    pub constant_w: Sourced<Watts>,
    /// Share of [`Self::constant_w`] that memory and its controllers draw, which grows with the number of
    /// channels. None if a file does not say it.
    pub memory_share: Option<Sourced<Share>>,
    /// Leakage of the powered core.
    pub leakage: Leakage,
    /// One row per unit, in the order of [`Unit::ALL`].
    units: Vec<UnitPower>,
    /// Power between frames: everything, with the core power-gated.
    pub idle_w: Sourced<Watts>,
    /// How far off the watts may be; without it they are taken as exact.
    pub ranges: Option<Ranges>,
    /// Free-running: gap between the end of a frame and the start of the next, in which the driver submits.
    pub submit_gap_s: Sourced<Seconds>,
    /// Idle time recorded before the first frame.
    pub lead_in_s: Sourced<RecordedIdle>,
    /// Idle time recorded after the last frame.
    pub tail_s: Sourced<RecordedIdle>,
    /// Contributions around the GPU that a recording shows: launch, blocking calls, the operating system.
    pub system: System,
    /// Rows that replace rows of the energy table, for devices with other energies.
    energy_rows: Vec<EnergyRow>,
}

/// One number of a platform and its source.
#[derive(Clone, Debug, PartialEq)]
pub struct ValueSource<'a> {
    /// Field, for example `leakage.reference_w`.
    pub field: String,
    /// Value.
    pub value: f64,
    /// Unit.
    pub unit: &'static str,
    /// Kind of source.
    pub basis: Basis,
    /// Source in words.
    pub source: &'a str,
}

impl Platform {
    /// Names of the built-in platforms.
    pub fn names() -> impl Iterator<Item = &'static str> {
        BUILTIN.into_iter().map(|(name, _)| name)
    }

    /// RON text of the built-in platform `name`.
    pub fn builtin_text(name: &str) -> Option<&'static str> {
        BUILTIN.into_iter().find(|(known, _)| *known == name).map(|(_, text)| text)
    }

    /// The built-in platform `name`.
    ///
    /// # Errors
    /// [`PlatformError::Unknown`] with the nearest known name.
    pub fn builtin(name: &str) -> Result<Self, PlatformError> {
        let Some(text) = Self::builtin_text(name) else {
            let suggestion = spec::suggestion(name, &BUILTIN.map(|(known, _)| known));
            return Err(PlatformError::Unknown { name: name.to_owned(), suggestion });
        };
        Self::parse(text, &format!("power-model/platforms/{name}.ron"))
    }

    /// Read the platform in the RON file at `path`.
    ///
    /// # Errors
    /// [`PlatformError`] if the file cannot be read, a number is out of range, or a unit is missing.
    pub fn load(path: &Path) -> Result<Self, PlatformError> {
        let mut platform = spec::load::<Written>(path)?.check(&path.display().to_string())?;
        platform.name_gpu_beside(path);
        Ok(platform)
    }

    /// Parse RON `text`; `file` is the file name in messages.
    ///
    /// # Errors
    /// As for [`Self::load`].
    pub fn parse(text: &str, file: &str) -> Result<Self, PlatformError> {
        spec::parse::<Written>(text, file)?.check(file)
    }

    /// Resolve the name of a GPU file relative to the folder of the platform file at `path`.
    pub fn name_gpu_beside(&mut self, path: &Path) {
        if self.made_for.ends_with(".ron") {
            self.made_for = path.with_file_name(&self.made_for).display().to_string();
        }
    }

    /// Power of every unit apart from its events, in the order of [`Unit::ALL`].
    pub fn units(&self) -> &[UnitPower] {
        &self.units
    }

    /// Rows that replace rows of the energy table.
    pub fn energy_rows(&self) -> &[EnergyRow] {
        &self.energy_rows
    }

    /// Leakage at the operating voltage and temperature, in watts.
    pub fn leakage_w(&self) -> f64 {
        let Leakage { reference_w, voltage_exponent, temperature_c, reference_c, doubling_c, .. } =
            &self.leakage;
        let voltage = libm::pow(self.voltage_ratio(), voltage_exponent.value());
        let doublings = if doubling_c.value() > 0.0 {
            (temperature_c.value() - reference_c.value()) / doubling_c.value()
        } else {
            0.0
        };
        reference_w.value() * voltage * libm::exp2(doublings)
    }

    /// Node of the table in use, and the factor for its energies of core events.
    pub fn table_node(&self) -> (u32, f64) {
        let from = self.energy_from.as_ref();
        from.map_or((self.node_nm, 1.0), |from| (from.node_nm.get(), from.core_scale.value()))
    }

    /// V/V0: operating core voltage over the voltage for which the watts are stated.
    pub fn voltage_ratio(&self) -> f64 {
        self.v_v.value() / self.v0_v.value()
    }

    /// Every number with its source, in the order of the file. Energy rows have their own sources and are
    /// left out.
    pub fn provenance(&self) -> Vec<ValueSource<'_>> {
        let scale =
            self.energy_from.as_ref().map(|from| provenance("energy_from.core_scale", &from.core_scale));
        let mut list: Vec<_> = scale.into_iter().collect();
        list.extend([
            provenance("rail.voltage_v", &self.rail.voltage_v),
            provenance("v0_v", &self.v0_v),
            provenance("v_v", &self.v_v),
            provenance("constant_w", &self.constant_w),
        ]);
        list.extend(self.memory_share.as_ref().map(|share| provenance("memory_share", share)));
        list.extend([
            provenance("leakage.reference_w", &self.leakage.reference_w),
            provenance("leakage.voltage_exponent", &self.leakage.voltage_exponent),
            provenance("leakage.temperature_c", &self.leakage.temperature_c),
            provenance("leakage.reference_c", &self.leakage.reference_c),
            provenance("leakage.doubling_c", &self.leakage.doubling_c),
        ]);
        list.extend(self.leakage.idle_share.as_ref().map(|share| provenance("leakage.idle_share", share)));
        for row in &self.units {
            let name = row.unit.name();
            list.push(provenance(&format!("units.{name}.clock_tree_w"), &row.clock_tree_w));
            list.push(provenance(&format!("units.{name}.idle_unit_w"), &row.idle_unit_w));
        }
        list.push(provenance("idle_w", &self.idle_w));
        list.push(provenance("submit_gap_s", &self.submit_gap_s));
        list.push(provenance("lead_in_s", &self.lead_in_s));
        list.push(provenance("tail_s", &self.tail_s));
        list.extend(self.system.provenance());
        list
    }
}

fn provenance<'a, T: Quantity>(field: &str, number: &'a Sourced<T>) -> ValueSource<'a> {
    ValueSource {
        field: field.to_owned(),
        value: number.value(),
        unit: number.unit(),
        basis: number.basis(),
        source: number.source(),
    }
}

/// A platform as written in a file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Written {
    name: String,
    doc: Source,
    made_for: String,
    node_nm: Nanometres,
    #[serde(default)]
    energy_from: Option<ScaledFrom>,
    rail: Rail,
    v0_v: Sourced<Volts>,
    v_v: Sourced<Volts>,
    constant_w: Sourced<Watts>,
    #[serde(default)]
    memory_share: Option<Sourced<Share>>,
    leakage: Leakage,
    units: Vec<UnitRow>,
    idle_w: Sourced<Watts>,
    #[serde(default)]
    ranges: Option<Ranges>,
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
    fn check(self, file: &str) -> Result<Platform, PlatformError> {
        refuse_repeated_rows(&self.energy_rows, file)?;
        refuse_repeated_names(&self.system, file)?;
        Ok(Platform {
            name: self.name,
            doc: self.doc.text().to_owned(),
            made_for: self.made_for,
            node_nm: self.node_nm.get(),
            energy_from: self.energy_from,
            rail: self.rail,
            v0_v: self.v0_v,
            v_v: self.v_v,
            constant_w: self.constant_w,
            memory_share: self.memory_share,
            leakage: self.leakage,
            units: complete(self.units, file)?,
            idle_w: self.idle_w,
            ranges: self.ranges,
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

/// Share of the leakage that is left between frames, of a platform that does not say it: power gating leaves
/// memories and what is always on.
const IDLE_SHARE: f64 = 0.5;

impl Platform {
    /// The platform at `bound`, of a GPU that differs by `scaling` from the one that it was made for.
    #[must_use]
    pub fn on(&self, scaling: &Scaling, bound: Bound) -> Self {
        self.at(bound).scaled(scaling, bound)
    }

    fn scaled(&self, scaling: &Scaling, bound: Bound) -> Self {
        let how = "scaled to the structure and clocks of the GPU";
        let mut scaled = self.clone();
        let leakage = scaling.leakage.at(bound);
        let reference_w = &self.leakage.reference_w;
        scaled.leakage.reference_w = reference_w.computed(reference_w.value() * leakage, how);
        let share = self.memory_share.as_ref().map_or(0.0, |share| share.value());
        let memory_w = self.constant_w.value() * share * (scaling.channels - 1.0);
        scaled.constant_w = self.constant_w.computed(self.constant_w.value() + memory_w, how);
        let share = self.leakage.idle_share.as_ref().map_or(IDLE_SHARE, |share| share.value());
        let leaked_w = share * self.leakage_w() * (leakage - 1.0);
        scaled.idle_w = self.idle_w.computed((self.idle_w.value() + memory_w + leaked_w).max(0.0), how);
        for row in &mut scaled.units {
            *row = unit(row, scaling, bound, how);
        }
        for row in &mut scaled.energy_rows {
            *row = row.on(scaling);
        }
        scaled
    }
}

/// A unit's watts. In the levels below the L2 those of an idle unit are leakage and refresh, and only what is
/// above them is the clock's.
fn unit(row: &UnitPower, scaling: &Scaling, bound: Bound, how: &str) -> UnitPower {
    let (busy_w, idle_w) = (row.clock_tree_w.value(), row.idle_unit_w.value());
    let clock = scaling.clock_tree(row.unit).at(bound);
    let is_below_l2 = matches!(row.unit, Unit::Llc | Unit::Edram);
    let retention = scaling.retention(row.unit).at(bound);
    let [busy, idle] = match is_below_l2 {
        true if clock == 1.0 && retention == 1.0 => [busy_w, idle_w],
        true => [idle_w * retention + (busy_w - idle_w) * clock, idle_w * retention],
        false => [busy_w * clock, idle_w * clock],
    };
    UnitPower {
        unit: row.unit,
        clock_tree_w: row.clock_tree_w.computed(busy, how),
        idle_unit_w: row.idle_unit_w.computed(idle, how),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::quantity::Source;

    #[test]
    fn every_number_of_every_builtin_has_a_source() {
        for name in Platform::names() {
            let platform = Platform::builtin(name).unwrap();
            assert_eq!(platform.name, name);
            for row in platform.provenance() {
                assert!(row.source.len() > 10, "{name}: {} has no source", row.field);
            }
        }
    }

    #[test]
    fn leakage_follows_its_law() {
        let mut platform = Platform::builtin("reference").unwrap();
        let volts = |v_v: f64| Sourced::Assumed(Volts::new(v_v).unwrap(), source());
        platform.v0_v = volts(1.0);
        platform.v_v = volts(1.0);
        let reference_w = platform.leakage.reference_w.value();
        platform.leakage.temperature_c = platform.leakage.reference_c.clone();
        assert_eq!(platform.leakage_w(), reference_w);

        platform.v_v = volts(1.1);
        platform.leakage.voltage_exponent = Sourced::Assumed(Exponent::new(2.0).unwrap(), source());
        assert!((platform.leakage_w() / reference_w - 1.21).abs() < 1e-12);

        platform.v_v = volts(1.0);
        let hotter = platform.leakage.reference_c.value() + platform.leakage.doubling_c.value();
        platform.leakage.temperature_c = Sourced::Assumed(Celsius::new(hotter).unwrap(), source());
        assert!((platform.leakage_w() / reference_w - 2.0).abs() < 1e-12);
    }

    fn source() -> Source {
        Source::try_from("for this test".to_owned()).unwrap()
    }
}
