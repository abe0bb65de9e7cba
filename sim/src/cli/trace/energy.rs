//! `quintile trace energy`.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use output::table::counted;
use output::terminal::Terminal;
use serde_json::json;
use traces::energy::{
    FramePart, Idle, IdleTooShort, Pooled, PowerIntegral, RunEnergy, RunEnergyError, RunEnergyOptions,
    SegmentEnergy, SegmentError, Spread, check_parts, idle_in_frames, negative_power, parts_j, pooled, whole,
};
use traces::io::{Repair, TraceReader};
use traces::trace::check_span;
use warnings::Warning;

use super::input::{Frames, warn_of};
use super::wrong;
use crate::cli::parse::{power, size_of_power, time};
use crate::cli::trace::input::{FindArgs, InputArgs, pass, segment};
use crate::cli::{Failure, print, print_json};

/// Arguments about frames; they do not apply to a segment.
const OF_FRAMES: [&str; 11] = [
    "mark",
    "mark_file",
    "auto",
    "end",
    "stream",
    "pixels",
    "pass",
    "discard",
    "drop_outliers",
    "run",
    "busy_above",
];

/// Arguments of `trace energy`.
#[derive(Clone, Debug, Args)]
#[command(
    after_help = "Examples:\n  quintile trace energy meter.csv --from 1.5 --to 2.5\n  quintile trace energy meter.csv --mark 2.513 --idle 0..0.4 --pass shadow=0 --pass light=4.2 --discard auto --drop-outliers"
)]
pub struct EnergyArgs {
    /// The trace.
    #[command(flatten)]
    pub input: InputArgs,
    /// The frames.
    #[command(flatten)]
    pub find: FindArgs,
    /// Begin of a segment, in seconds or with its unit; a segment needs no frames
    #[arg(long, value_name = "TIME", allow_hyphen_values = true, value_parser = time, conflicts_with_all = OF_FRAMES)]
    pub from: Option<f64>,
    /// End of the segment, in seconds or with its unit
    #[arg(long, value_name = "TIME", allow_hyphen_values = true, value_parser = time, conflicts_with_all = OF_FRAMES)]
    pub to: Option<f64>,
    /// A segment without rendering, in seconds or with units; its mean power is subtracted
    #[arg(long, value_name = "A..B", value_parser = segment, allow_hyphen_values = true, conflicts_with_all = ["idle_w", "idle_trace"])]
    pub idle: Option<(f64, f64)>,
    /// Idle power to subtract, in W
    #[arg(long, value_name = "W", conflicts_with = "idle_trace", allow_hyphen_values = true, value_parser = size_of_power)]
    pub idle_w: Option<f64>,
    /// A recording without rendering, to subtract
    #[arg(long, value_name = "TRACE")]
    pub idle_trace: Option<PathBuf>,
    /// How the recording is subtracted
    #[arg(long, value_enum, default_value_t, requires = "idle_trace")]
    pub idle_by: IdleBy,
    /// A pass within every frame: its name, and when it begins after the start of the frame, in milliseconds
    /// or with its unit
    #[arg(long, value_name = "NAME=MS", value_parser = pass)]
    pub pass: Vec<(String, f64)>,
    /// Leave out the first frames: a number, or `auto` to find the warm-up
    #[arg(long, value_name = "N", default_value = "0", value_parser = discard)]
    pub discard: Discard,
    /// Leave out frames that differ from those around them
    #[arg(long)]
    pub drop_outliers: bool,
    /// Another run of the same thing, with the same marks; may be given several times
    #[arg(long, value_name = "TRACE")]
    pub run: Vec<PathBuf>,
    /// Threshold of the begin-to-finish method: power above which a frame is still at work, in W; a tenth
    /// above idle without it
    #[arg(long, value_name = "W", allow_hyphen_values = true, value_parser = power)]
    pub busy_above: Option<f64>,
    /// Print everything as JSON and nothing else
    #[arg(long)]
    pub json: bool,
}

/// How an idle recording is subtracted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum IdleBy {
    /// Its mean power, at all times
    #[default]
    Mean,
    /// Instant by instant
    Instant,
}

/// Frames to leave out at the beginning.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Discard {
    /// This number of frames.
    Count(usize),
    /// Frames before the mean is stable.
    Auto,
}

fn discard(text: &str) -> Result<Discard, String> {
    match text {
        "auto" => Ok(Discard::Auto),
        _ => text
            .parse()
            .map(Discard::Count)
            .map_err(|_| format!("`{text}` is neither a number of frames nor auto")),
    }
}

pub(super) fn run(args: &EnergyArgs, terminal: &Terminal) -> Result<(), Failure> {
    let passes = args.passes();
    check_parts(&passes).map_err(|error| wrong(format!("--{error}")))?;
    let recording = args.idle_trace.as_ref().map(|path| args.input.load_other(path, terminal)).transpose()?;
    let recording = recording.as_ref().map(|(recording, _)| PowerIntegral::new(recording));
    if args.from.is_some() || args.to.is_some() {
        let (trace, repairs) = args.input.source(terminal)?;
        return segment_energy(args, &*trace, &repairs, recording.as_ref(), terminal);
    }
    let (first, repairs, of_file) =
        one_run(args, &args.input.trace, (&passes, recording.as_ref()), terminal)?;
    let pixels = args.find.pixels.or(of_file);
    let mut runs = vec![first];
    for path in &args.run {
        runs.push(one_run(args, path, (&passes, recording.as_ref()), terminal)?.0);
    }
    let energies: Vec<Vec<f64>> = runs.iter().map(|run| run.run.energies_j()).collect();
    let pool = pooled(&energies).ok_or_else(|| wrong("no frame is left; discard fewer"))?;
    if args.json {
        let warnings: Vec<&Warning> = runs.iter().flat_map(|run| &run.warnings).collect();
        let runs: Vec<_> = runs.iter().map(Run::json).collect();
        let report = json!({ "runs": runs, "pooled": pool, "pixels": pixels, "repairs": repairs, "warnings": warnings });
        return print_json(&report, true);
    }
    let text: String = runs.iter().map(Run::text).collect();
    print(&(text + &pooled_text(&pool, pixels)))
}

fn pooled_text(pool: &Pooled, pixels: Option<u64>) -> String {
    let per_pixel = pixels.filter(|&pixels| pixels > 0).map(|pixels| pool.mean / pixels as f64 * 1e9);
    format!(
        "{}, {}: {:.4} mJ/frame{}, pooled standard deviation {:.4} mJ",
        counted(pool.runs, "run"),
        counted(pool.values, "frame"),
        pool.mean * 1e3,
        per_pixel.map_or(String::new(), |nj| format!(", {nj:.3} nJ/pixel")),
        pool.deviation * 1e3
    )
}

/// Energy between two times.
fn segment_energy(
    args: &EnergyArgs,
    trace: &dyn TraceReader,
    repairs: &[Repair],
    recording: Option<&PowerIntegral<'_>>,
    terminal: &Terminal,
) -> Result<(), Failure> {
    let header = trace.header();
    let idle = idle(args, trace, recording)?;
    let (from_s, to_s) = (args.from.unwrap_or(header.start_s), args.to.unwrap_or(header.end_s()));
    let segment = SegmentEnergy::of(trace, from_s, to_s, idle.as_ref());
    let SegmentEnergy { energy_j, power_w, idle_j } = segment.map_err(segment_failure)?;
    let warnings: Vec<Warning> = negative_power(energy_j + idle_j).into_iter().collect();
    warn_of(&warnings, terminal);
    if args.json {
        return print_json(
            &json!({ "from_s": from_s, "to_s": to_s, "energy_J": energy_j, "power_W": power_w, "idle_J": idle_j,
                "repairs": repairs, "warnings": warnings }),
            true,
        );
    }
    print(&format!("{from_s} s to {to_s} s: {energy_j:.6} J, {power_w:.4} W (idle taken off: {idle_j:.6} J)"))
}

fn segment_failure(error: SegmentError) -> Failure {
    match error {
        SegmentError::Span(error) => wrong(format!("--from and --to: {error}")),
        SegmentError::Read(error) => error.into(),
    }
}

fn idle<'a>(
    args: &EnergyArgs,
    trace: &dyn TraceReader,
    recording: Option<&PowerIntegral<'a>>,
) -> Result<Option<Idle<'a>>, Failure> {
    if let Some((from_s, to_s)) = args.idle {
        let header = trace.header();
        let span = check_span([header.start_s, header.end_s()], [from_s, to_s]);
        span.map_err(|error| wrong(format!("--idle: {error}")))?;
        return Ok(Some(Idle::between(trace, from_s, to_s)?));
    }
    if let Some(recording) = recording {
        return Ok(Some(match args.idle_by {
            IdleBy::Mean => Idle::mean_of(recording),
            IdleBy::Instant => Idle::instant(recording.clone(), &trace.header()).map_err(too_short)?,
        }));
    }
    Ok(args.idle_w.map(Idle::Mean))
}

fn too_short(error: IdleTooShort) -> Failure {
    wrong(format!("--idle-by instant: {error}; record it as long, or take --idle-by mean"))
}

/// A run and its passes.
struct Run {
    run: RunEnergy,
    passes: Vec<(String, Spread)>,
    /// Whether the last frame is left out, as it is cut.
    without_last: bool,
    warnings: Vec<Warning>,
}

/// One recording: its frames, its repairs, and the pixels of its frames if it states them.
fn one_run(
    args: &EnergyArgs,
    path: &Path,
    (passes, recording): (&[FramePart], Option<&PowerIntegral<'_>>),
    terminal: &Terminal,
) -> Result<(Run, Vec<Repair>, Option<u64>), Failure> {
    let (Frames { set, repairs }, trace) = args.find.frames_and_samples(&args.input, path, terminal)?;
    let (trace, frames) = (&*trace, whole(&set.energies, set.ends_with_trace).to_vec());
    let without_last = frames.len() < set.energies.len();
    let idle = idle(args, trace, recording)?;
    let mut warnings = set.found.warnings;
    warnings.extend(args.idle.and_then(|segment| idle_in_frames(segment, &frames)));
    warnings.extend(idle.as_ref().and_then(|idle| idle.above_frames(trace.header().start_s, &frames)));
    let options = RunEnergyOptions {
        discard: match args.discard {
            Discard::Count(count) => Some(count),
            Discard::Auto => None,
        },
        drop_outliers: args.drop_outliers,
        busy_above_w: args.busy_above,
    };
    let run = RunEnergy::of(trace, frames, idle.as_ref(), &options).map_err(run_failure)?;
    for pass in passes {
        warnings.extend(pass.check(&run.frames).map_err(|error| wrong(format!("--{error}")))?);
    }
    warn_of(&warnings, terminal);
    let passes = parts_j(trace, &run.frames, passes, idle.as_ref())?;
    Ok((Run { run, passes, without_last, warnings }, repairs, set.metadata.pixels))
}

fn run_failure(error: RunEnergyError) -> Failure {
    match error {
        RunEnergyError::Read(error) => error.into(),
        RunEnergyError::NoFrames { frames, discarded } => wrong(format!(
            "of {} none is left after {discarded} are discarded; discard fewer",
            counted(frames, "frame")
        )),
    }
}

impl EnergyArgs {
    fn passes(&self) -> Vec<FramePart> {
        let pass = |(name, begin_s): &(String, f64)| FramePart { name: name.clone(), begin_s: *begin_s };
        self.pass.iter().map(pass).collect()
    }
}

impl Run {
    fn json(&self) -> serde_json::Value {
        let (run, energies) = (&self.run, self.run.energies_j());
        let passes: Vec<_> =
            self.passes.iter().map(|(name, j)| json!({ "pass": name, "energy_J": j })).collect();
        json!({
            "frames": run.frames.len(), "discarded": run.discarded, "warm_up_clearness": run.warm_up_clearness,
            "outliers": run.outliers, "energy_J": Spread::of(&energies), "begin_to_finish_J": run.begin_to_finish_j,
            "passes": passes, "energies_J": energies,
        })
    }

    fn text(&self) -> String {
        let run = &self.run;
        let spread = Spread::of(&run.energies_j()).unwrap_or_default();
        let mut text = format!(
            "{} ({} discarded, {}{}): {:.4} mJ/frame start to start (deviation {:.4}), {:.4} mJ begin to finish\n",
            counted(run.frames.len(), "frame"),
            run.discarded,
            counted(run.outliers, "outlier"),
            if self.without_last { ", without the last, which is cut" } else { "" },
            spread.mean * 1e3,
            spread.deviation * 1e3,
            run.begin_to_finish_j.mean * 1e3
        );
        for (name, spread) in &self.passes {
            text +=
                &format!("  {name}: {:.4} mJ (deviation {:.4})\n", spread.mean * 1e3, spread.deviation * 1e3);
        }
        text
    }
}
