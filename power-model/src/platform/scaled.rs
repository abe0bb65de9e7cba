//! A platform for another GPU than the one that it was made for.

use activity::Unit;

use super::{Platform, UnitPower};
use crate::bound::Bound;
use crate::structure::Scaling;

/// Share of the leakage that is left between frames, of a platform that does not say it: power gating leaves memories and what is
/// always on.
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

/// A unit's watts. In the levels below the L2 those of an idle unit are leakage and refresh, and only what is above them is the clock's.
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
