//! CPU time of one 5D pass on one thread, compared with the same work in many passes.
//!
//! Run `cargo bench -p workloads --bench views`. With `sweep` after `--`, it prints how much shading several
//! views costs compared with one view (rows VI-13 and VI-14), over one setting at a time.

#![allow(clippy::unwrap_used, reason = "a benchmark that cannot run may as well panic")]

mod sweep;

use cpu_time::ProcessTime;
use glam::{DVec3, Vec3};
use pipeline::sampling::SampleSpec;
use pipeline::{Cull, Gpu, LensShape, PipelineSpec, SampleTable, Viewport};
use workloads::accumulation::SharedSamples;
use workloads::multiview::{Layout, MultiviewRig, ViewTarget};
use workloads::soft_shadows::{AreaLight, LightSpec, ShadowMap, ShadowMethod};
use workloads::{Overrides, glossy, soft_shadows};

const RUNS: usize = 3;

/// Median CPU time of several runs, in seconds.
fn time(mut run: impl FnMut()) -> f64 {
    let one = |_| {
        let started = ProcessTime::now();
        run();
        started.elapsed().as_secs_f64()
    };
    let mut seconds: Vec<f64> = (0..RUNS).map(one).collect();
    seconds.sort_by(f64::total_cmp);
    seconds[RUNS / 2]
}

/// A row: one pass and the others, each with its number of passes.
fn print_row(what: &str, one: f64, others: &[(&str, usize, f64)]) {
    for (name, passes, seconds) in others {
        println!(
            "| {what} | {:.1} ms | {name}, {passes} passes | {:.1} ms | {:.2} |",
            1e3 * one,
            1e3 * seconds,
            seconds / one
        );
    }
}

fn views(spec: &PipelineSpec) {
    let size = Overrides { size: Some((160, 90)), ..Overrides::default() };
    let scene = workloads::load("default").unwrap().with_overrides(&size).unwrap();
    let frame = scene.frame(18).unwrap();
    let draws = frame.draws(&scene).unwrap();
    let to = ViewTarget {
        viewport: Viewport::new(160, 90).unwrap(),
        spec,
        background: scene.background(),
        places: &[],
    };
    let focus = frame.camera.lens().unwrap().focus();
    for layout in [Layout::stereo(0.28, 0.11), Layout::line(7, 0.5, 0.11)] {
        let rig = MultiviewRig::new(&frame.camera, focus, &layout, 8, 1).unwrap();
        let passes = [layout.views as usize, rig.samples() as usize];
        let one =
            time(|| _ = rig.one_pass(&draws, &to, &mut Gpu::without_packets(to.spec).unwrap()).unwrap());
        let each =
            time(|| _ = rig.view_by_view(&draws, &to, &mut Gpu::without_packets(to.spec).unwrap()).unwrap());
        let many =
            time(|| _ = rig.accumulated(&draws, &to, &mut Gpu::without_packets(to.spec).unwrap()).unwrap());
        let what = format!("{} views, 160x90, 8 samples", layout.views);
        print_row(&what, one, &[("view by view", passes[0], each), ("accumulation", passes[1], many)]);
    }
}

fn gloss(spec: &PipelineSpec) {
    let scene = glossy::default_scene(false).unwrap();
    let frame = scene.frame(0).unwrap();
    let draws: Vec<_> =
        frame.draws(&scene).unwrap().into_iter().map(|draw| draw.culling(Cull::None)).collect();
    let eye = (DVec3::new(0.3, 2.0, 3.0), DVec3::new(-0.1, -1.0, -0.8));
    let map =
        glossy::Map::new(&glossy::receiver(), eye, glossy::GlossyEffect::Reflection, 0.25, 128).unwrap();
    for count in [16, 64] {
        let table = SampleTable::new(&SampleSpec::default(), count, 1).unwrap();
        let set = SharedSamples::interleaved(&SampleSpec::default(), count, 1).unwrap();
        let one = time(|| {
            _ = map.one_pass(&draws, &table, Vec3::ZERO, &mut Gpu::without_packets(spec).unwrap()).unwrap()
        });
        let many = time(|| {
            _ = map.accumulated(&draws, &set, Vec3::ZERO, &mut Gpu::without_packets(spec).unwrap()).unwrap()
        });
        let what = format!("glossy map, {}x128, {count} samples", map.viewport.width());
        print_row(&what, one, &[("accumulation", count as usize, many)]);
    }
}

fn shadows(spec: &PipelineSpec) {
    let scene = soft_shadows::default_scene().unwrap();
    let frame = scene.frame(1).unwrap();
    let draws: Vec<_> =
        frame.draws(&scene).unwrap().into_iter().map(|draw| draw.culling(Cull::None)).collect();
    let light = AreaLight::new(&LightSpec::default()).unwrap();
    let disk = SampleSpec { lens: LensShape::Disk, ..SampleSpec::default() };
    for count in [16, 64] {
        let set = SharedSamples::interleaved(&disk, count, 1).unwrap();
        let [one, many] = [ShadowMethod::OnePass, ShadowMethod::Accumulation].map(|method| {
            time(|| {
                let gpu = &mut Gpu::without_packets(spec).unwrap();
                _ = ShadowMap::new(&light, &draws, 256, &set, method, gpu).unwrap();
            })
        });
        let what = format!("shadow map, 256x256, {count} places");
        print_row(&what, one, &[("accumulation", count as usize, many)]);
    }
}

fn main() {
    let spec = sweep::hardware();
    if std::env::args().any(|arg| arg == "sweep") {
        return sweep::run(&spec);
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    println!("| what | one pass | the same otherwise | its time | over one pass |\n|---|---|---|---|---|");
    pool.install(|| {
        views(&spec);
        gloss(&spec);
        shadows(&spec);
    });
}
