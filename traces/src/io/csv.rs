//! Interchange: CSV with the header `time_s,voltage_V,current_A`, no comment lines, and a JSON file beside it.

use super::{ReadError, ReadOptions, Rows, WriteError, atomic, header};
use crate::trace::Trace;
use flate2::Compression;
use flate2::write::GzEncoder;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

const TIME: &str = "time_s";
const CHANNELS: [&str; 2] = ["voltage_V", "current_A"];

/// Writes the samples. Times are whole nanoseconds written as seconds; values have the digits that read back as the same
/// number in f32 and in f64 alike, so that whoever integrates them in f64 finds the joules found here. About 50 bytes a
/// sample.
///
/// # Errors
/// [`WriteError::Encode`] if the writer fails.
pub fn write<W: Write>(trace: &Trace, out: W) -> Result<(), WriteError> {
    write_with(trace, out, b',')
}

/// As [`write()`], with something else than a comma between the fields: a tab for TSV.
///
/// # Errors
/// [`WriteError::Encode`] if the writer fails.
pub fn write_with<W: Write>(trace: &Trace, out: W, delimiter: u8) -> Result<(), WriteError> {
    let mut out = BufWriter::with_capacity(1 << 16, out);
    write_rows(trace, &mut out, char::from(delimiter)).map_err(|error| WriteError::Encode(error.to_string()))
}

fn write_rows(trace: &Trace, out: &mut impl Write, c: char) -> std::io::Result<()> {
    writeln!(out, "{TIME}{c}{}{c}{}", CHANNELS[0], CHANNELS[1])?;
    for index in trace.kept(0..trace.samples()) {
        let (voltage, current) = (trace.voltage_v()[index], trace.current_a()[index]);
        let time_ns = trace.time_ns(index);
        let (sign, time_ns) = (if time_ns < 0 { "-" } else { "" }, time_ns.unsigned_abs());
        let (seconds, mut fraction, mut digits) = (time_ns / 1_000_000_000, time_ns % 1_000_000_000, 9);
        while digits > 1 && fraction % 10 == 0 {
            fraction /= 10;
            digits -= 1;
        }
        let (voltage, current) = (f64::from(voltage), f64::from(current));
        writeln!(out, "{sign}{seconds}.{fraction:0digits$}{c}{voltage}{c}{current}")?;
    }
    out.flush()
}

/// Writes the JSON description: exact rate and start, number of samples, units, and the trace's metadata.
///
/// # Errors
/// [`WriteError`] if a mark is not finite or the writer fails.
pub fn write_sidecar<W: Write>(trace: &Trace, mut out: W) -> Result<(), WriteError> {
    let json = header::to_json(trace, true)?;
    writeln!(out, "{json}").and_then(|()| out.flush()).map_err(|error| WriteError::Encode(error.to_string()))
}

/// Where the description of a CSV file lies: the same name ending in `.json`.
pub fn sidecar_path(path: &Path) -> PathBuf {
    path.with_extension("json")
}

/// Writes the CSV file and, beside it, its description; each whole or not at all.
///
/// # Errors
/// [`WriteError`] names the file.
pub fn save(trace: &Trace, path: &Path) -> Result<(), WriteError> {
    atomic::write_file(path, |out| write(trace, out))?;
    atomic::write_file(&sidecar_path(path), |out| write_sidecar(trace, out))
}

/// What stands between the fields of a text's first line: a tab or a semicolon if it has any, else a comma.
pub(crate) fn delimiter(text: &[u8]) -> u8 {
    let line = text.split(|&byte| byte == b'\n').next().unwrap_or_default();
    [b'\t', b';'].into_iter().find(|byte| line.contains(byte)).unwrap_or(b',')
}

/// As [`save`], with another delimiter and compressed with gzip if asked.
///
/// # Errors
/// [`WriteError`] names the file.
pub fn save_as(trace: &Trace, path: &Path, delimiter: u8, gzip: bool) -> Result<(), WriteError> {
    atomic::write_file(path, |out| {
        if !gzip {
            return write_with(trace, out, delimiter);
        }
        let mut packed = GzEncoder::new(out, Compression::default());
        write_with(trace, &mut packed, delimiter)?;
        packed.finish().map(|_| ()).map_err(|error| WriteError::Encode(error.to_string()))
    })?;
    let beside = if gzip { path.with_extension("") } else { path.to_owned() };
    atomic::write_file(&sidecar_path(&beside), |out| write_sidecar(trace, out))
}

/// Reads a CSV file, and its description if there is a [`sidecar_path`].
///
/// Columns are found by name without regard to case, in any order among others; `time_s` may be missing if the
/// description states the rate. Without a description the rate is that of the time stamps.
///
/// # Errors
/// [`ReadError`] names the file, the row and how to mend it.
pub fn read(path: &Path) -> Result<Trace, ReadError> {
    Ok(super::read::load(Rows::csv(path, &ReadOptions::default(), false)?)?.trace)
}
