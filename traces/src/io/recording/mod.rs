//! A file that is read in pieces, as often as its samples are asked for.

use super::rows::{Chunk, Rows};
use super::source::{Heading, Sink, Source, Stretch};
use super::timing::{Fit, Fitted};
use super::{ReadError, ReadOptions, Repair, WriteError};
use crate::metadata::Metadata;
use crate::trace::check_times;
use std::path::{Path, PathBuf};

/// Rows read at once.
const PIECE: usize = 1 << 18;

/// A file that was looked through once and is a trace: finite samples at an even rate, as many as it says. It holds what
/// [`read`](super::read()) would have made of it, but for the samples.
#[derive(Clone, Debug)]
pub struct Recording {
    path: PathBuf,
    options: ReadOptions,
    /// Rows read at once.
    piece: usize,
    heading: Heading,
    repairs: Vec<Repair>,
}

impl Recording {
    /// Reads a file through, once.
    ///
    /// # Errors
    /// [`ReadError`] as [`read`](super::read()) without [`ReadOptions::repair`]: what is to be mended needs the whole trace.
    pub fn open(path: &Path, options: &ReadOptions) -> Result<Self, ReadError> {
        Self::in_pieces(path, options, PIECE)
    }

    fn in_pieces(path: &Path, options: &ReadOptions, piece: usize) -> Result<Self, ReadError> {
        let seen = Seen::of(path, options, piece, None)?;
        let Fitted { mut grid, sure } = seen.fit.conclude()?;
        if !sure {
            grid = Seen::of(path, options, piece, Some(grid.rate_hz))?.fit.conclude()?.grid;
        }
        check_times(seen.rows, grid.rate_hz, grid.start_s).map_err(|error| ReadError::trace(path, error))?;
        if let Some(error) = seen.voltage.or(seen.current).or(seen.end) {
            return Err(error);
        }
        let heading = Heading {
            start_s: grid.start_s,
            rate_hz: grid.rate_hz,
            samples: seen.rows,
            lost_samples: 0,
            lost_at_end: 0,
            metadata: seen.metadata,
        };
        Ok(Self { path: path.to_owned(), options: options.clone(), piece, heading, repairs: seen.repairs })
    }

    /// What was mended as the file was looked through.
    pub fn repairs(&self) -> &[Repair] {
        &self.repairs
    }

    fn changed(&self) -> WriteError {
        WriteError::Read(ReadError::Changed { path: self.path.clone() })
    }
}

/// What one look at all rows shows.
struct Seen {
    fit: Fit,
    rows: u64,
    metadata: Metadata,
    repairs: Vec<Repair>,
    /// The first value of each channel that is not finite.
    voltage: Option<ReadError>,
    current: Option<ReadError>,
    /// What is wrong with the end of a recording that is whole up to there.
    end: Option<ReadError>,
}

impl Seen {
    fn of(path: &Path, options: &ReadOptions, limit: usize, rate_hz: Option<f64>) -> Result<Self, ReadError> {
        let mut rows = Rows::open(path, options)?;
        let mut fit = Fit::new(path, rate_hz.or(rows.header.rate_hz), rows.header.start_s);
        let (mut voltage, mut current, mut count) = (None, None, 0);
        let (mut chunk, mut piece) = (Chunk::default(), Piece::default());
        while piece.read(&mut rows, limit, &mut chunk)? > 0 {
            fit.push(&chunk.stamps);
            voltage = voltage.or_else(|| rows.check_finite(&piece.voltage_v, &[], count).err());
            current = current.or_else(|| rows.check_finite(&[], &piece.current_a, count).err());
            count += piece.voltage_v.len() as u64;
        }
        if count == 0 {
            return Err(ReadError::Empty { path: path.to_owned() });
        }
        rows.header.check_rows(path, count)?;
        let (repairs, end) = (rows.repair().into_iter().collect(), rows.header.check_end(path).err());
        Ok(Self { fit, rows: count, metadata: rows.header.metadata, repairs, voltage, current, end })
    }
}

/// The samples at hand.
#[derive(Default)]
struct Piece {
    voltage_v: Vec<f32>,
    current_a: Vec<f32>,
}

impl Piece {
    /// Reads the next samples over those before; how many rows there were, 0 at the end.
    fn read(&mut self, rows: &mut Rows, limit: usize, chunk: &mut Chunk) -> Result<usize, ReadError> {
        self.voltage_v.clear();
        self.current_a.clear();
        rows.append(limit, chunk, &mut self.voltage_v, &mut self.current_a)
    }
}

impl Source for Recording {
    fn heading(&self) -> Heading {
        self.heading.clone()
    }

    fn pour(&self, sink: &mut dyn Sink) -> Result<(), WriteError> {
        let mut rows = Rows::open(&self.path, &self.options)?;
        let (mut piece, mut coming, mut chunk) = (Piece::default(), Piece::default(), Chunk::default());
        let (mut first, mut read) = (0, piece.read(&mut rows, self.piece, &mut chunk)?);
        while read > 0 {
            let Piece { voltage_v, current_a } = &piece;
            if rows.check_finite(voltage_v, current_a, first).is_err() {
                return Err(self.changed());
            }
            let stretch = Stretch { first, voltage_v, current_a, lost: false };
            // The next rows are decoded while these are taken.
            let (next, taken) =
                rayon::join(|| coming.read(&mut rows, self.piece, &mut chunk), || sink.take(&stretch));
            taken?;
            (first, read) = (first + stretch.len() as u64, next?);
            std::mem::swap(&mut piece, &mut coming);
        }
        if first == self.heading.samples { Ok(()) } else { Err(self.changed()) }
    }
}

#[cfg(test)]
mod tests;
