//! Work and energy by pass and by draw, over the simulated frames of a run.

use std::collections::BTreeMap;

use activity::{Counts, Event};
use pipeline::FrameReport;
use power_model::PowerModel;
use serde::Serialize;
use timing::{PassTime, Stalls};

use crate::stalls::{self, StalledSpan};
use crate::{Observed, Plan, Simulated, StallShares};

/// Passes of one name.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PassSummary {
    /// Name of the pass; `write back` for what is written to memory when frames end.
    pub name: String,
    /// Number of passes of this name.
    pub passes: u64,
    /// Seconds from the end of the pass before to its own end. Those of all passes add up to the busy time of the frames.
    pub time_s: f64,
    /// Energy in joules: that of the events, and the other energy of frames by time.
    pub energy_j: f64,
    /// Work of all of them.
    #[serde(flatten)]
    pub work: WorkSummary,
    /// Busy, idle and stalled shares of each unit's time in these passes, if the timing level records stalls.
    pub stalls: BTreeMap<&'static str, StallShares>,
    /// Draws of a pass, by their place in it. Empty if there is one draw only, or too many.
    pub draws: Vec<WorkSummary>,
}

/// Work of passes or draws.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct WorkSummary {
    /// Energy of the events in joules; parts that depend on time are not in it.
    pub events_j: f64,
    /// Bytes to and from memory.
    pub dram_bytes: u64,
    /// Event counts.
    pub counts: Counts,
}

/// Name of the last row: results that are written to memory when a frame ends.
pub const WRITE_BACK: &str = "write back";
/// Largest number of draws of a pass that are listed.
const MAX_DRAWS: usize = 256;

/// Drops the numbers of single draws where there are too many to list.
pub(crate) fn limit_draws(report: &mut FrameReport) {
    report.passes.iter_mut().filter(|pass| pass.draws.len() > MAX_DRAWS).for_each(|pass| pass.forget_draws());
}

impl WorkSummary {
    fn new(counts: Counts, model: &PowerModel) -> Self {
        Self {
            events_j: model.counts_energy(&counts).total_j(),
            dram_bytes: counts[Event::DramReadBytes] + counts[Event::DramWriteBytes],
            counts,
        }
    }
}

/// Passes of all simulated frames of a run, in the order of their first use.
pub(crate) fn summaries(plan: &Plan, simulated: &Simulated) -> Vec<PassSummary> {
    let mut groups: Vec<Group<'_>> = Vec::new();
    let mut write_back = Counts::default();
    for frame in simulated.in_order() {
        let Some(Observed { report, times, counts, stalls, .. }) = frame.observed() else { continue };
        write_back += &report.write_back;
        let events_j = plan.model.counts_energy(counts).total_j();
        let others_j = frame.power.energy().total_j() - events_j;
        let others_w = others_j / frame.power.duration_s();
        add(&mut groups, report, (times, stalls.as_ref()), others_w);
    }
    let mut rows: Vec<_> = groups.into_iter().map(|group| group.summary(&plan.model)).collect();
    let (name, work) = (WRITE_BACK.to_owned(), WorkSummary::new(write_back, &plan.model));
    let (stalls, draws) = Default::default();
    rows.push(PassSummary { name, passes: 0, time_s: 0.0, energy_j: work.events_j, work, stalls, draws });
    rows
}

/// Passes of one name, so far.
struct Group<'a> {
    name: String,
    passes: u64,
    time_s: f64,
    /// Energy that depends on time, in joules.
    others_j: f64,
    counts: Counts,
    draws: Vec<Counts>,
    stalled: Vec<StalledSpan<'a>>,
}

/// Adds the passes of a frame. `others_w` is its power besides the events.
fn add<'a>(
    groups: &mut Vec<Group<'a>>,
    report: &FrameReport,
    (times, stalls): (&[PassTime], Option<&'a Stalls>),
    others_w: f64,
) {
    let mut before_ps = 0;
    for (number, pass) in report.passes.iter().enumerate() {
        let place = groups.iter().position(|group| group.name == pass.name).unwrap_or_else(|| {
            let (counts, draws, stalled) = Default::default();
            let name = pass.name.clone();
            groups.push(Group { name, passes: 0, time_s: 0.0, others_j: 0.0, counts, draws, stalled });
            groups.len() - 1
        });
        let end_ps = times.get(number).map_or(before_ps, |time| time.end_ps);
        let time_s = (end_ps - before_ps) as f64 * 1e-12;
        let span = [std::mem::replace(&mut before_ps, end_ps), end_ps];
        let group = &mut groups[place];
        group.stalled.extend(stalls.map(|stalls| (stalls, span)));
        group.passes += 1;
        group.time_s += time_s;
        group.others_j += time_s * others_w;
        group.counts += &pass.counts();
        if pass.draws.len() > group.draws.len() {
            group.draws.resize(pass.draws.len(), Counts::default());
        }
        group.draws.iter_mut().zip(&pass.draws).for_each(|(sum, draw)| *sum += draw);
    }
}

impl Group<'_> {
    fn summary(self, model: &PowerModel) -> PassSummary {
        let listed = if (2..=MAX_DRAWS).contains(&self.draws.len()) { self.draws } else { Vec::new() };
        let work = WorkSummary::new(self.counts, model);
        PassSummary {
            name: self.name,
            passes: self.passes,
            time_s: self.time_s,
            energy_j: work.events_j + self.others_j,
            stalls: stalls::shares_of(&self.stalled, &work.counts),
            work,
            draws: listed.into_iter().map(|draw| WorkSummary::new(draw, model)).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pipeline::PassReport;

    fn counts(event: Event, count: u64) -> Counts {
        let mut counts = Counts::default();
        counts[event] = count;
        counts
    }

    fn pass(name: &str, draws: Vec<Counts>) -> PassReport {
        PassReport { name: name.to_owned(), triangles: 1, draws, others: counts(Event::PixelsResolved, 3) }
    }

    #[test]
    fn passes_of_a_name_are_one_row_with_their_draws() {
        let mut groups = Vec::new();
        let hits = |count| counts(Event::SamplesHit, count);
        for _ in 0..2 {
            let passes = vec![pass("map", vec![hits(5)]), pass("image", vec![hits(1), hits(2)])];
            let time = |begin_ps, end_ps| PassTime { begin_ps, end_ps, busy_ps: [0; activity::Unit::COUNT] };
            let times = [time(0, 3_000_000), time(2_000_000, 5_000_000)];
            add(&mut groups, &FrameReport { passes, ..FrameReport::default() }, (&times, None), 2.0);
        }
        let found: Vec<_> = groups.iter().map(|group| (group.name.as_str(), group.passes)).collect();
        assert_eq!(found, [("map", 2), ("image", 2)]);
        assert_eq!(groups[1].draws, [hits(2), hits(4)]);
        let spent: Vec<_> = groups.iter().map(|group| (group.time_s, group.others_j)).collect();
        assert_eq!(spent, [(6e-6, 12e-6), (4e-6, 8e-6)], "from end to end");
        assert_eq!((groups[1].counts[Event::SamplesHit], groups[1].counts[Event::PixelsResolved]), (6, 6));
    }

    #[test]
    fn too_many_draws_are_one_sum() {
        let draws = vec![counts(Event::SamplesHit, 1); MAX_DRAWS + 1];
        let mut report = FrameReport { passes: vec![pass("scene", draws)], ..FrameReport::default() };
        let before = report.counts();
        limit_draws(&mut report);
        assert!(report.passes[0].draws.is_empty() && report.counts() == before);
    }
}
