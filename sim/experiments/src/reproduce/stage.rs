//! A machine that draws frames, its recorder, and the analysis of the recorded trace.

use output::progress::Progress;
use pipeline::{Draw, RasterPass, Settings, Shader, Viewport};
use power_model::{
    Cause, Circumstances, EnergyTable, Finish, FramePower, Launch, Pacing, Platform, PowerModel, Seconds,
    Source, Sourced, Surrounded, Watts, pace,
};
use rayon::prelude::*;
use run::{BIN_PS, GpuSpec, RunError};
use timing::{FrameClock, Level, Recorder};
use traces::Trace;
use traces::device::{Device, DeviceSpec};
use traces::energy::{self, FrameEnergy, PowerIntegral, Score, TOLERANCE_S, TrueFrame};
use traces::frames::{FinderMethod, Flag, Marks, Options, Window, default_window, find_with};
use workloads::{Job, SampleChoice, Scene};

use super::scenes;
use run::JobFrame;

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
    /// "Two shunt current sensors measuring up to 1 A, suitable for the current of cellular phones" (thesis, section 3.1.1). The
    /// noise is assumed to be that of the default recorder, relative to the range.
    const SHUNT: Self = Self { range_a: 1.0, noise_a: 0.005 / 30.0 };
    /// "ACS710 Hall effect current sensors, capable of measuring up to 12 A" (thesis, section 3.1.1). Such a sensor is far noisier
    /// than a shunt; 0.4 % of its range is assumed.
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

    /// The phone with another power between frames. Its processor also feeds the driver while a frame runs, so that power changes by
    /// the same amount.
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
        RunError::Setting(format!("platform `{}` has no `system.{what}`", self.platform.name))
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
            .render(|packet, lines| clock.push(packet, lines))
            .map_err(RunError::setting)?;
        let timeline = clock.finish()?.timeline;
        self.model.frame(&timeline).map_err(|source| RunError::Timeline { frame: number, source })
    }

    /// Frame `number` of a job, with the energies of its passes.
    pub fn job_frame(&self, job: &dyn Job, number: u32) -> Result<JobFrame, RunError> {
        JobFrame::new(job, number, &self.gpu, &self.model)
    }

    /// The phone's sequence with objects of this edge, every `step`-th of its frames simulated and each shown until the next one.
    pub fn phone_sequence(
        &self,
        edge: f64,
        step: u32,
        progress: &Progress,
    ) -> Result<Vec<FramePower>, RunError> {
        let numbers: Vec<u32> = (0..scenes::PHONE_FRAMES).step_by(step as usize).collect();
        let bar = progress.bar("phone", numbers.len() as u64);
        let simulate = |&number: &u32| {
            let frame = self.frame(&scenes::phone(number, edge)?, 0, |looks| Box::new(scenes::Grids(looks)));
            bar.inc();
            frame
        };
        numbers.par_iter().map(simulate).collect()
    }

    /// The first frames of the PC's animation.
    pub fn pc_animation(&self, frames: u32, progress: &Progress) -> Result<Vec<FramePower>, RunError> {
        let scene = scenes::pc()?;
        let bar = progress.bar("pc", u64::from(frames));
        let simulate = |number| {
            let frame = self.frame(&scene, number, |looks| Box::new(scenes::Spotlights(looks)));
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

/// Tracking, not `auto`: if frames are equal except for a timer that disturbs every fifteenth, the sum of squares finds only the
/// disturbed ones, and `Auto` accepts this.
const METHOD: FinderMethod = FinderMethod::Tracking;

/// Number of marked starts on the PC, unless the row is about a single mark. From a single one the finder sometimes takes 15
/// frames for one, because the timer of 64 Hz disturbs every fifteenth frame of 30 Hz at the same position. On the phone one mark
/// is enough.
pub(super) const MARKED: usize = 3;

/// A trace and its ground truth.
pub(super) struct Recording {
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

impl Recording {
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
        let found = find_with(&self.trace, &self.marks(marked), &Options { method, ..Options::default() })?;
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

    /// For each drawn frame, the energy of the frame found at its position, J. `None` if no frame was found there, or if the
    /// analysis flags it as merged or split.
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
