//! Errors, blurs and costs of glossy maps.

use std::time::Instant;

use activity::Event;
use glam::{DVec3, Vec3};
use pipeline::sampling::SampleSource;
use pipeline::{Cull, Draw, Geometry, LensShape, SampleSpec, SampleTable};
use serde::Serialize;
use workloads::accumulation::{Rays, SharedSamples};
use workloads::glossy::{Effect, Lobe, Map, receiver, stage};
use workloads::{Frame, Scene};

use super::{Effort, ROUGHNESS};
use crate::chart::image::{White, errors, mean_square};
use crate::study::StudyError;
use run::GpuSpec;

/// One number of samples.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Row {
    /// Reflection or refraction.
    pub effect: &'static str,
    /// Samples of a texel.
    pub samples: u32,
    /// Error of one pass.
    pub rmse: f64,
    /// Error of accumulation, whose samples all texels share.
    pub accumulated_rmse: f64,
    /// Vertex shader runs of one pass.
    pub vertices: u64,
    /// Those of accumulation.
    pub accumulated_vertices: u64,
    /// Samples tested in one pass.
    pub samples_tested: u64,
    /// Those of accumulation.
    pub accumulated_samples_tested: u64,
    /// Seconds of the host for one pass.
    pub host_s: f64,
    /// Those for accumulation.
    pub accumulated_host_s: f64,
}

/// The blur of an edge at one height.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Blur {
    /// Above the plane, scene units.
    pub height: f64,
    /// Its width on the plane as found in the map, scene units.
    pub width: f64,
    /// That of geometry.
    pub expected: f64,
}

/// One radius of the lens.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Wide {
    /// Over half of the receiver's shorter side.
    pub over_half: f64,
    /// Error of 16 samples against rays through the same lens: noise.
    pub rmse_of_samples: f64,
    /// Error of the lens as a model of a surface of one roughness: rays through it against rays in a cone that is the same everywhere.
    pub rmse_of_lobe: f64,
}

/// The stage for an effect.
pub struct Bench {
    scene: Scene,
    frame: Frame,
    gpu: GpuSpec,
    effect: (&'static str, Effect),
    effort: Effort,
    radius: f64,
}

/// Seeds of references start here.
const REFERENCE_SEED: u64 = 1_000;
/// Heights at which blur is measured, and radii over half of the shorter side.
const HEIGHTS: [f64; 6] = [0.1, 0.2, 0.4, 0.8, 1.6, 3.2];
const RADII: [f64; 7] = [0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 4.0];
/// Samples of a texel where radii are compared.
const FEW: u32 = 16;

impl Bench {
    /// The stage.
    ///
    /// # Errors
    /// None that is expected.
    pub fn new(effect: (&'static str, Effect), effort: Effort) -> Result<Self, StudyError> {
        let scene = stage(effect.1 != Effect::Reflection)?;
        let frame = scene.frame(0)?;
        Ok(Self { scene, frame, gpu: GpuSpec::load("reference")?, effect, effort, radius: ROUGHNESS })
    }

    /// The same with a lens of another radius.
    #[must_use]
    pub fn with_radius(self, radius: f64) -> Self {
        Self { radius, ..self }
    }

    fn map(&self, radius: f64, texels: u32) -> Result<Map, StudyError> {
        let world = self.frame.camera.open().inverse();
        let eye: (DVec3, DVec3) = (world.translation.as_dvec3(), world.matrix3.z_axis.as_dvec3());
        Ok(Map::new(&receiver(), eye, self.effect.1, radius, texels)?)
    }

    fn draws(&self) -> Result<Vec<Draw<'_>>, StudyError> {
        let draws = self.frame.draws(&self.scene)?;
        Ok(draws.into_iter().map(|draw| Draw { cull: Cull::None, ..draw }).collect())
    }

    /// Brute force by rays through a lens.
    ///
    /// # Errors
    /// When the map cannot be.
    pub fn reference(&self, radius: f64) -> Result<Vec<Vec3>, StudyError> {
        self.by_rays(&self.map(radius, self.effort.texels)?, Lobe::Lens)
    }

    fn by_rays(&self, map: &Map, lobe: Lobe) -> Result<Vec<Vec3>, StudyError> {
        let seeds = 0..u64::from(self.effort.reference_tables);
        let tables = seeds.map(|seed| SampleTable::new(&SampleSpec::default(), 256, REFERENCE_SEED + seed));
        let tables = tables.collect::<Result<Vec<_>, _>>()?;
        let tables: Vec<&dyn SampleSource> = tables.iter().map(|table| table as &dyn SampleSource).collect();
        let colour = |mesh: &workloads::FrameMesh| self.scene.materials()[mesh.material].base_color;
        let colours: Vec<Vec3> = self.frame.meshes.iter().map(colour).collect();
        let rays = Rays::new(&self.draws()?);
        Ok(map.by_rays((&rays, &colours), &tables, self.scene.background(), lobe))
    }

    /// Both ways of making a map with so many samples.
    ///
    /// # Errors
    /// When the hardware cannot be built.
    pub fn row(&self, samples: u32, reference: &[Vec3]) -> Result<Row, StudyError> {
        let (map, draws) = (self.map(self.radius, self.effort.texels)?, self.draws()?);
        let look = (&self.gpu.pipeline, self.scene.background());
        let table = SampleTable::new(&SampleSpec::default(), samples, 1)?;
        let started = Instant::now();
        let (one, counts) = map.one_pass(&draws, &table, look, &mut |_, _| ())?;
        let host_s = started.elapsed().as_secs_f64();
        let set = SharedSamples::interleaved(&SampleSpec::default(), samples, 1)?;
        let started = Instant::now();
        let (many, many_counts) = map.accumulated(&draws, &set, look, &mut |_, _| ())?;
        let rmse = |image: &[Vec3]| mean_square(&errors(image, reference)).sqrt();
        Ok(Row {
            effect: self.effect.0,
            samples,
            rmse: rmse(&one),
            accumulated_rmse: rmse(&many),
            vertices: counts[Event::VertexInvocations],
            accumulated_vertices: many_counts[Event::VertexInvocations],
            samples_tested: counts[Event::SamplesTested],
            accumulated_samples_tested: many_counts[Event::SamplesTested],
            host_s,
            accumulated_host_s: started.elapsed().as_secs_f64(),
        })
    }

    /// The width of an edge's blur in the map over its height, through a square lens: a straight ramp.
    ///
    /// # Errors
    /// When the hardware cannot be built.
    pub fn blurs(&self) -> Result<Vec<Blur>, StudyError> {
        let map = self.map(self.radius, 64)?;
        let table =
            SampleTable::new(&SampleSpec { lens: LensShape::Square, ..SampleSpec::default() }, 64, 1)?;
        let blur = |&height: &f64| {
            let y = height as f32;
            let corners =
                [[0.0, -99.0], [99.0, -99.0], [99.0, 99.0], [0.0, 99.0]].map(|[x, z]| Vec3::new(x, y, z));
            let refused = |error: pipeline::DrawError| StudyError::Pipeline(error.to_string());
            let geometry = Geometry::new(&corners, &corners, &[[0, 1, 2], [0, 2, 3]]).map_err(refused)?;
            let draws = [Draw { geometry, shader: &White, cull: Cull::None }];
            let look = (&self.gpu.pipeline, Vec3::ZERO);
            let (image, _) = map.one_pass(&draws, &table, look, &mut |_, _| ())?;
            let width = ramp(&image, map.viewport.width() as usize) * map.texel();
            Ok(Blur { height, width, expected: map.blur(height) })
        };
        HEIGHTS.iter().map(blur).collect()
    }

    /// Lenses up to four times as wide as the receiver.
    pub(super) fn wides(&self) -> Result<Vec<Wide>, StudyError> {
        let half = receiver().half;
        let half = half[0].min(half[1]);
        let wide = |&over_half: &f64| {
            let map = self.map(over_half * half, self.effort.texels)?;
            let truth = self.by_rays(&map, Lobe::Lens)?;
            let cone = self.by_rays(&map, Lobe::Cone)?;
            let table = SampleTable::new(&SampleSpec::default(), FEW, 1)?;
            let look = (&self.gpu.pipeline, self.scene.background());
            let (few, _) = map.one_pass(&self.draws()?, &table, look, &mut |_, _| ())?;
            let rmse = |image: &[Vec3]| mean_square(&errors(image, &truth)).sqrt();
            Ok(Wide { over_half, rmse_of_samples: rmse(&few), rmse_of_lobe: rmse(&cone) })
        };
        RADII.iter().map(wide).collect()
    }
}

/// The width in texels of a straight ramp across an image, from the variance of its slope; the boxes of a texel and of a
/// difference add their own.
fn ramp(image: &[Vec3], width: usize) -> f64 {
    let column = |x: usize| image.iter().skip(x).step_by(width).map(|pixel| f64::from(pixel.x)).sum::<f64>();
    let columns: Vec<f64> = (0..width).map(column).collect();
    let slopes: Vec<f64> = columns.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect();
    let total: f64 = slopes.iter().sum();
    let moment =
        |power: i32| slopes.iter().enumerate().map(|(x, s)| s * (x as f64).powi(power)).sum::<f64>() / total;
    (12.0 * (moment(2) - moment(1) * moment(1)) - 2.0).max(0.0).sqrt()
}
