//! `quintile chart glossy`: glossy reflection and refraction on a planar receiver.
//!
//! Error is the root of the mean squared difference of the map to brute force by rays, over all texels and
//! channels in linear light. Beside one pass stand accumulation, whose samples all texels share, and ray
//! tracing with the samples of the one pass.

use std::time::Instant;

use activity::Event;
use glam::{DVec3, Vec3};
use output::OutputError;
use output::plot::{ChartPanel, Scale, Series};
use output::terminal::Progress;
use pipeline::sampling::SampleSource;
use pipeline::{Cull, Draw, Geometry, Gpu, LensShape, SampleSpec, SampleTable};
use run::GpuSpec;
use serde::Serialize;
use workloads::accumulation::{RayCaster, RayWork, SharedSamples};
use workloads::glossy::{GlossyEffect, Lobe, Map, default_scene, receiver};
use workloads::{Frame, Scene};

use crate::chart::{White, errors, mean_square};
use crate::study::table::{Sheet, TableBuilder, count, fixed, plain};
use crate::study::tradeoff::{Metric, TradeoffPoint};
use crate::study::{Gallery, Ran, Study, StudyError};

/// Effort of the measurement.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct GlossyEffort {
    /// Rows of texels of the map.
    pub texels: u32,
    /// Samples per texel go from 1 to this, doubling.
    pub most_samples: u32,
    /// Sample tables of 256 samples per texel that make up the reference.
    pub reference_tables: u32,
}

/// Radius of the lens where it does not vary, scene units.
const ROUGHNESS: f64 = 0.25;
/// Both effects, each with its name.
const EFFECTS: [(&str, GlossyEffect); 2] =
    [("reflection", GlossyEffect::Reflection), ("refraction", GlossyEffect::Refraction(1.33))];

/// Everything the chart found.
#[derive(Clone, Debug, Serialize)]
pub struct GlossyChart {
    /// Effort of the measurement.
    pub effort: GlossyEffort,
    /// By effect and samples.
    pub rows: Vec<GlossyRow>,
    /// Contact hardening: blur by height.
    pub blurs: Vec<Blur>,
    /// Failure cases: a lens as wide as the receiver, and wider.
    pub wides: Vec<Wide>,
}

impl Study for GlossyChart {
    const NAME: &'static str = "glossy";
    const ABOUT: &'static str =
        "Glossy reflection and refraction: error over samples, contact hardening, lenses too wide";
    const PICTURES: &'static [&'static str] = &["glossy_error", "glossy_blur", "glossy_failures"];
    const FILES: &'static [&'static str] = &["glossy.csv", "glossy.json"];

    type Effort = GlossyEffort;
    /// A reference of 4096 samples.
    const FULL: GlossyEffort = GlossyEffort { texels: 32, most_samples: 256, reference_tables: 16 };
    const QUICK: GlossyEffort = GlossyEffort { texels: 16, most_samples: 64, reference_tables: 2 };

    fn measure(effort: GlossyEffort, _scenes: &[String], progress: &Progress) -> Result<Self, StudyError> {
        let counts: Vec<u32> = (0..=effort.most_samples.ilog2()).map(|power| 1 << power).collect();
        let bar = progress.bar("glossy", (EFFECTS.len() * counts.len() + 2) as u64);
        let mut rows = Vec::new();
        for effect in EFFECTS {
            let bench = GlossyBench::new(effect, effort)?;
            let reference = bench.reference(ROUGHNESS)?;
            for &samples in &counts {
                rows.push(bench.row(samples, &reference)?);
                bar.inc();
            }
        }
        let bench = GlossyBench::new(EFFECTS[0], effort)?;
        let blurs = bench.blurs()?;
        bar.inc();
        let wides = bench.wides()?;
        bar.inc();
        Ok(Self { effort, rows, blurs, wides })
    }

    fn draw(&self, to: &Gallery<'_>) -> Result<(), OutputError> {
        let subject = format!(
            "RMSE in linear light against {} rays a texel, a map of {} rows",
            256 * self.effort.reference_tables,
            self.effort.texels
        );
        to.chart("glossy_error", ["Glossy maps: error and cost", &subject], self.errors())?;
        let heights = "the width on the plane of the blur of an edge at some height, in a map of 64 rows; below a texel blurs are not resolved";
        to.chart("glossy_blur", ["Glossy maps: contact hardens", heights], vec![self.contact()])?;
        let title = "Where glossy maps fail: a lens wider than the receiver";
        to.chart("glossy_failures", [title, &subject], vec![self.failures()])
    }

    fn tables(&self) -> Vec<Sheet> {
        let rows = TableBuilder::of(&self.rows)
            .column("effect", "effect", |row| row.effect, plain)
            .column("samples", "samples", |row| row.samples, plain)
            .column("rmse", "RMSE", |row| row.rmse, fixed(5))
            .column("accumulated_rmse", "(accumulated)", |row| row.accumulated_rmse, fixed(5))
            .column("vertices", "vertices", |row| row.vertices, count)
            .column("accumulated_vertices", "(accumulated)", |row| row.accumulated_vertices, count)
            .data("samples_tested", |row| row.samples_tested)
            .data("accumulated_samples_tested", |row| row.accumulated_samples_tested)
            .column("host_s", "host s", |row| row.host_s, fixed(3))
            .column("accumulated_host_s", "(accumulated)", |row| row.accumulated_host_s, fixed(3))
            .column("traced_rmse", "traced RMSE", |row| row.traced.rmse, fixed(5))
            .column("traced_host_s", "(host s)", |row| row.traced.host_s, fixed(3))
            .column("nodes_per_ray", "nodes a ray", |row| row.traced.nodes_per_ray, fixed(1))
            .column("triangles_per_ray", "triangles a ray", |row| row.traced.triangles_per_ray, fixed(1));
        let blurs = TableBuilder::of(&self.blurs)
            .shown("height", |blur| blur.height, plain)
            .shown("blur", |blur| blur.width, fixed(4))
            .shown("expected", |blur| blur.expected, fixed(4));
        let wides = TableBuilder::of(&self.wides)
            .shown("lens over half of the receiver", |wide| wide.over_half, plain)
            .shown("RMSE of 16 samples", |wide| wide.rmse_of_samples, fixed(4))
            .shown("RMSE of the lobe", |wide| wide.rmse_of_lobe, fixed(4));
        vec![rows.csv("glossy.csv").sheet(), blurs.sheet(), wides.sheet()]
    }

    fn tradeoff(&self) -> Vec<TradeoffPoint> {
        let both = |row: &GlossyRow| {
            let level = format!("{} samples a texel", row.samples);
            let point = |method, rmse, host_s| {
                let metrics = [Metric::rmse(rmse), Metric::host_s(host_s)];
                TradeoffPoint::new(format!("glossy {}", row.effect), [method, &level], metrics)
            };
            [
                point("one pass", row.rmse, row.host_s),
                point("accumulation", row.accumulated_rmse, row.accumulated_host_s),
                point("ray tracing", row.traced.rmse, row.traced.host_s),
            ]
        };
        self.rows.iter().flat_map(both).collect()
    }
}

/// The methods.
const METHODS: [&str; 3] = ["one pass", "accumulation", "ray tracing"];

/// The radius, over half of the receiver's shorter side, from which on a run warns.
const WARNED: f64 = 1.0;

impl GlossyChart {
    /// For each effect the error over samples and over cost.
    fn errors(&self) -> Vec<ChartPanel> {
        let all = |effect: &'static str, of: fn(&GlossyRow) -> [(f64, f64); 3]| {
            let of_effect = move || self.rows.iter().filter(move |row| row.effect == effect);
            let curve =
                |method: usize| Series::curve(METHODS[method], of_effect().map(|row| of(row)[method]));
            (0..METHODS.len()).map(curve).collect::<Vec<_>>()
        };
        let samples: fn(&GlossyRow) -> [(f64, f64); 3] = |row| {
            [row.rmse, row.accumulated_rmse, row.traced.rmse].map(|rmse| (f64::from(row.samples), rmse))
        };
        let seconds: fn(&GlossyRow) -> [(f64, f64); 3] = |row| {
            [
                (row.host_s, row.rmse),
                (row.accumulated_host_s, row.accumulated_rmse),
                (row.traced.host_s, row.traced.rmse),
            ]
        };
        let tests: fn(&GlossyRow) -> [(f64, f64); 3] = |row| {
            [
                (row.samples_tested as f64, row.rmse),
                (row.accumulated_samples_tested as f64, row.accumulated_rmse),
                (row.traced.tests as f64, row.traced.rmse),
            ]
        };
        let panels = EFFECTS.iter().flat_map(|&(effect, _)| {
            let [over_cost, over_time] = ["cost", "host time"].map(|what| format!("{effect}, over {what}"));
            [
                ChartPanel::new(effect, ["samples a texel", "RMSE"], all(effect, samples))
                    .on(Scale::Doublings, Scale::Decades),
                ChartPanel::new(
                    &over_cost,
                    ["samples, or boxes and triangles, tested", "RMSE"],
                    all(effect, tests),
                ),
                ChartPanel::new(&over_time, ["seconds of the host", "RMSE"], all(effect, seconds)),
            ]
        });
        panels.collect()
    }

    /// Contact hardening.
    fn contact(&self) -> ChartPanel {
        let of = |width: fn(&Blur) -> f64| self.blurs.iter().map(move |blur| (blur.height, width(blur)));
        let found = Series::curve("found in the map", of(|blur| blur.width));
        let expected = Series::curve("2 R h / (d + h)", of(|blur| blur.expected));
        let axes = ["height over the plane (scene units)", "width on the plane (scene units)"];
        ChartPanel::new("blur of an edge", axes, vec![found, expected])
            .failing(Some(0.0..self.thinnest()), "thinner than a texel")
    }

    /// The lowest height at which the blur of the chart is found within a tenth, less a little.
    fn thinnest(&self) -> f64 {
        let found = |blur: &&Blur| (blur.width / blur.expected - 1.0).abs() < 0.1;
        self.blurs.iter().find(found).map_or(0.0, |blur| 0.8 * blur.height)
    }

    /// Lenses that are too wide.
    fn failures(&self) -> ChartPanel {
        let of = |error: fn(&Wide) -> f64| self.wides.iter().map(move |wide| (wide.over_half, error(wide)));
        let noise = Series::curve("noise of 16 samples", of(|wide| wide.rmse_of_samples));
        let lobe =
            Series::curve("lens against a cone that is the same everywhere", of(|wide| wide.rmse_of_lobe));
        let axes = ["radius of the lens over half of the receiver's shorter side", "RMSE"];
        ChartPanel::new("error", axes, vec![noise, lobe])
            .failing(Some(WARNED..f64::INFINITY), "a run warns: lens-wider-than-receiver")
    }
}

/// One number of samples.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct GlossyRow {
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
    /// Vertex shader runs of accumulation.
    pub accumulated_vertices: u64,
    /// Samples tested in one pass.
    pub samples_tested: u64,
    /// Samples tested in accumulation.
    pub accumulated_samples_tested: u64,
    /// Passes, draws and fragments of both.
    #[serde(skip)]
    pub ran: Ran,
    /// Seconds of the host for one pass.
    pub host_s: f64,
    /// Seconds of the host for accumulation.
    pub accumulated_host_s: f64,
    /// Ray tracing with the samples of the one pass.
    pub traced: Traced,
}

/// An image by ray tracing.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Traced {
    /// Error of the image.
    pub rmse: f64,
    /// Boxes and triangles tested.
    pub tests: u64,
    /// Boxes of nodes tested per ray.
    pub nodes_per_ray: f64,
    /// Triangles tested per ray.
    pub triangles_per_ray: f64,
    /// Seconds of the host; those for the tree are part of them.
    pub host_s: f64,
}

impl Traced {
    /// The error, the work of all rays and the seconds.
    pub fn new(rmse: f64, work: RayWork, host_s: f64) -> Self {
        let per_ray = |count: u64| count as f64 / work.rays.max(1) as f64;
        Self {
            rmse,
            tests: work.nodes + work.triangles,
            nodes_per_ray: per_ray(work.nodes),
            triangles_per_ray: per_ray(work.triangles),
            host_s,
        }
    }
}

/// The blur of an edge at one height.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Blur {
    /// Above the plane, scene units.
    pub height: f64,
    /// Width of the blur on the plane as found in the map, scene units.
    pub width: f64,
    /// Width by geometry.
    pub expected: f64,
}

/// One radius of the lens.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Wide {
    /// Over half of the receiver's shorter side.
    pub over_half: f64,
    /// Error of 16 samples against rays through the same lens: noise.
    pub rmse_of_samples: f64,
    /// Error of the lens as a model of a surface of one roughness: rays through it against rays in a cone
    /// that is the same everywhere.
    pub rmse_of_lobe: f64,
}

/// The stage for an effect.
pub struct GlossyBench {
    scene: Scene,
    frame: Frame,
    gpu: GpuSpec,
    effect: (&'static str, GlossyEffect),
    effort: GlossyEffort,
    radius: f64,
}

/// Seeds of references start here.
const REFERENCE_SEED: u64 = 1_000;
/// Heights at which blur is measured, and radii over half of the shorter side.
const HEIGHTS: [f64; 6] = [0.1, 0.2, 0.4, 0.8, 1.6, 3.2];
const RADII: [f64; 7] = [0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 4.0];
/// Samples of a texel where radii are compared.
const FEW: u32 = 16;

impl GlossyBench {
    /// The stage.
    ///
    /// # Errors
    /// None that is expected.
    pub fn new(effect: (&'static str, GlossyEffect), effort: GlossyEffort) -> Result<Self, StudyError> {
        let scene = default_scene(effect.1 != GlossyEffect::Reflection)?;
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
        Ok(draws.into_iter().map(|draw| draw.culling(Cull::None)).collect())
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
        Ok(self.traced(map, &tables, lobe)?.0)
    }

    /// Rays of all samples of `tables`, with their work.
    fn traced(
        &self,
        map: &Map,
        tables: &[&dyn SampleSource],
        lobe: Lobe,
    ) -> Result<(Vec<Vec3>, RayWork), StudyError> {
        let colour = |mesh: &workloads::FrameMesh| self.scene.materials()[mesh.material].base_color;
        let colours: Vec<Vec3> = self.frame.meshes.iter().map(colour).collect();
        let rays = RayCaster::new(&self.draws()?);
        Ok(map.by_rays((&rays, &colours), tables, self.scene.background(), lobe))
    }

    /// All ways of making a map with so many samples.
    ///
    /// # Errors
    /// When the hardware cannot be built.
    pub fn row(&self, samples: u32, reference: &[Vec3]) -> Result<GlossyRow, StudyError> {
        let (map, draws) = (self.map(self.radius, self.effort.texels)?, self.draws()?);
        let (spec, background) = (&self.gpu.pipeline, self.scene.background());
        let table = SampleTable::new(&SampleSpec::default(), samples, 1)?;
        let started = Instant::now();
        let one = map.one_pass(&draws, &table, background, &mut Gpu::without_packets(spec)?)?;
        let counts = one.counts;
        let host_s = started.elapsed().as_secs_f64();
        let set = SharedSamples::interleaved(&SampleSpec::default(), samples, 1)?;
        let started = Instant::now();
        let (many, many_counts) =
            map.accumulated(&draws, &set, background, &mut Gpu::without_packets(spec)?)?;
        let accumulated_host_s = started.elapsed().as_secs_f64();
        let started = Instant::now();
        let (traced, work) = self.traced(&map, &[&table], Lobe::Lens)?;
        let traced_host_s = started.elapsed().as_secs_f64();
        let rmse = |image: &[Vec3]| mean_square(&errors(image, reference)).sqrt();
        Ok(GlossyRow {
            effect: self.effect.0,
            samples,
            rmse: rmse(&one.into_image()),
            accumulated_rmse: rmse(&many),
            vertices: counts[Event::VertexInvocations],
            accumulated_vertices: many_counts[Event::VertexInvocations],
            samples_tested: counts[Event::SamplesTested],
            accumulated_samples_tested: many_counts[Event::SamplesTested],
            ran: [(1, &counts), (u64::from(samples), &many_counts)]
                .map(|(n, c)| Ran::counted(n, c))
                .into_iter()
                .sum(),
            host_s,
            accumulated_host_s,
            traced: Traced::new(rmse(&traced), work, traced_host_s),
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
            let draws = [Draw::new(geometry, &White, Cull::None)];
            let gpu = &mut Gpu::images_only(&self.gpu.pipeline)?;
            let image = map.one_pass(&draws, &table, Vec3::ZERO, gpu)?.into_image();
            let width = ramp(&image, map.viewport.width() as usize) * map.texel();
            Ok(Blur { height, width, expected: map.blur(height) })
        };
        HEIGHTS.iter().map(blur).collect()
    }

    /// Lenses up to four times as wide as the receiver.
    fn wides(&self) -> Result<Vec<Wide>, StudyError> {
        let half = receiver().half;
        let half = half[0].min(half[1]);
        let wide = |&over_half: &f64| {
            let map = self.map(over_half * half, self.effort.texels)?;
            let truth = self.by_rays(&map, Lobe::Lens)?;
            let cone = self.by_rays(&map, Lobe::Cone)?;
            let table = SampleTable::new(&SampleSpec::default(), FEW, 1)?;
            let gpu = &mut Gpu::images_only(&self.gpu.pipeline)?;
            let few = map.one_pass(&self.draws()?, &table, self.scene.background(), gpu)?.into_image();
            let rmse = |image: &[Vec3]| mean_square(&errors(image, &truth)).sqrt();
            Ok(Wide { over_half, rmse_of_samples: rmse(&few), rmse_of_lobe: rmse(&cone) })
        };
        RADII.iter().map(wide).collect()
    }
}

/// The width in texels of a straight ramp across an image, from the variance of its slope; the boxes of a
/// texel and of a difference add their own.
fn ramp(image: &[Vec3], width: usize) -> f64 {
    let column = |x: usize| image.iter().skip(x).step_by(width).map(|pixel| f64::from(pixel.x)).sum::<f64>();
    let columns: Vec<f64> = (0..width).map(column).collect();
    let slopes: Vec<f64> = columns.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect();
    let total: f64 = slopes.iter().sum();
    let moment =
        |power: i32| slopes.iter().enumerate().map(|(x, s)| s * (x as f64).powi(power)).sum::<f64>() / total;
    (12.0 * (moment(2) - moment(1) * moment(1)) - 2.0).max(0.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::written;

    #[test]
    fn more_samples_err_less_contact_hardens_and_wide_lenses_fail() {
        let least = GlossyEffort { texels: 10, most_samples: 16, reference_tables: 1 };
        let (_folder, chart, _) = written::<GlossyChart>(least);
        for rows in chart.rows.chunks_exact(5) {
            assert!(rows[4].rmse < 0.6 * rows[0].rmse, "{rows:?}");
            assert!(rows[4].vertices < rows[4].accumulated_vertices);
            // The same samples: they differ where rounding decides an edge.
            let all = |row: &GlossyRow| (row.traced.rmse / row.rmse - 1.0).abs() < 0.02;
            assert!(rows.iter().all(all), "{rows:?}");
            assert!(rows.iter().all(|row| row.traced.nodes_per_ray >= 1.0));
        }
        assert!(chart.blurs.windows(2).all(|pair| pair[0].width < pair[1].width), "{:?}", chart.blurs);
        let (narrow, wide) = (&chart.wides[0], chart.wides.last().unwrap());
        assert!(wide.rmse_of_lobe > 2.0 * narrow.rmse_of_lobe, "{narrow:?} {wide:?}");
    }
}
