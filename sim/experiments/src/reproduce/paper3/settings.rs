//! Settings of Paper III's rows.

use serde::{Deserialize, Serialize};

use super::super::Paper;
use super::super::settings::{About, PaperSettings, Setting};

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

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Finding {
    pub about: About,
    pub marked: Setting<usize>,
    pub found_vsync: Setting<f64>,
    pub found_free: Setting<f64>,
    pub within_ms: Setting<f64>,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Sums {
    pub about: About,
    pub same: Setting<f64>,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct WarmUp {
    pub about: About,
    pub frames: Setting<u32>,
    pub planted_s: Setting<f64>,
    pub near: Setting<f64>,
    pub recorded: Setting<usize>,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct BlockingPhone {
    pub about: About,
    pub waiting_w: Setting<f64>,
    pub idle_w: Setting<f64>,
    pub edge: Setting<f64>,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct BlockingPc {
    pub about: About,
    pub with_mj: Setting<(f64, f64)>,
    pub without_mj: Setting<(f64, f64)>,
    pub waiting_w: Setting<f64>,
    pub background_w: Setting<f64>,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Disturbance {
    pub about: About,
    pub extra_w: Setting<f64>,
    pub frames: Setting<(usize, usize)>,
    pub shorts: Setting<u64>,
}

impl PaperSettings for Settings {
    const PAPER: Paper = Paper::Three;
    const FILE: &str = "sim/experiments/papers/paper3.ron";
    const TEXT: &str = include_str!("../../../papers/paper3.ron");

    fn paper(&self) -> &str {
        &self.paper
    }

    fn check(&self) -> Result<(), String> {
        self.work.check()?;
        self.iii_1.check()?;
        self.iii_2.same.within("iii_2.same", 0.0..=1.0)?;
        self.iii_3.check()?;
        self.iii_4.waiting_w.within("iii_4.waiting_w", 0.0..=10.0)?;
        self.iii_4.idle_w.within("iii_4.idle_w", 0.01..=10.0)?;
        self.iii_4.edge.within("iii_4.edge", 0.01..=1.0)?;
        self.iii_5.check()?;
        self.iii_6.extra_w.within("iii_6.extra_w", 0.0..=10.0)?;
        self.iii_6.frames.must("iii_6.frames", |(low, high)| low <= high, "fewest and most")?;
        self.iii_6.shorts.within("iii_6.shorts", 2..=1000)
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

impl Finding {
    fn check(&self) -> Result<(), String> {
        self.marked.within("iii_1.marked", 1..=8)?;
        self.found_vsync.within("iii_1.found_vsync", 0.0..=1.0)?;
        self.found_free.within("iii_1.found_free", 0.0..=1.0)?;
        self.within_ms.within("iii_1.within_ms", 0.001..=10.0)
    }
}

impl WarmUp {
    fn check(&self) -> Result<(), String> {
        self.frames.within("iii_3.frames", 1..=1000)?;
        self.planted_s.within("iii_3.planted_s", 0.1..=4.0)?;
        self.near.within("iii_3.near", 0.0..=100.0)?;
        self.recorded.within("iii_3.recorded", 150..=10_000)
    }
}

impl BlockingPc {
    fn check(&self) -> Result<(), String> {
        let energy = |(mean, deviation): &(f64, f64)| *mean > 0.0 && *deviation > 0.0;
        self.with_mj.must("iii_5.with_mj", energy, "a mean and a deviation above 0")?;
        self.without_mj.must("iii_5.without_mj", energy, "a mean and a deviation above 0")?;
        self.waiting_w.within("iii_5.waiting_w", 0.0..=100.0)?;
        self.background_w.within("iii_5.background_w", 0.0..=100.0)
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
