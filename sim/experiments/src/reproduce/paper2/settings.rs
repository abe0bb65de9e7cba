//! Settings of Paper II's rows.

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
    pub ii_1: Passes,
    pub ii_2: Inverses,
}

/// What is recorded for both rows.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Work {
    pub pc_frames: Setting<u32>,
    pub recorded_frames: Setting<usize>,
    pub seed: Setting<u64>,
}

row_settings! {
    Passes {
        frame_nj: f64, within(0.0..=1e9);
        g_buffer_nj: f64, within(0.0..=1e9);
        lighting_nj: f64, within(0.0..=1e9);
        same: f64, within(0.0..=1.0);
    }

    Inverses {
        same: f64, within(0.0..=1.0);
    }
}

impl PaperSettings for Settings {
    const PAPER: Paper = Paper::Two;
    const FILE: &str = "sim/experiments/papers/paper2.ron";
    const TEXT: &str = include_str!("../../../papers/paper2.ron");

    fn paper(&self) -> &str {
        &self.paper
    }

    fn check(&self) -> Result<(), String> {
        self.work.pc_frames.within("work.pc_frames", 1..=36)?;
        self.work.recorded_frames.within("work.recorded_frames", 8..=10_000)?;
        self.work.seed.within("work.seed", 0..=u64::MAX)?;
        self.ii_1.check("ii_1")?;
        self.ii_2.check("ii_2")
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
