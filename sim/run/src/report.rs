//! Contents of the report of a run, and its plots.

use activity::{Event, Unit};
use glam::Vec3;
use output::MeanSd;
use output::image::LinearImage;
use output::plot::{
    FrameEnergyPlot, FrameEnergyPoint, FramePowerPlot, Picture, PowerPart, PowerRun, UnitLane, UnitPlot,
    part_colour,
};
use output::report::{
    CounterRow, FactRow, FileLink, FrameNumbers, PartRow, PassRow, ReportFrame, ReportImage, ReportPlot,
    RunReport, UnitRow, WarningRow, WorkRow,
};
use output::table::{count_or_digits, grouped, shell_line, si};
use power_model::{Bound, Part};
use warnings::Warning;
use workloads::scene::CameraUsed;

use crate::dry_run::area_text;
use crate::frame::image_name;
use crate::passes::{stall_picture, waited_for};
use crate::summary::SettingsSummary;
use crate::{FinishedRun, HeatQuantity, Host, Input, PassSummary, Plan, RunError, RunFrame, WorkSummary};

/// Largest number of draws of a pass in the report; all are in the summary.
const MAX_DRAWS: usize = 48;

/// Collects the contents of the report.
pub(super) fn report<'a>(outcome: &'a FinishedRun, plots: &[Plot]) -> Result<RunReport<'a>, RunError> {
    let plan = &outcome.plan;
    Ok(RunReport {
        title: format!("{} on {}", plan.name, plan.gpu.name).into(),
        facts: facts(outcome),
        warnings: warnings(&outcome.summary.warnings),
        headline: outcome.summary.headline(),
        images: images(plan, &outcome.simulated.pictures)?.into_iter().chain(heat(outcome)).collect(),
        plots: plots.iter().map(plot).collect::<Result<_, _>>()?,
        parts: parts(outcome),
        frames: frames(outcome),
        pixels: plan.pixels(),
        passes: passes(outcome),
        units: units(outcome),
        counters: counters(outcome),
        settings: settings(outcome),
        inputs: inputs(&outcome.summary.inputs),
        files: files(outcome),
        host: host(&outcome.summary.host),
    })
}

pub(super) fn warnings(all: &[Warning]) -> Vec<WarningRow> {
    let row = |w: &Warning| WarningRow {
        code: w.code.name().to_owned(),
        message: w.message.clone(),
        details: w.details.clone(),
    };
    all.iter().map(row).collect()
}

/// The first, the middle and the last image of a run.
pub(super) fn images(plan: &Plan, pictures: &[(u32, Vec<Vec3>)]) -> Result<Vec<ReportImage>, RunError> {
    let viewport = plan.viewport;
    let mut pictures: Vec<_> = pictures.iter().collect();
    // The middle image comes first and large; the others follow in order as thumbnails.
    let middle = pictures.len() / 2;
    pictures[..=middle].rotate_right(1);
    let shown = plan.job.shows();
    let first = |number: u32| match shown {
        "" => format!("frame {number}"),
        shown => format!("frame {number}: {shown}"),
    };
    pictures
        .into_iter()
        .enumerate()
        .map(|(place, (number, image))| {
            let pixels: Vec<[f32; 3]> = image.iter().map(Vec3::to_array).collect();
            let linear = LinearImage::new(viewport.width(), viewport.height(), &pixels)?;
            Ok(ReportImage {
                caption: if place == 0 { first(*number) } else { format!("frame {number}") },
                png: linear.thumbnail_png(if place == 0 { 1280 } else { 320 })?,
                link: Some(format!("{}.png", image_name(*number))),
            })
        })
        .collect()
}

fn heat(outcome: &FinishedRun) -> impl Iterator<Item = ReportImage> {
    outcome.simulated.heat.iter().map(|map| ReportImage {
        caption: {
            let place = match &map.request.pass {
                Some(pass) => format!("pass {pass} of frame {}", map.frame),
                None => format!("frame {}", map.frame),
            };
            match map.request.quantity {
                HeatQuantity::Event(event) => {
                    format!("where in {place} the counter {} counted", event.name())
                }
                HeatQuantity::Joules => format!("where in {place} the energy of events was used"),
            }
        },
        png: map.png.clone(),
        link: Some(format!("{}.png", map.request.path(map.frame))),
    })
}

fn plot(plot: &Plot) -> Result<ReportPlot, RunError> {
    let (caption, stem) = (plot.caption.clone(), Some(plot.stem.to_owned()));
    Ok(ReportPlot { caption, svg: plot.picture.svg()?, stem })
}

fn parts(outcome: &FinishedRun) -> Vec<PartRow> {
    let energy = outcome.measurement.run.energy();
    let row = |part: Part| PartRow {
        name: part.name().to_owned(),
        doc: part.doc().to_owned(),
        colour: part_colour(part).css(),
        idle: part == Part::Idle,
        energy_j: energy[part],
    };
    parts_in_use(outcome).into_iter().map(row).collect()
}

fn frames(outcome: &FinishedRun) -> Vec<ReportFrame> {
    let rows = outcome.summary.frames.iter().zip(outcome.measurement.by_true_frame());
    rows.map(|(row, measured)| ReportFrame {
        frame: u64::from(row.frame),
        start_s: row.start_s,
        busy_s: Some(row.busy_s),
        measured: measured.map(|m| FrameNumbers {
            time_s: m.duration_s(),
            energy_j: m.energy_j,
            power_w: m.power_w(),
        }),
        truth: Some(FrameNumbers { time_s: row.duration_s, energy_j: row.energy_j, power_w: row.power_w }),
        flags: frame_flags(row.predicted, measured.map_or("missed".to_owned(), |m| m.flags.to_string())),
    })
    .collect()
}

fn frame_flags(predicted: bool, flags: String) -> String {
    match (predicted, flags.is_empty()) {
        (false, _) => flags,
        (true, true) => "predicted".to_owned(),
        (true, false) => format!("predicted, {flags}"),
    }
}

fn passes(outcome: &FinishedRun) -> Vec<PassRow> {
    let rows = &outcome.summary.passes;
    let time_s: f64 = rows.iter().map(|pass| pass.all.time_s).sum();
    let energy_j: f64 = rows.iter().map(|pass| pass.all.energy_j).sum();
    let work = |work: &WorkSummary| WorkRow {
        time_s: work.time_s,
        time_share: work.time_s / time_s,
        energy_j: work.energy_j,
        energy_share: work.energy_j / energy_j,
        dram_bytes: work.dram_bytes,
        waits: waited_for(&work.stalls)
            .into_iter()
            .map(|(unit, share)| format!("{unit} {:.0} %", 100.0 * share))
            .collect::<Vec<_>>()
            .join(", "),
    };
    let row = |pass: &PassSummary| PassRow {
        name: named(pass),
        passes: pass.passes,
        all: work(&pass.all),
        draws: if pass.draws.len() <= MAX_DRAWS { pass.draws.iter().map(work).collect() } else { Vec::new() },
        others: pass.others.as_ref().map(work),
    };
    rows.iter().map(row).collect()
}

/// Name of a pass, with the number of its draws if none is listed.
fn named(pass: &PassSummary) -> String {
    let unlisted = if pass.draws.len() > MAX_DRAWS { pass.draws.len() as u64 } else { pass.unlisted_draws };
    if unlisted > 0 { format!("{} ({unlisted} draws)", pass.name) } else { pass.name.clone() }
}

fn units(outcome: &FinishedRun) -> Vec<UnitRow> {
    let busy = &outcome.summary.unit_busy;
    let row = |unit: Unit| {
        let share = busy.get(unit.name()).copied();
        UnitRow {
            name: unit.name().to_owned(),
            doc: unit.doc().to_owned(),
            busy: share,
            modelled: share.is_some(),
            note: if share.is_some() { "" } else { "not used by the scene" }.to_owned(),
        }
    };
    let is_listed = |unit: &Unit| !unit.is_optional() || busy.contains_key(unit.name());
    Unit::ALL.into_iter().filter(is_listed).map(row).collect()
}

fn counters(outcome: &FinishedRun) -> Vec<CounterRow> {
    let frames = outcome.simulated.known().count().max(1) as f64;
    let pixels = outcome.plan.pixels() as f64;
    let row = |(event, total): (Event, u64)| {
        let per_frame = total as f64 / frames;
        CounterRow {
            unit: event.unit().name().to_owned(),
            name: event.name().to_owned(),
            doc: event.doc().to_owned(),
            total,
            per_frame,
            per_pixel: per_frame / pixels,
        }
    };
    outcome.summary.counts.reported().map(row).collect()
}

/// Facts below the heading: scene, hardware, model, limits.
fn facts(outcome: &FinishedRun) -> Vec<FactRow> {
    let (plan, summary) = (&outcome.plan, &outcome.summary);
    let mut facts = vec![
        FactRow::new("scene", plan.name.clone()),
        FactRow::new("triangles", grouped(summary.settings.triangles as u64)),
        FactRow::new("GPU", format!("{}: {}", plan.gpu.name, plan.gpu.doc)),
        FactRow::new("platform", format!("{}: {}", plan.platform.name, plan.platform.doc)),
        FactRow::new("energy table", format!("{}, {}", plan.table.name(), bound(plan.options.bound))),
        FactRow::new("area", area_text(&summary.hardware.area_mm2)),
        FactRow::new("modelled", summary.modelled.line()),
        FactRow::new("limits", summary.modelled.limits.join("; ")),
        FactRow::new("counts hash", summary.counts_hash.clone()),
        FactRow::new("Quintile", summary.version),
    ];
    let found = |(&name, value): (&&'static str, &f64)| FactRow::new(name, count_or_digits(*value));
    facts.extend(summary.facts.iter().map(found));
    facts.extend(summary.accuracy_rows().into_iter().map(|(name, value)| FactRow::new(name, value)));
    facts
}

fn bound(bound: Bound) -> &'static str {
    match bound {
        Bound::Low => "low values",
        Bound::Nominal => "nominal values",
        Bound::High => "high values",
    }
}

/// Settings in use.
fn settings(outcome: &FinishedRun) -> Vec<FactRow> {
    let settings = &outcome.summary.settings;
    let device = outcome.measurement.device.spec();
    let mut rows = view(&outcome.plan, settings, outcome.summary.camera.as_ref());
    rows.extend([
        FactRow::new("pacing", outcome.plan.options.pacing.name()),
        FactRow::new(
            "recorder",
            format!(
                "{}: {}, {} bits, ±{} A, ±{} V",
                device.name,
                si(device.rate_hz, "Hz"),
                device.bits,
                device.current_range_a[1],
                device.voltage_range_v[1]
            ),
        ),
        FactRow::new("seed", settings.seed.to_string()),
    ]);
    rows
}

/// Settings of image, frames and camera.
pub(super) fn view(
    plan: &Plan,
    settings: &SettingsSummary,
    camera_used: Option<&CameraUsed>,
) -> Vec<FactRow> {
    let mut rows = vec![
        FactRow::new("size", format!("{}x{} pixels", settings.width, settings.height)),
        FactRow::new("samples per pixel", settings.samples.to_string()),
        FactRow::new("sample table", settings.table.clone()),
        FactRow::new("frames", frame_range(plan)),
        FactRow::new("frame rate", si(settings.frame_rate_hz, "Hz")),
        FactRow::new("shutter", format!("{} of the frame period", settings.shutter)),
    ];
    rows.extend(settings.clip.as_ref().map(|clip| FactRow::new("animation clip", clip.clone())));
    rows.extend(camera(plan, settings, camera_used));
    rows
}

/// Camera of the first frame; for a workload without a scene only the lens.
fn camera(plan: &Plan, settings: &SettingsSummary, camera: Option<&CameraUsed>) -> Vec<FactRow> {
    let lens = |radius: f32| match radius > 0.0 {
        true => format!("radius {radius} scene units"),
        false => "none: a pinhole".to_owned(),
    };
    let Some(camera) = camera else {
        return vec![FactRow::new("lens", lens(settings.lens_radius))];
    };
    let vector = |[x, y, z]: [f64; 3]| format!("({x}, {y}, {z})");
    let view = match (camera.fov_deg, camera.view_height) {
        (Some(degrees), _) => format!("{degrees:.3} degrees high"),
        (None, height) => format!("{} scene units high, orthographic", height.unwrap_or_default()),
    };
    let note = |row: FactRow, note: &str| FactRow { note: note.to_owned(), ..row };
    let given = plan.job.settings().focus.is_some();
    vec![
        note(
            FactRow::new("camera position", vector(camera.position)),
            if camera.moves { "when the first frame begins" } else { "" },
        ),
        FactRow::new("camera looks along", vector(camera.direction)),
        FactRow::new("camera's up", vector(camera.up)),
        note(FactRow::new("camera", camera.source.to_string()), &format!("--camera '{}'", camera.ron)),
        FactRow::new("view", view),
        FactRow::new("lens", lens(camera.lens_radius)),
        note(
            FactRow::new("focus", format!("depth {} scene units", camera.focus)),
            if given { "" } else { "found automatically" },
        ),
    ]
}

/// Input files.
pub(super) fn inputs(all: &[Input]) -> Vec<FactRow> {
    let row = |input: &Input| FactRow {
        name: input.path.clone(),
        value: input.sha256.clone().unwrap_or_else(|| "missing".to_owned()),
        note: input.bytes.map_or(String::new(), |bytes| format!("{} bytes", grouped(bytes))),
    };
    all.iter().map(row).collect()
}

/// Program, command line and host.
pub(super) fn host(host: &Host) -> Vec<FactRow> {
    let Host { command, directory, revision, threads, cores, cpu, system, architecture } = host;
    let unknown = || "unknown".to_owned();
    vec![
        FactRow::new("command", shell_line(command)),
        FactRow::new("directory", directory.clone()),
        FactRow::new("git revision", revision.clone().unwrap_or_else(unknown)),
        FactRow::new("worker threads", threads.to_string()),
        FactRow::new("processor", cpu.clone().unwrap_or_else(unknown)),
        FactRow::new("cores", cores.to_string()),
        FactRow::new("system", format!("{system}, {architecture}")),
    ]
}

fn frame_range(plan: &Plan) -> String {
    let frames = &plan.job.settings().frames;
    format!("{} ({}..{})", frames.end - frames.start, frames.start, frames.end)
}

/// Files beside the report, with descriptions.
fn files(outcome: &FinishedRun) -> Vec<FileLink> {
    let heat = [(
        "heat/",
        "where in each frame counters counted, or energy was used: pictures, values of the pixels and of the tiles",
    )];
    let heat = heat.into_iter().filter(|_| !outcome.simulated.heat.is_empty());
    [
        ("summary.json", "every number of this page, for scripts"),
        ("frames.csv", "energy of each found frame, with the truth beside it"),
        ("trace.parquet", "the recorded trace: time, voltage, current"),
        ("trace.csv", "the same as text"),
        ("timeline.perfetto-trace", "units and power over time, for ui.perfetto.dev"),
        ("images/", "every frame that was simulated"),
        ("plots/", "the plots as SVG and PNG"),
        ("manifest.json", "these files with their sizes and hashes"),
    ]
    .into_iter()
    .chain(heat)
    .map(|(path, what)| FileLink { path: path.to_owned(), what: what.to_owned() })
    .collect()
}

/// A plot with its file name and caption.
pub(super) struct Plot {
    pub stem: &'static str,
    pub caption: String,
    pub picture: Picture,
}

/// All plots of a run.
pub(super) fn plots(outcome: &FinishedRun) -> Vec<Plot> {
    let subject = format!("{} on {}", outcome.plan.name, outcome.plan.gpu.name);
    let shown = shown_frame(outcome);
    let mut plots = vec![
        Plot {
            stem: "plots/power_run",
            caption: "Power over the run as recorded, lowest and highest sample of each column, with the frame starts \
                      found from the marked window and the true ones. Idle time before and after the frames is left out."
                .to_owned(),
            picture: power_run(outcome, &subject),
        },
        Plot {
            stem: "plots/frame_power",
            caption: format!(
                "Frame {}: power by part as the simulator knows it, dots are the recorded samples.",
                shown.1.index
            ),
            picture: frame_power(outcome, &subject, shown),
        },
        Plot {
            stem: "plots/unit_busy",
            caption: format!("Frame {}: how busy each unit is.", shown.1.index),
            picture: unit_busy(outcome, &subject, shown.1),
        },
        Plot {
            stem: "plots/frame_energy",
            caption: "Energy of each frame, start to start: measured in the trace and true.".to_owned(),
            picture: frame_energy(outcome, &subject),
        },
    ];
    plots.extend(stall_picture(shown.1, &subject, &outcome.plan.options.plot_style).map(|picture| Plot {
        stem: "plots/stalls",
        caption: format!("Frame {}: what each unit waited for, and which held it up.", shown.1.index),
        picture,
    }));
    plots
}

/// Frame shown in detail: the simulated frame nearest to the marked one, and its index in the run.
fn shown_frame(outcome: &FinishedRun) -> (usize, &RunFrame) {
    let middle = outcome.simulated.frames.len() / 2;
    let known = outcome.simulated.in_order().enumerate().filter(|(_, frame)| frame.observed().is_some());
    let (place, frame) =
        known.min_by_key(|(place, _)| place.abs_diff(middle)).unwrap_or((0, &outcome.simulated.distinct[0]));
    (place, frame)
}

fn power_run(outcome: &FinishedRun, subject: &str) -> Picture {
    let measurement = &outcome.measurement;
    let power: Vec<f64> = measurement.trace.powers_w().collect();
    let found: Vec<f64> = measurement.found.starts.iter().map(|start| start.time_s).collect();
    let truth: Vec<f64> = measurement.truth.iter().map(|frame| frame.start_s).collect();
    let (mark, window) = (measurement.marks.starts_s[0], measurement.found.window);
    PowerRun {
        subject,
        rate_hz: measurement.trace.rate_hz(),
        start_s: measurement.trace.start_s(),
        power_w: &power,
        found_starts_s: &found,
        true_starts_s: &truth,
        mark_s: Some((mark - window.pre_s, mark + window.post_s)),
    }
    .picture(&outcome.plan.options.plot_style)
}

/// Parts that consumed energy, in the order of all plots: overhead first, then units.
fn parts_in_use(outcome: &FinishedRun) -> Vec<Part> {
    let energy = outcome.measurement.run.energy();
    let (units, overhead): (Vec<Part>, Vec<Part>) = Part::ALL
        .into_iter()
        .filter(|part| energy[*part] > 0.0)
        .partition(|part| matches!(part, Part::Unit(_)));
    overhead.into_iter().chain(units).collect()
}

fn frame_power(outcome: &FinishedRun, subject: &str, (place, frame): (usize, &RunFrame)) -> Picture {
    let trace = &outcome.measurement.trace;
    let paced = &outcome.measurement.run.frames[place];
    let samples: Vec<(f64, f64)> = (0..trace.samples())
        .map(|index| (trace.time_s(index) + 0.5 * trace.period_s() - paced.start_s, trace.power_w(index)))
        .filter(|(time_s, _)| (0.0..paced.busy_end_s - paced.start_s).contains(time_s))
        .collect();
    let watts = frame.power.watts();
    let parts = parts_in_use(outcome).into_iter().filter(|part| *part != Part::Idle);
    FramePowerPlot {
        subject,
        frame: u64::from(frame.index),
        bin_s: frame.power.bin_s(),
        parts: parts
            .map(|part| PowerPart { part, power_w: watts.iter().map(|bin| bin[part.index()]).collect() })
            .collect(),
        samples: &samples,
        frame_j: outcome.summary.frames.get(place).map(|row| row.energy_j),
    }
    .picture(&outcome.plan.options.plot_style)
}

fn unit_busy(outcome: &FinishedRun, subject: &str, frame: &RunFrame) -> Picture {
    let total = outcome.simulated.total();
    let lane = |unit: Unit| UnitLane {
        name: unit.name(),
        busy: frame.busy.iter().map(|shares| f64::from(shares[unit as usize])).collect(),
    };
    UnitPlot {
        subject,
        frame: u64::from(frame.index),
        bin_s: frame.power.bin_s(),
        units: Unit::ALL.into_iter().filter(|&unit| total.uses(unit)).map(lane).collect(),
    }
    .picture(&outcome.plan.options.plot_style)
}

fn frame_energy(outcome: &FinishedRun, subject: &str) -> Picture {
    let frames: Vec<FrameEnergyPoint> = outcome
        .summary
        .frames
        .iter()
        .map(|row| FrameEnergyPoint {
            frame: u64::from(row.frame),
            measured_j: row.measured_energy_j,
            true_j: Some(row.energy_j),
        })
        .collect();
    FrameEnergyPlot {
        subject,
        frames: &frames,
        measured_j: MeanSd::of(outcome.measurement.frames.iter().map(|frame| frame.energy_j)),
        pixels: outcome.plan.pixels(),
    }
    .picture(&outcome.plan.options.plot_style)
}
