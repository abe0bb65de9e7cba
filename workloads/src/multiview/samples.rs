//! Parts of a sample table as tables of their own.

use std::ops::Range;

use pipeline::SampleTable;
use pipeline::sampling::{Sample, SampleSource};

/// A run of the samples of each pixel.
#[derive(Debug)]
pub(super) struct Run<'a> {
    pub table: &'a SampleTable,
    pub run: Range<u32>,
}

impl SampleSource for Run<'_> {
    fn per_pixel(&self) -> u32 {
        self.run.len() as u32
    }

    fn pixel_into(&self, px: u32, py: u32, into: &mut [Sample]) {
        let run = self.run.start as usize..self.run.end as usize;
        into.copy_from_slice(&self.table.pixel(px, py)[run]);
    }
}

/// The same run as a lens of its own sees it: part `middle` plus or minus `half` of the wide one, along `u` and `v`.
#[derive(Debug)]
pub(super) struct OwnLens<'a> {
    pub run: Run<'a>,
    pub middle: f32,
    pub half: f32,
}

impl SampleSource for OwnLens<'_> {
    fn per_pixel(&self) -> u32 {
        self.run.per_pixel()
    }

    fn pixel_into(&self, px: u32, py: u32, into: &mut [Sample]) {
        self.run.pixel_into(px, py, into);
        for sample in into {
            sample.u = ((sample.u - self.middle) / self.half).clamp(-1.0, 1.0);
            sample.v = (sample.v / self.half).clamp(-1.0, 1.0);
        }
    }
}
