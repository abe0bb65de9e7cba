//! The finder on the [`HELD_OUT_DEVICES`]: how well it finds, and how far its confidence is a probability. Also
//! whether a map would make it one: fits a logistic map (Platt 1999) of confidence, of how far methods agree
//! and of how even gaps are, on all kinds of devices but one, and judges it on that one.
//!
//! `cargo bench -p traces --bench calibrate_confidence -- FIRST_SEED LAST_SEED [METHOD|STEP]`: METHOD in place
//! of `auto`, or `auto` without STEP, one of `traces::frames::FinderStep`.

use std::error::Error;
use traces::Trace;
use traces::energy::{TOLERANCE_S, pairs, true_frames};
use traces::frames::{
    FinderMethod, FinderOptions, FinderStep, Found, MarkError, Marks, default_window, find_with,
};
use traces::synth::{HELD_OUT_DEVICES, SynthScene};

/// Frames of each device.
const FRAMES: usize = 200;
/// Places of the marks, as shares of the frames, and their errors, s.
const MARKED: [f64; 5] = [0.4, 0.1, 0.25, 0.6, 0.85];
const HAND_S: [f64; 5] = [0.05e-3, -0.1e-3, 0.1e-3, 0.0, -0.05e-3];
/// A constant, the confidence and its logit, the share of frames that squares and normalized find as well,
/// and the share of even gaps.
const FEATURES: usize = 6;
/// Bins of confidence.
const BINS: usize = 10;

/// A found frame.
struct Case {
    kind: &'static str,
    features: [f64; FEATURES],
    confidence: f64,
    flagged: bool,
    right: bool,
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|arg| arg != "--bench").collect();
    let [first, last, which @ ..] = arguments.as_slice() else {
        return Err("usage: calibrate_confidence FIRST_SEED LAST_SEED [METHOD|STEP]".into());
    };
    let step = |name: &str| FinderStep::ALL.into_iter().find(|step| step.0 == name).map(|step| step.1);
    let mut options = FinderOptions::default();
    if let Some(name) = which.first() {
        options.without = step(name);
        if options.without.is_none() {
            options.method = name.parse()?;
        }
    }
    let (first, last): (u64, u64) = (first.parse()?, last.parse()?);
    let mut cases = Vec::new();
    for device in &HELD_OUT_DEVICES {
        let (mut first_mark, mut worst) = (Vec::new(), Vec::new());
        for seed in first..=last {
            let scene = device.scene(FRAMES, seed)?;
            let trace = scene.record(&device.recorder(seed))?;
            let f1 = cases_of(device.name, &scene, &trace, &options, &mut cases)?;
            println!("{} {seed}: F1 by mark {f1:.3?}", device.name);
            first_mark.push(f1[0]);
            worst.push(f1.into_iter().fold(1.0, f64::min));
        }
        let mean = |of: &[f64]| of.iter().sum::<f64>() / of.len() as f64;
        println!(
            "{}: F1 first mark {:.3}, worst of five {:.3}",
            device.name,
            mean(&first_mark),
            mean(&worst)
        );
    }
    report(&cases);
    Ok(())
}

fn report(cases: &[Case]) {
    println!(
        "kind left out: frames, right; AUC; calibration error as stated, fitted on the others, fitted on all; wrong frames flagged, \
         right frames flagged; by the map of the others"
    );
    let everywhere = fitted(cases, |_| true);
    for kind in HELD_OUT_DEVICES.iter().map(|device| device.name).chain(["all"]) {
        let of: Vec<&Case> = cases.iter().filter(|case| case.kind == kind || kind == "all").collect();
        let others = fitted(cases, |case| case.kind != kind);
        let right = of.iter().filter(|case| case.right).count();
        let stated = error_of(&of, |case| case.confidence);
        let [mapped, all] =
            [others, everywhere].map(|weights| error_of(&of, |case| chance(&weights, &case.features)));
        let flagged = |right: bool, flag: &dyn Fn(&Case) -> bool| {
            let count = of.iter().filter(|case| case.right == right && flag(case)).count();
            format!("{count} of {}", of.iter().filter(|case| case.right == right).count())
        };
        let low = |case: &Case| chance(&others, &case.features) < 0.5;
        println!(
            "{kind}: {}, {right}; {:.3}; {stated:.3}, {mapped:.3}, {all:.3}; {}, {}; {}, {}",
            of.len(),
            ranked(&of),
            flagged(false, &|case| case.flagged),
            flagged(true, &|case| case.flagged),
            flagged(false, &low),
            flagged(true, &low),
        );
    }
}

/// F1 with each mark; adds the frames found.
fn cases_of(
    kind: &'static str,
    scene: &SynthScene,
    trace: &Trace,
    options: &FinderOptions,
    cases: &mut Vec<Case>,
) -> Result<Vec<f64>, MarkError> {
    let truth_s: Vec<f64> = scene.truth.iter().map(|frame| frame.start_s).collect();
    let mut lengths_s: Vec<f64> = truth_s.windows(2).map(|two| two[1] - two[0]).collect();
    lengths_s.sort_by(f64::total_cmp);
    let tolerance_s = TOLERANCE_S.min(0.15 * lengths_s[lengths_s.len() / 20]);
    let mut f1 = Vec::new();
    for (share, hand_s) in MARKED.into_iter().zip(HAND_S) {
        let mark_s = truth_s[(share * truth_s.len() as f64) as usize] + hand_s;
        let marks = Marks::one(mark_s, default_window(0.0, trace.rate_hz()), trace.end_s());
        let found = find_with(trace, &marks, options)?;
        let by = |method| find_with(trace, &marks, &FinderOptions { method, ..*options });
        let [squares, normalized] = [by(FinderMethod::SumOfSquares)?, by(FinderMethod::Normalized)?]
            .map(|other| agreement(&found, &other));
        let found_s = times_s(&found);
        let paired = pairs(&found_s, &truth_s, tolerance_s).len();
        f1.push(2.0 * paired as f64 / (found_s.len() + truth_s.len()) as f64);
        let even = even_share(&found_s);
        let right = true_frames(&found_s, &truth_s, tolerance_s);
        cases.extend(right.into_iter().zip(&found.frames).map(|(right, frame)| {
            let stated = frame.confidence.clamp(0.01, 0.99);
            let logit = (stated / (1.0 - stated)).ln();
            Case {
                kind,
                features: [1.0, frame.confidence, logit, squares, normalized, even],
                confidence: frame.confidence,
                flagged: frame.flags.has_low_confidence(),
                right,
            }
        }));
    }
    Ok(f1)
}

fn times_s(found: &Found) -> Vec<f64> {
    found.starts.iter().map(|start| start.time_s).collect()
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

/// The chance that a right frame has more confidence than a wrong one (Hanley and McNeil 1982).
fn ranked(cases: &[&Case]) -> f64 {
    let mut sorted: Vec<&&Case> = cases.iter().collect();
    sorted.sort_by(|a, b| a.confidence.total_cmp(&b.confidence));
    let (mut below, mut sum) = (0.0, 0.0);
    for same in sorted.chunk_by(|a, b| a.confidence == b.confidence) {
        let right = same.iter().filter(|case| case.right).count() as f64;
        let wrong = same.len() as f64 - right;
        sum += right * (below + 0.5 * wrong);
        below += wrong;
    }
    sum / (below * (cases.len() as f64 - below))
}

/// Newton's method for the likelihood, each kind with the same weight, with a slight pull to zero.
fn fitted(cases: &[Case], used: impl Fn(&Case) -> bool) -> [f64; FEATURES] {
    let of: Vec<&Case> = cases.iter().filter(|case| used(case)).collect();
    let share = |case: &Case| 1e3 / of.iter().filter(|other| other.kind == case.kind).count() as f64;
    let shares: Vec<(&'static str, f64)> = HELD_OUT_DEVICES
        .iter()
        .map(|device| device.name)
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
