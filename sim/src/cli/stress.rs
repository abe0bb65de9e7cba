//! `quintile stress`.

use super::Failure;
use super::args::StressArgs;
use super::terminal::{print, print_json};
use output::Destination;
use output::progress::Progress;
use output::terminal::Terminal;

pub(super) fn run(args: &StressArgs, terminal: &Terminal) -> Result<(), Failure> {
    // Open the folder first, so that an unwritable one is reported before the work.
    let out = Destination { folder: args.out.clone(), force: args.force };
    let mut dir = out.open([experiments::stress::claim()])?;
    let pool = super::threads(args.threads)?;
    let progress = Progress::on(terminal, args.json);
    let report =
        pool.install(|| experiments::stress::stress(args.family.as_deref(), args.quick, &progress))?;
    report.write(&dir, &args.look.look())?;
    dir.publish()?;
    if args.json {
        print_json(&report.summary(), true)?;
    } else {
        print(&format!("{}results: {}", report.text(), args.out.display()))?;
    }
    report.fault().map_or(Ok(()), |fault| Err(Failure { message: fault.to_owned(), code: 1 }))
}
