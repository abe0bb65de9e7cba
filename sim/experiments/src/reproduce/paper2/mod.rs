//! Paper II, "Performance per What?".

mod passes;

use output::progress::Progress;
use power_model::Circumstances;
use run::RunError;
use traces::energy::PowerIntegral;
use workloads::deferred::{LightPass, NormalFormat};

use super::row::{Number, Row, With, numbers};
use super::settings::{About, Origin, Setting, load, paper_settings, reduced, row_settings, settings_group};
use super::stage::{Frames, MARKED, Recording, Stage, looped};
use super::verdict::Verdict;
use super::{Done, Options, Paper};
use passes::Bench;

/// The ids of its rows.
pub(super) fn ids() -> Vec<&'static str> {
    vec!["II-1", "II-2"]
}

/// Pixels of the PC's image.
const PIXELS: f64 = 1280.0 * 720.0;

pub(super) fn rows(options: &Options, progress: &Progress) -> Result<(Origin, Vec<Done>), RunError> {
    let (settings, origin) = load::<Settings>(options.settings.as_deref())?;
    let form = options.form();
    let (pc, less) = (Stage::pc()?, reduced(&settings.work, form));
    let seed = *settings.work.seed.get(form);
    let recorded = *settings.work.recorded_frames.get(form);
    let circumstances = Circumstances { launch: false, blocking_finish: false, seed };
    let mut done = Vec::new();
    if options.wants("II-1") {
        let with = With { settings: &settings.ii_1, form, sha256: &origin.sha256, shared_less: less.clone() };
        done.push(passes::row(&with, &Bench { pc: &pc, recorded, circumstances }, progress)?);
    }
    if options.wants("II-2") {
        let frames = pc.pc_animation(*settings.work.pc_frames.get(form), progress)?;
        let recording = Recording::new(&pc, &looped(&frames, recorded), pc.capped()?, circumstances)?;
        let with = With { settings: &settings.ii_2, form, sha256: &origin.sha256, shared_less: less };
        done.push(inverses(&with, &recording, &recording.find(MARKED)?));
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
        lights: u32, within(0..=4096);
        lighting: LightPass, must(|_| true, "screen or volumes");
        range: f32, within(1e-3..=1e3);
        normals: NormalFormat, must(|_| true, "rgba16f or rgba8");
        size_px: (u32, u32), must(
            |(width, height)| [width, height].iter().all(|side| (8..=4096).contains(*side)),
            "8 to 4096 each"
        );
        scene: String, must(|name| !name.is_empty(), "the name of a scene, or a file");
        drawn_frames: u32, within(1..=36);
        same: f64, within(0.0..=1.0);
    }

    Inverses {
        same: f64, within(0.0..=1.0);
    }
}
