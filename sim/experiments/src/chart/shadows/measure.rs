//! Errors and costs of shadow maps.

use std::time::Instant;

use activity::{Counts, Event};
use glam::Vec3;
use pipeline::sampling::SampleSource;
use pipeline::{Cull, Draw, PipelineSpec, SampleSpec, SampleTable, Settings, Viewport};
use serde::Serialize;
use workloads::accumulation::SharedSamples;
use workloads::soft_shadows::{
    AreaLight, LightSpec, Method, Renderer, ShadowMap, Shadows, View, World, depth_pass, stage,
};
use workloads::{Frame, Overrides, Scene};

use super::Effort;
use crate::chart::image::{errors, mean_square, neighbours};
use crate::study::StudyError;
use run::GpuSpec;

/// What a map took.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Cost {
    /// Passes over the geometry.
    pub passes: u32,
    /// Vertex shader runs.
    pub vertices: u64,
    /// Tiles visited, coarse ones not counted.
    pub tiles: u64,
    /// Samples tested.
    pub samples_tested: u64,
    /// Multiply-adds of set-up, tile tests, screens and sample tests.
    pub madds: u64,
    /// Bytes read from and written to memory.
    pub dram_bytes: u64,
    /// Seconds of the host.
    pub host_s: f64,
}

/// One size of the set.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Row {
    /// Places `(u, v, t)`.
    pub points: u32,
    /// Error against rays, linear light.
    pub rmse: f64,
    /// Correlation of the errors of pixels side by side: 0 is noise, near 1 a band.
    pub neighbour_correlation: f64,
    /// Whether both maps are equal to the bit.
    pub equal: bool,
    /// In one pass.
    pub one_pass: Cost,
    /// In a pass each.
    pub accumulation: Cost,
}

/// One depth bias.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Bias {
    /// In widths of a texel at the target.
    pub texels: f64,
    /// Share of lit samples that the map has in shadow.
    pub acne: f64,
    /// Share of samples in shadow that the map has lit.
    pub leak: f64,
}

/// The scene and the hardware.
pub(super) struct Stage {
    effort: Effort,
    scene: Scene,
    frame: Frame,
    light: AreaLight,
    gpu: GpuSpec,
}

/// The same with its draws.
pub(super) struct Bench<'a> {
    stage: &'a Stage,
    draws: &'a [Draw<'a>],
    world: World<'a>,
    viewport: Viewport,
}

impl Stage {
    pub fn new(effort: &Effort) -> Result<Self, StudyError> {
        let size = Some((effort.size[0], effort.size[1]));
        let scene = stage()?.with_overrides(&Overrides { size, ..Overrides::default() })?;
        let frame = scene.frame(1)?;
        let light = AreaLight::new(&LightSpec::default())?;
        Ok(Self { effort: *effort, scene, frame, light, gpu: GpuSpec::load("reference")? })
    }

    pub fn with<T>(&self, run: impl FnOnce(&Bench<'_>) -> Result<T, StudyError>) -> Result<T, StudyError> {
        let draws: Vec<_> = self
            .frame
            .draws(&self.scene)?
            .into_iter()
            .map(|draw| Draw { cull: Cull::None, ..draw })
            .collect();
        let albedos: Vec<_> =
            self.frame.meshes.iter().map(|mesh| self.scene.materials()[mesh.material].base_color).collect();
        let [width, height] = self.effort.size;
        let viewport = Viewport::new(width, height)
            .ok_or_else(|| StudyError::Pipeline("an image of no size".to_owned()))?;
        let view = View { camera: &self.frame.camera, draws: &draws };
        let world = World::new(&view, viewport, &self.light, &albedos, self.scene.background());
        run(&Bench { stage: self, draws: &draws, world, viewport })
    }
}

/// Seeds of references start here.
const REFERENCE_SEED: u64 = 1_000;
/// Samples a pixel of each of their tables, and light samples when biases are compared.
const MOST: u32 = 256;
/// Light samples when biases are compared.
const BIAS_POINTS: u32 = 16;
/// Biases in widths of a texel.
const BIASES: [f64; 9] = [0.0, 0.125, 0.25, 0.5, 1.0, 2.0, 4.0, 16.0, 64.0];

impl Bench<'_> {
    fn spec(&self) -> &PipelineSpec {
        &self.stage.gpu.pipeline
    }

    /// The mean of several tables, every sample asking by rays.
    pub fn reference(&self) -> Result<Vec<Vec3>, StudyError> {
        let tables = self.stage.effort.reference_tables;
        let mut sum = vec![Vec3::ZERO; self.viewport.pixels()];
        for seed in 0..u64::from(tables) {
            let table = SampleTable::new(&SampleSpec::default(), MOST, REFERENCE_SEED + seed)?;
            let image = self.by_rays(&table)?;
            sum.iter_mut().zip(image).for_each(|(sum, pixel)| *sum += pixel / tables as f32);
        }
        Ok(sum)
    }

    fn by_rays(&self, samples: &dyn SampleSource) -> Result<Vec<Vec3>, StudyError> {
        let settings =
            Settings { spec: self.spec(), viewport: self.viewport, samples, background: Vec3::ZERO };
        let seen = pipeline::frame::visibility(&self.stage.frame.camera, self.draws, &settings)
            .map_err(|error| StudyError::Pipeline(error.to_string()))?;
        Ok(self.world.image(samples, &seen, Shadows::Rays))
    }

    fn map(&self, set: &SharedSamples, method: Method) -> Result<(ShadowMap, Cost), StudyError> {
        let started = Instant::now();
        let renderer = Renderer { method, spec: self.spec() };
        let Stage { light, effort, .. } = self.stage;
        let map = ShadowMap::new(light, self.draws, effort.map_px, set, renderer, &mut |_, _| ())?;
        let host_s = started.elapsed().as_secs_f64();
        let passes = if method == Method::OnePass { 1 } else { set.samples().len() as u32 };
        let cost = cost(&map.counts, passes, host_s);
        Ok((map, cost))
    }

    /// Both maps over a set of so many places, and the image of one of them.
    pub fn row(&self, points: u32, reference: &[Vec3]) -> Result<Row, StudyError> {
        let set = SharedSamples::interleaved(&SampleSpec::default(), points, 1)?;
        let (map, one_pass) = self.map(&set, Method::OnePass)?;
        let (other, accumulation) = self.map(&set, Method::Accumulation)?;
        let bits = |map: &ShadowMap| map.depths().iter().map(|depth| depth.to_bits()).collect::<Vec<_>>();
        let seen = self.seen(&set)?;
        let shadows = Shadows::Map { map: &map, bias: self.stage.effort.bias };
        let image = self.world.image(&set, &seen, shadows);
        let errors = errors(&image, reference);
        Ok(Row {
            points,
            rmse: mean_square(&errors).sqrt(),
            neighbour_correlation: neighbours(&errors, self.viewport.width() as usize),
            equal: bits(&map) == bits(&other),
            one_pass,
            accumulation,
        })
    }

    fn seen(&self, set: &SharedSamples) -> Result<Vec<(u32, u32)>, StudyError> {
        let view = View { camera: &self.stage.frame.camera, draws: self.draws };
        let renderer = Renderer { method: Method::OnePass, spec: self.spec() };
        Ok(depth_pass(&view, self.viewport, set, renderer, &mut |_, _| ())?.samples)
    }

    /// Wrong shadows over the bias.
    pub fn biases(&self) -> Result<Vec<Bias>, StudyError> {
        let set = SharedSamples::interleaved(&SampleSpec::default(), BIAS_POINTS, 1)?;
        let (map, seen) = (self.map(&set, Method::OnePass)?.0, self.seen(&set)?);
        let truth = self.world.lit_and_unlit(&set, &seen, Shadows::Rays);
        let target = glam::DVec3::from_array(LightSpec::default().target);
        let texel = self.stage.light.texel_width(target, map.side());
        let row = |&texels: &f64| {
            let shadows = Shadows::Map { map: &map, bias: texels * texel };
            let found = self.world.lit_and_unlit(&set, &seen, shadows);
            let wrong = |lit: bool| {
                let those = truth.iter().zip(&found).filter(|(truth, _)| **truth == Some(lit));
                let (all, bad) = those.fold((0_u32, 0_u32), |(all, bad), (_, found)| {
                    (all + 1, bad + u32::from(*found == Some(!lit)))
                });
                f64::from(bad) / f64::from(all.max(1))
            };
            Bias { texels, acne: wrong(true), leak: wrong(false) }
        };
        Ok(BIASES.iter().map(row).collect())
    }
}

fn cost(counts: &Counts, passes: u32, host_s: f64) -> Cost {
    let madds = [Event::SetupMadds, Event::TileMadds, Event::ScreenMadds, Event::SampleMadds];
    Cost {
        passes,
        vertices: counts[Event::VertexInvocations],
        tiles: counts[Event::TilesVisited],
        samples_tested: counts[Event::SamplesTested],
        madds: madds.into_iter().map(|event| counts[event]).sum(),
        dram_bytes: counts[Event::DramReadBytes] + counts[Event::DramWriteBytes],
        host_s,
    }
}
