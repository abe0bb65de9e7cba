//! Scores the frame finder on directories of cases with known frames: `cargo bench -p traces --bench
//! score_frames -- [--method M] [--cases A,B] [--several] [--json FILE] DIR...`, with absolute paths, as it
//! runs in the folder of the package.
//!
//! A case is `NAME.parquet` (or `.csv`), `NAME.json` (`mark_s`, `other_marks_s`, `window_pre_s`,
//! `window_post_s`) and `NAME.truth.csv` (`start_s`, `energy_J`), as `traces/tests/peers/cases.py` makes them
//! with an independent generator, which is not part of the repository. One line a case: F1 within 0.5 ms
//! (median over the marks, worst mark), the mean energy error of frames whose two ends were found beside that
//! of the true starts (the noise floor), and how many of the wrong frames are flagged.

#[path = "score_frames/case.rs"]
mod case;
#[path = "score_frames/outcome.rs"]
mod outcome;

use case::Case;
use outcome::{Outcome, floor};
use std::error::Error;
use std::path::{Path, PathBuf};
use traces::frames::FinderMethod;

/// The request.
struct Options {
    method: FinderMethod,
    several: bool,
    cases: Vec<String>,
    json: Option<PathBuf>,
    dirs: Vec<PathBuf>,
}

fn options() -> Result<Options, Box<dyn Error>> {
    let mut options = Options {
        method: FinderMethod::Auto,
        several: false,
        cases: Vec::new(),
        json: None,
        dirs: Vec::new(),
    };
    let mut arguments = std::env::args().skip(1).filter(|argument| argument != "--bench");
    while let Some(argument) = arguments.next() {
        let mut value = || arguments.next().ok_or_else(|| format!("{argument} needs a value"));
        match argument.as_str() {
            "--method" => options.method = value()?.parse()?,
            "--cases" => options.cases = value()?.split(',').map(str::to_owned).collect(),
            "--several" => options.several = true,
            "--json" => options.json = Some(value()?.into()),
            dir => options.dirs.push(dir.into()),
        }
    }
    Ok(options)
}

fn main() -> Result<(), Box<dyn Error>> {
    let options = options()?;
    if options.dirs.is_empty() {
        println!(
            "nothing to score: score_frames [--method M] [--cases A,B] [--several] [--json FILE] DIR..."
        );
        return Ok(());
    }
    println!(
        "{:<24} {:>6} {:>6} {:>6} {:>9} {:>9} {:>7} {:>7} {:>9}  chosen",
        "case", "F1", "worst", "conf", "clean %", "floor %", "ratio", "median", "flagged"
    );
    let mut rows = Vec::new();
    for dir in &options.dirs {
        let mut medians = Vec::new();
        for path in case::list(dir)? {
            let name = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default().to_owned();
            if !options.cases.is_empty() && !options.cases.contains(&name) {
                continue;
            }
            let row = score_case(&path, &options)?;
            medians.push(row["f1"].as_f64().unwrap_or_default());
            rows.push(row);
        }
        let mean = medians.iter().sum::<f64>() / medians.len() as f64;
        println!("{:<24} mean F1 {mean:.4}", dir.display());
    }
    if let Some(path) = &options.json {
        std::fs::write(path, serde_json::to_string_pretty(&rows)?)?;
    }
    Ok(())
}

/// One case: all marks in turn, or at once.
fn score_case(path: &Path, options: &Options) -> Result<serde_json::Value, Box<dyn Error>> {
    let case = Case::read(path)?;
    let marks: Vec<Vec<f64>> = if options.several {
        vec![case.marks_s.clone()]
    } else {
        case.marks_s.iter().map(|&mark_s| vec![mark_s]).collect()
    };
    let clock = std::time::Instant::now();
    let mut outcomes = marks
        .into_iter()
        .map(|marks_s| Outcome::new(&case, marks_s, options.method))
        .collect::<Result<Vec<_>, _>>()?;
    let seconds = clock.elapsed().as_secs_f64() / outcomes.len() as f64;
    outcomes.sort_by(|a, b| a.f1.total_cmp(&b.f1));
    let floor = floor(&case);
    let (median, worst) = (&outcomes[outcomes.len() / 2], &outcomes[0]);
    let name = format!("{}/{}", case.dir, case.name);
    println!(
        "{name:<24} {:6.3} {:6.3} {:6.2} {:9.4} {:9.4} {:7.2} {:7.2} {:4}/{:<4}  {} {seconds:.2} s",
        median.f1,
        worst.f1,
        median.confidence,
        100.0 * median.energy.mean,
        100.0 * floor.mean,
        median.energy.mean / floor.mean,
        median.energy.median / floor.median,
        worst.wrong_flagged,
        worst.wrong,
        median.chosen,
    );
    Ok(serde_json::json!({
        "case": case.name, "dir": case.dir, "f1": median.f1, "f1_min": worst.f1,
        "clean": median.energy.mean, "floor": floor.mean,
        "clean_median": median.energy.median, "floor_median": floor.median,
        "wrong": outcomes.iter().map(|o| o.wrong).sum::<usize>(),
        "wrong_flagged": outcomes.iter().map(|o| o.wrong_flagged).sum::<usize>(),
        "right_flagged": outcomes.iter().map(|o| o.right_flagged).sum::<usize>(),
        "frames": outcomes.iter().map(|o| o.frames).sum::<usize>(),
        "all_f1": outcomes.iter().map(|o| o.f1).collect::<Vec<_>>(),
        "seconds": seconds,
    }))
}
