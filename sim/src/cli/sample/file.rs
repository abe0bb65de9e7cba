//! Files of points.

use std::convert::Infallible;
use std::fmt::Write as _;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use rayon::prelude::*;

use super::{Failure, usage};

/// Points of any dimension.
pub(super) struct Points {
    pub dimensions: usize,
    /// Coordinates of all points, point by point.
    pub coordinates: Vec<f64>,
}

/// File formats.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Format {
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
