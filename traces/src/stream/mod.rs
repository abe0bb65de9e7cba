//! Frames of a file that need not fit into memory: one pass, in pieces, on all threads.
//!
//! The method is the sum of squares of [`frames`](crate::frames), the same minima and the same threshold. What differs:
//! offsets are screened by a transform in f32, and the distance of every minimum, its place finer than a sample and the
//! energy up to there are worked out in f64 while its samples are at hand. No step depends on how many threads there are.

mod clock;
mod conclude;
mod error;
mod minima;
mod pass;
mod piece;
mod screen;
mod template;
mod workspace;

pub use clock::{Clock, clock};
pub use error::StreamError;

use crate::energy::FrameEnergy;
use crate::frames::{Found, Marks};
use crate::io::{ReadOptions, Rows};
use crate::metadata::Metadata;
use std::path::Path;

/// Frames of a file with their energies.
#[derive(Clone, Debug, PartialEq)]
pub struct Streamed {
    /// The frames.
    pub found: Found,
    /// Their energies, in order.
    pub energies: Vec<FrameEnergy>,
    /// When samples were taken, and how many.
    pub clock: Clock,
    /// Energy of the whole trace, J.
    pub total_j: f64,
    /// What the file says of itself.
    pub metadata: Metadata,
}

/// Finds frames by the sum of squares and takes their energies. An infinite `marks.end_s` stands for the end of the
/// file.
///
/// # Errors
/// [`StreamError`] if the file cannot be read, its samples are not even or finite, or the marks are not in it.
pub fn find(path: &Path, options: &ReadOptions, marks: &Marks) -> Result<Streamed, StreamError> {
    let clock = clock(path, options)?;
    let plan = pass::Plan::new(path, options, marks, clock)?;
    let mut rows = Rows::open(path, options)?;
    let gathered = plan.gather(&mut rows)?;
    rows.header.check_rows(path, gathered.samples)?;
    rows.header.check_end(path)?;
    Ok(conclude::conclude(plan, marks, gathered, rows.header.metadata)?)
}

#[cfg(test)]
mod tests;
