//! One page that shows a whole run, opens from disk and asks the network for nothing.

use std::borrow::Cow;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use minijinja::{Environment, context};
use serde::{Serialize, Serializer};

use super::MeanSd;
use super::dir::{OutDir, OutputError};
use super::table::{grouped, number, si, si_digits, si_mean_sd};

mod rows;

pub use rows::{CounterRow, FactRow, FileLink, FrameNumbers, FrameRow, PartRow, UnitRow, WarningRow};

/// The page before it is filled.
const TEMPLATE: &str = include_str!("../../assets/report.html");
/// The end of the name makes every value escaped for HTML.
const TEMPLATE_NAME: &str = "report.html";

/// Why the report could not be made.
#[derive(Debug, thiserror::Error)]
#[error("cannot fill the report: {0}")]
pub struct ReportError(#[from] minijinja::Error);

/// What the report says. All text may be anything; it is escaped.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Report<'a> {
    /// The heading, for example `default on hd7970`.
    pub title: Cow<'a, str>,
    /// Scene, GPU, platform, level of timing, command line, version: shown below the heading in this order.
    pub facts: Vec<FactRow>,
    /// Remarks that go before everything else.
    pub warnings: Vec<WarningRow>,
    /// The numbers of the run: time, energy, energy per pixel and power of a frame.
    pub headline: Vec<Headline>,
    /// Rendered frames: the first is shown large, the others small.
    pub images: Vec<ReportImage>,
    /// The plots, in order.
    pub plots: Vec<ReportPlot>,
    /// Energy by part over the run.
    pub parts: Vec<PartRow>,
    /// One row per frame.
    pub frames: Vec<FrameRow>,
    /// Pixels of a frame, for joules per pixel; 0 leaves that column empty.
    pub pixels: u64,
    /// One row per unit: what was modelled and what was not.
    pub units: Vec<UnitRow>,
    /// One row per counter.
    pub counters: Vec<CounterRow>,
    /// Every setting that the results depend on.
    pub settings: Vec<FactRow>,
    /// The files that the run was made from: path, hash, size.
    pub inputs: Vec<FactRow>,
    /// The files beside the report.
    pub files: Vec<FileLink>,
    /// The program, the call and the machine: in a section of their own, as results do not depend on them.
    pub host: Vec<FactRow>,
}

/// A number of the run, per frame, measured and true.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Headline {
    /// What it is, for example `energy per frame`.
    pub label: String,
    /// Its plain unit, for example `J`; the prefix is chosen.
    pub unit: String,
    /// By the analysis of the trace, in the unit.
    pub measured: Option<MeanSd>,
    /// By the simulator, in the unit.
    pub truth: Option<MeanSd>,
}

/// A rendered frame within the page.
#[derive(Clone, Debug, Default, Serialize)]
pub struct ReportImage {
    /// Below the picture, for example `frame 12`.
    pub caption: String,
    /// The bytes of a PNG file; see [`super::image::LinearImage::thumbnail_png`].
    #[serde(serialize_with = "base64")]
    pub png: Vec<u8>,
    /// The file in full size, relative to the report.
    pub link: Option<String>,
}

/// A plot within the page.
#[derive(Clone, Debug, Default, Serialize)]
pub struct ReportPlot {
    /// What it shows and how to read it, in a sentence.
    pub caption: String,
    /// The text of an SVG file made by [`super::plot::Picture::svg`]; it is put into the page as it is.
    pub svg: String,
    /// Path without extension of the `.svg` and `.png` files, relative to the report.
    pub stem: Option<String>,
}

/// A part with what follows from the others.
#[derive(Serialize)]
struct PartView<'a> {
    #[serde(flatten)]
    part: &'a PartRow,
    share: f64,
    /// Share of the energy while frames are drawn; `None` for what is drawn between them.
    busy_share: Option<f64>,
}

impl Report<'_> {
    /// The page.
    ///
    /// # Errors
    /// [`ReportError`] when the template cannot be filled.
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

    /// The parts with their shares of all energy, and of that without what is drawn between frames.
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
    match (mean, sd) {
        (Some(mean), Some(sd)) => si_mean_sd(MeanSd { mean, sd }, unit),
        _ => "–".to_owned(),
    }
}

fn percent(fraction: f64) -> String {
    if fraction.is_finite() { format!("{:.1} %", fraction * 100.0) } else { "n/a".to_owned() }
}

fn base64<S: Serializer>(bytes: &[u8], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&STANDARD.encode(bytes))
}
