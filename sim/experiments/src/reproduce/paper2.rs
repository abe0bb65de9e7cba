//! Paper II, "Performance per What?".

use output::progress::Progress;
use power_model::{Circumstances, FramePower};
use run::RunError;
use traces::energy::PowerIntegral;

use super::figure::{POWER, TIME, line};
use super::row::{Number, Row, With, numbers};
use super::settings::{About, Origin, Setting, load, paper_settings, reduced, row_settings, settings_group};
use super::stage::{Frames, MARKED, Recording, Stage, looped};
use super::verdict::Verdict;
use super::{Done, Figure, Options, Paper};

/// The ids of its rows.
pub(super) fn ids() -> Vec<&'static str> {
    vec!["II-1", "II-2"]
}

/// Pixels of the PC's image.
const PIXELS: f64 = 1280.0 * 720.0;

pub(super) fn rows(options: &Options, progress: &Progress) -> Result<(Origin, Vec<Done>), RunError> {
    let (settings, origin) = load::<Settings>(options.settings.as_deref())?;
    let form = options.form();
    let pc = Stage::pc()?;
    let frames = pc.pc_animation(*settings.work.pc_frames.get(form), progress)?;
    let shown = looped(&frames, *settings.work.recorded_frames.get(form));
    let seed = *settings.work.seed.get(form);
    let recording = Recording::new(
        &pc,
        &shown,
        pc.capped()?,
        Circumstances { launch: false, blocking_finish: false, seed },
    )?;
    let found = recording.find(MARKED)?;
    let idle_w = pc.platform.idle_w.value();
    let (mut done, less) = (Vec::new(), reduced(&settings.work, form));
    if options.wants("II-1") {
        let with = With { settings: &settings.ii_1, form, sha256: &origin.sha256, shared_less: less.clone() };
        done.push(passes(&with, &recording, &frames, idle_w));
    }
    if options.wants("II-2") {
        let with = With { settings: &settings.ii_2, form, sha256: &origin.sha256, shared_less: less };
        done.push(inverses(&with, &recording, &found));
    }
    Ok((origin, done))
}

/// Recorded frames.
fn ran(recording: &Recording, found: usize) -> Vec<Number> {
    numbers([
        ("frames_drawn", recording.truth.frames.len() as f64),
        ("samples_recorded", recording.trace.samples() as f64),
        ("frames_found", found as f64),
    ])
}

/// Energies of the segments of a frame over all frames, with the mean idle power taken off as in the paper, J per pixel.
struct Split {
    drawing: f64,
    rest: f64,
    whole: f64,
}

fn split(recording: &Recording, idle_w: f64) -> Split {
    let integral = PowerIntegral::new(&recording.trace);
    let mut split = Split { drawing: 0.0, rest: 0.0, whole: 0.0 };
    let taken = |from_s: f64, to_s: f64| integral.energy_j(from_s, to_s) - idle_w * (to_s - from_s);
    for frame in &recording.truth.frames {
        split.drawing += taken(frame.start_s, frame.finish_s);
        split.rest += taken(frame.finish_s, frame.end_s);
        split.whole += taken(frame.start_s, frame.end_s);
    }
    let per_pixel = 1.0 / (PIXELS * recording.truth.frames.len() as f64);
    Split { drawing: split.drawing * per_pixel, rest: split.rest * per_pixel, whole: split.whole * per_pixel }
}

/// II-1: energies of the passes add up to that of the frame.
fn passes(with: &With<'_, Passes>, recording: &Recording, frames: &[FramePower], idle_w: f64) -> Done {
    let (row, form) = (with.settings, with.form);
    let Split { drawing, rest, whole } = split(recording, idle_w);
    let (error, same) = (((drawing + rest) / whole - 1.0).abs(), *row.same.get(form));
    let [drawing_nj, rest_nj, whole_nj] = [drawing, rest, whole].map(|joules| 1e9 * joules);
    let stated = [&row.frame_nj, &row.g_buffer_nj, &row.lighting_nj].map(|nj| *nj.get(form));
    let ours = format!(
        "{whole_nj:.1} = {drawing_nj:.1} + {rest_nj:.1} nJ/pixel (one opaque pass, rest), off by {error:.1e}"
    );
    let note = format!(
        "the deferred renderer with its G-buffer and lighting passes does not exist yet; the paper's {} = {} + {} + {} are of one. What there is, \
         one forward pass and the rest of the frame, adds up {} (within {same:.0e}), as intervals that share their ends do",
        stated[0],
        stated[1],
        stated[2],
        stated[0] - stated[1] - stated[2],
        if error < same { "exactly" } else { "not" }
    );
    let facts = numbers([
        ("frame_nJ_per_pixel", whole_nj),
        ("pass_nJ_per_pixel", drawing_nj),
        ("rest_nJ_per_pixel", rest_nj),
        ("relative_error", error),
        ("parts_relative_error", parts_error(frames)),
    ]);
    let made = with.row(&row.about, (ours, Verdict::NotYet, note));
    let row = Row { numbers: facts, ran: ran(recording, recording.truth.frames.len()), ..made };
    Done { row, figures: vec![figure(recording, idle_w)] }
}

/// Largest relative difference between the sum of a frame's parts and its power.
fn parts_error(frames: &[FramePower]) -> f64 {
    let error = |frame: &FramePower| {
        let drawn_j: f64 = frame.bins().map(|(length_s, watts)| length_s * watts.iter().sum::<f64>()).sum();
        (frame.energy().total_j() / drawn_j - 1.0).abs()
    };
    frames.iter().map(error).fold(0.0, f64::max)
}

/// Figure 1: measured power over two frames, idle taken off.
fn figure(recording: &Recording, idle_w: f64) -> Figure {
    let [first, second] =
        [0, 1].map(|place| &recording.truth.frames[recording.truth.frames.len() / 2 + place]);
    let above = |from_s: f64, to_s: f64| -> Vec<(f64, f64)> {
        let points = recording.points(from_s, to_s);
        points.into_iter().map(|(time_s, watts)| (from_s - first.start_s + time_s, watts - idle_w)).collect()
    };
    Figure::lines(
        "II_fig1",
        "Power of two frames (Paper II, Figure 1)",
        "forward rendering with 32 lights on the PC, mean idle power taken off",
        [TIME, POWER],
        vec![
            line("opaque pass", above(first.start_s, first.finish_s)),
            line("rest", above(first.finish_s, second.start_s)),
            line("opaque pass of the next frame", above(second.start_s, second.finish_s)),
            line("rest of the next frame", above(second.finish_s, second.end_s)),
        ],
    )
}

/// II-2: the mean of inverses is not the inverse of the mean.
fn inverses(with: &With<'_, Inverses>, recording: &Recording, frames: &Frames) -> Done {
    let same = *with.settings.same.get(with.form);
    let per_pixel: Vec<f64> = frames.found.iter().map(|frame| frame.energy_j / PIXELS).collect();
    let count = per_pixel.len() as f64;
    let wrong = per_pixel.iter().map(|joules| 1.0 / joules).sum::<f64>() / count;
    let right = count / per_pixel.iter().sum::<f64>();
    // The right one is that of the whole animation: all pixels over all joules.
    let from_s = frames.found.first().map_or(0.0, |frame| frame.start_s);
    let whole_j = PowerIntegral::new(&recording.trace).energy_j(from_s, frames.end_s);
    let whole = PIXELS * count / whole_j;
    let ours = format!(
        "mean of pixels/J {:.4} Mpixel/J (WRONG), 1 / mean of J/pixel {:.4} Mpixel/J, whole animation {:.4} Mpixel/J",
        wrong / 1e6,
        right / 1e6,
        whole / 1e6
    );
    let holds = wrong > right * (1.0 + same) && (right / whole - 1.0).abs() < same;
    let note = format!(
        "the mean of the inverses is {:.3} % too high; the inverse of the mean is that of the whole",
        100.0 * (wrong / right - 1.0)
    );
    let facts = numbers([
        ("mean_of_inverses_pixels_per_J", wrong),
        ("inverse_of_mean_pixels_per_J", right),
        ("whole_animation_pixels_per_J", whole),
    ]);
    let made = with.row(&with.settings.about, (ours, Verdict::of(holds), note));
    Done::bare(Row { numbers: facts, ran: ran(recording, frames.found.len()), ..made })
}

paper_settings!(Paper::Two, "paper2.ron" {
    work: Work,
    ii_1: Passes,
    ii_2: Inverses,
});

settings_group! {
    /// Recordings of both rows.
    Work {} {
        pc_frames: u32, within(1..=36);
        recorded_frames: usize, within(8..=10_000);
        seed: u64, within(0..=u64::MAX);
    }
}

row_settings! {
    Passes {
        frame_nj: f64, within(0.0..=1e9);
        g_buffer_nj: f64, within(0.0..=1e9);
        lighting_nj: f64, within(0.0..=1e9);
        same: f64, within(0.0..=1.0);
    }

    Inverses {
        same: f64, within(0.0..=1.0);
    }
}
