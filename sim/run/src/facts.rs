//! The facts of a run in words, for the report.

use power_model::Bound;

use super::{Host, Input, Outcome, Plan};
use output::report::{FactRow, FileLink};
use output::table::{count_or_digits, grouped, shell_line, si};

/// What was run.
pub(super) fn facts(outcome: &Outcome) -> Vec<FactRow> {
    let (plan, summary) = (&outcome.plan, &outcome.summary);
    let mut facts = vec![
        FactRow::new("scene", plan.work.name()),
        FactRow::new("triangles", grouped(summary.settings.triangles as u64)),
        FactRow::new("GPU", format!("{}: {}", plan.gpu.name, plan.gpu.doc)),
        FactRow::new("platform", format!("{}: {}", plan.platform.name, plan.platform.doc)),
        FactRow::new("energy table", format!("{}, {}", plan.table.name(), bound(plan.options.bound))),
        FactRow::new("modelled", summary.modelled.line()),
        FactRow::new("limits", summary.modelled.limits.join("; ")),
        FactRow::new("counts hash", summary.counts_hash.clone()),
        FactRow::new("Quintile", summary.version),
    ];
    let found = |(&name, value): (&&'static str, &f64)| FactRow::new(name, count_or_digits(*value));
    facts.extend(summary.facts.iter().map(found));
    facts.extend(summary.judgement().into_iter().map(|(name, value)| FactRow::new(name, value)));
    facts
}

fn bound(bound: Bound) -> &'static str {
    match bound {
        Bound::Low => "low values",
        Bound::Nominal => "nominal values",
        Bound::High => "high values",
    }
}

/// Settings as they came to be.
pub(super) fn settings(outcome: &Outcome) -> Vec<FactRow> {
    let settings = &outcome.summary.settings;
    let device = outcome.measurement.device.spec();
    let mut rows = vec![
        FactRow::new("size", format!("{}x{} pixels", settings.width, settings.height)),
        FactRow::new("samples per pixel", settings.samples.to_string()),
        FactRow::new("sample table", settings.table.clone()),
        FactRow::new("frames", frames(&outcome.plan)),
        FactRow::new("frame rate", si(settings.frame_rate_hz, "Hz")),
        FactRow::new("shutter", format!("{} of the frame period", settings.shutter)),
    ];
    rows.extend(settings.clip.as_ref().map(|clip| FactRow::new("animation clip", clip.clone())));
    rows.extend(camera(outcome));
    rows.extend([
        FactRow::new("pacing", settings.pacing),
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

/// The camera of the first frame; of a workload, which has its own, the lens.
fn camera(outcome: &Outcome) -> Vec<FactRow> {
    let lens = |radius: f32| match radius > 0.0 {
        true => format!("radius {radius} scene units"),
        false => "none: a pinhole".to_owned(),
    };
    let Some(camera) = &outcome.summary.camera else {
        return vec![FactRow::new("lens", lens(outcome.summary.settings.lens_radius))];
    };
    let vector = |[x, y, z]: [f64; 3]| format!("({x}, {y}, {z})");
    let view = match (camera.fov_deg, camera.view_height) {
        (Some(degrees), _) => format!("{degrees:.3} degrees high"),
        (None, height) => format!("{} scene units high, orthographic", height.unwrap_or_default()),
    };
    let note = |row: FactRow, note: &str| FactRow { note: note.to_owned(), ..row };
    let given = outcome.plan.work.settings().focus.is_some();
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

/// The files that the run was made from.
pub(super) fn inputs(outcome: &Outcome) -> Vec<FactRow> {
    let row = |input: &Input| FactRow {
        name: input.path.clone(),
        value: input.sha256.clone().unwrap_or_else(|| "missing".to_owned()),
        note: input.bytes.map_or(String::new(), |bytes| format!("{} bytes", grouped(bytes))),
    };
    outcome.summary.inputs.iter().map(row).collect()
}

/// The program, the call and the machine.
pub(super) fn host(outcome: &Outcome) -> Vec<FactRow> {
    let Host { command, directory, revision, threads, cores, cpu, system, architecture } =
        &outcome.summary.host;
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

fn frames(plan: &Plan) -> String {
    let frames = &plan.work.settings().frames;
    format!("{} ({}..{})", frames.end - frames.start, frames.start, frames.end)
}

/// The files beside the report.
pub(super) fn files(outcome: &Outcome) -> Vec<FileLink> {
    let heat = [(
        "heat/",
        "where in each frame counters counted: pictures, values of the pixels, counts of the tiles",
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
