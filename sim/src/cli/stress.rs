//! `quintile stress`.

use super::Failure;
use super::args::StressArgs;
use super::terminal::{print, print_json};
use crate::output::OutDir;
use crate::output::progress::Progress;
use crate::run::RunError;

pub(super) fn run(args: &StressArgs) -> Result<(), Failure> {
    // The folder first: that it cannot be made is better known before the work than after it.
    let dir = OutDir::create(&args.out).map_err(RunError::from)?;
    let pool = super::threads(args.threads)?;
    let progress = Progress::new(args.json);
    let report = pool.install(|| crate::stress::stress(args.family.as_deref(), args.quick, &progress))?;
    if args.json {
        print_json(&report.summary(), true)?;
    } else {
        print(&report.text())?;
    }
    let fault = report.fault();
    report.write(dir).map_err(RunError::from)?;
    if !args.json {
        print(&format!("results: {}", args.out.display()))?;
    }
    fault.map_or(Ok(()), |fault| Err(Failure { message: fault.to_owned(), code: 1 }))
}
