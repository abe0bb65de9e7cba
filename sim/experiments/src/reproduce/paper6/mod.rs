//! Paper VI, "Design and Novel Uses of Higher-Dimensional Rasterization": a module for each use.

mod collision;
mod culling;
mod depths;
mod figures;
mod light;
mod public;
mod sampling;
mod settings;
mod torus;
mod views;

use std::path::Path;

use output::terminal::Progress;
use run::RunError;
use settings::Settings;
use workloads::stress::{Size, StressScene, families};

use super::row::With;
use super::settings::{Form, Origin, load};
use super::{Done, Options};

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
    ("VI-4", culling::rate),
    ("VI-5", culling::cost),
    ("VI-6", light::executions),
    ("VI-7", light::no_light_is_lost),
    ("VI-8", torus::row),
    ("VI-9", sampling::darts),
    ("VI-10", sampling::densities),
    ("VI-11", light::glossy_row),
    ("VI-12", light::shadow_row),
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
        let mut row = compute(&task)?;
        row.row.about.limits = with_figures(&row.row.about.limits);
        done.push(row);
        bar.inc();
    }
    Ok((task.origin, done))
}

/// What the file says of figures that were not drawn when it was committed, and what holds now. Files of settings are not changed
/// once a number was computed with them.
const DRAWN_SINCE: [[&str; 2]; 7] = [
    ["; Figure 6 itself is not drawn.", "."],
    [
        "In 2D the first rounds of darts are samples of rasterized squares;",
        "The first rounds of darts are random candidates in squares (2D) and prisms (3D) that conservative mode drew;",
    ],
    ["and what is finer than pixels are done on the CPU.", "and later rounds are done on the CPU."],
    [
        "In 3D all darts are thrown on the CPU: no prism is drawn, and the 3D half of Figure 11 is not either.",
        "Figure 11 shows the points before the last pass, and the uncovered regions that it draws.",
    ],
    [
        "No triangle is drawn: points are chosen on the CPU from columns that bound the density.",
        "Columns that bound the density are drawn in conservative mode; the number of points of a set is random, as given on average.",
    ],
    [
        "Figure 14 is not drawn: the row measures the map, not the picture it is used in.",
        "The row measures the map, not the picture it is used in (Figure 14).",
    ],
    ["Figure 17 is not drawn: its scene,", "Figure 17 is drawn with our scene, smaller: its scene,"],
];

fn with_figures(limits: &str) -> String {
    DRAWN_SINCE.iter().fold(limits.to_owned(), |limits, [said, now]| limits.replace(said, now))
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_file_still_says_which_figures_were_not_drawn() {
        let (settings, _) = load::<Settings>(None).unwrap();
        let abouts = [
            &settings.vi_2.about,
            &settings.vi_9.about,
            &settings.vi_9.about,
            &settings.vi_9.about,
            &settings.vi_10.about,
            &settings.vi_11.about,
            &settings.vi_13.about,
        ];
        for (about, [said, now]) in abouts.into_iter().zip(DRAWN_SINCE) {
            assert!(about.limits.contains(said), "{}", about.id);
            let limits = with_figures(&about.limits);
            assert!(
                limits.contains(now) && !limits.contains("not drawn") && !limits.contains("is drawn:"),
                "{limits}"
            );
        }
    }
}
