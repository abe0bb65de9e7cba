//! Paper III, "Per-frame Energy Measurement Methodology for Computer Graphics".

mod blocking;
mod disturbance;
mod finding;
mod launch;

use power_model::{Circumstances, FramePower, Pacing};

use super::recording::{Recording, looped};
use super::stage::Stage;
use super::{Done, Effort};
use crate::output::progress::{Bar, Progress};
use crate::run::RunError;

/// Both machines, with their frames drawn once.
struct Bench<'a> {
    effort: Effort,
    pc: Stage,
    pc_frames: Vec<FramePower>,
    phone: Stage,
    /// The phone's sequence; where not all of it is simulated, what is.
    phone_frames: Vec<FramePower>,
    bar: &'a Bar,
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
    /// The frame of Figure 7, or the last simulated one before it.
    fn frame(&self) -> &FramePower {
        &self.phone_frames[FRAME / self.effort.phone_step as usize]
    }

    /// The phone draws `frames` at its cap.
    fn on_phone(&self, frames: &[&FramePower], circumstances: Circumstances) -> Result<Recording, RunError> {
        self.bar.inc();
        Recording::new(&self.phone, frames, self.phone.capped()?, circumstances)
    }

    /// The PC draws its animation.
    fn on_pc(&self, pacing: Pacing, circumstances: Circumstances) -> Result<Recording, RunError> {
        self.bar.inc();
        let shown = looped(&self.pc_frames, self.effort.recorded_frames);
        Recording::new(&self.pc, &shown, pacing, circumstances)
    }
}

pub(super) fn rows(effort: Effort, progress: &Progress) -> Result<Vec<Done>, RunError> {
    let (pc, phone) = (Stage::pc()?, Stage::phone()?);
    let pc_frames = pc.pc_animation(effort.pc_frames, progress)?;
    let phone_frames = phone.phone_sequence(effort.phone_step, progress)?;
    let bar = &progress.bar("recordings", 5 + disturbance::SHORT_REPEATS + 7 * effort.repeats);
    let bench = Bench { effort, pc, pc_frames, phone, phone_frames, bar };
    Ok(vec![
        finding::found(&bench)?,
        finding::sums(&bench)?,
        launch::warm_up(&bench)?,
        blocking::phone(&bench)?,
        blocking::pc(&bench)?,
        disturbance::five_seconds(&bench)?,
    ])
}
