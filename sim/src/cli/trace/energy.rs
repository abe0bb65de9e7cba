//! `quintile trace energy`.

use std::path::Path;

use serde_json::json;
use traces::Trace;
use traces::energy::{
    FrameEnergy, Idle, Pooled, PowerIntegral, Spread, energies_j, finishes_s, levels_w, outliers, pooled,
    warm_up, whole,
};
use traces::io::{TraceHeader, Repair, TraceReader};

use super::failure::wrong;
use crate::cli::Failure;
use crate::cli::args::trace::{Discard, EnergyArgs, IdleBy};
use crate::cli::terminal::{print, print_json};
use crate::output::table::counted;
use crate::output::terminal::Terminal;

/// Samples from which the lowest power is taken, about.
const LEVELS: u64 = 65_536;

pub(super) fn run(args: &EnergyArgs, terminal: &Terminal) -> Result<(), Failure> {
    passes_differ(&args.pass)?;
    let recording = args.idle_trace.as_ref().map(|path| args.input.load_other(path, terminal)).transpose()?;
    let recording = recording.as_ref().map(|(recording, _)| PowerIntegral::new(recording));
    if args.from.is_some() || args.to.is_some() {
        let (trace, repairs) = args.input.source(terminal)?;
        return stretch(args, (&*trace, &repairs), recording.as_ref());
    }
    let (first, repairs, of_file) = one_run(args, &args.input.trace, recording.as_ref(), terminal)?;
    let pixels = args.find.pixels.or(of_file);
    let mut runs = vec![first];
    for path in &args.run {
        runs.push(one_run(args, path, recording.as_ref(), terminal)?.0);
    }
    let energies: Vec<Vec<f64>> =
        runs.iter().map(|run| run.kept.iter().map(|f| f.energy_j).collect()).collect();
    let pool = pooled(&energies).ok_or_else(|| wrong("no frame is left; discard fewer"))?;
    if args.json {
        let runs: Vec<_> = runs.iter().map(Run::json).collect();
        let report = json!({ "runs": runs, "pooled": pool, "pixels": pixels, "repairs": repairs });
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
fn stretch(
    args: &EnergyArgs,
    (trace, repairs): (&dyn TraceReader, &[Repair]),
    recording: Option<&PowerIntegral<'_>>,
) -> Result<(), Failure> {
    let header = trace.header();
    let idle = idle(args, trace, recording)?;
    let (from_s, to_s) = (args.from.unwrap_or(header.start_s), args.to.unwrap_or(header.end_s()));
    check(&header, from_s, to_s, "--from and --to")?;
    let total_j = energies_j(trace, &[(from_s, to_s)])?[0];
    let idle_j = idle.map_or(0.0, |idle| idle.energy_j(header.start_s, from_s, to_s));
    let (energy_j, power_w) = (total_j - idle_j, (total_j - idle_j) / (to_s - from_s));
    if args.json {
        return print_json(
            &json!({ "from_s": from_s, "to_s": to_s, "energy_J": energy_j, "power_W": power_w, "idle_J": idle_j,
                "repairs": repairs }),
            true,
        );
    }
    print(&format!("{from_s} s to {to_s} s: {energy_j:.6} J, {power_w:.4} W (idle taken off: {idle_j:.6} J)"))
}

fn check(trace: &TraceHeader, from_s: f64, to_s: f64, what: &str) -> Result<(), Failure> {
    check_within((trace.start_s, trace.end_s()), (from_s, to_s), what)
}

/// Whether a number is between two others, to rounding.
pub(super) fn is_within([low, high]: [f64; 2], number: f64) -> bool {
    let rounding = 1e-12 * low.abs().max(high.abs());
    (low - rounding..=high + rounding).contains(&number)
}

/// Refuses a stretch that is not within a trace.
pub(super) fn check_within(
    (start_s, end_s): (f64, f64),
    (from_s, to_s): (f64, f64),
    what: &str,
) -> Result<(), Failure> {
    let extent = [start_s, end_s];
    let inside = is_within(extent, from_s) && is_within(extent, to_s);
    match (inside, from_s < to_s) {
        (true, true) => Ok(()),
        (true, false) => Err(wrong(format!(
            "{what}: {from_s} s to {to_s} s ends before it begins or has no length; give the earlier time first"
        ))),
        (false, _) => Err(wrong(format!(
            "{what}: {from_s} s to {to_s} s is not within the trace, {start_s} s to {end_s} s; give times inside it"
        ))),
    }
}

fn idle<'a>(
    args: &EnergyArgs,
    trace: &dyn TraceReader,
    recording: Option<&PowerIntegral<'a>>,
) -> Result<Option<Idle<'a>>, Failure> {
    if let Some((from_s, to_s)) = args.idle {
        check(&trace.header(), from_s, to_s, "--idle")?;
        return Ok(Some(Idle::Mean(energies_j(trace, &[(from_s, to_s)])?[0] / (to_s - from_s))));
    }
    if let Some(recording) = recording {
        let length_s = recording.trace().end_s() - recording.trace().start_s();
        return Ok(Some(match args.idle_by {
            IdleBy::Mean => Idle::Mean(recording.total_j() / length_s),
            IdleBy::Instant => {
                covers(recording.trace(), &trace.header())?;
                Idle::Instant(recording.clone())
            }
        }));
    }
    Ok(args.idle_w.map(Idle::Mean))
}

/// Refuses an idle recording that ends before the trace does: instants are compared from the starts of both on.
fn covers(idle: &Trace, trace: &TraceHeader) -> Result<(), Failure> {
    let [idle_s, trace_s] = [idle.end_s() - idle.start_s(), trace.end_s() - trace.start_s];
    if idle_s >= trace_s * (1.0 - 1e-9) {
        return Ok(());
    }
    Err(wrong(format!(
        "--idle-by instant: the idle recording lasts {idle_s} s, the trace {trace_s} s; record it as long, or take --idle-by mean"
    )))
}

/// Frames of one run and what was made of them.
struct Run {
    kept: Vec<FrameEnergy>,
    discarded: usize,
    clearness: f64,
    outliers: usize,
    old: Spread,
    passes: Vec<(String, Spread)>,
}

/// One recording: its frames, what was mended in it, and the pixels of its frames if it says so.
fn one_run(
    args: &EnergyArgs,
    path: &Path,
    recording: Option<&PowerIntegral<'_>>,
    terminal: &Terminal,
) -> Result<(Run, Vec<Repair>, Option<u64>), Failure> {
    let (found, trace) = args.find.frames_and_samples(&args.input, path, terminal)?;
    found.warn(terminal);
    let mut frames = whole(&found.energies).to_vec();
    let (trace, start_s) = (&*trace, trace.header().start_s);
    let idle = idle(args, trace, recording)?;
    let idle_j = |a_s: f64, b_s: f64| idle.as_ref().map_or(0.0, |idle| idle.energy_j(start_s, a_s, b_s));
    let all: Vec<f64> = frames.iter().map(|frame| frame.energy_j).collect();
    let warm = warm_up(&all);
    let discarded = match args.discard {
        Discard::Count(count) => count,
        Discard::Auto => warm.frames,
    };
    let out = outliers(&all);
    let count = out.iter().skip(discarded).filter(|out| **out).count();
    let old = begin_to_finish(args, trace, &frames)?.into_iter();
    let old: Vec<f64> = old.map(|((a_s, b_s), energy_j)| energy_j - idle_j(a_s, b_s)).collect();
    if let Some(idle) = &idle {
        idle.take_off(start_s, &mut frames);
    }
    let keep = |index: usize| index >= discarded && !(args.drop_outliers && out[index]);
    let kept: Vec<FrameEnergy> =
        frames.iter().enumerate().filter(|(i, _)| keep(*i)).map(|(_, f)| *f).collect();
    let old: Vec<f64> = old.into_iter().enumerate().filter(|(i, _)| keep(*i)).map(|(_, j)| j).collect();
    let none = || {
        wrong(format!(
            "of {} none is left after {discarded} are discarded; discard fewer",
            counted(frames.len(), "frame")
        ))
    };
    let old = Spread::of(&old).ok_or_else(none)?;
    args.pass.iter().try_for_each(|mark| within_frames(mark, &kept, terminal))?;
    let passes = passes(args, trace, &kept, &idle_j)?;
    let run = Run { kept, discarded, clearness: warm.clearness, outliers: count, old, passes };
    Ok((run, found.repairs, found.metadata.pixels))
}

/// A span of time, s.
type Span = (f64, f64);

/// From when to when each frame's work goes on, and its energy, J: the old method.
fn begin_to_finish(
    args: &EnergyArgs,
    trace: &dyn TraceReader,
    frames: &[FrameEnergy],
) -> Result<Vec<(Span, f64)>, Failure> {
    let busy_w = match args.busy_above {
        Some(watts) => watts,
        None => busy_above(levels_w(trace, LEVELS)?, frames),
    };
    let finishes_s = finishes_s(trace, frames, busy_w)?;
    let spans: Vec<Span> = frames.iter().map(|frame| frame.start_s).zip(finishes_s).collect();
    let energies = energies_j(trace, &spans)?;
    Ok(spans.into_iter().zip(energies).collect())
}

/// A tenth of the way from the lowest to the mean power of the frames.
fn busy_above(mut powers: Vec<f64>, frames: &[FrameEnergy]) -> f64 {
    powers.sort_by(f64::total_cmp);
    let low = powers[powers.len() / 20];
    let mean = frames.iter().map(FrameEnergy::power_w).sum::<f64>() / frames.len().max(1) as f64;
    low + 0.1 * (mean - low).max(0.0)
}

/// Energy of each pass, from its mark to the next one, or to the end of the frame; what is before the first is a pass
/// of its own, so that they add up.
fn passes(
    args: &EnergyArgs,
    trace: &dyn TraceReader,
    frames: &[FrameEnergy],
    idle_j: &dyn Fn(f64, f64) -> f64,
) -> Result<Vec<(String, Spread)>, Failure> {
    let mut marks = args.pass.clone();
    if marks.is_empty() {
        return Ok(Vec::new());
    }
    marks.sort_by(|a, b| a.1.total_cmp(&b.1));
    if marks[0].1 > 0.0 {
        marks.insert(0, ("before".to_owned(), 0.0));
    }
    let span = &|index: usize, frame: &FrameEnergy| {
        let at = |mark: &(String, f64)| (frame.start_s + mark.1).min(frame.end_s);
        (at(&marks[index]), marks.get(index + 1).map_or(frame.end_s, at))
    };
    // Pass by pass, and all at once: the samples may have to be read anew for each question.
    let of_pass = |index: usize| frames.iter().map(move |frame| span(index, frame));
    let spans: Vec<Span> = (0..marks.len()).flat_map(of_pass).collect();
    let less_idle = |(energy_j, (a_s, b_s)): (f64, &Span)| energy_j - idle_j(*a_s, *b_s);
    let energies: Vec<f64> = energies_j(trace, &spans)?.into_iter().zip(&spans).map(less_idle).collect();
    let spreads = energies.chunks(frames.len()).map(Spread::of);
    Ok(marks.iter().zip(spreads).filter_map(|((name, _), spread)| Some((name.clone(), spread?))).collect())
}

/// Refuses two passes of one name, whose energies could not be told apart.
fn passes_differ(passes: &[(String, f64)]) -> Result<(), Failure> {
    let mut names: Vec<&str> = passes.iter().map(|(name, _)| name.as_str()).collect();
    names.sort_unstable();
    match names.windows(2).find(|two| two[0] == two[1]) {
        Some(two) => Err(wrong(format!("--pass {} is given twice: name each pass differently", two[0]))),
        None => Ok(()),
    }
}

/// Refuses a pass that begins in no frame, and tells of one that begins in some alone.
fn within_frames(
    (name, begins_s): &(String, f64),
    frames: &[FrameEnergy],
    terminal: &Terminal,
) -> Result<(), Failure> {
    let beyond = frames.iter().filter(|frame| frame.duration_s() <= *begins_s).count();
    if beyond == frames.len() {
        let longest_s = frames.iter().map(FrameEnergy::duration_s).fold(0.0, f64::max);
        return Err(wrong(format!(
            "--pass {name}={}: no frame is longer than {:.3} ms; let the pass begin before that",
            begins_s * 1e3,
            longest_s * 1e3
        )));
    }
    if beyond > 0 {
        let frames = frames.len();
        let message = format!(
            "{beyond} of {frames} frames end before pass {name} begins, {} ms after their start: it has no energy there",
            begins_s * 1e3
        );
        terminal.warn_of("pass-beyond", &message);
    }
    Ok(())
}

impl Run {
    fn json(&self) -> serde_json::Value {
        let energies: Vec<f64> = self.kept.iter().map(|frame| frame.energy_j).collect();
        let passes: Vec<_> =
            self.passes.iter().map(|(name, j)| json!({ "pass": name, "energy_J": j })).collect();
        json!({
            "frames": self.kept.len(), "discarded": self.discarded, "warm_up_clearness": self.clearness,
            "outliers": self.outliers, "energy_J": Spread::of(&energies), "begin_to_finish_J": self.old,
            "passes": passes, "energies_J": energies,
        })
    }

    fn text(&self) -> String {
        let energies: Vec<f64> = self.kept.iter().map(|frame| frame.energy_j).collect();
        let spread = Spread::of(&energies).unwrap_or_default();
        let mut text = format!(
            "{} ({} discarded, {}): {:.4} mJ/frame start to start (deviation {:.4}), {:.4} mJ begin to finish\n",
            counted(self.kept.len(), "frame"),
            self.discarded,
            counted(self.outliers, "outlier"),
            spread.mean * 1e3,
            spread.deviation * 1e3,
            self.old.mean * 1e3
        );
        for (name, spread) in &self.passes {
            text +=
                &format!("  {name}: {:.4} mJ (deviation {:.4})\n", spread.mean * 1e3, spread.deviation * 1e3);
        }
        text
    }
}
