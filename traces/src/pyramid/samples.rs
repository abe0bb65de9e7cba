//! Columns narrower than blocks, from the samples themselves.

use super::{BLOCK, Column, Entry, Pyramid};
use crate::io::{Chunk, ReadError, ReadOptions, Rows};
use crate::trace::Trace;
use core::ops::Range;
use std::path::Path;

impl Pyramid {
    /// As [`Pyramid::columns`] of a file, but where columns are narrower than blocks, from its samples: those before are
    /// passed over, which takes texts as long as reading them.
    ///
    /// # Errors
    /// [`ReadError`] if samples cannot be read.
    pub fn columns_of_file(
        &self,
        (path, options): (&Path, &ReadOptions),
        (from_s, to_s): (f64, f64),
        columns: usize,
    ) -> Result<Option<Vec<Column>>, ReadError> {
        let Some(range) = self.few(from_s, to_s, columns) else {
            return Ok(self.columns(from_s, to_s, columns));
        };
        let mut rows = Rows::open(path, options)?;
        rows.skip(range.start)?;
        let (mut chunk, mut voltage_v, mut current_a) = (Chunk::default(), Vec::new(), Vec::new());
        let wanted = (range.end - range.start) as usize;
        while voltage_v.len() < wanted {
            let missing = wanted - voltage_v.len();
            if rows.append(missing, &mut chunk, &mut voltage_v, &mut current_a)? == 0 {
                return Err(ReadError::Changed { path: path.to_owned() });
            }
        }
        rows.check_finite(&voltage_v, &current_a, range.start)?;
        Ok(Some(self.of_samples(range.start, [&voltage_v, &current_a], columns)))
    }

    /// As [`Pyramid::columns_of_file`], of a trace in memory.
    pub fn columns_of_trace(
        &self,
        trace: &Trace,
        (from_s, to_s): (f64, f64),
        columns: usize,
    ) -> Option<Vec<Column>> {
        let Some(range) = self.few(from_s, to_s, columns) else { return self.columns(from_s, to_s, columns) };
        let within = range.start as usize..range.end as usize;
        let channels = [&trace.voltage_v()[within.clone()], &trace.current_a()[within]];
        Some(self.of_samples(range.start, channels, columns))
    }

    /// The samples of a stretch, if they are fewer than as many blocks would hold as there are to be columns.
    fn few(&self, from_s: f64, to_s: f64, columns: usize) -> Option<Range<u64>> {
        let (from, to) = self.places(from_s, to_s);
        (to > from && to - from < columns as u64 * BLOCK).then_some(from..to)
    }

    fn of_samples(&self, first: u64, [voltage_v, current_a]: [&[f32]; 2], columns: usize) -> Vec<Column> {
        let per_column = voltage_v.len().div_ceil(columns.max(1)).max(1);
        let both = voltage_v.chunks(per_column).zip(current_a.chunks(per_column)).enumerate();
        let column = |(index, (volts, amps)): (usize, (&[f32], &[f32]))| {
            let begin = first + (index * per_column) as u64;
            self.column(begin, begin + volts.len() as u64, Entry::of_samples(volts, amps))
        };
        both.map(column).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_short_stretch_shows_every_sample() {
        let amps: Vec<f32> = (0..5000_u16).map(|i| f32::from(i % 97)).collect();
        let trace = Trace::new(vec![2.0; 5000], amps.clone(), 1e3, 1.0, Default::default()).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let options = ReadOptions::default();
        for name in ["t.parquet", "t.csv"] {
            let path = folder.path().join(name);
            match name {
                "t.csv" => crate::io::csv::save(&trace, &path).unwrap(),
                _ => crate::io::parquet::save(&trace, &path).unwrap(),
            }
            let pyramid = Pyramid::of_file(&path, &options).unwrap();
            let look =
                |columns| pyramid.columns_of_file((&path, &options), (3.0, 3.1), columns).unwrap().unwrap();
            let each: Vec<f32> = look(1000).iter().map(|column| column.mean_w).collect();
            let powers: Vec<f32> = amps[2000..2100].iter().map(|amps| 2.0 * amps).collect();
            assert_eq!(each, powers);
            let pairs = look(50);
            assert_eq!((pairs.len(), pairs[0].from_s, pairs[49].to_s), (50, 3.0, 3.1));
            assert_eq!((pairs[1].low_w, pairs[1].high_w), (powers[2], powers[3]));
            assert_eq!(pyramid.columns_of_trace(&trace, (3.0, 3.1), 50).unwrap(), pairs);
        }
    }
}
