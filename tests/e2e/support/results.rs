//! The folder of results, read back.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use image::RgbImage;
use serde_json::Value;
use tempfile::TempDir;
use traces::Trace;

use super::Ended;

/// The results of a run.
#[derive(Debug)]
pub struct Results {
    folder: PathBuf,
    /// Keeps the temporary folder.
    _temporary: Option<TempDir>,
    /// Output of the command.
    pub ended: Ended,
}

/// A row of `frames.csv`, in SI units.
#[derive(Clone, Debug)]
pub struct FrameRow {
    /// Found start, s.
    pub start_s: f64,
    /// End: the next start or the end mark, s.
    pub end_s: f64,
    /// Energy, J.
    pub energy_j: f64,
}

impl Results {
    pub(crate) fn new(folder: PathBuf, temporary: Option<TempDir>, ended: Ended) -> Self {
        Self { folder, _temporary: temporary, ended }
    }

    /// Results in a folder, with the call that wrote them.
    pub fn in_folder(folder: &Path, ended: Ended) -> Self {
        Self::new(folder.to_owned(), None, ended)
    }

    /// The folder of the results.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The file `relative` of the results.
    pub fn path(&self, relative: &str) -> PathBuf {
        self.folder.join(relative)
    }

    /// Bytes of the file `relative`.
    ///
    /// # Panics
    /// If it is not there.
    pub fn bytes(&self, relative: &str) -> Vec<u8> {
        fs::read(self.path(relative)).unwrap_or_else(|error| panic!("{relative}: {error}"))
    }

    /// Text of the file `relative`.
    ///
    /// # Panics
    /// If it is not there or not UTF-8.
    pub fn text(&self, relative: &str) -> String {
        String::from_utf8(self.bytes(relative)).unwrap_or_else(|error| panic!("{relative}: {error}"))
    }

    /// `summary.json`.
    ///
    /// # Panics
    /// If it is not there or no JSON.
    pub fn summary(&self) -> Value {
        serde_json::from_slice(&self.bytes("summary.json")).expect("summary.json is JSON")
    }

    /// The codes of the warnings in `summary.json`.
    pub fn warning_codes(&self) -> Vec<String> {
        let summary = self.summary();
        let warnings = summary["warnings"].as_array().cloned().unwrap_or_default();
        warnings.iter().filter_map(|warning| warning["code"].as_str().map(str::to_owned)).collect()
    }

    /// `trace.parquet` as the library for traces reads it.
    ///
    /// # Panics
    /// If it is not a trace.
    pub fn trace(&self) -> Trace {
        let path = self.path("trace.parquet");
        traces::io::parquet::read(&path).unwrap_or_else(|error| panic!("{error}"))
    }

    /// The rows of `frames.csv`.
    ///
    /// # Panics
    /// If it is not such a table.
    pub fn frames(&self) -> Vec<FrameRow> {
        let text = self.text("frames.csv");
        let mut table = csv::Reader::from_reader(text.as_bytes());
        let header = table.headers().expect("frames.csv has a header").clone();
        let column = |name: &str| {
            header.iter().position(|other| other == name).unwrap_or_else(|| panic!("no column {name}"))
        };
        let columns = ["start_s", "end_s", "energy_J"].map(column);
        let row = |record: Result<csv::StringRecord, csv::Error>| {
            let record = record.expect("a row of frames.csv");
            let [start_s, end_s, energy_j] = columns.map(|at| record[at].parse().expect("a number"));
            FrameRow { start_s, end_s, energy_j }
        };
        table.records().map(row).collect()
    }

    /// The PNG of frame `number`.
    ///
    /// # Panics
    /// If it is not there or no PNG.
    pub fn image(&self, number: u32) -> RgbImage {
        let name = format!("images/frame_{number:04}.png");
        let picture = image::load_from_memory_with_format(&self.bytes(&name), image::ImageFormat::Png);
        picture.unwrap_or_else(|error| panic!("{name}: {error}")).to_rgb8()
    }

    /// Every file of the results by its path, with its bytes.
    ///
    /// # Panics
    /// If one cannot be read.
    pub fn files(&self) -> BTreeMap<PathBuf, Vec<u8>> {
        let mut files = BTreeMap::new();
        collect(&self.folder, Path::new(""), &mut files);
        files
    }
}

/// `files` without provenance of the host: `host` in summary and report, and the hashes of these two files.
/// Everything else is equal on every machine.
///
/// # Panics
/// If the host is missing.
#[must_use]
pub fn without_host(mut files: BTreeMap<PathBuf, Vec<u8>>) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut edit = |name: &str, change: fn(&mut Value)| {
        let file = files.get_mut(Path::new(name)).unwrap_or_else(|| panic!("no {name}"));
        let mut json: Value = serde_json::from_slice(file).unwrap_or_else(|error| panic!("{name}: {error}"));
        change(&mut json);
        *file = json.to_string().into_bytes();
    };
    edit("summary.json", |summary| {
        let host = summary.as_object_mut().and_then(|summary| summary.remove("host"));
        assert!(host.is_some_and(|host| host["command"].is_array()), "no host in the summary");
    });
    edit("manifest.json", |manifest| {
        for name in ["summary.json", "report.html"] {
            assert!(manifest["files"][name].take().is_object(), "{name} is not in the manifest");
        }
    });
    let report = files.get_mut(Path::new("report.html")).expect("a report");
    let text = String::from_utf8_lossy(report).into_owned();
    let (before, host) = text.split_once("<section id=\"host\">").expect("a section of the host");
    let (_, after) = host.split_once("</section>").expect("the end of that section");
    *report = [before, after].concat().into_bytes();
    files
}

fn collect(root: &Path, below: &Path, files: &mut BTreeMap<PathBuf, Vec<u8>>) {
    for entry in fs::read_dir(root.join(below)).expect("a folder of results") {
        let name = below.join(entry.expect("an entry of the folder").file_name());
        if root.join(&name).is_dir() {
            collect(root, &name, files);
        } else {
            files.insert(name.clone(), fs::read(root.join(&name)).expect("a file of the results"));
        }
    }
}

/// The number at `pointer` (such as `/checks/quantization_bound_j`) of a JSON value.
///
/// # Panics
/// If there is no number.
pub fn number(value: &Value, pointer: &str) -> f64 {
    value.pointer(pointer).and_then(Value::as_f64).unwrap_or_else(|| panic!("no number at {pointer}"))
}
