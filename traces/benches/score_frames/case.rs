//! Reading a case.

use std::error::Error;
use std::path::{Path, PathBuf};
use traces::energy::TrueFrame;
use traces::frames::Window;
use traces::{Trace, io};

/// A trace, what the analyst is reported of it, and the truth.
pub struct Case {
    pub dir: String,
    pub name: String,
    pub trace: Trace,
    pub marks_s: Vec<f64>,
    pub window: Window,
    pub truth: Vec<TrueFrame>,
    /// Where the last true frame ends, s.
    pub end_s: f64,
}

/// The descriptions of all cases in a directory, sorted.
pub fn list(dir: &Path) -> Result<Vec<PathBuf>, Box<dyn Error>> {
    let mut paths = std::fs::read_dir(dir)
        .map_err(|error| format!("{}: {error}", dir.display()))?
        .map(|entry| entry.map(|entry| entry.path()))
        .collect::<Result<Vec<_>, _>>()?;
    paths.retain(|path| path.extension().is_some_and(|extension| extension == "json"));
    paths.sort();
    Ok(paths)
}

impl Case {
    pub fn read(description: &Path) -> Result<Self, Box<dyn Error>> {
        let reported: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(description)?)?;
        let number = |key: &str| {
            reported[key].as_f64().ok_or_else(|| format!("{}: no number {key}", description.display()))
        };
        let mut marks_s = vec![number("mark_s")?];
        marks_s.extend(reported["other_marks_s"].as_array().into_iter().flatten().filter_map(|m| m.as_f64()));
        let parquet = description.with_extension("parquet");
        let trace = if parquet.exists() {
            io::parquet::read(&parquet)?
        } else {
            io::csv::read(&description.with_extension("csv"))?
        };
        let (truth, end_s) = truth(&description.with_extension("truth.csv"))?;
        let text = |part: Option<&std::ffi::OsStr>| part.and_then(|s| s.to_str()).unwrap_or("?").to_owned();
        Ok(Self {
            dir: text(description.parent().and_then(Path::file_name)),
            name: text(description.file_stem()),
            trace,
            marks_s,
            window: Window { pre_s: number("window_pre_s")?, post_s: number("window_post_s")? },
            truth,
            end_s,
        })
    }
}

fn truth(path: &Path) -> Result<(Vec<TrueFrame>, f64), Box<dyn Error>> {
    let mut reader = csv::Reader::from_path(path)?;
    let headers = reader.headers()?.clone();
    let column = |name: &str| {
        headers.iter().position(|h| h == name).ok_or_else(|| format!("{}: no column {name}", path.display()))
    };
    let (start, end, energy) = (column("start_s")?, column("end_s")?, column("energy_J")?);
    let mut frames = Vec::new();
    let mut end_s = 0.0;
    for record in reader.records() {
        let record = record?;
        frames.push(TrueFrame { start_s: record[start].parse()?, energy_j: record[energy].parse()? });
        end_s = record[end].parse()?;
    }
    Ok((frames, end_s))
}
