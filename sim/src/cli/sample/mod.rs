//! `quintile sample`, and files of points.

mod kinds;

use std::convert::Infallible;
use std::fmt::Write as _;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};
use output::terminal::Terminal;
use rayon::prelude::*;
use serde::Serialize;

use super::{Failure, print, print_json};
use crate::cli::args::ThreadArgs;

/// Arguments of `sample`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  quintile sample poisson --dim 2 --r 0.01 -o points.csv\n  \
    quintile sample poisson --dim 3 --count 100000 --box -o points.npy --json\n  \
    quintile sample white --dim 2 --image portrait.png --count 20000 -o stipples.csv\n  \
    quintile sample volume --mesh bunny.ply --count 50000 -o inside.bin\n\n\
    Files by their ending: .csv (with a line x,y,... first), .npy, or .bin (coordinates point by point, little-endian, f64 or, with \
    --single, f32). Without -o the points are printed as CSV.")]
pub struct SampleArgs {
    /// Distribution of the points
    #[command(subcommand)]
    pub kind: Kind,
}

/// Distributions of points.
#[derive(Debug, Subcommand)]
pub enum Kind {
    /// Poisson disk points of the unit square, cube, ...: a minimum distance, and no room for another point
    Poisson(kinds::PoissonArgs),
    /// Independent points of the unit square, cube, ... that follow a density
    White(kinds::WhiteArgs),
    /// Uniform points in a torus or in a closed surface
    Volume(kinds::VolumeArgs),
}

/// Arguments of all distributions.
#[derive(Debug, Args)]
pub struct CommonArgs {
    /// Seed of the points
    #[arg(long, value_name = "N", default_value_t = 1, allow_negative_numbers = true, value_parser = crate::cli::parse::seed)]
    pub seed: u64,
    /// File for the points: .csv, .npy or .bin
    #[arg(short, long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Coordinates in single precision
    #[arg(long)]
    pub single: bool,
    /// Worker threads.
    #[command(flatten)]
    pub threads: ThreadArgs,
    /// Print a description as one line of JSON instead of the points
    #[arg(long)]
    pub json: bool,
}

/// Description of the points for `--json`.
#[derive(Serialize)]
struct Made<T: Serialize> {
    points: usize,
    dimensions: usize,
    out: Option<String>,
    #[serde(flatten)]
    facts: T,
}

impl CommonArgs {
    /// Writes the file and prints the result.
    fn deliver(&self, points: &Points, facts: impl Serialize, line: &str) -> Result<(), Failure> {
        let pool = self.threads.pool()?;
        if let Some(path) = &self.out {
            pool.install(|| points.write(path, self.single))?;
        } else if !self.json {
            return print(&pool.install(|| points.csv(self.single)));
        }
        let out = self.out.as_deref().map(|path| path.display().to_string());
        if self.json {
            let dimensions = points.dimensions;
            return print_json(&Made { points: points.len(), dimensions, out, facts }, false);
        }
        print(&format!(
            "{}: {} points in {}D; {line}",
            out.unwrap_or_default(),
            points.len(),
            points.dimensions
        ))
    }

    /// Checks before the work that the output file has a known extension, can be written and is not the
    /// `input`.
    fn check(&self, input: Option<&Path>) -> Result<(), Failure> {
        let out = self.out.as_deref();
        out.map(Format::of).transpose()?;
        super::may_hold_results("--out", out, input)
    }
}

fn usage(message: impl std::fmt::Display) -> Failure {
    Failure { message: message.to_string(), code: 2 }
}

pub(super) fn run(args: &SampleArgs, terminal: &Terminal) -> Result<(), Failure> {
    match &args.kind {
        Kind::Poisson(args) => kinds::poisson(args, terminal),
        Kind::White(args) => kinds::white(args),
        Kind::Volume(args) => kinds::volume(args),
    }
}

/// Points of any dimension.
struct Points {
    pub dimensions: usize,
    /// Coordinates of all points, point by point.
    pub coordinates: Vec<f64>,
}

/// File formats.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Format {
    Csv,
    Npy,
    Bin,
}

impl Format {
    /// Format by the extension of a file name.
    pub fn of(path: &Path) -> Result<Self, Failure> {
        let ending = path.extension().and_then(|ending| ending.to_str()).map(str::to_ascii_lowercase);
        match ending.as_deref() {
            Some("csv") => Ok(Self::Csv),
            Some("npy") => Ok(Self::Npy),
            Some("bin") => Ok(Self::Bin),
            _ => Err(usage(format!(
                "--out: {}: the file name has to end in .csv, .npy or .bin",
                path.display()
            ))),
        }
    }
}

impl Points {
    pub fn new<const D: usize>(points: &[[f64; D]]) -> Self {
        Self { dimensions: D, coordinates: points.as_flattened().to_vec() }
    }

    pub fn len(&self) -> usize {
        self.coordinates.len() / self.dimensions
    }

    pub fn write(&self, path: &Path, single: bool) -> Result<(), Failure> {
        let format = Format::of(path)?;
        traces::io::atomic::write_file(path, |out: &mut BufWriter<File>| {
            match format {
                Format::Csv => self.csv_into(single, |text| out.write_all(text.as_bytes()))?,
                Format::Npy => {
                    out.write_all(&self.npy_header(single))?;
                    self.numbers(out, single)?;
                }
                Format::Bin => self.numbers(out, single)?,
            }
            out.flush()
        })
        .map_err(|error| Failure { message: error.to_string(), code: 1 })
    }

    /// The CSV as one text.
    pub fn csv(&self, single: bool) -> String {
        let mut all = String::new();
        let pushed: Result<(), Infallible> = self.csv_into(single, |text| {
            all.push_str(text);
            Ok(())
        });
        let Ok(()) = pushed;
        all
    }

    /// CSV with enough digits to read back the same numbers, in parts that threads format in parallel.
    fn csv_into<E>(&self, single: bool, mut each: impl FnMut(&str) -> Result<(), E>) -> Result<(), E> {
        each(&["x", "y", "z", "w"][..self.dimensions].join(","))?;
        each("\n")?;
        for part in self.coordinates.chunks(PART * PARTS * self.dimensions) {
            let pieces = part.par_chunks(PART * self.dimensions);
            let texts: Vec<String> = pieces.map(|piece| lines(piece, self.dimensions, single)).collect();
            texts.iter().try_for_each(|text| each(text))?;
        }
        Ok(())
    }

    fn numbers(&self, out: &mut impl Write, single: bool) -> io::Result<()> {
        let mut bytes = Vec::with_capacity(8 * PART);
        for part in self.coordinates.chunks(PART) {
            bytes.clear();
            if single {
                part.iter().for_each(|&x| bytes.extend_from_slice(&(x as f32).to_le_bytes()));
            } else {
                part.iter().for_each(|x| bytes.extend_from_slice(&x.to_le_bytes()));
            }
            out.write_all(&bytes)?;
        }
        Ok(())
    }

    /// Header of the NumPy format, version 1.0.
    fn npy_header(&self, single: bool) -> Vec<u8> {
        let (kind, shape) = (if single { "<f4" } else { "<f8" }, (self.len(), self.dimensions));
        let text = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape:?}, }}");
        // The header with its ten bytes of prefix is a multiple of 64 bytes and ends in a newline.
        let padded = (10 + text.len() + 1).next_multiple_of(64) - 11;
        let mut header = b"\x93NUMPY\x01\x00".to_vec();
        header.extend(((padded + 1) as u16).to_le_bytes());
        header.extend(format!("{text:padded$}\n").into_bytes());
        header
    }
}

/// Points per part of the CSV.
const PART: usize = 4096;
/// Parts formatted in parallel.
const PARTS: usize = 64;

/// One line per point.
fn lines(coordinates: &[f64], dimensions: usize, single: bool) -> String {
    let mut text = String::with_capacity(20 * coordinates.len());
    for point in coordinates.chunks(dimensions) {
        for (place, &x) in point.iter().enumerate() {
            let comma = if place == 0 { "" } else { "," };
            // Writing into a string cannot fail.
            let _ = if single { write!(text, "{comma}{}", x as f32) } else { write!(text, "{comma}{x}") };
        }
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_in_order() {
        let all: Vec<[f64; 2]> = (0..PART * PARTS + 5).map(|n| [n as f64, 0.25 * n as f64]).collect();
        let points = Points::new(&all);
        let text = points.csv(false);
        assert_eq!(text.lines().count(), all.len() + 1);
        let read = |line: &str| line.split(',').map(|x| x.parse().unwrap()).collect::<Vec<f64>>();
        assert!(text.lines().skip(1).zip(&all).all(|(line, point)| read(line) == point));
        let mut bytes = Vec::new();
        points.numbers(&mut bytes, false).unwrap();
        let number = |bytes: &[u8]| f64::from_le_bytes(bytes.try_into().unwrap());
        assert!(bytes.chunks(8).map(number).eq(points.coordinates.iter().copied()));
    }

    #[test]
    fn every_format_holds_the_same_numbers() {
        let points = Points::new(&[[0.1, 0.5], [1.0 / 3.0, 0.75]]);
        assert_eq!(points.csv(false), "x,y\n0.1,0.5\n0.3333333333333333,0.75\n");
        let header = points.npy_header(false);
        assert_eq!((header.len() % 64, header[header.len() - 1]), (0, b'\n'));
        assert!(String::from_utf8_lossy(&header).contains("'shape': (2, 2)"));
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.bin");
        assert!(points.write(&path, false).is_ok());
        let bytes = std::fs::read(&path).unwrap();
        assert_eq!((bytes.len(), &bytes[..8]), (32, &0.1_f64.to_le_bytes()[..]));
        assert!(points.write(&path, true).is_ok());
        assert_eq!(std::fs::read(&path).unwrap().len(), 16);
        assert_eq!(Format::of(Path::new("a.txt")).map_err(|failure| failure.code), Err(2));
    }
}
