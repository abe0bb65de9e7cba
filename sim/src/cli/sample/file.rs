//! Points in files.

use std::fmt::Write as _;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use super::{Failure, usage};

/// Points of any dimension.
pub(super) struct Points {
    pub dimensions: usize,
    /// Coordinate after coordinate, point after point.
    pub coordinates: Vec<f64>,
}

/// Kinds of files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Format {
    Csv,
    Npy,
    Bin,
}

impl Format {
    /// By the ending of a name.
    pub fn of(path: &Path) -> Result<Self, Failure> {
        let ending = path.extension().and_then(|ending| ending.to_str()).map(str::to_ascii_lowercase);
        match ending.as_deref() {
            Some("csv") => Ok(Self::Csv),
            Some("npy") => Ok(Self::Npy),
            Some("bin") => Ok(Self::Bin),
            _ => Err(usage(format!("--out: {}: let the name end in .csv, .npy or .bin", path.display()))),
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
                Format::Csv => out.write_all(self.csv(single).as_bytes())?,
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

    /// With as many digits as it takes to read the same numbers back.
    pub fn csv(&self, single: bool) -> String {
        let mut text = ["x", "y", "z", "w"][..self.dimensions].join(",");
        text.push('\n');
        for point in self.coordinates.chunks(self.dimensions) {
            for (place, &x) in point.iter().enumerate() {
                let comma = if place == 0 { "" } else { "," };
                // Writing into a string cannot fail.
                let _ = if single { write!(text, "{comma}{}", x as f32) } else { write!(text, "{comma}{x}") };
            }
            text.push('\n');
        }
        text
    }

    fn numbers(&self, out: &mut impl Write, single: bool) -> io::Result<()> {
        let mut each = self.coordinates.iter();
        if single {
            each.try_for_each(|&x| out.write_all(&(x as f32).to_le_bytes()))
        } else {
            each.try_for_each(|x| out.write_all(&x.to_le_bytes()))
        }
    }

    /// The header of version 1.0 of the format of NumPy.
    fn npy_header(&self, single: bool) -> Vec<u8> {
        let (kind, shape) = (if single { "<f4" } else { "<f8" }, (self.len(), self.dimensions));
        let text = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape:?}, }}");
        // All of the header is a multiple of 64 bytes, ends in a newline, and begins with ten bytes of its own.
        let padded = (10 + text.len() + 1).next_multiple_of(64) - 11;
        let mut header = b"\x93NUMPY\x01\x00".to_vec();
        header.extend(((padded + 1) as u16).to_le_bytes());
        header.extend(format!("{text:padded$}\n").into_bytes());
        header
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
