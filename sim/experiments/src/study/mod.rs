//! Studies: something is measured, drawn and written in one go. A chart of the book and the failure catalogue
//! are studies.
//!
//! - [`Study`]: what a study is; [`StudyEntry`]: one of them in a list.
//! - [`table`]: tables whose columns are declared once.
//! - [`tradeoff`]: speed against accuracy, the same few numbers for every method; one page of all studies.
//! - [`Ran`]: work that a measurement ran, added up from the reports of its frames.

pub mod table;
pub mod tradeoff;

use std::ops::AddAssign;
use std::time::Instant;

use activity::{Counts, Event};
use output::plot::{Chart, ChartPanel, Picture, PlotStyle};
use output::terminal::Progress;
use output::{Claim, OutDir, OutputError};
use pipeline::FrameReport;
use rayon::prelude::*;
use run::{GpuError, RunError};
use serde::Serialize;
use table::Sheet;
use tradeoff::TradeoffPoint;

/// The result of a study: measured once, then drawn, written and printed. As JSON it is everything that was found.
pub trait Study: Serialize + Sized {
    /// Name of the study on the command line.
    const NAME: &'static str;
    /// Subject of the study, in one line.
    const ABOUT: &'static str;
    /// Paths of its pictures, without endings.
    const PICTURES: &'static [&'static str];
    /// CSV files, and the JSON file, which is written last. Tables in Markdown are in `NAME.md`.
    const FILES: &'static [&'static str];
    /// Whether other scenes than its own can be given.
    const TAKES_SCENES: bool = false;
    /// Whether it draws what it measures at random, by a seed that can be given.
    const TAKES_SEED: bool = false;
    /// Whether the time it took is printed.
    const SHOWS_TIME: bool = false;
    /// Effort of the measurement.
    type Effort;
    /// The study of the book.
    const FULL: Self::Effort;
    /// A preview in seconds.
    const QUICK: Self::Effort;

    /// The effort with another seed, where it takes one.
    fn seeded(effort: Self::Effort, _seed: u64) -> Self::Effort {
        effort
    }

    /// Measures, on `scenes` besides its own where it takes any.
    ///
    /// # Errors
    /// [`StudyError`] when a scene cannot be loaded or drawn, or the hardware cannot be built.
    fn measure(effort: Self::Effort, scenes: &[String], progress: &Progress) -> Result<Self, StudyError>;

    /// Draws its pictures.
    ///
    /// # Errors
    /// Errors of the folder.
    fn draw(&self, to: &Gallery<'_>) -> Result<(), OutputError>;

    /// Tables, in the order in which they are printed.
    fn tables(&self) -> Vec<Sheet>;

    /// Methods and their levels between speed and accuracy.
    fn tradeoff(&self) -> Vec<TradeoffPoint> {
        Vec::new()
    }

    /// A promise that was found broken.
    fn fault(&self) -> Option<String> {
        None
    }

    /// The files it may write.
    fn claim() -> Claim {
        Claim::new(format!("chart {}", Self::NAME)).plots(Self::PICTURES).files(files::<Self>())
    }
}

/// All files of a study besides its pictures.
pub(crate) fn files<S: Study>() -> impl Iterator<Item = String> {
    S::FILES.iter().map(|file| (*file).to_owned()).chain([markdown_file::<S>()])
}

fn markdown_file<S: Study>() -> String {
    format!("{}.md", S::NAME.replace('-', "_"))
}

/// The pictures of a study on their way into its folder.
#[derive(Debug)]
pub struct Gallery<'a> {
    dir: &'a OutDir,
    plot_style: &'a PlotStyle,
}

impl Gallery<'_> {
    /// Style of pictures.
    pub fn plot_style(&self) -> &PlotStyle {
        self.plot_style
    }

    /// Writes a picture as `stem`.
    ///
    /// # Errors
    /// Errors of the folder.
    pub fn add(&self, stem: &str, picture: &Picture) -> Result<(), OutputError> {
        picture.write(self.dir, stem)
    }

    /// Draws panels under a title and a line on what they show, and writes them as `stem`.
    ///
    /// # Errors
    /// Errors of the folder.
    pub fn chart(&self, stem: &str, titles: [&str; 2], panels: Vec<ChartPanel>) -> Result<(), OutputError> {
        let [title, subject] = titles;
        self.add(stem, &Chart::new(title, subject, panels).picture(self.plot_style))
    }
}

/// Measures every case, several at once, with a bar of this name. Results are in the order of the cases.
pub(crate) fn each<C: Sync, R: Send, E: Send>(
    cases: &[C],
    (bar, progress): (&str, &Progress),
    measure: impl Fn(&C) -> Result<R, E> + Sync,
) -> Result<Vec<R>, E> {
    let bar = progress.bar(bar, cases.len() as u64);
    let one = |case| measure(case).inspect(|_| bar.inc());
    cases.par_iter().map(one).collect()
}

/// Rows in groups, in the order of the first of each group.
pub(crate) fn groups<'a, R>(
    rows: impl Iterator<Item = &'a R>,
    same: impl Fn(&R, &R) -> bool,
) -> Vec<Vec<&'a R>> {
    let mut groups: Vec<Vec<&R>> = Vec::new();
    for row in rows {
        match groups.iter_mut().find(|group| same(group[0], row)) {
            Some(group) => group.push(row),
            None => groups.push(vec![row]),
        }
    }
    groups
}

/// A request for a study.
#[derive(Clone, Copy, Debug)]
pub struct StudyRequest<'a> {
    /// Whether a preview will do.
    pub quick: bool,
    /// Scenes besides its own.
    pub scenes: &'a [String],
    /// Seed of what is drawn at random, instead of its own.
    pub seed: Option<u64>,
    /// The folder for its files.
    pub dir: &'a OutDir,
    /// Style of pictures.
    pub plot_style: &'a PlotStyle,
    /// Display of progress.
    pub progress: &'a Progress,
}

/// A study that is measured, drawn and written.
#[derive(Clone, Debug)]
pub struct Done {
    /// Tables and what else is to be said of the study, in whole lines.
    pub text: String,
    /// Everything it found.
    pub json: String,
    /// Methods and their levels between speed and accuracy.
    pub tradeoff: Vec<TradeoffPoint>,
    /// A promise that it found broken.
    pub fault: Option<String>,
}

impl Done {
    /// Draws and writes what a study found into `dir`.
    ///
    /// # Errors
    /// Errors of the folder.
    pub fn new<S: Study>(found: &S, dir: &OutDir, plot_style: &PlotStyle) -> Result<Self, OutputError> {
        let sheets = found.tables();
        write(found, &sheets, dir, plot_style)?;
        let texts: Vec<String> = sheets.iter().filter_map(Sheet::text).collect();
        // What was written as JSON can be printed as JSON.
        let json = serde_json::to_string_pretty(found).unwrap_or_default();
        let tradeoff = found.tradeoff().into_iter().map(|point| point.of(S::NAME)).collect();
        Ok(Self { text: texts.join("\n"), json, tradeoff, fault: found.fault() })
    }
}

fn write<S: Study>(
    found: &S,
    sheets: &[Sheet],
    dir: &OutDir,
    plot_style: &PlotStyle,
) -> Result<(), OutputError> {
    found.draw(&Gallery { dir, plot_style })?;
    for sheet in sheets {
        sheet.csv_file().map_or(Ok(()), |file| dir.write_file(file, |out| sheet.write_csv(out)))?;
    }
    let tables: Vec<String> = sheets.iter().filter_map(Sheet::markdown).collect();
    dir.write_file(&markdown_file::<S>(), |out| Ok(out.write_all(tables.join("\n").as_bytes())?))?;
    S::FILES.iter().find(|file| file.ends_with(".json")).map_or(Ok(()), |file| dir.write_json(file, found))
}

/// A study in a list of studies.
#[derive(Clone, Copy, Debug)]
pub struct StudyEntry {
    /// Name of the study on the command line.
    pub name: &'static str,
    /// Subject of the study, in one line.
    pub about: &'static str,
    /// Whether other scenes than its own can be given.
    pub takes_scenes: bool,
    /// Whether a seed can be given.
    pub takes_seed: bool,
    claim: fn() -> Claim,
    run: fn(&StudyRequest<'_>) -> Result<Done, StudyError>,
}

impl StudyEntry {
    /// The entry of a study.
    pub const fn of<S: Study>() -> Self {
        Self {
            name: S::NAME,
            about: S::ABOUT,
            takes_scenes: S::TAKES_SCENES,
            takes_seed: S::TAKES_SEED,
            claim: S::claim,
            run: run::<S>,
        }
    }

    /// The files it may write.
    pub fn claim(&self) -> Claim {
        (self.claim)()
    }

    /// Measures, draws and writes it.
    ///
    /// # Errors
    /// [`StudyError`], above all when the folder cannot be written to.
    pub fn run(&self, request: &StudyRequest<'_>) -> Result<Done, StudyError> {
        (self.run)(request)
    }
}

fn run<S: Study>(request: &StudyRequest<'_>) -> Result<Done, StudyError> {
    let started = Instant::now();
    let effort = if request.quick { S::QUICK } else { S::FULL };
    let effort = match request.seed {
        Some(seed) => S::seeded(effort, seed),
        None => effort,
    };
    let scenes = if S::TAKES_SCENES { request.scenes } else { &[] };
    let found = S::measure(effort, scenes, request.progress)?;
    let mut done = Done::new(&found, request.dir, request.plot_style)?;
    if S::SHOWS_TIME {
        done.text += &format!("took {:.1} s\n", started.elapsed().as_secs_f64());
    }
    Ok(done)
}

/// Measures a study and checks that all of its files are there, in a folder that lives as long as the first result.
#[cfg(test)]
pub(crate) fn written<S: Study>(effort: S::Effort) -> (tempfile::TempDir, S, Done) {
    let folder = tempfile::tempdir().unwrap();
    let foreign = folder.path().join(format!("{}_old.png", S::NAME));
    std::fs::write(&foreign, b"mine").unwrap();
    let found = S::measure(effort, &[], &Progress::new(true)).unwrap();
    let make = |dir: &OutDir| Done::new(&found, dir, &PlotStyle::default()).unwrap();
    let done = OutDir::with(folder.path(), S::claim(), make).unwrap();
    let pictures = S::PICTURES.iter().flat_map(|stem| ["svg", "png"].map(|end| format!("{stem}.{end}")));
    for file in pictures.chain(files::<S>()) {
        assert!(folder.path().join(&file).exists(), "{file}");
    }
    let tables = std::fs::read_to_string(folder.path().join(markdown_file::<S>())).unwrap();
    assert!(tables.starts_with("| "), "{tables}");
    assert!(foreign.exists(), "a file that no study wrote is gone");
    (folder, found, done)
}

/// Why a study could not be made.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the variants are the sources, documented there")]
pub enum StudyError {
    #[error(transparent)]
    Scene(#[from] workloads::LoadError),
    #[error(transparent)]
    Frame(#[from] workloads::FrameError),
    #[error(transparent)]
    Pass(#[from] pipeline::PassError),
    #[error(transparent)]
    Samples(#[from] pipeline::sampling::SampleTableError),
    #[error(transparent)]
    Gpu(#[from] GpuError),
    #[error(transparent)]
    Soup(#[from] workloads::stress::StressError),
    #[error(transparent)]
    Curve(#[from] traces::CurveError),
    #[error(transparent)]
    Recording(#[from] traces::synth::SynthError),
    #[error(transparent)]
    Mark(#[from] traces::frames::MarkError),
    #[error("starting the thread that is timed: {0}")]
    Thread(#[from] rayon::ThreadPoolBuildError),
    #[error("the pipeline does not take the scene: {0}")]
    Pipeline(String),
    #[error(transparent)]
    Job(#[from] workloads::job::JobError),
    #[error(transparent)]
    Run(#[from] RunError),
    #[error(transparent)]
    Output(#[from] OutputError),
}

impl StudyError {
    /// The pipeline refused what it was given.
    pub(crate) fn pipeline(why: impl std::fmt::Display) -> Self {
        Self::Pipeline(why.to_string())
    }
}

impl From<StudyError> for RunError {
    fn from(error: StudyError) -> Self {
        match error {
            StudyError::Run(error) => error,
            // Failures stay what they are; the rest comes from values in the settings of a paper.
            StudyError::Frame(error) => error.into(),
            StudyError::Job(error) => error.into(),
            StudyError::Output(error) => error.into(),
            other => Self::setting(other),
        }
    }
}

/// Counts of what ran.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Ran {
    /// Passes.
    pub passes: u64,
    /// Draws.
    pub draws: u64,
    /// Samples inside a triangle.
    pub fragments: u64,
}

impl Ran {
    /// Work of a frame.
    pub fn of(report: &FrameReport) -> Self {
        Self::counted(report.passes.len() as u64, &report.counts())
    }

    /// Work of so many passes with these counts.
    pub fn counted(passes: u64, counts: &Counts) -> Self {
        Self { passes, draws: counts[Event::Draws], fragments: counts[Event::SamplesHit] }
    }
}

impl AddAssign for Ran {
    fn add_assign(&mut self, other: Self) {
        self.passes += other.passes;
        self.draws += other.draws;
        self.fragments += other.fragments;
    }
}

impl std::iter::Sum for Ran {
    fn sum<I: Iterator<Item = Self>>(all: I) -> Self {
        all.fold(Self::default(), |mut sum, one| {
            sum += one;
            sum
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failure_in_a_study_is_no_fault_of_the_request() {
        let failed = OutputError::Unclaimed { path: "summary.json".to_owned() };
        assert!(!RunError::from(StudyError::from(failed)).is_usage());
        assert!(RunError::from(StudyError::pipeline("an image without pixels")).is_usage());
    }
}
