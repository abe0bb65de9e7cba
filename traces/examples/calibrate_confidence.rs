//! How often frames are right, by what the trace shows of them: fits a logistic map (Platt 1999) of the finder's confidence
//! and of how far methods agree, on some kinds of devices, and judges it on another kind that it has not seen.
//!
//! `calibrate_confidence FIRST_SEED LAST_SEED`

use std::error::Error;
use std::process::ExitCode;
use traces::Trace;
use traces::frames::{FinderMethod, Found, Marks, Options, default_window, find_with};
use traces::score::{TOLERANCE_S, true_beside_found};
use traces::synth::{Recording, SCENARIOS, Scene, WITNESSES};

/// Frames of each device.
const FRAMES: usize = 200;
/// Places of the marks, as shares of the frames.
const MARKED: [f64; 5] = [0.4, 0.1, 0.25, 0.6, 0.85];

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run() -> Result<(), Box<dyn Error>> {
    let seeds: Vec<u64> = std::env::args().skip(1).map(|seed| seed.parse()).collect::<Result<_, _>>()?;
    let [first, last] = seeds[..] else {
        return Err("usage: calibrate_confidence FIRST_SEED LAST_SEED".into());
    };
    println!(
        "kind,seed,mark,method,right,confidence,near_squares,near_normalized,near_several,all_squares,all_normalized,all_several,even"
    );
    for seed in first..=last {
        for scenario in &SCENARIOS {
            let scene = scenario.scene(FRAMES, seed)?;
            print_device(
                "shared",
                seed,
                &scene,
                &scene.record(&Recording { seed, ..Recording::default() })?,
            )?;
        }
        for witness in &WITNESSES {
            let scene = witness.scene(FRAMES, seed)?;
            print_device(witness.name, seed, &scene, &scene.record(&witness.recording(seed))?)?;
        }
    }
    Ok(())
}

fn print_device(kind: &str, seed: u64, scene: &Scene, trace: &Trace) -> Result<(), Box<dyn Error>> {
    let truth_s: Vec<f64> = scene.truth.iter().map(|frame| frame.start_s).collect();
    let mut lengths_s: Vec<f64> = truth_s.windows(2).map(|two| two[1] - two[0]).collect();
    lengths_s.sort_by(f64::total_cmp);
    let tolerance_s = TOLERANCE_S.min(0.15 * lengths_s[lengths_s.len() / 20]);
    for share in MARKED {
        let mark_s = truth_s[(share * truth_s.len() as f64) as usize];
        let window = default_window(0.0, trace.rate_hz());
        let search = |starts_s: Vec<f64>, method| {
            find_with(trace, &Marks { starts_s, window, end_s: trace.end_s() }, &Options { method })
        };
        let found = search(vec![mark_s], FinderMethod::Auto)?;
        let starts_s: Vec<f64> = found.starts.iter().map(|start| start.time_s).collect();
        let inner: Vec<f64> = starts_s
            .iter()
            .copied()
            .filter(|s| *s > trace.start_s() + 2e-3 && *s < trace.end_s() - 6e-3)
            .collect();
        let several = if inner.len() < 5 {
            vec![mark_s]
        } else {
            (0..5).map(|i| inner[(2 * i + 1) * inner.len() / 10]).collect()
        };
        let others = [
            search(vec![mark_s], FinderMethod::SumOfSquares)?,
            search(vec![mark_s], FinderMethod::Normalized)?,
            search(several, FinderMethod::SumOfSquares)?,
        ];
        let agree: Vec<Vec<bool>> = others.iter().map(|other| agreeing(&found, other)).collect();
        let partner = true_beside_found(&starts_s, &truth_s, tolerance_s);
        let even = even(&starts_s);
        for (index, two) in partner.windows(2).enumerate() {
            let right = matches!(two, [Some(a), Some(b)] if *b == a + 1);
            print!(
                "{kind},{seed},{share},{},{},{:.5}",
                found.method,
                u8::from(right),
                found.frames[index].confidence
            );
            for agree in &agree {
                let near = &agree[index.saturating_sub(4)..(index + 5).min(agree.len())];
                print!(",{:.4}", near.iter().filter(|agree| **agree).count() as f64 / near.len() as f64);
            }
            for agree in &agree {
                print!(",{:.4}", agree.iter().filter(|agree| **agree).count() as f64 / agree.len() as f64);
            }
            println!(",{even:.4}");
        }
    }
    Ok(())
}

/// Whether another search found the same frame: its two ends and none between.
fn agreeing(found: &Found, other: &Found) -> Vec<bool> {
    let times = |of: &Found| -> Vec<f64> { of.starts.iter().map(|start| start.time_s).collect() };
    let partner = true_beside_found(&times(found), &times(other), TOLERANCE_S);
    partner.windows(2).map(|two| matches!(two, [Some(a), Some(b)] if *b == a + 1)).collect()
}

/// Share of gaps within a tenth of the one before.
fn even(starts_s: &[f64]) -> f64 {
    let gaps: Vec<f64> = starts_s.windows(2).map(|two| two[1] - two[0]).collect();
    let even = gaps.windows(2).filter(|two| (two[1] / two[0] - 1.0).abs() < 0.1).count();
    even as f64 / gaps.len().saturating_sub(1).max(1) as f64
}
