//! Row III-3: the first frames after launch draw more.

use power_model::Circumstances;
use traces::energy::{WarmUp, mean_over_discarded, outliers, warm_up as knee};

use super::super::figure::{ENERGY, POWER, TIME, by_place, level, line};
use super::super::recording::{MARKED, Recording, looped};
use super::super::row::{Kind, Row, Verdict, numbers};
use super::super::{Done, Figure};
use super::{Bench, settled, unflagged};
use crate::run::RunError;

/// What the paper found on the phone.
const PAPER: f64 = 48.0;
/// How far off it may be.
const NEAR: f64 = 2.0;
/// Frames of a recording from launch on.
const FRAMES: usize = 240;

fn launched(seed: u64) -> Circumstances {
    Circumstances { launch: true, ..settled(seed) }
}

/// The knee among the frames that are no outliers, as a number of all frames: a disturbance of the operating system lifts a frame
/// far more than the launch does. Where there is none, outliers at the very start may be a short launch.
fn settles(energies_j: &[f64]) -> WarmUp {
    let flags = outliers(energies_j);
    let at_start = flags.iter().take_while(|flag| **flag).count();
    let without = |kept_at_start: usize| {
        let kept: Vec<usize> =
            (0..energies_j.len()).filter(|&place| place < kept_at_start || !flags[place]).collect();
        let found = knee(&kept.iter().map(|&place| energies_j[place]).collect::<Vec<_>>());
        let frames = if found.frames > 0 { kept[found.frames] } else { 0 };
        WarmUp { frames, ..found }
    };
    let found = without(0);
    if found.frames > 0 { found } else { without(at_start) }
}

/// III-3: the number of frames after which the mean energy settles, from recordings of one frame drawn again and again.
pub(super) fn warm_up(bench: &Bench<'_>) -> Result<Done, RunError> {
    let shown = vec![bench.frame(); FRAMES];
    let recordings = (1..=bench.effort.repeats).map(|seed| bench.on_phone(&shown, launched(seed)));
    let recordings: Vec<Recording> = recordings.collect::<Result<_, _>>()?;
    let energies: Vec<Vec<f64>> = recordings
        .iter()
        .map(|recording| Ok(recording.find(1)?.energies_j()))
        .collect::<Result<_, RunError>>()?;
    let knees: Vec<WarmUp> = energies.iter().map(|energies| settles(energies)).collect();
    let frames: Vec<f64> = knees.iter().map(|knee| knee.frames as f64).collect();
    let (low, high) =
        (frames.iter().copied().fold(f64::INFINITY, f64::min), frames.iter().copied().fold(0.0, f64::max));
    let period_s = bench.phone.capped_period_s()?;
    let excess_w = knees.iter().map(|knee| knee.excess_j).sum::<f64>() / (knees.len() as f64 * period_s);
    let pc_shown = looped(&bench.pc_frames[..1], FRAMES);
    bench.bar.inc();
    let pc = Recording::new(&bench.pc, &pc_shown, bench.pc.capped()?, launched(1))?;
    let pc_energies = pc.find(MARKED)?.energies_j();
    let pc_frames = settles(&pc_energies).frames;
    let row = Row {
        id: "III-3",
        kind: Kind::Number,
        claim: "the first frames after launch draw more",
        paper: "around 48 frames on the iPhone 4S, +0.05 W; a few on the i7 3770K (Figure 5)",
        ours: format!(
            "{low} to {high} frames in {} recordings of the phone, +{excess_w:.3} W; {pc_frames} on the PC",
            knees.len()
        ),
        verdict: Verdict::of((low - PAPER).abs() <= NEAR && (high - PAPER).abs() <= NEAR),
        note: format!(
            "holds where every recording alone gives {PAPER} +- {NEAR}. The platform draws {} W more for {} s after launch; how many \
             frames that is, is found in the trace",
            bench.phone.launch()?.extra_w.value(),
            bench.phone.launch()?.duration_s.value()
        ),
        numbers: numbers([
            ("fewest_frames", low),
            ("most_frames", high),
            ("excess_W", excess_w),
            ("least_clearness", knees.iter().map(|knee| knee.clearness).fold(f64::INFINITY, f64::min)),
            ("pc_frames", pc_frames as f64),
        ]),
        figure: None,
        figures: Vec::new(),
    };
    let figures = vec![drop(&recordings[0]), on_pc(&pc_energies), discarded(&energies[0], knees[0].frames)];
    Ok(Done { row, figures })
}

/// Figure 5a: nine frames about the drop.
fn drop(recording: &Recording) -> Figure {
    let frames = &recording.truth.frames;
    let (from_s, to_s) = (frames[44].start_s, frames[52].end_s);
    let points = recording.points(from_s, to_s);
    Figure::lines(
        "III_fig5a",
        "Power drops some frames after launch (Paper III, Figure 5a)",
        "the phone draws one frame again and again; frames 44 to 52 after launch",
        [TIME, POWER],
        vec![line("recorded", points)],
    )
}

/// Figure 5b: identical frames on the PC, from launch on.
fn on_pc(energies: &[f64]) -> Figure {
    let shown = energies.len().min(60);
    Figure::lines(
        "III_fig5b",
        "Identical frames on the PC from launch on (Paper III, Figure 5b)",
        "energy from start to start",
        [("frame", ""), ENERGY],
        vec![line("energy per frame", by_place(&energies[..shown]))],
    )
}

/// Figure 5c: mean energy over discarded frames, outliers left out.
fn discarded(energies: &[f64], knee: usize) -> Figure {
    let flags = outliers(energies);
    let kept = unflagged(energies, &flags);
    // Frames are numbered as kept from here on.
    let knee = (0..knee).filter(|&place| !flags[place]).count();
    let means = mean_over_discarded(&kept);
    let shown = &means[..means.len() - means.len() / 4];
    let [low, high] =
        [f64::min, f64::max].map(|pick: fn(f64, f64) -> f64| shown.iter().copied().reduce(pick));
    let ends = low.zip(high).map_or(Vec::new(), |(low, high)| vec![(knee as f64, low), (knee as f64, high)]);
    Figure::lines(
        "III_fig5c",
        "Mean energy over discarded frames (Paper III, Figure 5c)",
        "the phone draws one frame again and again; outliers left out; the knee as the analysis finds it",
        [("discarded frames", ""), ("mean energy", "J")],
        vec![
            line("mean of the frames left", by_place(shown)),
            line("knee", ends),
            level("settled", 0.0, shown.len() as f64, means[knee]),
        ],
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 240 frames of 24 mJ that scatter by some 0.1 mJ, 1.67 mJ more up to `launch`, and 14 mJ more where disturbed.
    fn energies(launch: usize, disturbed: &[usize]) -> Vec<f64> {
        let scatter = |place: usize| 1e-4 * ((place * 7919 % 101) as f64 / 50.0 - 1.0);
        let extra = |place: usize| if place < launch { 1.67e-3 } else { 0.0 };
        let hit = |place: usize| if disturbed.contains(&place) { 14e-3 } else { 0.0 };
        (0..240).map(|place| 24e-3 + scatter(place) + extra(place) + hit(place)).collect()
    }

    #[test]
    fn the_knee_is_a_number_of_all_frames_wherever_disturbances_lie() {
        assert_eq!(settles(&energies(48, &[])).frames, 48);
        for disturbed in [[0, 1, 2], [10, 11, 12], [45, 46, 47], [46, 47, 48], [49, 50, 51], [200, 201, 202]]
        {
            let found = settles(&energies(48, &disturbed)).frames;
            assert!((46..=50).contains(&found), "{disturbed:?}: {found}");
        }
        // The analysis without that step takes the disturbance for the launch.
        assert_ne!(knee(&energies(48, &[10, 11, 12])).frames, 48);
    }

    #[test]
    fn a_launch_of_a_few_frames_is_one_and_none_is_none() {
        let mut short = energies(0, &[]);
        short[..3].iter_mut().for_each(|energy| *energy += 5e-3);
        assert_eq!(settles(&short).frames, 3);
        assert_eq!(settles(&energies(0, &[100, 101])).frames, 0);
    }
}
