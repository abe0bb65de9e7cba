//! Rows III-1 and III-2: one mark finds the frames, and their energies add up.

use power_model::Pacing;
use traces::energy::PowerIntegral;
use traces::score::Score;

use super::super::figure::{POWER, TIME, dots, line};
use super::super::recording::{MARKED, Recording};
use super::super::row::{Kind, Row, Verdict, numbers};
use super::super::{Done, Figure};
use super::{Bench, settled};
use crate::run::RunError;

/// Least F1 at which starts count as found, set before the first run: all of them where V-sync helps, and that which is asked
/// of the finder in its worst case where it does not.
const FOUND: [f64; 2] = [0.99, 0.90];
/// Beyond this two sums are not the same.
const SAME: f64 = 1e-9;

/// III-1: one marked start finds the others, with V-sync and without.
pub(super) fn found(bench: &Bench<'_>) -> Result<Done, RunError> {
    let (capped, with) = scored(bench, bench.pc.capped()?, 1)?;
    let (free, without) = scored(bench, Pacing::FreeRunning, 5000)?;
    let row = Row {
        id: "III-1",
        kind: Kind::Number,
        claim: "one marked start finds the others",
        paper: "found by least squared difference; V-sync greatly simplifies the search, without it in most cases",
        ours: format!(
            "V-sync: precision {:.3}, recall {:.3} (worst recording {:.3}, {:.3}); without: {:.3}, {:.3} ({:.3}, {:.3}); {} recordings \
             of {} frames each, within 0.5 ms",
            with.mean[0],
            with.mean[1],
            with.worst[0],
            with.worst[1],
            without.mean[0],
            without.mean[1],
            without.worst[0],
            without.worst[1],
            bench.effort.repeats,
            bench.effort.recorded_frames
        ),
        verdict: Verdict::of(with.f1 >= FOUND[0] && without.f1 >= FOUND[1]),
        note: format!(
            "holds at a mean F1 of at least {} with and {} without V-sync; it is {:.3} and {:.3}",
            FOUND[0], FOUND[1], with.f1, without.f1
        ),
        numbers: numbers([
            ("vsync_f1", with.f1),
            ("vsync_precision", with.mean[0]),
            ("vsync_recall", with.mean[1]),
            ("vsync_worst_recall", with.worst[1]),
            ("free_f1", without.f1),
            ("free_precision", without.mean[0]),
            ("free_recall", without.mean[1]),
            ("free_worst_recall", without.worst[1]),
        ]),
        figure: None,
        figures: Vec::new(),
    };
    let figures = vec![
        shown_frames("III_fig3", "Two frames at 30 Hz (Paper III, Figure 3)", &capped, 2),
        shown_frames("III_fig4", "Three frames without V-sync (Paper III, Figure 4)", &free, 3),
    ];
    Ok(Done { row, figures })
}

/// How well starts were found over several recordings: precision and recall.
struct Found {
    mean: [f64; 2],
    worst: [f64; 2],
    f1: f64,
}

/// Recordings of the PC's animation with one mark each: the first, and how well all of them are found.
fn scored(bench: &Bench<'_>, pacing: Pacing, first_seed: u64) -> Result<(Recording, Found), RunError> {
    let mut first = None;
    let mut scores = Vec::new();
    for seed in first_seed..first_seed + bench.effort.repeats {
        let recording = bench.on_pc(pacing, settled(seed), 1)?;
        scores.push(recording.score());
        first.get_or_insert(recording);
    }
    let of = |rate: fn(&Score) -> f64| scores.iter().map(rate);
    let mean = |rate| of(rate).sum::<f64>() / scores.len() as f64;
    let worst = |rate| of(rate).fold(f64::INFINITY, f64::min);
    let found = Found {
        mean: [mean(Score::precision), mean(Score::recall)],
        worst: [worst(Score::precision), worst(Score::recall)],
        f1: mean(Score::f1),
    };
    let none = || RunError::Setting("no recording was asked for".to_owned());
    Ok((first.ok_or_else(none)?, found))
}

/// Some frames from the middle, with the starts that were found.
fn shown_frames(name: &'static str, title: &str, recording: &Recording, count: usize) -> Figure {
    let middle = recording.truth.frames.len() / 2;
    let (first, last) = (&recording.truth.frames[middle], &recording.truth.frames[middle + count - 1]);
    let margin_s = 0.05 * (last.end_s - first.start_s);
    let (from_s, to_s) = (first.start_s - margin_s, last.end_s + margin_s);
    let points = recording.points(from_s, to_s);
    let near = |time_s: f64| points.iter().find(|point| point.0 >= time_s).map_or(0.0, |point| point.1);
    let starts = recording.found.iter().map(|frame| frame.start_s);
    let starts = starts
        .filter(|start| (from_s..to_s).contains(start))
        .map(|start| (start - from_s, near(start - from_s)));
    let starts = dots("found starts", starts.collect());
    let subject = "the PC's animation, 32 lights in one pass";
    Figure::lines(name, title, subject, [TIME, POWER], vec![line("recorded", points.clone()), starts])
}

/// III-2: start-to-start energies sum to the whole, begin-to-finish ones do not.
pub(super) fn sums(bench: &Bench<'_>) -> Result<Done, RunError> {
    let capped = bench.on_pc(bench.pc.capped()?, settled(1), MARKED)?;
    let integral = PowerIntegral::new(&capped.trace);
    let whole_j = integral.energy_j(capped.found[0].start_s, capped.end_s);
    let new_j: f64 = capped.energies_j().iter().sum();
    let drawn_j = integral.energy_j(capped.truth.start_s, capped.truth.end_s);
    let old_j: f64 = capped.begin_to_finish_j().iter().sum();
    let [new, old] = [(new_j / whole_j - 1.0).abs(), 1.0 - old_j / drawn_j];
    let row = Row {
        id: "III-2",
        kind: Kind::Equality,
        claim: "start-to-start energies sum to the whole",
        paper: "no energy is unaccounted for from start to start; from begin to finish the sum is not the whole",
        ours: format!(
            "start to start {new_j:.6} J of {whole_j:.6} J, off by {new:.1e}; begin to finish {old_j:.3} J, short by {:.1} %",
            100.0 * old
        ),
        verdict: Verdict::of(new < SAME && old.abs() > SAME),
        note: format!(
            "holds within {SAME:.0e}; what the old method leaves out is the idle time before the next frame"
        ),
        numbers: numbers([
            ("whole_J", whole_j),
            ("start_to_start_J", new_j),
            ("relative_error", new),
            ("begin_to_finish_J", old_j),
            ("begin_to_finish_missing", old),
        ]),
        figure: None,
        figures: Vec::new(),
    };
    Ok(Done { row, figures: Vec::new() })
}
