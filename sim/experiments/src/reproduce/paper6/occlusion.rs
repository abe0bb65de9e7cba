//! Rows VI-4 and VI-5: occlusion queries by intervals.

use output::plot::Series;
use pipeline::{IntervalAnswer, SampledAnswer};
use run::RunError;
use workloads::occlusion::WallSceneSpec;

use super::super::Done;
use super::super::band::{Cases, one_at_a_time, short};
use super::super::report::{Figure, over_doublings};
use super::super::row::{Number, Row, numbers, ran};
use super::Task;
use super::settings::QueriedObjects;
use crate::chart::occlusion::{Drawn, Kind, QueryAnswers};
use crate::study::Ran;

/// Draws the scenes of a kind, with `asked` queried boxes in each.
fn drawn(
    kind: Kind,
    scenes: u64,
    change: impl Fn(WallSceneSpec) -> WallSceneSpec,
    size: (u32, u32),
    samples: u32,
    asked: u32,
) -> Result<Vec<Drawn>, RunError> {
    let one = |seed| Drawn::new([size.0, size.1], &change(kind.spec(asked, seed)), samples);
    (0..scenes).map(one).collect::<Result<_, _>>().map_err(RunError::setting)
}

/// Answers of queries by intervals: objects hidden, those of them found, and those called hidden that a sample sees.
#[derive(Clone, Copy, Default)]
struct Share {
    hidden: u64,
    found: u64,
    wrong: u64,
    tiles: u64,
    /// Work of the interval queries.
    ran: Ran,
}

impl Share {
    fn of(scenes: &[Drawn], boxes: [u32; 3], tile_px: u32) -> Result<Self, RunError> {
        let mut share = Self::default();
        for scene in scenes {
            let asked = scene.ask(boxes, tile_px).map_err(RunError::setting)?;
            share.ran += asked.ran;
            for (answer, seen) in asked.answers.iter().zip(&scene.seen) {
                let hidden = seen.passed == 0;
                share.hidden += u64::from(hidden);
                share.found += u64::from(hidden && answer.hidden);
                share.wrong += u64::from(!hidden && answer.hidden);
                share.tiles += answer.tiles;
            }
        }
        Ok(share)
    }

    fn rate(&self) -> f64 {
        self.found as f64 / self.hidden.max(1) as f64
    }
}

/// Share of the hidden objects found over the number of boxes in time, with tiles of `tile_px`.
struct Rates {
    tile_px: u32,
    found: Vec<(f64, f64)>,
}

/// VI-4: the rate grows with the boxes in time.
pub(super) fn rate(task: &Task<'_>) -> Result<Done, RunError> {
    let with = task.with(|settings| &settings.vi_4);
    let (row, form) = (with.settings, with.form);
    let (size, asked) = (*row.size_px.get(form), *row.asked.get(form));
    let mut total = Share::default();
    let mut measure = |motion: f32, tile_px: u32| -> Result<Vec<(f64, f64)>, RunError> {
        let change = |spec| WallSceneSpec { motion, ..spec };
        let scenes = drawn(Kind::Motion, *row.yards.get(form), change, size, *row.samples.get(form), asked)?;
        total.ran += scenes.iter().map(|scene| scene.ran).sum();
        let at = |&boxes: &u32| {
            let share = Share::of(&scenes, [1, 1, boxes], tile_px)?;
            total.hidden += share.hidden;
            total.tiles += share.tiles;
            total.wrong += share.wrong;
            total.ran += share.ran;
            Ok((f64::from(boxes), share.rate()))
        };
        row.boxes_in_t.get(form).iter().map(at).collect()
    };
    let (motion, tile_px) = (*row.motion_m.get(form), *row.tile_px.get(form));
    let mut curves = Vec::new();
    let mut tiles = Vec::new();
    let mut sides = row.tile_px.all(form).to_vec();
    sides.sort_unstable();
    for side in sides {
        let rates = measure(motion, side)?;
        tiles.push((side, gain(&rates), grows(&rates)));
        curves.push(Rates { tile_px: side, found: rates });
    }
    let mut motions = Vec::new();
    for &motion in row.motion_m.all(form) {
        let rates = measure(motion, tile_px)?;
        motions.push((motion, gain(&rates), grows(&rates)));
    }
    let wrong = total.wrong;
    let mut tried = Cases::new(
        "share found gained by more boxes",
        "tile_px and motion_m one at a time about the values given",
    );
    let at = tiles.into_iter().map(|(side, gain, grows)| (side, gain, grows && wrong == 0));
    tried.along("tile_px", at).with_base(tile_px);
    let at = motions.into_iter().map(|(motion, gain, grows)| (motion, gain, grows && wrong == 0));
    tried.along("motion_m", at).with_base(motion);
    let full = one_at_a_time([row.tile_px.values(), row.motion_m.values()]);
    let band = tried.band(full)?;
    let (ours, facts) = rates_found(&curves, tile_px, wrong);
    let mut ran = ran(&total.ran);
    let queried = [("hidden_objects_queried", total.hidden as f64), ("tiles", total.tiles as f64)];
    ran.extend(numbers(queried));
    let row = Row { numbers: facts, ran, ..with.banded(&row.about, ours, band) };
    Ok(Done { row, figures: vec![rate_figure(curves)] })
}

/// The result in words and in numbers, with tiles of `tile_px`.
fn rates_found(curves: &[Rates], tile_px: u32, wrong: u64) -> (String, Vec<Number>) {
    let base = curves.iter().find(|rates| rates.tile_px == tile_px).map(|rates| &rates.found);
    let listed: Vec<String> =
        base.into_iter().flatten().map(|(boxes, rate)| format!("{boxes}: {rate:.3}")).collect();
    let ours = format!(
        "share of hidden objects found by boxes in t, {tile_px}-pixel tiles: {}; {wrong} seen objects called hidden",
        listed.join(", ")
    );
    let ends = base.and_then(|found| found.first().zip(found.last()));
    let facts = numbers([
        ("share_fewest_boxes", ends.map_or(f64::NAN, |(first, _)| first.1)),
        ("share_most_boxes", ends.map_or(f64::NAN, |(_, last)| last.1)),
        ("wrong", wrong as f64),
    ]);
    (ours, facts)
}

fn rate_figure(curves: Vec<Rates>) -> Figure {
    over_doublings(
        "VI_occlusion",
        [
            "Occlusion rate over boxes in time (Paper VI, section 3)",
            "share of the objects hidden from every sample that a query by intervals finds",
        ],
        ["boxes in t", "share found"],
        curves.into_iter().map(|of| Series::curve(format!("{}-pixel tiles", of.tile_px), of.found)).collect(),
    )
}

fn gain(rates: &[(f64, f64)]) -> f64 {
    rates.first().zip(rates.last()).map_or(f64::NAN, |(first, last)| last.1 - first.1)
}

/// Whether the share never falls, and grows in all.
fn grows(rates: &[(f64, f64)]) -> bool {
    rates.is_sorted_by(|a, b| a.1 <= b.1) && gain(rates) > 0.0
}

/// Tests, bytes and multiply-adds of both queries, summed over objects.
#[derive(Clone, Copy, Default)]
struct Costs {
    sampled: [f64; 3],
    interval: [f64; 3],
    objects: f64,
}

impl Costs {
    /// Over the queried objects; `charged` is the share of gathering the farthest depths that queries pay for. Of the two
    /// sampled queries, that which ends early costs less.
    fn of(scenes: &[(Drawn, QueryAnswers)], asked: QueriedObjects, charged: f64) -> Self {
        let mut costs = Self::default();
        for (scene, answered) in scenes {
            let share = charged / answered.answers.len().max(1) as f64;
            let gathered = [answered.gathered, answered.gathered_bytes].map(|count| share * count as f64);
            for (answer, seen) in answered.answers.iter().zip(&scene.seen) {
                if asked == QueriedObjects::All || seen.passed == 0 {
                    costs.add(seen, answer, gathered);
                }
            }
        }
        costs
    }

    fn add(&mut self, seen: &SampledAnswer, answer: &IntervalAnswer, [tests, bytes]: [f64; 2]) {
        let sampled = [seen.tests(), seen.bytes(), seen.madds].map(|count| count as f64);
        let interval =
            [answer.tests() as f64 + tests, answer.bytes() as f64 + bytes, answer.all_madds() as f64];
        for n in 0..3 {
            self.sampled[n] += sampled[n];
            self.interval[n] += interval[n];
        }
        self.objects += 1.0;
    }

    fn ratio(&self, of: usize) -> f64 {
        self.sampled[of] / self.interval[of]
    }
}

/// The least ratios of tests, bytes and multiply-adds over all kinds of blur and numbers of samples.
fn least(all: &[Costs]) -> [f64; 3] {
    [0, 1, 2].map(|of| all.iter().map(|costs| costs.ratio(of)).fold(f64::INFINITY, f64::min))
}

/// VI-5: what a query costs.
pub(super) fn cost(task: &Task<'_>) -> Result<Done, RunError> {
    let with = task.with(|settings| &settings.vi_5);
    let (row, form) = (with.settings, with.form);
    let (size, asked, tile_px) = (*row.size_px.get(form), *row.asked.get(form), *row.tile_px.get(form));
    let mut queried = Vec::new();
    for kind in Kind::ALL {
        for &samples in row.samples.get(form) {
            let scenes = drawn(kind, *row.yards.get(form), |spec| spec, size, samples, asked)?;
            let answered = |scene: Drawn| {
                let answered = scene.ask(kind.typical(), tile_px).map_err(RunError::setting)?;
                Ok((scene, answered))
            };
            queried.push(scenes.into_iter().map(answered).collect::<Result<Vec<_>, RunError>>()?);
        }
    }
    let costs = |objects, charged| {
        queried.iter().map(|scenes| Costs::of(scenes, objects, charged)).collect::<Vec<_>>()
    };
    let far = *row.far_fewer.get(form);
    let mut tried =
        Cases::new("times fewer tests or bytes, whichever are nearer", "objects and boxes_charged jointly");
    for &objects in row.objects.all(form) {
        let at = row.boxes_charged.all(form).iter().map(|&charged| {
            let [tests, bytes, _] = least(&costs(objects, charged));
            (charged, tests.min(bytes), tests > far && bytes > far)
        });
        let which = if objects == QueriedObjects::All { "all objects" } else { "hidden objects" };
        tried.along(&format!("boxes_charged ({which})"), at.collect::<Vec<_>>());
    }
    let full = row.objects.values() * row.boxes_charged.values();
    let band = tried.band(full)?;
    let base = costs(*row.objects.get(form), *row.boxes_charged.get(form));
    let [tests, bytes, madds] = least(&base);
    let charged = least(&costs(*row.objects.get(form), 1.0));
    let ours = format!(
        "at least {} times fewer tests, {} times fewer bytes, {} times fewer multiply-adds than sampled queries with Hi-Z that end at the first sample; \
         with the farthest depths gathered for the queries, which is compares alone, {} times fewer tests and {} times fewer bytes",
        short(tests),
        short(bytes),
        short(madds),
        short(charged[0]),
        short(charged[1])
    );
    let facts = numbers([
        ("least_tests_ratio", tests),
        ("least_bytes_ratio", bytes),
        ("least_madds_ratio", madds),
        ("least_tests_ratio_boxes_charged", charged[0]),
        ("least_bytes_ratio_boxes_charged", charged[1]),
    ]);
    let scenes = || queried.iter().flatten();
    let counted: u64 = scenes().flat_map(|(scene, _)| &scene.counted).map(SampledAnswer::tests).sum::<u64>();
    let mut ran = ran(&scenes().flat_map(|(scene, answered)| [scene.ran, answered.ran]).sum());
    ran.extend(numbers([
        ("gathered_depths", scenes().map(|(_, answered)| answered.gathered as f64).sum()),
        ("sampled_tests_counting_all", counted as f64),
        ("objects_queried", base.iter().map(|costs| costs.objects).sum()),
        ("sampled_tests", base.iter().map(|costs| costs.sampled[0]).sum()),
        ("interval_tests", base.iter().map(|costs| costs.interval[0]).sum()),
    ]));
    Ok(Done::bare(Row { numbers: facts, ran, ..with.banded(&row.about, ours, band) }))
}
