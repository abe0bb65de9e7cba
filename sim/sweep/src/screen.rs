//! Screening: designs that a coarse timing level shows to be far from the frontier are not run at the finer ones.
//!
//! Levels differ in time and energy by a factor that varies from design to design. Some designs, drawn by a
//! hash of their settings, run at both levels. A design is dropped if another one is better in both by more
//! than the range of these factors: within it the order may turn. Designs that are kept add to the range, and
//! where it grows more of them are kept. For designs like those that ran at both levels, a further one is
//! outside of a range of `n` with a probability of 2 / (n + 1) (conformal prediction, Vovk, Gammerman and
//! Shafer 2005).
//!
//! Designs that the coarse level `packet` cannot distinguish by its stated error do not all run: those on its
//! own frontier do, and others are undecided against them. Where one that ran is outside of the stated error,
//! the range decides as above.

use std::collections::{BTreeMap, HashSet};

use output::dir::sha256_of_text;
use timing::Level;

use crate::execute::{Measured, Outcome};
use crate::plan::{Point, SweepPlan};
use crate::{Folder, SweepError};

/// Number of designs of a workload that run at both levels whatever they cost: with as many a further design
/// is outside of their range with a probability of 5 %.
const CALIBRATED: usize = 39;

/// Logarithms of busy time and busy energy.
type Cost = [f64; 2];

fn cost(measured: &Measured) -> Cost {
    [measured.busy_ms, measured.busy_mj].map(libm::log)
}

/// Stated errors of time and energy, as logarithms.
fn stated(measured: &Measured) -> Cost {
    [measured.cycles_error, measured.energy_error].map(libm::log1p)
}

/// A design at two levels.
#[derive(Clone, Copy, Debug)]
struct Design<'a> {
    /// The point at the fine level.
    point: &'a Point,
    /// Its cost at the coarse level; `None` if it failed there or was dropped before.
    coarse: Option<Cost>,
    /// Its cost at the fine level; `None` if it did not run there, or failed.
    fine: Option<Cost>,
    /// Stated error at the coarse level.
    stated: Cost,
}

impl Design<'_> {
    /// Whether its costs at both levels differ by at most the stated error, as far as known.
    fn is_within_stated(&self) -> bool {
        let (Some(coarse), Some(fine)) = (self.coarse, self.fine) else { return true };
        (0..2).all(|of| (fine[of] - coarse[of]).abs() <= self.stated[of])
    }

    /// Whether `other` is better in both by more than both stated errors.
    fn is_far_behind(&self, other: &Self) -> bool {
        let (Some(cost), Some(better)) = (self.coarse, other.coarse) else { return false };
        (0..2).all(|of| better[of] + other.stated[of] + self.stated[of] < cost[of])
    }
}

/// Range of the factors between two levels, as a difference of logarithms; `None` with fewer than two designs
/// at both.
fn range(designs: &[Design<'_>]) -> Option<Cost> {
    let both: Vec<Cost> = designs
        .iter()
        .filter_map(|design| Some((design.coarse?, design.fine?)))
        .map(|(coarse, fine)| [0, 1].map(|of| fine[of] - coarse[of]))
        .collect();
    let ends = |of: usize| {
        let factors = both.iter().map(|factor| factor[of]);
        let [low, high] = [f64::min, f64::max].map(|end| factors.clone().reduce(end));
        Some(high? - low?)
    };
    if both.len() < 2 { None } else { Some([ends(0)?, ends(1)?]) }
}

/// Whether `design` may be on the frontier of the fine level, if factors vary by `range`.
fn may_be_optimal(design: &Design<'_>, designs: &[Design<'_>], range: Cost) -> bool {
    let Some(cost) = design.coarse else { return false };
    let is_far_better = |other: &Cost| (0..2).all(|of| other[of] + range[of] < cost[of]);
    !designs.iter().filter_map(|other| other.coarse).any(|other| is_far_better(&other))
}

/// Designs on the frontier of the coarse level, one of those with equal costs: none is better there than one of them.
fn optimal<'a>(designs: &[Design<'a>]) -> Vec<&'a Point> {
    let known = || designs.iter().enumerate().filter_map(|(at, design)| Some((at, design.coarse?)));
    let is_better = |(other, by): (usize, Cost), (at, cost): (usize, Cost)| {
        (0..2).all(|of| by[of] <= cost[of]) && (by != cost || other < at)
    };
    let is_optimal = |&design: &(usize, Cost)| !known().any(|other| is_better(other, design));
    known().filter(is_optimal).map(|(at, _)| designs[at].point).collect()
}

/// Designs of one workload that run at the fine level, by what the level `coarse` can distinguish.
fn chosen<'a>(coarse: Level, designs: &[Design<'a>]) -> Vec<&'a Point> {
    match coarse {
        Level::Packet if designs.iter().all(Design::is_within_stated) => optimal(designs),
        _ => kept(designs, CALIBRATED),
    }
}

/// Why a design does not run at the fine level.
fn reason(coarse: Level, design: &Design<'_>, designs: &[Design<'_>]) -> Outcome {
    let name = coarse.name();
    let by_stated = coarse == Level::Packet && designs.iter().all(Design::is_within_stated);
    let text = match design.coarse {
        None => format!("it did not run at `{name}`"),
        Some(_) if !by_stated => {
            format!("at `{name}` another design is better in time and energy by more than levels differ")
        }
        Some(_) if designs.iter().any(|other| design.is_far_behind(other)) => {
            format!("at `{name}` another design is better in time and energy by more than the stated errors")
        }
        Some(_) => {
            let text =
                format!("at `{name}` no better than a design that ran, by less than the stated errors");
            return Outcome::Undecided(text);
        }
    };
    Outcome::ScreenedOut(text)
}

/// Order in which designs are drawn: as random as a hash, and the same for every build of the program, as ids
/// are not.
fn draw_order(point: &Point) -> String {
    let settings = point.settings.iter().filter(|setting| &*setting.path != "timing");
    let mut lines: Vec<String> = settings.map(|set| format!("{:?}={:?}", set.path, set.value)).collect();
    lines.sort();
    sha256_of_text(&lines.join("\n"))
}

/// Designs of one workload that run at the fine level: `calibrated` of them to compare levels, and those that
/// may be on its frontier.
fn kept<'a>(designs: &[Design<'a>], calibrated: usize) -> Vec<&'a Point> {
    let mut known: Vec<&Design<'_>> = designs.iter().filter(|design| design.coarse.is_some()).collect();
    known.sort_by_cached_key(|design| draw_order(design.point));
    let calibrated: Vec<&str> =
        known.iter().take(calibrated).map(|design| design.point.id.as_str()).collect();
    let range = range(designs);
    let is_kept = |design: &&Design<'_>| {
        let is_calibrated = design.coarse.is_some() && calibrated.contains(&design.point.id.as_str());
        is_calibrated || range.is_some_and(|range| may_be_optimal(design, designs, range))
    };
    designs.iter().filter(is_kept).map(|design| design.point).collect()
}

/// Points of the level `fine` of a plan, by whether they have to run by what is known of the coarser level.
pub(crate) struct Screened<'a> {
    /// Number of points that have to run.
    pub kept: usize,
    /// Points that have to run and have not.
    pub pending: Vec<&'a Point>,
    /// Others, with the reason.
    pub dropped: Vec<(&'a Point, Outcome)>,
    /// Ranges of time and energy by workload, for notes.
    pub ranges: BTreeMap<String, [f64; 2]>,
}

/// Screens the points of level number `fine` of the plan by those of the level before.
///
/// # Errors
/// If a result cannot be read.
pub(crate) fn screened<'a>(
    plan: &'a SweepPlan,
    folder: &Folder,
    fine: usize,
) -> Result<Screened<'a>, SweepError> {
    let (mut workloads, mut ran) = (BTreeMap::<String, Vec<Design<'a>>>::new(), HashSet::new());
    for (coarse, point) in plan.of_level(fine - 1).iter().zip(plan.of_level(fine)) {
        let outcome = |point: &Point| folder.result(point).map(|result| result.map(|result| result.outcome));
        let (coarse, fine) = (outcome(coarse)?, outcome(point)?);
        if fine.as_ref().is_some_and(Outcome::ran) {
            ran.insert(point.id.as_str());
        }
        let [coarse, fine] = [&coarse, &fine].map(|outcome| outcome.as_ref().and_then(Outcome::measured));
        let stated = coarse.map_or([0.0; 2], stated);
        let design = Design { point, coarse: coarse.map(cost), fine: fine.map(cost), stated };
        workloads.entry(workload(point)).or_default().push(design);
    }
    let level = plan.screen[fine - 1];
    let mut all = Screened { kept: 0, pending: Vec::new(), dropped: Vec::new(), ranges: BTreeMap::new() };
    for (workload, designs) in workloads {
        let chosen = chosen(level, &designs);
        let ids: HashSet<&str> = chosen.iter().map(|point| point.id.as_str()).collect();
        let runs = |design: &&Design<'_>| {
            let id = design.point.id.as_str();
            ids.contains(id) || ran.contains(id)
        };
        let (runs, dropped): (Vec<&Design<'_>>, Vec<&Design<'_>>) = designs.iter().partition(runs);
        all.dropped.extend(dropped.into_iter().map(|design| (design.point, reason(level, design, &designs))));
        all.ranges.extend(range(&designs).map(|range| (workload, range)));
        all.kept += runs.len();
        all.pending.extend(chosen.into_iter().filter(|point| !ran.contains(point.id.as_str())));
    }
    Ok(all)
}

/// What designs are compared under: all settings that are neither of the hardware nor the level.
fn workload(point: &Point) -> String {
    let settings = point.settings.iter().filter(|set| !set.is_of_design() && &*set.path != "timing");
    settings.map(|set| format!("{}={}", set.path, set.value)).collect::<Vec<_>>().join(", ")
}

/// Note about a finished level.
pub(crate) fn note(coarse: Level, fine: Level, screened: &Screened<'_>) -> String {
    let most = |of: usize| screened.ranges.values().map(|range| range[of]).fold(0.0, f64::max);
    let [time, energy] = [0, 1].map(|of| 100.0 * (libm::exp(most(of)) - 1.0));
    let (kept, all) = (screened.kept, screened.kept + screened.dropped.len());
    let is_undecided = |(_, outcome): &&(&Point, Outcome)| matches!(outcome, Outcome::Undecided(_));
    let undecided = match screened.dropped.iter().filter(is_undecided).count() {
        0 => String::new(),
        count => format!("; {count} that it cannot distinguish from them are undecided"),
    };
    let nothing = match screened.dropped.is_empty() {
        true => format!(
            ". Screening saved nothing: {CALIBRATED} designs of a workload always run, and no other is far enough from the frontier; leave \
             `screen` out"
        ),
        false => String::new(),
    };
    format!(
        "{kept} of {all} designs ran at {}: it differs from {} by a factor that varies by {time:.2} % in time and {energy:.2} % in \
         energy{undecided}{nothing}",
        fine.name(),
        coarse.name()
    )
}

#[cfg(test)]
mod tests {
    use std::collections::HashMap;

    use output::terminal::Progress;

    use super::*;
    use crate::{Shard, ShardWork, Status};

    fn points(count: usize) -> Vec<Point> {
        let setting = |number: usize| crate::Setting::new("gpu.core_hz", number.to_string());
        let point = |number| Point { id: format!("{number:03}"), settings: vec![setting(number)] };
        (0..count).map(point).collect()
    }

    /// Costs on a circle and outside of it, with a factor between levels that varies by at most `range`.
    fn designs(points: &[Point], range: f64) -> Vec<(Cost, Cost)> {
        let unit = |number: usize, salt: u64| {
            pipeline::random::unit(pipeline::random::mix(number as u64 * 7 + salt))
        };
        let one = |(number, _): (usize, &Point)| {
            let angle = unit(number, 1) * std::f64::consts::FRAC_PI_2;
            let out = 1.0 - 0.5 * unit(number, 2).powi(3);
            let fine = [1.0 - out * angle.cos(), 1.0 - out * angle.sin()];
            let factor = |salt| 0.3 + range * (unit(number, salt) - 0.5);
            ([fine[0] - factor(3), fine[1] - factor(4)], fine)
        };
        points.iter().enumerate().map(one).collect()
    }

    /// Runs until no more designs are kept; returns them.
    fn run<'a>(points: &'a [Point], costs: &[(Cost, Cost)]) -> Vec<&'a str> {
        run_by(points, costs, CALIBRATED)
    }

    fn run_by<'a>(points: &'a [Point], costs: &[(Cost, Cost)], calibrated: usize) -> Vec<&'a str> {
        let mut ran: Vec<bool> = vec![false; points.len()];
        loop {
            let design = |(at, point): (usize, &'a Point)| Design {
                point,
                coarse: Some(costs[at].0),
                fine: ran[at].then_some(costs[at].1),
                stated: [0.0; 2],
            };
            let designs: Vec<Design<'a>> = points.iter().enumerate().map(design).collect();
            let kept: Vec<&str> = kept(&designs, calibrated).iter().map(|point| point.id.as_str()).collect();
            let next: Vec<bool> = points
                .iter()
                .zip(&ran)
                .map(|(point, ran)| *ran || kept.contains(&point.id.as_str()))
                .collect();
            if next == ran {
                return points
                    .iter()
                    .zip(ran)
                    .filter(|(_, ran)| *ran)
                    .map(|(point, _)| point.id.as_str())
                    .collect();
            }
            ran = next;
        }
    }

    fn frontier<'a>(points: &'a [Point], costs: &[(Cost, Cost)]) -> Vec<&'a str> {
        let fine = |at: usize| costs[at].1;
        let dominated =
            |at: usize| (0..points.len()).any(|other| (0..2).all(|of| fine(other)[of] < fine(at)[of]));
        (0..points.len()).filter(|&at| !dominated(at)).map(|at| points[at].id.as_str()).collect()
    }

    /// Designs of a small GPU: clocks, rates and queues.
    const DESIGNS: &str = r#"
        name: "designs",
        settings: {"scene": "SCENE", "frames": (0, 1), "size": SIZE, "samples": 2LEVEL},
        axes: [
            Values(path: "gpu.core_hz", values: [200e6, 400e6, 800e6]),
            Values(path: "gpu.units.dram.channels", values: [1, 2, 4]),
            Values(path: "gpu.units.shader.cores", values: [1, 2, 4]),
            Values(path: "gpu.units.traversal.rates.tiles_visited", values: [0.25, 0.5, 1, 2]),
            Values(path: "gpu.units.depth.queue", values: [4, 16]),
        ],
    "#;

    /// Plan of these designs with further fields or at a level, run in a folder: costs by settings without
    /// the level, at the last level.
    fn costs(scene: &str, size: &str, more: &str) -> (HashMap<String, Cost>, Status, f64) {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("designs.ron");
        // A level, or fields of the file.
        let [level, more] = match Level::ALL.iter().any(|level| level.name() == more) {
            true => [format!(", \"timing\": \"{more}\""), String::new()],
            false => [String::new(), more.to_owned()],
        };
        let text = DESIGNS.replace("SCENE", scene).replace("SIZE", size).replace("LEVEL", &level);
        std::fs::write(&file, format!("({text}{more})")).unwrap();
        let plan = SweepPlan::load(&file, false, None).unwrap();
        let into = Folder::at(folder.path().join("out"));
        into.write_plan(&plan).unwrap();
        let started = cpu_time::ProcessTime::now();
        let work = ShardWork::new(&plan, &into, Shard::default(), false).unwrap();
        let status = work.run(&Progress::new(true)).unwrap();
        let host_s = started.elapsed().as_secs_f64();
        let last = plan.of_level(plan.screen.len().max(1) - 1);
        let of = |point: &Point| {
            let settings = point.settings.iter().filter(|set| &*set.path != "timing");
            let name =
                settings.map(|set| format!("{}={}", set.path, set.value)).collect::<Vec<_>>().join(" ");
            Some((name, cost(into.result(point).unwrap()?.outcome.measured()?)))
        };
        (last.iter().filter_map(of).collect(), status, host_s)
    }

    /// Share of the true frontier that screening has found within the stated error, and by how much a
    /// frontier design at worst lost: how far the nearest design found is behind it, in the worse of time and
    /// energy.
    fn recall(found: &[Cost], truth: &[Cost], stated: Cost) -> (f64, f64) {
        let is_better = |a: &Cost, b: &Cost| (0..2).all(|of| a[of] <= b[of]) && a != b;
        let optimal = || truth.iter().filter(|cost| !truth.iter().any(|other| is_better(other, cost)));
        let behind = |cost: &Cost, other: &Cost| [0, 1].map(|of| other[of] - cost[of]);
        let is_found = |cost: &&Cost| {
            let is_near = |other: &Cost| (0..2).all(|of| behind(cost, other)[of] <= stated[of]);
            found.iter().any(is_near)
        };
        let regret = |cost: &Cost| {
            let lost = found.iter().map(|other| behind(cost, other).into_iter().fold(0.0, f64::max));
            lost.fold(f64::INFINITY, f64::min)
        };
        let share = optimal().filter(is_found).count() as f64 / optimal().count() as f64;
        (share, libm::exp(optimal().map(regret).fold(0.0, f64::max)) - 1.0)
    }

    /// Stated errors of `packet`, as logarithms, of a run of `tiny`.
    fn stated_at_packet() -> Cost {
        let settings = [("scene", "tiny"), ("frames", "0..1"), ("samples", "1")];
        let settings = settings.map(|(path, value)| crate::Setting::new(path, value));
        let outcome = crate::execute::execute("a", &settings).outcome;
        outcome.measured().map(stated).unwrap()
    }

    #[test]
    fn screening_finds_the_frontier_of_all_designs_with_fewer_runs() {
        let (truth, ..) = costs("tiny", "(32, 24)", "stepped");
        let (screened, status, _) = costs("tiny", "(32, 24)", "screen: [bound, packet, stepped],");
        let [found, all] = [&screened, &truth].map(|costs| costs.values().copied().collect::<Vec<_>>());
        let stated = stated_at_packet();
        let (recall, regret) = recall(&found, &all, stated);
        println!(
            "recall {recall:.3}, regret {regret:.4}, {} of {} at the last level",
            found.len(),
            all.len()
        );
        assert_eq!((status.finished, status.failed), (3 * all.len(), 0));
        assert!(status.screened_out > 0 && found.len() * 20 < all.len());
        assert!(recall == 1.0 && regret <= libm::expm1(stated[0].max(stated[1])));
    }

    #[test]
    #[ignore = "takes minutes; prints the numbers of docs/guide/sweeps.md"]
    fn screening_and_all_designs_at_stepped() {
        for (scene, size) in [("default", "(320, 180)"), ("tiny", "(64, 48)")] {
            let (truth, _, all_s) = costs(scene, size, "stepped");
            let (screened, _, screened_s) = costs(scene, size, "screen: [bound, packet, stepped],");
            let [found, all] = [&screened, &truth].map(|costs| costs.values().copied().collect::<Vec<_>>());
            let (recall, regret) = recall(&found, &all, stated_at_packet());
            println!(
                "{scene}: {} designs, recall {recall:.3}, regret {regret:.4}, {} at stepped, {:.1} % of the time",
                all.len(),
                found.len(),
                100.0 * screened_s / all_s
            );
        }
    }

    /// Costs of the designs at all levels, by settings.
    fn at_all_levels(scene: &str, size: &str) -> (Vec<Point>, Vec<[Cost; 3]>) {
        let [bound, packet, stepped] =
            ["bound", "packet", "stepped"].map(|level| costs(scene, size, level).0);
        let mut all: Vec<(String, [Cost; 3])> = bound
            .into_iter()
            .map(|(name, cost)| (name.clone(), [cost, packet[&name], stepped[&name]]))
            .collect();
        all.sort_by(|a, b| a.0.cmp(&b.0));
        let point = |(name, costs): (String, [Cost; 3])| {
            (Point { id: name.clone(), settings: vec![crate::Setting::new("gpu", name)] }, costs)
        };
        all.into_iter().map(point).unzip()
    }

    #[test]
    #[ignore = "takes minutes; prints how often screening finds the frontier, for docs/guide/sweeps.md"]
    fn screening_by_many_draws() {
        let frames = [("default", "(320, 180)"), ("tiny", "(64, 48)"), ("tiny", "(32, 24)")];
        for (scene, size) in frames {
            let (points, costs) = at_all_levels(scene, size);
            let pairs: Vec<(Cost, Cost)> = costs.iter().map(|cost| (cost[0], cost[1])).collect();
            let truth: Vec<Cost> = costs.iter().map(|cost| cost[2]).collect();
            let stated = stated_at_packet();
            for designs in [8, 19, 39] {
                let (mut whole, mut worst, mut runs) = (0, 0.0_f64, [0; 2]);
                for seed in 0..200 {
                    // Another setting is another draw.
                    let mut points = points.clone();
                    let set = crate::Setting::new("seed", seed.to_string());
                    points.iter_mut().for_each(|point| point.settings.push(set.clone()));
                    let survivors = run_by(&points, &pairs, designs);
                    let design = |at: usize| {
                        let ran = survivors.contains(&points[at].id.as_str());
                        let [_, coarse, fine] = costs[at];
                        Design { point: &points[at], coarse: ran.then_some(coarse), fine: Some(fine), stated }
                    };
                    let all: Vec<Design<'_>> = (0..points.len()).map(design).collect();
                    let found = optimal(&all);
                    let is_found =
                        |design: &&Design<'_>| found.iter().any(|point| point.id == design.point.id);
                    let found: Vec<&Design<'_>> = all.iter().filter(is_found).collect();
                    assert!(found.iter().all(|design| design.is_within_stated()), "{scene} {size}");
                    let fine: Vec<Cost> = found.iter().filter_map(|design| design.fine).collect();
                    let (recall, regret) = recall(&fine, &truth, stated);
                    whole += u32::from(recall == 1.0);
                    worst = worst.max(regret);
                    runs = [runs[0] + survivors.len(), runs[1] + found.len()];
                }
                println!(
                    "{scene} {size}, {designs} designs: all of the frontier within the stated error in {whole} of 200, regret up to \
                     {:.2} %, {} at packet, {} at stepped",
                    100.0 * worst,
                    runs[0] / 200,
                    runs[1] / 200
                );
            }
        }
    }

    #[test]
    fn the_frontier_is_kept_where_factors_stay_within_their_range() {
        let points = points(200);
        for range in [0.0, 0.01, 0.05] {
            let costs = designs(&points, range);
            let (kept, frontier) = (run(&points, &costs), frontier(&points, &costs));
            assert!(frontier.iter().all(|id| kept.contains(id)), "{range}: {frontier:?}, {kept:?}");
            assert!(kept.len() < 120, "{range}: {} kept", kept.len());
        }
    }

    #[test]
    fn designs_that_packet_cannot_distinguish_are_undecided() {
        let points = points(5);
        let costs = [[0.0, 0.1], [0.1, 0.0], [0.1, 0.0], [0.11, 0.01], [0.9, 0.9]];
        let of = |stated, fine: [Option<Cost>; 5]| {
            let design = |((point, coarse), fine)| Design { point, coarse: Some(coarse), fine, stated };
            points.iter().zip(costs).zip(fine).map(design).collect::<Vec<_>>()
        };
        let ids =
            |chosen: Vec<&Point>| chosen.iter().map(|point| point.id.as_str()).collect::<Vec<_>>().concat();
        // One of two with equal costs runs.
        let designs = of([0.05; 2], [Some([0.02, 0.1]), None, None, None, None]);
        assert_eq!(ids(chosen(Level::Packet, &designs)), "000001");
        assert!(matches!(reason(Level::Packet, &designs[2], &designs), Outcome::Undecided(_)));
        assert!(matches!(reason(Level::Packet, &designs[3], &designs), Outcome::Undecided(_)));
        assert!(matches!(reason(Level::Packet, &designs[4], &designs), Outcome::ScreenedOut(_)));
        // One that ran is outside of the stated error: the range decides, from designs that run at both levels.
        let designs = of([0.05; 2], [Some([0.06, 0.1]), None, None, None, None]);
        assert_eq!(chosen(Level::Packet, &designs).len(), 5);
        // A coarser level says too little.
        assert_eq!(chosen(Level::Bound, &of([0.5; 2], [None; 5])).len(), 5);
    }

    #[test]
    fn a_design_that_the_coarse_level_alone_finds_bad_is_lost() {
        // The best design by far, at a coarse level that finds it the worst; all others agree.
        let points = points(100);
        let mut costs = designs(&points, 0.0);
        let last = (0..100).max_by_key(|&at| draw_order(&points[at])).unwrap();
        costs[last] = ([2.0, 2.0], [-1.0, -1.0]);
        assert!(!run(&points, &costs).contains(&points[last].id.as_str()));
    }

    #[test]
    fn screening_that_saves_nothing_says_so() {
        let of = |dropped| {
            let screened = Screened { kept: 3, pending: Vec::new(), dropped, ranges: BTreeMap::new() };
            note(Level::Bound, Level::Packet, &screened)
        };
        let points = points(1);
        let dropped = vec![(&points[0], Outcome::ScreenedOut(String::new()))];
        assert!(
            of(Vec::new()).contains("3 of 3 designs") && of(Vec::new()).contains("saved nothing: 39 designs")
        );
        assert!(of(dropped.clone()).contains("3 of 4 designs") && !of(dropped).contains("nothing"));
    }

    #[test]
    fn designs_that_failed_before_are_not_kept() {
        let points = points(3);
        let design = |point| Design { point, coarse: None, fine: None, stated: [0.0; 2] };
        assert!(kept(&points.iter().map(design).collect::<Vec<_>>(), CALIBRATED).is_empty());
    }
}
