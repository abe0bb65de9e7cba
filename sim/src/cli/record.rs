//! `quintile record` and `quintile time`.

use std::path::{Path, PathBuf};

use clap::Args;
use output::table::{Table, counted, si};
use output::terminal::{Progress, Terminal};
use power_model::Bound;
use rayon::prelude::*;
use run::{Change, MACHINES_IN_TURN, PacingChoice, Plan, RecordedRun, RunError, RunOptions, TimedFrames};
use serde::Serialize;
use sweep::{Measured, Setting, measured};
use timing::Level;
use workloads::job::OptionSource;

use super::run::{bound, one_gpu, pacing};
use super::{Failure, lists, may_hold_trace, print, print_json};
use crate::cli::args::{SceneArgs, ThreadArgs};
use crate::cli::parse::setting;

/// Arguments of `record`.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  quintile record tiny --out tiny.rec\n  quintile time tiny.rec --set gpu.core_hz=400e6\n\n\
    What a pipeline does depends on neither clocks nor rates nor energies. So its frames are drawn once here, and timed by `quintile \
    time` as often as there are machines with this pipeline. Images and traces are those of `quintile run`."
)]
pub struct RecordArgs {
    /// A built-in scene or a workload, or a .ron, .gltf, .glb, .obj, .ply, .off or .stl file
    #[arg(default_value = "default", value_name = "SCENE|WORKLOAD|FILE")]
    pub scene: PathBuf,
    /// Options of a workload in a .ron file
    #[arg(long, value_name = "FILE.ron")]
    pub options: Option<PathBuf>,
    /// An option of a workload, or a value in the file of GPU or scene, such as gpu.pipeline.tile_px=8; may
    /// be given several times
    #[arg(long, value_name = "NAME=VALUE", value_parser = setting)]
    pub set: Vec<(String, String)>,
    /// The file for the frames
    #[arg(long, value_name = "FILE", default_value = "frames.rec")]
    pub out: PathBuf,
    /// Changes to the scene
    #[command(flatten)]
    pub view: SceneArgs,
    /// A built-in GPU or a .ron file
    #[arg(long, value_name = "NAME|FILE", default_value = "reference")]
    pub gpu: PathBuf,
    /// Seed of samples
    #[arg(long, value_name = "N", default_value_t = 1, allow_negative_numbers = true, value_parser = crate::cli::parse::seed)]
    pub seed: u64,
    /// Worker threads.
    #[command(flatten)]
    pub threads: ThreadArgs,
    /// Print as JSON
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `time`.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  quintile record --frames 0..4 --out default.rec\n  quintile time default.rec --gpu reference slow.ron fast.ron\n  \
    quintile time default.rec --timing stepped --set gpu.units.dram.channels=4 --json\n\n\
    The numbers are those of `quintile run` on the same GPU. A GPU with another pipeline is refused."
)]
pub struct TimeArgs {
    /// A file from `quintile record`
    #[arg(value_name = "FILE")]
    pub recording: PathBuf,
    /// Built-in GPUs or .ron files, with the pipeline that drew the frames
    #[arg(long, value_name = "NAME|FILE", num_args = 1.., default_value = "reference")]
    pub gpu: Vec<PathBuf>,
    /// A value in the file of GPU, platform or energy table, such as gpu.core_hz=400e6; may be given several times
    #[arg(long, value_name = "PATH=VALUE", value_parser = setting)]
    pub set: Vec<(String, String)>,
    /// A built-in platform or a .ron file [default: the GPU's own]
    #[arg(long, value_name = "NAME|FILE")]
    pub platform: Option<PathBuf>,
    /// A built-in energy table or a .ron file [default: the GPU's own]
    #[arg(long, value_name = "NAME|FILE")]
    pub energy: Option<PathBuf>,
    /// Which values of the energy table to use
    #[arg(long, value_name = "BOUND", default_value = "nominal", value_parser = bound())]
    pub bound: Bound,
    /// Timing level: stepped, packet or bound
    #[arg(long, value_name = "LEVEL", default_value = "packet", value_parser = level)]
    pub timing: Level,
    /// When the next frame starts
    #[arg(long, value_name = "PACING", default_value = "vsync", value_parser = pacing())]
    pub pacing: PacingChoice,
    /// Worker threads.
    #[command(flatten)]
    pub threads: ThreadArgs,
    /// Print as JSON: a list, one entry for each GPU
    #[arg(long)]
    pub json: bool,
}

/// Parser of `--timing`.
fn level(text: &str) -> Result<Level, String> {
    let known = Level::ALL.map(Level::name);
    let found = Level::ALL.into_iter().find(|level| level.name() == text);
    found.ok_or_else(|| format!("`{text}` is no timing level; {}", activity::spec::suggestion(text, &known)))
}

/// Checks that `out` can be written, and that a file there is an older recording.
fn may_hold_recording(out: &Path, scene: &Path) -> Result<(), Failure> {
    may_hold_trace("--out", Some(out), [scene])?;
    if !out.exists() || RecordedRun::is_at(out) {
        return Ok(());
    }
    let message = format!(
        "--out: {} is not from `quintile record`, and stays as it is: move or rename it, or name another file",
        out.display()
    );
    Err(Failure { message, code: 2 })
}

pub(super) fn record(args: &RecordArgs, terminal: &Terminal) -> Result<(), Failure> {
    one_gpu(&args.gpu)?;
    let mut options = RunOptions {
        scene: args.scene.clone(),
        options: OptionSource { file: args.options.clone(), set: Vec::new() },
        overrides: args.view.overrides(),
        gpu: args.gpu.clone(),
        seed: args.seed,
        ..RunOptions::default()
    };
    let mut set = |(path, value): &(String, String)| {
        lists::set(&mut options, &Setting::new(path.as_str(), value.as_str()))
    };
    args.set.iter().try_for_each(&mut set)?;
    let progress = Progress::on(terminal, args.json);
    let plan = Plan::resolve(options)?;
    may_hold_recording(&args.out, &args.scene)?;
    let recorded = args.threads.pool()?.install(|| RecordedRun::draw(&plan, &progress))?;
    recorded.write(&args.out)?;
    let bytes = std::fs::metadata(&args.out).map_or(0, |file| file.len());
    let (frames, packets) = (recorded.frame_count(), recorded.packets());
    if args.json {
        let out = args.out.display().to_string();
        let printed = serde_json::json!({ "out": out, "frames": frames, "packets": packets, "bytes": bytes });
        return print_json(&printed, true);
    }
    print(&format!(
        "{}: {} of {}, {packets} packets, {}",
        args.out.display(),
        counted(frames, "frame"),
        plan.name,
        si(bytes as f64, "byte")
    ))
}

/// A machine with its numbers.
#[derive(Clone, Serialize)]
struct TimedRow {
    gpu: String,
    #[serde(flatten)]
    measured: Measured,
}

pub(super) fn time(args: &TimeArgs) -> Result<(), Failure> {
    let recorded = RecordedRun::read(&args.recording)?;
    let rows = |gpus: &[PathBuf]| timed(args, &recorded, gpus);
    let pool = args.threads.pool()?;
    let in_turn = args.gpu.len().div_ceil(pool.current_num_threads()).clamp(1, MACHINES_IN_TURN);
    let rows =
        pool.install(|| args.gpu.par_chunks(in_turn).map(rows).collect::<Result<Vec<_>, _>>())?.concat();
    if args.json {
        return print_json(&rows, true);
    }
    let mut table =
        Table::new(["GPU", "cycles", "busy time", "busy energy", "energy of a frame", "warnings"]);
    for TimedRow { gpu, measured } in rows {
        let [time, busy, frame] =
            [(measured.busy_ms * 1e-3, "s"), (measured.busy_mj * 1e-3, "J"), (measured.frame_mj * 1e-3, "J")]
                .map(|(value, unit)| si(value, unit));
        table.row([gpu, measured.cycles.to_string(), time, busy, frame, measured.warnings]);
    }
    print(&table.to_string())
}

/// Numbers of the recorded frames on some GPUs.
fn timed(args: &TimeArgs, recorded: &RecordedRun, gpus: &[PathBuf]) -> Result<Vec<TimedRow>, RunError> {
    let plans: Vec<Plan> = gpus.iter().map(|gpu| planned(args, recorded, gpu)).collect::<Result<_, _>>()?;
    let timed = recorded.timed(&plans.iter().collect::<Vec<_>>())?;
    let row = |((gpu, plan), timed): ((&PathBuf, &Plan), TimedFrames<'_>)| {
        let frames = timed.powered(plan.model())?;
        Ok(TimedRow { gpu: gpu.display().to_string(), measured: measured(plan, frames, recorded.groups())? })
    };
    gpus.iter().zip(&plans).zip(timed).map(row).collect()
}

/// The recorded run on a GPU.
fn planned(args: &TimeArgs, recorded: &RecordedRun, gpu: &Path) -> Result<Plan, RunError> {
    if let Some((name, value)) = args.set.iter().find(|(path, _)| !path.contains('.')) {
        let why = "it is of the drawing; only gpu., platform. and table. can be set here";
        return Err(RunError::invalid(format_args!("--set {name}={value}"), why));
    }
    let changes = args.set.iter().cloned().map(|(path, value)| Change { path, value }).collect();
    recorded.plan(RunOptions {
        changes,
        gpu: gpu.to_owned(),
        platform: args.platform.clone(),
        energy: args.energy.clone(),
        bound: args.bound,
        timing: Some(args.timing),
        pacing: args.pacing,
        ..RunOptions::default()
    })
}
