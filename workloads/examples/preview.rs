//! Renders frames of a scene to PNG: `preview SCENE WIDTHxHEIGHT SAMPLES OUT FRAME...`.
use std::time::Instant;
use pipeline::{LensShape, PipelineSpec, SampleTable, Settings, Viewport, linear_to_srgb8, render};
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let started = Instant::now();
    let scene = workloads::load(&args[1]).unwrap_or_else(|e| { eprintln!("{e}"); std::process::exit(1) });
    let (w, h) = args[2].split_once('x').unwrap();
    let (w, h): (u32, u32) = (w.parse().unwrap(), h.parse().unwrap());
    let n: u32 = args[3].parse().unwrap();
    let scene = scene.with_overrides(&workloads::Overrides { size: Some((w, h)), ..Default::default() }).unwrap();
    eprintln!("load {:?}; {} triangles; frames {:?}", started.elapsed(), scene.triangle_count(), scene.settings().frames);
    for warning in scene.warnings() { eprintln!("{warning}"); }
    let samples = SampleTable::low_discrepancy(n, 1, LensShape::Disk).unwrap();
    let spec = { use pipeline::*; let lines = CacheSpec { entries: 256, ways: 4 };
      PipelineSpec { tile_px: 8, coarse_tile_px: 64, batch_triangles: 4096, vertex_reuse: 16, shading_cache: CacheSpec { entries: 1024, ways: 4 },
      memory: MemorySpec { depth: lines, colour: lines, texture: lines, l2: CacheSpec { entries: 4096, ways: 8 } }, features: Features::ALL } };
    for index in args[5..].iter().map(|f| f.parse().unwrap()) {
        let t = Instant::now();
        let mut frame = scene.frame(index).unwrap(); if let Ok(k) = std::env::var("ONLY") { frame.meshes.retain(|m| m.name.contains(&k)); }
        let made = t.elapsed();
        let draws = frame.draws(&scene).unwrap();
        let settings = Settings { spec: &spec, viewport: Viewport::new(w, h).unwrap(), samples: &samples, background: scene.background() };
        let t = Instant::now();
        let out = render(&frame.camera, &draws, &settings, |_| ()).unwrap();
        eprintln!("frame {index}: made {made:?}, rendered {:?}", t.elapsed());
        let bytes: Vec<u8> = out.image.iter().flat_map(|c| [c.x, c.y, c.z].map(linear_to_srgb8)).collect();
        image::RgbImage::from_raw(w, h, bytes).unwrap().save(format!("{}-{index}.png", args[4])).unwrap();
    }
}
