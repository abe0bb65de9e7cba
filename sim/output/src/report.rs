//! Report: one HTML page about a run that opens from disk and needs no network.

use std::borrow::Cow;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use minijinja::{Environment, context};
use serde::{Serialize, Serializer};

use super::MeanSd;
use super::dir::{OutDir, OutputError};
use super::table::{grouped, number, si, si_digits, si_mean_sd};

/// Template of the page.
const TEMPLATE: &str = include_str!("../assets/report.html");
/// The extension `.html` enables escaping of every value.
const TEMPLATE_NAME: &str = "report.html";

/// Error of filling the template.
#[derive(Debug, thiserror::Error)]
#[error("cannot fill the report: {0}")]
pub struct ReportError(#[from] minijinja::Error);

/// Contents of the report. All text is escaped.
#[derive(Clone, Debug, Default, Serialize)]
pub struct RunReport<'a> {
    /// Heading, for example `default on hd7970`.
    pub title: Cow<'a, str>,
    /// Scene, GPU, platform, level of timing, command line, version: shown below the heading in this order.
    pub facts: Vec<FactRow>,
    /// Warnings, shown first.
    pub warnings: Vec<WarningRow>,
    /// Time, energy, energy per pixel and power of a frame.
    pub headline: Vec<Headline>,
    /// Rendered frames: the first is shown large, the others small.
    pub images: Vec<ReportImage>,
    /// The plots, in order.
    pub plots: Vec<ReportPlot>,
    /// Energy by part over the run.
    pub parts: Vec<PartRow>,
    /// One row per frame.
    pub frames: Vec<ReportFrame>,
    /// Pixels of a frame, for joules per pixel; 0 leaves that column empty.
    pub pixels: u64,
    /// One row per name of a pass.
    pub passes: Vec<PassRow>,
    /// One row per unit: what was modelled and what was not.
    pub units: Vec<UnitRow>,
    /// One row per counter.
    pub counters: Vec<CounterRow>,
    /// Settings in use.
    pub settings: Vec<FactRow>,
    /// Input files: path, hash, size.
    pub inputs: Vec<FactRow>,
    /// The files beside the report.
    pub files: Vec<FileLink>,
    /// Program, command line and host, in a section of their own: results do not depend on them.
    pub host: Vec<FactRow>,
}

/// Quantity per frame, measured and true.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Headline {
    /// Name, for example `energy per frame`.
    pub label: String,
    /// Unit without prefix, for example `J`.
    pub unit: String,
    /// Measured in the trace, in the unit.
    pub measured: Option<MeanSd>,
    /// Ground truth of the simulator, in the unit.
    pub truth: Option<MeanSd>,
}

/// Image embedded in the page.
#[derive(Clone, Debug, Default, Serialize)]
pub struct ReportImage {
    /// Caption, for example `frame 12`.
    pub caption: String,
    /// Contents of a PNG file; see [`super::image::LinearImage::thumbnail_png`].
    #[serde(serialize_with = "base64")]
    pub png: Vec<u8>,
    /// File in full size, relative to the report.
    pub link: Option<String>,
}

/// Plot embedded in the page.
#[derive(Clone, Debug, Default, Serialize)]
pub struct ReportPlot {
    /// Caption, one sentence.
    pub caption: String,
    /// The text of an SVG file made by [`super::plot::Picture::svg`]; it is embedded unchanged.
    pub svg: String,
    /// Path without extension of the `.svg` and `.png` files, relative to the report.
    pub stem: Option<String>,
}

/// Part with its share of the energy.
#[derive(Serialize)]
struct PartView<'a> {
    #[serde(flatten)]
    part: &'a PartRow,
    share: f64,
    /// Share of the energy without idle time; `None` for idle energy.
    busy_share: Option<f64>,
}

impl RunReport<'_> {
    /// Fills the template.
    ///
    /// # Errors
    /// [`ReportError`] if the template cannot be filled.
    pub fn html(&self) -> Result<String, ReportError> {
        let mut environment = Environment::new();
        environment.set_trim_blocks(true);
        environment.set_lstrip_blocks(true);
        environment
            .add_filter("si", |value: Option<f64>, unit: &str| value.map_or("–".into(), |v| si(v, unit)));
        environment.add_filter("si4", |value: Option<f64>, unit: &str| {
            value.map_or("–".into(), |value| si_digits(value, unit, 4))
        });
        environment.add_filter("mean_sd", mean_sd);
        environment.add_filter("number", |value: f64| number(value));
        environment.add_filter("grouped", |value: u64| grouped(value));
        environment.add_filter("percent", |value: Option<f64>| value.map_or("–".into(), percent));
        environment.add_template(TEMPLATE_NAME, TEMPLATE)?;
        let page = environment.get_template(TEMPLATE_NAME)?;
        Ok(page.render(context! { report => self, parts => self.part_views() })?)
    }

    /// Writes the page to `relative` in `dir`.
    ///
    /// # Errors
    /// [`OutputError::Write`] with the file and the cause.
    pub fn write(&self, dir: &OutDir, relative: &str) -> Result<(), OutputError> {
        dir.write_file(relative, |out| Ok(out.write_all(self.html()?.as_bytes())?)).map(drop)
    }

    /// Parts with their shares of all energy, and of the energy without idle time.
    fn part_views(&self) -> Vec<PartView<'_>> {
        let sum = |parts: &mut dyn Iterator<Item = &PartRow>| parts.map(|part| part.energy_j).sum::<f64>();
        let total = sum(&mut self.parts.iter());
        let busy = sum(&mut self.parts.iter().filter(|part| !part.idle));
        let of = |part: &PartRow, whole: f64| if whole > 0.0 { part.energy_j / whole } else { 0.0 };
        let view = |part| PartView {
            part,
            share: of(part, total),
            busy_share: Some(of(part, busy)).filter(|_| !part.idle),
        };
        self.parts.iter().map(view).collect()
    }
}

fn mean_sd(mean: Option<f64>, sd: Option<f64>, unit: &str) -> String {
    mean.map_or("–".to_owned(), |mean| si_mean_sd(MeanSd { mean, sd }, unit))
}

fn percent(fraction: f64) -> String {
    if fraction.is_finite() { format!("{:.1} %", fraction * 100.0) } else { "n/a".to_owned() }
}

fn base64<S: Serializer>(bytes: &[u8], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&STANDARD.encode(bytes))
}

/// Name and value, for example of a setting.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct FactRow {
    /// Name.
    pub name: String,
    /// Value with its unit.
    pub value: String,
    /// Note; may be empty.
    pub note: String,
}

impl FactRow {
    /// Row without a note.
    pub fn new(name: impl Into<String>, value: impl Into<String>) -> Self {
        Self { name: name.into(), value: value.into(), note: String::new() }
    }
}

/// Warning.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct WarningRow {
    /// Warning code.
    pub code: String,
    /// Message.
    pub message: String,
    /// Affected things, if there are several.
    pub details: Vec<String>,
}

/// A part of the energy of the run.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct PartRow {
    /// A unit, `constant`, `leakage`, `clock tree`.
    pub name: String,
    /// Description, one sentence.
    pub doc: String,
    /// Colour in CSS notation, the same as in plots.
    pub colour: String,
    /// Whether this is idle energy between frames.
    pub idle: bool,
    /// Energy in joules.
    pub energy_j: f64,
}

/// Time, energy and mean power of a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct FrameNumbers {
    /// Time to the start of the next frame, in seconds.
    pub time_s: f64,
    /// Energy over that time, in joules.
    pub energy_j: f64,
    /// Mean power in watts.
    pub power_w: f64,
}

/// Row of a frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ReportFrame {
    /// Number of the frame.
    pub frame: u64,
    /// Start in seconds.
    pub start_s: f64,
    /// Busy time in seconds, if known.
    pub busy_s: Option<f64>,
    /// Measured in the trace; `None` if the frame was not found.
    pub measured: Option<FrameNumbers>,
    /// Ground truth of the simulator; `None` for a recording.
    pub truth: Option<FrameNumbers>,
    /// Flags, for example `warm-up`; may be empty.
    pub flags: String,
}

/// Row of the passes of one name.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct PassRow {
    /// Name of the pass.
    pub name: String,
    /// Number of passes.
    pub passes: u64,
    /// All of them together.
    #[serde(flatten)]
    pub all: WorkRow,
    /// Each draw, by its place in the pass; empty if they are not shown.
    pub draws: Vec<WorkRow>,
    /// What is of no single draw.
    pub others: Option<WorkRow>,
}

/// Time, energy and memory traffic of passes or draws.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct WorkRow {
    /// Seconds.
    pub time_s: f64,
    /// Share of the time of all passes, 0 to 1.
    pub time_share: f64,
    /// Joules.
    pub energy_j: f64,
    /// Share of the energy of all passes, 0 to 1.
    pub energy_share: f64,
    /// Bytes to and from memory.
    pub dram_bytes: u64,
    /// What units waited for most; empty if it is not known.
    pub waits: String,
}

/// Row of a unit.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct UnitRow {
    /// Name of the unit.
    pub name: String,
    /// Description, one sentence.
    pub doc: String,
    /// Share of the frames' busy time in which the unit was busy, 0 to 1; `None` if it was not timed.
    pub busy: Option<f64>,
    /// Whether the run modelled it.
    pub modelled: bool,
    /// Note on the model; may be empty.
    pub note: String,
}

/// Row of a counter.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct CounterRow {
    /// Unit of the counter.
    pub unit: String,
    /// Name in files.
    pub name: String,
    /// Description of one event.
    pub doc: String,
    /// Sum over the run.
    pub total: u64,
    /// Mean per frame.
    pub per_frame: f64,
    /// Mean per pixel of a frame.
    pub per_pixel: f64,
}

/// A file beside the report.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct FileLink {
    /// Path relative to the report, with `/` between folders.
    pub path: String,
    /// Description of the contents.
    pub what: String,
}
