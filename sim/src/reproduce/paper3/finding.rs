//! Rows III-1 and III-2: one mark finds the frames, and their energies add up.

use power_model::Pacing;
use traces::energy::PowerIntegral;

use super::super::figure::{POWER, TIME, dots, line};
use super::super::recording::{Recording, looped};
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
pub(super) fn found(bench: &Bench<'_>, capped: &Recording) -> Result<Done, RunError> {
    let shown = looped(&bench.pc_frames, bench.effort.recorded_frames);
    bench.bar.inc();
    let free = Recording::new(&bench.pc, &shown, Pacing::FreeRunning, settled(2))?;
    let (with, without) = (capped.score(), free.score());
    let row = Row {
        id: "III-1",
        kind: Kind::Number,
        claim: "one marked start finds the others",
        paper: "found by least squared difference; V-sync greatly simplifies the search, without it in most cases",
        ours: format!(
            "V-sync: precision {:.3}, recall {:.3}; without: {:.3}, {:.3} ({} frames each, within 0.5 ms)",
            with.precision(),
            with.recall(),
            without.precision(),
            without.recall(),
            with.truth
        ),
        verdict: Verdict::of(with.f1() >= FOUND[0] && without.f1() >= FOUND[1]),
        note: format!("holds at F1 of at least {} with and {} without V-sync", FOUND[0], FOUND[1]),
        numbers: numbers([
            ("vsync_precision", with.precision()),
            ("vsync_recall", with.recall()),
            ("vsync_worst_timing_error_s", with.worst_timing_error_s().unwrap_or(f64::NAN)),
            ("free_precision", without.precision()),
            ("free_recall", without.recall()),
            ("free_worst_timing_error_s", without.worst_timing_error_s().unwrap_or(f64::NAN)),
        ]),
        figure: None,
        figures: Vec::new(),
    };
    let figures = vec![
        shown_frames("III_fig3", "Two frames at 30 Hz (Paper III, Figure 3)", capped, 2),
        shown_frames("III_fig4", "Three frames without V-sync (Paper III, Figure 4)", &free, 3),
    ];
    Ok(Done { row, figures })
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
pub(super) fn sums(capped: &Recording) -> Done {
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
    Done { row, figures: Vec::new() }
}
