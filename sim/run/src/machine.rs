//! Area and power of the hardware of a run.

use std::collections::BTreeMap;

use activity::Unit;
use power_model::{Estimate, PowerModel};
use serde::Serialize;

use crate::{Plan, structure};

/// Area of the GPU of `plan` on the node of its platform, in square millimetres.
pub fn area_mm2(plan: &Plan) -> Estimate {
    structure(&plan.gpu).area_mm2(plan.platform.node_nm)
}

/// Hardware of a run, in `summary.json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct HardwareSummary {
    /// Process node in nanometres.
    pub node_nm: u32,
    /// GPU for which the numbers of the platform hold.
    pub made_for: String,
    /// Area in square millimetres.
    pub area_mm2: Estimate,
    /// Leakage in watts, of the core.
    pub leakage_w: f64,
    /// Leakage over that of the GPU of the platform.
    pub leakage_ratio: Estimate,
    /// Power between frames in watts.
    pub idle_w: f64,
    /// Power of each unit while it is busy in watts, without its events.
    pub clock_tree_w: BTreeMap<&'static str, f64>,
    /// Power of each unit while it is idle in watts.
    pub idle_unit_w: BTreeMap<&'static str, f64>,
}

impl HardwareSummary {
    /// Hardware of `plan`.
    pub(super) fn new(plan: &Plan) -> Self {
        let units = Unit::ALL.into_iter().filter(|&unit| plan.gpu.units.has(unit));
        let watts = |state: usize, model: &PowerModel| {
            units.clone().map(|unit| (unit.name(), model.unit_w(unit)[state])).collect()
        };
        Self {
            node_nm: plan.platform.node_nm,
            made_for: plan.platform.made_for.clone(),
            area_mm2: area_mm2(plan),
            leakage_w: plan.model.leakage_w(),
            leakage_ratio: plan.scaling.leakage,
            idle_w: plan.platform.idle_w.value(),
            clock_tree_w: watts(0, &plan.model),
            idle_unit_w: watts(1, &plan.model),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hardware::tests::{GROW, set};

    /// Energy of the first frame of `scene` in joules on the reference GPU with changes, until it ends.
    fn frame_j(scene: &str, size: (u32, u32), changes: &[(&str, f64)]) -> f64 {
        let options = crate::RunOptions {
            scene: scene.into(),
            overrides: workloads::Overrides {
                size: Some(size),
                samples: Some(4),
                ..workloads::Overrides::default()
            },
            changes: set(changes),
            ..crate::RunOptions::default()
        };
        let plan = Plan::resolve(options).unwrap();
        let frames = crate::frames_of(&plan, &[0], &output::progress::Progress::new(true)).unwrap();
        frames[0].cost().energy_j
    }

    /// Every rate, the cores and all caches, 64 times.
    fn sixty_fourfold() -> Vec<(&'static str, f64)> {
        let is_speed = |path: &&(&str, f64)| {
            path.0.contains("rates")
                || path.0.contains("entries")
                || path.0.ends_with("cores")
                || path.0.ends_with("lines_per_cycle")
        };
        GROW.iter().filter(is_speed).map(|&(path, start)| (path, 64.0 * start)).collect()
    }

    #[test]
    fn the_machine_of_64_times_the_hardware_loses_on_energy() {
        for (scene, size) in [("tiny", (64, 48)), ("default", (320, 180))] {
            let [own, large] =
                [&[("core_hz", 400e6)][..], &sixty_fourfold()].map(|set| frame_j(scene, size, set));
            println!("{scene}: {own} J, 64 times the hardware {large} J");
            assert!(large > 1.5 * own, "{scene}: {own} J, {large} J");
        }
    }
}
