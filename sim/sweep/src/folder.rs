//! The folder of a sweep: `plan.jsonl` and a file for each finished point, each written whole or not at all.

use std::fs::{self, File};
use std::io::{self, BufRead, BufReader, Write};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use traces::io::atomic;

use crate::SweepError;
use crate::execute::PointResult;
use crate::plan::{Plan, Point, SCHEMA};
use crate::setting::Setting;

/// File of the plan: a header, then one line per point.
const PLAN: &str = "plan.jsonl";

/// First line of the plan.
#[derive(PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    schema: u32,
    sweep: String,
    /// Settings of all points.
    settings: Vec<Setting>,
    points: usize,
}

impl Header {
    fn of(plan: &Plan) -> Self {
        let Plan { name, settings, points } = plan;
        Self { schema: SCHEMA, sweep: name.clone(), settings: settings.clone(), points: points.len() }
    }
}

/// Folder of a sweep.
#[derive(Clone, Debug)]
pub struct Folder {
    root: PathBuf,
}

impl Folder {
    /// The folder at `root`, as it is.
    pub fn at(root: impl Into<PathBuf>) -> Self {
        Self { root: root.into() }
    }

    /// Its path.
    pub fn path(&self) -> &Path {
        &self.root
    }

    /// Checks that `plan` may use the folder.
    ///
    /// # Errors
    /// [`SweepError::OtherSweep`] if it holds another sweep.
    pub fn check(&self, plan: &Plan) -> Result<(), SweepError> {
        match self.header()? {
            Some(Header { sweep, .. }) if sweep != plan.name => Err(SweepError::OtherSweep {
                folder: self.root.clone(),
                holds: sweep,
                name: plan.name.clone(),
            }),
            _ => Ok(()),
        }
    }

    /// Creates the folder and writes `plan` into it, unless it is there. An earlier plan of the same sweep is replaced, results
    /// stay.
    ///
    /// # Errors
    /// As [`Self::check`], and if the folder cannot be written.
    pub fn write_plan(&self, plan: &Plan) -> Result<(), SweepError> {
        fs::create_dir_all(&self.root).map_err(SweepError::folder(&self.root))?;
        self.check(plan)?;
        let header = Header::of(plan);
        if self.holds(plan, &header)? {
            return Ok(atomic::try_place(&self.root.join(PLAN))?);
        }
        let write = |out: &mut io::BufWriter<File>| {
            serde_json::to_writer(&mut *out, &header)?;
            for point in &plan.points {
                writeln!(out)?;
                serde_json::to_writer(&mut *out, point)?;
            }
            writeln!(out)
        };
        Ok(atomic::write_file(&self.root.join(PLAN), write)?)
    }

    fn header(&self) -> Result<Option<Header>, SweepError> {
        let path = self.root.join(PLAN);
        let file = match File::open(&path) {
            Ok(file) => file,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(SweepError::folder(&path)(error)),
        };
        let line = BufReader::new(file).lines().next().transpose().map_err(SweepError::folder(&path))?;
        let header: Header =
            serde_json::from_str(&line.unwrap_or_default()).map_err(|error| damaged(&path, &error))?;
        if header.schema != SCHEMA {
            let message = format!(
                "its schema is {}, this version reads {SCHEMA}: use the version that wrote it",
                header.schema
            );
            return Err(SweepError::Plan { path, message });
        }
        Ok(Some(header))
    }

    /// Points of the plan, line by line.
    fn points(&self) -> Result<impl Iterator<Item = Result<Point, SweepError>>, SweepError> {
        let path = self.root.join(PLAN);
        let lines = BufReader::new(File::open(&path).map_err(SweepError::folder(&path))?).lines().skip(1);
        Ok(lines.map(move |line| {
            let line = line.map_err(SweepError::folder(&path))?;
            serde_json::from_str(&line).map_err(|error| damaged(&path, &error))
        }))
    }

    /// Whether the plan on disk is `plan`, without a second one in memory.
    fn holds(&self, plan: &Plan, header: &Header) -> Result<bool, SweepError> {
        if self.header()?.as_ref() != Some(header) {
            return Ok(false);
        }
        let mut known = self.points()?;
        let is_known = |point: &Point| known.next().is_some_and(|line| line.is_ok_and(|line| line == *point));
        Ok(plan.points.iter().all(is_known))
    }

    /// Reads the plan.
    ///
    /// # Errors
    /// If it does not exist, or it is damaged.
    pub fn plan(&self) -> Result<Plan, SweepError> {
        let path = self.root.join(PLAN);
        let Some(header) = self.header()? else {
            let message = "it does not exist: call `quintile sweep plan FILE.ron --out DIR` first".to_owned();
            return Err(SweepError::Plan { path, message });
        };
        let points = self.points()?.collect::<Result<Vec<Point>, _>>()?;
        if points.len() != header.points {
            let message =
                format!("it has {} of {} points: plan the sweep again", points.len(), header.points);
            return Err(SweepError::Plan { path, message });
        }
        Ok(Plan { name: header.sweep, settings: header.settings, points })
    }

    /// File of a point, in one of 256 folders: a folder of a million files is slow.
    fn file_of(&self, point: &Point) -> PathBuf {
        let start: String = point.id.chars().take(2).collect();
        self.root.join("points").join(start).join(format!("{}.json", point.id))
    }

    /// Result of a point; `None` if it is missing or not whole.
    ///
    /// # Errors
    /// If the file exists and cannot be read.
    pub(crate) fn result(&self, point: &Point) -> Result<Option<PointResult>, SweepError> {
        let path = self.file_of(point);
        match fs::read(&path) {
            Ok(bytes) => {
                Ok(serde_json::from_slice(&bytes).ok().filter(|result: &PointResult| result.id == point.id))
            }
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
            Err(error) => Err(SweepError::folder(&path)(error)),
        }
    }

    /// Writes the result of a point.
    ///
    /// # Errors
    /// If it cannot be written.
    pub(crate) fn write_result(&self, point: &Point, result: &PointResult) -> Result<(), SweepError> {
        let path = self.file_of(point);
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder).map_err(SweepError::folder(folder))?;
        }
        Ok(atomic::write_file(&path, |out| serde_json::to_writer(out, result))?)
    }
}

fn damaged(path: &Path, error: &serde_json::Error) -> SweepError {
    let message = format!("it is not a plan, or damaged: {error}; plan the sweep again");
    SweepError::Plan { path: path.to_owned(), message }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plan(name: &str) -> Plan {
        let point = |id: &str| Point { id: id.to_owned(), settings: vec![Setting::new("samples", "2")] };
        Plan {
            name: name.to_owned(),
            settings: vec![Setting::new("scene", "tiny")],
            points: vec![point("aa01"), point("ab02")],
        }
    }

    #[test]
    fn a_plan_is_read_as_written_and_keeps_other_sweeps_out() {
        let root = tempfile::tempdir().unwrap();
        let folder = Folder::at(root.path().join("new"));
        assert!(folder.plan().unwrap_err().to_string().contains("it does not exist"));
        folder.write_plan(&plan("a")).unwrap();
        assert_eq!(folder.plan().unwrap(), plan("a"));
        let error = folder.write_plan(&plan("b")).unwrap_err();
        assert!(
            error.is_usage() && error.to_string().contains("holds the sweep `a`, and this is `b`"),
            "{error}"
        );
        assert_eq!(folder.plan().unwrap(), plan("a"));
    }

    #[test]
    fn damage_is_reported_or_counts_as_unfinished() {
        let root = tempfile::tempdir().unwrap();
        let (folder, plan) = (Folder::at(root.path()), plan("a"));
        folder.write_plan(&plan).unwrap();
        let failed = PointResult { id: "aa01".to_owned(), outcome: Err("why".to_owned()).into() };
        folder.write_result(&plan.points[0], &failed).unwrap();
        assert_eq!(folder.result(&plan.points[0]).unwrap(), Some(failed));
        assert_eq!(folder.result(&plan.points[1]).unwrap(), None);
        let path = folder.file_of(&plan.points[0]);
        let text = fs::read_to_string(&path).unwrap();
        fs::write(&path, &text[..text.len() / 2]).unwrap();
        assert_eq!(folder.result(&plan.points[0]).unwrap(), None);
        let path = root.path().join(PLAN);
        let text = fs::read_to_string(&path).unwrap();
        for length in [0, 10, text.find('\n').unwrap() + 1, text.len() - 5] {
            fs::write(&path, &text[..length]).unwrap();
            let error = folder.plan().unwrap_err();
            assert!(error.to_string().contains("plan the sweep again"), "{error}");
        }
    }

    #[test]
    fn a_folder_that_cannot_be_written_is_named() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let error = Folder::at(file.path().join("below")).write_plan(&plan("a")).unwrap_err();
        assert!(!error.is_usage() && error.to_string().contains("check that it is a folder"), "{error}");
    }
}
