//! A machine that draws frames, its recorder, and the analysis of the recorded trace; and the workloads of
//! the papers, as far as the papers describe them.

use std::f64::consts::{FRAC_1_SQRT_2, TAU};
use std::sync::Arc;

use glam::{DQuat, DVec3, Mat4, Vec3, Vec4};
use output::terminal::Progress;
use pipeline::{Draw, Lane, RasterPass, Settings, Shader, ShadingPoint, Texture, Viewport, Wrap};
use power_model::{
    Cause, Circumstances, EnergyTable, Finish, FramePower, Launch, Pacing, Platform, PowerModel, Seconds,
    Source, Sourced, Surrounded, Watts, pace,
};
use rayon::prelude::*;
use run::{BIN_PS, GpuSpec, JobFrame, RunError};
use timing::{FrameClock, Level, Recorder};
use traces::Trace;
use traces::device::{Device, DeviceSpec};
use traces::energy::{self, FrameEnergy, PowerIntegral, Score, TOLERANCE_S, TrueFrame};
use traces::frames::{FinderMethod, FinderOptions, Flag, Marks, Window, default_window, find_with};
use workloads::scene::{Frustum, Graph, Local, Node, Parts, Rig, SceneCamera, SceneSettings, Trs};
use workloads::{Job, LoadError, Material, Overrides, SampleChoice, Scene, shapes};

/// GPU, platform and energies.
#[derive(Clone)]
pub(super) struct Stage {
    pub gpu: GpuSpec,
    pub platform: Platform,
    pub sensor: Sensor,
    model: PowerModel,
}

/// Current sensors of the papers.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sensor {
    /// Largest current, A.
    pub range_a: f64,
    /// Noise of a sample, A rms.
    pub noise_a: f64,
}

impl Sensor {
    /// "Two shunt current sensors measuring up to 1 A, suitable for the current of cellular phones" (thesis,
    /// section 3.1.1). The noise is assumed to be that of the default recorder, relative to the range.
    const SHUNT: Self = Self { range_a: 1.0, noise_a: 0.005 / 30.0 };
    /// "ACS710 Hall effect current sensors, capable of measuring up to 12 A" (thesis, section 3.1.1). Such a
    /// sensor is far noisier than a shunt; 0.4 % of its range is assumed.
    const HALL: Self = Self { range_a: 12.0, noise_a: 0.05 };
}

/// Largest number of bins of a frame: finer than the recorder for frames of up to 0.1 s.
const MAX_BINS: usize = 4096;

impl Stage {
    fn new(gpu: &str, platform: &str, sensor: Sensor) -> Result<Self, RunError> {
        let platform = Platform::builtin(platform)?;
        let model = PowerModel::new(&EnergyTable::builtin("28nm")?, &platform)?;
        Ok(Self { gpu: GpuSpec::load(gpu)?, platform, sensor, model })
    }

    /// The phone of the papers.
    pub fn phone() -> Result<Self, RunError> {
        Self::new("mobile", "iphone_4s", Sensor::SHUNT)
    }

    /// The PC of the papers.
    pub fn pc() -> Result<Self, RunError> {
        Self::new("hd_4000", "hd_4000", Sensor::HALL)
    }

    /// The phone with another power between frames. Its processor also feeds the driver while a frame runs,
    /// so that power changes by the same amount.
    pub fn phone_idling(idle_w: f64) -> Result<Self, RunError> {
        let mut stage = Self::phone()?;
        let platform = &mut stage.platform;
        let constant_w = idle_w + platform.constant_w.value() - platform.idle_w.value();
        platform.idle_w = swept(Watts::new(idle_w))?;
        platform.constant_w = swept(Watts::new(constant_w))?;
        stage.model = PowerModel::new(&EnergyTable::builtin("28nm")?, &stage.platform)?;
        Ok(stage)
    }

    /// The same machine with another added power of the waiting processor.
    pub fn waiting(mut self, waiting_w: f64) -> Result<Self, RunError> {
        let finish = Finish { waiting_w: swept(Watts::new(waiting_w))?, ..self.finish()?.clone() };
        self.platform.system.finish = Some(finish);
        Ok(self)
    }

    /// The same machine with another duration of the added power after launch.
    pub fn launching(mut self, duration_s: f64) -> Result<Self, RunError> {
        let launch = Launch { duration_s: swept(Seconds::new(duration_s))?, ..self.launch()?.clone() };
        self.platform.system.launch = Some(launch);
        Ok(self)
    }

    /// The same machine with another added power of the first kind of disturbance.
    pub fn disturbed(mut self, extra_w: f64) -> Result<Self, RunError> {
        let first = self.platform.system.disturbances.first_mut();
        let Some(first) = first else { return Err(self.without("disturbances")) };
        *first = first.clone().drawing(swept(Watts::new(extra_w))?);
        Ok(self)
    }

    /// V-sync at the frame rate cap of the platform.
    pub fn capped(&self) -> Result<Pacing, RunError> {
        let cap = self.platform.system.frame_cap_hz.as_ref();
        Ok(Pacing::Vsync { rate: *cap.ok_or_else(|| self.without("frame_cap_hz"))?.get() })
    }

    /// Period of that V-sync, s.
    pub fn capped_period_s(&self) -> Result<f64, RunError> {
        match self.capped()? {
            Pacing::Vsync { rate } => Ok(1.0 / rate.value()),
            Pacing::FreeRunning => Err(self.without("frame_cap_hz")),
        }
    }

    /// Added power of the platform after launch.
    pub fn launch(&self) -> Result<&Launch, RunError> {
        self.platform.system.launch.as_ref().ok_or_else(|| self.without("launch"))
    }

    /// Cost of a blocking finish on the platform.
    pub fn finish(&self) -> Result<&Finish, RunError> {
        self.platform.system.finish.as_ref().ok_or_else(|| self.without("finish"))
    }

    fn without(&self, what: &str) -> RunError {
        RunError::setting(format_args!("platform `{}` has no `system.{what}`", self.platform.name))
    }

    /// Power over time of frame `number` of a scene, with a shader for each of its own.
    pub fn frame(&self, scene: &Scene, number: u32, shader: Shaders) -> Result<FramePower, RunError> {
        let options = scene.settings();
        let viewport = Viewport::new(options.width, options.height);
        let viewport = viewport.ok_or_else(|| RunError::setting(workloads::job::IMAGE_SIZE))?;
        let samples = SampleChoice::load(&options.table)?.source(options.samples, 1)?;
        let background = scene.background();
        let settings = Settings { spec: &self.gpu.pipeline, viewport, samples: &*samples, background };
        let frame = scene.frame(number)?;
        let draws = frame.draws(scene)?;
        let shaders: Vec<_> = draws.iter().map(|draw| shader(draw.shader)).collect();
        let draws: Vec<Draw<'_>> =
            draws.iter().zip(&shaders).map(|(draw, shader)| Draw { shader: &**shader, ..*draw }).collect();
        let mut clock =
            FrameClock::new(Level::default(), self.gpu.machine()?, Recorder::new(BIN_PS, MAX_BINS));
        RasterPass::new(&frame.camera, &draws, &settings)
            .without_image()
            .render(|packet, lines| clock.push(packet, lines))?;
        let timeline = clock.finish()?.timeline;
        self.model.frame(&timeline).map_err(|source| RunError::Timeline { frame: number, source })
    }

    /// Frame `number` of a job, with the energies of its passes.
    pub fn job_frame(&self, job: &dyn Job, number: u32) -> Result<JobFrame, RunError> {
        JobFrame::new(job, number, &self.gpu, &self.model)
    }

    /// The phone's sequence with objects of this edge, every `step`-th of its frames simulated and each shown
    /// until the next one.
    pub fn phone_sequence(
        &self,
        edge: f64,
        step: u32,
        progress: &Progress,
    ) -> Result<Vec<FramePower>, RunError> {
        let numbers: Vec<u32> = (0..PHONE_FRAMES).step_by(step as usize).collect();
        let bar = progress.bar("phone", numbers.len() as u64);
        let simulate = |&number: &u32| {
            let frame = self.frame(&phone(number, edge)?, 0, |looks| Box::new(Grids(looks)));
            bar.inc();
            frame
        };
        numbers.par_iter().map(simulate).collect()
    }

    /// The first frames of the PC's animation.
    pub fn pc_animation(&self, frames: u32, progress: &Progress) -> Result<Vec<FramePower>, RunError> {
        let scene = pc()?;
        let bar = progress.bar("pc", u64::from(frames));
        let simulate = |number| {
            let frame = self.frame(&scene, number, |looks| Box::new(Spotlights(looks)));
            bar.inc();
            frame
        };
        (0..frames).into_par_iter().map(simulate).collect()
    }
}

/// The shader that is drawn in place of another one.
type Shaders = for<'a> fn(&'a dyn Shader) -> Box<dyn Shader + 'a>;

/// A quantity of the platform that a row varies.
fn swept<T>(value: Result<T, impl std::fmt::Display>) -> Result<Sourced<T>, RunError> {
    let value = value.map_err(RunError::setting)?;
    let source = Source::try_from("varied by `quintile reproduce`".to_owned()).map_err(RunError::setting)?;
    Ok(Sourced::Assumed(value, source))
}

/// Samples per second of the papers' recorder (Paper II, section 3).
const RATE_HZ: f64 = 40e3;

/// Tracking, not `auto`: if frames are equal except for a timer that disturbs every fifteenth, the sum of
/// squares finds only the disturbed ones, and `Auto` accepts this.
const METHOD: FinderMethod = FinderMethod::Tracking;

/// Number of marked starts on the PC, unless the row is about a single mark. From a single one the finder
/// sometimes takes 15 frames for one, because the timer of 64 Hz disturbs every fifteenth frame of 30 Hz at
/// the same position. On the phone one mark is enough.
pub(super) const MARKED: usize = 3;

/// A trace and its ground truth.
pub(super) struct TracedRun {
    /// Drawn frames with the timestamps of the application.
    pub truth: Surrounded,
    /// Recorded trace.
    pub trace: Trace,
}

/// Frames found in a trace.
pub(super) struct Frames {
    /// With their energies from start to start.
    pub found: Vec<FrameEnergy>,
    /// Where the last one ends.
    pub end_s: f64,
}

impl Frames {
    /// Energies in order, J.
    pub fn energies_j(&self) -> Vec<f64> {
        self.found.iter().map(|frame| frame.energy_j).collect()
    }
}

impl TracedRun {
    /// Draws `frames` on the stage and records them.
    pub fn new(
        stage: &Stage,
        frames: &[&FramePower],
        pacing: Pacing,
        circumstances: Circumstances,
    ) -> Result<Self, RunError> {
        let run = pace(frames, &stage.platform, pacing)?;
        let truth = stage.platform.system.surround(&run, &circumstances)?;
        let trace =
            recorder(stage, circumstances.seed)?.sample(&truth.curve, 0.0, truth.curve.end_s())?.trace;
        Ok(Self { truth, trace })
    }

    /// Finds the frames again, by tracking from `marked` starts in a row.
    pub fn find(&self, marked: usize) -> Result<Frames, RunError> {
        self.find_by(METHOD, marked)
    }

    /// The same by another method.
    pub fn find_by(&self, method: FinderMethod, marked: usize) -> Result<Frames, RunError> {
        let found = find_with(
            &self.trace,
            &self.marks(marked),
            &FinderOptions { method, ..FinderOptions::default() },
        )?;
        Ok(Frames { end_s: found.end_s, found: PowerIntegral::new(&self.trace).frames(&found) })
    }

    /// Found starts compared with true ones within a tolerance, and the number of missed starts under a disturbance.
    pub fn score(&self, frames: &Frames, within_s: f64) -> (Score, usize) {
        let truth = self.truth.frames.iter();
        let truth: Vec<_> =
            truth.map(|frame| TrueFrame { start_s: frame.start_s, energy_j: frame.energy_j }).collect();
        let beside = energy::truth_beside(&frames.found, &truth, within_s);
        let missed = truth.iter().filter(|frame| !beside.contains(&Some(**frame)));
        let Window { pre_s, post_s } = self.marks(1).window;
        let disturbed =
            missed.filter(|frame| self.is_disturbed(frame.start_s - pre_s, frame.start_s + post_s));
        (energy::score(&frames.found, &truth, within_s), disturbed.count())
    }

    fn is_disturbed(&self, from_s: f64, to_s: f64) -> bool {
        let disturbances =
            self.truth.pulses.iter().filter(|pulse| matches!(pulse.cause, Cause::Disturbance(_)));
        disturbances.into_iter().any(|pulse| pulse.overlap_s(from_s, to_s) > 0.0)
    }

    /// Marks `count` consecutive starts from the middle on, in the steady part, and the end of the last frame.
    fn marks(&self, count: usize) -> Marks {
        let frames = &self.truth.frames;
        let lengths = frames.iter().map(|frame| frame.end_s - frame.start_s);
        Marks {
            starts_s: frames.iter().skip(frames.len() / 2).take(count).map(|frame| frame.start_s).collect(),
            window: default_window(lengths.fold(f64::INFINITY, f64::min), self.trace.rate_hz()),
            end_s: self.truth.end_s.min(self.trace.end_s()),
        }
    }

    /// For each drawn frame, the energy of the frame found at its position, J. `None` if no frame was found
    /// there, or if the analysis flags it as merged or split.
    pub fn by_true_frame_j(&self, frames: &Frames) -> Vec<Option<f64>> {
        let found: Vec<f64> = frames.found.iter().map(|frame| frame.start_s).collect();
        let truth: Vec<f64> = self.truth.frames.iter().map(|frame| frame.start_s).collect();
        let whole_j = |place: usize| {
            let frame = &frames.found[place];
            let parts = [Flag::Merged, Flag::Split, Flag::Long, Flag::Short];
            (!parts.iter().any(|flag| frame.flags.contains(*flag))).then_some(frame.energy_j)
        };
        let beside = energy::found_beside_true(&found, &truth, TOLERANCE_S);
        beside.into_iter().map(|place| place.and_then(whole_j)).collect()
    }

    /// Recorded energy from start to start by the timestamps of the application, J.
    pub fn by_timestamps_j(&self) -> Vec<f64> {
        let integral = PowerIntegral::new(&self.trace);
        self.truth.frames.iter().map(|frame| integral.energy_j(frame.start_s, frame.end_s)).collect()
    }

    /// The old method: recorded energy from begin to finish by the timestamps of the application, J.
    pub fn begin_to_finish_j(&self) -> Vec<f64> {
        let integral = PowerIntegral::new(&self.trace);
        self.truth.frames.iter().map(|frame| integral.energy_j(frame.start_s, frame.finish_s)).collect()
    }

    /// Recorded power over an interval, as points from its start on.
    pub fn points(&self, from_s: f64, to_s: f64) -> Vec<(f64, f64)> {
        let place =
            |time_s: f64| self.trace.position(time_s).clamp(0.0, self.trace.samples() as f64) as usize;
        (place(from_s)..place(to_s))
            .map(|index| (self.trace.time_s(index) - from_s, self.trace.power_w(index)))
            .collect()
    }
}

/// The papers' recorder on the rail of the platform: current and voltage at 40 kHz.
fn recorder(stage: &Stage, seed: u64) -> Result<Device, RunError> {
    let default = DeviceSpec::default();
    let rail_v = stage.platform.rail.voltage_v.value();
    let (range_a, range_v) = (stage.sensor.range_a, 1.5 * rail_v);
    Ok(Device::new(DeviceSpec {
        name: "station of the papers".to_owned(),
        rate_hz: RATE_HZ,
        rail_v,
        current_range_a: [-range_a, range_a],
        voltage_range_v: [-range_v, range_v],
        current_noise_a: stage.sensor.noise_a,
        voltage_noise_v: default.voltage_noise_v * range_v / default.voltage_range_v[1],
        seed,
        ..default
    })?)
}

/// `frames` repeated, `count` in all.
pub(super) fn looped(frames: &[FramePower], count: usize) -> Vec<&FramePower> {
    frames.iter().cycle().take(count).collect()
}

/// Frames in the phone's sequence (Paper III, section 4).
const PHONE_FRAMES: u32 = 24;
/// Objects of a frame, fewest and most (Paper III, section 4).
const OBJECTS: [u32; 2] = [23, 62];
/// Quads along an edge of an object: 2048 triangles (Paper III, section 4).
const CELLS: u32 = 32;

/// The phone's shaders (Paper III, section 4): three matrices times a vector for a vertex, of which the
/// pipeline does one; a normalization, a dot product and a mix of two texels for a fragment. A draw has one
/// texture here, but its look-up is trilinear: two fetches, as many as their two without mipmaps.
struct Grids<'a>(pub &'a dyn Shader);

impl Shader for Grids<'_> {
    fn texture(&self) -> Option<&Texture> {
        self.0.texture()
    }

    fn vertex(&self, lane: &Lane, position: Vec3) {
        let turned = lane.transform4(&Mat4::from_rotation_y(0.5), position.extend(1.0));
        lane.transform4(&Mat4::from_rotation_x(0.5), turned);
    }

    fn shade(&self, lane: &Lane, at: &ShadingPoint, texel: Vec4) -> Vec4 {
        let facing = lane.dot(lane.normalize(at.normal), Vec3::Y);
        let other = Vec4::ONE;
        lane.madd(lane.sub(other, texel), Vec4::splat(facing), texel)
    }
}

/// Number of objects in a frame of the phone's sequence: from fewest to most and back.
pub(super) fn objects(frame: u32) -> u32 {
    let [fewest, most] = OBJECTS.map(f64::from);
    let wave = 0.5 - 0.5 * libm::cos(TAU * f64::from(frame) / f64::from(PHONE_FRAMES));
    libm::round(fewest + (most - fewest) * wave) as u32
}

/// The synthetic scene of Paper III for the phone, 960x640: textured grids, the nearest drawn last. `edge` is
/// that of an object where the image is 2 high and 3 wide; the paper does not say.
pub(super) fn phone(frame: u32, edge: f64) -> Result<Scene, LoadError> {
    let mut parts = Parts::new("grids of Paper III");
    let white = Material::colored("white", Vec3::ONE);
    let material = Material { double_sided: true, texture: texture().map(Arc::new), ..white };
    let material = parts.graph.push_material(material);
    for object in 0..objects(frame) {
        grid(&mut parts.graph, object, edge, material);
    }
    parts.camera = SceneCamera {
        rig: Rig::look_at(DVec3::new(0.0, 0.0, 10.0), DVec3::ZERO),
        view: Some(Frustum::Orthographic { half_height: 1.0 }),
        near: None,
    };
    parts.settings = SceneSettings {
        width: 960,
        height: 640,
        samples: 1,
        frame_rate_hz: 30.0,
        shutter: 0.0,
        ..SceneSettings::default()
    };
    Scene::new(parts)
}

/// 256 x 256 texels (Paper III, section 4), in stripes.
fn texture() -> Option<Texture> {
    const SIDE: u32 = 256;
    let texel = |at: u32| if (at / 16).is_multiple_of(2) { [210, 200, 180, 255] } else { [60, 90, 140, 255] };
    let texels = (0..SIDE).flat_map(|y| (0..SIDE).map(move |x| texel(x + y))).collect();
    Texture::from_srgb8(SIDE, SIDE, texels, [Wrap::Repeat; 2]).ok()
}

/// An object that faces the camera, wholly inside the image, at a place of a low-discrepancy sequence (the
/// generalized golden ratio in two dimensions, Roberts 2018).
fn grid(graph: &mut Graph, object: u32, edge: f64, material: usize) {
    const STEPS: [f64; 2] = [0.754_877_666_246_692_8, 0.569_840_290_998_053_2];
    let place = |step: f64, room: f64| {
        let at = 0.5 + step * f64::from(object);
        room * (2.0 * (at - libm::floor(at)) - 1.0)
    };
    let at = DVec3::new(
        place(STEPS[0], 1.5 - 0.5 * edge),
        place(STEPS[1], 1.0 - 0.5 * edge),
        0.01 * f64::from(object),
    );
    // A plane looks up; a quarter of a turn makes it look at the camera.
    let rotation = DQuat::from_xyzw(FRAC_1_SQRT_2, 0.0, 0.0, FRAC_1_SQRT_2);
    let trs = Trs { translation: at, rotation, ..Trs::default() };
    let node = graph.push_node(Node::new("grid", None, Local::Trs(trs)));
    graph.attach(shapes::plane(edge, CELLS, 1.0, material), node);
}

/// Spotlights of the PC's animation (Paper III, section 4).
const LIGHTS: u16 = 32;

/// The PC's shader: 32 spotlights in one forward pass on top of the surface's own. The paper has their
/// number; each is a usual one with a cone, a range and a highlight (Blinn 1977).
struct Spotlights<'a>(pub &'a dyn Shader);

impl Spotlights<'_> {
    /// Light `number` at `position`, towards which the surface faces by `normal`: diffuse light and highlight.
    fn light(lane: &Lane, number: u16, at: &ShadingPoint, [normal, to_camera]: [Vec3; 2]) -> f32 {
        let [cone, hardness, range, exponent] = [0.7, 1.0 / (1.0 - 0.7), 0.01, 24.0];
        let place = Vec3::new(f32::from(number % 8) - 3.5, 4.0, f32::from(number / 8) - 1.5);
        let to_light = lane.sub(place, at.position);
        let square = lane.dot(to_light, to_light);
        let to_light = lane.scale(to_light, lane.recip(lane.sqrt(square)));
        let edge = lane.sub(lane.dot(to_light, Vec3::Y), cone);
        let edge = lane.saturate(lane.mul(edge, hardness));
        let cone = lane.mul(lane.mul(edge, edge), lane.madd(-2.0, edge, 3.0));
        let fading = lane.max(lane.madd(square, -range, 1.0), 0.0);
        let half = lane.normalize(lane.add(to_light, to_camera));
        let glint = lane.max(lane.dot(normal, half), 0.0);
        let glint = lane.exp2(lane.mul(exponent, lane.log2(glint)));
        let reflected = lane.add(lane.max(lane.dot(normal, to_light), 0.0), glint);
        lane.mul(lane.mul(reflected, cone), fading)
    }
}

impl Shader for Spotlights<'_> {
    fn texture(&self) -> Option<&Texture> {
        self.0.texture()
    }

    fn shade(&self, lane: &Lane, at: &ShadingPoint, texel: Vec4) -> Vec4 {
        let looks = self.0.shade(lane, at, texel);
        let seen = [lane.normalize(at.normal), lane.normalize(at.to_camera)];
        (0..LIGHTS).fold(looks, |sum, number| {
            let light = Self::light(lane, number, at, seen);
            lane.madd(Vec3::splat(light), looks.truncate(), sum.truncate()).extend(1.0)
        })
    }
}

/// The PC's animation: the built-in scene without motion blur and lens, as their GPUs drew it, at 30 frames a second.
/// (Theirs is a path through Sponza, which does not come with this program.)
pub(super) fn pc() -> Result<Scene, LoadError> {
    workloads::load("default")?.with_overrides(&Overrides {
        size: Some((1280, 720)),
        samples: Some(1),
        frame_rate_hz: Some(30.0),
        shutter: Some(0.0),
        lens_radius: Some(0.0),
        ..Overrides::default()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_phones_sequence_is_the_papers() {
        let counts: Vec<u32> = (0..PHONE_FRAMES).map(objects).collect();
        assert_eq!((counts.iter().min(), counts.iter().max()), (Some(&23), Some(&62)));
        let scene = phone(9, 0.28).unwrap();
        assert_eq!(scene.triangle_count(), 2048 * objects(9) as usize);
    }

    /// Nothing is drawn outside the image, where it would cost nothing.
    #[test]
    fn every_object_lies_in_the_image() {
        let scene = phone(12, 0.28).unwrap();
        for mesh in scene.frame(0).unwrap().meshes {
            assert!(
                mesh.open.iter().all(|p| p.x.abs() <= 1.5001 && p.y.abs() <= 1.0001 && p.z < 1.0),
                "{:?}",
                mesh.open[0]
            );
            let facing = mesh.open.iter().map(|p| p.z).fold(f32::NEG_INFINITY, f32::max) - mesh.open[0].z;
            assert!(facing.abs() < 1e-3);
        }
    }
}
