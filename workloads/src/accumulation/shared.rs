//! Samples that all pixels share.

use pipeline::sampling::{Sample, SampleSource};
use pipeline::{SampleTable, sampling::Pattern, sampling::SampleSpec, sampling::TableError};

/// The same samples in every pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct SharedSamples(Vec<Sample>);

impl SharedSamples {
    /// These samples, 1 to 256 of them and all in range, in every pixel; `None` where they are not.
    pub fn new(samples: Vec<Sample>) -> Option<Self> {
        let fits = (1..=SampleTable::MAX_PER_PIXEL as usize).contains(&samples.len());
        (fits && samples.iter().all(Sample::is_in_range)).then_some(Self(samples))
    }

    /// A fixed set of `count` places on the lens and in time by the description of a table: those of its first pixel. A pattern
    /// that differs between pixels is as good as one that does not.
    ///
    /// # Errors
    /// When the table cannot be made.
    pub fn from_spec(spec: &SampleSpec, count: u32, seed: u64) -> Result<Self, TableError> {
        Ok(Self(SampleTable::new(spec, count, seed)?.pixel(0, 0).to_vec()))
    }

    /// `count` places, the first ones of a scrambled Sobol sequence.
    ///
    /// # Errors
    /// When `count` is not 1 to 256.
    pub fn interleaved(spec: &SampleSpec, count: u32, seed: u64) -> Result<Self, TableError> {
        let pattern = Pattern::Interleaved { points: count.max(1) };
        Self::from_spec(&SampleSpec { pattern, ..spec.clone() }, count, seed)
    }

    /// The samples.
    pub fn samples(&self) -> &[Sample] {
        &self.0
    }

    /// The same places, all looking through the middle of the pixel.
    #[must_use]
    pub fn centred(&self) -> Self {
        Self(self.0.iter().map(|sample| Sample { x: 0.5, y: 0.5, ..*sample }).collect())
    }

    /// One of the samples without its place on the lens and in time.
    pub fn still(&self, index: usize) -> Self {
        let Sample { x, y, .. } = self.0[index];
        Self(vec![Sample { x, y, ..Sample::default() }])
    }
}

impl SampleSource for SharedSamples {
    fn per_pixel(&self) -> u32 {
        self.0.len() as u32
    }

    fn pixel_into(&self, _px: u32, _py: u32, into: &mut [Sample]) {
        into.copy_from_slice(&self.0);
    }
}
