//! Checks of a method: coverage compared with brute force, and warnings about inaccurate beams.

use glam::DVec3;
use pipeline::Lane;
use rayon::prelude::*;
use warnings::{Code, Warning};

use super::draw::draw_with_work;
use super::generator::Ocean;
use super::light::Seen;
use super::{Beam, Eye, Floor, Method};

/// Coverage of a method.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Coverage {
    /// Pairs of a pixel and a beam that lights the floor at the pixel's centre.
    pub lit: u64,
    /// Pairs that the method misses (false negatives); must be 0.
    pub missed: u64,
    /// Pairs by number of hits: one, two, three. A folded beam hits a point more than once.
    pub by_hits: [u64; 3],
    /// Pictures drawn to find the covered pixels.
    pub draws: u64,
    /// Covered pixels of all beams.
    pub fragments: u64,
}

impl Coverage {
    /// Sum of both.
    #[must_use]
    pub fn and(self, other: &Self) -> Self {
        let by_hits = [0, 1, 2].map(|n| self.by_hits[n] + other.by_hits[n]);
        Self {
            lit: self.lit + other.lit,
            missed: self.missed + other.missed,
            by_hits,
            draws: self.draws + other.draws,
            fragments: self.fragments + other.fragments,
        }
    }
}

/// Tests every beam at the floor point of every pixel, and counts the pairs that a method misses.
pub fn receivers(beams: &[Beam], eye: &Eye, method: Method, floor: &Floor) -> Coverage {
    let (picture, mut work) = draw_with_work(beams, eye, method, None, true);
    work.sort_by_key(|work| (work.beam, work.tile));
    let (width, height) = (eye.viewport().width(), eye.viewport().height());
    let columns = width.div_ceil(8);
    let covered = |beam: u32, [x, y]: [u32; 2]| {
        let tile = y / 8 * columns + x / 8;
        let at = work.binary_search_by_key(&(beam, tile), |work| (work.beam, work.tile));
        at.is_ok_and(|at| work[at].pixels >> (y % 8 * 8 + x % 8) & 1 != 0)
    };
    let bounded = |seen: Seen| (BoundingBox::of(&seen.image), seen);
    let seen: Vec<Option<(BoundingBox, Seen)>> =
        beams.iter().map(|beam| eye.see(beam).map(bounded)).collect();
    let row = |y: u32| {
        let mut found = Coverage::default();
        for x in 0..width {
            let Some(point) = floor.point(eye, eye.pixel_centre([x, y])) else { continue };
            for (number, seen) in (0..).zip(&seen) {
                let near = seen.as_ref().filter(|(bounds, _)| bounds.contains(point));
                let hits = near.map_or(0, |(_, seen)| seen.image.inside(&Lane::default(), point).count());
                if hits > 0 {
                    found.lit += 1;
                    found.by_hits[hits.min(3) - 1] += 1;
                    found.missed += u64::from(!covered(number, [x, y]));
                }
            }
        }
        found
    };
    let drawn = Coverage { draws: 1, fragments: picture.total_runs(), ..Coverage::default() };
    (0..height).into_par_iter().map(row).reduce(Coverage::default, |a, b| a.and(&b)).and(&drawn)
}

/// Bounding box of a beam's corners, with a margin for rounding. Points outside are outside the beam.
struct BoundingBox {
    low: DVec3,
    high: DVec3,
}

impl BoundingBox {
    fn of(beam: &Beam) -> Self {
        let corners = || beam.open.iter().chain(&beam.close).copied();
        let low = corners().fold(DVec3::INFINITY, DVec3::min);
        let high = corners().fold(DVec3::NEG_INFINITY, DVec3::max);
        let bounds = DVec3::splat(1e-3 * (1.0 + (high - low).max_element()));
        Self { low: low - bounds, high: high + bounds }
    }

    fn contains(&self, point: DVec3) -> bool {
        point.cmpge(self.low).all() && point.cmple(self.high).all()
    }
}

/// Mean share of a beam's length with crossed sides above which a warning is given. Half a percent of the
/// light in the volume is missing there (`quintile chart caustics`).
pub const MAX_CROSSED_SHARE: f64 = 0.1;
/// Least number of grid squares along the shortest wave.
pub const MIN_SQUARES_PER_WAVE: f64 = 4.0;

/// Mean share of their length over which sides of beams cross.
pub fn crossing(beams: &[Beam]) -> f64 {
    beams.iter().map(Beam::crossing).sum::<f64>() / beams.len().max(1) as f64
}

/// Warnings about an ocean made of these beams.
pub fn accuracy_warnings(ocean: &Ocean, beams: &[Beam]) -> Vec<Warning> {
    let crossed = crossing(beams);
    let squares = ocean.shortest_m() / ocean.side_m * f64::from(ocean.cells);
    let crossed = (crossed > MAX_CROSSED_SHARE).then(|| {
        Warning::new(
            Code::CausticsCrossed,
            format!(
                "the sides of beams cross for {:.1} % of their length on average (a warning from {:.0} % on): triangles stand along the light for much \
                 of its way, which then differs in length within a beam, and light in the water is missing, half a percent from there on and more beyond; \
                 more cells, flatter waves or deeper water help",
                100.0 * crossed,
                100.0 * MAX_CROSSED_SHARE
            ),
        )
    });
    let coarse = (squares < MIN_SQUARES_PER_WAVE).then(|| {
        Warning::new(
            Code::CausticsCoarse,
            format!(
                "the shortest wave is {squares:.1} squares of generator triangles long, fewer than {MIN_SQUARES_PER_WAVE:.0}: the surface is not resolved and its light \
                 falls elsewhere; more cells or longer waves help"
            ),
        )
    });
    crossed.into_iter().chain(coarse).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::caustics::generator::tests::{Uniform, turned, warped};

    #[test]
    fn every_point_of_a_beam_is_in_its_box() {
        let mut random = Uniform::new(8);
        for round in 0..2000 {
            let beam = if round % 2 == 0 { warped(&mut random, 0.8) } else { turned(&mut random) };
            let inside = beam.point(&random.hit());
            let bounds = BoundingBox::of(&beam);
            assert!(bounds.contains(inside));
            let far = inside + DVec3::splat(12.0);
            assert!(!bounds.contains(far) && beam.inside(&Lane::default(), far).count() == 0);
        }
    }
}
