//! Paper VI, "Design and Novel Uses of Higher-Dimensional Rasterization": a module for each use.

mod caustics;
mod caustics_figures;
mod collision;
mod collision_figure;
mod culling;
mod depths;
mod glossy;
mod image_figures;
mod occlusion;
mod public;
mod sampling;
mod settings;
mod shadows;
mod torus;
mod views;

use std::path::Path;

use workloads::stress::{Size, StressScene, families};

use super::row::With;
use super::settings::{Form, Origin, load};
use super::{Done, Options};
use output::progress::Progress;
use run::RunError;
use settings::Settings;

/// Input of every row.
struct Task<'a> {
    settings: Settings,
    form: Form,
    origin: Origin,
    /// Public cases of collision detection.
    collision_data: Option<&'a Path>,
    progress: &'a Progress,
}

impl Task<'_> {
    /// The settings of one row.
    fn with<'s, S>(&'s self, row: fn(&'s Settings) -> &'s S) -> With<'s, S> {
        With {
            settings: row(&self.settings),
            form: self.form,
            sha256: &self.origin.sha256,
            shared_less: Vec::new(),
        }
    }
}

type Compute = fn(&Task<'_>) -> Result<Done, RunError>;

const ROWS: [(&str, Compute); 16] = [
    ("VI-1", collision::missed),
    ("VI-2", collision::dodged),
    ("VI-3", collision::tighter),
    ("VI-4", occlusion::rate),
    ("VI-5", occlusion::cost),
    ("VI-6", caustics::executions),
    ("VI-7", caustics::no_light_is_lost),
    ("VI-8", torus::row),
    ("VI-9", sampling::darts),
    ("VI-10", sampling::densities),
    ("VI-11", glossy::row),
    ("VI-12", shadows::row),
    ("VI-13", views::stereo),
    ("VI-14", views::seven),
    ("VI-15", depths::tighter),
    ("VI-16", culling::unchanged),
];

/// The row that reads public cases of collision detection.
pub(super) const READS_COLLISION_DATA: &str = "VI-1";

/// The ids of its rows.
pub(super) fn ids() -> Vec<&'static str> {
    ROWS.iter().map(|(id, _)| *id).collect()
}

pub(super) fn rows(options: &Options, progress: &Progress) -> Result<(Origin, Vec<Done>), RunError> {
    let (settings, origin) = load::<Settings>(options.settings.as_deref())?;
    let task = Task {
        settings,
        form: options.form(),
        origin,
        collision_data: options.collision_data.as_deref(),
        progress,
    };
    // A folder that cannot be read is better known before the work than after it.
    if let Some(folder) = task.collision_data {
        public::check(folder, task.settings.vi_1.public_scenes.get(task.form))?;
    }
    let wanted: Vec<_> = ROWS.into_iter().filter(|(id, _)| options.wants(id)).collect();
    let bar = progress.bar("rows", wanted.len() as u64);
    let mut done = Vec::new();
    for (_, compute) in wanted {
        done.push(compute(&task)?);
        bar.inc();
    }
    Ok((task.origin, done))
}

/// Scenes of every family of the failure catalogue: one in the middle of its sweep, or so many from its harmless end on.
fn catalogue(size: Size, of_each: usize, seed: u64) -> Result<Vec<StressScene>, RunError> {
    let mut scenes = Vec::new();
    for family in families() {
        let values = family.sweep(true);
        let (first, step) = match of_each {
            1 => (values.len() / 2, values.len()),
            many => (0, (values.len() / (many - 1).max(1)).max(1)),
        };
        for value in values.iter().skip(first).step_by(step) {
            scenes.push(family.scene(*value, size, seed).map_err(RunError::setting)?);
        }
    }
    Ok(scenes)
}
