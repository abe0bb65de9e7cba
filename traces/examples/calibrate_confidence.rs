//! Whether the chance that a frame is right can be estimated from the trace: fits a logistic map (Platt 1999) of the finder's
//! confidence, of how far methods agree and of how even gaps are, on all kinds of devices but one, and judges it on that one.
//!
//! `calibrate_confidence FIRST_SEED LAST_SEED`

use std::error::Error;
use std::process::ExitCode;
use traces::Trace;
use traces::frames::{FinderMethod, Found, MarkError, Marks, Options, default_window, find_with};
use traces::score::{TOLERANCE_S, true_frames};
use traces::synth::{Recording, SCENARIOS, Scene, WITNESSES};

/// Frames of each device.
const FRAMES: usize = 200;
/// Places of the marks, as shares of the frames.
const MARKED: [f64; 5] = [0.4, 0.1, 0.25, 0.6, 0.85];
/// A constant, the logit of the confidence, the share of frames that squares, normalized and squares with five of the found
/// starts as marks find as well, and the share of even gaps.
const FEATURES: usize = 6;
/// Bins of confidence.
const BINS: usize = 10;

/// A found frame.
struct Case {
    kind: &'static str,
    features: [f64; FEATURES],
    confidence: f64,
    right: bool,
}

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
    let mut cases = Vec::new();
    for seed in first..=last {
        for scenario in &SCENARIOS {
            let scene = scenario.scene(FRAMES, seed)?;
            let trace = scene.record(&Recording { seed, ..Recording::default() })?;
            cases.extend(cases_of("shared", &scene, &trace)?);
        }
        for witness in &WITNESSES {
            let scene = witness.scene(FRAMES, seed)?;
            cases.extend(cases_of(witness.name, &scene, &scene.record(&witness.recording(seed))?)?);
        }
    }
    println!(
        "kind left out: frames, share that is right; calibration error as stated, fitted on the others, fitted on all"
    );
    let everywhere = fitted(&cases, |_| true);
    for kind in WITNESSES.iter().map(|witness| witness.name).chain(["shared"]) {
        let of: Vec<&Case> = cases.iter().filter(|case| case.kind == kind).collect();
        let others = fitted(&cases, |case| case.kind != kind);
        let right = of.iter().filter(|case| case.right).count() as f64 / of.len() as f64;
        let stated = error_of(&of, |case| case.confidence);
        let [others, all] =
            [others, everywhere].map(|weights| error_of(&of, |case| chance(&weights, &case.features)));
        println!("{kind}: {}, {right:.3}; {stated:.3}, {others:.3}, {all:.3}", of.len());
    }
    Ok(())
}

fn cases_of(kind: &'static str, scene: &Scene, trace: &Trace) -> Result<Vec<Case>, MarkError> {
    let truth_s: Vec<f64> = scene.truth.iter().map(|frame| frame.start_s).collect();
    let mut lengths_s: Vec<f64> = truth_s.windows(2).map(|two| two[1] - two[0]).collect();
    lengths_s.sort_by(f64::total_cmp);
    let tolerance_s = TOLERANCE_S.min(0.15 * lengths_s[lengths_s.len() / 20]);
    let window = default_window(0.0, trace.rate_hz());
    let search = |starts_s: Vec<f64>, method| {
        find_with(trace, &Marks { starts_s, window, end_s: trace.end_s() }, &Options { method })
    };
    let mut cases = Vec::new();
    for share in MARKED {
        let mark_s = truth_s[(share * truth_s.len() as f64) as usize];
        let found = search(vec![mark_s], FinderMethod::Auto)?;
        let others = [
            search(vec![mark_s], FinderMethod::SumOfSquares)?,
            search(vec![mark_s], FinderMethod::Normalized)?,
            search(five_of(&found, mark_s), FinderMethod::SumOfSquares)?,
        ];
        let [squares, normalized, several] = others.map(|other| agreement(&found, &other));
        let even = even_share(&times_s(&found));
        let right = true_frames(&times_s(&found), &truth_s, tolerance_s);
        cases.extend(right.into_iter().zip(&found.frames).map(|(right, frame)| {
            let stated = frame.confidence.clamp(0.01, 0.99);
            let logit = (stated / (1.0 - stated)).ln();
            Case {
                kind,
                features: [1.0, logit, squares, normalized, several, even],
                confidence: frame.confidence,
                right,
            }
        }));
    }
    Ok(cases)
}

fn times_s(found: &Found) -> Vec<f64> {
    found.starts.iter().map(|start| start.time_s).collect()
}

/// Five of the found starts, evenly chosen; the mark where there are fewer.
fn five_of(found: &Found, mark_s: f64) -> Vec<f64> {
    let all = times_s(found);
    if all.len() < 12 { vec![mark_s] } else { (0..5).map(|i| all[(2 * i + 1) * all.len() / 10]).collect() }
}

/// Share of frames that another search found as well: both ends, and no start between.
fn agreement(found: &Found, other: &Found) -> f64 {
    let same = true_frames(&times_s(found), &times_s(other), TOLERANCE_S);
    same.iter().filter(|same| **same).count() as f64 / same.len().max(1) as f64
}

/// Share of gaps within a tenth of the one before.
fn even_share(starts_s: &[f64]) -> f64 {
    let gaps: Vec<f64> = starts_s.windows(2).map(|two| two[1] - two[0]).collect();
    let even = gaps.windows(2).filter(|two| (two[1] / two[0] - 1.0).abs() < 0.1).count();
    even as f64 / gaps.len().saturating_sub(1).max(1) as f64
}

fn chance(weights: &[f64; FEATURES], features: &[f64; FEATURES]) -> f64 {
    let sum: f64 = weights.iter().zip(features).map(|(weight, feature)| weight * feature).sum();
    1.0 / (1.0 + (-sum).exp())
}

/// Newton's method for the likelihood, each kind with the same weight, with a slight pull to zero.
fn fitted(cases: &[Case], used: impl Fn(&Case) -> bool) -> [f64; FEATURES] {
    let of: Vec<&Case> = cases.iter().filter(|case| used(case)).collect();
    let share = |case: &Case| 1e3 / of.iter().filter(|other| other.kind == case.kind).count() as f64;
    let shares: Vec<(&'static str, f64)> = WITNESSES
        .iter()
        .map(|witness| witness.name)
        .chain(["shared"])
        .filter_map(|kind| of.iter().find(|case| case.kind == kind).map(|case| (kind, share(case))))
        .collect();
    let mut weights = [0.0; FEATURES];
    for _ in 0..40 {
        let mut equations = [[0.0; FEATURES + 1]; FEATURES];
        for case in &of {
            let share = shares.iter().find(|(kind, _)| *kind == case.kind).map_or(0.0, |(_, share)| *share);
            let p = chance(&weights, &case.features);
            let off = f64::from(u8::from(case.right)) - p;
            for (row, x) in equations.iter_mut().zip(case.features) {
                for (value, y) in row.iter_mut().zip(case.features) {
                    *value += share * p * (1.0 - p) * x * y;
                }
                row[FEATURES] += share * off * x;
            }
        }
        for (index, row) in equations.iter_mut().enumerate() {
            row[index] += 1e-2;
            row[FEATURES] -= 1e-2 * weights[index];
        }
        let step = solved(equations);
        weights.iter_mut().zip(step).for_each(|(weight, step)| *weight += step);
    }
    weights
}

/// Gaussian elimination of symmetric positive definite equations.
fn solved(mut equations: [[f64; FEATURES + 1]; FEATURES]) -> [f64; FEATURES] {
    for pivot in 0..FEATURES {
        let row = equations[pivot].map(|value| value / equations[pivot][pivot]);
        equations[pivot] = row;
        for (_, other) in equations.iter_mut().enumerate().filter(|(index, _)| *index != pivot) {
            let factor = other[pivot];
            other.iter_mut().zip(row).for_each(|(value, mine)| *value -= factor * mine);
        }
    }
    equations.map(|row| row[FEATURES])
}

/// Expected calibration error (Naeini, Cooper and Hauskrecht 2015).
fn error_of(cases: &[&Case], chance: impl Fn(&Case) -> f64) -> f64 {
    let mut bins = [0.0; BINS];
    for case in cases {
        let chance = chance(case);
        bins[((chance * BINS as f64) as usize).min(BINS - 1)] += chance - f64::from(u8::from(case.right));
    }
    bins.iter().map(|off: &f64| off.abs()).sum::<f64>() / cases.len() as f64
}
