//! What each step of the finder is worth: all of it, and with one step left out, on the eight scenes and on
//! the devices of other structure.
//!
//! `cargo bench -p traces --bench ablation -- FIRST_SEED LAST_SEED`: mean F1 with the first mark, median energy
//! error, and how many wrong and right frames carry a flag.

use std::error::Error;
use traces::Trace;
use traces::energy::{PowerIntegral, TOLERANCE_S, score, true_frames};
use traces::frames::{FinderOptions, FinderStep, Marks, default_window, find_with};
use traces::synth::{HELD_OUT_DEVICES, RecorderSpec, SCENARIOS, SynthScene};

const FRAMES: usize = 200;
/// The marked frame, as a share of all, and the error of the mark, s.
const MARKED: f64 = 0.4;
const HAND_S: f64 = 0.05e-3;

/// Sums over traces.
#[derive(Default)]
struct Sum {
    traces: f64,
    f1: f64,
    energy: f64,
    /// Wrong and right frames, and those of each with a flag.
    frames: [usize; 2],
    flagged: [usize; 2],
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments = std::env::args().skip(1).filter(|arg| arg != "--bench");
    let arguments: Vec<u64> = arguments.map(|text| text.parse()).collect::<Result<_, _>>()?;
    let &[first, last] = arguments.as_slice() else {
        return Err("usage: ablation FIRST_SEED LAST_SEED".into());
    };
    let steps =
        core::iter::once(("nothing", None)).chain(FinderStep::ALL.map(|(name, step)| (name, Some(step))));
    let options: Vec<(&str, FinderOptions)> =
        steps.map(|(name, without)| (name, FinderOptions { without, ..FinderOptions::default() })).collect();
    println!("on: without: F1, energy error in percent, wrong frames with a flag, right frames with a flag");
    for name in
        SCENARIOS.map(|scenario| scenario.name).into_iter().chain(HELD_OUT_DEVICES.map(|kind| kind.name))
    {
        let mut sums: Vec<Sum> = options.iter().map(|_| Sum::default()).collect();
        for seed in first..=last {
            let (scene, trace) = recorded(name, seed)?;
            for (sum, (_, options)) in sums.iter_mut().zip(&options) {
                sum.add(&scene, &trace, options)?;
            }
        }
        for (sum, (without, _)) in sums.iter().zip(&options) {
            let [f1, energy] = [sum.f1, 100.0 * sum.energy].map(|x| x / sum.traces);
            let [wrong, right] = [0, 1].map(|of| format!("{} of {}", sum.flagged[of], sum.frames[of]));
            println!("{name}: {without}: {f1:.4}, {energy:.3}, {wrong}, {right}");
        }
    }
    Ok(())
}

fn recorded(name: &str, seed: u64) -> Result<(SynthScene, Trace), Box<dyn Error>> {
    let kind = HELD_OUT_DEVICES.iter().find(|kind| kind.name == name);
    let scenario = SCENARIOS.iter().find(|scenario| scenario.name == name);
    let (scene, recording) = match (kind, scenario) {
        (Some(kind), _) => (kind.scene(FRAMES, seed)?, kind.recorder(seed)),
        (None, Some(scenario)) => {
            (scenario.scene(FRAMES, seed)?, RecorderSpec { seed, ..RecorderSpec::default() })
        }
        (None, None) => return Err(format!("no scene {name}").into()),
    };
    let trace = scene.record(&recording)?;
    Ok((scene, trace))
}

impl Sum {
    fn add(
        &mut self,
        scene: &SynthScene,
        trace: &Trace,
        options: &FinderOptions,
    ) -> Result<(), Box<dyn Error>> {
        let truth_s: Vec<f64> = scene.truth.iter().map(|frame| frame.start_s).collect();
        let mark_s = truth_s[(MARKED * truth_s.len() as f64) as usize] + HAND_S;
        let marks = Marks::one(mark_s, default_window(0.0, trace.rate_hz()), trace.end_s());
        let found = find_with(trace, &marks, options)?;
        let frames = PowerIntegral::new(trace).frames(&found);
        let scored = score(&frames, &scene.truth, TOLERANCE_S);
        self.traces += 1.0;
        self.f1 += scored.f1();
        self.energy += scored.median_energy_error().unwrap_or(0.0);
        let found_s: Vec<f64> = found.starts.iter().map(|start| start.time_s).collect();
        for (right, frame) in true_frames(&found_s, &truth_s, TOLERANCE_S).into_iter().zip(&found.frames) {
            self.frames[usize::from(right)] += 1;
            self.flagged[usize::from(right)] += usize::from(frame.flags.has_low_confidence());
        }
        Ok(())
    }
}
