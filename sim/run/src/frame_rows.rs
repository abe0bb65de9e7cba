//! The rows of `summary.json`, one for each frame.

use activity::{Counts, Event};
use power_model::Energy;
use serde::Serialize;

use super::frame::image_name;
use super::{Measurement, Plan, Simulated};

/// One frame of a run.
#[derive(Clone, Debug, Serialize)]
pub struct FrameRow {
    /// Its number in the scene.
    pub frame: u32,
    /// Its image; a frame that was predicted has none.
    pub image: Option<String>,
    /// Whether it was predicted from others.
    pub predicted: bool,
    /// A hash of its counts, the same at every level of timing; a frame that was predicted has none.
    pub counts_hash: Option<String>,
    /// True start in seconds from the start of the recording.
    pub start_s: f64,
    /// Cycles of the core clock for which the GPU worked on it.
    pub cycles: u64,
    /// For how long the GPU worked on it, in seconds.
    pub busy_s: f64,
    /// From start to start, in seconds.
    pub duration_s: f64,
    /// True energy in joules.
    pub energy_j: f64,
    /// True energy per pixel in joules.
    pub energy_per_pixel_j: f64,
    /// True mean power in watts.
    pub power_w: f64,
    /// True energy by part in joules; summed in this order it is the frame's, exactly.
    pub energy_by_part_j: Energy,
    /// Where it was predicted: the ends of the interval in which its cycles lie.
    pub cycles_interval: Option<[f64; 2]>,
    /// The same for its energy, in joules.
    pub energy_interval_j: Option<[f64; 2]>,
    /// Energy as measured in the trace, in joules, where the frame was found.
    pub measured_energy_j: Option<f64>,
    /// Error of the found start in seconds.
    pub start_error_s: Option<f64>,
}

/// A hash of counts that goes on from that of others.
pub(super) fn hash(seed: u64, counts: &Counts) -> u64 {
    Event::ALL.iter().fold(seed, |hash: u64, &event| {
        pipeline::random::mix(hash.rotate_left(1) ^ counts[event].wrapping_add(event as u64))
    })
}

/// The interval of `half` the width around a value.
fn around(value: f64, half: Option<f64>) -> Option<[f64; 2]> {
    half.map(|half| [(value - half).max(0.0), value + half])
}

/// Every frame of the run.
pub(super) fn rows(plan: &Plan, simulated: &Simulated, measurement: &Measurement) -> Vec<FrameRow> {
    let first = plan.work.settings().frames.start;
    measurement
        .run
        .frames
        .iter()
        .zip(measurement.by_true_frame())
        .zip(simulated.in_order())
        .zip(first..)
        .map(|(((paced, measured), known), frame)| {
            let (energy_j, duration_s) = (paced.energy.total_j(), paced.end_s - paced.start_s);
            FrameRow {
                frame,
                image: known.observed().map(|_| format!("{}.png", image_name(frame))),
                predicted: known.half_widths().is_some(),
                counts_hash: known.observed().map(|observed| format!("{:016x}", hash(0, &observed.counts))),
                start_s: paced.start_s,
                cycles: known.cycles,
                busy_s: paced.busy_end_s - paced.start_s,
                duration_s,
                energy_j,
                energy_per_pixel_j: energy_j / plan.pixels() as f64,
                cycles_interval: around(known.cycles as f64, known.half_widths().map(|half| half.cycles)),
                energy_interval_j: around(energy_j, known.half_widths().map(|half| half.energy_j)),
                energy_by_part_j: paced.energy,
                power_w: energy_j / duration_s,
                measured_energy_j: measured.map(|m| m.energy_j),
                start_error_s: measured.map(|m| m.start_s - paced.start_s),
            }
        })
        .collect()
}
