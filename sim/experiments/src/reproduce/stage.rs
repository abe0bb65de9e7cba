//! A machine that draws.

use glam::{Vec3, Vec4};
use pipeline::frame::render_with_heat;
use pipeline::{Draw, Settings, Shader, ShaderCost, ShadingPoint, Texture, Viewport};
use power_model::{
    EnergyTable, Finish, FramePower, Launch, Pacing, Platform, PowerModel, Seconds, Source, Sourced, Watts,
};
use rayon::prelude::*;
use timing::Recorder;
use workloads::{SampleChoice, Scene};

use super::scenes;
use output::progress::Progress;
use run::GpuSpec;
use run::{BIN_PS, RunError};
use timing::{FrameClock, Level};

/// GPU, platform and energies.
#[derive(Clone)]
pub(super) struct Stage {
    pub gpu: GpuSpec,
    pub platform: Platform,
    pub sensor: Sensor,
    model: PowerModel,
}

/// What the papers put into the supply to measure the current.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sensor {
    /// Largest current, A.
    pub range_a: f64,
    /// Noise of a sample, A rms.
    pub noise_a: f64,
}

impl Sensor {
    /// "Two shunt current sensors measuring up to 1 A, suitable for the current of cellular phones" (thesis, section 3.1.1). The
    /// noise is assumed to be that of the usual recorder, as a part of the range.
    const SHUNT: Self = Self { range_a: 1.0, noise_a: 0.005 / 30.0 };
    /// "ACS710 Hall effect current sensors, capable of measuring up to 12 A" (thesis, section 3.1.1). Such a sensor is far noisier
    /// than a shunt; 0.4 % of its range is assumed.
    const HALL: Self = Self { range_a: 12.0, noise_a: 0.05 };
}

/// Bins of a frame at most: finer than the recorder for frames of up to a tenth of a second.
const MOST_BINS: usize = 4096;

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

    /// The phone with another draw between frames. Its processor feeds the driver on top of that while a frame runs, so that goes with it.
    pub fn phone_idling(idle_w: f64) -> Result<Self, RunError> {
        let mut stage = Self::phone()?;
        let platform = &mut stage.platform;
        let constant_w = idle_w + platform.constant_w.value() - platform.idle_w.value();
        platform.idle_w = swept(Watts::new(idle_w))?;
        platform.constant_w = swept(Watts::new(constant_w))?;
        stage.model = PowerModel::new(&EnergyTable::builtin("28nm")?, &stage.platform)?;
        Ok(stage)
    }

    /// The same machine, its waiting processor drawing another power on top.
    pub fn waiting(mut self, waiting_w: f64) -> Result<Self, RunError> {
        let finish = Finish { waiting_w: swept(Watts::new(waiting_w))?, ..self.finish()?.clone() };
        self.platform.system.finish = Some(finish);
        Ok(self)
    }

    /// The same machine, drawing more for another time after launch.
    pub fn launching(mut self, duration_s: f64) -> Result<Self, RunError> {
        let launch = Launch { duration_s: swept(Seconds::new(duration_s))?, ..self.launch()?.clone() };
        self.platform.system.launch = Some(launch);
        Ok(self)
    }

    /// The same machine, the disturbances of the kind that is listed first drawing another power on top.
    pub fn disturbed(mut self, extra_w: f64) -> Result<Self, RunError> {
        let first = self.platform.system.disturbances.first_mut();
        let Some(first) = first else { return Err(self.without("disturbances")) };
        *first = first.clone().drawing(swept(Watts::new(extra_w))?);
        Ok(self)
    }

    /// V-sync at the rate at which the platform's applications are capped.
    pub fn capped(&self) -> Result<Pacing, RunError> {
        let cap = self.platform.system.frame_cap_hz.as_ref();
        Ok(Pacing::Vsync { rate: *cap.ok_or_else(|| self.without("frame_cap_hz"))?.get() })
    }

    /// The time from one tick to the next at that rate, s.
    pub fn capped_period_s(&self) -> Result<f64, RunError> {
        match self.capped()? {
            Pacing::Vsync { rate } => Ok(1.0 / rate.value()),
            Pacing::FreeRunning => Err(self.without("frame_cap_hz")),
        }
    }

    /// What the platform draws more after launch.
    pub fn launch(&self) -> Result<&Launch, RunError> {
        self.platform.system.launch.as_ref().ok_or_else(|| self.without("launch"))
    }

    /// What a blocking finish costs on the platform.
    pub fn finish(&self) -> Result<&Finish, RunError> {
        self.platform.system.finish.as_ref().ok_or_else(|| self.without("finish"))
    }

    fn without(&self, what: &str) -> RunError {
        RunError::Setting(format!("platform `{}` has no `system.{what}`", self.platform.name))
    }

    /// Watts over time of frame `number` of a scene, with shaders of the given cost.
    pub fn frame(&self, scene: &Scene, number: u32, cost: ShaderCost) -> Result<FramePower, RunError> {
        let options = scene.settings();
        let viewport = Viewport::new(options.width, options.height);
        let viewport = viewport.ok_or_else(|| RunError::Setting("an image of no size".to_owned()))?;
        let samples = SampleChoice::load(&options.table)?.source(options.samples, 1)?;
        let background = scene.background();
        let settings = Settings { spec: &self.gpu.pipeline, viewport, samples: &*samples, background };
        let frame = scene.frame(number)?;
        let draws = frame.draws(scene)?;
        let shaders: Vec<Costed<'_>> = draws.iter().map(|draw| Costed { looks: draw.shader, cost }).collect();
        let draws: Vec<Draw<'_>> =
            draws.iter().zip(&shaders).map(|(draw, shader)| Draw { shader, ..*draw }).collect();
        let mut clock =
            FrameClock::new(Level::default(), self.gpu.machine()?, Recorder::new(BIN_PS, MOST_BINS));
        render_with_heat(&frame.camera, &draws, &settings, &[], |packet, lines| clock.push(packet, lines))
            .map_err(RunError::setting)?;
        let timeline = clock.finish()?.timeline;
        self.model.frame(&timeline).map_err(|source| RunError::Timeline { frame: number, source })
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
            let frame = self.frame(&scenes::phone(number, edge)?, 0, scenes::PHONE_COST);
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
            let frame = self.frame(&scene, number, scenes::PC_COST);
            bar.inc();
            frame
        };
        (0..frames).into_par_iter().map(simulate).collect()
    }
}

/// A quantity that a row varies.
fn swept<T>(value: Result<T, impl std::fmt::Display>) -> Result<Sourced<T>, RunError> {
    let value = value.map_err(RunError::setting)?;
    let source = Source::try_from("varied by `quintile reproduce`".to_owned()).map_err(RunError::setting)?;
    Ok(Sourced::Assumed(value, source))
}

/// A shader that looks like another one at a cost of its own.
struct Costed<'a> {
    looks: &'a dyn Shader,
    cost: ShaderCost,
}

impl Shader for Costed<'_> {
    fn cost(&self) -> ShaderCost {
        self.cost
    }

    fn texture(&self) -> Option<&Texture> {
        self.looks.texture()
    }

    fn shade(&self, at: &ShadingPoint, texel: Vec4) -> Vec3 {
        self.looks.shade(at, texel)
    }
}
