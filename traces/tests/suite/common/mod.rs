//! Synthetic curves whose frames are known.

pub mod jls;
pub mod jls_traces;

use std::path::{Path, PathBuf};
use traces::energy::TrueFrame;
use traces::{Curve, CurveBuilder};

/// A file that another program made.
pub fn foreign(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/foreign").join(name)
}

/// A curve and its frames.
pub struct Case {
    pub curve: Curve,
    pub truth: Vec<TrueFrame>,
    /// End of the last frame, s.
    pub end_s: f64,
}

/// A small repeatable source of numbers in [0, 1) for making test cases (Park and Miller 1988).
pub struct Rng(pub u64);

impl Rng {
    pub fn next(&mut self) -> f64 {
        self.0 = self.0 * 48_271 % 2_147_483_647;
        self.0 as f64 / 2_147_483_647.0
    }
}

/// The work of one frame: front end, clear, then draws whose length and power differ; `progress` changes the content
/// slowly, `rng` a little from frame to frame.
fn draws(progress: f64, rng: &mut Rng) -> Vec<(f64, f64)> {
    let mut fixed = Rng(1234);
    let mut draws = vec![(0.14e-3, 1.0), (0.11e-3, 3.4)];
    for draw in 0..60 {
        let slow = 1.0 + 0.2 * (6.0 * progress + f64::from(draw)).sin();
        let length_s = 0.15e-3 * (0.2 + 2.0 * fixed.next()) * slow * (1.0 + 0.02 * (rng.next() - 0.5));
        draws.push((length_s, (1.0 + 2.0 * fixed.next()) * (1.0 + 0.02 * (rng.next() - 0.5))));
    }
    draws
}

/// Frames with `gap_s(work_s, rng)` seconds at `gap_w` after each one's work; idle before and after.
fn frames(count: u32, idle_w: f64, gap_w: f64, gap_s: impl Fn(f64, &mut Rng) -> f64) -> Case {
    let mut rng = Rng(99);
    let mut builder = CurveBuilder::new(0.0).unwrap();
    builder.push(0.0505, idle_w).unwrap();
    let mut starts_s = Vec::new();
    for frame in 0..count {
        starts_s.push(builder.now_s());
        for (length_s, watts) in draws(f64::from(frame) / f64::from(count), &mut rng) {
            builder.push(length_s, idle_w + watts).unwrap();
        }
        let work_s = builder.now_s() - starts_s[starts_s.len() - 1];
        builder.push(gap_s(work_s, &mut rng), gap_w).unwrap();
    }
    let end_s = builder.now_s();
    builder.push(0.05, idle_w).unwrap();
    let curve = builder.build().unwrap();
    let ends_s = starts_s.iter().skip(1).copied().chain([end_s]);
    let truth = starts_s
        .iter()
        .zip(ends_s)
        .map(|(&a_s, b_s)| TrueFrame { start_s: a_s, energy_j: curve.energy_j(a_s, b_s) });
    let truth = truth.collect();
    Case { curve, truth, end_s }
}

/// V-sync at 30 Hz: about 11 ms of work, then idle.
pub fn vsync(count: u32) -> Case {
    frames(count, 0.55, 0.55, |work_s, _| 1.0 / 30.0 - work_s)
}

/// Free-running: a dip of 0.12 to 0.25 ms at the end of each frame.
pub fn free_running(count: u32) -> Case {
    frames(count, 0.55, 0.8, |_, rng| 0.12e-3 + 0.13e-3 * rng.next())
}
