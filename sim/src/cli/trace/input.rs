//! Reading a trace, its marks and its frames, by the arguments.

use std::fs;
use std::path::Path;

use traces::energy::{FrameEnergy, PowerIntegral};
use traces::frames::{Found, Marks, Method, Options, Proposal, Window, find_with, propose};
use traces::io::{ReadOptions, Recording, Repair, Rows, TraceReader, open, rail_of_sums, read};
use traces::stream;
use traces::times::read_times;
use traces::trace::RATE_LIMITS_HZ;
use traces::{Metadata, Trace};

use super::failure::wrong;
use super::pipes::shown;
use crate::cli::Failure;
use crate::cli::args::trace::{FindArgs, InputArgs};
use output::terminal::Terminal;
use warnings::Code;

/// Traces of more samples are read in pieces.
const MAX_SAMPLES_IN_MEMORY: u64 = 1 << 24;
/// Texts of more bytes are read in pieces.
const MAX_BYTES_IN_MEMORY: u64 = 1 << 30;

impl InputArgs {
    pub(super) fn options(&self) -> Result<ReadOptions, Failure> {
        let [low, high] = RATE_LIMITS_HZ;
        if let Some(rate_hz) = self.rate.filter(|rate| !(low..=high).contains(rate)) {
            return Err(wrong(format!("--rate {rate_hz}: a rate has to be from {low:e} to {high:e} Hz")));
        }
        if self.power_column.is_some() && !self.rail.is_empty() {
            return Err(wrong("--rail chooses by name what --power-column chooses by hand: leave one out"));
        }
        let twice = |(index, rail): &(usize, &String)| {
            self.rail[..*index].iter().any(|other| other.eq_ignore_ascii_case(rail))
        };
        if let Some((_, rail)) = self.rail.iter().enumerate().find(twice) {
            return Err(wrong(format!("--rail {rail} is given twice: rails are added up, each once")));
        }
        Ok(ReadOptions {
            rails: self.rail.clone(),
            time: self.time_column.clone(),
            voltage: self.voltage_column.clone(),
            current: self.current_column.clone(),
            power: self.power_column.clone(),
            fixed_voltage_v: self.voltage,
            rate_hz: self.rate,
            start_s: self.start,
            delimiter: None,
            header: self.no_header.then_some(false),
            repair: self.repair,
        })
    }

    /// The whole trace in memory. Repairs are reported.
    pub(super) fn load(&self, terminal: &Terminal) -> Result<(Trace, Vec<Repair>), Failure> {
        self.load_other(&self.trace, terminal)
    }

    /// Another trace, read in the same way.
    pub(super) fn load_other(
        &self,
        path: &Path,
        terminal: &Terminal,
    ) -> Result<(Trace, Vec<Repair>), Failure> {
        let loaded = read(path, &self.options()?)?;
        self.warn_of_sums(path, terminal)?;
        note_repairs(path, &loaded.repairs, terminal);
        Ok((loaded.trace, loaded.repairs))
    }

    /// The trace, of any length: read in pieces, or in memory where it has to be repaired. Repairs are reported.
    pub(super) fn source(&self, terminal: &Terminal) -> Result<(Box<dyn TraceReader>, Vec<Repair>), Failure> {
        let (trace, repairs) = open(&self.trace, &self.options()?)?;
        self.warn_of_sums(&self.trace, terminal)?;
        note_repairs(&self.trace, &repairs, terminal);
        Ok((trace, repairs))
    }

    /// Warns of a rail that is added to those that it is the sum of.
    pub(super) fn warn_of_sums(&self, path: &Path, terminal: &Terminal) -> Result<(), Failure> {
        if !self.rail.is_empty() {
            return Ok(());
        }
        if let Some(sum) = rail_of_sums(path, &self.options()?)? {
            let others: Vec<String> = sum.others.iter().map(|rail| format!("--rail {rail}")).collect();
            let alone = if sum.rail.is_empty() { String::new() } else { format!("--rail {}, or ", sum.rail) };
            terminal.warn_of(Code::RailCountedTwice, &format!("{sum}: give {alone}{}", others.join(" ")));
        }
        Ok(())
    }
}

fn note_repairs(path: &Path, repairs: &[Repair], terminal: &Terminal) {
    for repair in repairs {
        terminal.note(&format!("{}: repaired: {}", shown(path), repair.message));
    }
}

/// Frames, found in memory or in pieces.
pub(super) struct Frames {
    pub found: Found,
    pub energies: Vec<FrameEnergy>,
    pub metadata: Metadata,
    pub samples: u64,
    pub rate_hz: f64,
    pub start_s: f64,
    pub total_j: f64,
    pub proposal: Option<Proposal>,
    pub repairs: Vec<Repair>,
}

impl Frames {
    pub(super) fn warn(&self, terminal: &Terminal) {
        let warnings = self.found.warnings.iter();
        warnings.for_each(|warning| terminal.warn_of(warning.code, &warning.message));
    }
}

impl FindArgs {
    /// Finds frames in memory, or in pieces where the trace is long.
    pub(super) fn frames(
        &self,
        input: &InputArgs,
        path: &Path,
        terminal: &Terminal,
    ) -> Result<Frames, Failure> {
        if self.streams(input, path)? {
            return self.in_pieces(input, path, terminal);
        }
        let (trace, repairs) = input.load_other(path, terminal)?;
        self.at_once(&trace, repairs)
    }

    /// As [`FindArgs::frames`], with the samples they were found in.
    pub(super) fn frames_and_samples(
        &self,
        input: &InputArgs,
        path: &Path,
        terminal: &Terminal,
    ) -> Result<(Frames, Box<dyn TraceReader>), Failure> {
        if self.streams(input, path)? {
            let recording = Recording::open(path, &input.options()?)?;
            return Ok((self.in_pieces(input, path, terminal)?, Box::new(recording)));
        }
        let (trace, repairs) = input.load_other(path, terminal)?;
        Ok((self.at_once(&trace, repairs)?, Box::new(trace)))
    }

    fn at_once(&self, trace: &Trace, repairs: Vec<Repair>) -> Result<Frames, Failure> {
        let (found, proposal) = self.found(trace)?;
        let integral = PowerIntegral::new(trace);
        Ok(Frames {
            energies: integral.frames(&found),
            found,
            samples: trace.samples() as u64,
            rate_hz: trace.rate_hz(),
            start_s: trace.start_s(),
            total_j: integral.total_j(),
            proposal,
            repairs,
            metadata: trace.metadata.clone(),
        })
    }

    fn streams(&self, input: &InputArgs, path: &Path) -> Result<bool, Failure> {
        if matches!(self.method, Method::Tracking | Method::Normalized) || input.repair {
            return if self.stream {
                Err(wrong("--stream goes with the sum of squares and without --repair; leave one out"))
            } else {
                Ok(false)
            };
        }
        let rows = Rows::open(path, &input.options()?)?;
        let bytes = fs::metadata(path).map_or(0, |metadata| metadata.len());
        Ok(self.stream
            || rows.count().map_or(bytes > MAX_BYTES_IN_MEMORY, |count| count > MAX_SAMPLES_IN_MEMORY))
    }

    fn in_pieces(&self, input: &InputArgs, path: &Path, terminal: &Terminal) -> Result<Frames, Failure> {
        let options = input.options()?;
        if self.auto {
            return Err(wrong("--auto looks at traces that fit into memory; mark a frame with --mark"));
        }
        let rows = Rows::open(path, &options)?;
        let starts_s = self.marks(rows.metadata())?;
        let end_s = self.end.or_else(|| rows.metadata().end_mark_s()).unwrap_or(f64::INFINITY);
        let marks = Marks { starts_s, window: self.window_s(), end_s };
        let streamed = stream::find(path, &options, &marks)?;
        input.warn_of_sums(path, terminal)?;
        let clock = streamed.clock;
        Ok(Frames {
            found: streamed.found,
            energies: streamed.energies,
            metadata: streamed.metadata,
            samples: clock.samples.unwrap_or(0),
            rate_hz: clock.rate_hz,
            start_s: clock.start_s,
            total_j: streamed.total_j,
            proposal: None,
            repairs: Vec::new(),
        })
    }

    /// Frames of a trace in memory, where nothing is read in pieces.
    pub(super) fn found_at_once(&self, trace: &Trace) -> Result<Found, Failure> {
        if self.stream {
            return Err(wrong("--stream: to draw frames, all samples are held; leave it out"));
        }
        Ok(self.found(trace)?.0)
    }

    /// Frames of a trace in memory.
    fn found(&self, trace: &Trace) -> Result<(Found, Option<Proposal>), Failure> {
        let proposal = if self.auto {
            let none = || wrong("--auto found no rise of power to propose as a start: mark one with --mark");
            Some(propose(trace).ok_or_else(none)?)
        } else {
            None
        };
        let starts_s = match &proposal {
            Some(proposal) => vec![proposal.mark_s],
            None => self.marks(&trace.metadata)?,
        };
        let end_s = self.end.or_else(|| trace.metadata.end_mark_s()).unwrap_or(trace.end_s());
        let marks = Marks { starts_s, window: self.window_s(), end_s };
        Ok((find_with(trace, &marks, &Options { method: self.method })?, proposal))
    }

    fn window_s(&self) -> Window {
        let (pre_s, post_s) = self.window;
        Window { pre_s, post_s }
    }

    fn marks(&self, metadata: &Metadata) -> Result<Vec<f64>, Failure> {
        let mut marks = self.mark.clone();
        if let Some(path) = &self.mark_file {
            marks.extend(read_times(path)?);
        }
        if marks.is_empty() {
            marks.extend(metadata.frame_starts_s());
        }
        if marks.is_empty() {
            return Err(wrong("no frame start is marked: give --mark SECONDS, --mark-file FILE or --auto"));
        }
        marks.sort_by(f64::total_cmp);
        marks.dedup();
        Ok(marks)
    }
}
