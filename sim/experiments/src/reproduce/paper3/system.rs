//! Rows III-3 and III-6: the first frames after launch draw more, and the operating system shows every five seconds.

use power_model::{Cause, Circumstances, Pulse};
use run::RunError;
use traces::energy::{Spread, WarmUp, mean_over_discarded, outliers, warm_up as knee};

use super::super::report::{ENERGY, POWER, TIME, by_place, dots, level, line};
use super::super::row::{Cases, ClaimRow, numbers};
use super::super::stage::{MARKED, TracedRun, looped};
use super::super::{Done, Figure};
use super::{Bench, settled, unflagged};

fn launched(seed: u64) -> Circumstances {
    Circumstances { launch: true, ..settled(seed) }
}

/// The knee among the frames that are no outliers, as a number of all frames: a disturbance of the operating
/// system lifts a frame far more than the launch does. Where there is none, outliers at the very start may be
/// a short launch.
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
    recordings: Vec<TracedRun>,
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
        let recordings: Vec<TracedRun> = recordings.collect::<Result<_, _>>()?;
        let energies = recordings.iter().map(|run| Ok(run.find(1)?.energies_j()));
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
    let (mut described, mut base) = (Vec::new(), None);
    let mut at = Vec::new();
    for &planted_s in row.planted_s.all(form) {
        let planted = Planted::new(bench, planted_s)?;
        let off = (planted.farthest() - planted.frames).abs();
        let [low, high] = planted.found();
        described.push(format!("{low} to {high} of {:.0}", planted.frames));
        at.push((planted_s, off, off <= near));
        if planted_s == *row.planted_s.get(form) {
            base = Some(planted);
        }
    }
    tried.along("planted_s", at);
    let band = tried.band(row.planted_s.values())?;
    let base = base.ok_or_else(|| RunError::setting("planted_s: its own value is not among those to try"))?;
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
        described.join(", "),
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
    Ok(Done { row: ClaimRow { numbers: facts, ran, ..with.banded(&row.about, ours, band) }, figures })
}

/// Figure 5a: nine frames about the drop.
fn drop(run: &TracedRun) -> Figure {
    let frames = &run.truth.frames;
    let (from_s, to_s) = (frames[44].start_s, frames[52].end_s);
    let points = run.points(from_s, to_s);
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

/// Frames of a short repeated measurement for the upper half of Figure 8.
const SHORT: usize = 24;

/// The disturbances of the kind that is listed first: those every five seconds.
fn five_second_ones(run: &TracedRun) -> Vec<&Pulse> {
    run.truth.pulses.iter().filter(|pulse| pulse.cause == Cause::Disturbance(0)).collect()
}

/// For each true frame, how much of it is disturbed, s.
fn overlaps_s(run: &TracedRun) -> Vec<f64> {
    let pulses = five_second_ones(run);
    let frames = run.truth.frames.iter();
    frames.map(|frame| pulses.iter().map(|pulse| pulse.overlap_s(frame.start_s, frame.end_s)).sum()).collect()
}

/// Counts of frames that were disturbed, flagged or both.
struct Tally {
    touched: usize,
    flagged: usize,
    both: usize,
    /// Frames touched by each whole disturbance, fewest and most.
    frames: [usize; 2],
    disturbances: usize,
}

fn tally(run: &TracedRun, flags: &[bool]) -> Tally {
    let touched: Vec<bool> = overlaps_s(run).iter().map(|overlap_s| *overlap_s > 0.0).collect();
    let counts: Vec<usize> = five_second_ones(run)
        .into_iter()
        .filter(|pulse| pulse.start_s > run.truth.start_s && pulse.end_s < run.truth.end_s)
        .map(|pulse| {
            run.truth.frames.iter().filter(|frame| pulse.overlap_s(frame.start_s, frame.end_s) > 0.0).count()
        })
        .collect();
    Tally {
        touched: touched.iter().filter(|touched| **touched).count(),
        flagged: flags.iter().filter(|flag| **flag).count(),
        both: touched.iter().zip(flags).filter(|(touched, flag)| **touched && **flag).count(),
        frames: [counts.iter().copied().min().unwrap_or(0), counts.iter().copied().max().unwrap_or(0)],
        disturbances: counts.len(),
    }
}

/// One frame drawn again and again, with what the analysis makes of it.
struct Still {
    run: TracedRun,
    energies: Vec<f64>,
    flags: Vec<bool>,
    tally: Tally,
    /// Deviation of all frames and of those that are not flagged, mJ.
    deviations_mj: [f64; 2],
}

impl Still {
    fn new(bench: &Bench<'_>, extra_w: f64) -> Result<Self, RunError> {
        let shown = vec![bench.frame(); *bench.settings.work.still_frames.get(bench.form)];
        let run = bench.on(&bench.phone.clone().disturbed(extra_w)?, &shown, settled(5))?;
        // A frame that was not found counts as one of no energy, which nobody could overlook.
        let found = run.by_true_frame_j(&run.find(1)?);
        let energies: Vec<f64> = found.iter().map(|energy| energy.unwrap_or(0.0)).collect();
        let flags = outliers(&energies);
        let tally = tally(&run, &flags);
        let kept = unflagged(&energies, &flags);
        let deviation_mj =
            |values: &[f64]| 1e3 * Spread::of(values).map_or(f64::NAN, |spread| spread.deviation);
        let deviations_mj = [deviation_mj(&energies), deviation_mj(&kept)];
        Ok(Self { run, energies, flags, tally, deviations_mj })
    }

    /// Whether the frames flagged are those touched.
    fn same(&self) -> bool {
        self.tally.both == self.tally.touched && self.tally.both == self.tally.flagged
    }

    fn holds(&self, (fewest, most): (usize, usize)) -> bool {
        let [low, high] = self.tally.frames;
        self.same() && low >= fewest && high <= most && self.deviations_mj[0] > self.deviations_mj[1]
    }
}

/// III-6: the frames that the disturbance hits are those flagged, three or four each, and they lift the deviation.
pub(super) fn five_seconds(bench: &Bench<'_>) -> Result<Done, RunError> {
    let with = bench.with(|settings| &settings.iii_6);
    let (row, form) = (with.settings, with.form);
    let frames = *row.frames.get(form);
    let base = Still::new(bench, *row.extra_w.get(form))?;
    let mut watts = row.extra_w.all(form).to_vec();
    watts.sort_by(f64::total_cmp);
    let at = watts.iter().map(|&extra_w| {
        let still = Still::new(bench, extra_w)?;
        let right = still.tally.both as f64 / still.tally.touched.max(still.tally.flagged).max(1) as f64;
        Ok((extra_w, right, still.holds(frames)))
    });
    let mut tried = Cases::new("share of the frames touched or flagged that are both", "extra_w alone");
    tried.along("extra_w", at.collect::<Result<Vec<_>, RunError>>()?);
    let band = tried.band(row.extra_w.values())?;
    let Tally { touched, flagged: flags, both, frames: [fewest, most], disturbances } = base.tally;
    let [all_mj, without_mj] = base.deviations_mj;
    let ours = format!(
        "with {} W: {disturbances} disturbances of {fewest} to {most} frames; {touched} frames touched, {flags} flagged, {both} of them both; \
         deviation {all_mj:.3} mJ, {without_mj:.3} mJ without them",
        row.extra_w.get(form)
    );
    let facts = numbers([
        ("touched_frames", touched as f64),
        ("flagged_frames", flags as f64),
        ("both_frames", both as f64),
        ("fewest_frames", fewest as f64),
        ("most_frames", most as f64),
        ("deviation_mJ", all_mj),
        ("deviation_without_outliers_mJ", without_mj),
    ]);
    let ran = numbers([
        ("recordings", watts.len() as f64 + 1.0 + *row.shorts.get(form) as f64),
        ("frames_of_one", base.energies.len() as f64),
        ("disturbances", disturbances as f64),
        ("samples_of_one", base.run.trace.samples() as f64),
    ]);
    let made = with.banded(&row.about, ours, band);
    let note = match reason(&base) {
        None => made.note.clone(),
        Some(reason) => format!("{}; {reason}", made.note),
    };
    let figures = vec![hit(&base.run), flagged(&base.energies, &base.flags), growing(bench)?];
    Ok(Done { row: ClaimRow { numbers: facts, ran, note, ..made }, figures })
}

/// Which frames are flagged wrongly, with how much of them was disturbed.
fn reason(still: &Still) -> Option<String> {
    if still.same() {
        return None;
    }
    let overlaps = overlaps_s(&still.run);
    let wrong = overlaps
        .iter()
        .zip(&still.flags)
        .enumerate()
        .filter(|(_, (overlap_s, flag))| (**overlap_s > 0.0) != **flag);
    // A frame whose start was missed counts as one without energy, and is flagged.
    let list: Vec<String> =
        wrong.map(|(place, (overlap_s, _))| format!("{place} ({:.2} ms)", 1e3 * overlap_s)).collect();
    Some(format!("frames flagged wrongly, with how long they were disturbed: {}", list.join(", ")))
}

/// Figure 8, lower right: power over a group of disturbed frames.
fn hit(run: &TracedRun) -> Figure {
    let inside =
        |pulse: &&&Pulse| pulse.start_s > run.truth.start_s + 0.2 && pulse.end_s < run.truth.end_s - 0.2;
    let pulses = five_second_ones(run);
    let centre_s = pulses
        .iter()
        .find(inside)
        .map_or(run.truth.start_s + 0.2, |pulse| 0.5 * (pulse.start_s + pulse.end_s));
    Figure::lines(
        "III_fig8_power",
        "A disturbance on top of identical frames (Paper III, Figure 8, lower right)",
        "the phone draws one frame again and again",
        [TIME, POWER],
        vec![line("recorded", run.points(centre_s - 0.15, centre_s + 0.15))],
    )
}

/// Energies over the frames, with those flagged.
fn flagged(energies: &[f64], flags: &[bool]) -> Figure {
    let points = by_place(energies);
    let out = points.iter().zip(flags).filter(|(_, flag)| **flag).map(|(point, _)| *point).collect();
    Figure::lines(
        "III_fig8_frames",
        "Frames that are flagged as outliers (Paper III, Figure 8)",
        "the phone draws one frame again and again; each should be the same",
        [("frame", ""), ENERGY],
        vec![dots("energy per frame", points.clone()), dots("flagged", out)],
    )
}

/// Figure 8, upper half: standard deviation over the number of repetitions, of a frame that is never hit and
/// of one that is.
fn growing(bench: &Bench<'_>) -> Result<Figure, RunError> {
    let shown = vec![bench.frame(); SHORT];
    let (mut energies, mut first_hits) = (vec![Vec::new(); SHORT], [None; SHORT]);
    for seed in 0..*bench.settings.iii_6.shorts.get(bench.form) {
        let run = bench.on_phone(&shown, settled(100 + seed))?;
        let frames = run.by_timestamps_j().into_iter().zip(overlaps_s(&run));
        for ((energy, overlap_s), (list, first_hit)) in frames.zip(energies.iter_mut().zip(&mut first_hits)) {
            list.push(energy);
            if overlap_s > 5e-3 {
                first_hit.get_or_insert(list.len());
            }
        }
    }
    let never = first_hits.iter().position(Option::is_none);
    // The later it is hit, the better one sees the deviation fall and then rise.
    let late = (0..SHORT).filter(|&place| first_hits[place].is_some()).max_by_key(|&place| first_hits[place]);
    let deviations = |place: usize| -> Vec<(f64, f64)> {
        let list = &energies[place];
        let of = |count: usize| Spread::of(&list[..count]).map_or(0.0, |spread| spread.deviation);
        (2..=list.len()).map(|count| (count as f64, of(count))).collect()
    };
    let mut series = Vec::new();
    series.extend(never.map(|place| line("a frame never hit", deviations(place))));
    series.extend(late.map(|place| line("a frame hit at least once", deviations(place))));
    Ok(Figure::lines(
        "III_fig8_deviation",
        "Standard deviation over repetitions (Paper III, Figure 8, top)",
        "the same measurements, two frames of the sequence",
        [("repetitions", ""), ("standard deviation", "J")],
        series,
    ))
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
