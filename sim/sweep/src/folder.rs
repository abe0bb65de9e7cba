//! The folder of a sweep: `plan.jsonl` and a file for each finished point, each written whole or not at all.

use std::collections::HashSet;
use std::fs::{self, File};
use std::io::{self, BufRead, BufReader, Write};
use std::path::{Path, PathBuf};

use output::Destination;
use output::dir::{Claim, OutDir, sha256_of_text};
use serde::de::IgnoredAny;
use serde::{Deserialize, Serialize};
use timing::Level;
use traces::io::atomic;

use crate::SweepError;
use crate::execute::PointResult;
use crate::plan::{Point, SCHEMA, SweepPlan, version};
use crate::setting::{Setting, Texts};

/// File of the plan: a header, then one line per point.
const PLAN: &str = "plan.jsonl";

/// First line of the plan.
#[derive(PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    schema: u32,
    sweep: String,
    /// Version of the program that planned it.
    #[serde(default)]
    program: String,
    /// Settings of all points.
    settings: Vec<Setting>,
    points: usize,
    /// Timing levels that screen.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    screen: Vec<Level>,
    /// Constraints and forbidden entries that leave out no point.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    idle: Vec<String>,
}

impl Header {
    fn of(plan: &SweepPlan) -> Self {
        let SweepPlan { name: sweep, settings, points, screen, program, idle } = plan.clone();
        Self { schema: SCHEMA, sweep, program, settings, points: points.len(), screen, idle }
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

    /// Path of the folder.
    pub fn path(&self) -> &Path {
        &self.root
    }

    /// Checks that `plan` may use the folder.
    ///
    /// # Errors
    /// [`SweepError::OtherSweep`] if it holds another sweep.
    pub fn check(&self, plan: &SweepPlan) -> Result<(), SweepError> {
        match self.header()? {
            Some(Header { sweep, .. }) if sweep != plan.name => Err(SweepError::OtherSweep {
                folder: self.root.clone(),
                holds: sweep,
                name: plan.name.clone(),
            }),
            _ => Ok(()),
        }
    }

    /// Creates the folder and writes `plan` into it, unless it is there. An earlier plan of the same sweep is
    /// replaced, results stay.
    ///
    /// # Errors
    /// As [`Self::check`], and if the folder cannot be written.
    pub fn write_plan(&self, plan: &SweepPlan) -> Result<(), SweepError> {
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
        atomic::write_file(&self.root.join(PLAN), write)?;
        // Another sweep may have come between.
        self.check(plan)
    }

    /// Opens it for the results `files` of the command `by`: all or none are replaced, and no file of the user.
    ///
    /// # Errors
    /// If a file of the user has such a name, another process writes results, or the folder cannot be written.
    pub(crate) fn open<'a>(
        &self,
        by: &str,
        files: impl IntoIterator<Item = &'a str>,
    ) -> Result<OutDir, SweepError> {
        Ok(Destination::new(&self.root).open([Claim::new(by).files(files)])?)
    }

    /// Whether it has a plan.
    pub(crate) fn holds_plan(&self) -> bool {
        self.root.join(PLAN).exists()
    }

    fn header(&self) -> Result<Option<Header>, SweepError> {
        let path = self.root.join(PLAN);
        let file = match File::open(&path) {
            Ok(file) => file,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(SweepError::folder(&path)(error)),
        };
        let mut line = Vec::new();
        match BufReader::new(file).read_until(b'\n', &mut line) {
            Ok(_) => {}
            Err(error) if error.kind() == io::ErrorKind::IsADirectory => {}
            Err(error) => return Err(SweepError::folder(&path)(error)),
        }
        match serde_json::from_slice::<Header>(&line) {
            Ok(header) if header.schema == SCHEMA => Ok(Some(header)),
            _ => Err(SweepError::Plan { path, message: not_a_plan(&line) }),
        }
    }

    /// Points of the plan, line by line. They share the texts of their settings.
    fn points(&self) -> Result<impl Iterator<Item = Result<Point, SweepError>>, SweepError> {
        let path = self.root.join(PLAN);
        let lines = BufReader::new(File::open(&path).map_err(SweepError::folder(&path))?).lines().skip(1);
        let mut texts = Texts::default();
        Ok(lines.map(move |line| {
            let line = line.map_err(SweepError::folder(&path))?;
            let Point { id, settings }: Point =
                serde_json::from_str(&line).map_err(|error| damaged(&path, &error))?;
            Ok(Point { id, settings: settings.iter().map(|setting| texts.shared(setting)).collect() })
        }))
    }

    /// Whether the plan on disk is `plan`, without a second one in memory.
    fn holds(&self, plan: &SweepPlan, header: &Header) -> Result<bool, SweepError> {
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
    pub fn plan(&self) -> Result<SweepPlan, SweepError> {
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
        let Header { sweep: name, settings, screen, program, idle, .. } = header;
        Ok(SweepPlan { name, settings, points, screen, program, idle })
    }

    /// Whether the plan is of another build than `program`, in words; `None` if it is not, or there is no plan.
    ///
    /// # Errors
    /// If the plan cannot be read.
    pub fn other_build(&self, program: Option<&str>) -> Result<Option<String>, SweepError> {
        let Some(Header { program: planned, .. }) =
            self.header()?.filter(|header| header.program != version(program))
        else {
            return Ok(None);
        };
        // A hash is long.
        let planned: Vec<String> = planned.split(' ').map(|word| word.chars().take(12).collect()).collect();
        Ok(Some(format!(
            "{}: planned and run by another build of quintile ({}): `quintile sweep run FILE.ron --out DIR` makes the numbers of this one",
            self.root.display(),
            if planned.concat().is_empty() { "which is not known".to_owned() } else { planned.join(" ") }
        )))
    }

    /// Results of points that are not in `plan`: of other builds of the program, settings or inputs.
    ///
    /// # Errors
    /// If a folder cannot be read.
    pub fn others(&self, plan: &SweepPlan) -> Result<Vec<PathBuf>, SweepError> {
        let known: HashSet<&str> = plan.points.iter().map(|point| point.id.as_str()).collect();
        let is_other = |path: &PathBuf| {
            let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
            let id = name.strip_suffix(".json").filter(|id| !id.starts_with('.') && !known.contains(id));
            // Files of the user are not removed.
            id.is_some_and(|id| fs::read(path).is_ok_and(|bytes| is_point(&bytes, id)))
        };
        Ok(self.files()?.into_iter().filter(is_other).collect())
    }

    /// Removes [`Self::others`]; returns their number.
    ///
    /// # Errors
    /// If there is no plan, or a file cannot be removed.
    pub fn remove_others(&self) -> Result<usize, SweepError> {
        let others = self.others(&self.plan()?)?;
        others.iter().try_for_each(|path| fs::remove_file(path).map_err(SweepError::folder(path)))?;
        Ok(others.len())
    }

    /// File of a point, in one of 256 folders: a folder of a million files is slow.
    fn file_of(&self, point: &Point) -> PathBuf {
        let start: String = point.id.chars().take(2).collect();
        self.root.join("points").join(start).join(format!("{}.json", point.id))
    }

    /// What is kept of a point.
    ///
    /// # Errors
    /// If its file exists and cannot be read.
    pub(crate) fn stored(&self, point: &Point) -> Result<Stored, SweepError> {
        let path = self.file_of(point);
        let fault = match fs::read(&path) {
            Ok(bytes) => match unsealed(&bytes).map(|text| serde_json::from_str::<PointResult>(&text)) {
                Some(Ok(result)) if result.id == point.id => return Ok(Stored::Whole(result)),
                Some(Ok(result)) => format!("it holds the point {}", result.id),
                Some(Err(_)) => return Ok(Stored::OtherBuild),
                None => fault(&bytes),
            },
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Stored::Missing),
            Err(error) => return Err(SweepError::folder(&path)(error)),
        };
        Ok(Stored::Damaged(format!("{}: {fault}; `quintile sweep run` runs its point again", path.display())))
    }

    /// Result of a point; `None` if it is missing or not whole.
    ///
    /// # Errors
    /// If the file exists and cannot be read.
    pub(crate) fn result(&self, point: &Point) -> Result<Option<PointResult>, SweepError> {
        Ok(match self.stored(point)? {
            Stored::Whole(result) => Some(result),
            Stored::Missing | Stored::OtherBuild | Stored::Damaged(_) => None,
        })
    }

    /// Writes the result of a point.
    ///
    /// # Errors
    /// If it cannot be written, unless another process has.
    pub(crate) fn write_result(&self, point: &Point, result: &PointResult) -> Result<(), SweepError> {
        let path = self.file_of(point);
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder).map_err(SweepError::folder(folder))?;
        }
        let write =
            |out: &mut io::BufWriter<File>| out.write_all(sealed(&serde_json::to_string(result)?).as_bytes());
        atomic::write_file(&path, write).or_else(|error| match self.result(point) {
            Ok(Some(_)) => Ok(()),
            _ => Err(error.into()),
        })
    }

    /// Removes what killed processes left of points that are finished. Files of other points may be about to
    /// be finished.
    ///
    /// # Errors
    /// If a folder cannot be read.
    pub(crate) fn clean(&self) -> Result<(), SweepError> {
        for path in self.files()? {
            let whole = path.file_name().and_then(|name| Some(finished_name(name.to_str()?)?.to_owned()));
            if whole.is_some_and(|whole| path.with_file_name(whole).exists()) {
                // Another process may have removed it.
                let _ = fs::remove_file(&path);
            }
        }
        Ok(())
    }

    /// All files of points, finished or not.
    fn files(&self) -> Result<Vec<PathBuf>, SweepError> {
        let folders = entries(&self.root.join("points"))?;
        let files = folders.iter().map(|folder| entries(folder)).collect::<Result<Vec<_>, _>>()?;
        Ok(files.into_iter().flatten().collect())
    }
}

/// What is kept of a point.
pub(crate) enum Stored {
    /// The result of the point.
    Whole(PointResult),
    /// A file that is not its result: what is wrong, and what to do.
    Damaged(String),
    /// A result that a build of the program wrote which keeps other numbers.
    OtherBuild,
    /// Nothing.
    Missing,
}

/// Start of the file of a point; the checksum of the rest follows.
const SEAL: &str = "{\"sha256\":\"";

/// A JSON object with its checksum as first field.
fn sealed(object: &str) -> String {
    format!("{SEAL}{}\",{}", sha256_of_text(object), object.trim_start_matches('{'))
}

/// The object that was [`sealed`]; `None` if a byte of it has changed.
fn unsealed(bytes: &[u8]) -> Option<String> {
    let (sha256, rest) = std::str::from_utf8(bytes).ok()?.strip_prefix(SEAL)?.split_once("\",")?;
    let object = format!("{{{rest}");
    (sha256_of_text(&object) == sha256).then_some(object)
}

/// What is wrong with the file of a point whose checksum is not its own.
fn fault(bytes: &[u8]) -> String {
    match serde_json::from_slice::<IgnoredAny>(bytes) {
        _ if bytes.is_empty() => "it is empty".to_owned(),
        Ok(_) => "it was changed after it was written".to_owned(),
        Err(error) => format!("it is cut off or damaged: {error}"),
    }
}

/// Whether `bytes` are a whole file of the point `id`, whatever else it holds.
fn is_point(bytes: &[u8], id: &str) -> bool {
    serde_json::from_slice::<serde_json::Value>(bytes).is_ok_and(|value| value["id"] == id)
}

/// Name of the file that the file called `name` was to become, such as `ID.json` of `.ID.json.XXXXXX.part`.
fn finished_name(name: &str) -> Option<&str> {
    let (whole, _random) = name.strip_prefix('.')?.strip_suffix(".part")?.rsplit_once('.')?;
    Some(whole)
}

/// Paths in a folder; none if it does not exist, or is a file.
fn entries(folder: &Path) -> Result<Vec<PathBuf>, SweepError> {
    let none = [io::ErrorKind::NotFound, io::ErrorKind::NotADirectory];
    match fs::read_dir(folder) {
        Ok(entries) => entries
            .map(|entry| entry.map(|entry| entry.path()))
            .collect::<Result<_, _>>()
            .map_err(SweepError::folder(folder)),
        Err(error) if none.contains(&error.kind()) => Ok(Vec::new()),
        Err(error) => Err(SweepError::folder(folder)(error)),
    }
}

/// What is wrong with a file whose first line is `line`, and what to do. It may be a file of the user.
fn not_a_plan(line: &[u8]) -> String {
    let header = serde_json::from_slice::<serde_json::Value>(line).unwrap_or_default();
    match header["schema"].as_u64().filter(|schema| header["sweep"].is_string() && *schema != u64::from(SCHEMA)) {
        Some(schema) => format!("its schema is {schema}, this version reads {SCHEMA}: use the version that wrote it"),
        None => "it is not a plan that this program wrote, and stays as it is: move or rename it, or give another --out".to_owned(),
    }
}

fn damaged(path: &Path, error: &serde_json::Error) -> SweepError {
    let message = format!("it is damaged: {error}; plan the sweep again");
    SweepError::Plan { path: path.to_owned(), message }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plan(name: &str) -> SweepPlan {
        let point = |id: &str| Point { id: id.to_owned(), settings: vec![Setting::new("samples", "2")] };
        SweepPlan {
            name: name.to_owned(),
            settings: vec![Setting::new("scene", "tiny")],
            points: vec![point("aa01"), point("ab02")],
            program: version(Some("r1")),
            idle: vec!["constraints[0]".to_owned()],
            ..SweepPlan::default()
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
        let of = |object: &str| sealed(&object.replace("aa01", "aa02"));
        let other = of(&unsealed(text.as_bytes()).unwrap());
        let edited = text.replace("why", "because");
        for (damaged, says) in [
            (&text[..text.len() / 2], "cut off"),
            ("", "it is empty"),
            (&*other, "the point aa02"),
            (&*edited, "it was changed after it was written"),
            (&*text.replace(",", ", "), "it was changed after it was written"),
        ] {
            fs::write(&path, damaged).unwrap();
            assert_eq!(folder.result(&plan.points[0]).unwrap(), None);
            let Ok(Stored::Damaged(message)) = folder.stored(&plan.points[0]) else { panic!() };
            assert!(message.contains("aa01.json: ") && message.contains(says), "{message}");
        }
        fs::write(&path, sealed(r#"{"id":"aa01","measured":{"cycles":1}}"#)).unwrap();
        assert!(matches!(folder.stored(&plan.points[0]).unwrap(), Stored::OtherBuild));
        let path = root.path().join(PLAN);
        let text = fs::read_to_string(&path).unwrap();
        for length in [text.find('\n').unwrap() + 1, text.len() - 5] {
            fs::write(&path, &text[..length]).unwrap();
            let error = folder.plan().unwrap_err();
            assert!(error.to_string().contains("plan the sweep again"), "{error}");
            folder.write_plan(&plan).unwrap();
            assert_eq!(fs::read_to_string(&path).unwrap(), text);
        }
    }

    #[test]
    fn a_plan_of_others_stays_as_it_is() {
        let root = tempfile::tempdir().unwrap();
        let (folder, path) = (Folder::at(root.path()), root.path().join(PLAN));
        let of_others = [&b""[..], b"{\"schema\":2,\"sw", b"{\"task\": \"buy milk\"}\n", b"\xff\0\n"];
        let newer = &b"{\"schema\":9,\"sweep\":\"a\",\"more\":1}\n"[..];
        for (text, says) in of_others
            .map(|text| (text, "not a plan that this program wrote"))
            .into_iter()
            .chain([(newer, "its schema is 9")])
        {
            fs::write(&path, text).unwrap();
            for error in [folder.plan().map(drop), folder.write_plan(&plan("a"))].map(Result::unwrap_err) {
                assert!(error.is_usage() && error.to_string().contains(says), "{error}");
                assert!(!error.to_string().contains("plan the sweep again"), "{error}");
            }
            assert_eq!(fs::read(&path).unwrap(), text);
        }
        fs::remove_file(&path).unwrap();
        fs::create_dir(&path).unwrap();
        let error = folder.plan().unwrap_err();
        assert!(error.is_usage() && error.to_string().contains("move or rename it"), "{error}");
    }

    #[test]
    fn leftovers_of_finished_points_are_removed() {
        let root = tempfile::tempdir().unwrap();
        let (folder, plan) = (Folder::at(root.path()), plan("a"));
        folder.clean().unwrap();
        folder.write_plan(&plan).unwrap();
        let failed = PointResult { id: "aa01".to_owned(), outcome: Err("why".to_owned()).into() };
        folder.write_result(&plan.points[0], &failed).unwrap();
        let left = ["aa/.aa01.json.7.part", "aa/.aa02.json.7.part", "aa/notes.part"]
            .map(|name| root.path().join("points").join(name));
        left.iter().for_each(|path| fs::write(path, "{").unwrap());
        folder.clean().unwrap();
        assert_eq!(left.map(|path| path.exists()), [false, true, true]);
        assert!(folder.result(&plan.points[0]).unwrap().is_some());
    }

    #[test]
    fn other_builds_are_named_and_their_results_removed_on_request_alone() {
        let root = tempfile::tempdir().unwrap();
        let (folder, mut plan) = (Folder::at(root.path()), plan("a"));
        assert_eq!(folder.other_build(Some("r1")).unwrap(), None);
        folder.write_plan(&plan).unwrap();
        assert_eq!(folder.other_build(Some("r1")).unwrap(), None);
        let message = folder.other_build(Some("r2")).unwrap().unwrap();
        assert!(message.contains("another build of quintile (") && message.contains(" r1)"), "{message}");
        let failed = |id: &str| PointResult { id: id.to_owned(), outcome: Err("why".to_owned()).into() };
        plan.points.iter().for_each(|point| folder.write_result(point, &failed(&point.id)).unwrap());
        plan.points.remove(0);
        folder.write_plan(&plan).unwrap();
        let own = root.path().join("points/aa/mine.json");
        fs::write(&own, "{\"id\": 1}").unwrap();
        assert_eq!(folder.others(&plan).unwrap(), [root.path().join("points/aa/aa01.json")]);
        assert_eq!((folder.remove_others().unwrap(), folder.remove_others().unwrap()), (1, 0));
        assert!(own.exists());
        assert!(folder.result(&plan.points[0]).unwrap().is_some());
    }

    #[test]
    fn a_folder_that_cannot_be_written_is_named() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let error = Folder::at(file.path().join("below")).write_plan(&plan("a")).unwrap_err();
        assert!(error.is_usage() && error.to_string().contains("check that it is a folder"), "{error}");
    }
}
