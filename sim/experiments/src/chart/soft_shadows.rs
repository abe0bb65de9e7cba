//! `quintile chart soft-shadows`: soft shadows from a five-dimensional shadow map against accumulation buffering.
//!
//! Error is the root of the mean squared difference to an image in which every sample asks the light by rays,
//! over all pixels and channels in linear light. Cost is that of making the map, in one pass and in as many
//! passes as light samples. Ray tracing, with samples of each pixel's own, has no map; for it the seconds of
//! shading count, and the trade-off adds them to the maps' too.

use std::time::Instant;

use activity::{Counts, Event};
use glam::Vec3;
use output::OutputError;
use output::plot::{ChartPanel, Scale, Series};
use output::terminal::Progress;
use pipeline::sampling::SampleSource;
use pipeline::{
    Cull, Draw, Gpu, PipelineSpec, RasterPass, SampleSpec, SampleTable, Settings, Target, Viewport,
};
use run::GpuSpec;
use serde::Serialize;
use workloads::accumulation::{RayWork, SharedSamples};
use workloads::soft_shadows::{
    AreaLight, LightSpec, SceneView, ShadowMap, ShadowMethod, Shadows, World, default_scene, depth_pass,
};
use workloads::{Frame, Overrides, Scene};

use crate::chart::glossy::Traced;
use crate::chart::{errors, mean_square, neighbours};
use crate::study::table::{Sheet, TableBuilder, count, fixed, plain};
use crate::study::tradeoff::{Metric, TradeoffPoint};
use crate::study::{Gallery, Study, StudyError};

/// Effort of the measurement.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct SoftShadowsEffort {
    /// Pixels of the image, across and down.
    pub size: [u32; 2],
    /// Texels of the map across and down.
    pub map_px: u32,
    /// Places `(u, v, t)` go from 1 to this, doubling.
    pub most_points: u32,
    /// Sample tables of 256 samples per pixel that make up the reference.
    pub reference_tables: u32,
    /// Depth bias, scene units.
    pub bias: f64,
}

/// Everything the chart found.
#[derive(Clone, Debug, Serialize)]
pub struct SoftShadowsChart {
    /// Effort of the measurement.
    pub effort: SoftShadowsEffort,
    /// Samples per pixel of the reference.
    pub reference_samples_per_pixel: u32,
    /// By light samples, from few to many.
    pub rows: Vec<ShadowsRow>,
    /// Failure cases: too small and too large a bias, by its size.
    pub biases: Vec<Bias>,
}

impl Study for SoftShadowsChart {
    const NAME: &'static str = "soft-shadows";
    const ABOUT: &'static str =
        "Soft shadows: error over light samples, one pass against accumulation, and the bias";
    const PICTURES: &'static [&'static str] =
        &["soft_shadows_error", "soft_shadows_cost", "soft_shadows_failures"];
    const FILES: &'static [&'static str] =
        &["soft_shadows.csv", "soft_shadows_rays.csv", "soft_shadows.json"];

    type Effort = SoftShadowsEffort;
    const FULL: SoftShadowsEffort =
        SoftShadowsEffort { size: [96, 54], map_px: 256, most_points: 256, reference_tables: 4, bias: 0.06 };
    const QUICK: SoftShadowsEffort =
        SoftShadowsEffort { size: [48, 27], map_px: 128, most_points: 64, reference_tables: 1, bias: 0.1 };

    fn measure(
        effort: SoftShadowsEffort,
        _scenes: &[String],
        progress: &Progress,
    ) -> Result<Self, StudyError> {
        let counts: Vec<u32> = (0..=effort.most_points.ilog2()).map(|power| 1 << power).collect();
        let bar = progress.bar("soft-shadows", counts.len() as u64 + 2);
        let stage = Stage::new(&effort)?;
        stage.with(|world| {
            let reference = world.reference()?;
            bar.inc();
            let row = |&points: &u32| {
                let row = world.row(points, &reference);
                bar.inc();
                row
            };
            let rows = counts.iter().map(row).collect::<Result<_, _>>()?;
            let biases = world.biases()?;
            bar.inc();
            let reference_samples_per_pixel = 256 * effort.reference_tables;
            Ok(Self { effort, reference_samples_per_pixel, rows, biases })
        })
    }

    fn draw(&self, to: &Gallery<'_>) -> Result<(), OutputError> {
        let [width, height] = self.effort.size;
        let subject = format!(
            "{width}x{height} pixels, a map of {0}x{0} texels, RMSE in linear light against {1} rays a pixel",
            self.effort.map_px, self.reference_samples_per_pixel
        );
        let title = "Soft shadows: error, and correlation of neighbouring errors";
        to.chart("soft_shadows_error", [title, &subject], self.errors())?;
        let title = "Soft shadows: one pass against accumulation";
        to.chart("soft_shadows_cost", [title, &subject], self.costs())?;
        let subject =
            "wrong shadows of a map of 16 places against rays; marked: where a run warns (shadow-bias)";
        to.chart("soft_shadows_failures", ["Where shadow maps fail: the bias", subject], self.failures())
    }

    fn tables(&self) -> Vec<Sheet> {
        let rows = TableBuilder::of(&self.rows)
            .shown("places", |row| row.points, plain)
            .shown("RMSE", |row| row.rmse, fixed(5))
            .shown("neighbours", |row| row.neighbour_correlation, fixed(2))
            .shown("equal", |row| if row.equal { "yes" } else { "NO" }, plain)
            .shown("vertices", |row| row.one_pass.vertices, count)
            .shown("(accumulated)", |row| row.accumulation.vertices, count)
            .shown("madds", |row| row.one_pass.madds, count)
            .shown("(accumulated)", |row| row.accumulation.madds, count)
            .shown("host s", |row| row.one_pass.host_s, fixed(3))
            .shown("(accumulated)", |row| row.accumulation.host_s, fixed(3))
            .shown("shading s", |row| row.shade_s, fixed(3));
        let traced = TableBuilder::of(&self.rows)
            .column("points", "rays a pixel", |row| row.points, plain)
            .column("rmse", "RMSE", |row| row.traced.rmse, fixed(5))
            .column("neighbour_correlation", "neighbours", |row| row.traced_correlation, fixed(2))
            .column("nodes_per_ray", "nodes a ray", |row| row.traced.nodes_per_ray, fixed(1))
            .column("triangles_per_ray", "triangles a ray", |row| row.traced.triangles_per_ray, fixed(1))
            .column("host_s", "host s", |row| row.traced.host_s, fixed(3))
            .csv("soft_shadows_rays.csv");
        let biases = TableBuilder::of(&self.biases)
            .shown("bias, texels", |bias| bias.texels, plain)
            .shown("acne %", |bias| 100.0 * bias.acne, fixed(2))
            .shown("leak %", |bias| 100.0 * bias.leak, fixed(2));
        let by_method = TableBuilder::of(self.rows.iter().flat_map(methods))
            .data("points", |(row, ..)| row.points)
            .data("rmse", |(row, ..)| row.rmse)
            .data("neighbour_correlation", |(row, ..)| row.neighbour_correlation)
            .data("equal", |(row, ..)| row.equal)
            .data("method", |(_, method, _)| *method)
            .data("passes", |(.., cost)| cost.passes)
            .data("vertices", |(.., cost)| cost.vertices)
            .data("tiles", |(.., cost)| cost.tiles)
            .data("samples_tested", |(.., cost)| cost.samples_tested)
            .data("madds", |(.., cost)| cost.madds)
            .data("dram_bytes", |(.., cost)| cost.dram_bytes)
            .data("host_s", |(.., cost)| cost.host_s)
            .csv("soft_shadows.csv");
        vec![rows.sheet(), traced.sheet(), biases.sheet(), by_method.sheet()]
    }

    fn tradeoff(&self) -> Vec<TradeoffPoint> {
        let point = |(row, method, cost): (&ShadowsRow, &str, &MapCost)| {
            seconds(row, method, row.rmse, cost.host_s + row.shade_s)
        };
        let traced = |row: &ShadowsRow| seconds(row, "ray tracing", row.traced.rmse, row.traced.host_s);
        self.rows.iter().flat_map(methods).map(point).chain(self.rows.iter().map(traced)).collect()
    }

    fn fault(&self) -> Option<String> {
        (!self.is_equal()).then(|| "one pass and accumulation differ; please report it".to_owned())
    }
}

/// Both ways to make a map, with what they cost.
fn methods(row: &ShadowsRow) -> [(&ShadowsRow, &'static str, &MapCost); 2] {
    [(row, "one pass", &row.one_pass), (row, "accumulation", &row.accumulation)]
}

/// A method with as many light samples as a row: the error over the seconds of all but the visibility from
/// the camera.
fn seconds(row: &ShadowsRow, method: &str, rmse: f64, host_s: f64) -> TradeoffPoint {
    let level = format!("{} light samples", row.points);
    let host_s = Metric::host_s(host_s).beside(row.accumulation.host_s + row.shade_s);
    TradeoffPoint::new("soft shadows", [method, &level], [Metric::rmse(rmse), host_s])
}

/// Light samples from which on a run does not warn.
const BANDS_BELOW: f64 = 16.0;

fn panel(title: &str, up: &str, curves: Vec<Series>) -> ChartPanel {
    ChartPanel::new(title, ["places (u, v, t)", up], curves).on(Scale::Doublings, Scale::Decades)
}

impl SoftShadowsChart {
    /// Whether the map of one pass was that of accumulation to the bit, everywhere.
    pub fn is_equal(&self) -> bool {
        self.rows.iter().all(|row| row.equal)
    }

    fn curve(&self, name: &str, y: impl Fn(&ShadowsRow) -> f64) -> Series {
        Series::curve(name, self.rows.iter().map(|row| (f64::from(row.points), y(row))))
    }

    fn errors(&self) -> Vec<ChartPanel> {
        let name = "both methods: equal to the bit";
        let over_cost = |method: fn(&ShadowsRow) -> &MapCost, name: &str| {
            Series::curve(name, self.rows.iter().map(|row| (method(row).madds as f64, row.rmse)))
        };
        let rays = "ray tracing";
        let banding = vec![
            self.curve(name, |row| row.neighbour_correlation),
            self.curve(rays, |row| row.traced_correlation),
        ];
        let errors = vec![self.curve(name, |row| row.rmse), self.curve(rays, |row| row.traced.rmse)];
        let time =
            |name: &str, of: fn(&ShadowsRow) -> (f64, f64)| Series::curve(name, self.rows.iter().map(of));
        let times = vec![
            time("one pass", |row| (row.one_pass.host_s + row.shade_s, row.rmse)),
            time("accumulation", |row| (row.accumulation.host_s + row.shade_s, row.rmse)),
            time(rays, |row| (row.traced.host_s, row.traced.rmse)),
        ];
        let costs = vec![
            over_cost(|row| &row.one_pass, "one pass"),
            over_cost(|row| &row.accumulation, "accumulation"),
        ];
        let bands = |panel: ChartPanel| panel.failing(Some(0.0..BANDS_BELOW), "a run warns: shadow-banding");
        vec![
            bands(panel("error", "RMSE", errors)),
            bands(panel("banding", "correlation of neighbours' errors", banding))
                .on(Scale::Doublings, Scale::Even),
            ChartPanel::new("error over cost of the map", ["multiply-adds of all tests", "RMSE"], costs),
            ChartPanel::new("error over time", ["seconds of the host, map and shading", "RMSE"], times),
        ]
    }

    fn costs(&self) -> Vec<ChartPanel> {
        let both = |of: fn(&MapCost) -> f64| {
            vec![
                self.curve("one pass", |row| of(&row.one_pass)),
                self.curve("accumulation", |row| of(&row.accumulation)),
            ]
        };
        vec![
            panel("vertex shader runs", "runs", both(|cost| cost.vertices as f64)),
            panel("multiply-adds of all tests", "multiply-adds", both(|cost| cost.madds as f64)),
            panel("memory", "bytes", both(|cost| cost.dram_bytes as f64)),
            panel("host", "seconds", both(|cost| cost.host_s)),
        ]
    }

    /// Wrong shadows over the bias; a bias of none is at zero.
    fn failures(&self) -> Vec<ChartPanel> {
        let panel = |[title, up, name]: [&str; 3], share: fn(&Bias) -> f64, failing| {
            let points = self.biases.iter().map(|bias| (bias.texels, 100.0 * share(bias)));
            ChartPanel::new(title, ["bias (widths of a texel)", up], vec![Series::curve(name, points)])
                .on(Scale::Doublings, Scale::Even)
                .failing(Some(failing), "a run warns")
        };
        let acne = ["too small: acne", "lit samples in shadow (%)", "acne"];
        let leak = ["too large: leak", "samples in shadow that are lit (%)", "leak"];
        vec![panel(acne, |b| b.acne, 0.0..0.5), panel(leak, |b| b.leak, 8.0..f64::INFINITY)]
    }
}

/// Cost of a map.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct MapCost {
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
pub struct ShadowsRow {
    /// Places `(u, v, t)`.
    pub points: u32,
    /// Error against rays, linear light.
    pub rmse: f64,
    /// Correlation of the errors of pixels side by side: 0 is noise, near 1 a band.
    pub neighbour_correlation: f64,
    /// Whether both maps are equal to the bit.
    pub equal: bool,
    /// In one pass.
    pub one_pass: MapCost,
    /// In a pass each.
    pub accumulation: MapCost,
    /// Seconds of the host for shading with a map.
    pub shade_s: f64,
    /// Ray tracing with as many samples of each pixel's own.
    pub traced: Traced,
    /// Correlation of its errors.
    pub traced_correlation: f64,
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
struct Stage {
    effort: SoftShadowsEffort,
    scene: Scene,
    frame: Frame,
    light: AreaLight,
    gpu: GpuSpec,
}

/// The same with its draws.
struct Bench<'a> {
    stage: &'a Stage,
    draws: &'a [Draw<'a>],
    world: World<'a>,
    viewport: Viewport,
}

impl Stage {
    pub fn new(effort: &SoftShadowsEffort) -> Result<Self, StudyError> {
        let size = Some((effort.size[0], effort.size[1]));
        let scene = default_scene()?.with_overrides(&Overrides { size, ..Overrides::default() })?;
        let frame = scene.frame(1)?;
        let light = AreaLight::new(&LightSpec::default())?;
        Ok(Self { effort: *effort, scene, frame, light, gpu: GpuSpec::load("reference")? })
    }

    pub fn with<T>(&self, run: impl FnOnce(&Bench<'_>) -> Result<T, StudyError>) -> Result<T, StudyError> {
        let draws: Vec<_> =
            self.frame.draws(&self.scene)?.into_iter().map(|draw| draw.culling(Cull::None)).collect();
        let albedos: Vec<_> =
            self.frame.meshes.iter().map(|mesh| self.scene.materials()[mesh.material].base_color).collect();
        let [width, height] = self.effort.size;
        let viewport = Viewport::new(width, height)
            .ok_or_else(|| StudyError::Pipeline(workloads::job::IMAGE_SIZE.to_owned()))?;
        let view = SceneView { camera: &self.frame.camera, draws: &draws };
        let world = World::new(&view, viewport, &self.light, &albedos, self.scene.background());
        run(&Bench { stage: self, draws: &draws, world, viewport })
    }
}

/// Seeds of references start here.
const REFERENCE_SEED: u64 = 1_000;
/// Samples a pixel of each of their tables, and light samples when biases are compared.
const MAX_SAMPLES: u32 = 256;
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
            let table = SampleTable::new(&SampleSpec::default(), MAX_SAMPLES, REFERENCE_SEED + seed)?;
            let image = self.by_rays(&table)?.0;
            sum.iter_mut().zip(image).for_each(|(sum, pixel)| *sum += pixel / tables as f32);
        }
        Ok(sum)
    }

    /// The image, with the work of the rays to the light and the seconds of shading.
    fn by_rays(&self, samples: &dyn SampleSource) -> Result<(Vec<Vec3>, RayWork, f64), StudyError> {
        let settings =
            Settings { spec: self.spec(), viewport: self.viewport, samples, background: Vec3::ZERO };
        let pass = RasterPass::new(&self.stage.frame.camera, self.draws, &settings).onto(Target::Depth);
        let seen = pass.with_visible().uncounted()?.visible;
        let started = Instant::now();
        let (image, work) = self.world.image_counted(samples, &seen, Shadows::Rays);
        Ok((image, work, started.elapsed().as_secs_f64()))
    }

    fn map(&self, set: &SharedSamples, method: ShadowMethod) -> Result<(ShadowMap, MapCost), StudyError> {
        let started = Instant::now();
        let mut gpu = Gpu::without_packets(self.spec())?;
        let Stage { light, effort, .. } = self.stage;
        let map = ShadowMap::new(light, self.draws, effort.map_px, set, method, &mut gpu)?;
        let host_s = started.elapsed().as_secs_f64();
        let passes = if method == ShadowMethod::OnePass { 1 } else { set.samples().len() as u32 };
        let cost = cost(&gpu.finish().counts(), passes, host_s);
        Ok((map, cost))
    }

    /// Both maps over a set of so many places, and the image of one of them.
    pub fn row(&self, points: u32, reference: &[Vec3]) -> Result<ShadowsRow, StudyError> {
        let set = SharedSamples::interleaved(&SampleSpec::default(), points, 1)?;
        let (map, one_pass) = self.map(&set, ShadowMethod::OnePass)?;
        let (other, accumulation) = self.map(&set, ShadowMethod::Accumulation)?;
        let bits = |map: &ShadowMap| map.depths().iter().map(|depth| depth.to_bits()).collect::<Vec<_>>();
        let seen = self.seen(&set)?;
        let shadows = Shadows::Map { map: &map, bias: self.stage.effort.bias };
        let started = Instant::now();
        let image = self.world.image(&set, &seen, shadows);
        let shade_s = started.elapsed().as_secs_f64();
        let table = SampleTable::new(&SampleSpec::default(), points, 1)?;
        let (traced, work, traced_s) = self.by_rays(&table)?;
        let width = self.viewport.width() as usize;
        let (traced, errors) = (errors(&traced, reference), errors(&image, reference));
        Ok(ShadowsRow {
            points,
            rmse: mean_square(&errors).sqrt(),
            neighbour_correlation: neighbours(&errors, width),
            equal: bits(&map) == bits(&other),
            one_pass,
            accumulation,
            shade_s,
            traced: Traced::new(mean_square(&traced).sqrt(), work, traced_s),
            traced_correlation: neighbours(&traced, width),
        })
    }

    fn seen(&self, set: &SharedSamples) -> Result<Vec<(u32, u32)>, StudyError> {
        let view = SceneView { camera: &self.stage.frame.camera, draws: self.draws };
        Ok(depth_pass(&view, self.viewport, set, ShadowMethod::OnePass, &mut Gpu::images_only(self.spec())?)?
            .samples)
    }

    /// Wrong shadows over the bias.
    pub fn biases(&self) -> Result<Vec<Bias>, StudyError> {
        let set = SharedSamples::interleaved(&SampleSpec::default(), BIAS_POINTS, 1)?;
        let (map, seen) = (self.map(&set, ShadowMethod::OnePass)?.0, self.seen(&set)?);
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

fn cost(counts: &Counts, passes: u32, host_s: f64) -> MapCost {
    let madds = [Event::SetupMadds, Event::TileMadds, Event::ScreenMadds, Event::SampleMadds];
    MapCost {
        passes,
        vertices: counts[Event::VertexInvocations],
        tiles: counts[Event::TilesVisited],
        samples_tested: counts[Event::SamplesTested],
        madds: madds.into_iter().map(|event| counts[event]).sum(),
        dram_bytes: counts[Event::DramReadBytes] + counts[Event::DramWriteBytes],
        host_s,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::written;

    #[test]
    fn more_places_err_less_one_pass_costs_less_and_is_equal() {
        let least =
            SoftShadowsEffort { size: [32, 18], map_px: 64, most_points: 16, reference_tables: 1, bias: 0.2 };
        let (_folder, chart, _) = written::<SoftShadowsChart>(least);
        assert!(chart.is_equal());
        assert!(chart.rows.iter().all(|row| row.traced.nodes_per_ray >= 1.0 && row.traced.rmse > 0.0));
        let (first, last) = (&chart.rows[0], chart.rows.last().unwrap());
        assert!(last.rmse < 0.6 * first.rmse, "{} {}", first.rmse, last.rmse);
        assert!(last.one_pass.vertices * 16 == last.accumulation.vertices);
        // The L2 holds the vertices from pass to pass, so both move little but their depths.
        let [one, many] = [&last.one_pass, &last.accumulation].map(|cost| cost.dram_bytes as f64);
        assert!((one / many - 1.0).abs() < 0.05, "{one} {many}");
        let (least, most) = (&chart.biases[0], chart.biases.last().unwrap());
        assert!(least.acne > 0.05 && most.acne < 0.01, "{} {}", least.acne, most.acne);
        assert!(most.leak > 0.2 && least.leak < most.leak, "{} {}", least.leak, most.leak);
    }
}
