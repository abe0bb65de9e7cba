//! One family at one value, all methods: what is lost, what it costs, how tight the boxes are.

use activity::{Counts, Event};
use serde::Serialize;
use workloads::stress::{Family, Size};

use super::intervals::{Intervals, Pairs};
use super::methods::{Method, differing, on_subject};
use run::GpuSpec;
use run::RunError;

/// What one method made of one value of a family.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// The family.
    pub family: &'static str,
    /// The value of its parameter.
    pub value: f64,
    /// The method.
    pub method: &'static str,
    /// Triangles drawn.
    pub triangles: u64,
    /// Samples that do not see what they have to: must be none.
    pub samples_lost: u64,
    /// What that was found by: `brute force` or `no tests`.
    pub held_against: &'static str,
    /// What it cost.
    pub work: Work,
    /// Its multiply-adds over those of the best method at this value.
    pub over_best: f64,
    /// Where the true intervals are from: `exact roots` or `dense sampling`.
    pub truth: &'static str,
    /// How wide its boxes are.
    pub intervals: Intervals,
}

/// Counted work of a method.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Work {
    /// Samples tested.
    pub samples_tested: u64,
    /// Samples found inside.
    pub samples_hit: u64,
    /// Multiply-adds of tile tests and depth intervals.
    pub tile_madds: u64,
    /// Multiply-adds of screens and sample tests.
    pub sample_madds: u64,
}

impl Work {
    /// The work in `counts`.
    pub fn new(counts: &Counts) -> Self {
        Self {
            samples_tested: counts[Event::SamplesTested],
            samples_hit: counts[Event::SamplesHit],
            tile_madds: counts[Event::TileMadds] + counts[Event::DepthIntervalMadds],
            sample_madds: counts[Event::ScreenMadds] + counts[Event::SampleMadds],
        }
    }

    /// All multiply-adds of tests.
    pub fn madds(&self) -> u64 {
        self.tile_madds + self.sample_madds
    }

    /// Samples hit over samples tested, where any was.
    pub fn efficiency(&self) -> Option<f64> {
        (self.samples_tested > 0).then(|| self.samples_hit as f64 / self.samples_tested as f64)
    }
}

/// Pairs of triangle and tile whose true interval is found, at full size and where time is short.
const PAIRS: [u64; 2] = [400, 60];

/// Every method on `family` at `value`.
///
/// # Errors
/// When the scene cannot be made or the hardware cannot be built.
pub fn measure(
    family: &'static Family,
    value: f64,
    size: Size,
    gpu: &GpuSpec,
    methods: &[Method],
) -> Result<Vec<Row>, RunError> {
    on_subject(family, value, (size, super::SEED), gpu, |subject| {
        let pairs = Pairs::of(subject, PAIRS[usize::from(size != Size::FULL)]);
        let (reference, brute) = subject.reference()?;
        let row = |method: &Method| {
            let seen = subject.seen(method.features)?;
            Ok(Row {
                family: family.name,
                value,
                method: method.name,
                triangles: subject.triangles(),
                samples_lost: differing(&seen, &reference),
                held_against: if brute { "brute force" } else { "no tests" },
                work: Work::new(&subject.counts(method.features)?),
                over_best: 1.0,
                truth: pairs.source(),
                intervals: pairs.under(&method.features),
            })
        };
        Ok(compared(methods.iter().map(row).collect::<Result<_, _>>()?))
    })
}

/// With the cost of each over that of the best.
fn compared(mut rows: Vec<Row>) -> Vec<Row> {
    let best = rows.iter().map(|row| row.work.madds()).min().unwrap_or(0).max(1) as f64;
    rows.iter_mut().for_each(|row| row.over_best = row.work.madds().max(1) as f64 / best);
    rows
}
