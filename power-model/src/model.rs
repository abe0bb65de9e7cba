//! Parts that draw power and energy by part, and the conversion of activity over time to the power of a frame
//! over time.

use std::ops::{AddAssign, Index, IndexMut};

use activity::{Bin, Counts, Event, S_PER_PS, Timeline, Unit};
use serde::{Serialize, Serializer};

use crate::platform::Platform;
use crate::quantity::{Bound, Watts};
use crate::structure::Scaling;
use crate::table::{EnergyRow, EnergyTable, Supply};
use crate::{ModelError, TimelineError};

/// A part that draws power: the events of a unit, or power that no event causes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Part {
    /// The events of one unit.
    Unit(Unit),
    /// Constant power during a frame.
    Constant,
    /// Leakage of the powered core.
    Leakage,
    /// Clock trees of busy units, and idle power of powered units.
    ClockTree,
    /// Idle power between frames, with the core power-gated.
    Idle,
}

/// Number of parts.
pub const PARTS: usize = Unit::COUNT + 4;

impl Part {
    /// All parts in the order of storage and summation: units as declared, then the others.
    pub const ALL: [Self; PARTS] = {
        let mut all = [Self::Idle; PARTS];
        let mut at = 0;
        while at < Unit::COUNT {
            all[at] = Self::Unit(Unit::ALL[at]);
            at += 1;
        }
        all[Self::Constant.index()] = Self::Constant;
        all[Self::Leakage.index()] = Self::Leakage;
        all[Self::ClockTree.index()] = Self::ClockTree;
        all
    };

    /// Index in [`Part::ALL`].
    pub const fn index(self) -> usize {
        match self {
            Self::Unit(unit) => unit as usize,
            Self::Constant => Unit::COUNT,
            Self::Leakage => Unit::COUNT + 1,
            Self::ClockTree => Unit::COUNT + 2,
            Self::Idle => Unit::COUNT + 3,
        }
    }

    /// Whether it is a unit that a GPU may lack.
    pub const fn is_optional(self) -> bool {
        matches!(self, Self::Unit(unit) if unit.is_optional())
    }

    /// Name in files, for example `sample_test` or `leakage`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Unit(unit) => unit.name(),
            Self::Constant => "constant",
            Self::Leakage => "leakage",
            Self::ClockTree => "clock_tree",
            Self::Idle => "idle",
        }
    }

    /// One sentence: what draws the power.
    pub const fn doc(self) -> &'static str {
        match self {
            Self::Unit(unit) => unit.doc(),
            Self::Constant => "Drawn as long as a frame runs, whatever it does.",
            Self::Leakage => "Leakage of the powered core.",
            Self::ClockTree => "Clock trees of busy units and what powered but idle units draw.",
            Self::Idle => "The floor between frames, with the core power-gated.",
        }
    }
}

/// Energy by part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Energy {
    /// Energy in joules, in the order of [`Part::ALL`].
    pub by_part_j: [f64; PARTS],
}

impl Energy {
    /// Zero energy.
    pub const ZERO: Self = Self { by_part_j: [0.0; PARTS] };

    /// Sum of all parts in joules, in the order of [`Part::ALL`]. No other total is stored, so it is exact by
    /// definition.
    pub fn total_j(&self) -> f64 {
        self.by_part_j.iter().fold(0.0, |sum, joules| sum + joules)
    }

    /// Every part with its energy in joules, in the order of [`Part::ALL`].
    pub fn iter(&self) -> impl Iterator<Item = (Part, f64)> + '_ {
        Part::ALL.into_iter().zip(self.by_part_j)
    }

    /// The same without units that a GPU may lack and that used no energy.
    pub fn reported(&self) -> impl Iterator<Item = (Part, f64)> + '_ {
        self.iter().filter(|(part, joules)| !part.is_optional() || *joules > 0.0)
    }
}

impl Default for Energy {
    fn default() -> Self {
        Self::ZERO
    }
}

impl Index<Part> for Energy {
    type Output = f64;
    fn index(&self, part: Part) -> &f64 {
        &self.by_part_j[part.index()]
    }
}

impl IndexMut<Part> for Energy {
    fn index_mut(&mut self, part: Part) -> &mut f64 {
        &mut self.by_part_j[part.index()]
    }
}

impl AddAssign<&Self> for Energy {
    fn add_assign(&mut self, other: &Self) {
        for (mine, theirs) in self.by_part_j.iter_mut().zip(other.by_part_j) {
            *mine += theirs;
        }
    }
}

impl Serialize for Energy {
    /// Write a map from part name to joules, as [`Energy::reported`].
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.reported().map(|(part, joules)| (part.name(), joules)))
    }
}

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

    /// The model with all energies and watts at one end of their intervals.
    ///
    /// # Errors
    /// As for [`Self::new`].
    pub fn at(table: &EnergyTable, platform: &Platform, bound: Bound) -> Result<Self, ModelError> {
        check_match(table, platform)?;
        Ok(Self::built(table, &platform.at(bound), bound))
    }

    /// The model of a GPU that differs by `scaling` from the one that the platform was made for.
    ///
    /// # Errors
    /// As for [`Self::new`].
    pub fn on(
        table: &EnergyTable,
        platform: &Platform,
        bound: Bound,
        scaling: &Scaling,
    ) -> Result<Self, ModelError> {
        check_match(table, platform)?;
        Ok(Self::built(&table.on(scaling), &platform.on(scaling, bound), bound))
    }

    /// The model of a table and a platform that match, with the platform's watts at `bound`.
    fn built(table: &EnergyTable, platform: &Platform, bound: Bound) -> Self {
        let squared = platform.voltage_ratio() * platform.voltage_ratio();
        let unit_w = |watts: fn(&crate::UnitPower) -> f64| {
            let mut by_unit = [0.0; Unit::COUNT];
            for row in platform.units() {
                by_unit[row.unit as usize] = watts(row) * squared;
            }
            by_unit
        };
        Self {
            event_j: event_energies(table, platform, bound),
            clock_tree_w: unit_w(|row| row.clock_tree_w.value()),
            idle_unit_w: unit_w(|row| row.idle_unit_w.value()),
            constant_w: platform.constant_w.value(),
            leakage_w: platform.leakage_w(),
        }
    }

    /// Leakage at the platform's voltage and temperature, in watts.
    pub const fn leakage_w(&self) -> f64 {
        self.leakage_w
    }

    /// Power of `unit` at the platform's voltage while it is busy and while it is idle, without its events, in watts.
    pub const fn unit_w(&self, unit: Unit) -> [f64; 2] {
        [self.clock_tree_w[unit as usize], self.idle_unit_w[unit as usize]]
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

    /// Energy of a frame of this length from the sums over its timeline, as [`Self::frame`] has it.
    pub fn energy_of(&self, sums: &Bin, duration_ps: u64) -> Energy {
        let used = Unit::ALL.map(|unit| sums.counts.uses(unit) || sums.busy_ps[unit as usize] > 0);
        self.bin_energy(sums, duration_ps, used)
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

/// Power of one frame over time, by part, and its energy.
#[derive(Clone, Debug, PartialEq)]
pub struct FramePower {
    /// Length of a bin in picoseconds.
    bin_ps: u64,
    /// Length of the frame in picoseconds.
    duration_ps: u64,
    /// Power by part and bin in watts; the last bin ends with the frame.
    watts: Vec<[f64; PARTS]>,
    /// Energy of the frame by part, in joules.
    energy: Energy,
}

impl FramePower {
    /// Length of a bin in seconds; the last bin may be shorter.
    pub fn bin_s(&self) -> f64 {
        self.bin_ps as f64 * S_PER_PS
    }

    /// Length of the frame in seconds.
    pub fn duration_s(&self) -> f64 {
        self.duration_ps as f64 * S_PER_PS
    }

    /// Length of the frame in picoseconds.
    pub const fn duration_ps(&self) -> u64 {
        self.duration_ps
    }

    /// Mean power of each bin in watts, by part in the order of [`crate::Part::ALL`].
    pub fn watts(&self) -> &[[f64; PARTS]] {
        &self.watts
    }

    /// Energy of the frame by part, in joules. Its total is the frame's energy, without idle time after the
    /// frame.
    pub const fn energy(&self) -> &Energy {
        &self.energy
    }

    /// True length in seconds and power by part of each bin; the last bin ends with the frame.
    pub fn bins(&self) -> impl Iterator<Item = (f64, &[f64; PARTS])> {
        self.bins_ps().map(|(length_ps, watts)| (length_ps as f64 * S_PER_PS, watts))
    }

    /// The bins as [`Self::bins`], with lengths in picoseconds.
    pub(crate) fn bins_ps(&self) -> impl Iterator<Item = (u64, &[f64; PARTS])> {
        bin_lengths_ps(self.bin_ps, self.duration_ps).zip(&self.watts)
    }

    /// Mean power over the frame by part, in watts; zero for a frame of length 0.
    pub fn mean_w(&self) -> [f64; PARTS] {
        let duration_s = self.duration_s();
        self.energy.by_part_j.map(|joules| if duration_s > 0.0 { joules / duration_s } else { 0.0 })
    }

    /// The frame with another length and energy but the same shape: each part keeps its share of every bin.
    /// The number of bins is the same. The last bin may gain or lose a little by rounding to whole
    /// picoseconds.
    #[must_use]
    pub fn reshaped(&self, duration_ps: u64, energy_j: f64) -> Self {
        let length_ratio = duration_ps as f64 / self.duration_ps.max(1) as f64;
        let bin_ps = ((self.bin_ps as f64 * length_ratio).ceil() as u64).max(1);
        let lengths: Vec<f64> =
            bin_lengths_ps(bin_ps, duration_ps).map(|length_ps| length_ps as f64 * S_PER_PS).collect();
        let joules = |watts: &[f64; PARTS], length_s: f64| watts.iter().sum::<f64>() * length_s;
        let before_j: f64 =
            self.watts.iter().zip(&lengths).map(|(watts, &length_s)| joules(watts, length_s)).sum();
        let scale = if before_j > 0.0 { energy_j / before_j } else { 0.0 };
        let watts: Vec<[f64; PARTS]> = self.watts.iter().map(|bin| bin.map(|watts| watts * scale)).collect();
        let mut energy = Energy::ZERO;
        for (watts, length_s) in watts.iter().zip(lengths) {
            energy += &Energy { by_part_j: watts.map(|watts| watts * length_s) };
        }
        Self { bin_ps, duration_ps, watts, energy }
    }

    /// Highest power of any bin, all parts together, in watts; zero for a frame of length 0.
    pub fn peak_w(&self) -> f64 {
        self.watts.iter().map(|watts| watts.iter().sum()).fold(0.0, f64::max)
    }
}

/// True lengths in picoseconds of the bins that begin before the end of the frame.
fn bin_lengths_ps(bin_ps: u64, duration_ps: u64) -> impl Iterator<Item = u64> {
    let mut left_ps = duration_ps;
    std::iter::from_fn(move || {
        let length_ps = left_ps.min(bin_ps);
        left_ps -= length_ps;
        (length_ps > 0).then_some(length_ps)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_index_matches_the_position() {
        for (at, part) in Part::ALL.into_iter().enumerate() {
            assert_eq!(part.index(), at, "{part:?}");
        }
    }

    #[test]
    fn names_are_unique() {
        for (at, part) in Part::ALL.into_iter().enumerate() {
            assert!(Part::ALL[..at].iter().all(|other| other.name() != part.name()), "{part:?}");
        }
    }

    #[test]
    fn optional_units_that_use_no_energy_are_not_reported() {
        let mut energy = Energy::ZERO;
        assert_eq!(energy.reported().count(), PARTS - 3);
        energy[Part::Unit(Unit::Edram)] = 1.0;
        assert_eq!(energy.reported().count(), PARTS - 2);
    }

    #[test]
    fn energies_add_part_by_part() {
        let mut energy = Energy::ZERO;
        energy[Part::Leakage] = 1.5;
        let other = energy;
        energy += &other;
        assert_eq!(energy[Part::Leakage], 3.0);
        assert_eq!(energy.total_j(), 3.0);
    }

    #[test]
    fn another_length_and_energy_are_met_and_shares_kept() {
        let mut watts = vec![[0.0; PARTS]; 3];
        for (bin, level) in watts.iter_mut().zip([1.0, 3.0, 2.0]) {
            bin[0] = level;
            bin[1] = 2.0 * level;
        }
        let energy = Energy {
            by_part_j: std::array::from_fn(|part| [55e-12, 110e-12].get(part).copied().unwrap_or(0.0)),
        };
        let frame = FramePower { bin_ps: 10, duration_ps: 25, watts, energy };
        for (duration_ps, energy_j) in [(25, 165e-12), (50, 1e-9), (7, 2e-12), (1_000_001, 3e-6)] {
            let other = frame.reshaped(duration_ps, energy_j);
            assert_eq!((other.duration_ps, other.watts.len()), (duration_ps, 3));
            assert!((other.energy.total_j() / energy_j - 1.0).abs() < 1e-12);
            let spent: f64 = other.bins().map(|(length_s, watts)| length_s * watts.iter().sum::<f64>()).sum();
            assert!((spent / energy_j - 1.0).abs() < 1e-12);
            let parts = other.energy.by_part_j;
            assert!((parts[1] / parts[0] - 2.0).abs() < 1e-12 && parts[2] == 0.0);
        }
        assert_eq!(frame.reshaped(0, 1.0).energy.total_j(), 0.0);
    }

    #[test]
    fn only_the_last_bin_is_partial() {
        let lengths = |bin_ps, duration_ps| bin_lengths_ps(bin_ps, duration_ps).collect::<Vec<_>>();
        assert_eq!(lengths(10, 25), [10, 10, 5]);
        assert_eq!(lengths(10, 20), [10, 10]);
        assert_eq!(lengths(10, 3), [3]);
        assert!(lengths(10, 0).is_empty());
    }
}
