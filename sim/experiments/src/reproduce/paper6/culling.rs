//! Rows VI-4 and VI-5: occlusion queries by intervals. VI-16: with every test and shortcut on, every sample
//! sees what it sees by brute force.

use activity::{Counts, Event};
use glam::Vec3;
use output::plot::Series;
use pipeline::depth::{DepthBound, DepthSpec};
use pipeline::{
    Cull, Features, IntervalAnswer, PipelineSpec, RasterPass, Rendered, SampledAnswer, Settings, Target,
};
use rayon::prelude::*;
use run::{GpuSpec, RunError};
use workloads::occlusion::WallSceneSpec;
use workloads::stress::{Size, StressScene, brute_force};
use workloads::visibility::Unshaded;

use super::settings::{Bound, Cost, Hardware, QueriedObjects};
use super::{Task, catalogue};
use crate::chart::occlusion::{Drawn, OcclusionBlur, QueryAnswers};
use crate::reproduce::Done;
use crate::reproduce::report::{Figure, over_doublings};
use crate::reproduce::row::{Cases, ClaimRow, NamedValue, Verdict, numbers, one_at_a_time, ran, short};
use crate::reproduce::settings::Form;
use crate::study::Ran;

/// Draws the scenes of a kind, with `queries` queried boxes in each.
fn drawn(
    kind: OcclusionBlur,
    scenes: u64,
    change: impl Fn(WallSceneSpec) -> WallSceneSpec,
    size: (u32, u32),
    samples: u32,
    queries: u32,
) -> Result<Vec<Drawn>, RunError> {
    let one = |seed| Drawn::new([size.0, size.1], &change(kind.spec(queries, seed)), samples);
    Ok((0..scenes).map(one).collect::<Result<_, _>>()?)
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
            let queried = scene.query(boxes, tile_px)?;
            share.ran += queried.ran;
            for (answer, seen) in queried.answers.iter().zip(&scene.seen) {
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
    let (size, queries) = (*row.size_px.get(form), *row.asked.get(form));
    let mut total = Share::default();
    let mut measure = |motion: f32, tile_px: u32| -> Result<Vec<(f64, f64)>, RunError> {
        let change = |spec| WallSceneSpec { motion, ..spec };
        let scenes = drawn(
            OcclusionBlur::Motion,
            *row.yards.get(form),
            change,
            size,
            *row.samples.get(form),
            queries,
        )?;
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
    let row = ClaimRow { numbers: facts, ran, ..with.banded(&row.about, ours, band) };
    Ok(Done { row, figures: vec![rate_figure(curves)] })
}

/// The result in words and in numbers, with tiles of `tile_px`.
fn rates_found(curves: &[Rates], tile_px: u32, wrong: u64) -> (String, Vec<NamedValue>) {
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
    /// Over the queried objects; `charged` is the share of gathering the farthest depths that queries pay
    /// for. Of the two sampled queries, that which ends early costs less.
    fn of(scenes: &[(Drawn, QueryAnswers)], queried: QueriedObjects, charged: f64) -> Self {
        let mut costs = Self::default();
        for (scene, answered) in scenes {
            let share = charged / answered.answers.len().max(1) as f64;
            let gathered = [answered.gathered, answered.gathered_bytes].map(|count| share * count as f64);
            for (answer, seen) in answered.answers.iter().zip(&scene.seen) {
                if queried == QueriedObjects::All || seen.passed == 0 {
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

/// Scenes with both kinds of answers, for each kind of blur and number of samples.
type Queried = Vec<Vec<(Drawn, QueryAnswers)>>;

/// Queries all scenes of VI-5, by samples on a machine with tiles of `rival_px`.
fn queried(row: &Cost, form: Form, rival_px: u32) -> Result<Queried, RunError> {
    let machine = PipelineSpec { tile_px: rival_px, ..GpuSpec::load("reference")?.pipeline };
    let (size, asked, tile_px) = (*row.size_px.get(form), *row.asked.get(form), *row.tile_px.get(form));
    let mut all = Vec::new();
    for kind in OcclusionBlur::ALL {
        for &samples in row.samples.get(form) {
            let answered = |seed| {
                let scene = Drawn::on(machine, [size.0, size.1], &kind.spec(asked, seed), samples)?;
                let answered = scene.query(kind.typical(), tile_px)?;
                Ok((scene, answered))
            };
            all.push((0..*row.yards.get(form)).map(answered).collect::<Result<Vec<_>, RunError>>()?);
        }
    }
    Ok(all)
}

/// Costs by kind of blur and number of samples, as in [`Costs::of`].
fn costs(queried: &[Vec<(Drawn, QueryAnswers)>], objects: QueriedObjects, charged: f64) -> Vec<Costs> {
    queried.iter().map(|scenes| Costs::of(scenes, objects, charged)).collect()
}

/// VI-5: what a query costs.
pub(super) fn cost(task: &Task<'_>) -> Result<Done, RunError> {
    let with = task.with(|settings| &settings.vi_5);
    let (row, form) = (with.settings, with.form);
    let far = *row.far_fewer.get(form);
    let mut tried = Cases::new(
        "times fewer tests or bytes, whichever are nearer",
        "objects, boxes_charged and rival_tile_px jointly",
    );
    let mut machines = Vec::new();
    for &side in row.rival_tile_px.all(form) {
        let queried = queried(row, form, side)?;
        for &objects in row.objects.all(form) {
            let at = row.boxes_charged.all(form).iter().map(|&charged| {
                let [tests, bytes, _] = least(&costs(&queried, objects, charged));
                (charged, tests.min(bytes), tests > far && bytes > far)
            });
            let which = if objects == QueriedObjects::All { "all" } else { "hidden" };
            let of = format!("boxes_charged ({which} objects, {side}-pixel tiles of the rival)");
            tried.along(&of, at.collect::<Vec<_>>());
        }
        machines.push((side, queried));
    }
    let full = row.objects.values() * row.boxes_charged.values() * row.rival_tile_px.values();
    let band = tried.band(full)?;
    let rival_px = *row.rival_tile_px.get(form);
    let given = machines.iter().find(|(side, _)| *side == rival_px);
    let queried = given.map_or(&[][..], |(_, queried)| queried);
    let base = costs(queried, *row.objects.get(form), *row.boxes_charged.get(form));
    let [tests, bytes, madds] = least(&base);
    let charged = least(&costs(queried, *row.objects.get(form), 1.0));
    let ours = format!(
        "at least {} times fewer tests, {} times fewer bytes, {} times fewer multiply-adds than sampled queries with Hi-Z of {rival_px}-pixel tiles that end at the first sample; \
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
    Ok(Done::bare(ClaimRow { numbers: facts, ran, ..with.banded(&row.about, ours, band) }))
}

impl Hardware {
    fn spec(&self, reference: &PipelineSpec) -> PipelineSpec {
        let bound = match self.bound {
            Bound::Vertices => DepthBound::Vertices,
            Bound::VerticesInTime => DepthBound::VerticesInTime,
            Bound::Planes => DepthBound::Planes,
            Bound::LocalPlanes => DepthBound::LocalPlanes,
        };
        let (u, v, t) = self.boxes;
        let depth = DepthSpec { bound, boxes: [u, v, t], z_min: self.z_min };
        PipelineSpec { features: Features { auto: self.auto, ..Features::ALL }, depth, ..*reference }
    }
}

/// Samples compared with brute force, and what was done for that.
#[derive(Clone, Default)]
struct Compared {
    samples: u64,
    differ: u64,
    passes: u64,
    counts: Counts,
}

impl Compared {
    /// A scene with all faces drawn, and with back faces culled.
    fn of(scene: &StressScene, spec: &PipelineSpec) -> Result<Self, RunError> {
        let mut all = Self::default();
        for cull in [Cull::None, Cull::Back] {
            let draws = [scene.draw(&Unshaded)?.culling(cull)];
            let truth = brute_force(&scene.camera, &draws, scene.viewport, &scene.samples);
            let settings =
                Settings { spec, viewport: scene.viewport, samples: &scene.samples, background: Vec3::ZERO };
            let pass = RasterPass::new(&scene.camera, &draws, &settings).onto(Target::Depth).with_visible();
            let Rendered { visible: seen, counts, .. } = pass.render(|_, _| ())?;
            all.samples += seen.len() as u64;
            // A sample that one of them does not have differs as well.
            let missing = seen.len().abs_diff(truth.len());
            all.differ +=
                seen.iter().zip(&truth).filter(|(one, other)| one != other).count() as u64 + missing as u64;
            all.passes += 1;
            all.counts += &counts;
        }
        Ok(all)
    }

    fn and(mut self, other: &Self) -> Self {
        self.samples += other.samples;
        self.differ += other.differ;
        self.passes += other.passes;
        self.counts += &other.counts;
        self
    }
}

/// All scenes with the same hardware.
fn compared(scenes: &[StressScene], spec: &PipelineSpec) -> Result<Compared, RunError> {
    let each = scenes.par_iter().map(|scene| Compared::of(scene, spec)).collect::<Result<Vec<_>, _>>()?;
    Ok(each.iter().fold(Compared::default(), Compared::and))
}

/// A machine, and what it made of all scenes.
struct Machine {
    name: String,
    found: Compared,
}

impl Machine {
    fn new(name: &str, scenes: &[StressScene], spec: &PipelineSpec) -> Result<Self, RunError> {
        Ok(Self { name: name.to_owned(), found: compared(scenes, spec)? })
    }

    /// Boxes culled by `z_max`, and those of them that are no whole tiles.
    fn boxes_culled(&self) -> [u64; 2] {
        let [boxes, tiles] = [Event::BoxesCulledZMax, Event::TilesCulledZMax].map(|e| self.found.counts[e]);
        [boxes, boxes.saturating_sub(tiles)]
    }
}

/// The machines of the settings, and others that show what a kind of culling takes away alone, or beyond
/// another. What any of them sees is compared with brute force.
struct Machines {
    all: Vec<Machine>,
    /// Samples that the lens lines spare where no other tile test runs, and beside the side planes.
    by_lens_lines: [u64; 2],
    /// Boxes, or whole tiles, that depths by planes cull beyond those by vertices.
    by_planes: u64,
    /// Boxes of a tile that are culled where the whole tile is not.
    by_boxes: u64,
}

impl Machines {
    fn new(scenes: &[StressScene], reference: &PipelineSpec, all: &[Hardware]) -> Result<Self, RunError> {
        let mut machines = Self { all: Vec::new(), by_lens_lines: [0; 2], by_planes: 0, by_boxes: 0 };
        for hardware in all {
            machines.with_hardware(scenes, hardware, reference)?;
        }
        let none = Features {
            auto: false,
            side_planes: false,
            lens_lines: false,
            facing: false,
            edges: false,
            ..Features::ALL
        };
        let beside = Features { side_planes: true, ..none };
        machines.by_lens_lines = [
            machines.spared(
                scenes,
                reference,
                none,
                ["no tile test", "lens lines and no other tile test"],
            )?,
            machines.spared(
                scenes,
                reference,
                beside,
                ["side planes alone", "side planes and lens lines"],
            )?,
        ];
        Ok(machines)
    }

    /// A machine of the settings; one with planes also without them.
    fn with_hardware(
        &mut self,
        scenes: &[StressScene],
        hardware: &Hardware,
        reference: &PipelineSpec,
    ) -> Result<(), RunError> {
        let spec = hardware.spec(reference);
        let machine = Machine::new(&hardware.name, scenes, &spec)?;
        if matches!(hardware.bound, Bound::Planes | Bound::LocalPlanes) {
            let depth = DepthSpec { bound: DepthBound::VerticesInTime, ..spec.depth };
            let name = format!("{}, by vertices in place of planes", hardware.name);
            let vertices = Machine::new(&name, scenes, &PipelineSpec { depth, ..spec })?;
            let ([boxes, within_tiles], [others, _]) = (machine.boxes_culled(), vertices.boxes_culled());
            self.by_planes += boxes.saturating_sub(others);
            self.by_boxes += within_tiles;
            self.all.push(vertices);
        }
        self.all.push(machine);
        Ok(())
    }

    /// Samples that are tested without lens lines and not with them, beside the other tests in `features`.
    fn spared(
        &mut self,
        scenes: &[StressScene],
        reference: &PipelineSpec,
        features: Features,
        names: [&str; 2],
    ) -> Result<u64, RunError> {
        let machine = |lens_lines, name| {
            let spec = PipelineSpec { features: Features { lens_lines, ..features }, ..*reference };
            Machine::new(name, scenes, &spec)
        };
        let both = [machine(false, names[0])?, machine(true, names[1])?];
        let [without, with] = both.each_ref().map(|one| one.found.counts[Event::SamplesTested]);
        self.all.extend(both);
        Ok(without.saturating_sub(with))
    }

    fn total(&self) -> Compared {
        self.all.iter().fold(Compared::default(), |all, one| all.and(&one.found))
    }

    fn text(&self) -> String {
        let one = |one: &Machine| format!("{}: {} of {}", one.name, one.found.differ, one.found.samples);
        self.all.iter().map(one).collect::<Vec<_>>().join("; ")
    }
}

/// VI-16.
pub(super) fn unchanged(task: &Task<'_>) -> Result<Done, RunError> {
    let with = task.with(|settings| &settings.vi_16);
    let (row, form) = (with.settings, with.form);
    let size = Size { side_px: *row.side_px.get(form), triangles: *row.triangles.get(form) };
    let scenes = catalogue(size, *row.values_of_each_family.get(form), *row.seed.get(form))?;
    let machines = Machines::new(&scenes, &GpuSpec::load("reference")?.pipeline, row.hardware.get(form))?;
    let total = machines.total();
    let ours = format!(
        "samples that see another triangle or depth than by brute force in {} scenes, with all faces and with back faces culled: {}; \
         lens lines spare {} samples where no other tile test runs and {} beside side planes",
        scenes.len(),
        machines.text(),
        machines.by_lens_lines[0],
        machines.by_lens_lines[1]
    );
    let counted = |event: Event| total.counts[event] as f64;
    let mut ran = ran(&Ran::counted(total.passes, &total.counts));
    ran.extend(numbers([
        ("samples", total.samples as f64),
        ("tiles_culled_by_side_planes", counted(Event::TilesCulledSides)),
        ("samples_spared_by_lens_lines_alone", machines.by_lens_lines[0] as f64),
        ("tiles_culled_by_facing", counted(Event::TilesCulledFacing)),
        ("tiles_culled_by_edges", counted(Event::TilesCulledEdges)),
        ("tiles_culled_by_z_max", counted(Event::TilesCulledZMax)),
        ("boxes_culled_by_z_max_in_other_tiles", machines.by_boxes as f64),
        ("boxes_culled_by_planes_beyond_vertices", machines.by_planes as f64),
        ("depth_reads_spared_by_z_min", counted(Event::DepthReadsSkipped)),
    ]));
    let facts = numbers([
        ("machines", machines.all.len() as f64),
        ("samples", total.samples as f64),
        ("differ", total.differ as f64),
    ]);
    let made =
        with.row(&row.about, (ours, Verdict::of(total.differ == 0 && total.samples > 0), String::new()));
    Ok(Done::bare(ClaimRow { numbers: facts, ran, ..made }))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Savings of lens lines are compared with brute force, not counted beside it: machines of the settings
    /// have side planes, beside which lens lines take nothing away.
    #[test]
    fn every_machine_that_spares_something_is_compared() {
        let scenes = catalogue(Size { side_px: 16, triangles: 8 }, 1, 6).unwrap();
        let reference = GpuSpec::load("reference").unwrap().pipeline;
        let machines = Machines::new(&scenes, &reference, &[]).unwrap();
        let named = |name: &str| machines.all.iter().find(|one| one.name == name).unwrap();
        let [none, alone] = ["no tile test", "lens lines and no other tile test"].map(named);
        let tested = |one: &Machine| one.found.counts[Event::SamplesTested];
        assert!(machines.by_lens_lines[0] > 0);
        assert_eq!(machines.by_lens_lines[0], tested(none) - tested(alone));
        assert!(machines.all.iter().all(|one| one.found.samples == none.found.samples));
        assert_eq!((machines.total().samples, machines.total().differ), (4 * none.found.samples, 0));
        // A difference of any machine is one of the row.
        let mut wrong = machines;
        wrong.all[1].found.differ = 3;
        assert!(
            wrong.total().differ == 3 && wrong.text().contains("lens lines and no other tile test: 3 of")
        );
    }
}
