//! Settings of Paper III's rows.

use serde::{Deserialize, Serialize};

use super::super::Paper;
use super::super::settings::{About, PaperSettings, Setting, row_settings};

/// The file.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Settings {
    paper: String,
    #[allow(dead_code, reason = "names what passages refer to, for readers of the file")]
    source: String,
    pub work: Work,
    pub iii_1: Finding,
    pub iii_2: Sums,
    pub iii_3: WarmUp,
    pub iii_4: BlockingPhone,
    pub iii_5: BlockingPc,
    pub iii_6: Disturbance,
}

/// How much is simulated and recorded for all rows.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Work {
    pub pc_frames: Setting<u32>,
    pub phone_step: Setting<u32>,
    pub recorded_frames: Setting<usize>,
    pub still_frames: Setting<usize>,
    pub repeats: Setting<u64>,
}

row_settings! {
    Finding {
        marked: usize, within(1..=8);
        found_vsync: f64, within(0.0..=1.0);
        found_free: f64, within(0.0..=1.0);
        within_ms: f64, within(0.001..=10.0);
    }

    Sums {
        same: f64, within(0.0..=1.0);
    }

    WarmUp {
        frames: u32, within(1..=1000);
        planted_s: f64, within(0.1..=4.0);
        near: f64, within(0.0..=100.0);
        recorded: usize, within(150..=10_000);
    }

    BlockingPhone {
        waiting_w: f64, within(0.0..=10.0);
        idle_w: f64, within(0.01..=10.0);
        edge: f64, within(0.01..=1.0);
    }

    BlockingPc {
        with_mj: (f64, f64), must(energy, ENERGY);
        without_mj: (f64, f64), must(energy, ENERGY);
        waiting_w: f64, within(0.0..=100.0);
        background_w: f64, within(0.0..=100.0);
    }

    Disturbance {
        extra_w: f64, within(0.0..=10.0);
        frames: (usize, usize), must(|(low, high)| low <= high, "fewest and most");
        shorts: u64, within(2..=1000);
    }
}

fn energy((mean, deviation): &(f64, f64)) -> bool {
    *mean > 0.0 && *deviation > 0.0
}

const ENERGY: &str = "a mean and a deviation above 0";

impl PaperSettings for Settings {
    const PAPER: Paper = Paper::Three;
    const FILE: &str = "sim/experiments/papers/paper3.ron";
    const TEXT: &str = include_str!("../../../papers/paper3.ron");

    fn paper(&self) -> &str {
        &self.paper
    }

    fn check(&self) -> Result<(), String> {
        self.work.check()?;
        self.iii_1.check("iii_1")?;
        self.iii_2.check("iii_2")?;
        self.iii_3.check("iii_3")?;
        self.iii_4.check("iii_4")?;
        self.iii_5.check("iii_5")?;
        self.iii_6.check("iii_6")
    }
}

impl Work {
    fn check(&self) -> Result<(), String> {
        self.pc_frames.within("work.pc_frames", 1..=36)?;
        self.phone_step.within("work.phone_step", 1..=8)?;
        self.recorded_frames.within("work.recorded_frames", 24..=10_000)?;
        self.still_frames.within("work.still_frames", 200..=10_000)?;
        self.repeats.within("work.repeats", 1..=1000)
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::settings::load;
    use super::*;

    #[test]
    fn the_committed_file_is_valid() {
        let (_, origin) = load::<Settings>(None).unwrap();
        assert!(origin.committed && origin.sha256.len() == 64);
    }
}
