//! VI-16: with every test and shortcut on, every sample sees what it sees by brute force.

use activity::{Counts, Event};
use glam::Vec3;
use pipeline::depth::{DepthBound, DepthSpec};
use pipeline::frame::render_depth;
use pipeline::{Cull, Draw, Features, PipelineSpec, Settings};
use rayon::prelude::*;
use workloads::stress::{Size, StressScene, brute_force};
use workloads::visibility::Unshaded;

use super::settings::{Bound, Hardware};
use super::{Task, catalogue};
use crate::reproduce::Done;
use crate::reproduce::row::{Row, numbers};
use crate::reproduce::verdict::Verdict;
use run::GpuSpec;
use run::RunError;

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
    counts: Counts,
}

impl Compared {
    /// A scene with all faces drawn, and with back faces culled.
    fn of(scene: &StressScene, spec: &PipelineSpec) -> Result<Self, RunError> {
        let mut all = Self::default();
        for cull in [Cull::None, Cull::Back] {
            let draws = [Draw { cull, ..scene.draw(&Unshaded).map_err(RunError::setting)? }];
            let truth = brute_force(&scene.camera, &draws, scene.viewport, &scene.samples);
            let settings =
                Settings { spec, viewport: scene.viewport, samples: &scene.samples, background: Vec3::ZERO };
            let (seen, counts) =
                render_depth(&scene.camera, &draws, &settings, |_, _| ()).map_err(RunError::setting)?;
            all.samples += seen.len() as u64;
            // A sample that one of them does not have differs as well.
            let missing = seen.len().abs_diff(truth.len());
            all.differ +=
                seen.iter().zip(&truth).filter(|(one, other)| one != other).count() as u64 + missing as u64;
            all.counts += &counts;
        }
        Ok(all)
    }

    fn and(mut self, other: &Self) -> Self {
        self.samples += other.samples;
        self.differ += other.differ;
        self.counts += &other.counts;
        self
    }
}

/// All scenes with the same hardware.
fn compared(scenes: &[StressScene], spec: &PipelineSpec) -> Result<Compared, RunError> {
    let each = scenes.par_iter().map(|scene| Compared::of(scene, spec)).collect::<Result<Vec<_>, _>>()?;
    Ok(each.iter().fold(Compared::default(), Compared::and))
}

/// What a kind of culling takes away that the others do not, or do not alone.
#[derive(Default)]
struct Apart {
    /// Samples that the lens lines spare where no other tile test runs, and beside the side planes.
    by_lens_lines: [u64; 2],
    /// Boxes, or whole tiles, that depths by planes cull beyond those by vertices.
    by_planes: u64,
    /// Boxes of a tile that are culled where the whole tile is not.
    by_boxes: u64,
}

impl Apart {
    fn new(scenes: &[StressScene], reference: &PipelineSpec, all: &[Hardware]) -> Result<Self, RunError> {
        let alone =
            Features { auto: false, side_planes: false, facing: false, edges: false, ..Features::ALL };
        let beside = Features { side_planes: true, ..alone };
        let by_lens_lines = [spared(scenes, reference, alone)?, spared(scenes, reference, beside)?];
        let mut apart = Self { by_lens_lines, ..Self::default() };
        for hardware in all.iter().filter(|one| matches!(one.bound, Bound::Planes | Bound::LocalPlanes)) {
            let planes = hardware.spec(reference);
            let depth = DepthSpec { bound: DepthBound::VerticesInTime, ..planes.depth };
            let [by_planes, by_vertices] = [planes.depth, depth].map(|depth| {
                let found = compared(scenes, &PipelineSpec { depth, ..planes })?;
                let [boxes, tiles] =
                    [Event::BoxesCulledZMax, Event::TilesCulledZMax].map(|e| found.counts[e]);
                Ok::<_, RunError>([boxes, boxes.saturating_sub(tiles)])
            });
            let ([boxes, within_tiles], [others, _]) = (by_planes?, by_vertices?);
            apart.by_planes += boxes.saturating_sub(others);
            apart.by_boxes += within_tiles;
        }
        Ok(apart)
    }
}

/// Samples that are tested without lens lines and not with them, beside the other tests in `features`.
fn spared(scenes: &[StressScene], reference: &PipelineSpec, features: Features) -> Result<u64, RunError> {
    let tested = |lens_lines| {
        let spec = PipelineSpec { features: Features { lens_lines, ..features }, ..*reference };
        Ok::<u64, RunError>(compared(scenes, &spec)?.counts[Event::SamplesTested])
    };
    Ok(tested(false)?.saturating_sub(tested(true)?))
}

/// VI-16.
pub(super) fn unchanged(task: &Task<'_>) -> Result<Done, RunError> {
    let with = task.with(|settings| &settings.vi_16);
    let (row, form) = (with.settings, with.form);
    let size = Size { side_px: *row.side_px.get(form), triangles: *row.triangles.get(form) };
    let scenes = catalogue(size, *row.values_of_each_family.get(form), *row.seed.get(form))?;
    let reference = GpuSpec::load("reference")?.pipeline;
    let (mut total, mut said) = (Compared::default(), Vec::new());
    for hardware in row.hardware.get(form) {
        let found = compared(&scenes, &hardware.spec(&reference))?;
        said.push(format!("{}: {} of {}", hardware.name, found.differ, found.samples));
        total = total.and(&found);
    }
    let apart = Apart::new(&scenes, &reference, row.hardware.get(form))?;
    let ours = format!(
        "samples that see another triangle or depth than by brute force in {} scenes, with all faces and with back faces culled: {}; \
         lens lines spare {} samples where no other tile test runs and {} beside side planes",
        scenes.len(),
        said.join("; "),
        apart.by_lens_lines[0],
        apart.by_lens_lines[1]
    );
    let counted = |event: Event| total.counts[event] as f64;
    let ran = numbers([
        ("samples", total.samples as f64),
        ("draws", counted(Event::Draws)),
        ("samples_hit", counted(Event::SamplesHit)),
        ("tiles_culled_by_side_planes", counted(Event::TilesCulledSides)),
        ("samples_spared_by_lens_lines_alone", apart.by_lens_lines[0] as f64),
        ("tiles_culled_by_facing", counted(Event::TilesCulledFacing)),
        ("tiles_culled_by_edges", counted(Event::TilesCulledEdges)),
        ("tiles_culled_by_z_max", counted(Event::TilesCulledZMax)),
        ("boxes_culled_by_z_max_in_other_tiles", apart.by_boxes as f64),
        ("boxes_culled_by_planes_beyond_vertices", apart.by_planes as f64),
        ("depth_reads_spared_by_z_min", counted(Event::DepthReadsSkipped)),
    ]);
    let facts = numbers([("samples", total.samples as f64), ("differ", total.differ as f64)]);
    let made =
        with.row(&row.about, (ours, Verdict::of(total.differ == 0 && total.samples > 0), String::new()));
    Ok(Done::bare(Row { numbers: facts, ran, ..made }))
}
