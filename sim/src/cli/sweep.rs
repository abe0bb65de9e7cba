//! `quintile sweep`.

use std::io::Write;
use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};
use output::progress::Progress;
use output::table::{Table, counted, shell_line, si};
use output::terminal::Terminal;
use rayon::ThreadPool;
use run::Input;
use serde::Serialize;
use sweep::{
    Answer, Expected, Folder, Plan, Question, RatedDesign, Report, ReportOptions, Search, Shard, SlurmArray,
    SlurmJob, Status, SweepError, Work, merge, submit, write_scripts,
};
use traces::io::atomic::write_file;

use super::Failure;
use super::outputs::{print, print_json};
use super::run::REVISION;
use super::stop::Stop;
use super::trace::{PlotFormat, write_picture};
use crate::cli::args::{LookArgs, ThreadArgs};
use crate::cli::parse::percent;

/// Arguments of `sweep`.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  quintile sweep run tiles.ron --out tiles --dry-run\n  quintile sweep run tiles.ron --out tiles\n  \
    quintile sweep merge tiles\n  quintile sweep report tiles\n  sbatch --array=0-7 --wrap 'quintile sweep run tiles.ron --out tiles'\n\n\
    `sweep run` may be stopped at any moment and called again: finished points are skipped. Points are finished when their \
    file is in DIR/points; a point that fails is finished, too, with its reason. After USR1 or TERM no further points are begun, those \
    in flight are finished (after TERM, if they can within 20 s), and the exit code is 138 or 143 if points are left."
)]
pub struct SweepArgs {
    /// What to do
    #[command(subcommand)]
    pub step: Step,
}

impl SweepArgs {
    /// Whether signals of a scheduler end it between two points.
    pub(super) const fn follows_stop(&self) -> bool {
        matches!(self.step, Step::Run(_))
    }
}

/// Step of a sweep.
#[derive(Debug, Subcommand)]
pub enum Step {
    /// Check a sweep file, write its points into DIR/plan.jsonl, and print their number and the expected time
    Plan(PlanArgs),
    /// Run the points that are not finished, on all cores
    Run(RunStepArgs),
    /// Plan, and write scripts for Slurm: DIR/array.sh, whose tasks run the points, and DIR/merge.sh
    Slurm(SlurmArgs),
    /// Print how many points are finished, from the files of the sweep alone
    Status(StatusArgs),
    /// Answer an optimizer: read places on the axes from standard input, a line of JSON each, and print what a point there costs
    Ask(AskArgs),
    /// Write DIR/results.parquet, with a row for each point
    Merge(MergeArgs),
    /// Write DIR/report.html, with tables and a picture beside it: frontiers of time, energy and area, best designs, effects and
    /// interactions of settings; and print the frontiers
    Report(ReportArgs),
}

/// A sweep file and its folder.
#[derive(Debug, Args)]
pub struct FileArgs {
    /// The sweep file
    #[arg(value_name = "FILE.ron")]
    pub file: PathBuf,
    /// Folder of the sweep; created if missing
    #[arg(long, value_name = "DIR", default_value = "sweep")]
    pub out: PathBuf,
    /// Take the settings under `quick` of the sweep file, which make the runs small
    #[arg(long)]
    pub quick: bool,
    /// Worker threads
    #[command(flatten)]
    pub threads: ThreadArgs,
    /// Print as JSON
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `sweep plan`.
#[derive(Debug, Args)]
pub struct PlanArgs {
    /// The sweep
    #[command(flatten)]
    pub sweep: FileArgs,
}

/// Arguments of `sweep run`.
#[derive(Debug, Args)]
pub struct RunStepArgs {
    /// The sweep
    #[command(flatten)]
    pub sweep: FileArgs,
    /// Run part i of n of the points, such as 1/8 [default: that of the task by the variables of Slurm, PBS or HyperQueue;
    /// all points outside of a task]
    #[arg(long, value_name = "i/n", value_parser = Shard::parse, conflicts_with = "shards")]
    pub shard: Option<Shard>,
    /// Number of tasks, for PBS and HyperQueue, which do not give it
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub shards: Option<u32>,
    /// Run points that failed again
    #[arg(long)]
    pub retry: bool,
    /// Print number and expected time of the runs, and stop before anything is written
    #[arg(long)]
    pub dry_run: bool,
}

/// Arguments of `sweep slurm`.
#[derive(Debug, Args)]
pub struct SlurmArgs {
    /// The sweep
    #[command(flatten)]
    pub sweep: FileArgs,
    /// Number of tasks, at most 1000 [default: as many as take ten minutes each, by the expected time]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub tasks: Option<u32>,
    /// Threads of a task
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub task_threads: u16,
    /// Submit both scripts by `sbatch`, and print the numbers of the jobs
    #[arg(long)]
    pub submit: bool,
}

/// Arguments of `sweep ask`.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  echo '{\"at\": [0.5, 0.25]}' | quintile sweep ask caches.ron --out caches\n\n\
    The first line printed has the axes: the settings of each, and the number of its values. A place on an axis is from 0 to 1; \
    value i of n is at (i + 0.5) / n. Each line read is answered by a line. Points are kept in DIR as those of `sweep run`, so that \
    nothing runs twice, and `sweep merge` and `sweep report` have them. sim/sweep/drivers/optuna_sweep.py searches by this."
)]
pub struct AskArgs {
    /// The sweep file, with the space of the search
    #[arg(value_name = "FILE.ron")]
    pub file: PathBuf,
    /// Folder of the search; created if missing
    #[arg(long, value_name = "DIR", default_value = "sweep")]
    pub out: PathBuf,
    /// Take the settings under `quick` of the sweep file
    #[arg(long)]
    pub quick: bool,
    /// Worker threads
    #[command(flatten)]
    pub threads: ThreadArgs,
}

/// The folder of a sweep.
#[derive(Debug, Args)]
pub struct FolderArgs {
    /// The folder of the sweep; or its file, and --out for the folder
    #[arg(value_name = "DIR|FILE.ron")]
    pub sweep: PathBuf,
    /// Folder of the sweep, if its file is given
    #[arg(long, value_name = "DIR", default_value = "sweep")]
    pub out: PathBuf,
    /// Print as JSON
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `sweep status`.
#[derive(Debug, Args)]
pub struct StatusArgs {
    /// The sweep
    #[command(flatten)]
    pub folder: FolderArgs,
}

/// Arguments of `sweep merge`.
#[derive(Debug, Args)]
pub struct MergeArgs {
    /// The sweep
    #[command(flatten)]
    pub folder: FolderArgs,
    /// Write points that are not finished as rows with that reason
    #[arg(long)]
    pub partial: bool,
}

/// Arguments of `sweep report`.
#[derive(Debug, Args)]
pub struct ReportArgs {
    /// The sweep
    #[command(flatten)]
    pub folder: FolderArgs,
    /// How far from the best a design may be to be chosen for what else it costs, for example 5%
    #[arg(long, value_name = "P%", default_value = "5%", value_parser = percent, allow_hyphen_values = true)]
    pub within: f64,
    /// Style of the plot
    #[command(flatten)]
    pub look: LookArgs,
}

impl FolderArgs {
    fn folder(&self) -> Folder {
        let is_file = self.sweep.extension().is_some_and(|ending| ending == "ron") && !self.sweep.is_dir();
        Folder::at(if is_file { &self.out } else { &self.sweep })
    }
}

impl From<SweepError> for Failure {
    fn from(error: SweepError) -> Self {
        Self { message: error.to_string(), code: if error.is_usage() { 2 } else { 1 } }
    }
}

/// What a step did, with the folder.
#[derive(Serialize)]
struct Printed<'a, T: Serialize> {
    out: String,
    #[serde(flatten)]
    done: &'a T,
}

pub(super) fn run(args: &SweepArgs, terminal: &Terminal, stop: &Stop) -> Result<(), Failure> {
    match &args.step {
        Step::Plan(args) => plan(args, terminal),
        Step::Run(args) => run_points(args, terminal, stop),
        Step::Slurm(args) => slurm(args, terminal),
        Step::Status(args) => status(args, terminal),
        Step::Ask(args) => ask(args),
        Step::Merge(args) => merged(args),
        Step::Report(args) => report(args),
    }
}

/// A sweep that is planned.
struct Opened {
    plan: Plan,
    folder: Folder,
    pool: ThreadPool,
    progress: Progress,
}

impl Opened {
    /// Plans the sweep of these arguments.
    fn new(args: &FileArgs, terminal: &Terminal) -> Result<Self, Failure> {
        let (pool, progress) = (args.threads.pool()?, Progress::on(terminal, args.json));
        let plan =
            pool.install(|| Plan::load_with_progress(&args.file, args.quick, Some(&program()), &progress))?;
        let folder = Folder::at(&args.out);
        folder.check(&plan)?;
        Ok(Self { plan, folder, pool, progress })
    }

    /// Expected time of all points that are not finished, by running two of them.
    fn probe(&self, shard: Shard, retry: bool) -> Result<Expected, Failure> {
        let work = Work::new(&self.plan, &self.folder, shard, retry)?;
        self.progress.note(&format!(
            "{} planned; running two for the expected time",
            counted(self.plan.points.len(), "run")
        ));
        Ok(self.pool.install(|| work.probe()))
    }
}

/// Revision and contents of this program: results of another one do not count.
fn program() -> String {
    let hash = std::env::current_exe().ok().and_then(|path| Input::now(&path).ok()?.sha256);
    format!("{} {}", REVISION.unwrap_or_default(), hash.unwrap_or_default())
}

fn plan(args: &PlanArgs, terminal: &Terminal) -> Result<(), Failure> {
    let opened = Opened::new(&args.sweep, terminal)?;
    opened.folder.write_plan(&opened.plan)?;
    print_expected(&args.sweep, &opened.probe(Shard::default(), false)?)
}

fn run_points(args: &RunStepArgs, terminal: &Terminal, stop: &Stop) -> Result<(), Failure> {
    let shard = match args.shard {
        Some(shard) => shard,
        None => Shard::of_task(args.shards.map(|count| count as usize), |name| std::env::var(name).ok())?,
    };
    let opened = Opened::new(&args.sweep, terminal)?;
    if args.dry_run {
        return print_expected(&args.sweep, &opened.probe(shard, args.retry)?);
    }
    let Opened { plan, folder, pool, progress } = opened;
    folder.write_plan(&plan)?;
    let is_asked = || stop.is_asked();
    let work = Work::new(&plan, &folder, shard, args.retry)?.until(&is_asked);
    let status = pool.install(|| work.run(&progress))?;
    print_status(&args.sweep.out, args.sweep.json, &status)?;
    match status.points - status.finished {
        0 => Ok(()),
        left => Err(Failure {
            message: format!(
                "stopped by a signal: {} not finished; call it again to continue",
                counted(left, "run")
            ),
            code: stop.code(),
        }),
    }
}

fn slurm(args: &SlurmArgs, terminal: &Terminal) -> Result<(), Failure> {
    let opened = Opened::new(&args.sweep, terminal)?;
    opened.folder.write_plan(&opened.plan)?;
    let expected = opened.probe(Shard::default(), false)?;
    let Opened { plan, pool, .. } = opened;
    let tasks = match args.tasks.map(|count| count as usize) {
        Some(count) if count > 1 && !plan.screen.is_empty() => {
            let message = "--tasks: a sweep that screens runs as one task; leave it out".to_owned();
            return Err(Failure { message, code: 2 });
        }
        given if plan.screen.is_empty() => given,
        _ => Some(1),
    };
    let array = SlurmArray::new(&expected, pool.current_num_threads(), args.task_threads.into(), tasks);
    let [out, directory] = [&*args.sweep.out, Path::new("")].map(absolute);
    let [run, merge] = commands(&args.sweep);
    let job = SlurmJob { name: &plan.name, folder: &out, directory: &directory, command: &run };
    let merge_sh = SlurmJob { command: &merge, ..job }.merge_script();
    let paths = write_scripts(&out, &array.script(&job), &merge_sh)?;
    let jobs = match args.submit {
        true => Some(submit(paths.each_ref().map(PathBuf::as_path))?),
        false => None,
    };
    let scripts = paths.map(|path| path.display().to_string());
    if args.sweep.json {
        let printed = serde_json::json!({
            "scripts": scripts, "tasks": array.tasks, "jobs": jobs, "expected": expected
        });
        return print_json(&printed, true);
    }
    let (tasks, minutes) = (counted(array.tasks, "task"), array.minutes);
    let then = match jobs {
        Some([array, merge]) => format!("submitted as job {array}, and job {merge} to merge"),
        None => {
            let [array_sh, merge_sh] = scripts.map(|path| shell_line(&[path]));
            format!("submit with\nsbatch --dependency=afterany:$(sbatch --parsable {array_sh}) {merge_sh}")
        }
    };
    print(&format!("{}\n{tasks} of {minutes} min at most; {then}", expected.line()))
}

/// Commands of a task and of the merge job, with absolute paths.
fn commands(args: &FileArgs) -> [Vec<String>; 2] {
    let text = |path: &Path| path.display().to_string();
    let program = text(&std::env::current_exe().unwrap_or_else(|_| "quintile".into()));
    let [file, out] = [&args.file, &args.out].map(|path| text(&absolute(path)));
    let step = |name: &str| vec![program.clone(), "sweep".to_owned(), name.to_owned()];
    let quick = args.quick.then(|| "--quick".to_owned());
    let run = step("run").into_iter().chain([file, "--out".to_owned(), out.clone()]).chain(quick);
    let merge = step("merge").into_iter().chain([out, "--partial".to_owned()]);
    [run.collect(), merge.collect()]
}

/// The path from the root; an empty one is the current directory.
fn absolute(path: &Path) -> PathBuf {
    std::env::current_dir().map_or_else(|_| path.to_owned(), |directory| directory.join(path))
}

fn ask(args: &AskArgs) -> Result<(), Failure> {
    let pool = args.threads.pool()?;
    let folder = Folder::at(&args.out);
    let program = program();
    let mut search = Search::new(&args.file, args.quick, Some(&program), &folder)?;
    print_json(&serde_json::json!({ "axes": search.dimensions() }), false)?;
    for line in std::io::stdin().lines() {
        let line = line.map_err(|error| Failure { message: format!("standard input: {error}"), code: 1 })?;
        let answer = match serde_json::from_str::<Question>(&line) {
            Ok(question) => pool.install(|| search.answer(&question))?,
            Err(error) => {
                let reason = format!("`{line}` is no question: {error}; write {{\"at\": [0.5]}}");
                Answer { error: Some(reason), ..Answer::default() }
            }
        };
        print_json(&answer, false)?;
    }
    search.finish()?;
    Ok(())
}

fn status(args: &StatusArgs, terminal: &Terminal) -> Result<(), Failure> {
    let folder = args.folder.folder();
    let (status, damaged) = Status::of(&folder)?;
    damaged.iter().for_each(|message| terminal.note(message));
    print_status(folder.path(), args.folder.json, &status)
}

fn merged(args: &MergeArgs) -> Result<(), Failure> {
    let path = merge(&args.folder.folder(), args.partial)?;
    match args.folder.json {
        true => print_json(&serde_json::json!({ "results": path.display().to_string() }), true),
        false => print(&format!("results: {}", path.display())),
    }
}

fn report(args: &ReportArgs) -> Result<(), Failure> {
    let folder = args.folder.folder();
    let report = Report::of(&folder, ReportOptions { within: args.within })?;
    let file = |name: &str| folder.path().join(name);
    report.tables().into_iter().try_for_each(|(name, table)| write_file(&file(name), |out| table(out)))?;
    let look = args.look.look();
    write_picture(&report.picture(&look), &file("frontier.svg"), PlotFormat::Svg)?;
    let page = report.html(&look).map_err(|error| Failure { message: error.to_string(), code: 1 })?;
    write_file(&file("report.html"), |out| out.write_all(page.as_bytes()))?;
    let name = folder.path().display().to_string();
    if args.folder.json {
        return print_json(&Printed { out: name, done: &report }, true);
    }
    let html = file("report.html").display().to_string();
    print(&format!("{}\n{}\n{}\nreport: {html}", frontiers(&report), winners(&report), left_out(&report)))
}

/// Designs on the frontier, the fastest first.
fn frontiers(report: &Report) -> Table {
    let mut table = Table::new([
        "workload",
        "busy time",
        "busy energy",
        "area",
        "ranks by time",
        "design on the frontier",
    ]);
    for (workload, designs) in &report.workloads {
        let mut optimal: Vec<&RatedDesign> = designs.iter().filter(|design| design.on_frontier).collect();
        optimal.sort_by(|a, b| a.design.time_s.value.total_cmp(&b.design.time_s.value));
        for rated in optimal {
            let design = &rated.design;
            let [time, energy] = [(design.time_s.value, "s"), (design.energy_j.value, "J")]
                .map(|(value, unit)| si(value, unit));
            let area = design.area_mm2.map_or("-".to_owned(), |area| format!("{area:.1} mm2"));
            let [best, worst] = rated.time_ranks;
            let ranks = if best == worst { best.to_string() } else { format!("{best} to {worst}") };
            table.row([workload.clone(), time, energy, area, ranks, design.design.clone()]);
        }
    }
    table
}

/// Best designs, and how many others they cannot be distinguished from.
fn winners(report: &Report) -> Table {
    let mut table = Table::new(["workload", "best by", "cost", "undecided", "design"]);
    for winner in &report.winners {
        let undecided = format!("{} of {}", winner.undecided, winner.designs.saturating_sub(1));
        let cost = si(winner.value, winner.measure.unit());
        let measure = winner.measure.name().to_owned();
        table.row([winner.workload.clone(), measure, cost, undecided, winner.design.clone()]);
    }
    table
}

fn left_out(report: &Report) -> String {
    match report.left_out {
        0 => "all points are in".to_owned(),
        count => format!("{} left out, failed, screened out or not finished", counted(count, "point")),
    }
}

fn print_expected(args: &FileArgs, expected: &Expected) -> Result<(), Failure> {
    match args.json {
        true => print_json(&Printed { out: args.out.display().to_string(), done: expected }, true),
        false => print(&expected.line()),
    }
}

fn print_status(out: &Path, json: bool, status: &Status) -> Result<(), Failure> {
    if json {
        return print_json(&Printed { out: out.display().to_string(), done: status }, true);
    }
    let Status { points, finished, failed, screened_out } = status;
    let screened = if *screened_out > 0 { format!(", {screened_out} screened out") } else { String::new() };
    print(&format!(
        "{}: {finished} of {} finished, {failed} failed{screened}",
        out.display(),
        counted(*points, "run")
    ))
}
