//! VI-16: with every test and shortcut on, every sample sees what it sees by brute force.

use activity::{Counts, Event};
use glam::Vec3;
use pipeline::depth::{DepthBound, DepthSpec};
use pipeline::{Cull, Features, PipelineSpec, RasterPass, Rendered, Settings, Target};
use rayon::prelude::*;
use run::{GpuSpec, RunError};
use workloads::stress::{Size, StressScene, brute_force};
use workloads::visibility::Unshaded;

use super::settings::{Bound, Hardware};
use super::{Task, catalogue};
use crate::reproduce::Done;
use crate::reproduce::band::Verdict;
use crate::reproduce::row::{Row, numbers, ran};
use crate::study::Ran;

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
            let draws = [scene.draw(&Unshaded).map_err(RunError::setting)?.culling(cull)];
            let truth = brute_force(&scene.camera, &draws, scene.viewport, &scene.samples);
            let settings =
                Settings { spec, viewport: scene.viewport, samples: &scene.samples, background: Vec3::ZERO };
            let pass = RasterPass::new(&scene.camera, &draws, &settings).onto(Target::Depth).with_visible();
            let Rendered { visible: seen, counts, .. } = pass.render(|_, _| ()).map_err(RunError::setting)?;
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

/// The machines of the settings, and others that show what a kind of culling takes away alone, or beyond another. What any of
/// them sees is compared with brute force.
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

    fn said(&self) -> String {
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
        machines.said(),
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
    Ok(Done::bare(Row { numbers: facts, ran, ..made }))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Savings of lens lines are compared with brute force, not counted beside it: machines of the settings have side planes, beside
    /// which lens lines take nothing away.
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
            wrong.total().differ == 3 && wrong.said().contains("lens lines and no other tile test: 3 of")
        );
    }
}
