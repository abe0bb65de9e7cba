//! Writing.

use super::description_path;
use crate::decimal;
use crate::io::source::{Heading, Sink, Source, Stretch};
use crate::io::{WriteError, atomic, header};
use flate2::Compression;
use flate2::write::GzEncoder;
use rayon::prelude::*;
use std::io::{BufWriter, Write};
use std::path::Path;

const TIME: &str = "time_s";
const CHANNELS: [&str; 2] = ["voltage_V", "current_A"];
/// Rows a thread makes text of at once, and rows whose text is held at once.
const TASK_ROWS: usize = 1 << 12;
const HELD_ROWS: usize = 1 << 18;

/// Writes the samples. Times are whole nanoseconds written as seconds; values have the digits that read back as the same
/// number in f32 and in f64 alike, so that whoever integrates them in f64 finds the joules found here. About 50 bytes a
/// sample.
///
/// # Errors
/// [`WriteError::Encode`] if the writer fails, [`WriteError::Read`] if the samples cannot be read.
pub fn write<W: Write + Send>(trace: &dyn Source, out: W) -> Result<(), WriteError> {
    write_with(trace, out, b',')
}

/// As [`write()`], with something else than a comma between the fields: a tab for TSV.
///
/// # Errors
/// As [`write()`].
pub fn write_with<W: Write + Send>(trace: &dyn Source, out: W, delimiter: u8) -> Result<(), WriteError> {
    let out = BufWriter::with_capacity(1 << 16, out);
    let mut writer = Writer { out, heading: trace.heading(), delimiter: char::from(delimiter) };
    writer.head().map_err(encode)?;
    trace.pour(&mut writer)?;
    writer.out.flush().map_err(encode)
}

fn encode(error: impl std::fmt::Display) -> WriteError {
    WriteError::Encode(error.to_string())
}

/// A text being written.
struct Writer<W: Write + Send> {
    out: BufWriter<W>,
    heading: Heading,
    delimiter: char,
}

impl<W: Write + Send> Sink for Writer<W> {
    fn take(&mut self, stretch: &Stretch<'_>) -> Result<(), WriteError> {
        if stretch.lost {
            return Ok(());
        }
        for from in (0..stretch.len()).step_by(HELD_ROWS) {
            let held = stretch.part(from, stretch.len().min(from + HELD_ROWS));
            for text in self.texts(&held) {
                self.out.write_all(&text).map_err(encode)?;
            }
        }
        Ok(())
    }
}

impl<W: Write + Send> Writer<W> {
    fn head(&mut self) -> std::io::Result<()> {
        let c = self.delimiter;
        writeln!(self.out, "{TIME}{c}{}{c}{}", CHANNELS[0], CHANNELS[1])
    }

    /// The rows in order, made side by side.
    fn texts(&self, held: &Stretch<'_>) -> Vec<Vec<u8>> {
        let (heading, delimiter) = (&self.heading, self.delimiter);
        let tasks = (0..held.len().div_ceil(TASK_ROWS)).into_par_iter();
        let part = |task: usize| held.part(task * TASK_ROWS, held.len().min((task + 1) * TASK_ROWS));
        tasks.map(|task| text(heading, &part(task), delimiter)).collect()
    }
}

/// The rows of a stretch.
fn text(heading: &Heading, rows: &Stretch<'_>, c: char) -> Vec<u8> {
    let mut out = Vec::with_capacity(rows.len() * 56);
    for (index, (voltage, current)) in rows.voltage_v.iter().zip(rows.current_a).enumerate() {
        let time_ns = heading.time_ns(rows.first + index as u64);
        let (sign, time_ns) = (if time_ns < 0 { "-" } else { "" }, time_ns.unsigned_abs());
        let (seconds, mut fraction, mut digits) = (time_ns / 1_000_000_000, time_ns % 1_000_000_000, 9);
        while digits > 1 && fraction % 10 == 0 {
            fraction /= 10;
            digits -= 1;
        }
        // Writing to memory does not fail.
        let _ = write!(out, "{sign}{seconds}.{fraction:0digits$}");
        for value in [voltage, current] {
            let _ = write!(out, "{c}");
            decimal::push(&mut out, f64::from(*value));
        }
        out.push(b'\n');
    }
    out
}

/// Writes the JSON description: exact rate and start, number of samples, units, and the trace's metadata.
///
/// # Errors
/// [`WriteError`] if a mark is not finite or the writer fails.
pub fn write_sidecar<W: Write>(trace: &dyn Source, mut out: W) -> Result<(), WriteError> {
    let json = header::to_json(&trace.heading(), true)?;
    writeln!(out, "{json}").and_then(|()| out.flush()).map_err(encode)
}

/// Writes the CSV file and, beside it, its description; each whole or not at all.
///
/// # Errors
/// [`WriteError`] names the file.
pub fn save(trace: &dyn Source, path: &Path) -> Result<(), WriteError> {
    save_as(trace, path, b',', false)
}

/// As [`save`], with another delimiter and compressed with gzip if asked.
///
/// # Errors
/// [`WriteError`] names the file.
pub fn save_as(trace: &dyn Source, path: &Path, delimiter: u8, gzip: bool) -> Result<(), WriteError> {
    atomic::write_trace(path, |out| {
        if !gzip {
            return write_with(trace, out, delimiter);
        }
        let mut packed = GzEncoder::new(out, Compression::default());
        write_with(trace, &mut packed, delimiter)?;
        packed.finish().map(|_| ()).map_err(encode)
    })?;
    atomic::write_trace(&description_path(path), |out| write_sidecar(trace, out))
}
