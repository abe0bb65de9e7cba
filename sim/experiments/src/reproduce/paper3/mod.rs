//! Paper III, "Per-frame Energy Measurement Methodology for Computer Graphics".

mod blocking;
mod disturbance;
mod finding;
mod launch;
mod settings;

use power_model::{Circumstances, FramePower, Pacing};

use super::recording::{Recording, looped};
use super::row::With;
use super::settings::{Form, Origin, load, reduced};
use super::stage::Stage;
use super::{Done, Options};
use output::progress::Progress;
use run::RunError;
use settings::Settings;

/// Both machines, with their frames drawn once.
struct Bench<'a> {
    settings: Settings,
    form: Form,
    origin: Origin,
    pc: Stage,
    pc_frames: Vec<FramePower>,
    phone: Stage,
    /// The phone's sequence; where not all of it is simulated, what is.
    phone_frames: Vec<FramePower>,
    progress: &'a Progress,
}

/// The frame of the phone's sequence that the paper looks at closely (Figure 7).
const FRAME: usize = 9;

/// Long after launch, without blocking.
fn settled(seed: u64) -> Circumstances {
    Circumstances { launch: false, blocking_finish: false, seed }
}

/// The energies that are not flagged.
fn unflagged(energies_j: &[f64], flags: &[bool]) -> Vec<f64> {
    energies_j.iter().zip(flags).filter(|(_, flag)| !**flag).map(|(energy, _)| *energy).collect()
}

impl Bench<'_> {
    /// The settings of one row.
    fn with<'s, S>(&'s self, row: fn(&'s Settings) -> &'s S) -> With<'s, S> {
        With {
            settings: row(&self.settings),
            form: self.form,
            sha256: &self.origin.sha256,
            shared_less: reduced(&self.settings.work, self.form),
        }
    }

    /// Recordings of the same thing.
    fn repeats(&self) -> u64 {
        *self.settings.work.repeats.get(self.form)
    }

    /// Frames in a recording of an animation.
    fn recorded_frames(&self) -> usize {
        *self.settings.work.recorded_frames.get(self.form)
    }

    /// Every how many frames of the phone's sequence one is simulated.
    fn phone_step(&self) -> u32 {
        *self.settings.work.phone_step.get(self.form)
    }

    /// The frame of Figure 7, or the last simulated one before it.
    fn frame(&self) -> &FramePower {
        &self.phone_frames[FRAME / self.phone_step() as usize]
    }

    /// The phone draws `frames` at its cap.
    fn on_phone(&self, frames: &[&FramePower], circumstances: Circumstances) -> Result<Recording, RunError> {
        self.on(&self.phone, frames, circumstances)
    }

    /// A machine draws `frames` at its cap.
    fn on(
        &self,
        stage: &Stage,
        frames: &[&FramePower],
        circumstances: Circumstances,
    ) -> Result<Recording, RunError> {
        Recording::new(stage, frames, stage.capped()?, circumstances)
    }

    /// The PC draws its animation.
    fn on_pc(&self, pacing: Pacing, circumstances: Circumstances) -> Result<Recording, RunError> {
        let shown = looped(&self.pc_frames, self.recorded_frames());
        Recording::new(&self.pc, &shown, pacing, circumstances)
    }
}

type Compute = fn(&Bench<'_>) -> Result<Done, RunError>;

const ROWS: [(&str, Compute); 6] = [
    ("III-1", finding::found),
    ("III-2", finding::sums),
    ("III-3", launch::warm_up),
    ("III-4", blocking::phone),
    ("III-5", blocking::pc),
    ("III-6", disturbance::five_seconds),
];

/// The ids of its rows.
pub(super) fn ids() -> Vec<&'static str> {
    ROWS.iter().map(|(id, _)| *id).collect()
}

pub(super) fn rows(options: &Options, progress: &Progress) -> Result<(Origin, Vec<Done>), RunError> {
    let (settings, origin) = load::<Settings>(options.settings.as_deref())?;
    let form = options.form();
    let (pc, phone) = (Stage::pc()?, Stage::phone()?);
    let pc_frames = pc.pc_animation(*settings.work.pc_frames.get(form), progress)?;
    let edge = *settings.iii_4.edge.get(form);
    let phone_frames = phone.phone_sequence(edge, *settings.work.phone_step.get(form), progress)?;
    let bench = Bench { settings, form, origin, pc, pc_frames, phone, phone_frames, progress };
    let wanted: Vec<_> = ROWS.into_iter().filter(|(id, _)| options.wants(id)).collect();
    let bar = progress.bar("rows", wanted.len() as u64);
    let mut done = Vec::new();
    for (_, compute) in wanted {
        done.push(compute(&bench)?);
        bar.inc();
    }
    Ok((bench.origin, done))
}
