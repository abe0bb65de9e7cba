//! The facts of a run in words, for the report.

use power_model::Bound;

use super::{Outcome, Plan};
use crate::output::report::{FactRow, FileLink};
use crate::output::table::{digits, grouped, si};

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
    let found = |(&name, value): (&&'static str, &f64)| FactRow::new(name, digits(*value));
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
    let focus =
        settings.focus.map_or("the scene's centre".to_owned(), |focus| format!("{focus} scene units"));
    vec![
        FactRow::new("size", format!("{}x{} pixels", settings.width, settings.height)),
        FactRow::new("samples per pixel", settings.samples.to_string()),
        FactRow::new("sample table", outcome.plan.work.settings().table.clone()),
        FactRow::new("frames", frames(&outcome.plan)),
        FactRow::new("frame rate", si(settings.frame_rate_hz, "Hz")),
        FactRow::new("shutter", format!("{} of the frame period", settings.shutter)),
        FactRow::new("lens radius", format!("{} scene units", settings.lens_radius)),
        FactRow::new("focus", if settings.lens_radius > 0.0 { focus } else { "pinhole".to_owned() }),
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
    ]
    .into_iter()
    .chain(heat)
    .map(|(path, what)| FileLink { path: path.to_owned(), what: what.to_owned() })
    .collect()
}
