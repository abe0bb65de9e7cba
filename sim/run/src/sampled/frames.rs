//! Frames that were not simulated, made from one that was.

use std::collections::BTreeMap;

use activity::Unit;

use super::super::frame::Whole;
use super::super::{Distinct, Origin, Plan, RunFrame, Simulated};
use super::summary::summary;
use super::{Forecast, Scout};

/// Frames are never predicted to take less than this share of what the one they are made from takes.
const LEAST_SHARE: f64 = 0.01;

/// Every frame of the run, simulated or predicted. `whole` holds the groups of frames that were simulated.
pub(super) fn all(
    plan: &Plan,
    frames: &Distinct,
    scout: &Scout,
    forecast: &Forecast,
    mut whole: BTreeMap<usize, Whole>,
) -> Simulated {
    let (numbers, groups) = (frames.numbers(), frames.groups());
    let mut distinct: BTreeMap<usize, RunFrame> = BTreeMap::new();
    for (place, &group) in groups.iter().enumerate().filter(|(_, group)| !whole.contains_key(group)) {
        distinct.entry(group).or_insert_with(|| {
            let like = &whole[&groups[nearest(scout, forecast, place)]].frame;
            predict(numbers[group], scout, forecast, place, like)
        });
    }
    let sampled = summary(plan, frames, scout, forecast);
    let pictures = whole.iter_mut().filter_map(|(&group, done)| Some((numbers[group], done.picture.take()?)));
    let pictures = pictures.collect();
    let pilot = whole.get_mut(&groups[scout.pilot]);
    let heat = pilot.map(|pilot| std::mem::take(&mut pilot.heat)).unwrap_or_default();
    distinct.extend(whole.into_iter().map(|(group, done)| (group, done.frame)));
    Simulated {
        distinct: distinct.into_values().collect(),
        frames: groups.to_vec(),
        pictures,
        heat,
        sampled: Some(sampled),
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
fn predict(number: u32, scout: &Scout, forecast: &Forecast, place: usize, like: &RunFrame) -> RunFrame {
    let [value, half] = forecast.frame(place);
    let share = |predicted: f64, known: f64| (predicted / known.max(f64::MIN_POSITIVE)).max(LEAST_SHARE);
    let time = share(value.cycles, like.cycles as f64);
    let energy_j = share(value.energy_j, like.power.energy().total_j()) * like.power.energy().total_j();
    let glimpse = &scout.glimpses[place];
    RunFrame {
        index: number,
        triangles: glimpse.triangles,
        moving: glimpse.moving,
        lens: glimpse.lens,
        power: like.power.reshaped((like.power.duration_ps() as f64 * time).round() as u64, energy_j),
        busy_ps: Unit::ALL.map(|unit| (like.busy_ps[unit as usize] as f64 * time).round() as u64),
        busy: like.busy.clone(),
        cycles: (like.cycles as f64 * time).round() as u64,
        origin: Origin::Predicted(half),
    }
}
