//! A whole run: its frames without warm-up and outliers, by both rules for the end of a frame, and by passes.

use super::{FrameEnergy, Idle, Spread, energies_j, finishes_s, levels_w, outliers, warm_up};
use crate::io::{TraceReader, WriteError};
use thiserror::Error;
use warnings::{Code, Warning};

/// About how many samples the lowest power is taken from.
const LEVELS: u64 = 65_536;

/// A span of time, s.
type Span = (f64, f64);

/// How to evaluate a run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RunEnergyOptions {
    /// How many frames to discard at the beginning; by default as many as [`warm_up`] finds.
    pub discard: Option<usize>,
    /// Whether to leave out [`outliers`].
    pub drop_outliers: bool,
    /// Power, W, above which a frame is busy, for energies from begin to finish; by default a tenth of the
    /// way from the lowest power of the trace to the mean of the frames.
    pub busy_above_w: Option<f64>,
}

/// The frames of one run.
#[derive(Clone, Debug, PartialEq)]
pub struct RunEnergy {
    /// The remaining frames; idle energy is taken off.
    pub frames: Vec<FrameEnergy>,
    /// How many were discarded at the beginning.
    pub discarded: usize,
    /// How clearly the warm-up ends, see [`super::WarmUp`].
    pub warm_up_clearness: f64,
    /// Outliers among the frames that were not discarded.
    pub outliers: usize,
    /// Energy per frame from its start to the end of its work, J: the older rule.
    pub begin_to_finish_j: Spread,
}

/// A part of every frame, from its begin to that of the next pass, or to the end of the frame.
#[derive(Clone, Debug, PartialEq)]
pub struct FramePart {
    /// Name of the pass.
    pub name: String,
    /// When it begins, s after the start of the frame.
    pub begin_s: f64,
}

/// A pass that cannot be one of these frames.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum FramePartError {
    /// Two passes of one name.
    #[error("pass {name} is given twice: name each pass differently")]
    Twice {
        /// The name.
        name: String,
    },
    /// The pass begins in no frame.
    #[error(
        "pass {name} begins {begin_ms} ms after the start of its frame, but no frame is longer than {longest_ms:.3} ms; let it \
         begin before that"
    )]
    Beyond {
        /// The name.
        name: String,
        /// When it begins, ms after the start of a frame.
        begin_ms: f64,
        /// The longest frame, ms.
        longest_ms: f64,
    },
}

/// Refuses two passes of one name.
///
/// # Errors
/// [`FramePartError::Twice`].
pub fn check_parts(passes: &[FramePart]) -> Result<(), FramePartError> {
    let twice =
        |(index, pass): &(usize, &FramePart)| passes[..*index].iter().any(|other| other.name == pass.name);
    match passes.iter().enumerate().find(twice) {
        Some((_, pass)) => Err(FramePartError::Twice { name: pass.name.clone() }),
        None => Ok(()),
    }
}

impl FramePart {
    /// Warning if the pass begins in some of the frames only.
    ///
    /// # Errors
    /// [`FramePartError::Beyond`] if it begins in none.
    pub fn check(&self, frames: &[FrameEnergy]) -> Result<Option<Warning>, FramePartError> {
        let (name, begin_ms) = (&self.name, self.begin_s * 1e3);
        let beyond = frames.iter().filter(|frame| frame.duration_s() <= self.begin_s).count();
        if beyond == frames.len() {
            let longest_ms = frames.iter().map(FrameEnergy::duration_s).fold(0.0, f64::max) * 1e3;
            return Err(FramePartError::Beyond { name: name.clone(), begin_ms, longest_ms });
        }
        let message = || {
            let all = frames.len();
            format!(
                "{beyond} of {all} frames end before pass {name} begins, {begin_ms} ms after their start: it has no energy there"
            )
        };
        Ok((beyond > 0).then(|| Warning::new(Code::PassBeyond, message())))
    }
}

/// Why a run could not be evaluated.
#[derive(Debug, Error)]
pub enum RunEnergyError {
    /// The samples could not be read.
    #[error(transparent)]
    Read(#[from] WriteError),
    /// All frames were discarded.
    #[error("of {frames} frames none is left after {discarded} are discarded")]
    NoFrames {
        /// How many frames there were.
        frames: usize,
        /// How many were to be discarded.
        discarded: usize,
    },
}

impl RunEnergy {
    /// Evaluates the frames of a trace.
    ///
    /// # Errors
    /// [`RunEnergyError`] if the samples cannot be read, or no frame is left.
    pub fn of(
        trace: &dyn TraceReader,
        mut frames: Vec<FrameEnergy>,
        idle: Option<&Idle<'_>>,
        options: &RunEnergyOptions,
    ) -> Result<Self, RunEnergyError> {
        let start_s = trace.header().start_s;
        let all: Vec<f64> = frames.iter().map(|frame| frame.energy_j).collect();
        let warm = warm_up(&all);
        let discarded = options.discard.unwrap_or(warm.frames);
        let out = outliers(&all);
        let count = out.iter().skip(discarded).filter(|out| **out).count();
        let older = begin_to_finish_j(trace, &frames, idle, options.busy_above_w)?;
        if let Some(idle) = idle {
            idle.take_off(start_s, &mut frames);
        }
        let keep = |index: usize| index >= discarded && !(options.drop_outliers && out[index]);
        let kept: Vec<FrameEnergy> =
            frames.iter().enumerate().filter(|(index, _)| keep(*index)).map(|(_, frame)| *frame).collect();
        let older: Vec<f64> =
            older.into_iter().enumerate().filter(|(index, _)| keep(*index)).map(|(_, j)| j).collect();
        let none = RunEnergyError::NoFrames { frames: frames.len(), discarded };
        Ok(Self {
            frames: kept,
            discarded,
            warm_up_clearness: warm.clearness,
            outliers: count,
            begin_to_finish_j: Spread::of(&older).ok_or(none)?,
        })
    }

    /// Energies of the frames, J.
    pub fn energies_j(&self) -> Vec<f64> {
        self.frames.iter().map(|frame| frame.energy_j).collect()
    }
}

/// Energy of each frame from its start to the end of its work, J.
fn begin_to_finish_j(
    trace: &dyn TraceReader,
    frames: &[FrameEnergy],
    idle: Option<&Idle<'_>>,
    busy_above_w: Option<f64>,
) -> Result<Vec<f64>, WriteError> {
    let busy_w = match busy_above_w {
        Some(watts) => watts,
        None => busy_threshold_w(levels_w(trace, LEVELS)?, frames),
    };
    let finishes_s = finishes_s(trace, frames, busy_w)?;
    let spans: Vec<Span> = frames.iter().map(|frame| frame.start_s).zip(finishes_s).collect();
    without_idle_j(trace, &spans, idle)
}

/// A tenth of the way from the lowest to the mean power of the frames.
fn busy_threshold_w(mut powers: Vec<f64>, frames: &[FrameEnergy]) -> f64 {
    powers.sort_by(f64::total_cmp);
    let low = powers[powers.len() / 20];
    let mean = frames.iter().map(FrameEnergy::power_w).sum::<f64>() / frames.len().max(1) as f64;
    low + 0.1 * (mean - low).max(0.0)
}

/// Energies of spans less idle energy, J.
fn without_idle_j(
    trace: &dyn TraceReader,
    spans: &[Span],
    idle: Option<&Idle<'_>>,
) -> Result<Vec<f64>, WriteError> {
    let start_s = trace.header().start_s;
    let idle_j = |(a_s, b_s): Span| idle.map_or(0.0, |idle| idle.energy_j(start_s, a_s, b_s));
    let energies = energies_j(trace, spans)?.into_iter();
    Ok(energies.zip(spans).map(|(energy_j, span)| energy_j - idle_j(*span)).collect())
}

/// Energy of each pass, J. A pass called `before` is added if the first one does not begin with the frame, so
/// that the passes add up to the frames.
///
/// # Errors
/// [`WriteError::Read`] if the samples cannot be read.
pub fn parts_j(
    trace: &dyn TraceReader,
    frames: &[FrameEnergy],
    passes: &[FramePart],
    idle: Option<&Idle<'_>>,
) -> Result<Vec<(String, Spread)>, WriteError> {
    let mut passes = passes.to_vec();
    if passes.is_empty() {
        return Ok(Vec::new());
    }
    passes.sort_by(|a, b| a.begin_s.total_cmp(&b.begin_s));
    if passes[0].begin_s > 0.0 {
        passes.insert(0, FramePart { name: "before".to_owned(), begin_s: 0.0 });
    }
    let span = &|index: usize, frame: &FrameEnergy| {
        let at = |pass: &FramePart| (frame.start_s + pass.begin_s).min(frame.end_s);
        (at(&passes[index]), passes.get(index + 1).map_or(frame.end_s, at))
    };
    // Pass by pass, and all at once: the samples may have to be read again for each question.
    let of_pass = |index: usize| frames.iter().map(move |frame| span(index, frame));
    let spans: Vec<Span> = (0..passes.len()).flat_map(of_pass).collect();
    let energies = without_idle_j(trace, &spans, idle)?;
    let spreads = energies.chunks(frames.len()).map(Spread::of);
    Ok(passes.iter().zip(spreads).filter_map(|(pass, spread)| Some((pass.name.clone(), spread?))).collect())
}

/// Mean frames and pixels per joule. Inverse units cannot be averaged: these are inverses of the mean energy
/// (Paper II).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InverseUnits {
    /// Frames per joule.
    pub frames_per_j: f64,
    /// Pixels per joule, if the pixels of a frame are known.
    pub pixels_per_j: Option<f64>,
    /// The mean of frames per joule over all frames, which is wrong, for comparison.
    pub wrong_mean_of_frames_per_j: f64,
}

impl InverseUnits {
    /// The inverse units of some frames.
    pub fn of(frames: &[FrameEnergy], pixels: Option<u64>) -> Self {
        let energies: Vec<f64> = frames.iter().map(|frame| frame.energy_j).collect();
        let count = energies.len() as f64;
        let frames_per_j = count / energies.iter().sum::<f64>();
        Self {
            frames_per_j,
            pixels_per_j: pixels.map(|pixels| pixels as f64 * frames_per_j),
            wrong_mean_of_frames_per_j: energies.iter().map(|j| 1.0 / j).sum::<f64>() / count,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::energy::PowerIntegral;
    use crate::frames::Flags;
    use crate::trace::Metadata;
    use crate::trace::Trace;

    /// Ten frames of 100 samples at 1 kHz: 40 at 5 W, then 60 at 1 W.
    fn trace() -> Trace {
        let current = |sample: usize| if sample % 100 < 40 { 5.0 } else { 1.0 };
        let current_a = (0..1000).map(current).collect();
        Trace::new(vec![1.0; 1000], current_a, 1e3, 0.0, Metadata::default()).unwrap()
    }

    fn frames() -> Vec<FrameEnergy> {
        let frame = |index: u32| FrameEnergy {
            start_s: f64::from(index) * 0.1,
            end_s: f64::from(index + 1) * 0.1,
            energy_j: 0.26,
            confidence: 1.0,
            flags: Flags::default(),
        };
        (0..10).map(frame).collect()
    }

    #[test]
    fn both_rules_passes_and_idle_of_frames_known_in_closed_form() {
        let (trace, options) =
            (trace(), RunEnergyOptions { discard: Some(2), ..RunEnergyOptions::default() });
        let run = RunEnergy::of(&trace, frames(), None, &options).unwrap();
        assert_eq!((run.frames.len(), run.discarded), (8, 2));
        assert!((run.begin_to_finish_j.mean - 0.2).abs() < 1e-9, "{run:?}");
        let passes = [FramePart { name: "draws".to_owned(), begin_s: 0.02 }];
        let of = |idle: Option<&Idle<'_>>| parts_j(&trace, &run.frames, &passes, idle).unwrap();
        let [before, draws] = &of(None)[..] else { panic!("two passes") };
        assert_eq!((before.0.as_str(), draws.0.as_str()), ("before", "draws"));
        assert!((before.1.mean - 0.1).abs() < 1e-9 && (draws.1.mean - 0.16).abs() < 1e-9);
        assert!((of(Some(&Idle::Mean(1.0)))[1].1.mean - 0.08).abs() < 1e-9);
        assert!((PowerIntegral::new(&trace).total_j() - 2.6).abs() < 1e-9);
        assert!(parts_j(&trace, &run.frames, &[], None).unwrap().is_empty());
    }

    #[test]
    fn passes_have_names_of_their_own_and_begin_within_frames() {
        let pass = |name: &str, begin_s| FramePart { name: name.to_owned(), begin_s };
        assert_eq!(check_parts(&[pass("a", 0.0), pass("b", 0.1)]), Ok(()));
        let twice = check_parts(&[pass("a", 0.0), pass("b", 0.1), pass("a", 0.2)]).unwrap_err();
        assert_eq!(twice, FramePartError::Twice { name: "a".to_owned() });
        let mut frames = frames();
        frames[3].end_s = frames[3].start_s + 0.01;
        assert_eq!(pass("a", 0.005).check(&frames), Ok(None));
        let warning = pass("a", 0.05).check(&frames).unwrap().unwrap();
        assert!(warning.message.starts_with("1 of 10 frames end before pass a begins, 50 ms"), "{warning:?}");
        let error = pass("a", 0.2).check(&frames).unwrap_err().to_string();
        assert!(error.contains("begins 200 ms") && error.contains("longer than 100.000 ms"), "{error}");
    }

    #[test]
    fn a_run_whose_frames_are_all_discarded_is_refused() {
        let options = RunEnergyOptions { discard: Some(10), ..RunEnergyOptions::default() };
        let error = RunEnergy::of(&trace(), frames(), None, &options).unwrap_err();
        assert!(error.to_string().contains("of 10 frames none is left after 10"), "{error}");
    }

    #[test]
    fn inverse_units_are_those_of_the_mean_energy() {
        let mut frames = frames();
        frames.truncate(2);
        (frames[0].energy_j, frames[1].energy_j) = (0.1, 0.3);
        let units = InverseUnits::of(&frames, Some(1000));
        assert!((units.frames_per_j - 5.0).abs() < 1e-12);
        assert!((units.pixels_per_j.unwrap() - 5000.0).abs() < 1e-9);
        assert!((units.wrong_mean_of_frames_per_j - 20.0 / 3.0).abs() < 1e-12);
    }
}
