//! A run as the Perfetto viewer shows it.

use activity::Unit;
use power_model::Part;

use super::{Outcome, stalls};
use output::perfetto::{CounterTrack, FrameSpan, MAX_SLICES, Timeline, UnitTrack, slices_of_bins};

const NS: f64 = 1e9;

/// The timeline of a run: frames, the units in use, and power in total and by part.
pub(super) fn timeline<'a>(outcome: &'a Outcome, process: &'a str) -> Timeline<'a> {
    let total = outcome.simulated.total();
    let units = Unit::ALL
        .into_iter()
        .filter(|&unit| total.uses(unit))
        .map(|unit| unit_track(outcome, unit))
        .collect();
    let energy = outcome.measurement.run.energy();
    let parts = Part::ALL.into_iter().filter(|part| energy[*part] > 0.0);
    let starts: Vec<u64> = outcome.measurement.run.frames.iter().map(|paced| ns(paced.start_s)).collect();
    let power = std::iter::once(total_power(outcome)).chain(parts.map(|part| part_power(outcome, part)));
    let counters = power.chain(stalls::tracks(&outcome.simulated, &starts)).collect();
    Timeline { process, frames: frames(outcome), units, counters }
}

fn ns(time_s: f64) -> u64 {
    (time_s * NS).round() as u64
}

fn frames(outcome: &Outcome) -> Vec<FrameSpan> {
    let rows = outcome.measurement.run.frames.iter().zip(&outcome.summary.frames);
    rows.map(|(paced, row)| FrameSpan {
        frame: u64::from(row.frame),
        start_ns: ns(paced.start_s),
        busy_end_ns: ns(paced.busy_end_s),
        end_ns: ns(paced.end_s),
        numbers: vec![
            ("energy_mJ", row.energy_j * 1e3),
            ("energy_nJ_per_pixel", row.energy_per_pixel_j * 1e9),
            ("power_W", row.power_w),
        ],
    })
    .collect()
}

fn unit_track(outcome: &Outcome, unit: Unit) -> UnitTrack<'static> {
    let limit = (MAX_SLICES / outcome.simulated.frames.len().max(1)).max(1);
    let slices = outcome
        .measurement
        .run
        .frames
        .iter()
        .zip(outcome.simulated.in_order())
        .flat_map(|(paced, frame)| {
            let busy: Vec<f64> = frame.busy.iter().map(|shares| f64::from(shares[unit as usize])).collect();
            slices_of_bins(ns(paced.start_s), frame.power.bin_s() * NS, &busy, limit)
        })
        .collect();
    UnitTrack { name: unit.name(), doc: unit.doc(), slices }
}

fn total_power(outcome: &Outcome) -> CounterTrack<'static> {
    let curve = &outcome.measurement.run.curve;
    let points = curve.edges_s().iter().zip(curve.watts()).map(|(&edge, &watts)| (ns(edge), watts)).collect();
    CounterTrack { name: "power, total", unit: "W", points }
}

fn part_power(outcome: &Outcome, part: Part) -> CounterTrack<'static> {
    let idle_w = outcome.plan.platform.idle_w.value();
    let between = if part == Part::Idle { idle_w } else { 0.0 };
    let mut points = vec![(0, between)];
    for (paced, frame) in outcome.measurement.run.frames.iter().zip(outcome.simulated.in_order()) {
        let mut at = paced.start_s;
        for (length_s, watts) in frame.power.bins() {
            points.push((ns(at), watts[part.index()]));
            at += length_s;
        }
        points.push((ns(paced.busy_end_s), between));
    }
    CounterTrack { name: part.name(), unit: "W", points }
}
