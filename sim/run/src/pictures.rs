//! Plots of a run.

use activity::Unit;
use power_model::Part;

use super::{FinishedRun, RunFrame, stalls};
use output::MeanSd;
use output::plot::{
    FrameEnergyPlot, FrameEnergyPoint, FramePowerPlot, Picture, PowerPart, PowerRun, UnitLane, UnitPlot,
};

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
    plots.extend(stalls::picture(shown.1, &subject, &outcome.plan.options.plot_style).map(|picture| Plot {
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
pub(super) fn parts_in_use(outcome: &FinishedRun) -> Vec<Part> {
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
