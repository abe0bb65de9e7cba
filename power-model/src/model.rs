//! Conversion of activity over time to power over time.

use activity::{Bin, Counts, Event, Timeline, Unit};

use crate::error::{ModelError, TimelineError};
use crate::frame::{FramePower, S_PER_PS, bin_lengths_ps};
use crate::parts::{Energy, Part};
use crate::platform::Platform;
use crate::quantity::Watts;
use crate::row::{EnergyRow, Supply};
use crate::table::{Bound, EnergyTable};

/// An energy table and a platform, with voltages applied.
#[derive(Clone, Debug, PartialEq)]
pub struct PowerModel {
    /// Energy per event at the platform's voltage, in joules, indexed by event.
    event_j: [f64; Event::COUNT],
    clock_tree_w: [f64; Unit::COUNT],
    idle_unit_w: [f64; Unit::COUNT],
    constant_w: f64,
    leakage_w: f64,
}

impl PowerModel {
    /// The model with nominal energies.
    ///
    /// # Errors
    /// [`ModelError`] if the table is for another node or does not cover the platform's voltage.
    pub fn new(table: &EnergyTable, platform: &Platform) -> Result<Self, ModelError> {
        Self::at(table, platform, Bound::Nominal)
    }

    /// The model with all energies at one end of their intervals.
    ///
    /// # Errors
    /// As for [`Self::new`].
    pub fn at(table: &EnergyTable, platform: &Platform, bound: Bound) -> Result<Self, ModelError> {
        check_match(table, platform)?;
        let squared = platform.voltage_ratio() * platform.voltage_ratio();
        let unit_w = |watts: fn(&crate::UnitPower) -> f64| {
            let mut by_unit = [0.0; Unit::COUNT];
            for row in platform.units() {
                by_unit[row.unit as usize] = watts(row) * squared;
            }
            by_unit
        };
        Ok(Self {
            event_j: event_energies(table, platform, bound),
            clock_tree_w: unit_w(|row| row.clock_tree_w.value()),
            idle_unit_w: unit_w(|row| row.idle_unit_w.value()),
            constant_w: platform.constant_w.value(),
            leakage_w: platform.leakage_w(),
        })
    }

    /// Energy of one `event` at the platform's voltage, in joules.
    pub fn event_j(&self, event: Event) -> f64 {
        self.event_j[event as usize]
    }

    /// Power of one frame from its activity.
    ///
    /// A unit without activity in the whole frame is not modelled: it has no clock or idle power.
    ///
    /// # Errors
    /// [`TimelineError`] if the timeline contradicts itself.
    pub fn frame(&self, timeline: &Timeline) -> Result<FramePower, TimelineError> {
        check_timeline(timeline)?;
        let used = used_units(timeline);
        let mut energy = Energy::ZERO;
        let mut watts = Vec::with_capacity(timeline.bins.len());
        let lengths = bin_lengths_ps(timeline.bin_ps, timeline.duration_ps);
        for (length_ps, bin) in lengths.zip(&timeline.bins) {
            let spent = self.bin_energy(bin, length_ps, used);
            energy += &spent;
            let length_s = length_ps as f64 * S_PER_PS;
            watts.push(spent.by_part_j.map(|joules| joules / length_s));
        }
        Ok(FramePower { bin_ps: timeline.bin_ps, duration_ps: timeline.duration_ps, watts, energy })
    }

    /// Energy of the events alone, from counts of any origin. Parts that depend on time are 0.
    pub fn counts_energy(&self, counts: &Counts) -> Energy {
        let mut energy = Energy::ZERO;
        for (event, count) in counts.iter() {
            energy[Part::Unit(event.unit())] += count as f64 * self.event_j(event);
        }
        energy
    }

    fn bin_energy(&self, bin: &Bin, length_ps: u64, used: [bool; Unit::COUNT]) -> Energy {
        let length_s = length_ps as f64 * S_PER_PS;
        let mut energy = self.counts_energy(&bin.counts);
        energy[Part::Constant] = self.constant_w * length_s;
        energy[Part::Leakage] = self.leakage_w * length_s;
        for unit in Unit::ALL.into_iter().filter(|&unit| used[unit as usize]) {
            let at = unit as usize;
            let busy_s = bin.busy_ps[at] as f64 * S_PER_PS;
            let idle_s = (length_ps - bin.busy_ps[at]) as f64 * S_PER_PS;
            energy[Part::ClockTree] += self.clock_tree_w[at] * busy_s + self.idle_unit_w[at] * idle_s;
        }
        energy
    }
}

fn check_match(table: &EnergyTable, platform: &Platform) -> Result<(), ModelError> {
    if table.node_nm() != platform.table_node().0 {
        return Err(ModelError::Node {
            platform: platform.name.clone(),
            platform_nm: platform.table_node().0,
            table: table.name().to_owned(),
            table_nm: table.node_nm(),
        });
    }
    let (v_v, [low_v, high_v]) = (platform.v_v.value(), table.valid_v());
    if !(low_v..=high_v).contains(&v_v) {
        let (platform, table) = (platform.name.clone(), table.name().to_owned());
        return Err(ModelError::Voltage { platform, v_v, table, low_v, high_v });
    }
    let (leakage_w, most_w) = (platform.leakage_w(), Watts::MAX);
    if !(0.0..=most_w).contains(&leakage_w) {
        return Err(ModelError::Leakage { platform: platform.name.clone(), leakage_w, most_w });
    }
    Ok(())
}

/// Energy per event in joules. Rows of the platform replace those of the table, and core rows are scaled to
/// the core voltage. Switching energy is proportional to C V^2 (Horowitz 2014). Rows of the platform are also
/// stated at the table's V0, but on the platform's node.
fn event_energies(table: &EnergyTable, platform: &Platform, bound: Bound) -> [f64; Event::COUNT] {
    let ratio = platform.v_v.value() / table.v0_v();
    let at_voltage = |row: &EnergyRow| match row.supply() {
        Supply::Core => row.joules(bound) * (ratio * ratio),
        Supply::Memory => row.joules(bound),
    };
    let scale = platform.table_node().1;
    let mut joules = [0.0; Event::COUNT];
    for row in table.rows() {
        let node = if row.supply() == Supply::Core { scale } else { 1.0 };
        joules[row.event() as usize] = node * at_voltage(row);
    }
    for row in platform.energy_rows() {
        joules[row.event() as usize] = at_voltage(row);
    }
    joules
}

fn check_timeline(timeline: &Timeline) -> Result<(), TimelineError> {
    let &Timeline { bin_ps, duration_ps, ref bins } = timeline;
    if bin_ps == 0 {
        return Err(TimelineError::EmptyBin);
    }
    if duration_ps.div_ceil(bin_ps) > bins.len() as u64 {
        return Err(TimelineError::TooShort { bins: bins.len(), bin_ps, duration_ps });
    }
    let mut left_ps = duration_ps;
    for (index, bin) in bins.iter().enumerate() {
        let length_ps = left_ps.min(bin_ps);
        left_ps -= length_ps;
        if length_ps == 0 && *bin != Bin::default() {
            return Err(TimelineError::AfterEnd { bin: index });
        }
        if let Some(unit) = Unit::ALL.into_iter().find(|&unit| bin.busy_ps[unit as usize] > length_ps) {
            let busy_ps = bin.busy_ps[unit as usize];
            return Err(TimelineError::TooBusy { bin: index, unit: unit.name(), busy_ps, length_ps });
        }
    }
    Ok(())
}

fn used_units(timeline: &Timeline) -> [bool; Unit::COUNT] {
    let (counts, busy_ps) = (timeline.total(), timeline.busy_ps());
    Unit::ALL.map(|unit| counts.uses(unit) || busy_ps[unit as usize] > 0)
}
