//! Paper III, "Measuring Per-Frame Energy Consumption of Real-Time Graphics Applications".
//! Rows III-1 and III-2: one mark finds the frames, and their energies add up.

mod blocking;
mod system;

use output::terminal::Progress;
use power_model::{Circumstances, FramePower, Pacing};
use run::RunError;
use traces::energy::{PowerIntegral, Score};
use traces::frames::FinderMethod;

use super::report::{POWER, TIME, dots, line};
use super::row::{ClaimRow, Verdict, With, numbers};
use super::settings::{
    About, Form, RowSetting, SettingsOrigin, load, paper_settings, reduced, row_settings, settings_group,
};
use super::stage::{Frames, MARKED, Stage, TracedRun, looped};
use super::{Done, Figure, Paper, ReproduceOptions};

/// Both machines, with their simulated frames.
struct Bench<'a> {
    settings: Settings,
    form: Form,
    origin: SettingsOrigin,
    pc: Stage,
    pc_frames: Vec<FramePower>,
    phone: Stage,
    /// Simulated frames of the phone's sequence.
    phone_frames: Vec<FramePower>,
    progress: &'a Progress,
}

/// The frame of the phone's sequence in Figure 7.
const FRAME: usize = 9;

/// Long after launch, without blocking.
fn settled(seed: u64) -> Circumstances {
    Circumstances { launch: false, blocking_finish: false, seed }
}

/// Energies of frames without flags.
fn unflagged(energies_j: &[f64], flags: &[bool]) -> Vec<f64> {
    energies_j.iter().zip(flags).filter(|(_, flag)| !**flag).map(|(energy, _)| *energy).collect()
}

impl Bench<'_> {
    /// The settings of one row.
    fn with<'s, S>(&'s self, row: fn(&'s Settings) -> &'s S) -> With<'s, S> {
        With {
            settings: row(&self.settings),
            form: self.form,
            sha256: &self.origin.sha256,
            shared_less: reduced(&self.settings.work, self.form),
        }
    }

    /// Number of recordings of the same frames.
    fn repeats(&self) -> u64 {
        *self.settings.work.repeats.get(self.form)
    }

    /// Frames in a recording of an animation.
    fn recorded_frames(&self) -> usize {
        *self.settings.work.recorded_frames.get(self.form)
    }

    /// One frame of the phone's sequence is simulated for each so many.
    fn phone_step(&self) -> u32 {
        *self.settings.work.phone_step.get(self.form)
    }

    /// The frame of Figure 7, or the last simulated one before it.
    fn frame(&self) -> &FramePower {
        &self.phone_frames[FRAME / self.phone_step() as usize]
    }

    /// Recording of the phone, which draws `frames` at its frame rate cap.
    fn on_phone(&self, frames: &[&FramePower], circumstances: Circumstances) -> Result<TracedRun, RunError> {
        self.on(&self.phone, frames, circumstances)
    }

    /// Recording of a machine, which draws `frames` at its frame rate cap.
    fn on(
        &self,
        stage: &Stage,
        frames: &[&FramePower],
        circumstances: Circumstances,
    ) -> Result<TracedRun, RunError> {
        TracedRun::new(stage, frames, stage.capped()?, circumstances)
    }

    /// Recording of the PC, which draws its animation.
    fn on_pc(&self, pacing: Pacing, circumstances: Circumstances) -> Result<TracedRun, RunError> {
        let shown = looped(&self.pc_frames, self.recorded_frames());
        TracedRun::new(&self.pc, &shown, pacing, circumstances)
    }
}

type Compute = fn(&Bench<'_>) -> Result<Done, RunError>;

const ROWS: [(&str, Compute); 6] = [
    ("III-1", found),
    ("III-2", sums),
    ("III-3", system::warm_up),
    ("III-4", blocking::phone),
    ("III-5", blocking::pc),
    ("III-6", system::five_seconds),
];

/// The ids of its rows.
pub(super) fn ids() -> Vec<&'static str> {
    ROWS.iter().map(|(id, _)| *id).collect()
}

pub(super) fn rows(
    options: &ReproduceOptions,
    progress: &Progress,
) -> Result<(SettingsOrigin, Vec<Done>), RunError> {
    let (settings, origin) = load::<Settings>(options.settings.as_deref())?;
    let form = options.form();
    let (pc, phone) = (Stage::pc()?, Stage::phone()?);
    let pc_frames = pc.pc_animation(*settings.work.pc_frames.get(form), progress)?;
    let edge = *settings.iii_4.edge.get(form);
    let phone_frames = phone.phone_sequence(edge, *settings.work.phone_step.get(form), progress)?;
    let bench = Bench { settings, form, origin, pc, pc_frames, phone, phone_frames, progress };
    let wanted: Vec<_> = ROWS.into_iter().filter(|(id, _)| options.wants(id)).collect();
    let bar = progress.bar("rows", wanted.len() as u64);
    let mut done = Vec::new();
    for (_, compute) in wanted {
        done.push(compute(&bench)?);
        bar.inc();
    }
    Ok((bench.origin, done))
}

paper_settings!(Paper::Three, "paper3.ron" {
    work: Work,
    iii_1: Finding,
    iii_2: Sums,
    iii_3: WarmUp,
    iii_4: BlockingPhone,
    iii_5: BlockingPc,
    iii_6: Disturbance,
});

settings_group! {
    /// Amount of simulation and recording, shared by all rows.
    Work {} {
        pc_frames: u32, within(1..=36);
        phone_step: u32, within(1..=8);
        recorded_frames: usize, within(24..=10_000);
        still_frames: usize, within(200..=10_000);
        repeats: u64, within(1..=1000);
    }
}

row_settings! {
    Finding {
        marked: usize, within(1..=8);
        found_vsync: f64, within(0.0..=1.0);
        found_free: f64, within(0.0..=1.0);
        within_ms: f64, within(0.001..=10.0);
    }

    Sums {
        same: f64, within(0.0..=1.0);
    }

    WarmUp {
        frames: u32, within(1..=1000);
        planted_s: f64, within(0.1..=4.0);
        near: f64, within(0.0..=100.0);
        recorded: usize, within(150..=10_000);
    }

    BlockingPhone {
        waiting_w: f64, within(0.0..=10.0);
        idle_w: f64, within(0.01..=10.0);
        edge: f64, within(0.01..=1.0);
    }

    BlockingPc {
        with_mj: (f64, f64), must(energy, ENERGY);
        without_mj: (f64, f64), must(energy, ENERGY);
        waiting_w: f64, within(0.0..=100.0);
        background_w: f64, within(0.0..=100.0);
    }

    Disturbance {
        extra_w: f64, within(0.0..=10.0);
        frames: (usize, usize), must(|(low, high)| low <= high, "fewest and most");
        shorts: u64, within(2..=1000);
    }
}

fn energy((mean, deviation): &(f64, f64)) -> bool {
    *mean > 0.0 && *deviation > 0.0
}

const ENERGY: &str = "a mean and a deviation above 0";

/// III-1: one marked start finds the others, with V-sync and without. It is judged by the method of the
/// paper; the tracking of this program stands beside it.
fn found(bench: &Bench<'_>) -> Result<Done, RunError> {
    let with = bench.with(|settings| &settings.iii_1);
    let (row, form) = (with.settings, with.form);
    let (capped, [vsync, vsync_tracking]) = scored(bench, bench.pc.capped()?, 1)?;
    let (free, [without, without_tracking]) = scored(bench, Pacing::FreeRunning, 5000)?;
    let least = [*row.found_vsync.get(form), *row.found_free.get(form)];
    let ours = format!(
        "least squares: V-sync {}, without {}; tracking: V-sync {}, without {}; {} recordings of {} frames each, within {} ms",
        vsync.text(),
        without.text(),
        vsync_tracking.text(),
        without_tracking.text(),
        bench.repeats(),
        bench.recorded_frames(),
        row.within_ms.get(form)
    );
    let note = format!(
        "mean F1 of least squares is {:.3} with V-sync and {:.3} without{}",
        vsync.f1,
        without.f1,
        missed(&[vsync, without, vsync_tracking, without_tracking])
    );
    let facts = numbers([
        ("vsync_f1", vsync.f1),
        ("vsync_precision", vsync.mean[0]),
        ("vsync_recall", vsync.mean[1]),
        ("free_f1", without.f1),
        ("free_precision", without.mean[0]),
        ("free_recall", without.mean[1]),
        ("vsync_tracking_f1", vsync_tracking.f1),
        ("free_tracking_f1", without_tracking.f1),
    ]);
    let recordings = 2 * bench.repeats();
    let ran = numbers([
        ("recordings", recordings as f64),
        ("frames_drawn", (recordings * bench.recorded_frames() as u64) as f64),
        ("samples_of_one", capped.0.trace.samples() as f64),
    ]);
    let holds = vsync.f1 >= least[0] && without.f1 >= least[1];
    let made = with.row(&row.about, (ours, Verdict::of(holds), note));
    let figures = vec![
        shown_frames("III_fig3", "Two frames at 30 Hz (Paper III, Figure 3)", &capped, 2),
        shown_frames("III_fig4", "Three frames without V-sync (Paper III, Figure 4)", &free, 3),
    ];
    Ok(Done { row: ClaimRow { numbers: facts, ran, ..made }, figures })
}

/// How well starts were found over several recordings.
#[derive(Clone, Copy)]
struct Found {
    /// Precision and recall.
    mean: [f64; 2],
    /// Of the worst recording.
    worst: [f64; 2],
    f1: f64,
    /// Recordings in which less than half of the starts were found.
    lost: usize,
    /// Starts missed in all, and those of them on which a disturbance lay.
    missed: [usize; 2],
}

impl Found {
    fn of(judged: &[(Score, usize)]) -> Self {
        let scores: Vec<&Score> = judged.iter().map(|(score, _)| score).collect();
        let of = |rate: fn(&Score) -> f64| scores.iter().map(move |score| rate(score));
        let mean = |rate| of(rate).sum::<f64>() / scores.len() as f64;
        let worst = |rate| of(rate).fold(f64::INFINITY, f64::min);
        Self {
            mean: [mean(Score::precision), mean(Score::recall)],
            worst: [worst(Score::precision), worst(Score::recall)],
            f1: mean(Score::f1),
            lost: scores.iter().filter(|score| score.recall() < 0.5).count(),
            missed: [
                scores.iter().map(|score| score.truth - score.matched).sum(),
                judged.iter().map(|(_, disturbed)| disturbed).sum(),
            ],
        }
    }

    fn text(&self) -> String {
        let ([precision, recall], [_, least]) = (self.mean, self.worst);
        format!("precision {precision:.3}, recall {recall:.3} (least {least:.3})")
    }
}

/// Missed starts by method and pacing, and how many of them lay under a disturbance.
fn missed(found: &[Found; 4]) -> String {
    let names =
        ["least squares with V-sync", "least squares without", "tracking with V-sync", "tracking without"];
    let line = |(name, found): (&&str, &Found)| {
        let [all, disturbed] = found.missed;
        let lost = match found.lost {
            0 => String::new(),
            lost => format!(
                ", most of them in {lost} recordings in which a multiple of the period was taken for it"
            ),
        };
        (all > 0).then(|| {
            format!("; {name} missed {all} starts, {disturbed} of them with a disturbance on them{lost}")
        })
    };
    names.iter().zip(found).filter_map(line).collect()
}

/// A recording and what was found in it.
type Searched = (TracedRun, Frames);

/// Recordings of the PC's animation with one mark each: the first, and how well all of them are found by
/// either method.
fn scored(bench: &Bench<'_>, pacing: Pacing, first_seed: u64) -> Result<(Searched, [Found; 2]), RunError> {
    let row = &bench.settings.iii_1;
    let (marked, within_s) = (*row.marked.get(bench.form), 1e-3 * row.within_ms.get(bench.form));
    let mut first = None;
    let (mut squares, mut tracking) = (Vec::new(), Vec::new());
    for seed in first_seed..first_seed + bench.repeats() {
        let run = bench.on_pc(pacing, settled(seed))?;
        let tracked = run.find(marked)?;
        squares.push(run.score(&run.find_by(FinderMethod::SumOfSquares, marked)?, within_s));
        tracking.push(run.score(&tracked, within_s));
        first.get_or_insert((run, tracked));
    }
    let none = || RunError::setting("no recording was requested");
    Ok((first.ok_or_else(none)?, [Found::of(&squares), Found::of(&tracking)]))
}

/// Some frames from the middle, with the starts that were found.
fn shown_frames(name: &'static str, title: &str, (run, frames): &Searched, count: usize) -> Figure {
    let middle = run.truth.frames.len() / 2;
    let (first, last) = (&run.truth.frames[middle], &run.truth.frames[middle + count - 1]);
    let margin_s = 0.05 * (last.end_s - first.start_s);
    let (from_s, to_s) = (first.start_s - margin_s, last.end_s + margin_s);
    let points = run.points(from_s, to_s);
    let near = |time_s: f64| points.iter().find(|point| point.0 >= time_s).map_or(0.0, |point| point.1);
    let starts = frames.found.iter().map(|frame| frame.start_s);
    let starts = starts
        .filter(|start| (from_s..to_s).contains(start))
        .map(|start| (start - from_s, near(start - from_s)));
    let starts = dots("found starts", starts.collect());
    let subject = "the PC's animation, 32 lights in one pass";
    Figure::lines(name, title, subject, [TIME, POWER], vec![line("recorded", points.clone()), starts])
}

/// III-2: start-to-start energies sum to the whole, begin-to-finish ones do not.
fn sums(bench: &Bench<'_>) -> Result<Done, RunError> {
    let with = bench.with(|settings| &settings.iii_2);
    let same = *with.settings.same.get(with.form);
    let capped = bench.on_pc(bench.pc.capped()?, settled(1))?;
    let frames = capped.find(MARKED)?;
    let integral = PowerIntegral::new(&capped.trace);
    let from_s = frames.found.first().map_or(0.0, |frame| frame.start_s);
    let whole_j = integral.energy_j(from_s, frames.end_s);
    let new_j: f64 = frames.energies_j().iter().sum();
    let drawn_j = integral.energy_j(capped.truth.start_s, capped.truth.end_s);
    let old_j: f64 = capped.begin_to_finish_j().iter().sum();
    let [new, old] = [(new_j / whole_j - 1.0).abs(), 1.0 - old_j / drawn_j];
    let ours = format!(
        "start to start {new_j:.6} J of {whole_j:.6} J, off by {new:.1e}; begin to finish {old_j:.3} J, short by {:.1} %",
        100.0 * old
    );
    let facts = numbers([
        ("whole_J", whole_j),
        ("start_to_start_J", new_j),
        ("relative_error", new),
        ("begin_to_finish_J", old_j),
        ("begin_to_finish_missing", old),
    ]);
    let ran = numbers([
        ("frames_drawn", capped.truth.frames.len() as f64),
        ("frames_found", frames.found.len() as f64),
        ("samples", capped.trace.samples() as f64),
    ]);
    let verdict = Verdict::of(new < same && old.abs() > same);
    let made = with.row(&with.settings.about, (ours, verdict, String::new()));
    Ok(Done::bare(ClaimRow { numbers: facts, ran, ..made }))
}
