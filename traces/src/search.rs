//! Frames of a recording with their energies: in memory, or in pieces where the file is long.

use crate::energy::{FrameEnergy, PowerIntegral, clipped_current, negative_power};
use crate::frames::{
    FinderMethod, FinderOptions, Found, MarkError, Marks, Proposal, Window, default_window, find_with,
    propose, repetition_samples,
};
use crate::io::{ReadError, ReadOptions, Rows};
use crate::stream::{self, AnalysisError};
use crate::trace::{Metadata, Trace};
use std::path::Path;
use thiserror::Error;

/// Traces of more samples are read in pieces.
const MAX_SAMPLES_IN_MEMORY: u64 = 1 << 24;
/// Files that state no number of samples are read in pieces from this size on, in bytes.
const MAX_BYTES_IN_MEMORY: u64 = 1 << 30;

/// Which frames to find, and how.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameSearch {
    /// Marked starts, s; without any, those of the trace's metadata.
    pub starts_s: Vec<f64>,
    /// Whether to [propose](propose()) a start instead.
    pub propose: bool,
    /// The window around a mark; by default the usual one, no longer than the time after which power repeats.
    /// Files that are read in pieces have the usual one.
    pub window: Option<Window>,
    /// Where the last frame ends, s; by default the end mark of the metadata, or the end of the trace.
    pub end_s: Option<f64>,
    /// The method.
    pub method: FinderMethod,
    /// Whether to read in pieces what would fit into memory.
    pub in_pieces: bool,
}

/// Frames of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameSet {
    /// The frames.
    pub found: Found,
    /// Energies of the frames, in order.
    pub energies: Vec<FrameEnergy>,
    /// The metadata of the trace.
    pub metadata: Metadata,
    /// Number of samples of the trace.
    pub samples: u64,
    /// Samples per second.
    pub rate_hz: f64,
    /// Left edge of the first sample, s.
    pub start_s: f64,
    /// Energy of the whole trace, J.
    pub total_j: f64,
    /// The proposed start, where one was to be proposed.
    pub proposal: Option<Proposal>,
    /// Whether the last frame ends with the trace, not at an end mark.
    pub ends_with_trace: bool,
}

/// Reason why no frames were found.
#[derive(Debug, Error)]
pub enum SearchError {
    /// The file.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The marks.
    #[error(transparent)]
    Mark(#[from] MarkError),
    /// Neither a mark nor one in the metadata.
    #[error("no frame start is marked")]
    Unmarked,
    /// The trace has no rise of power.
    #[error("found no rise of power to propose as a start")]
    NoRise,
    /// The proposed start is the only one of its kind.
    #[error(
        "found no start that comes back: nothing else resembles the steepest rises, such as that at {mark_s} s"
    )]
    NoRepetition {
        /// The proposal, s.
        mark_s: f64,
    },
    /// A start is proposed in memory only.
    #[error("a start is proposed only for traces that fit into memory")]
    ProposalInPieces,
    /// A method or a repair that needs all samples at once.
    #[error("squares and normalized read in pieces, tracking and repair do not")]
    NotInPieces,
}

impl From<AnalysisError> for SearchError {
    fn from(error: AnalysisError) -> Self {
        match error {
            AnalysisError::Read(error) => Self::Read(error),
            AnalysisError::Mark(error) => Self::Mark(error),
        }
    }
}

impl FrameSearch {
    /// Whether a file is to be read in pieces, by [`FrameSearch::of_file`].
    ///
    /// # Errors
    /// [`SearchError::NotInPieces`] if it is requested but not possible; [`SearchError::Read`].
    pub fn reads_in_pieces(&self, path: &Path, options: &ReadOptions) -> Result<bool, SearchError> {
        if self.method == FinderMethod::Tracking || options.repair {
            return if self.in_pieces { Err(SearchError::NotInPieces) } else { Ok(false) };
        }
        let bytes = || std::fs::metadata(path).map_or(0, |metadata| metadata.len());
        let is_long = |rows: Rows| match rows.count() {
            Some(count) => count > MAX_SAMPLES_IN_MEMORY,
            None => bytes() > MAX_BYTES_IN_MEMORY,
        };
        let rows = Rows::open(path, options)?;
        Ok(self.in_pieces || is_long(rows))
    }

    /// Frames of a trace in memory.
    ///
    /// # Errors
    /// [`SearchError`] if the marks are not in the trace, or no start is found.
    pub fn of_trace(&self, trace: &Trace) -> Result<FrameSet, SearchError> {
        let proposal = self.propose.then(|| propose(trace).ok_or(SearchError::NoRise)).transpose()?;
        let starts_s = match &proposal {
            Some(proposal) => vec![proposal.mark_s],
            None => self.marked(&trace.metadata)?,
        };
        let marked_end_s = self.end_s.or_else(|| trace.metadata.end_mark_s());
        let end_s = marked_end_s.unwrap_or(trace.end_s());
        let power: Vec<f64> = trace.powers_w().collect();
        let repetition_s = repetition_samples(&power).map(|samples| samples as f64 * trace.period_s());
        let window =
            self.window.unwrap_or_else(|| default_window(repetition_s.unwrap_or(0.0), trace.rate_hz()));
        let marks = Marks { starts_s, window, end_s };
        let mut found = find_with(trace, &marks, &FinderOptions { method: self.method, without: None })?;
        if let Some(Proposal { mark_s, .. }) = proposal.filter(|_| found.starts.len() < 2) {
            return Err(SearchError::NoRepetition { mark_s });
        }
        let integral = PowerIntegral::new(trace);
        found.warnings.extend(negative_power(integral.total_j()));
        found.warnings.extend(clipped_current(trace));
        found.warn_of_long_window(repetition_s);
        Ok(FrameSet {
            energies: integral.frames(&found),
            found,
            metadata: trace.metadata.clone(),
            samples: trace.samples() as u64,
            rate_hz: trace.rate_hz(),
            start_s: trace.start_s(),
            total_j: integral.total_j(),
            proposal,
            ends_with_trace: marked_end_s.is_none(),
        })
    }

    /// Frames of a file of any length, read in pieces.
    ///
    /// # Errors
    /// [`SearchError`] if the file cannot be read, or the marks are not in it.
    pub fn of_file(&self, path: &Path, options: &ReadOptions) -> Result<FrameSet, SearchError> {
        if self.propose {
            return Err(SearchError::ProposalInPieces);
        }
        let rows = Rows::open(path, options)?;
        let starts_s = self.marked(rows.metadata())?;
        let marked_end_s = self.end_s.or_else(|| rows.metadata().end_mark_s());
        let end_s = marked_end_s.unwrap_or(f64::INFINITY);
        let window = self.window.unwrap_or_else(|| default_window(0.0, f64::INFINITY));
        let marks = Marks { starts_s, window, end_s };
        let mut streamed = stream::find(path, options, &marks, self.method)?;
        streamed.found.warnings.extend(negative_power(streamed.total_j));
        let clock = streamed.clock;
        Ok(FrameSet {
            found: streamed.found,
            energies: streamed.energies,
            metadata: streamed.metadata,
            samples: clock.samples.unwrap_or(0),
            rate_hz: clock.rate_hz,
            start_s: clock.start_s,
            total_j: streamed.total_j,
            proposal: None,
            ends_with_trace: marked_end_s.is_none(),
        })
    }

    /// The marked starts, sorted, each once.
    fn marked(&self, metadata: &Metadata) -> Result<Vec<f64>, SearchError> {
        let mut marks = self.starts_s.clone();
        if marks.is_empty() {
            marks.extend(metadata.frame_starts_s());
        }
        if marks.is_empty() {
            return Err(SearchError::Unmarked);
        }
        marks.sort_by(f64::total_cmp);
        marks.dedup();
        Ok(marks)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::energy::whole;
    use crate::io::parquet;
    use crate::trace::{Mark, MarkKind};

    const PERIOD_S: f64 = 0.01;

    /// 20 frames of 50 samples at 5 kHz from 0.1 s on: 4 ms at 20 W falling to 12 W, then 2 W.
    fn trace(marks: Vec<Mark>) -> Trace {
        let watts = |i: usize| match i.checked_sub(500).map(|since| since % 50) {
            Some(within) if i < 1500 && within < 20 => 20.0 - 0.4 * within as f32,
            _ => 2.0 + 1e-3 * (i * 7919 % 101) as f32,
        };
        let metadata = Metadata { marks, ..Metadata::default() };
        Trace::new(vec![1.0; 1600], (0..1600).map(watts).collect(), 5e3, 0.0, metadata).unwrap()
    }

    fn search() -> FrameSearch {
        FrameSearch {
            starts_s: Vec::new(),
            propose: false,
            window: Some(Window { pre_s: 1e-3, post_s: 4e-3 }),
            end_s: None,
            method: FinderMethod::SumOfSquares,
            in_pieces: false,
        }
    }

    #[test]
    fn marks_of_the_caller_go_before_those_of_the_metadata() {
        let marks = vec![Mark { time_s: 0.15, kind: MarkKind::FrameStart, label: String::new() }];
        let set = search().of_trace(&trace(marks.clone())).unwrap();
        assert_eq!(set.energies.len(), 20);
        assert!((set.energies[3].duration_s() - PERIOD_S).abs() < 1e-5);
        let given = FrameSearch { starts_s: vec![0.12, 0.11, 0.12], ..search() };
        assert_eq!(given.marked(&Metadata::default()).unwrap(), [0.11, 0.12]);
        assert_eq!(given.marked(&trace(marks).metadata).unwrap(), [0.11, 0.12]);
        assert!(matches!(search().of_trace(&trace(Vec::new())), Err(SearchError::Unmarked)));
    }

    #[test]
    fn a_reversed_current_is_warned_about() {
        let all = trace(Vec::new());
        let reversed = all.current_a().iter().map(|amperes| -amperes).collect();
        let reversed = Trace::new(vec![1.0; 1600], reversed, 5e3, 0.0, Metadata::default()).unwrap();
        let marked = FrameSearch { starts_s: vec![0.15], ..search() };
        let negative = |trace: &Trace| {
            let set = marked.of_trace(trace).unwrap();
            set.found.warnings.iter().any(|warning| warning.code == "negative-power")
        };
        assert!(negative(&reversed) && !negative(&all));
    }

    #[test]
    fn a_last_frame_that_the_recording_cuts_is_not_whole_and_one_before_an_end_mark_is() {
        // The trace without what follows 27 of the 50 samples of its last frame.
        let all = trace(Vec::new());
        let cut =
            Trace::new(vec![1.0; 1477], all.current_a()[..1477].to_vec(), 5e3, 0.0, Metadata::default())
                .unwrap();
        let marked = FrameSearch { starts_s: vec![0.15], ..search() };
        let set = marked.of_trace(&cut).unwrap();
        assert_eq!((set.energies.len(), whole(&set.energies, set.ends_with_trace).len()), (20, 19));
        let set = FrameSearch { end_s: Some(0.2954), ..marked }.of_trace(&cut).unwrap();
        assert_eq!((set.energies.len(), whole(&set.energies, set.ends_with_trace).len()), (20, 20));
    }

    #[test]
    fn a_file_in_pieces_has_the_frames_of_the_trace_in_memory() {
        let folder = tempfile::tempdir().unwrap();
        let (path, options) = (folder.path().join("t.parquet"), ReadOptions::default());
        parquet::save(&trace(Vec::new()), &path).unwrap();
        let marked = FrameSearch { starts_s: vec![0.15], in_pieces: true, ..search() };
        let (whole, pieces) =
            (marked.of_trace(&trace(Vec::new())).unwrap(), marked.of_file(&path, &options).unwrap());
        assert_eq!((pieces.samples, pieces.rate_hz, pieces.start_s), (1600, 5e3, 0.0));
        assert!((pieces.total_j / whole.total_j - 1.0).abs() < 1e-12);
        for (ours, theirs) in pieces.energies.iter().zip(&whole.energies) {
            assert!((ours.start_s - theirs.start_s).abs() < 1e-8);
        }
        assert_eq!(pieces.energies.len(), 20);
        assert!(marked.reads_in_pieces(&path, &options).unwrap());
        assert!(!search().reads_in_pieces(&path, &options).unwrap());
        let tracking = FrameSearch { method: FinderMethod::Tracking, ..marked.clone() };
        assert!(matches!(tracking.reads_in_pieces(&path, &options), Err(SearchError::NotInPieces)));
        let proposing = FrameSearch { propose: true, ..marked };
        assert!(matches!(proposing.of_file(&path, &options), Err(SearchError::ProposalInPieces)));
    }

    #[test]
    fn a_proposal_has_to_come_back() {
        let set = FrameSearch { propose: true, ..search() }.of_trace(&trace(Vec::new())).unwrap();
        assert!(set.proposal.is_some() && set.energies.len() > 10);
        // One frame between noise.
        let random = crate::stats::Random::new(1, 0);
        let watts = |i: u64| {
            let busy = (10_000..10_400).contains(&i);
            let level = if busy { 3.0 + libm::sin(i as f64 / 17.0) } else { 0.5 };
            (level + 0.1 * (random.uniform(i) - 0.5)) as f32
        };
        let watts = (0..20_000).map(watts).collect();
        let once = Trace::new(vec![1.0; 20_000], watts, 50e3, 0.0, Metadata::default()).unwrap();
        let found = FrameSearch { propose: true, ..search() }.of_trace(&once);
        assert!(matches!(found, Err(SearchError::NoRepetition { .. })));
    }
}
