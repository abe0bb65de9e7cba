//! Row III-3: the first frames after launch draw more.

use power_model::Circumstances;
use traces::energy::{WarmUp, mean_over_discarded, outliers, warm_up as knee};

use super::super::band::Cases;
use super::super::figure::{ENERGY, POWER, TIME, by_place, level, line};
use super::super::row::{Row, numbers};
use super::super::stage::{MARKED, Recording, looped};
use super::super::{Done, Figure};
use super::{Bench, settled, unflagged};
use run::RunError;

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

/// Recordings of one frame drawn again and again on a machine that draws more for so long after launch.
struct Planted {
    recordings: Vec<Recording>,
    energies: Vec<Vec<f64>>,
    knees: Vec<WarmUp>,
    /// Frames that it draws more for.
    frames: f64,
}

impl Planted {
    fn new(bench: &Bench<'_>, planted_s: f64) -> Result<Self, RunError> {
        let stage = bench.phone.clone().launching(planted_s)?;
        let shown = vec![bench.frame(); *bench.settings.iii_3.recorded.get(bench.form)];
        let recordings = (1..=bench.repeats()).map(|seed| bench.on(&stage, &shown, launched(seed)));
        let recordings: Vec<Recording> = recordings.collect::<Result<_, _>>()?;
        let energies = recordings.iter().map(|recording| Ok(recording.find(1)?.energies_j()));
        let energies: Vec<Vec<f64>> = energies.collect::<Result<_, RunError>>()?;
        let knees = energies.iter().map(|energies| settles(energies)).collect();
        Ok(Self { recordings, energies, knees, frames: planted_s / stage.capped_period_s()? })
    }

    /// Fewest and most frames found.
    fn found(&self) -> [f64; 2] {
        let frames = || self.knees.iter().map(|knee| knee.frames as f64);
        [frames().fold(f64::INFINITY, f64::min), frames().fold(0.0, f64::max)]
    }

    /// The number that is farthest from what was planted.
    fn farthest(&self) -> f64 {
        let [low, high] = self.found();
        if (low - self.frames).abs() > (high - self.frames).abs() { low } else { high }
    }

    /// Excess power, W.
    fn excess_w(&self, period_s: f64) -> f64 {
        self.knees.iter().map(|knee| knee.excess_j).sum::<f64>() / (self.knees.len() as f64 * period_s)
    }
}

/// III-3: the number of frames after which the mean energy settles is what was planted.
pub(super) fn warm_up(bench: &Bench<'_>) -> Result<Done, RunError> {
    let with = bench.with(|settings| &settings.iii_3);
    let (row, form) = (with.settings, with.form);
    let near = *row.near.get(form);
    let mut tried = Cases::new("frames found off what was planted", "planted_s alone");
    let (mut said, mut base) = (Vec::new(), None);
    let mut at = Vec::new();
    for &planted_s in row.planted_s.all(form) {
        let planted = Planted::new(bench, planted_s)?;
        let off = (planted.farthest() - planted.frames).abs();
        let [low, high] = planted.found();
        said.push(format!("{low} to {high} of {:.0}", planted.frames));
        at.push((planted_s, off, off <= near));
        if planted_s == *row.planted_s.get(form) {
            base = Some(planted);
        }
    }
    tried.along("planted_s", at);
    let nothing = || RunError::setting("III-3 has nothing to try");
    let (band, base) = (tried.band(row.planted_s.values()).ok_or_else(nothing)?, base.ok_or_else(nothing)?);
    let recorded = *row.recorded.get(form);
    let pc_shown = looped(&bench.pc_frames[..1], recorded);
    let pc = bench.on(&bench.pc, &pc_shown, launched(1))?;
    let pc_energies = pc.find(MARKED)?.energies_j();
    let pc_frames = settles(&pc_energies).frames;
    let excess_w = base.excess_w(bench.phone.capped_period_s()?);
    let [low, high] = base.found();
    let ours = format!(
        "frames found of those planted, in {} recordings of each: {}; the paper's {} are the {:.0} planted with {} s, +{excess_w:.3} W; {pc_frames} \
         frames on the PC",
        base.knees.len(),
        said.join(", "),
        row.frames.get(form),
        base.frames,
        row.planted_s.get(form)
    );
    let facts = numbers([
        ("planted_frames", base.frames),
        ("fewest_frames", low),
        ("most_frames", high),
        ("excess_W", excess_w),
        ("least_clearness", base.knees.iter().map(|knee| knee.clearness).fold(f64::INFINITY, f64::min)),
        ("pc_frames", pc_frames as f64),
    ]);
    let recordings = row.planted_s.all(form).len() * base.recordings.len() + 1;
    let ran = numbers([
        ("recordings", recordings as f64),
        ("frames_drawn", (recordings * recorded) as f64),
        ("samples_of_one", base.recordings[0].trace.samples() as f64),
    ]);
    let figures = vec![
        drop(&base.recordings[0]),
        on_pc(&pc_energies),
        discarded(&base.energies[0], base.knees[0].frames),
    ];
    Ok(Done { row: Row { numbers: facts, ran, ..with.banded(&row.about, ours, band) }, figures })
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
