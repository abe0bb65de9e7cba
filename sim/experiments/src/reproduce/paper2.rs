//! Paper II, "Performance per What?".
//! Row II-1: energies of the passes of a deferred renderer add up to that of the frame.

use output::plot::Series;
use output::terminal::Progress;
use power_model::{Circumstances, FramePower};
use rayon::prelude::*;
use run::{JobFrame, RunError};
use traces::energy::PowerIntegral;
use workloads::Overrides;
use workloads::deferred::{Deferred, DeferredOptions, LightPass, NormalFormat};

use super::report::{POWER, TIME, line};
use super::row::{Cases, ClaimRow, NamedValue, Verdict, With, numbers, one_at_a_time};
use super::settings::{
    About, Form, RowSetting, SettingsOrigin, load, paper_settings, reduced, row_settings, settings_group,
};
use super::stage::{Frames, MARKED, Stage, TracedRun, looped};
use super::{Done, Figure, Paper, ReproduceOptions};

/// The ids of its rows.
pub(super) fn ids() -> Vec<&'static str> {
    vec!["II-1", "II-2"]
}

/// Pixels of the PC's image.
const PIXELS: f64 = 1280.0 * 720.0;

pub(super) fn rows(
    options: &ReproduceOptions,
    progress: &Progress,
) -> Result<(SettingsOrigin, Vec<Done>), RunError> {
    let (settings, origin) = load::<Settings>(options.settings.as_deref())?;
    let form = options.form();
    let (pc, less) = (Stage::pc()?, reduced(&settings.work, form));
    let seed = *settings.work.seed.get(form);
    let recorded = *settings.work.recorded_frames.get(form);
    let circumstances = Circumstances { launch: false, blocking_finish: false, seed };
    let mut done = Vec::new();
    if options.wants("II-1") {
        let with = With { settings: &settings.ii_1, form, sha256: &origin.sha256, shared_less: less.clone() };
        done.push(row(&with, &Bench { pc: &pc, recorded, circumstances }, progress)?);
    }
    if options.wants("II-2") {
        let frames = pc.pc_animation(*settings.work.pc_frames.get(form), progress)?;
        let run = TracedRun::new(&pc, &looped(&frames, recorded), pc.capped()?, circumstances)?;
        let with = With { settings: &settings.ii_2, form, sha256: &origin.sha256, shared_less: less };
        done.push(inverses(&with, &run, &run.find(MARKED)?));
    }
    Ok((origin, done))
}

/// Recorded frames.
fn ran(run: &TracedRun, found: usize) -> Vec<NamedValue> {
    numbers([
        ("frames_drawn", run.truth.frames.len() as f64),
        ("samples_recorded", run.trace.samples() as f64),
        ("frames_found", found as f64),
    ])
}

/// II-2: the mean of inverses is not the inverse of the mean.
fn inverses(with: &With<'_, Inverses>, run: &TracedRun, frames: &Frames) -> Done {
    let same = *with.settings.same.get(with.form);
    let per_pixel: Vec<f64> = frames.found.iter().map(|frame| frame.energy_j / PIXELS).collect();
    let count = per_pixel.len() as f64;
    let wrong = per_pixel.iter().map(|joules| 1.0 / joules).sum::<f64>() / count;
    let right = count / per_pixel.iter().sum::<f64>();
    // The right one is that of the whole animation: all pixels over all joules.
    let from_s = frames.found.first().map_or(0.0, |frame| frame.start_s);
    let whole_j = PowerIntegral::new(&run.trace).energy_j(from_s, frames.end_s);
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
    Done::bare(ClaimRow { numbers: facts, ran: ran(run, frames.found.len()), ..made })
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

/// The machine and its recordings.
struct Bench<'a> {
    pub pc: &'a Stage,
    /// Frames of a recording.
    pub recorded: usize,
    pub circumstances: Circumstances,
}

/// One value of every open setting.
#[derive(Clone, Debug, PartialEq)]
struct Point {
    lights: u32,
    lighting: LightPass,
    range: f32,
    normals: NormalFormat,
    size_px: (u32, u32),
}

impl Point {
    fn base(row: &Passes, form: Form) -> Self {
        Self {
            lights: *row.lights.get(form),
            lighting: *row.lighting.get(form),
            range: *row.range.get(form),
            normals: *row.normals.get(form),
            size_px: *row.size_px.get(form),
        }
    }

    fn pixels(&self) -> f64 {
        f64::from(self.size_px.0) * f64::from(self.size_px.1)
    }
}

/// Energies of frames with the mean idle power taken off as in the paper, J per pixel.
#[derive(Clone, Copy, Debug, Default)]
struct Split {
    g_buffer: f64,
    lighting: f64,
    /// Image, write-back, and what is above idle until the next frame.
    rest: f64,
    /// By the power over time from start to start.
    frame: f64,
    /// G-buffer and lighting between the ends of passes in the recording.
    stamped: [f64; 2],
    /// Share of the frame that is cut at the ends of passes, so that it adds up by construction.
    cut: f64,
}

impl Split {
    fn error(&self) -> f64 {
        ((self.g_buffer + self.lighting + self.rest) / self.frame - 1.0).abs()
    }

    fn scaled(self, by: f64) -> Self {
        let Self { g_buffer, lighting, rest, frame, stamped, cut } = self;
        Self {
            g_buffer: g_buffer * by,
            lighting: lighting * by,
            rest: rest * by,
            frame: frame * by,
            stamped: stamped.map(|part| part * by),
            cut: cut * by,
        }
    }
}

/// Frames of a point, their recording and their energies.
struct Measured {
    run: TracedRun,
    /// Ends of the G-buffer and the lighting pass of each drawn frame, s from its start.
    ends_s: Vec<[f64; 2]>,
    split: Split,
    invocations: f64,
}

impl Bench<'_> {
    fn measure(&self, row: &Passes, form: Form, point: &Point) -> Result<Measured, RunError> {
        let options = DeferredOptions {
            scene: row.scene.get(form).clone(),
            lights: point.lights,
            lighting: point.lighting,
            range: point.range,
            normals: point.normals,
            ..DeferredOptions::default()
        };
        let overrides =
            Overrides { size: Some(point.size_px), frame_rate_hz: Some(30.0), ..Overrides::default() };
        let job = Deferred::new(options, &overrides, 1)?;
        let numbers = (0..*row.drawn_frames.get(form)).into_par_iter();
        let frames = numbers.map(|number| self.pc.job_frame(&job, number));
        let frames = frames.collect::<Result<Vec<JobFrame>, RunError>>()?;
        let shown: Vec<&FramePower> =
            frames.iter().map(|frame| &frame.power).cycle().take(self.recorded).collect();
        let run = TracedRun::new(self.pc, &shown, self.pc.capped()?, self.circumstances)?;
        let split = self.split(&frames, &run).scaled(1.0 / point.pixels());
        let facts = frames.iter().flat_map(|frame| &frame.drawn.facts);
        let invocations =
            facts.filter(|fact| fact.name == "lighting_invocations").map(|fact| fact.value).sum();
        Ok(Measured { ends_s: frames.iter().map(ends_s).collect(), run, split, invocations })
    }

    /// Mean energies of the recorded frames.
    fn split(&self, frames: &[JobFrame], run: &TracedRun) -> Split {
        let idle_w = self.pc.platform.idle_w.value();
        let (truth, stamps) = (&run.truth, PowerIntegral::new(&run.trace));
        let mut split = Split::default();
        for (paced, frame) in truth.frames.iter().zip(frames.iter().cycle()) {
            let above = |joules: f64, from_s: f64, to_s: f64| joules - idle_w * (to_s - from_s);
            let whole = truth.curve.energy_j(paced.start_s, paced.end_s);
            split.frame += above(whole, paced.start_s, paced.end_s);
            // Between frames the machine draws idle power, and disturbances at any time.
            split.rest += paced.extra_j;
            for pass in &frame.passes {
                let part = match pass.name.as_str() {
                    "g-buffer" => &mut split.g_buffer,
                    "lighting" => &mut split.lighting,
                    _ => &mut split.rest,
                };
                *part += above(pass.total_j(), 0.0, pass.time_s);
                split.cut += above(pass.timed_j, 0.0, pass.time_s);
            }
            let [first, second] = ends_s(frame).map(|end_s| paced.start_s + end_s);
            for (stamped, [from_s, to_s]) in
                split.stamped.iter_mut().zip([[paced.start_s, first], [first, second]])
            {
                *stamped += above(stamps.energy_j(from_s, to_s), from_s, to_s);
            }
        }
        split.scaled(1.0 / truth.frames.len() as f64)
    }
}

/// Ends of the G-buffer and the lighting pass.
fn ends_s(frame: &JobFrame) -> [f64; 2] {
    ["g-buffer", "lighting"]
        .map(|name| frame.passes.iter().find(|pass| pass.name == name).map_or(0.0, |pass| pass.end_s))
}

/// Copies one setting from a point to another.
type Change<T> = fn(&mut Point, T);

/// The cases of a row.
struct Tried<'a> {
    bench: &'a Bench<'a>,
    row: &'a Passes,
    form: Form,
    cases: Cases,
    errors: Vec<f64>,
    invocations: f64,
}

impl Tried<'_> {
    fn along<T: Clone>(
        &mut self,
        setting: &'static str,
        values: &RowSetting<T>,
        name: fn(&T) -> String,
        change: Change<T>,
    ) -> Result<(), RunError> {
        let all = values.all(self.form);
        if all.len() < 2 {
            return Ok(());
        }
        let same = *self.row.same.get(self.form);
        let mut found = Vec::new();
        for value in all {
            let mut point = Point::base(self.row, self.form);
            change(&mut point, value.clone());
            let measured = self.bench.measure(self.row, self.form, &point)?;
            let error = measured.split.error();
            self.errors.push(error);
            self.invocations += measured.invocations;
            found.push((name(value), error / PER, error < same));
        }
        self.cases.along(setting, found).with_base(name(values.get(self.form)));
        Ok(())
    }
}

/// Unit of relative errors in the report.
const PER: f64 = 1e-15;

impl Tried<'_> {
    /// Every open setting, one at a time.
    fn sweep(&mut self, progress: &Progress) -> Result<(), RunError> {
        let (row, bar) = (self.row, progress.bar("deferred", 5));
        self.along("lights", &row.lights, u32::to_string, |point, value| point.lights = value)?;
        bar.inc();
        let name = |lighting: &LightPass| format!("{lighting:?}").to_lowercase();
        self.along("lighting", &row.lighting, name, |point, value| point.lighting = value)?;
        bar.inc();
        self.along("range", &row.range, f32::to_string, |point, value| point.range = value)?;
        bar.inc();
        let name = |normals: &NormalFormat| format!("{normals:?}").to_lowercase();
        self.along("normals", &row.normals, name, |point, value| point.normals = value)?;
        bar.inc();
        let size = |(width, height): &(u32, u32)| format!("{width}x{height}");
        self.along("size_px", &row.size_px, size, |point, value| point.size_px = value)?;
        bar.inc();
        Ok(())
    }
}

/// II-1.
fn row(with: &With<'_, Passes>, bench: &Bench<'_>, progress: &Progress) -> Result<Done, RunError> {
    let (row, form) = (with.settings, with.form);
    let cases = Cases::new("relative difference in 1e-15", "one at a time");
    let mut tried = Tried { bench, row, form, cases, errors: Vec::new(), invocations: 0.0 };
    let base = bench.measure(row, form, &Point::base(row, form))?;
    tried.sweep(progress)?;
    let [lights, lighting] = [row.lights.values(), row.lighting.values()];
    let full = [lights, lighting, row.range.values(), row.normals.values(), row.size_px.values()];
    let Tried { cases, errors, invocations, .. } = tried;
    let band = cases.band(one_at_a_time(full))?;
    let made = with.banded(&row.about, ours(&base.split, row, form), band);
    let largest = errors.iter().copied().fold(base.split.error(), f64::max);
    let ran = numbers([
        ("frames_recorded_per_case", base.run.truth.frames.len() as f64),
        ("cases", errors.len() as f64),
        ("lighting_invocations", base.invocations + invocations),
        ("samples_recorded", base.run.trace.samples() as f64),
    ]);
    let figure = figure(&base, bench.pc.platform.idle_w.value());
    Ok(Done { row: ClaimRow { numbers: facts(&base.split, largest), ran, ..made }, figures: vec![figure] })
}

fn ours(split: &Split, row: &Passes, form: Form) -> String {
    let [frame, g_buffer, lighting, rest] =
        [split.frame, split.g_buffer, split.lighting, split.rest].map(|part| 1e9 * part);
    let [whole, first, second] = [&row.frame_nj, &row.g_buffer_nj, &row.lighting_nj].map(|nj| *nj.get(form));
    format!(
        "{frame:.1} = {g_buffer:.1} + {lighting:.1} + {rest:.1} nJ/pixel (paper {whole} = {first} + {second} + {}), off by {:.1e}",
        whole - first - second,
        split.error()
    )
}

fn facts(split: &Split, largest: f64) -> Vec<NamedValue> {
    numbers([
        ("frame_nJ_per_pixel", 1e9 * split.frame),
        ("g_buffer_nJ_per_pixel", 1e9 * split.g_buffer),
        ("lighting_nJ_per_pixel", 1e9 * split.lighting),
        ("rest_nJ_per_pixel", 1e9 * split.rest),
        ("g_buffer_by_time_stamps_nJ_per_pixel", 1e9 * split.stamped[0]),
        ("lighting_by_time_stamps_nJ_per_pixel", 1e9 * split.stamped[1]),
        ("share_cut_at_ends_of_passes", split.cut / split.frame),
        ("relative_difference", split.error()),
        ("largest_relative_difference", largest),
    ])
}

/// Figure 1: measured power over two frames, idle taken off.
fn figure(measured: &Measured, idle_w: f64) -> Figure {
    let (run, ends_s) = (&measured.run, &measured.ends_s);
    let middle = run.truth.frames.len() / 2;
    let origin_s = run.truth.frames[middle].start_s;
    let above = |name: &str, from_s: f64, to_s: f64| -> Series {
        let points = run.points(from_s, to_s).into_iter();
        line(name, points.map(|(time_s, watts)| (from_s - origin_s + time_s, watts - idle_w)).collect())
    };
    let of_frame = |place: usize| {
        let paced = &run.truth.frames[place];
        let [first, second] = ends_s[place % ends_s.len()].map(|end_s| paced.start_s + end_s);
        let of = if place == middle { "" } else { " of the next frame" };
        [
            above(&format!("G-buffer{of}"), paced.start_s, first),
            above(&format!("lighting{of}"), first, second),
            above(&format!("rest{of}"), second, paced.end_s),
        ]
    };
    Figure::lines(
        "II_fig1",
        "Power of two frames (Paper II, Figure 1)",
        "deferred rendering on the PC, mean idle power taken off",
        [TIME, POWER],
        [middle, middle + 1].into_iter().flat_map(of_frame).collect(),
    )
}
