//! All methods for one value of a family: lost samples, cost, and the boxes of tile tests compared with the true ones.

use activity::{Counts, Event};
use pipeline::geometry::Projection;
use pipeline::random::mix;
use pipeline::setup::{Triangle, bounds};
use pipeline::traversal::Box5;
use pipeline::{Features, PassError, Shear};
use run::{GpuSpec, RunError};
use serde::Serialize;
use workloads::stress::{Family, Size, set_up_all};

use super::methods::{Method, Place, Subject, differing, on_subject};
use super::truth::{Hulls, Truth};

/// Result of one method for one value of a family.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StressRow {
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
    /// Source of the reference: `brute force` or `no tests`.
    pub compared_with: &'static str,
    /// Its cost.
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
) -> Result<Vec<StressRow>, RunError> {
    on_subject(family, value, (size, super::SEED), gpu, |subject| {
        let pairs = Pairs::of(subject, PAIRS[usize::from(size != Size::FULL)]);
        let (reference, brute) = subject.reference()?;
        let row = |method: &Method| -> Result<_, PassError> {
            let seen = subject.seen(method.features)?;
            Ok(StressRow {
                family: family.name,
                value,
                method: method.name,
                triangles: subject.triangles(),
                samples_lost: differing(&seen, &reference),
                compared_with: if brute { "brute force" } else { "no tests" },
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
fn compared(mut rows: Vec<StressRow>) -> Vec<StressRow> {
    let best = rows.iter().map(|row| row.work.madds()).min().unwrap_or(0).max(1) as f64;
    rows.iter_mut().for_each(|row| row.over_best = row.work.madds().max(1) as f64 / best);
    rows
}

/// Pairs of a triangle and a tile, with what is true of each.
pub struct Pairs {
    pairs: Vec<Pair>,
    shear: Shear,
    exact: bool,
}

struct Pair {
    triangle: Triangle,
    place: Place,
    truth: Option<Hulls>,
}

/// Intervals of the pairs under a set of tests. Widths are shares of the whole lens and shutter, means over pairs that truly touch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Intervals {
    /// Pairs looked at, those of the bounding box.
    pub pairs: u64,
    /// Pairs of these that truly touch.
    pub pairs_touching: u64,
    /// Pairs the tests keep.
    pub pairs_kept: u64,
    /// Pairs that truly touch and are not kept, or whose box leaves out what truly touches: must be none.
    pub pairs_wrong: u64,
    /// Mean width in u, v, t of the boxes of pairs that touch.
    pub u_width: f64,
    /// See `u_width`.
    pub v_width: f64,
    /// See `u_width`.
    pub t_width: f64,
    /// Mean true width.
    pub u_true: f64,
    /// Mean true width.
    pub v_true: f64,
    /// Mean true width.
    pub t_true: f64,
    /// Volume of the true boxes over the volume of those that the tests keep: 1 is as tight as a box can be.
    pub tightness: f64,
}

/// Largest part of the true box that a box may leave out: the rounding error of the true box itself.
const TOLERANCE: f64 = 1e-6;

impl Pairs {
    /// About `most` of the pairs of `subject` that pass the bounding box, spread evenly, tiles as in its spec.
    pub fn of(subject: &Subject<'_>, most: u64) -> Self {
        let projection = Projection::new(subject.camera, subject.viewport);
        let side = subject.spec.tile_px;
        let triangles: Vec<_> = set_up_all(subject.camera, subject.draws, subject.viewport).collect();
        let rects: Vec<_> = triangles
            .iter()
            .map(|triangle| bounds(triangle, &projection.shear, subject.viewport).tiles(side))
            .collect();
        let count = |rect: &pipeline::setup::PixelRect| {
            u64::from(rect.x1.saturating_sub(rect.x0)) * u64::from(rect.y1.saturating_sub(rect.y0))
        };
        let stride = rects.iter().map(count).sum::<u64>().div_ceil(most).max(1);
        let (mut pairs, mut passed) = (Vec::new(), 0);
        for (triangle, rect) in triangles.iter().zip(&rects) {
            let (across, here) = (u64::from(rect.x1.saturating_sub(rect.x0)), count(rect));
            for tile in (0..here).filter(|tile| chosen(passed + tile, stride)) {
                let [column, row] = [tile % across, tile / across].map(|step| step as u32);
                let origin = [(rect.x0 + column) * side, (rect.y0 + row) * side];
                let place = Place::new(subject.viewport, projection.shear, projection.near, origin, side);
                let truth = Truth::new(triangle, &projection.shear, &place.tile, projection.near);
                // The truth asks where a triangle is, not which face it shows; so must the tests.
                let triangle = Triangle { faces: [true; 2], ..*triangle };
                pairs.push((truth.is_exact(), Pair { triangle, place, truth: truth.hulls() }));
            }
            passed += here;
        }
        let exact = pairs.iter().all(|(exact, _)| *exact);
        let pairs = pairs.into_iter().map(|(_, pair)| pair).collect();
        Self { pairs, shear: projection.shear, exact }
    }

    /// Where the true intervals are from.
    pub fn source(&self) -> &'static str {
        if self.exact { "exact roots" } else { "dense sampling" }
    }

    /// Intervals under the tests of `features`.
    pub fn under(&self, features: &Features) -> Intervals {
        self.bounded(|place, triangle| place.bound(features, triangle))
    }

    /// Intervals under `bound`.
    pub fn bounded(&self, bound: impl Fn(&Place, &Triangle) -> Option<Box5>) -> Intervals {
        let mut sum = Intervals { pairs: self.pairs.len() as u64, ..Intervals::default() };
        let (mut volume, mut true_volume) = (0.0, 0.0);
        for pair in &self.pairs {
            let found = bound(&pair.place, &pair.triangle).map(|within| self.hulls(&within));
            sum.pairs_kept += u64::from(found.is_some());
            volume += found.map_or(0.0, |hulls| widths(&hulls).iter().product());
            let Some(truth) = pair.truth else { continue };
            true_volume += widths(&truth).iter().product::<f64>();
            sum.pairs_touching += 1;
            sum.pairs_wrong += u64::from(found.is_none_or(|found| !holds(&found, &truth)));
            sum.add_widths(&found.map_or([0.0; 3], |found| widths(&found)), &widths(&truth));
        }
        sum.divide(volume, true_volume)
    }

    fn hulls(&self, within: &Box5) -> Hulls {
        let whole = [-1.0, 1.0];
        let lens = if self.shear.is_none() { [whole; 2] } else { [within.u, within.v].map(wide) };
        [lens[0], lens[1], wide(within.t)]
    }
}

impl Intervals {
    fn add_widths(&mut self, found: &[f64; 3], truth: &[f64; 3]) {
        for (sum, width) in [&mut self.u_width, &mut self.v_width, &mut self.t_width].into_iter().zip(found) {
            *sum += width;
        }
        for (sum, width) in [&mut self.u_true, &mut self.v_true, &mut self.t_true].into_iter().zip(truth) {
            *sum += width;
        }
    }

    fn divide(mut self, volume: f64, true_volume: f64) -> Self {
        let touching = self.pairs_touching.max(1) as f64;
        let Self { u_width, v_width, t_width, u_true, v_true, t_true, .. } = &mut self;
        [u_width, v_width, t_width, u_true, v_true, t_true].into_iter().for_each(|sum| *sum /= touching);
        self.tightness = if volume > 0.0 { true_volume / volume } else { 1.0 };
        self
    }
}

/// Spreads the choice over triangles and tiles, in which a plain stride would fall into step.
fn chosen(pair: u64, stride: u64) -> bool {
    mix(pair).is_multiple_of(stride)
}

fn wide(range: [f32; 2]) -> [f64; 2] {
    range.map(f64::from)
}

/// Shares of the whole lens and shutter.
fn widths(hulls: &Hulls) -> [f64; 3] {
    let [u, v, t] = hulls.map(|[low, high]| (high - low).max(0.0));
    [0.5 * u, 0.5 * v, t]
}

fn holds(found: &Hulls, truth: &Hulls) -> bool {
    found.iter().zip(truth).all(|([low, high], t)| *low <= t[0] + TOLERANCE && *high >= t[1] - TOLERANCE)
}
