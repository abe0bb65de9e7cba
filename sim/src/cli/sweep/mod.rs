//! `quintile sweep`.

mod args;

use std::path::{Path, PathBuf};

use output::table::{Table, counted, shell_line, si};
use output::terminal::{Progress, Terminal};
use rayon::ThreadPool;
use run::Input;
use serde::Serialize;
use sweep::{
    Answer, ExpectedRuns, Folder, Question, RatedDesign, ReportOptions, Scripts, Search, Shard, ShardWork,
    SlurmArray, SlurmJob, Status, SweepPlan, SweepReport, merge, submit,
};

use self::args::{
    AskArgs, CleanArgs, FileArgs, FolderArgs, MergeArgs, PlanArgs, ReportArgs, RunStepArgs, SlurmArgs,
    StatusArgs, Step,
};
use super::run::REVISION;
use super::signals::Stop;
use super::{Failure, print, print_json};

pub use self::args::SweepArgs;

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
        Step::Merge(args) => merged(args, terminal),
        Step::Clean(args) => clean(args),
        Step::Report(args) => report(args, terminal),
    }
}

/// A sweep that is planned.
struct Opened {
    plan: SweepPlan,
    folder: Folder,
    pool: ThreadPool,
    progress: Progress,
}

impl Opened {
    /// Plans the sweep of these arguments.
    fn new(args: &FileArgs, terminal: &Terminal) -> Result<Self, Failure> {
        let (pool, progress) = (args.threads.pool()?, Progress::on(terminal, args.json));
        let plan = pool
            .install(|| SweepPlan::load_with_progress(&args.file, args.quick, Some(&program()), &progress))?;
        let folder = Folder::at(&args.out);
        folder.check(&plan)?;
        Ok(Self { plan, folder, pool, progress })
    }

    /// Expected time of all points that are not finished, by running two of them.
    fn probe(&self, shard: Shard, retry: bool) -> Result<ExpectedRuns, Failure> {
        let work = ShardWork::new(&self.plan, &self.folder, shard, retry)?;
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
    let is_requested = || stop.is_requested();
    let work = ShardWork::new(&plan, &folder, shard, args.retry)?.until(&is_requested);
    let status = pool.install(|| work.run(&progress))?;
    print_status(
        &args.sweep.out,
        args.sweep.json,
        &InShard { status, shard, sweep_points: plan.points.len() },
    )?;
    match (status.points - status.finished, status.failed) {
        (0, 0) => Ok(()),
        (0, failed) => Err(Failure {
            message: format!(
                "{} failed: the lines above and the table have the reasons; --retry runs them again",
                counted(failed, "run")
            ),
            code: 1,
        }),
        (left, _) => Err(Failure {
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
    let scripts = Scripts::open(&opened.folder)?;
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
    let paths = scripts.write(&array.script(&job), &merge_sh)?.map(|path| absolute(&path));
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

/// The folder of a sweep, with a note if its results are of another build.
fn opened(args: &FolderArgs, terminal: &Terminal) -> Result<Folder, Failure> {
    let folder = args.folder();
    folder.other_build(Some(&program()))?.iter().for_each(|message| terminal.note(message));
    Ok(folder)
}

fn status(args: &StatusArgs, terminal: &Terminal) -> Result<(), Failure> {
    let folder = opened(&args.folder, terminal)?;
    let (status, damaged) = Status::of(&folder)?;
    damaged.iter().for_each(|message| terminal.note(message));
    let others = folder.others(&folder.plan()?)?.len();
    if others > 0 {
        let count = counted(others, "result");
        let place = shell_line(&[folder.path().display().to_string()]);
        terminal
            .note(&format!("{count} of other builds, settings or inputs are kept; `quintile sweep clean {place}` removes them"));
    }
    print_status(
        folder.path(),
        args.folder.json,
        &InShard { status, shard: Shard::default(), sweep_points: status.points },
    )
}

fn clean(args: &CleanArgs) -> Result<(), Failure> {
    let folder = args.folder.folder();
    let removed = folder.remove_others()?;
    match args.folder.json {
        true => print_json(
            &serde_json::json!({ "out": folder.path().display().to_string(), "removed": removed }),
            true,
        ),
        false => print(&format!("{}: {} removed", folder.path().display(), counted(removed, "result"))),
    }
}

fn merged(args: &MergeArgs, terminal: &Terminal) -> Result<(), Failure> {
    let path = merge(&opened(&args.folder, terminal)?, args.partial)?;
    match args.folder.json {
        true => print_json(&serde_json::json!({ "results": path.display().to_string() }), true),
        false => print(&format!("results: {}", path.display())),
    }
}

fn print_expected(args: &FileArgs, expected: &ExpectedRuns) -> Result<(), Failure> {
    match args.json {
        true => print_json(&Printed { out: args.out.display().to_string(), done: expected }, true),
        false => print(&expected.line()),
    }
}

/// State of a share of a sweep.
#[derive(Serialize)]
struct InShard {
    #[serde(flatten)]
    status: Status,
    shard: Shard,
    /// Points of the whole sweep.
    sweep_points: usize,
}

fn print_status(out: &Path, json: bool, state: &InShard) -> Result<(), Failure> {
    if json {
        return print_json(&Printed { out: out.display().to_string(), done: state }, true);
    }
    let InShard { status: Status { points, finished, failed, screened_out }, shard, sweep_points } = state;
    let screened = if *screened_out > 0 { format!(", {screened_out} screened out") } else { String::new() };
    let [of, all] = match shard.is_whole() {
        true => [String::new(), String::new()],
        false => [format!("shard {shard}: "), format!("; the sweep has {}", counted(*sweep_points, "run"))],
    };
    let (out, runs) = (out.display(), counted(*points, "run"));
    print(&format!("{out}: {of}{finished} of {runs} finished, {failed} failed{screened}{all}"))
}

fn report(args: &ReportArgs, terminal: &Terminal) -> Result<(), Failure> {
    let folder = opened(&args.folder, terminal)?;
    let report = SweepReport::of(&folder, ReportOptions { within: args.within })?;
    let page = report.write(&folder, &args.plot_style.plot_style())?;
    let name = folder.path().display().to_string();
    if args.folder.json {
        return print_json(&Printed { out: name, done: &report }, true);
    }
    let notes: String = report.notes().iter().map(|note| format!("{note}\n")).collect();
    let effects = match report.no_effects.len() {
        0 => String::new(),
        count => format!(
            "{} with too many values for effects of each: see the report\n",
            counted(count, "setting")
        ),
    };
    print(&format!(
        "{notes}{}\n{}\n{effects}report: {}",
        frontiers(&report),
        winners(&report),
        page.display()
    ))
}

/// Designs on the frontier, the fastest first.
fn frontiers(report: &SweepReport) -> Table {
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
            table.row([
                workload.clone(),
                time,
                energy,
                area,
                ranks,
                marked(&design.design, design.is_mismatched()),
            ]);
        }
    }
    table
}

/// Best designs, and how many others they cannot be distinguished from.
fn winners(report: &SweepReport) -> Table {
    let mut table = Table::new(["workload", "best by", "cost", "undecided", "design"]);
    for winner in &report.winners {
        let undecided = format!("{} of {}", winner.undecided, winner.designs.saturating_sub(1));
        let cost = si(winner.value, winner.measure.unit());
        let measure = winner.measure.name().to_owned();
        table.row([
            winner.workload.clone(),
            measure,
            cost,
            undecided,
            marked(&winner.design, winner.platform_mismatch),
        ]);
    }
    table
}

/// The name of a design, marked if its energies are those of another GPU.
fn marked(design: &str, is_mismatched: bool) -> String {
    format!("{design}{}", if is_mismatched { " *" } else { "" })
}
