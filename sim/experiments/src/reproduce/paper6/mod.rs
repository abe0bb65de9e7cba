//! Paper VI, "Design and Novel Uses of Higher-Dimensional Rasterization": a module for each use.
//!
//! Public cases of collision detection are read from a folder that a user names: scenes (`*.mts.gz`) and, in
//! `queries`, files of queries of one vertex and one face or of two edges.

mod collision;
mod culling;
mod depths;
mod figures;
mod light;
mod sampling;
mod settings;
mod torus;
mod views;

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};

use flate2::read::GzDecoder;
use output::terminal::Progress;
use run::RunError;
use settings::Settings;
use workloads::collision::{Object, PairAnswer, PairSearch, detect, detect_each};
use workloads::stress::{Size, StressScene, families};
use workloads::visibility::load_mts;

use self::settings::PublicScene;
use super::row::With;
use super::settings::{Form, SettingsOrigin, load};
use super::{Done, ReproduceOptions};

/// Input of every row.
struct Task<'a> {
    settings: Settings,
    form: Form,
    origin: SettingsOrigin,
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

pub(super) fn rows(
    options: &ReproduceOptions,
    progress: &Progress,
) -> Result<(SettingsOrigin, Vec<Done>), RunError> {
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
        check_public(folder, task.settings.vi_1.public_scenes.get(task.form))?;
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

/// Scenes of every family of the failure catalogue: one in the middle of its sweep, or so many from its
/// harmless end on.
fn catalogue(size: Size, of_each: usize, seed: u64) -> Result<Vec<StressScene>, RunError> {
    let mut scenes = Vec::new();
    for family in families() {
        let values = family.sweep(true);
        let (first, step) = match of_each {
            1 => (values.len() / 2, values.len()),
            many => (0, (values.len() / (many - 1).max(1)).max(1)),
        };
        for value in values.iter().skip(first).step_by(step) {
            scenes.push(family.scene(*value, size, seed)?);
        }
    }
    Ok(scenes)
}

/// Two objects that collide.
type Pair = [Object; 2];

/// Content of the folder.
#[derive(Default)]
struct Public {
    /// Scenes read.
    pub scenes: usize,
    /// Pairs of their objects that collide, by the lists that come with them.
    pub known: usize,
    /// Pairs of them in which two triangles were seen to cross or to share a corner; which pairs the others
    /// are is not known.
    pub seen: usize,
    /// Pairs of scenes, at least, and queries missed by `quintile ccd`.
    pub missed_closer: usize,
    /// Files of queries, and queries that collide.
    pub query_files: usize,
    /// Queries in all.
    pub queries: usize,
    /// Pairs that passes have to keep: the pairs seen, and the queries that collide.
    pub collide: Vec<Pair>,
    /// The queries that do not collide, which passes may clear or keep.
    pub apart: Vec<Pair>,
    /// Queries of them that `quintile ccd` keeps.
    pub kept_closer: usize,
}

/// Refuses a folder without any case that is read.
fn check_public(folder: &Path, scenes: &[PublicScene]) -> Result<(), RunError> {
    let scene = scenes.iter().any(|scene| folder.join(&scene.file).is_file());
    let files = files_below(folder)?;
    let is_query = |path: &PathBuf| {
        path.starts_with(folder.join("queries")) && path.to_string_lossy().ends_with(".csv.gz")
    };
    if scene || files.iter().any(is_query) {
        return Ok(());
    }
    let known: Vec<&str> = scenes.iter().map(|scene| scene.file.as_str()).collect();
    Err(RunError::setting(format_args!(
        "--collision-data {}: no public case in it ({}, or *.csv.gz in a folder called queries); name the folder that has them",
        folder.display(),
        known.join(", ")
    )))
}

/// Every file in a folder and below, in order.
fn files_below(folder: &Path) -> Result<Vec<PathBuf>, RunError> {
    let failed = |error: std::io::Error| {
        let name = format_args!("--collision-data {}", folder.display());
        RunError::invalid(name, format_args!("cannot read it: {error}; name a folder"))
    };
    let mut entries = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(failed)? {
        entries.push(entry.map_err(failed)?.path());
    }
    entries.sort();
    let mut files = Vec::new();
    for path in entries {
        if path.is_dir() {
            files.extend(files_below(&path)?);
        } else {
            files.push(path);
        }
    }
    Ok(files)
}

/// Reads all cases that are there.
fn load_public(folder: &Path, scenes: &[PublicScene]) -> Result<Public, RunError> {
    let mut public = Public::default();
    for scene in scenes {
        let path = folder.join(&scene.file);
        if path.is_file() {
            public.scene(&path, scene)?;
        }
    }
    let queries = folder.join("queries");
    let files = if queries.is_dir() { files_below(&queries)? } else { Vec::new() };
    for path in files.iter().filter(|path| path.to_string_lossy().ends_with(".csv.gz")) {
        public.file_of_queries(path)?;
    }
    Ok(public)
}

impl Public {
    fn scene(&mut self, path: &Path, scene: &PublicScene) -> Result<(), RunError> {
        let meshes = load_mts(path)?;
        if meshes.len() != scene.objects {
            let message =
                format!("{}: {} objects, {} are known", path.display(), meshes.len(), scene.objects);
            return Err(RunError::setting(format_args!("{message}; get the file of the data set anew")));
        }
        let object = |mesh| Object::new(mesh, 0.0);
        let objects: Option<Vec<Object>> = meshes.iter().map(object).collect();
        let objects = objects.ok_or_else(|| {
            RunError::invalid(path.display(), "a coordinate is beyond 1e60 or not a number")
        })?;
        let answers = detect(&objects, &PairSearch::default());
        let kept = answers.iter().filter(|answer| answer.verdict.may_collide());
        let seen: Vec<_> = kept.clone().filter(|answer| answer.verdict.is_contact()).collect();
        self.scenes += 1;
        self.known += scene.collide;
        self.seen += seen.len().min(scene.collide);
        self.missed_closer += scene.collide.saturating_sub(kept.count());
        let pair = |answer: &&PairAnswer| [answer.a, answer.b].map(|n| objects[n].clone());
        self.collide.extend(seen.iter().map(pair));
        Ok(())
    }

    /// Eight rows a query, of seven integers: x, y and z as fractions, and the truth.
    fn file_of_queries(&mut self, path: &Path) -> Result<(), RunError> {
        let rows = query_rows(path)?;
        let vertex_face = path.parent().is_some_and(|folder| folder.ends_with("vertex-face"));
        let pair = |query: &[([f64; 3], bool)]| query_pair(query, vertex_face);
        let pairs: Option<Vec<Pair>> = rows.chunks_exact(8).map(pair).collect();
        let pairs = pairs.ok_or_else(|| RunError::invalid(path.display(), "a coordinate is beyond 1e60"))?;
        let cases: Vec<&[Object]> = pairs.iter().map(Pair::as_slice).collect();
        let kept: Vec<bool> = detect_each(&cases, &PairSearch::default(), || ())
            .iter()
            .map(|answers| any_kept(answers))
            .collect();
        self.queries += pairs.len();
        self.query_files += 1;
        for ((pair, kept), query) in pairs.into_iter().zip(kept).zip(rows.chunks_exact(8)) {
            if query[0].1 {
                self.missed_closer += usize::from(!kept);
                self.collide.push(pair);
            } else {
                self.kept_closer += usize::from(kept);
                self.apart.push(pair);
            }
        }
        Ok(())
    }
}

/// Whether a pair of objects may collide.
fn any_kept(answers: &[PairAnswer]) -> bool {
    answers.iter().any(|answer| answer.verdict.may_collide())
}

/// The vertex and the face of a query, or its two edges; `None` if a coordinate is too large.
fn query_pair(query: &[([f64; 3], bool)], vertex_face: bool) -> Option<Pair> {
    let [from, to] = [0, 4].map(|end| [0, 1, 2, 3].map(|corner| query[end + corner].0));
    let [one, other] = if vertex_face {
        [[from, to].map(|p| [p[0]; 3]), [from, to].map(|p| [p[1], p[2], p[3]])]
    } else {
        [[from, to].map(|p| [p[0], p[1], p[1]]), [from, to].map(|p| [p[2], p[3], p[3]])]
    };
    Some([Object::from_ends(vec![one], 0.0)?, Object::from_ends(vec![other], 0.0)?])
}

/// The rows of a file of queries: a point, and whether the truth of its query is a collision.
fn query_rows(path: &Path) -> Result<Vec<([f64; 3], bool)>, RunError> {
    let failed = |line: usize, what: &str| {
        let name = format_args!("{}:{line}", path.display());
        RunError::invalid(name, format_args!("{what}; get the file of the data set anew"))
    };
    let file = std::fs::File::open(path).map_err(|error| failed(1, &error.to_string()))?;
    let mut rows = Vec::new();
    for (number, line) in (1..).zip(BufReader::new(GzDecoder::new(file)).lines()) {
        let line = line.map_err(|error| failed(number, &error.to_string()))?;
        if line.trim().is_empty() {
            continue;
        }
        let cells: Result<Vec<f64>, _> = line.split(',').map(|cell| cell.trim().parse::<f64>()).collect();
        let cells = cells.map_err(|error| failed(number, &error.to_string()))?;
        let [x, dx, y, dy, z, dz, truth] = cells[..] else {
            return Err(failed(number, "seven numbers are expected"));
        };
        rows.push(([x / dx, y / dy, z / dz], truth != 0.0));
    }
    if !rows.len().is_multiple_of(8) {
        return Err(failed(rows.len(), "eight rows for each query are expected"));
    }
    Ok(rows)
}
