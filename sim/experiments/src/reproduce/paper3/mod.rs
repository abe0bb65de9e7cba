//! Paper III, "Measuring Per-Frame Energy Consumption of Real-Time Graphics Applications".

mod blocking;
mod finding;
mod system;

use output::progress::Progress;
use power_model::{Circumstances, FramePower, Pacing};
use run::RunError;

use super::row::With;
use super::settings::{
    About, Form, Origin, Setting, load, paper_settings, reduced, row_settings, settings_group,
};
use super::stage::{Recording, Stage, looped};
use super::{Done, Options, Paper};

/// Both machines, with their simulated frames.
struct Bench<'a> {
    settings: Settings,
    form: Form,
    origin: Origin,
    pc: Stage,
    pc_frames: Vec<FramePower>,
    phone: Stage,
    /// Simulated frames of the phone's sequence.
    phone_frames: Vec<FramePower>,
    progress: &'a Progress,
}

/// The frame of the phone's sequence in Figure 7.
const FRAME: usize = 9;

/// Long after launch, without blocking.
fn settled(seed: u64) -> Circumstances {
    Circumstances { launch: false, blocking_finish: false, seed }
}

/// Energies of frames without flags.
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

    /// Number of recordings of the same frames.
    fn repeats(&self) -> u64 {
        *self.settings.work.repeats.get(self.form)
    }

    /// Frames in a recording of an animation.
    fn recorded_frames(&self) -> usize {
        *self.settings.work.recorded_frames.get(self.form)
    }

    /// One frame of the phone's sequence is simulated for each so many.
    fn phone_step(&self) -> u32 {
        *self.settings.work.phone_step.get(self.form)
    }

    /// The frame of Figure 7, or the last simulated one before it.
    fn frame(&self) -> &FramePower {
        &self.phone_frames[FRAME / self.phone_step() as usize]
    }

    /// Recording of the phone, which draws `frames` at its frame rate cap.
    fn on_phone(&self, frames: &[&FramePower], circumstances: Circumstances) -> Result<Recording, RunError> {
        self.on(&self.phone, frames, circumstances)
    }

    /// Recording of a machine, which draws `frames` at its frame rate cap.
    fn on(
        &self,
        stage: &Stage,
        frames: &[&FramePower],
        circumstances: Circumstances,
    ) -> Result<Recording, RunError> {
        Recording::new(stage, frames, stage.capped()?, circumstances)
    }

    /// Recording of the PC, which draws its animation.
    fn on_pc(&self, pacing: Pacing, circumstances: Circumstances) -> Result<Recording, RunError> {
        let shown = looped(&self.pc_frames, self.recorded_frames());
        Recording::new(&self.pc, &shown, pacing, circumstances)
    }
}

type Compute = fn(&Bench<'_>) -> Result<Done, RunError>;

const ROWS: [(&str, Compute); 6] = [
    ("III-1", finding::found),
    ("III-2", finding::sums),
    ("III-3", system::warm_up),
    ("III-4", blocking::phone),
    ("III-5", blocking::pc),
    ("III-6", system::five_seconds),
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

paper_settings!(Paper::Three, "paper3.ron" {
    work: Work,
    iii_1: Finding,
    iii_2: Sums,
    iii_3: WarmUp,
    iii_4: BlockingPhone,
    iii_5: BlockingPc,
    iii_6: Disturbance,
});

settings_group! {
    /// Amount of simulation and recording, shared by all rows.
    Work {} {
        pc_frames: u32, within(1..=36);
        phone_step: u32, within(1..=8);
        recorded_frames: usize, within(24..=10_000);
        still_frames: usize, within(200..=10_000);
        repeats: u64, within(1..=1000);
    }
}

row_settings! {
    Finding {
        marked: usize, within(1..=8);
        found_vsync: f64, within(0.0..=1.0);
        found_free: f64, within(0.0..=1.0);
        within_ms: f64, within(0.001..=10.0);
    }

    Sums {
        same: f64, within(0.0..=1.0);
    }

    WarmUp {
        frames: u32, within(1..=1000);
        planted_s: f64, within(0.1..=4.0);
        near: f64, within(0.0..=100.0);
        recorded: usize, within(150..=10_000);
    }

    BlockingPhone {
        waiting_w: f64, within(0.0..=10.0);
        idle_w: f64, within(0.01..=10.0);
        edge: f64, within(0.01..=1.0);
    }

    BlockingPc {
        with_mj: (f64, f64), must(energy, ENERGY);
        without_mj: (f64, f64), must(energy, ENERGY);
        waiting_w: f64, within(0.0..=100.0);
        background_w: f64, within(0.0..=100.0);
    }

    Disturbance {
        extra_w: f64, within(0.0..=10.0);
        frames: (usize, usize), must(|(low, high)| low <= high, "fewest and most");
        shorts: u64, within(2..=1000);
    }
}

fn energy((mean, deviation): &(f64, f64)) -> bool {
    *mean > 0.0 && *deviation > 0.0
}

const ENERGY: &str = "a mean and a deviation above 0";
