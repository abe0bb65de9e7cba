//! Row III-6: the operating system shows every five seconds.

use power_model::{Cause, Pulse};
use traces::energy::{Spread, outliers};

use super::super::band::Cases;
use super::super::figure::{ENERGY, POWER, TIME, by_place, dots, line};
use super::super::row::{Row, numbers};
use super::super::stage::Recording;
use super::super::{Done, Figure};
use super::{Bench, settled, unflagged};
use run::RunError;

/// Frames of a short repeated measurement for the upper half of Figure 8.
const SHORT: usize = 24;

/// The disturbances of the kind that is listed first: those every five seconds.
fn five_second_ones(recording: &Recording) -> Vec<&Pulse> {
    recording.truth.pulses.iter().filter(|pulse| pulse.cause == Cause::Disturbance(0)).collect()
}

/// For each true frame, how much of it is disturbed, s.
fn overlaps_s(recording: &Recording) -> Vec<f64> {
    let pulses = five_second_ones(recording);
    let frames = recording.truth.frames.iter();
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

fn tally(recording: &Recording, flags: &[bool]) -> Tally {
    let touched: Vec<bool> = overlaps_s(recording).iter().map(|overlap_s| *overlap_s > 0.0).collect();
    let counts: Vec<usize> = five_second_ones(recording)
        .into_iter()
        .filter(|pulse| pulse.start_s > recording.truth.start_s && pulse.end_s < recording.truth.end_s)
        .map(|pulse| {
            recording
                .truth
                .frames
                .iter()
                .filter(|frame| pulse.overlap_s(frame.start_s, frame.end_s) > 0.0)
                .count()
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
    recording: Recording,
    energies: Vec<f64>,
    flags: Vec<bool>,
    tally: Tally,
    /// Deviation of all frames and of those that are not flagged, mJ.
    deviations_mj: [f64; 2],
}

impl Still {
    fn new(bench: &Bench<'_>, extra_w: f64) -> Result<Self, RunError> {
        let shown = vec![bench.frame(); *bench.settings.work.still_frames.get(bench.form)];
        let recording = bench.on(&bench.phone.clone().disturbed(extra_w)?, &shown, settled(5))?;
        // A frame that was not found counts as one of no energy, which nobody could overlook.
        let found = recording.by_true_frame_j(&recording.find(1)?);
        let energies: Vec<f64> = found.iter().map(|energy| energy.unwrap_or(0.0)).collect();
        let flags = outliers(&energies);
        let tally = tally(&recording, &flags);
        let kept = unflagged(&energies, &flags);
        let deviation_mj =
            |values: &[f64]| 1e3 * Spread::of(values).map_or(f64::NAN, |spread| spread.deviation);
        let deviations_mj = [deviation_mj(&energies), deviation_mj(&kept)];
        Ok(Self { recording, energies, flags, tally, deviations_mj })
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
    let band =
        tried.band(row.extra_w.values()).ok_or_else(|| RunError::setting("III-6 has nothing to try"))?;
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
        ("samples_of_one", base.recording.trace.samples() as f64),
    ]);
    let made = with.banded(&row.about, ours, band);
    let note = match reason(&base) {
        None => made.note.clone(),
        Some(reason) => format!("{}; {reason}", made.note),
    };
    let figures = vec![hit(&base.recording), flagged(&base.energies, &base.flags), growing(bench)?];
    Ok(Done { row: Row { numbers: facts, ran, note, ..made }, figures })
}

/// Which frames are flagged wrongly, with how much of them was disturbed.
fn reason(still: &Still) -> Option<String> {
    if still.same() {
        return None;
    }
    let overlaps = overlaps_s(&still.recording);
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
fn hit(recording: &Recording) -> Figure {
    let inside = |pulse: &&&Pulse| {
        pulse.start_s > recording.truth.start_s + 0.2 && pulse.end_s < recording.truth.end_s - 0.2
    };
    let pulses = five_second_ones(recording);
    let centre_s = pulses
        .iter()
        .find(inside)
        .map_or(recording.truth.start_s + 0.2, |pulse| 0.5 * (pulse.start_s + pulse.end_s));
    Figure::lines(
        "III_fig8_power",
        "A disturbance on top of identical frames (Paper III, Figure 8, lower right)",
        "the phone draws one frame again and again",
        [TIME, POWER],
        vec![line("recorded", recording.points(centre_s - 0.15, centre_s + 0.15))],
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

/// Figure 8, upper half: standard deviation over the number of repetitions, of a frame that is never hit and of one that is.
fn growing(bench: &Bench<'_>) -> Result<Figure, RunError> {
    let shown = vec![bench.frame(); SHORT];
    let (mut energies, mut first_hits) = (vec![Vec::new(); SHORT], [None; SHORT]);
    for seed in 0..*bench.settings.iii_6.shorts.get(bench.form) {
        let recording = bench.on_phone(&shown, settled(100 + seed))?;
        let frames = recording.by_timestamps_j().into_iter().zip(overlaps_s(&recording));
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
