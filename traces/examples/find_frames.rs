//! Finds the frames of a recording from one marked start and prints `frames.csv`; warnings go to standard error.
//!
//! `find_frames TRACE MARK_S END_S [PRE_S POST_S]`, where TRACE is `.csv` or `.parquet` and END_S may be `end`.

use std::error::Error;
use std::path::Path;
use std::process::ExitCode;
use traces::energy::{FrameTable, PowerIntegral};
use traces::frames::{Marks, Window, default_window, find};
use traces::{Trace, io};

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [path, mark_s, end_s, window @ ..] = arguments.as_slice() else {
        return Err("usage: find_frames TRACE MARK_S END_S [PRE_S POST_S]".into());
    };
    let trace = read(Path::new(path))?;
    let end_s = if end_s == "end" { trace.end_s() } else { end_s.parse()? };
    let window = match window {
        [pre_s, post_s] => Window { pre_s: pre_s.parse()?, post_s: post_s.parse()? },
        _ => default_window(1.0 / 30.0, trace.rate_hz()),
    };
    let found = find(&trace, &Marks::one(mark_s.parse()?, window, end_s))?;
    eprintln!("{:?}", found.threshold);
    for warning in &found.warnings {
        eprintln!("warning: {}: {}", warning.code, warning.message);
    }
    let frames = PowerIntegral::new(&trace).frames(&found);
    FrameTable::new(frames, trace.metadata.pixels).write_csv(std::io::stdout().lock())?;
    Ok(())
}

fn read(path: &Path) -> Result<Trace, io::ReadError> {
    if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("csv")) {
        io::csv::read(path)
    } else {
        io::parquet::read(path)
    }
}
