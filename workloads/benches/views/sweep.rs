//! Additional shading of two and seven views over one view, over one setting at a time.

use activity::Event;
use pipeline::depth::DepthSpec;
use pipeline::{CacheSpec, Features, Gpu, MemorySpec, PipelineSpec, Replacement, Shading, Viewport};
use workloads::multiview::{Layout, MultiviewRig, ViewTarget};
use workloads::{Overrides, Scene};

/// The hardware of `sim/run/gpus/reference.ron`.
pub fn hardware() -> PipelineSpec {
    let lines = CacheSpec::lru(256, 4);
    PipelineSpec {
        tile_px: 8,
        coarse_tile_px: 32,
        batch_triangles: 65_536,
        vertex_reuse: 32,
        shading: Shading::Cached,
        shading_cache: CacheSpec::lru(1024, 4),
        memory: MemorySpec {
            depth: lines,
            colour: lines,
            texture: lines,
            bins: None,
            l2: CacheSpec::lru(4096, 8),
            llc: None,
            edram: None,
            compression: Default::default(),
        },
        features: Features::ALL,
        depth: DepthSpec::default(),
        compute: None,
        warp_lanes: 32,
    }
}

/// Distance of the eyes in scene units, which are metres in the built-in scene: the mean of adults is 63 mm
/// (Dodgson 2004).
const EYES: f64 = 0.065;

/// One combination of settings.
#[derive(Clone)]
struct Point {
    scene: String,
    size: (u32, u32),
    /// Distance of the eyes, scene units.
    eyes: f64,
    /// Radius of an eye's lens, relative to the distance of the eyes.
    aperture: f64,
    shutter: f64,
    samples: u32,
    cache: CacheSpec,
}

impl Point {
    fn base() -> Self {
        Self {
            scene: std::env::var("QUINTILE_SCENE").unwrap_or_else(|_| "default".to_owned()),
            size: (320, 180),
            eyes: EYES,
            aperture: 0.4,
            shutter: 0.5,
            samples: 8,
            cache: CacheSpec::lru(1024, 4),
        }
    }

    /// Additional shading of one pass relative to the middle view alone: for two eyes, and for seven views on
    /// a line of the same length.
    fn increases(&self, hardware: &PipelineSpec) -> [f64; 2] {
        let over = Overrides { size: Some(self.size), shutter: Some(self.shutter), ..Overrides::default() };
        let scene = workloads::load(&self.scene).unwrap().with_overrides(&over).unwrap();
        let focus = scene.frame(18).unwrap().camera.lens().map_or(8.0, |lens| f64::from(lens.focus()));
        let (spacing, aperture) = (self.eyes, self.aperture * self.eyes);
        [Layout::stereo(spacing, aperture), Layout::line(7, spacing + 2.0 * aperture, aperture)]
            .map(|layout| self.increase(&scene, focus, &layout, hardware))
    }

    fn increase(&self, scene: &Scene, focus: f64, layout: &Layout, hardware: &PipelineSpec) -> f64 {
        let frame = scene.frame(18).unwrap();
        let draws = frame.draws(scene).unwrap();
        let rig = MultiviewRig::new(&frame.camera, focus as f32, layout, self.samples, 1).unwrap();
        let spec = PipelineSpec { shading_cache: self.cache, ..*hardware };
        let viewport = Viewport::new(self.size.0, self.size.1).unwrap();
        let to = ViewTarget { viewport, spec: &spec, background: scene.background(), places: &[] };
        let middle = (layout.views as usize - 1) / 2;
        let all = rig.one_pass(&draws, &to, &mut Gpu::without_packets(to.spec).unwrap()).unwrap().counts
            [Event::PixelInvocations];
        let one = rig.view(middle, &draws, &to, &mut Gpu::without_packets(to.spec).unwrap()).unwrap().counts
            [Event::PixelInvocations];
        all as f64 / one as f64 - 1.0
    }
}

fn line(what: &str, value: impl std::fmt::Display, point: &Point, hardware: &PipelineSpec) {
    let [two, seven] = point.increases(hardware).map(|increase| 100.0 * increase);
    println!("| {what} | {value} | {two:+.1} % | {seven:+.1} % |");
}

/// Prints all rows.
pub fn run(hardware: &PipelineSpec) {
    let base = Point::base();
    println!(
        "Frame 18 of `{}`, {}x{} pixels a view, {} samples, eyes {} apart with lenses of {} of that, shutter {}, {} entries\n",
        base.scene,
        base.size.0,
        base.size.1,
        base.samples,
        base.eyes,
        base.aperture,
        base.shutter,
        base.cache.entries
    );
    println!("| setting | value | two views | seven views |\n|---|---|---|---|");
    line("none", "as below", &base, hardware);
    for eyes in [0.01, 0.03, 0.14, 0.28, 0.56] {
        line("distance of eyes, scene units", eyes, &Point { eyes, ..base.clone() }, hardware);
    }
    for size in [(160, 90), (640, 360), (1280, 720)] {
        line("pixels", format!("{}x{}", size.0, size.1), &Point { size, ..base.clone() }, hardware);
    }
    for size in [(160, 90), (1280, 720)] {
        let point = Point { size, eyes: 0.28, ..base.clone() };
        line("eyes and pixels", format!("0.28, {}x{}", size.0, size.1), &point, hardware);
    }
    for aperture in [0.02, 0.1, 0.2, 0.49] {
        line("lens over distance of eyes", aperture, &Point { aperture, ..base.clone() }, hardware);
    }
    for shutter in [0.0, 0.1, 1.0] {
        line("shutter", shutter, &Point { shutter, ..base.clone() }, hardware);
    }
    for samples in [2, 4, 16, 32] {
        line("samples of a view", samples, &Point { samples, ..base.clone() }, hardware);
    }
    for entries in [64, 256, 4096, 16_384, 1 << 20] {
        line("entries", entries, &Point { cache: CacheSpec::lru(entries, 4), ..base.clone() }, hardware);
    }
    for (eyes, entries) in [(0.28, 64), (0.28, 4096), (0.28, 16_384), (0.28, 1 << 20)] {
        let point = Point { eyes, cache: CacheSpec::lru(entries, 4), ..base.clone() };
        line("eyes and entries", format!("{eyes}, {entries}"), &point, hardware);
    }
    for (name, replacement) in [("fifo", Replacement::Fifo), ("random", Replacement::Random { seed: 1 })] {
        let cache = CacheSpec { replacement, ..base.cache };
        line("replacement", name, &Point { cache, ..base.clone() }, hardware);
    }
}
