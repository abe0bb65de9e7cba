//! Work, energy and stalls by pass and by draw, over the simulated frames of a run.

use std::collections::{BTreeMap, HashSet};

use activity::{Counts, Event, Packet, S_PER_PS, Unit};
use output::plot::{Picture, PlotStyle, StallLane, UnitPlot};
use pipeline::{FrameReport, PassReport};
use power_model::{FramePower, Part, PowerModel};
use serde::Serialize;
use timing::{DrawSpan, PassTime, Stalls, Timed, UnitTime};
use traces::io::perfetto::CounterTrack;

use crate::{Observed, Plan, RunFrame, Simulated};

/// Passes of one name.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PassSummary {
    /// Name of the pass; `write back` for what is written to memory when frames end.
    pub name: String,
    /// Number of passes of this name.
    pub passes: u64,
    /// All of them. Their time is from the end of the pass before to their own end; that of all passes adds
    /// up to the busy time of the frames.
    #[serde(flatten)]
    pub all: WorkSummary,
    /// Draws of a pass, by their place in it. Empty if there is one draw only, or too many.
    pub draws: Vec<WorkSummary>,
    /// Most draws of a pass in a frame, if they are too many to be listed; 0 otherwise.
    pub unlisted_draws: u64,
    /// What is of no single draw; with the draws it adds up to `all`. `None` without draws.
    pub others: Option<WorkSummary>,
}

/// Work of passes or draws.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct WorkSummary {
    /// Time in seconds.
    pub time_s: f64,
    /// Energy in joules: that of the events, and what a frame takes besides them in the time.
    pub energy_j: f64,
    /// Energy of the events in joules; parts that depend on time are not in it.
    pub events_j: f64,
    /// Bytes to and from memory.
    pub dram_bytes: u64,
    /// Event counts.
    pub counts: Counts,
    /// Busy, idle and stalled shares of the time of each unit that the pass used, if the timing level records stalls.
    pub stalls: BTreeMap<&'static str, StallShares>,
}

/// Name of the last row: results that are written to memory when a frame ends.
pub(crate) const WRITE_BACK: &str = "write back";
/// Largest number of draws of a pass that are listed.
const MAX_DRAWS: usize = 256;

/// Drops the numbers of single draws where there are too many to list.
pub(crate) fn limit_draws(report: &mut FrameReport) {
    report.passes.iter_mut().filter(|pass| pass.draws.len() > MAX_DRAWS).for_each(|pass| pass.forget_draws());
}

/// Time of passes and spans of draws, without those of single draws where there are too many to list, and
/// without spans that nobody reads: those of draws that take turns are for stalls alone.
pub(crate) fn limited_times(timed: &Timed) -> (Vec<PassTime>, Vec<DrawSpan>) {
    let mut times = timed.passes.clone();
    times.iter_mut().filter(|pass| pass.draws_ps.len() > MAX_DRAWS).for_each(|pass| pass.draws_ps.clear());
    let are_read = timed.stalls.is_some() || !take_turns(&timed.spans);
    (times, if are_read { timed.spans.clone() } else { Vec::new() })
}

/// Whether any draw has more than one of the spans.
pub(crate) fn take_turns(spans: &[DrawSpan]) -> bool {
    let mut seen = HashSet::new();
    let of_draws = spans.iter().filter(|span| span.draw != Packet::NONE);
    of_draws.into_iter().any(|span| !seen.insert((span.pass, span.draw)))
}

/// Passes of the simulated frames of a run, in the order of their first use.
pub fn passes_of<'a>(plan: &Plan, frames: impl Iterator<Item = &'a RunFrame>) -> Vec<PassSummary> {
    let mut groups: Vec<Group<'_>> = Vec::new();
    let mut write_back = Spent::default();
    for frame in frames {
        let Some(observed) = frame.observed() else { continue };
        let timed_j = |from_s, to_s| timed_j(&frame.power, from_s, to_s);
        add((&mut groups, &mut write_back), &FrameWork::new(observed), timed_j);
    }
    let mut rows: Vec<_> = groups.into_iter().map(|group| group.summary(&plan.model)).collect();
    let used = write_back.counts;
    let all = write_back.summary(&plan.model, &used);
    let name = WRITE_BACK.to_owned();
    rows.push(PassSummary { name, passes: 0, all, draws: Vec::new(), unlisted_draws: 0, others: None });
    rows
}

/// What is known of the passes of a frame. The last of `times` is that of the write-back.
struct FrameWork<'a> {
    report: &'a FrameReport,
    times: &'a [PassTime],
    spans: &'a [DrawSpan],
    stalls: Option<&'a Stalls>,
}

impl<'a> FrameWork<'a> {
    fn new(observed: &'a Observed) -> Self {
        let Observed { report, times, spans, stalls, .. } = observed;
        Self { report, times, spans, stalls: stalls.as_ref() }
    }

    /// Where pass `number` begins and ends: from the end of the pass before to its own.
    fn span(&self, number: usize) -> [u64; 2] {
        let end_of =
            |number: usize| self.times.get(number).or(self.times.last()).map_or(0, |time| time.end_ps);
        [number.checked_sub(1).map_or(0, end_of), end_of(number)]
    }

    /// Spans of a pass with their draws, if stalls are recorded.
    fn stalled(&self, pass: usize) -> impl Iterator<Item = (usize, StalledSpan<'a>)> {
        let mut before_ps = 0;
        let span = move |span: &DrawSpan| {
            let ends = [std::mem::replace(&mut before_ps, span.end_ps), span.end_ps];
            (span.pass as usize, span.draw as usize, ends)
        };
        let stalls = self.stalls;
        let of_pass = self.spans.iter().map(span).filter(move |(of, ..)| *of == pass);
        of_pass.filter_map(move |(_, draw, ends)| Some((draw, (stalls?, ends))))
    }
}

/// Time, energy and work, so far.
#[derive(Clone, Default)]
struct Spent<'a> {
    time_s: f64,
    /// Energy that depends on time, in joules.
    others_j: f64,
    counts: Counts,
    stalled: Vec<StalledSpan<'a>>,
}

impl<'a> Spent<'a> {
    /// Adds work between two times, with the energy besides its events.
    fn add_span(&mut self, counts: &Counts, span: [u64; 2], others_w: f64, stalls: Option<&'a Stalls>) {
        self.stalled.extend(stalls.map(|stalls| (stalls, span)));
        self.add(counts, span[1] - span[0], others_w);
    }

    fn add(&mut self, counts: &Counts, time_ps: u64, others_w: f64) {
        let time_s = seconds(time_ps);
        self.time_s += time_s;
        self.others_j += time_s * others_w;
        self.counts += counts;
    }

    /// Stalls are those of the units that did any of the work in `used`.
    fn summary(self, model: &PowerModel, used: &Counts) -> WorkSummary {
        let Self { time_s, others_j, counts, stalled } = self;
        let events_j = model.counts_energy(&counts).total_j();
        WorkSummary {
            time_s,
            energy_j: events_j + others_j,
            events_j,
            dram_bytes: counts[Event::DramReadBytes] + counts[Event::DramWriteBytes],
            stalls: shares_of(&stalled, used),
            counts,
        }
    }
}

/// Passes of one name, so far.
#[derive(Default)]
struct Group<'a> {
    name: String,
    passes: u64,
    all: Spent<'a>,
    draws: Vec<Spent<'a>>,
    /// Most draws of a pass that are among the others.
    forgotten: usize,
    others: Spent<'a>,
}

fn seconds(time_ps: u64) -> f64 {
    time_ps as f64 * S_PER_PS
}

/// Adds the passes of a frame and its write-back. `timed_j` is its energy besides the events, between two times.
/// Draws that share the time of a pass share it by their times.
fn add<'a>(
    (groups, write_back): (&mut Vec<Group<'a>>, &mut Spent<'a>),
    frame: &FrameWork<'a>,
    timed_j: impl Fn(f64, f64) -> f64,
) {
    let others_w = |[from_ps, to_ps]: [u64; 2]| {
        let (from_s, to_s) = (seconds(from_ps), seconds(to_ps));
        if to_s > from_s { timed_j(from_s, to_s) / (to_s - from_s) } else { 0.0 }
    };
    for (number, pass) in frame.report.passes.iter().enumerate() {
        let place = groups.iter().position(|group| group.name == pass.name).unwrap_or_else(|| {
            groups.push(Group { name: pass.name.clone(), ..Group::default() });
            groups.len() - 1
        });
        let span = frame.span(number);
        let others_w = others_w(span);
        let group = &mut groups[place];
        group.passes += 1;
        group.forgotten = group.forgotten.max(pass.forgotten_draws);
        group.all.add_span(&pass.counts(), span, others_w, frame.stalls);
        if pass.draws.len() > 1 {
            let draws_ps = frame.times.get(number).map_or(&[][..], |time| &time.draws_ps);
            group.add_draws(pass, (draws_ps, span[1] - span[0]), others_w);
            frame.stalled(number).for_each(|(draw, span)| group.of_draw(draw).stalled.push(span));
        }
    }
    let span = frame.span(frame.report.passes.len());
    write_back.add_span(&frame.report.write_back, span, others_w(span), frame.stalls);
}

impl<'a> Group<'a> {
    /// Adds the draws of a pass, by the time of each of them and of the pass.
    fn add_draws(&mut self, pass: &PassReport, (draws_ps, pass_ps): (&[u64], u64), others_w: f64) {
        if pass.draws.len() > self.draws.len() {
            self.draws.resize(pass.draws.len(), Spent::default());
        }
        let times = draws_ps.iter().copied().chain(std::iter::repeat(0));
        for ((spent, draw), time_ps) in self.draws.iter_mut().zip(&pass.draws).zip(times) {
            spent.add(draw, time_ps, others_w);
        }
        let all_ps: u64 = draws_ps.iter().take(pass.draws.len()).sum();
        self.others.add(&pass.others, pass_ps - all_ps, others_w);
    }

    fn of_draw(&mut self, draw: usize) -> &mut Spent<'a> {
        self.draws.get_mut(draw).unwrap_or(&mut self.others)
    }

    fn summary(self, model: &PowerModel) -> PassSummary {
        let is_listed = (2..=MAX_DRAWS).contains(&self.draws.len());
        let unlisted = self.forgotten.max(if self.draws.len() > MAX_DRAWS { self.draws.len() } else { 0 });
        let draws = if is_listed { self.draws } else { Vec::new() };
        let used = self.all.counts;
        PassSummary {
            name: self.name,
            passes: self.passes,
            all: self.all.summary(model, &used),
            draws: draws.into_iter().map(|draw| draw.summary(model, &used)).collect(),
            unlisted_draws: unlisted as u64,
            others: is_listed.then(|| self.others.summary(model, &used)),
        }
    }
}

/// Energy between two times of the parts of a power that depend on time: what a pass takes besides its events.
pub(crate) fn timed_j(power: &FramePower, from_s: f64, to_s: f64) -> f64 {
    let is_timed = |part: &Part| !matches!(part, Part::Unit(_));
    let mut at_s = 0.0;
    let energy = |(length_s, watts): (f64, &[f64; Part::ALL.len()])| {
        let begin_s = at_s;
        at_s += length_s;
        let inside_s = (at_s.min(to_s) - begin_s.max(from_s)).max(0.0);
        let watts: f64 =
            Part::ALL.iter().zip(watts).filter(|(part, _)| is_timed(part)).map(|(_, watts)| watts).sum();
        watts * inside_s
    };
    power.bins().map(energy).sum()
}

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
type StalledSpan<'a> = (&'a Stalls, [u64; 2]);

/// Shares of every unit in use over all distinct frames; empty if the timing level records no stalls.
pub(super) fn stall_shares(simulated: &Simulated) -> BTreeMap<&'static str, StallShares> {
    let frames = simulated.observed().filter_map(|(_, frame)| frame.stalls.as_ref());
    let spans: Vec<StalledSpan<'_>> = frames.map(|stalls| (stalls, [0, u64::MAX])).collect();
    shares_of(&spans, &simulated.total())
}

/// Shares of every unit that counted in `used`, over parts of frames; empty without any.
fn shares_of(spans: &[StalledSpan<'_>], used: &Counts) -> BTreeMap<&'static str, StallShares> {
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
pub(super) fn stall_picture(frame: &RunFrame, subject: &str, plot_style: &PlotStyle) -> Option<Picture> {
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
    let bin_s = stalls.interval_ps() as f64 * S_PER_PS * group as f64;
    Some(UnitPlot { subject, frame: u64::from(frame.index), bin_s, units }.picture(plot_style))
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
pub(super) fn stall_tracks(simulated: &Simulated, starts: &[u64]) -> Vec<CounterTrack<'static>> {
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

#[cfg(test)]
mod tests {
    use activity::Unit;
    use power_model::{EnergyTable, Platform};

    use super::*;

    fn counts(event: Event, count: u64) -> Counts {
        let mut counts = Counts::default();
        counts[event] = count;
        counts
    }

    fn pass(name: &str, draws: Vec<Counts>) -> PassReport {
        let others = counts(Event::PixelsResolved, 3);
        PassReport { draws, others, ..PassReport::named(name, 1) }
    }

    #[test]
    fn passes_of_a_name_are_one_row_with_their_draws() {
        let mut groups = Vec::new();
        let hits = |count| counts(Event::SamplesHit, count);
        let time = |begin_ps, end_ps, draws_ps: &[u64]| PassTime {
            begin_ps,
            end_ps,
            busy_ps: [0; Unit::COUNT],
            draws_ps: draws_ps.to_vec(),
        };
        let times = [
            time(0, 3_000_000, &[]),
            time(2_000_000, 5_000_000, &[500_000, 900_000]),
            time(4_000_000, 5_500_000, &[]),
        ];
        let passes = vec![pass("map", vec![hits(5)]), pass("image", vec![hits(1), hits(2)])];
        let report = FrameReport { passes, write_back: hits(7), ..FrameReport::default() };
        let frame = FrameWork { report: &report, times: &times, spans: &[], stalls: None };
        let mut write_back = Spent::default();
        (0..2).for_each(|_| {
            add((&mut groups, &mut write_back), &frame, |from_s, to_s| 2.0 * (to_s - from_s));
        });
        let found: Vec<_> = groups.iter().map(|group| (group.name.as_str(), group.passes)).collect();
        assert_eq!(found, [("map", 2), ("image", 2)]);
        let spent: Vec<_> = groups.iter().map(|group| (group.all.time_s, group.all.others_j)).collect();
        let near = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-12;
        assert!(near(write_back.time_s, 1e-6) && near(write_back.others_j, 2e-6));
        assert_eq!(write_back.counts, hits(14));
        let expected = [(6e-6, 12e-6), (4e-6, 8e-6)];
        let close = |((time_s, joules), (of_s, of_j)): (&(f64, f64), (f64, f64))| {
            near(*time_s, of_s) && near(*joules, of_j)
        };
        assert!(spent.iter().zip(expected).all(close), "from end to end: {spent:?}");
        let image = &groups[1];
        assert_eq!((image.all.counts[Event::SamplesHit], image.all.counts[Event::PixelsResolved]), (6, 6));
        assert_eq!([0, 1].map(|draw| image.draws[draw].counts), [hits(2), hits(4)]);
        assert_eq!([0, 1].map(|draw| image.draws[draw].time_s), [1e-6, 1.8e-6]);

        let table = EnergyTable::builtin("28nm").unwrap();
        let model = PowerModel::new(&table, &Platform::builtin("reference").unwrap()).unwrap();
        let image = groups.remove(1).summary(&model);
        let parts: Vec<_> = image.draws.iter().chain(&image.others).collect();
        let sum = |of: fn(&WorkSummary) -> f64| {
            parts.iter().map(|part| of(part)).sum::<f64>() / of(&image.all) - 1.0
        };
        assert!(sum(|work| work.time_s).abs() < 1e-9 && sum(|work| work.energy_j).abs() < 1e-9);
    }

    #[test]
    fn draws_that_come_back_take_turns() {
        let spans = |draws: &[u32]| -> Vec<DrawSpan> {
            let span = |(&draw, end_ps)| DrawSpan { pass: 0, draw, end_ps };
            draws.iter().zip(1..).map(span).collect()
        };
        assert!(!take_turns(&spans(&[0, Packet::NONE, 1, Packet::NONE])) && take_turns(&spans(&[0, 1, 0])));
    }

    #[test]
    fn too_many_draws_are_one_sum() {
        let draws = vec![counts(Event::SamplesHit, 1); MAX_DRAWS + 1];
        let mut report = FrameReport { passes: vec![pass("scene", draws)], ..FrameReport::default() };
        let before = report.counts();
        limit_draws(&mut report);
        assert!(report.passes[0].draws.is_empty() && report.counts() == before);
        assert_eq!(report.passes[0].forgotten_draws, MAX_DRAWS + 1);
    }
}
