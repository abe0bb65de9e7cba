//! Score of one analysis of a case.

use crate::case::Case;
use std::error::Error;
use traces::energy::{FrameEnergy, PowerIntegral, TOLERANCE_S, score, true_frames};
use traces::frames::{FinderMethod, FinderOptions, Flags, Marks, find_with};

/// Relative errors of energy.
#[derive(Clone, Copy, Default)]
pub struct Errors {
    pub mean: f64,
    pub median: f64,
}

pub struct Outcome {
    pub f1: f64,
    pub confidence: f64,
    pub energy: Errors,
    /// Frames one of whose ends is not a true one's, and those of them with a flag that says so.
    pub wrong: usize,
    pub wrong_flagged: usize,
    /// Other frames with such a flag, and how many frames there are.
    pub right_flagged: usize,
    pub frames: usize,
    pub chosen: String,
}

impl Outcome {
    pub fn new(case: &Case, starts_s: Vec<f64>, method: FinderMethod) -> Result<Self, Box<dyn Error>> {
        let marks = Marks { starts_s, window: case.window, end_s: case.trace.end_s() };
        let found = find_with(&case.trace, &marks, &FinderOptions { method, without: None })?;
        let frames = PowerIntegral::new(&case.trace).frames(&found);
        let score = score(&frames, &case.truth, TOLERANCE_S);
        let (wrong, wrong_flagged, right_flagged) = wrong(case, &frames);
        let confidence = frames.iter().map(|frame| frame.confidence).sum::<f64>() / frames.len() as f64;
        let chosen = format!(
            "{:?} {}",
            found.method,
            found.warnings.iter().map(|w| w.code.name()).collect::<Vec<_>>().join(",")
        );
        Ok(Self {
            f1: score.f1(),
            confidence,
            energy: errors(&score.energy_errors),
            wrong,
            wrong_flagged,
            right_flagged,
            frames: frames.len(),
            chosen,
        })
    }
}

/// The errors that remain between the true starts, rounded to samples: those of the noise.
pub fn floor(case: &Case) -> Errors {
    let on_grid = |time_s: f64| case.trace.time_s(case.trace.position(time_s).round() as usize);
    let ends_s = case.truth.iter().skip(1).map(|frame| frame.start_s).chain([case.end_s]);
    let integral = PowerIntegral::new(&case.trace);
    let frames: Vec<FrameEnergy> = case
        .truth
        .iter()
        .zip(ends_s)
        .map(|(frame, end_s)| {
            let (start_s, end_s) = (on_grid(frame.start_s), on_grid(end_s));
            FrameEnergy {
                start_s,
                end_s,
                energy_j: integral.energy_j(start_s, end_s),
                confidence: 1.0,
                flags: Flags::default(),
            }
        })
        .collect();
    errors(&score(&frames, &case.truth, TOLERANCE_S).energy_errors)
}

fn errors(relative: &[f64]) -> Errors {
    let mut magnitudes: Vec<f64> = relative.iter().map(|error| error.abs()).collect();
    magnitudes.sort_by(f64::total_cmp);
    let mean = magnitudes.iter().sum::<f64>() / magnitudes.len() as f64;
    Errors { mean, median: magnitudes.get(magnitudes.len() / 2).copied().unwrap_or(f64::NAN) }
}

/// Frames one of whose ends is wrong, how many of them say so, and how many of the right ones say so. The
/// last one ends at the end mark, wherever that is.
fn wrong(case: &Case, frames: &[FrameEnergy]) -> (usize, usize, usize) {
    let found_s: Vec<f64> = frames.iter().map(|frame| frame.start_s).collect();
    let truth_s: Vec<f64> = case.truth.iter().map(|frame| frame.start_s).collect();
    let mut counts = (0, 0, 0);
    for (right, frame) in true_frames(&found_s, &truth_s, TOLERANCE_S).into_iter().zip(frames) {
        let reported = usize::from(frame.flags.has_low_confidence());
        if right {
            counts.2 += reported;
        } else {
            counts.0 += 1;
            counts.1 += reported;
        }
    }
    counts
}
