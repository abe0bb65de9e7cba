//! `quintile chart deferred`: deferred against forward rendering over lights, overdraw, formats and samples.
//!
//! Error is the root of the mean squared difference to forward rendering with the same samples, over all
//! pixels and channels in linear light. All are frame 0 on the GPU and the platform `hd_4000`.

use activity::Event;
use glam::{DVec3, Vec3};
use output::OutputError;
use output::plot::{ChartPanel, Scale, Series};
use output::terminal::Progress;
use power_model::{EnergyTable, Platform, PowerModel};
use run::{GpuSpec, JobFrame, RunError};
use serde::Serialize;
use workloads::deferred::{Deferred, DeferredOptions, LightPass, LightingMethod, LightingRate, NormalFormat};
use workloads::scene::{Local, Node, Parts, Rig, Scene, SceneCamera, Trs};
use workloads::{Alpha, Material, Overrides, shapes};

use crate::chart::{errors, mean_square};
use crate::study::table::{Sheet, TableBuilder, count, fixed, millis, plain};
use crate::study::tradeoff::{Metric, TradeoffPoint};
use crate::study::{Gallery, Study, StudyError, each};

/// How much is drawn.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct DeferredEffort {
    /// Width and height of the image in pixels.
    pub size: (u32, u32),
    /// Point lights go through the powers of 4 up to this.
    #[serde(rename = "most_lights")]
    pub max_lights: u32,
    /// Layers and samples of a pixel go from 1 to this, doubling.
    #[serde(rename = "most")]
    pub max_layers_and_samples: u32,
}

/// Lights where they do not vary.
const LIGHTS: u32 = 16;
/// Largest relative difference between the energies of the passes and that of the frame.
const SAME: f64 = 1e-9;

/// What varies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum DeferredSweep {
    /// Point lights in the built-in scene.
    Lights,
    /// Opaque layers over the whole image, the farthest first.
    Layers,
    /// The same with blended layers.
    Blended,
    /// Samples of a pixel of the built-in scene.
    Samples,
}

impl DeferredSweep {
    const ALL: [Self; 4] = [Self::Lights, Self::Layers, Self::Blended, Self::Samples];

    const fn name(self) -> &'static str {
        match self {
            Self::Lights => "point lights",
            Self::Layers => "opaque layers",
            Self::Blended => "blended layers",
            Self::Samples => "samples per pixel",
        }
    }

    fn values(self, effort: DeferredEffort) -> Vec<u32> {
        match self {
            Self::Lights => std::iter::successors(Some(1), |lights| Some(4 * lights))
                .take_while(|lights| *lights <= effort.max_lights)
                .collect(),
            _ => (0..=effort.max_layers_and_samples.ilog2()).map(|power| 1 << power).collect(),
        }
    }
}

/// A way to draw the frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Way {
    name: &'static str,
    method: LightingMethod,
    lighting: LightPass,
    normals: NormalFormat,
    rate: LightingRate,
}

/// Every way; the first is the reference.
const WAYS: [Way; 5] = {
    let deferred = Way {
        name: "deferred",
        method: LightingMethod::Deferred,
        lighting: LightPass::Screen,
        normals: NormalFormat::Rgba16f,
        rate: LightingRate::Sample,
    };
    [
        Way { name: "forward", method: LightingMethod::Forward, ..deferred },
        deferred,
        Way { name: "light volumes", lighting: LightPass::Volumes, ..deferred },
        Way { name: "normals in bytes", normals: NormalFormat::Rgba8, ..deferred },
        Way { name: "lit once a pixel", rate: LightingRate::Pixel, ..deferred },
    ]
};

/// A frame drawn in one way.
#[derive(Clone, Debug, Serialize)]
pub struct DeferredRow {
    /// What varies.
    pub sweep: DeferredSweep,
    /// Value of the varied setting.
    pub value: u32,
    /// The way.
    pub method: &'static str,
    /// Length of the frame in seconds.
    pub frame_s: f64,
    /// Energy of the frame in joules.
    pub frame_j: f64,
    /// Bytes to and from memory.
    pub dram_bytes: u64,
    /// Operations of shaders.
    pub shader_ops: u64,
    /// Bytes of the G-buffer per pixel.
    pub g_buffer_bytes: f64,
    /// Error against forward rendering.
    pub rmse: f64,
    /// Relative difference between the energies of the passes and that of the frame.
    pub passes_off: f64,
}

/// The whole chart.
#[derive(Clone, Debug, Serialize)]
pub struct DeferredChart {
    /// How much was drawn.
    pub effort: DeferredEffort,
    /// Sweep by sweep, value by value, way by way.
    pub rows: Vec<DeferredRow>,
}

impl Study for DeferredChart {
    const NAME: &'static str = "deferred";
    const ABOUT: &'static str = "Deferred against forward rendering: time, energy and bytes over lights and overdraw, error over bytes";
    const PICTURES: &'static [&'static str] = &["deferred", "deferred_failures"];
    const FILES: &'static [&'static str] = &["deferred.csv", "deferred.json"];

    type Effort = DeferredEffort;
    const FULL: DeferredEffort =
        DeferredEffort { size: (640, 360), max_lights: 256, max_layers_and_samples: 8 };
    const QUICK: DeferredEffort =
        DeferredEffort { size: (160, 90), max_lights: 64, max_layers_and_samples: 4 };

    fn measure(effort: DeferredEffort, _: &[String], progress: &Progress) -> Result<Self, StudyError> {
        let cases: Vec<(DeferredSweep, u32)> = DeferredSweep::ALL
            .into_iter()
            .flat_map(|sweep| sweep.values(effort).into_iter().map(move |value| (sweep, value)))
            .collect();
        let bench = Bench::new(effort)?;
        let rows = each(&cases, ("deferred", progress), |&(sweep, value)| bench.rows(sweep, value))?;
        Ok(Self { effort, rows: rows.concat() })
    }

    fn draw(&self, to: &Gallery<'_>) -> Result<(), OutputError> {
        let (width, height) = self.effort.size;
        let subject = format!("a frame of {width}x{height} pixels on the GPU hd_4000");
        let gains = vec![
            self.panel(DeferredSweep::Lights, "frame (ms)", milliseconds),
            self.panel(DeferredSweep::Lights, "energy (mJ)", millijoules),
            self.panel(DeferredSweep::Lights, "memory (MB)", megabytes),
            self.panel(DeferredSweep::Layers, "frame (ms)", milliseconds),
            self.panel(DeferredSweep::Layers, "energy (mJ)", millijoules),
            self.panel(DeferredSweep::Layers, "memory (MB)", megabytes),
        ];
        to.chart("deferred", ["Deferred and forward rendering", &subject], gains)?;
        let several = || Some(1.5..f64::INFINITY);
        let failures = vec![
            self.panel(DeferredSweep::Samples, "memory (MB)", megabytes),
            self.panel(DeferredSweep::Samples, "RMSE", |row| row.rmse)
                .failing(several(), "a run warns: deferred-one-surface"),
            self.panel(DeferredSweep::Blended, "frame (ms)", milliseconds),
        ];
        to.chart("deferred_failures", ["Where deferred rendering fails", &subject], failures)
    }

    fn tables(&self) -> Vec<Sheet> {
        let rows = TableBuilder::of(&self.rows)
            .column("sweep", "varies", |row| row.sweep.name(), plain)
            .column("value", "value", |row| row.value, plain)
            .column("method", "method", |row| row.method, plain)
            .column("frame_s", "frame (ms)", |row| row.frame_s, millis(3))
            .column("frame_j", "energy (mJ)", |row| row.frame_j, millis(3))
            .column("dram_bytes", "memory (bytes)", |row| row.dram_bytes, count)
            .column("shader_ops", "shader operations", |row| row.shader_ops, count)
            .column("g_buffer_bytes", "G-buffer (B/pixel)", |row| row.g_buffer_bytes, plain)
            .column("rmse", "RMSE", |row| row.rmse, fixed(6))
            .data("passes_off", |row| row.passes_off);
        vec![rows.csv("deferred.csv").sheet()]
    }

    fn tradeoff(&self) -> Vec<TradeoffPoint> {
        let most =
            self.rows.iter().filter(|row| row.sweep == DeferredSweep::Lights).map(|row| row.value).max();
        let of_most =
            self.rows.iter().filter(|row| row.sweep == DeferredSweep::Lights && Some(row.value) == most);
        let point = |row: &DeferredRow| {
            let bytes = Metric::new("G-buffer", "B/pixel", row.g_buffer_bytes);
            TradeoffPoint::new("deferred image", ["G-buffer", row.method], [Metric::rmse(row.rmse), bytes])
        };
        of_most.filter(|row| ["deferred", "normals in bytes"].contains(&row.method)).map(point).collect()
    }

    fn fault(&self) -> Option<String> {
        let off = self.rows.iter().find(|row| row.passes_off.is_nan() || row.passes_off > SAME)?;
        let DeferredRow { sweep, value, method, passes_off, .. } = off;
        Some(format!(
            "{method} with {value} {}: energies of passes are off by {passes_off:e} of the frame's",
            sweep.name()
        ))
    }
}

fn milliseconds(row: &DeferredRow) -> f64 {
    1e3 * row.frame_s
}

fn millijoules(row: &DeferredRow) -> f64 {
    1e3 * row.frame_j
}

fn megabytes(row: &DeferredRow) -> f64 {
    1e-6 * row.dram_bytes as f64
}

impl DeferredChart {
    fn panel(&self, sweep: DeferredSweep, name: &str, of: fn(&DeferredRow) -> f64) -> ChartPanel {
        let curve = |way: &Way| {
            let rows = self.rows.iter().filter(|row| (row.sweep, row.method) == (sweep, way.name));
            Series::curve(way.name, rows.map(|row| (f64::from(row.value), of(row))))
        };
        let drawn = |way: &&Way| self.rows.iter().any(|row| (row.sweep, row.method) == (sweep, way.name));
        let curves = WAYS.iter().filter(drawn).map(curve).collect();
        ChartPanel::new("", [sweep.name(), name], curves).on(Scale::Doublings, Scale::FromZero)
    }
}

/// The machine.
struct Bench {
    effort: DeferredEffort,
    gpu: GpuSpec,
    model: PowerModel,
}

impl Bench {
    fn new(effort: DeferredEffort) -> Result<Self, RunError> {
        let platform = Platform::builtin("hd_4000")?;
        let model = PowerModel::new(&EnergyTable::builtin("28nm")?, &platform)?;
        Ok(Self { effort, gpu: GpuSpec::load("hd_4000")?, model })
    }

    /// Every way that differs at a value.
    fn rows(&self, sweep: DeferredSweep, value: u32) -> Result<Vec<DeferredRow>, RunError> {
        let ways = WAYS
            .iter()
            .filter(|way| way.rate == LightingRate::Sample || (sweep == DeferredSweep::Samples && value > 1));
        let mut wanted: Option<Vec<Vec3>> = None;
        let row = |way: &Way| {
            let frame = JobFrame::new(&self.job(sweep, value, way)?, 0, &self.gpu, &self.model)?;
            let image = &frame.drawn.image;
            let wanted = wanted.get_or_insert_with(|| image.clone());
            let frame_j = frame.power.energy().total_j();
            let bytes = frame.drawn.facts.iter().find(|fact| fact.name == "g_buffer_bytes_per_pixel");
            Ok(DeferredRow {
                sweep,
                value,
                method: way.name,
                frame_s: frame.power.duration_s(),
                frame_j,
                dram_bytes: frame.dram_bytes(),
                shader_ops: frame.report.counts()[Event::ShaderOps],
                g_buffer_bytes: bytes.map_or(0.0, |fact| fact.value),
                rmse: mean_square(&errors(image, wanted)).sqrt(),
                passes_off: (frame.sum_j() / frame_j - 1.0).abs(),
            })
        };
        ways.map(row).collect()
    }

    fn job(&self, sweep: DeferredSweep, value: u32, way: &Way) -> Result<Deferred, RunError> {
        let lights = if sweep == DeferredSweep::Lights { value } else { LIGHTS };
        let samples = if sweep == DeferredSweep::Samples { value } else { 1 };
        let Way { method, lighting, normals, rate, .. } = *way;
        let options =
            DeferredOptions { method, lighting, normals, rate, lights, ..DeferredOptions::default() };
        let overrides =
            Overrides { size: Some(self.effort.size), samples: Some(samples), ..Overrides::default() };
        let scene = match sweep {
            DeferredSweep::Lights | DeferredSweep::Samples => workloads::load(&options.scene)?,
            DeferredSweep::Layers => layers(value, Alpha::Opaque)?,
            DeferredSweep::Blended => layers(value, Alpha::Blended)?,
        };
        Ok(Deferred::of(scene, options, &overrides, 1)?)
    }
}

/// Layers that cover the image, the farthest drawn first.
fn layers(count: u32, alpha: Alpha) -> Result<Scene, workloads::LoadError> {
    let mut parts = Parts::new("layers");
    for layer in 0..count {
        let share = (layer + 1) as f32 / count as f32;
        let colour = Material::colored("layer", Vec3::new(share, 0.5, 1.0 - 0.5 * share));
        let material = parts.graph.push_material(Material { opacity: 0.5, alpha, ..colour });
        let place = DVec3::new(0.0, 0.0, 0.4 * f64::from(layer) - 0.4 * f64::from(count));
        let trs = Trs { translation: place, ..Trs::default() };
        let node = parts.graph.push_node(Node::new("layer", None, Local::Trs(trs)));
        parts.graph.attach(shapes::cuboid(Vec3::new(16.0, 9.0, 0.1), material), node);
    }
    let rig = Rig::look_at(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO);
    parts.camera = SceneCamera { rig, ..SceneCamera::default() };
    Scene::new(parts)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::written;

    #[test]
    fn deferred_rendering_gains_with_overdraw_and_loses_with_samples() {
        let least = DeferredEffort { size: (64, 36), max_lights: 16, max_layers_and_samples: 4 };
        let (_folder, chart, _) = written::<DeferredChart>(least);
        assert_eq!(chart.fault(), None);
        let find = |sweep, value, method| {
            let is_it = |row: &&DeferredRow| (row.sweep, row.value, row.method) == (sweep, value, method);
            chart.rows.iter().find(is_it).unwrap()
        };
        let ops = |layers, method| find(DeferredSweep::Layers, layers, method).shader_ops as f64;
        assert!(ops(4, "forward") > 3.5 * ops(1, "forward"));
        assert!(ops(4, "deferred") < 1.5 * ops(1, "deferred"));
        let bytes = |samples| find(DeferredSweep::Samples, samples, "deferred").g_buffer_bytes;
        assert_eq!(bytes(4), 4.0 * bytes(1));
        let rmse = |method| find(DeferredSweep::Samples, 4, method).rmse;
        assert!(rmse("lit once a pixel") > 2.0 * rmse("deferred"));
        assert!(
            find(DeferredSweep::Lights, 16, "normals in bytes").rmse
                > find(DeferredSweep::Lights, 16, "deferred").rmse
        );
        // Blended layers are lit forward either way, so nothing is gained.
        let blended = |method| find(DeferredSweep::Blended, 4, method).shader_ops;
        assert!(blended("deferred") > blended("forward"));
    }
}
