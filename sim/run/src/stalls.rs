//! Stalls of units over a run, for summary, plot and timeline.

use std::collections::BTreeMap;

use activity::{Counts, Unit};
use serde::Serialize;
use timing::{Stalls, UnitTime};

use super::{RunFrame, Simulated};
use output::plot::{Look, Picture, StallLane, UnitPlot};
use traces::io::perfetto::CounterTrack;

/// Largest number of columns of the plot.
const MAX_COLUMNS: usize = 128;

/// Shares of a unit's time over the frames of a run; all of them add up to 1.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct StallShares {
    /// Serving work.
    pub busy: f64,
    /// No work left, or no request.
    pub idle: f64,
    /// Waiting for input from a unit, by that unit.
    pub starved: BTreeMap<&'static str, f64>,
    /// Waiting for a unit to accept output or to reply, by that unit.
    pub blocked: BTreeMap<&'static str, f64>,
}

/// Part of a frame: its stalls, and where it begins and ends in picoseconds.
pub(super) type StalledSpan<'a> = (&'a Stalls, [u64; 2]);

/// Shares of every unit in use over all distinct frames; empty if the timing level records no stalls.
pub(super) fn shares(simulated: &Simulated) -> BTreeMap<&'static str, StallShares> {
    let frames = simulated.observed().filter_map(|(_, frame)| frame.stalls.as_ref());
    let spans: Vec<StalledSpan<'_>> = frames.map(|stalls| (stalls, [0, u64::MAX])).collect();
    shares_of(&spans, &simulated.total())
}

/// Shares of every unit that counted in `used`, over parts of frames; empty without any.
pub(super) fn shares_of(spans: &[StalledSpan<'_>], used: &Counts) -> BTreeMap<&'static str, StallShares> {
    if spans.is_empty() {
        return BTreeMap::new();
    }
    let of = |unit: Unit| {
        let times: Vec<UnitTime> = spans.iter().map(|(stalls, span)| stalls.between(unit, *span)).collect();
        let total = times.iter().map(UnitTime::total).sum::<u64>().max(1) as f64;
        let share = |pick: &dyn Fn(&UnitTime) -> u64| times.iter().map(pick).sum::<u64>() as f64 / total;
        let by = |pick: fn(&UnitTime, usize) -> u64| {
            let shares = Unit::ALL.map(|by| (by.name(), share(&|time| pick(time, by as usize))));
            shares.into_iter().filter(|(_, share)| *share > 0.0).collect()
        };
        let (starved, blocked) = (by(|time, by| time.starved[by]), by(|time, by| time.blocked[by]));
        StallShares { busy: share(&|time| time.busy), idle: share(&|time| time.idle), starved, blocked }
    };
    Unit::ALL.into_iter().filter(|&unit| used.uses(unit)).map(|unit| (unit.name(), of(unit))).collect()
}

/// The units that others waited for most, at most three: the mean share over all units in `stalls`.
pub(super) fn waited_for(stalls: &BTreeMap<&'static str, StallShares>) -> Vec<(&'static str, f64)> {
    let mut waits: BTreeMap<&'static str, f64> = BTreeMap::new();
    for (&by, &share) in stalls.values().flat_map(|of| of.starved.iter().chain(&of.blocked)) {
        *waits.entry(by).or_default() += share / stalls.len() as f64;
    }
    let mut most: Vec<_> = waits.into_iter().collect();
    most.sort_by(|a, b| b.1.total_cmp(&a.1));
    most.truncate(3);
    most
}

/// Busy, starved and blocked share of `unit` in each interval.
fn lane(stalls: &Stalls, unit: Unit) -> impl Iterator<Item = [f64; 3]> {
    stalls.intervals().iter().map(move |interval| {
        let time = &interval[unit as usize];
        let total = time.total().max(1) as f64;
        [time.busy, time.starved.iter().sum(), time.blocked.iter().sum()].map(|part| part as f64 / total)
    })
}

/// Plot of the stalls in a frame; `None` if they are not recorded.
pub(super) fn picture(frame: &RunFrame, subject: &str, look: &Look) -> Option<Picture> {
    let observed = frame.observed()?;
    let stalls = observed.stalls.as_ref()?;
    let group = stalls.intervals().len().div_ceil(MAX_COLUMNS).max(1);
    let bottlenecks = stalls.bottlenecks();
    let of = |unit: Unit| {
        let shares: Vec<[f64; 3]> = lane(stalls, unit).collect();
        let mean = |group: &[[f64; 3]]| {
            [0, 1, 2].map(|kind| group.iter().map(|s| s[kind]).sum::<f64>() / group.len() as f64)
        };
        let most = |group: &[(Unit, f64)]| {
            2 * group.iter().filter(|(busiest, _)| *busiest == unit).count() > group.len()
        };
        let bottleneck = bottlenecks.chunks(group).map(most).collect();
        StallLane { name: unit.name(), shares: shares.chunks(group).map(mean).collect(), bottleneck }
    };
    let units = Unit::ALL.into_iter().filter(|&unit| observed.counts.uses(unit)).map(of).collect();
    let bin_s = stalls.interval_ps() as f64 * 1e-12 * group as f64;
    Some(UnitPlot { subject, frame: u64::from(frame.index), bin_s, units }.picture(look))
}

/// Names of the tracks, in the order of units.
const TRACKS: [[&str; 2]; Unit::COUNT] = [
    ["command starved", "command blocked"],
    ["shader starved", "shader blocked"],
    ["compute starved", "compute blocked"],
    ["setup starved", "setup blocked"],
    ["traversal starved", "traversal blocked"],
    ["z_cull starved", "z_cull blocked"],
    ["sample_test starved", "sample_test blocked"],
    ["depth starved", "depth blocked"],
    ["shading_cache starved", "shading_cache blocked"],
    ["texture starved", "texture blocked"],
    ["colour starved", "colour blocked"],
    ["l2 starved", "l2 blocked"],
    ["llc starved", "llc blocked"],
    ["edram starved", "edram blocked"],
    ["dram starved", "dram blocked"],
];

/// Tracks for the Perfetto viewer: starved and blocked share of each unit. `starts` are the starts of frames
/// in ns.
pub(super) fn tracks(simulated: &Simulated, starts: &[u64]) -> Vec<CounterTrack<'static>> {
    let mut tracks = Vec::new();
    for (unit, names) in Unit::ALL.into_iter().zip(TRACKS) {
        for (kind, name) in names.into_iter().enumerate() {
            let mut points = Vec::new();
            for (frame, &start) in simulated.in_order().zip(starts) {
                let Some(stalls) = frame.observed().and_then(|observed| observed.stalls.as_ref()) else {
                    continue;
                };
                let interval_ns = stalls.interval_ps() as f64 * 1e-3;
                let at = |place: usize| start + (place as f64 * interval_ns) as u64;
                points.extend(
                    lane(stalls, unit)
                        .enumerate()
                        .map(|(place, shares)| (at(place), 100.0 * shares[kind + 1])),
                );
                points.push((start + (frame.power.duration_s() * 1e9) as u64, 0.0));
            }
            if points.iter().any(|(_, share)| *share > 0.0) {
                tracks.push(CounterTrack { name, unit: "%", points });
            }
        }
    }
    tracks
}
