//! The signature of a frame: its preview, scaled to the size of the run by one frame that was seen at both.

use activity::{Counts, Event, Unit};
use power_model::PowerModel;

use super::super::RunFrame;
use super::Glimpse;

/// About what each frame takes. Only differences between frames matter.
#[derive(Clone, Debug, PartialEq)]
pub struct Signatures {
    /// A soft maximum of the busy times of the units, in picoseconds.
    pub cycles: Vec<f64>,
    /// Events times their energy, and what goes with time, in joules.
    pub energy_j: Vec<f64>,
}

impl Signatures {
    /// Of the frames seen in `glimpses`, of which `pilot` is the one at place `at`, simulated whole.
    ///
    /// At a small size other units are the bottleneck, and triangles weigh more beside pixels. So each unit's busy time and each
    /// event's count is scaled by what it is for the pilot over what it is in the pilot's preview; then the slowest unit decides
    /// over time (fourth powers are summed, as units overlap without quite hiding each other), and energies add up.
    pub fn new(glimpses: &[Glimpse], at: usize, pilot: &RunFrame, model: &PowerModel) -> Self {
        let counts = pilot.observed().map_or_else(Counts::default, |observed| observed.counts);
        let seen = &glimpses[at];
        let by_unit = Unit::ALL.map(|unit| ratio(pilot.busy_ps[unit as usize], seen.busy_ps[unit as usize]));
        let by_event =
            Event::ALL.map(|event| ratio(counts[event], seen.counts[event]) * model.event_j(event));
        let slowest = |glimpse: &Glimpse| {
            let busy = glimpse.busy_ps.iter().zip(by_unit).map(|(&busy, scale)| busy as f64 * scale);
            busy.map(|busy| (busy * busy) * (busy * busy)).sum::<f64>().sqrt().sqrt()
        };
        let events = |glimpse: &Glimpse| -> f64 {
            Event::ALL.iter().zip(by_event).map(|(&event, scale)| glimpse.counts[event] as f64 * scale).sum()
        };
        let cycles: Vec<f64> = glimpses.iter().map(slowest).collect();
        let with_time = pilot.power.energy().total_j() - model.counts_energy(&counts).total_j();
        let per_time = if cycles[at] > 0.0 { with_time / cycles[at] } else { 0.0 };
        let energy_j = glimpses.iter().zip(&cycles).map(|(glimpse, time)| events(glimpse) + per_time * time);
        Self { energy_j: energy_j.collect(), cycles }
    }
}

fn ratio(whole: u64, seen: u64) -> f64 {
    if seen == 0 { 0.0 } else { whole as f64 / seen as f64 }
}

/// The place of the frame in the middle by the cycles of its preview, the earlier of two.
pub fn median(glimpses: &[Glimpse]) -> usize {
    let mut order: Vec<usize> = (0..glimpses.len()).collect();
    order.sort_by_key(|&place| (glimpses[place].cycles, place));
    order[order.len() / 2]
}
