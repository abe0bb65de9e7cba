//! One program of groups: its cost in a frame, and its error against the exact answer.

use activity::{Event, PS_PER_S};
use glam::{DVec3, Vec4};
use output::terminal::Progress;
use pipeline::Gpu;
use pipeline::sampling::{Sample, SampleSource};
use run::{GpuSpec, Observed, Plan, RunError, RunOptions, frames_of};
use workloads::Overrides;
use workloads::compute::{
    Atomics, CHAIN, Compute, ComputeOptions, Kernel, Kernels, LightSphere, Order, TileLights,
};
use workloads::job::{DrawsScene, OptionSource};
use workloads::scene::Frame;

use super::{ComputeRow, ComputeSweep};

/// Sizes of groups.
const GROUPS: [u32; 5] = [16, 32, 64, 128, 256];
/// Words between the sums of lanes, up to the banks of the GPU.
const STRIDES: [u32; 6] = [1, 2, 4, 8, 16, 32];
/// Lanes of a group whose sums at the largest stride fit into shared memory, with padding.
const STRIDE_GROUP: u32 = 64;
/// Contrasts of the image.
const CONTRASTS: [f64; 7] = [0.0, 0.01, 0.03, 0.1, 0.3, 0.6, 1.0];
/// Copies of the histogram.
const COPIES: u32 = 8;
/// Steps between pixels that are read.
const STEPS: [u32; 5] = [1, 2, 4, 8, 16];
/// Sides of tiles in pixels.
const TILES: [u32; 3] = [8, 16, 32];
/// Lists take all lights that reach a tile.
const LIST: u32 = 512;
/// The GPU of all cases.
const GPU: &str = "reference";
/// The pass that writes the image.
const DISPLAY: &str = "display";
/// The mean by a mip chain.
pub(super) const CHAIN_METHOD: &str = "mip chain";
/// Seed of samples and lights.
const SEED: u64 = 1;

/// A method at a value.
#[derive(Clone, Debug)]
pub(super) struct Case {
    sweep: ComputeSweep,
    value: f64,
    method: &'static str,
    options: ComputeOptions,
}

impl Case {
    /// All cases, sweep by sweep.
    pub fn all() -> Vec<Self> {
        let [reduction, histogram, culling] = [Kernel::Reduction, Kernel::Histogram, Kernel::LightCulling]
            .map(|kernel| ComputeOptions { kernel, ..ComputeOptions::default() });
        let culling = ComputeOptions { list: LIST, ..culling };
        let mut cases = Vec::new();
        let mut add = |sweep, value: f64, method, options| cases.push(Self { sweep, value, method, options });
        for group in GROUPS {
            let kernels = [("reduction", &reduction), ("histogram", &histogram), ("light culling", &culling)];
            for (method, kernel) in kernels {
                let options = ComputeOptions { group, ..kernel.clone() };
                add(ComputeSweep::Group, f64::from(group), method, options);
            }
        }
        let layouts = [
            ("sequential", Order::Sequential, false),
            ("sequential, padded", Order::Sequential, true),
            ("interleaved", Order::Interleaved, false),
            ("interleaved, padded", Order::Interleaved, true),
        ];
        for stride in STRIDES {
            for (method, order, padded) in layouts {
                let options =
                    ComputeOptions { stride, order, padded, group: STRIDE_GROUP, ..reduction.clone() };
                add(ComputeSweep::Stride, f64::from(stride), method, options);
            }
        }
        let places = [
            ("global", Atomics::Global, 1, false),
            ("shared", Atomics::Shared, 1, false),
            ("8 copies", Atomics::Shared, COPIES, false),
            ("8 copies, padded", Atomics::Shared, COPIES, true),
        ];
        for contrast in CONTRASTS {
            for (method, atomics, copies, padded) in places {
                let options = ComputeOptions {
                    contrast: contrast as f32,
                    atomics,
                    copies,
                    padded,
                    ..histogram.clone()
                };
                add(ComputeSweep::Contrast, contrast, method, options);
            }
        }
        for step in STEPS {
            for (method, kernel) in [("reduction", &reduction), ("histogram", &histogram)] {
                add(ComputeSweep::Step, f64::from(step), method, ComputeOptions { step, ..kernel.clone() });
            }
        }
        let chain = ComputeOptions { kernel: Kernel::MipChain, ..ComputeOptions::default() };
        add(ComputeSweep::Step, 1.0, CHAIN_METHOD, chain);
        for tile_px in TILES {
            for (method, depth_bounds) in [("depth bounds", true), ("frustum", false)] {
                let options = ComputeOptions { tile_px, depth_bounds, ..culling.clone() };
                add(ComputeSweep::Tile, f64::from(tile_px), method, options);
            }
        }
        cases
    }
}

/// What programs compute without approximating.
pub(super) struct Bench {
    size: (u32, u32),
    gpu: GpuSpec,
    mean: f64,
    histogram: Vec<u32>,
    depths: Vec<Vec4>,
    lights: Vec<LightSphere>,
    frame: Frame,
    samples: Vec<Sample>,
}

impl Bench {
    pub fn new(size: (u32, u32)) -> Result<Self, RunError> {
        let (gpu, options) =
            (GpuSpec::load(GPU)?, ComputeOptions { list: LIST, ..ComputeOptions::default() });
        let job = job(&options, size)?;
        let frame = DrawsScene::scene(&job).frame(0)?;
        let mut on = Gpu::without_packets(&gpu.pipeline)?;
        let depth = job.depths(&frame, &mut on)?;
        let depths = on.contents(depth).unwrap_or_default();
        drop(on);
        let lights = job.lights(&frame)?;
        let table = job.samples();
        let mut samples = vec![Sample::default(); (size.0 * size.1) as usize];
        for (pixel, sample) in (0..).zip(samples.chunks_mut(1)) {
            table.pixel_into(pixel % size.0, pixel / size.0, sample);
        }
        let mean = found(&job, &gpu, &frame, &options, |kernels, image| {
            let mean = kernels.mean_luminance(image)?;
            Ok(f64::from(kernels.values(mean)[0]))
        })?;
        let histogram = histogram(&job, &gpu, &frame, &options)?;
        Ok(Self { size, mean, histogram, depths, lights, frame, samples, gpu })
    }

    pub fn row(&self, case: &Case) -> Result<ComputeRow, RunError> {
        let Case { sweep, value, method, options } = case;
        let plan = plan(options, self.size)?;
        let frames = frames_of(&plan, &[0], &Progress::new(true))?;
        let observed = frames[0].observed().ok_or_else(|| RunError::setting("a frame without counts"))?;
        let [cycles, events_j, conflicts] = cost(&plan, observed);
        let mut warns: Vec<&'static str> =
            observed.warnings.iter().map(|warning| warning.code.name()).collect();
        warns.dedup();
        let (value, conflicts) = (*value, conflicts as u64);
        let error_percent = self.error(case)?.map(|error| 100.0 * error);
        Ok(ComputeRow { sweep: *sweep, value, method, cycles, events_j, conflicts, error_percent, warns })
    }

    fn error(&self, case: &Case) -> Result<Option<f64>, RunError> {
        let (options, frame) = (&case.options, &self.frame);
        let job = job(options, self.size)?;
        Ok(match (case.sweep, options.kernel) {
            (ComputeSweep::Step, Kernel::Reduction) => {
                let mean = found(&job, &self.gpu, frame, options, |kernels, image| {
                    let mean = kernels.mean_luminance(image)?;
                    Ok(f64::from(kernels.values(mean)[0]))
                })?;
                Some((mean / self.mean - 1.0).abs())
            }
            (ComputeSweep::Step, Kernel::MipChain) => {
                let mut gpu = Gpu::without_packets(&self.gpu.pipeline)?;
                let chain = job.chain(frame, &mut gpu)?;
                Some((f64::from(chain.mean) / self.mean - 1.0).abs())
            }
            (ComputeSweep::Step, _) => {
                let other = histogram(&job, &self.gpu, frame, options)?;
                let share = |bins: &[u32]| {
                    let all = f64::from(bins.iter().sum::<u32>());
                    bins.iter().map(|count| f64::from(*count) / all).collect::<Vec<f64>>()
                };
                let pairs = share(&self.histogram).into_iter().zip(share(&other));
                Some(0.5 * pairs.map(|(a, b)| (a - b).abs()).sum::<f64>())
            }
            (ComputeSweep::Tile, _) => Some(self.wasted(&self.lists(&job, options)?, options.tile_px)),
            _ => None,
        })
    }

    fn lists(&self, job: &Compute, options: &ComputeOptions) -> Result<TileLights, RunError> {
        let mut gpu = Gpu::without_packets(&self.gpu.pipeline)?;
        let depth = job.depths(&self.frame, &mut gpu)?;
        let view = gpu.surface_view(depth).ok_or_else(|| RunError::setting("no depths"))?;
        let viewport = job.viewport()?;
        let mut kernels = Kernels::new(&mut gpu, options)?;
        Ok(kernels.light_lists(&view, (&self.frame.camera, viewport), &self.lights)?)
    }

    /// Share of the lights in lists that reach no sample of their tile.
    fn wasted(&self, tiles: &TileLights, side: u32) -> f64 {
        let (width, height) = self.size;
        let [mut listed, mut wasted] = [0_u64; 2];
        for (tile, list) in (0..).zip(&tiles.lists) {
            let [left, top] = [tile % tiles.tiles[0] * side, tile / tiles.tiles[0] * side];
            let rows = top..(top + side).min(height);
            let pixels = rows.flat_map(|y| (left..(left + side).min(width)).map(move |x| [x, y]));
            let points: Vec<DVec3> = pixels.filter_map(|pixel| self.point(pixel)).collect();
            let reaches = |light: &LightSphere| {
                let (centre, radius) = (light.centre.as_dvec3(), f64::from(light.radius));
                points.iter().any(|point| point.distance_squared(centre) <= radius * radius)
            };
            listed += list.len() as u64;
            wasted += list.iter().filter(|light| !reaches(&self.lights[**light as usize])).count() as u64;
        }
        wasted as f64 / listed.max(1) as f64
    }

    /// The point that the sample of a pixel sees, in world space; `None` for the background.
    fn point(&self, [x, y]: [u32; 2]) -> Option<DVec3> {
        let (pixel, camera) = ((y * self.size.0 + x) as usize, &self.frame.camera);
        let depth = f64::from(self.depths[pixel].x);
        let (sample, height) = (&self.samples[pixel], f64::from(self.size.1));
        let scale = 0.5 * height / f64::from(camera.half_height());
        let [shift_x, shift_y] = camera.shift().to_array().map(|shift| f64::from(shift) * height);
        let right = f64::from(x) + f64::from(sample.x) - 0.5 * f64::from(self.size.0) - shift_x;
        let down = f64::from(y) + f64::from(sample.y) - 0.5 * height - shift_y;
        let along = if camera.is_orthographic() { 1.0 } else { depth };
        let seen = DVec3::new(right / scale * along, -down / scale * along, depth);
        depth.is_finite().then(|| camera.open().inverse().transform_point3(seen.as_vec3()).as_dvec3())
    }
}

fn job(options: &ComputeOptions, size: (u32, u32)) -> Result<Compute, RunError> {
    let overrides = Overrides { size: Some(size), ..Overrides::default() };
    Ok(Compute::new(options.clone(), &overrides, SEED)?)
}

/// Cycles of a time. Whole cycles stay whole: their product is exact up to some ten million cycles, and 1e-12
/// is no double.
fn cycles(ps: u64, core_hz: f64) -> f64 {
    ps as f64 * core_hz / PS_PER_S
}

/// Cycles, energy of the events and conflicts of the passes of the program: those of groups but the one that
/// writes the image, and those that draw a mip chain.
fn cost(plan: &Plan, observed: &Observed) -> [f64; 3] {
    let (mut all, mut busy_ps, mut before_ps) = ([0.0; 3], 0, 0);
    for (pass, time) in observed.report.passes.iter().zip(&observed.times) {
        let counts = pass.counts();
        let is_of_groups = counts[Event::Groups] > 0 && pass.name != DISPLAY;
        if is_of_groups || pass.name.starts_with(&format!("{CHAIN} level ")) {
            busy_ps += time.end_ps - before_ps;
            all[1] += plan.model().counts_energy(&counts).total_j();
            all[2] += (counts[Event::BankConflicts] + counts[Event::AtomicConflicts]) as f64;
        }
        before_ps = time.end_ps;
    }
    all[0] = cycles(busy_ps, plan.gpu().core_hz);
    all
}

fn plan(options: &ComputeOptions, size: (u32, u32)) -> Result<Plan, RunError> {
    let value = serde_json::to_value(options).map_err(RunError::setting)?;
    let text = |value: &serde_json::Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
    let set = value.as_object().into_iter().flatten().map(|(name, value)| (name.clone(), text(value)));
    let overrides = Overrides { size: Some(size), frames: Some(0..1), ..Overrides::default() };
    let options = OptionSource { file: None, set: set.collect() };
    Plan::resolve(RunOptions {
        scene: "compute".into(),
        gpu: GPU.into(),
        overrides,
        options,
        seed: SEED,
        ..RunOptions::default()
    })
}

/// What a program computes of the image.
fn found<T>(
    job: &Compute,
    gpu: &GpuSpec,
    frame: &Frame,
    options: &ComputeOptions,
    run: impl Fn(&mut Kernels<'_, '_>, &pipeline::SurfaceView) -> Result<T, pipeline::PassError>,
) -> Result<T, RunError> {
    let mut gpu = Gpu::without_packets(&gpu.pipeline)?;
    let image = job.image(frame, None, &mut gpu)?;
    let view = gpu.surface_view(image).ok_or_else(|| RunError::setting("no image"))?;
    let mut kernels = Kernels::new(&mut gpu, options)?;
    Ok(run(&mut kernels, &view)?)
}

fn histogram(
    job: &Compute,
    gpu: &GpuSpec,
    frame: &Frame,
    options: &ComputeOptions,
) -> Result<Vec<u32>, RunError> {
    found(job, gpu, frame, options, |kernels, image| {
        let counts = kernels.histogram(image)?;
        Ok(kernels.values(counts))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_cycles_stay_whole() {
        // 400 MHz: 2500 ps a cycle.
        assert!((1..1_000_000_u32).step_by(7).all(|n| cycles(2500 * u64::from(n), 400e6) == f64::from(n)));
    }

    #[test]
    fn options_of_cases_have_an_effect() {
        for case in Case::all() {
            assert!(plan(&case.options, (64, 36)).is_ok(), "{case:?}");
        }
    }
}
