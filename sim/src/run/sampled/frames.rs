//! Frames that were not simulated, made from one that was.

use std::collections::BTreeMap;

use activity::{Counts, Unit};

use super::super::simulate::Whole;
use super::super::{Plan, Regime, Simulated, SimulatedFrame};
use super::{Forecast, SampledSummary, Scout, Taken};

/// Frames are never predicted to take less than this share of what the one they are made from takes.
const LEAST_SHARE: f64 = 0.01;

/// Every frame of the run, simulated or predicted.
pub(super) fn all(
    plan: &Plan,
    numbers: &[u32],
    scout: &Scout,
    forecast: &Forecast,
    mut whole: BTreeMap<usize, Whole>,
) -> Simulated {
    let predicted: BTreeMap<usize, SimulatedFrame> = (0..numbers.len())
        .filter(|place| !whole.contains_key(place))
        .map(|place| {
            let like = &whole[&nearest(scout, forecast, place)].frame;
            (place, predict(numbers[place], scout, forecast, place, like))
        })
        .collect();
    let summary = SampledSummary::new(plan, numbers, scout, forecast);
    let pictures = whole.iter_mut().filter_map(|(&place, done)| Some((numbers[place], done.picture.take()?)));
    let pictures = pictures.collect();
    let heat = whole.remove(&scout.pilot).map(|mut pilot| {
        let heat = std::mem::take(&mut pilot.heat);
        whole.insert(scout.pilot, pilot);
        heat
    });
    let mut distinct = predicted;
    distinct.extend(whole.into_iter().map(|(place, done)| (place, done.frame)));
    Simulated {
        distinct: distinct.into_values().collect(),
        frames: (0..numbers.len()).collect(),
        pictures,
        heat: heat.unwrap_or_default(),
        sampled: Some(summary),
    }
}

/// The representative of its stratum whose preview is most like that of the frame at `place`.
fn nearest(scout: &Scout, forecast: &Forecast, place: usize) -> usize {
    let design = forecast.design();
    let apart = |&other: &usize| scout.glimpses[other].cycles.abs_diff(scout.glimpses[place].cycles);
    let chosen = &design.strata()[design.stratum_of(place)].chosen;
    chosen.iter().copied().min_by_key(apart).unwrap_or(scout.pilot)
}

/// The power curve of `like`, stretched to the time and the energy that are predicted.
fn predict(
    number: u32,
    scout: &Scout,
    forecast: &Forecast,
    place: usize,
    like: &SimulatedFrame,
) -> SimulatedFrame {
    let [value, half] = forecast.frame(place);
    let share = |predicted: f64, known: f64| (predicted / known.max(f64::MIN_POSITIVE)).max(LEAST_SHARE);
    let time = share(value.cycles, like.cycles as f64);
    let energy_j = share(value.energy_j, like.power.energy().total_j()) * like.power.energy().total_j();
    let glimpse = &scout.glimpses[place];
    SimulatedFrame {
        index: number,
        triangles: glimpse.triangles,
        moving: glimpse.moving,
        lens: glimpse.lens,
        counts: Counts::default(),
        facts: Vec::new(),
        warnings: Vec::new(),
        regime: Regime::default(),
        power: like.power.reshaped((like.power.duration_ps() as f64 * time).round() as u64, energy_j),
        busy_ps: Unit::ALL.map(|unit| (like.busy_ps[unit as usize] as f64 * time).round() as u64),
        busy: like.busy.clone(),
        cycles: (like.cycles as f64 * time).round() as u64,
        stalls: None,
        doubts: Vec::new(),
        predicted: Some(Taken { cycles: half.cycles, energy_j: half.energy_j }),
    }
}
