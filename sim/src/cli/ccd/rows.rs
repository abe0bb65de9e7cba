//! CSV with a row for every pair.

use std::io::Write;
use std::path::{Path, PathBuf};

use super::{CcdArgs, Found, Outcome};
use crate::cli::terminal::print;
use crate::cli::{Failure, outputs};

/// Destination of the rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Rows<'a> {
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
            return outputs::may_hold_results(("--csv", Some(path)), inputs).map(|()| Self::File(path));
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
    pub fn write(self, outcomes: &[Outcome]) -> Result<(), Failure> {
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

fn all(outcomes: &[Outcome], out: impl Write) -> csv::Result<()> {
    let mut csv = csv::WriterBuilder::new().has_headers(false).from_writer(out);
    csv.write_record(["case_id", "a", "b", "may_collide"])?;
    outcomes.iter().filter_map(Outcome::found).try_for_each(|case| lines(case, &mut csv))?;
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
