//! `quintile ccd`, with a CSV row for every pair.

use std::io::Write;
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use output::table::{Table, grouped};
use output::terminal::{Progress, Terminal};
use rayon::prelude::*;
use serde::Serialize;
use workloads::collision::{
    CaseFiles, CollisionMethod, Object, PairAnswer, PairSearch, PairVerdict, candidates, detect_each,
};

use super::{Failure, print, print_json};
use crate::cli::args::ThreadArgs;
use crate::cli::may_hold_results;

/// Arguments of `ccd`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  quintile ccd armadillo-rollers.mts.gz --json\n  \
    quintile ccd cases/*.mts --resolution 128 --csv pairs.csv\n  quintile ccd start.ply end.ply\n\n\
    Every vertex moves on a straight line from time 0 to time 1. A pair that is not reported does not collide; one that is may. \
    A file that is broken or has coordinates beyond 1e60 does not stop the others. It is reported, its case has no row in \
    the CSV and an `error` in the JSON, and the exit code is 1.")]
pub struct CcdArgs {
    /// .mts files (gzipped or not), a case each, or .ply, .obj or .off files two by two: a mesh at time 0 and
    /// at time 1
    #[arg(value_name = "FILE", required = true)]
    pub files: Vec<PathBuf>,
    /// Pixels across each of the three images
    #[arg(long, value_name = "N", default_value_t = 128, allow_negative_numbers = true, value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub resolution: u32,
    /// Bins of time in a pixel
    #[arg(long, value_name = "N", default_value_t = 16, allow_negative_numbers = true, value_parser = clap::value_parser!(u32).range(1..=256))]
    pub bins: u32,
    /// Comparison in each pixel
    #[arg(long, value_enum, default_value_t)]
    pub method: MethodArg,
    /// Render once at the given resolution, without refinement of the remaining pairs
    #[arg(long)]
    pub no_refinement: bool,
    /// File for every pair of every case: case_id,a,b,may_collide; `-` prints that and nothing else
    #[arg(long, value_name = "FILE")]
    pub csv: Option<PathBuf>,
    /// Worker threads.
    #[command(flatten)]
    pub threads: ThreadArgs,
    /// Print the result as one line of JSON
    #[arg(long)]
    pub json: bool,
}

/// Comparison in each pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum MethodArg {
    /// Each fragment of one object with the box of the other
    #[default]
    #[value(alias = "fragment_box")]
    FragmentBox,
    /// The boxes of time and depth of both
    #[value(alias = "box_box")]
    BoxBox,
    /// Depths alone, in six passes (Govindaraju et al. 2003)
    #[value(alias = "depth_only")]
    DepthOnly,
}

impl CcdArgs {
    fn search(&self) -> PairSearch {
        let method = match self.method {
            MethodArg::FragmentBox => CollisionMethod::FragmentBox,
            MethodArg::BoxBox => CollisionMethod::BoxBox,
            MethodArg::DepthOnly => CollisionMethod::DepthOnly,
        };
        PairSearch { resolution: self.resolution, bins: self.bins, method, zoom: !self.no_refinement }
    }
}

/// Product of pixels across and bins above which a pair without refinement takes minutes.
const MAX_FAST_PIXEL_BINS: u32 = 128 * 64;

/// Pair of objects that may collide.
#[derive(Serialize)]
struct Pair {
    a: usize,
    b: usize,
    /// First and last time of possible contact.
    time: [f64; 2],
    /// Bounds of the possible contact: smallest and largest x, y, z.
    space: [[f64; 2]; 3],
    /// Remaining pixels of the last image; `None` if the pair was kept before an image was complete.
    pixels: Option<u64>,
    /// Whether two triangles cross or share a corner.
    seen: bool,
}

/// Result of a case.
#[derive(Serialize)]
struct Found {
    case_id: String,
    objects: usize,
    triangles: usize,
    /// Pairs whose swept boxes touch.
    candidates: usize,
    may_collide: Vec<Pair>,
}

/// Case without a result.
#[derive(Serialize)]
struct Unknown {
    case_id: String,
    error: String,
}

/// Result of a case, or its error.
#[derive(Serialize)]
#[serde(untagged)]
enum CaseResult {
    Found(Found),
    Unknown(Unknown),
}

impl CaseResult {
    fn new(case: &CaseFiles, objects: Result<Vec<Object>, String>, answers: &[PairAnswer]) -> Self {
        let case_id = case.id.clone();
        match objects {
            Ok(objects) => Self::Found(Found::new(case_id, &objects, answers)),
            Err(error) => Self::Unknown(Unknown { case_id, error }),
        }
    }

    fn found(&self) -> Option<&Found> {
        match self {
            Self::Found(found) => Some(found),
            Self::Unknown(_) => None,
        }
    }
}

/// Objects of a case.
fn objects(files: &CaseFiles) -> Result<Vec<Object>, String> {
    let case = files.load().map_err(|error| error.to_string())?;
    let object = |(number, mesh)| {
        Object::new(mesh, case.uncertainty).ok_or_else(|| {
            format!(
                "{}: object {number}: a coordinate is beyond 1e60 or not a number; scale it",
                files.start().display()
            )
        })
    };
    case.objects.iter().enumerate().map(object).collect()
}

impl Found {
    fn new(case_id: String, objects: &[Object], answers: &[PairAnswer]) -> Self {
        Self {
            case_id,
            objects: objects.len(),
            triangles: objects.iter().map(Object::len).sum(),
            candidates: answers.len(),
            may_collide: answers.iter().filter_map(pair).collect(),
        }
    }
}

fn pair(answer: &PairAnswer) -> Option<Pair> {
    let PairVerdict::Maybe { bounds, tiles, seen } = answer.verdict else { return None };
    let pixels = (tiles > 0).then_some(tiles);
    Some(Pair { a: answer.a, b: answer.b, time: bounds.time, space: bounds.space, pixels, seen })
}

pub(super) fn run(args: &CcdArgs, terminal: &Terminal) -> Result<(), Failure> {
    let (search, rows) = (args.search(), Rows::of(args)?);
    let cases = CaseFiles::of(&args.files)?;
    let pool = args.threads.pool()?;
    let progress = Progress::on(terminal, args.json);
    if !search.zoom && search.resolution * search.bins > MAX_FAST_PIXEL_BINS {
        progress.note(
            "without refinement, this number of pixels and bins takes minutes per pair; leave --no-refinement out for seconds",
        );
    }
    let outcomes = pool.install(|| answered(&cases, &search, &progress));
    // Without any result nothing is written, and an older file stays.
    let known = outcomes.is_empty() || outcomes.iter().any(|outcome| outcome.found().is_some());
    if known {
        rows.write(&outcomes)?;
    }
    let unanswered = unanswered(&outcomes, terminal);
    if args.json {
        print_json(&outcomes, false)?;
    } else if known && rows != Rows::Printed {
        print(&text(&outcomes))?;
    }
    unanswered
}

/// Results of all cases, in order. The threads share the pairs of all cases.
fn answered(cases: &[CaseFiles], search: &PairSearch, progress: &Progress) -> Vec<CaseResult> {
    let all: Vec<_> = cases.par_iter().map(objects).collect();
    let known: Vec<&[Object]> = all.iter().map(|case| case.as_deref().unwrap_or_default()).collect();
    let pairs = known.iter().map(|objects| candidates(objects).len() as u64).sum();
    let bar = progress.bar("pairs", pairs);
    let answers = detect_each(&known, search, || bar.inc());
    let outcomes = cases.iter().zip(all).zip(answers);
    outcomes.map(|((case, objects), answers)| CaseResult::new(case, objects, &answers)).collect()
}

/// Fails if a case has no result; the message names each.
fn unanswered(outcomes: &[CaseResult], terminal: &Terminal) -> Result<(), Failure> {
    let errors = outcomes.iter().filter_map(|outcome| match outcome {
        CaseResult::Found(_) => None,
        CaseResult::Unknown(unknown) => Some(unknown.error.clone()),
    });
    let errors: Vec<String> = errors.collect();
    let message = match (&errors[..], outcomes.len()) {
        ([], _) => return Ok(()),
        ([error], 1) => error.clone(),
        (several, all) => {
            several.iter().for_each(|error| terminal.error(error));
            format!("{} of {all} cases have no answer: fix their files or leave them out", several.len())
        }
    };
    Err(Failure { message, code: 1 })
}

fn text(outcomes: &[CaseResult]) -> String {
    let mut table =
        Table::new(["case", "objects", "triangles", "boxes touch", "may collide", "contact found"]);
    for case in outcomes.iter().filter_map(CaseResult::found) {
        table.row([
            case.case_id.clone(),
            case.objects.to_string(),
            grouped(case.triangles as u64),
            case.candidates.to_string(),
            case.may_collide.len().to_string(),
            case.may_collide.iter().filter(|pair| pair.seen).count().to_string(),
        ]);
    }
    table.to_string()
}

/// Destination of the rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Rows<'a> {
    Unasked,
    /// Standard output.
    Printed,
    File(&'a Path),
}

/// Names of standard output.
const PRINTED: [&str; 4] = ["-", "/dev/stdout", "/dev/fd/1", "/proc/self/fd/1"];

impl<'a> Rows<'a> {
    /// Destination of `--csv`, checked before the work.
    pub fn of(args: &'a CcdArgs) -> Result<Self, Failure> {
        let Some(path) = args.csv.as_deref() else { return Ok(Self::Unasked) };
        if !PRINTED.iter().any(|printed| path == Path::new(printed)) {
            let inputs = args.files.iter().map(PathBuf::as_path);
            return may_hold_results("--csv", Some(path), inputs).map(|()| Self::File(path));
        }
        if args.json {
            let message = format!(
                "--csv {}: standard output takes the rows or --json, not both; name a file for --csv",
                path.display()
            );
            return Err(Failure { message, code: 2 });
        }
        Ok(Self::Printed)
    }

    /// Writes the rows of all cases with a result.
    pub fn write(self, outcomes: &[CaseResult]) -> Result<(), Failure> {
        let failed = |message: String| Failure { message, code: 1 };
        match self {
            Self::Unasked => Ok(()),
            Self::File(path) => traces::io::atomic::write_file(path, |out| all(outcomes, out))
                .map_err(|error| failed(error.to_string())),
            Self::Printed => {
                let mut text = Vec::new();
                all(outcomes, &mut text).map_err(|error| failed(format!("--csv: {error}")))?;
                print(&String::from_utf8_lossy(&text))
            }
        }
    }
}

fn all(outcomes: &[CaseResult], out: impl Write) -> csv::Result<()> {
    let mut csv = csv::WriterBuilder::new().has_headers(false).from_writer(out);
    csv.write_record(["case_id", "a", "b", "may_collide"])?;
    outcomes.iter().filter_map(CaseResult::found).try_for_each(|case| lines(case, &mut csv))?;
    Ok(csv.flush()?)
}

/// Writes a line for each pair of objects.
fn lines(case: &Found, csv: &mut csv::Writer<impl Write>) -> csv::Result<()> {
    let mut left = case.may_collide.iter().map(|pair| (pair.a, pair.b)).peekable();
    for (a, b) in (0..case.objects).flat_map(|a| (a + 1..case.objects).map(move |b| (a, b))) {
        let may = left.next_if_eq(&(a, b)).is_some();
        csv.serialize((&case.case_id, a, b, u8::from(may)))?;
    }
    Ok(())
}
