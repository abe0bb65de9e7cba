//! One analysis, and several joined.

use std::time::Instant;

use serde::Serialize;
use traces::Trace;
use traces::energy::{FrameEnergy, PowerIntegral};
use traces::frames::{Marks, Method, Options, default_window, find_with};
use traces::score::{TOLERANCE_S, score, true_beside_found};
use traces::synth::{Recording, Scenario, Scene};

use super::{FramesEffort, Way};
use crate::study::StudyError;

/// Places of the marks, as shares of the frames; where one is requested, it is the first.
const MARKED: [f64; 5] = [0.4, 0.1, 0.25, 0.6, 0.85];
/// How far off the marks are, s.
const HAND_S: [f64; 5] = [0.05e-3, -0.1e-3, 0.1e-3, 0.0, -0.05e-3];

/// Quality of the starts found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Outcome {
    /// Harmonic mean of precision and recall of starts; of several analyses the mean.
    pub f1: f64,
    /// Median energy error of frames whose two ends were found, as a share; `None` where there is none.
    pub energy_error: Option<f64>,
    /// Frames with an end that is not a true one, or a start missed within.
    pub wrong: usize,
    /// How many of them carry a flag.
    pub wrong_flagged: usize,
    /// The other frames.
    pub right: usize,
    /// How many of them carry a flag all the same.
    pub right_flagged: usize,
    /// Host time, s for a million samples.
    pub host_s_per_1e6: f64,
}

/// A scenario with every seed.
pub(super) struct Subject {
    pub name: &'static str,
    scenes: Vec<(u64, Scene)>,
}

impl Subject {
    pub fn new(scenario: &Scenario, effort: &FramesEffort) -> Result<Self, StudyError> {
        let scene = |&seed: &u64| Ok((seed, scenario.scene(effort.frames, seed)?));
        let scenes = effort.seeds.iter().map(scene).collect::<Result<_, StudyError>>()?;
        Ok(Self { name: scenario.name, scenes })
    }

    /// By each method, the outcome with each seed.
    pub fn analyse(&self, recording: &Recording) -> Result<Vec<(Way, Vec<Outcome>)>, StudyError> {
        let mut of = Way::ALL.map(|way| (way, Vec::new()));
        for (seed, scene) in &self.scenes {
            let trace = scene.record(&Recording { seed: *seed, ..*recording })?;
            for (way, outcomes) in &mut of {
                outcomes.push(analyse(&trace, scene, *way)?);
            }
        }
        Ok(of.into())
    }
}

/// Marks some frames, finds the others and holds them against the truth.
fn analyse(trace: &Trace, scene: &Scene, way: Way) -> Result<Outcome, StudyError> {
    let (count, method) = match way {
        Way::Squares => (1, Method::SumOfSquares),
        Way::Normalized => (1, Method::Normalized),
        Way::Templates => (MARKED.len(), Method::SumOfSquares),
        Way::Tracking => (1, Method::Tracking),
        Way::Auto => (1, Method::Auto),
    };
    let frame = |share: f64| &scene.truth[(share * scene.truth.len() as f64) as usize];
    let marks_s = MARKED.iter().zip(HAND_S).map(|(&share, hand_s)| frame(share).start_s + hand_s);
    let marks = Marks {
        starts_s: marks_s.take(count).collect(),
        window: default_window(0.0, trace.rate_hz()),
        end_s: trace.end_s(),
    };
    let clock = Instant::now();
    let found = find_with(trace, &marks, &Options { method })?;
    let host_s = clock.elapsed().as_secs_f64();
    let frames = PowerIntegral::new(trace).frames(&found);
    let score = score(&frames, &scene.truth, TOLERANCE_S);
    Ok(Outcome {
        f1: score.f1(),
        energy_error: score.median_energy_error(),
        host_s_per_1e6: host_s * 1e6 / trace.samples() as f64,
        ..flagged(&frames, scene)
    })
}

/// How many frames are wrong and right, and how many of each carry a flag. The last one ends at the end mark and is left out.
fn flagged(frames: &[FrameEnergy], scene: &Scene) -> Outcome {
    let found_s: Vec<f64> = frames.iter().map(|frame| frame.start_s).collect();
    let truth_s: Vec<f64> = scene.truth.iter().map(|frame| frame.start_s).collect();
    let partner = true_beside_found(&found_s, &truth_s, TOLERANCE_S);
    let mut outcome = Outcome::default();
    for (two, frame) in partner.windows(2).zip(frames) {
        let right = matches!(two, [Some(a), Some(b)] if *b == a + 1);
        let flagged = usize::from(frame.flags.has_low_confidence());
        if right {
            (outcome.right, outcome.right_flagged) = (outcome.right + 1, outcome.right_flagged + flagged);
        } else {
            (outcome.wrong, outcome.wrong_flagged) = (outcome.wrong + 1, outcome.wrong_flagged + flagged);
        }
    }
    outcome
}

/// Several as one: means of rates and errors, sums of counts.
pub(super) fn joined(outcomes: &[Outcome]) -> Outcome {
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
    let all = |of: fn(&Outcome) -> f64| mean(&outcomes.iter().map(of).collect::<Vec<_>>());
    let sum = |of: fn(&Outcome) -> usize| outcomes.iter().map(of).sum();
    let errors: Vec<f64> = outcomes.iter().filter_map(|outcome| outcome.energy_error).collect();
    Outcome {
        f1: all(|o| o.f1),
        energy_error: (!errors.is_empty()).then(|| mean(&errors)),
        wrong: sum(|o| o.wrong),
        wrong_flagged: sum(|o| o.wrong_flagged),
        right: sum(|o| o.right),
        right_flagged: sum(|o| o.right_flagged),
        host_s_per_1e6: all(|o| o.host_s_per_1e6),
    }
}
