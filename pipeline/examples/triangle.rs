//! Renders one moving, defocused triangle and prints the work that it caused.

use activity::Event;
use glam::{Affine3A, Vec3, Vec4};
use pipeline::depth::DepthSpec;
use pipeline::{
    CacheSpec, Camera, Cull, Draw, Features, Geometry, Lane, Lens, LensShape, MemorySpec, PipelineSpec,
    RasterPass, SampleTable, Settings, Shader, Shading, ShadingPoint, Viewport,
};

/// A surface of one colour.
struct White;

impl Shader for White {
    fn shade(&self, _: &Lane, _: &ShadingPoint, _: Vec4) -> Vec4 {
        Vec4::ONE
    }
}

fn hardware() -> PipelineSpec {
    let lines = CacheSpec::lru(256, 4);
    PipelineSpec {
        tile_px: 8,
        coarse_tile_px: 32,
        batch_triangles: 100,
        vertex_reuse: 16,
        shading: Shading::default(),
        shading_cache: CacheSpec::lru(1024, 4),
        memory: MemorySpec {
            depth: lines,
            colour: lines,
            texture: lines,
            bins: None,
            l2: lines,
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

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let camera = Camera::new(Affine3A::IDENTITY, 1.0, 0.1)?.with_lens(Some(Lens::new(0.1, 2.0)?));
    let open = [Vec3::new(-1.0, -1.0, 3.0), Vec3::new(1.0, -1.0, 3.0), Vec3::new(0.0, 1.0, 3.0)];
    let close = open.map(|corner| corner + 0.5 * Vec3::X);
    let geometry = Geometry::new(&open, &close, &[[0, 1, 2]])?;
    let samples = SampleTable::low_discrepancy(16, 1, LensShape::Disk)?;
    let viewport = Viewport::new(64, 64).ok_or("an image without pixels")?;
    let settings = Settings { spec: &hardware(), viewport, samples: &samples, background: Vec3::ZERO };
    let draws = [Draw::new(geometry, &White, Cull::None)];
    let mut packets = 0;
    let rendered = RasterPass::new(&camera, &draws, &settings).render(|_, _| packets += 1)?;
    println!("{packets} packets, {} samples hit", rendered.counts[Event::SamplesHit]);
    Ok(())
}
