//! What surrounds the events: voltages, constant power, leakage, clock trees, idle.

mod file;
mod system;

use std::path::Path;

use activity::{Unit, spec};
use serde::Deserialize;

use self::file::Written;
pub use self::system::{Disturbance, Finish, Launch, System};
use crate::PlatformError;
use crate::quantity::{
    Basis, Celsius, Exponent, Nanometres, Quantity, Ratio, RecordedIdle, Seconds, Sourced, Volts, Watts,
};
use crate::row::EnergyRow;

/// The platforms that come with the crate, by name.
const BUILTIN: [(&str, &str); 3] = [
    ("reference", include_str!("../../platforms/reference.ron")),
    ("iphone_4s", include_str!("../../platforms/iphone_4s.ron")),
    ("hd_4000", include_str!("../../platforms/hd_4000.ron")),
];

/// The supply at which a power meter would be put.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rail {
    /// Its name in a trace.
    pub name: String,
    /// Its voltage, which turns watts into amperes; not the core voltage.
    pub voltage_v: Sourced<Volts>,
}

/// How energies of another node's table become this node's.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ScaledFrom {
    /// The node of the table.
    pub node_nm: Nanometres,
    /// Energy of an event in the core on this platform's node over that on the table's, at one voltage. Memory has nodes of
    /// its own and is not scaled.
    pub core_scale: Sourced<Ratio>,
}

/// Leakage of the powered core: `P = reference_w (V/V0)^voltage_exponent 2^((T - T0) / doubling)`, with V0 the
/// platform's [`Platform::v0_v`].
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Leakage {
    /// At V0 and `reference_c`.
    pub reference_w: Sourced<Watts>,
    /// 1 for a current that does not depend on the voltage (Butts and Sohi, MICRO 2000), more with
    /// drain-induced barrier lowering.
    pub voltage_exponent: Sourced<Exponent>,
    /// The junction temperature, held fixed for the whole run.
    pub temperature_c: Sourced<Celsius>,
    /// The junction temperature `reference_w` holds at.
    pub reference_c: Sourced<Celsius>,
    /// How many degrees double the leakage; 0 or less switches the dependence off.
    pub doubling_c: Sourced<Celsius>,
}

/// What one unit draws apart from its events, at [`Platform::v0_v`] and the clock of the GPU it is used with; both
/// scale with (V/V0)^2. It counts only in frames that use the unit.
#[derive(Clone, Debug, PartialEq)]
pub struct UnitPower {
    /// The unit.
    pub unit: Unit,
    /// While it is busy: its clock tree and the registers that toggle whatever it does.
    pub clock_tree_w: Sourced<Watts>,
    /// While it is powered but idle: what clock gating does not stop.
    pub idle_unit_w: Sourced<Watts>,
}

/// A machine: everything about its power that is not an event.
#[derive(Clone, Debug, PartialEq)]
pub struct Platform {
    /// Its name.
    pub name: String,
    /// What it is, in words.
    pub doc: String,
    /// Its process node in nanometres, which the energy table's must match, or that of `energy_from`.
    pub node_nm: u32,
    /// The table it uses instead of one for its own node.
    pub energy_from: Option<ScaledFrom>,
    /// The supply a meter would see.
    pub rail: Rail,
    /// The core voltage at which the watts of this platform are stated.
    pub v0_v: Sourced<Volts>,
    /// The core voltage it runs at.
    pub v_v: Sourced<Volts>,
    /// Drawn as long as a frame runs, whatever it does.
    pub constant_w: Sourced<Watts>,
    /// Leakage of the powered core.
    pub leakage: Leakage,
    /// One row per unit, in the order of [`Unit::ALL`].
    units: Vec<UnitPower>,
    /// The floor between frames: everything, with the core power-gated.
    pub idle_w: Sourced<Watts>,
    /// Free-running, the gap between the end of a frame and the start of the next, while the driver submits.
    pub submit_gap_s: Sourced<Seconds>,
    /// Idle time recorded before the first frame.
    pub lead_in_s: Sourced<RecordedIdle>,
    /// Idle time recorded after the last frame.
    pub tail_s: Sourced<RecordedIdle>,
    /// What surrounds the GPU and shows in a recording: launch, blocking calls, the operating system.
    pub system: System,
    /// Rows that replace the energy table's, for devices the table cannot know.
    energy_rows: Vec<EnergyRow>,
}

/// One number of a platform and where it comes from.
#[derive(Clone, Debug, PartialEq)]
pub struct Provenance<'a> {
    /// The field, for example `leakage.reference_w`.
    pub field: String,
    /// The number.
    pub value: f64,
    /// Its unit.
    pub unit: &'static str,
    /// Where it comes from, in one word.
    pub basis: Basis,
    /// Where it comes from, in words.
    pub source: &'a str,
}

impl Platform {
    /// The names of the platforms that come with the crate.
    pub fn names() -> impl Iterator<Item = &'static str> {
        BUILTIN.into_iter().map(|(name, _)| name)
    }

    /// The platform called `name` that comes with the crate.
    ///
    /// # Errors
    /// [`PlatformError::Unknown`] with the nearest known name.
    pub fn builtin(name: &str) -> Result<Self, PlatformError> {
        let Some((_, text)) = BUILTIN.into_iter().find(|(known, _)| *known == name) else {
            let mend = spec::suggestion(name, &BUILTIN.map(|(known, _)| known));
            return Err(PlatformError::Unknown { name: name.to_owned(), mend });
        };
        Self::parse(text, &format!("power-model/platforms/{name}.ron"))
    }

    /// Reads the platform in the RON file at `path`.
    ///
    /// # Errors
    /// [`PlatformError`] when the file cannot be read, a number is out of range, or a unit is missing.
    pub fn load(path: &Path) -> Result<Self, PlatformError> {
        spec::load::<Written>(path)?.check(&path.display().to_string())
    }

    /// Parses RON `text`; `file` stands for the file in messages.
    ///
    /// # Errors
    /// As [`Self::load`].
    pub fn parse(text: &str, file: &str) -> Result<Self, PlatformError> {
        spec::parse::<Written>(text, file)?.check(file)
    }

    /// What each unit draws apart from its events, in the order of [`Unit::ALL`].
    pub fn units(&self) -> &[UnitPower] {
        &self.units
    }

    /// Rows that replace the energy table's.
    pub fn energy_rows(&self) -> &[EnergyRow] {
        &self.energy_rows
    }

    /// Leakage at the core voltage and temperature it runs at, in watts.
    pub fn leakage_w(&self) -> f64 {
        let Leakage { reference_w, voltage_exponent, temperature_c, reference_c, doubling_c } = &self.leakage;
        let voltage = libm::pow(self.voltage_ratio(), voltage_exponent.value());
        let doublings = if doubling_c.value() > 0.0 {
            (temperature_c.value() - reference_c.value()) / doubling_c.value()
        } else {
            0.0
        };
        reference_w.value() * voltage * libm::exp2(doublings)
    }

    /// The node of the table it uses, and what the table's energies of core events are multiplied with.
    pub fn table_node(&self) -> (u32, f64) {
        let from = self.energy_from.as_ref();
        from.map_or((self.node_nm, 1.0), |from| (from.node_nm.get(), from.core_scale.value()))
    }

    /// V/V0: the core voltage it runs at over the one its watts are stated at.
    pub fn voltage_ratio(&self) -> f64 {
        self.v_v.value() / self.v0_v.value()
    }

    /// Every number with its source, in the order of the file; energy rows excepted, which carry their own.
    pub fn provenance(&self) -> Vec<Provenance<'_>> {
        let scale =
            self.energy_from.as_ref().map(|from| provenance("energy_from.core_scale", &from.core_scale));
        let mut list: Vec<_> = scale.into_iter().collect();
        list.extend([
            provenance("rail.voltage_v", &self.rail.voltage_v),
            provenance("v0_v", &self.v0_v),
            provenance("v_v", &self.v_v),
            provenance("constant_w", &self.constant_w),
            provenance("leakage.reference_w", &self.leakage.reference_w),
            provenance("leakage.voltage_exponent", &self.leakage.voltage_exponent),
            provenance("leakage.temperature_c", &self.leakage.temperature_c),
            provenance("leakage.reference_c", &self.leakage.reference_c),
            provenance("leakage.doubling_c", &self.leakage.doubling_c),
        ]);
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

fn provenance<'a, T: Quantity>(field: &str, number: &'a Sourced<T>) -> Provenance<'a> {
    Provenance {
        field: field.to_owned(),
        value: number.value(),
        unit: number.unit(),
        basis: number.basis(),
        source: number.source(),
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
