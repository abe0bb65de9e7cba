//! Bounds of loaded depths: found once for each tile, where they are needed, and counted.

use activity::{Counts, Event};
use glam::Vec3;
use pipeline::depth::DepthSpec;
use pipeline::*;

use crate::common::stage::*;
use crate::common::*;

/// A triangle over all of the image at a depth.
fn screen(depth: f32) -> [Vec3; 3] {
    [[-600.0, -600.0], [2000.0, -600.0], [-600.0, 2000.0]].map(|[x, y]| depth * Vec3::new(x, y, 1.0))
}

/// Events of a pass that loads depths of 1 and draws triangles at `depths`.
fn over_loaded(spec: &PipelineSpec, depths: &[f32]) -> Counts {
    let stage = Stage::sampled(16, 16, 1);
    let settings = Settings { spec, viewport: stage.viewport, samples: &stage.table, background: Vec3::ZERO };
    let mut gpu = Gpu::without_packets(spec).unwrap();
    let surface = gpu.create_surface(&SurfaceSpec::new("depth", stage.viewport, Format::D32));
    let mut draw = |depth: Attachment<Clear>, at: &[f32]| {
        let corners: Vec<[Vec3; 3]> = at.iter().map(|depth| screen(*depth)).collect();
        let geometries = corners.iter().map(|three| Geometry::new(three, three, &[[0, 1, 2]]).unwrap());
        let draws: Vec<Draw<'_>> = geometries.map(|geometry| Draw::new(geometry, &RED, Cull::None)).collect();
        let targets = Attachments { colours: vec![], depth: Some(depth) };
        let pass = RasterPass::new(&stage.camera, &draws, &settings).onto(Target::Surfaces(&targets));
        gpu.draw(&pass).unwrap().counts
    };
    draw(Attachment::cleared(surface, Clear::default()), &[1.0]);
    draw(Attachment::loaded(surface), depths)
}

const EVENTS: [Event; 7] = [
    Event::DepthReads,
    Event::DepthLines,
    Event::ZCullTests,
    Event::ZMaxUpdates,
    Event::TilesCulledZMax,
    Event::SamplesTested,
    Event::DepthWrites,
];

fn counted(spec: &PipelineSpec, depths: &[f32]) -> [u64; 7] {
    let counts = over_loaded(spec, depths);
    EVENTS.map(|event| counts[event])
}

#[test]
fn loaded_depths_are_read_once_to_cull_by_them() {
    let all = spec(Features::ALL);
    // Four tiles of 64 samples, each of four lines, and a comparison of each triangle with each tile.
    assert_eq!(counted(&all, &[2.0]), [256, 16, 256 + 4, 4, 4, 0, 0]);
    assert_eq!(counted(&all, &[2.0, 3.0]), [256, 16, 256 + 8, 4, 8, 0, 0]);
    // What is in front is tested, too; its depths make new bounds for the triangle behind it.
    assert_eq!(counted(&all, &[0.5, 2.0]), [512, 32, 256 + 8, 4 + 4, 4, 256, 256]);
    // Boxes of time are bounded each on their own.
    let boxes = PipelineSpec { depth: DepthSpec { boxes: [1, 1, 4], ..all.depth }, ..all };
    assert_eq!(counted(&boxes, &[2.0])[..4], [256, 16, 256 + 16, 16]);
}

#[test]
fn what_does_not_cull_needs_no_bounds() {
    let none = spec(Features { z_max: false, ..Features::ALL });
    assert_eq!(counted(&none, &[2.0]), [256, 16, 0, 0, 0, 256, 0]);
}
