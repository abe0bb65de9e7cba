//! The report of a run.

use activity::{Event, Unit};
use glam::Vec3;
use power_model::Part;

use super::frame::image_name;
use super::heat::heat_name;
use super::pictures::{Plot, parts_in_use};
use super::{Outcome, RunError, facts};
use output::image::LinearImage;
use output::plot::part_colour;
use output::report::{
    CounterRow, FrameNumbers, FrameRow, PartRow, Report, ReportImage, ReportPlot, UnitRow, WarningRow,
};

/// Fills the report.
pub(super) fn report<'a>(outcome: &'a Outcome, plots: &[Plot]) -> Result<Report<'a>, RunError> {
    let plan = &outcome.plan;
    Ok(Report {
        title: format!("{} on {}", plan.work.name(), plan.gpu.name).into(),
        facts: facts::facts(outcome),
        warnings: warnings(outcome),
        headline: outcome.summary.headline(),
        images: images(outcome)?.into_iter().chain(heat(outcome)).collect(),
        plots: plots.iter().map(plot).collect::<Result<_, _>>()?,
        parts: parts(outcome),
        frames: frames(outcome),
        pixels: plan.pixels(),
        units: units(outcome),
        counters: counters(outcome),
        settings: facts::settings(outcome),
        inputs: facts::inputs(outcome),
        files: facts::files(outcome),
        host: facts::host(outcome),
    })
}

fn warnings(outcome: &Outcome) -> Vec<WarningRow> {
    let row = |w: &warnings::Warning| WarningRow {
        code: w.code.name().to_owned(),
        message: w.message.clone(),
        details: w.details.clone(),
    };
    outcome.summary.warnings.iter().map(row).collect()
}

fn images(outcome: &Outcome) -> Result<Vec<ReportImage>, RunError> {
    let viewport = outcome.plan.viewport;
    let mut pictures: Vec<_> = outcome.simulated.pictures.iter().collect();
    // The middle one first, large; the others in order as thumbnails.
    let middle = pictures.len() / 2;
    pictures[..=middle].rotate_right(1);
    let shown = outcome.plan.work.shows();
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

fn heat(outcome: &Outcome) -> impl Iterator<Item = ReportImage> {
    outcome.simulated.heat.iter().map(|map| ReportImage {
        caption: format!("where in frame {} the counter {} counted", map.frame, map.event.name()),
        png: map.png.clone(),
        link: Some(format!("{}.png", heat_name(map.event, map.frame))),
    })
}

fn plot(plot: &Plot) -> Result<ReportPlot, RunError> {
    let (caption, stem) = (plot.caption.clone(), Some(plot.stem.to_owned()));
    Ok(ReportPlot { caption, svg: plot.picture.svg()?, stem })
}

fn parts(outcome: &Outcome) -> Vec<PartRow> {
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

fn frames(outcome: &Outcome) -> Vec<FrameRow> {
    let rows = outcome.summary.frames.iter().zip(outcome.measurement.by_true_frame());
    rows.map(|(row, measured)| FrameRow {
        frame: u64::from(row.frame),
        start_s: row.start_s,
        busy_s: Some(row.busy_s),
        measured: measured.map(|m| FrameNumbers {
            time_s: m.duration_s(),
            energy_j: m.energy_j,
            power_w: m.power_w(),
        }),
        truth: Some(FrameNumbers { time_s: row.duration_s, energy_j: row.energy_j, power_w: row.power_w }),
        flags: remarks(row.predicted, measured.map_or("missed".to_owned(), |m| m.flags.to_string())),
    })
    .collect()
}

fn remarks(predicted: bool, flags: String) -> String {
    match (predicted, flags.is_empty()) {
        (false, _) => flags,
        (true, true) => "predicted".to_owned(),
        (true, false) => format!("predicted, {flags}"),
    }
}

fn units(outcome: &Outcome) -> Vec<UnitRow> {
    let busy = &outcome.summary.unit_busy;
    let row = |unit: Unit| {
        let share = busy.get(unit.name()).copied();
        UnitRow {
            name: unit.name().to_owned(),
            doc: unit.doc().to_owned(),
            busy: share,
            modelled: share.is_some(),
            note: if share.is_some() { "" } else { "nothing in the scene asks for it" }.to_owned(),
        }
    };
    Unit::ALL.into_iter().map(row).collect()
}

fn counters(outcome: &Outcome) -> Vec<CounterRow> {
    let frames = outcome.simulated.known().count().max(1) as f64;
    let pixels = outcome.plan.pixels() as f64;
    let row = |event: Event| {
        let total = outcome.summary.counts[event];
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
    Event::ALL.into_iter().map(row).collect()
}
