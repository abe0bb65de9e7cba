//! Rows of JLS version 2, what Joulescope instruments record: each signal by a reader of its own, all of them at once.
//!
//! A file is a row of chunks; those of one kind are linked. Signals are defined in one list, and each has a list of its
//! data, with indices and summaries above it ([`format`](crate::io::jls::format)). Summaries, annotations and UTC are not
//! read.

mod chunk;
mod notes;
mod sample;
mod signal;
#[cfg(test)]
mod tests;
mod track;

use super::Chunk;
use crate::io::columns::{Layout, layout};
use crate::io::header::Header;
use crate::io::timing::Stamps;
use crate::io::{ReadError, ReadOptions, Repair};
use chunk::ChunkFile;
use rayon::prelude::*;
use signal::Definitions;
use std::path::Path;
use track::Track;

/// A JLS file being read.
pub(super) struct JlsRows {
    names: Vec<String>,
    tracks: Vec<Track>,
    count: u64,
    /// What was left out so that signals make up rows.
    cut: Option<Repair>,
}

impl JlsRows {
    pub fn open(path: &Path, options: &ReadOptions) -> Result<(Self, Layout, Header), ReadError> {
        let mut file = ChunkFile::open(path)?;
        let definitions = Definitions::read(&mut file)?;
        let names = definitions.names();
        let mut layout = layout(path, &names, options)?;
        // Rates are fixed: no signal holds times.
        layout.time = None;
        let mut tracks = Vec::with_capacity(layout.values.len());
        for picked in &mut layout.values {
            let signal = &definitions.signals[picked.index];
            picked.scale = signal.scale().unwrap_or(picked.scale);
            tracks.push(Track::open(path, signal)?);
        }
        let cut = if options.repair {
            cut(path, &mut tracks)?
        } else {
            check_alike(path, &tracks).map(|()| None)?
        };
        let count = tracks.first().map_or(0, Track::left);
        let mut header = Header::default();
        if let (Some(track), Some(picked)) = (tracks.first(), layout.values.first()) {
            header.metadata.device = definitions.device(&definitions.signals[picked.index]);
            let described = notes::description(&mut file)?.unwrap_or(header);
            header = notes::placed(described, f64::from(track.rate_hz), track.at());
            header.rate_hz = header.rate_hz.filter(|&rate_hz| rate_hz > 0.0);
        }
        Ok((Self { names, tracks, count, cut }, layout, header))
    }

    pub fn names(&self) -> &[String] {
        &self.names
    }

    pub fn count(&self) -> u64 {
        self.count
    }

    /// What was left out, and when, by the description's rate and start.
    pub fn cut(&self, header: &Header) -> Option<Repair> {
        let mut cut = self.cut.clone()?;
        cut.time_s = header.time_s(cut.row as usize - 1);
        cut.message += &format!("; row {} is at {} s", cut.row, cut.time_s);
        Some(cut)
    }

    pub fn skip(&mut self, rows: u64) -> Result<(), ReadError> {
        self.tracks.iter_mut().try_for_each(|track| track.skip(rows))
    }

    pub fn next(&mut self, limit: usize, chunk: &mut Chunk) -> Result<usize, ReadError> {
        chunk.stamps = Stamps::Absent;
        let each = self.tracks.par_iter_mut().zip(&mut chunk.values);
        let read: Vec<_> = each.map(|(track, list)| track.values(limit, list)).collect();
        // All have as many: each was held against its own number, and the numbers are alike.
        read.into_iter().try_fold(0, |_, rows| rows)
    }
}

/// Leaves of signals of one rate, which need not begin and end together, what all have.
fn cut(path: &Path, tracks: &mut [Track]) -> Result<Option<Repair>, ReadError> {
    let from = tracks.iter().map(|track| i128::from(track.first)).max().unwrap_or(0);
    let to = tracks.iter().map(Track::end).min().unwrap_or(0);
    let longest = tracks.iter().map(|track| track.rows).max().unwrap_or(0);
    let rate_hz = tracks.first().map_or(0, |track| track.rate_hz);
    let kept = u64::try_from(to - from).unwrap_or(0);
    // Where they begin together, what is left out comes after the last row.
    let row = if tracks.iter().all(|track| i128::from(track.first) == from) { kept } else { 1 };
    if kept == longest || kept == 0 || tracks.iter().any(|track| track.rate_hz != rate_hz) {
        return check_alike(path, tracks).map(|()| None);
    }
    tracks.iter_mut().try_for_each(|track| track.cut(from, to))?;
    let count = longest - kept;
    let message = format!(
        "signals do not begin and end together: the {kept} samples from number {from} on are read, which all have; the \
         longest signal has {count} more"
    );
    Ok(Some(Repair { code: "cut-signals", row, time_s: 0.0, count, message }))
}

/// Rows are made of signals of one rate, from one sample to another.
fn check_alike(path: &Path, tracks: &[Track]) -> Result<(), ReadError> {
    let Some((one, others)) = tracks.split_first() else { return Ok(()) };
    let key = |track: &Track| (track.rate_hz, track.first, track.rows);
    let told = |track: &Track| {
        let (name, rows, first, rate_hz) = (&track.name, track.rows, track.first, track.rate_hz);
        format!("{name} has {rows} samples from number {first} on at {rate_hz} Hz")
    };
    match others.iter().find(|other| key(other) != key(one)) {
        Some(other) => Err(ReadError::Signals { path: path.to_owned(), one: told(one), other: told(other) }),
        None => Ok(()),
    }
}
