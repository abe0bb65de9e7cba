//! Disjoint regions of the lens, for several views from one sample table.

use serde::{Deserialize, Deserializer, Serialize, de::Error};

/// A rectangle of lens coordinates.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LensRegion {
    /// Range of `u`.
    pub u: (f32, f32),
    /// Range of `v`.
    pub v: (f32, f32),
}

impl LensRegion {
    /// The whole square of the lens.
    pub const WHOLE: Self = Self { u: (-1.0, 1.0), v: (-1.0, 1.0) };

    /// Map a point of the whole square to the region.
    pub fn map(&self, lens: [f32; 2]) -> [f32; 2] {
        let within = |(lo, hi): (f32, f32), c: f32| {
            let part = 0.5 * (f64::from(c) + 1.0);
            ((f64::from(lo) + part * (f64::from(hi) - f64::from(lo))) as f32).clamp(lo, hi)
        };
        if *self == Self::WHOLE { lens } else { [within(self.u, lens[0]), within(self.v, lens[1])] }
    }

    /// Whether the point is in the region, border included.
    pub fn contains(&self, [u, v]: [f32; 2]) -> bool {
        (self.u.0..=self.u.1).contains(&u) && (self.v.0..=self.v.1).contains(&v)
    }

    fn is_proper(&self) -> bool {
        [self.u, self.v].iter().all(|&(lo, hi)| -1.0 <= lo && lo < hi && hi <= 1.0)
    }

    /// Whether the interiors of the two intersect.
    fn overlaps(&self, other: &Self) -> bool {
        let meet = |(a, b): (f32, f32), (c, d): (f32, f32)| a < d && c < b;
        meet(self.u, other.u) && meet(self.v, other.v)
    }
}

/// Division of the lens. Each region is a separate aperture: the shape of the lens, inscribed in the
/// rectangle. The samples of a pixel are divided evenly; the first ones belong to the first region.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub enum LensRegions {
    /// Not divided.
    #[default]
    Whole,
    /// This many equal strips side by side in `u`, for the views of a camera line from left to right.
    Across(#[serde(deserialize_with = "few")] u32),
    /// Columns times rows, row by row from the lowest `v`.
    Grid(#[serde(deserialize_with = "few")] u32, #[serde(deserialize_with = "few")] u32),
    /// The given rectangles; the rest of the lens has no samples.
    Rectangles(#[serde(deserialize_with = "disjoint")] Vec<LensRegion>),
}

/// Largest number of regions along an axis, and in a list.
const MAX_REGIONS: u32 = 256;

fn few<'de, D: Deserializer<'de>>(from: D) -> Result<u32, D::Error> {
    let count = u32::deserialize(from)?;
    let fits = (1..=MAX_REGIONS).contains(&count);
    fits.then_some(count)
        .ok_or_else(|| D::Error::custom(format!("{count} regions; it takes 1 to {MAX_REGIONS}")))
}

fn disjoint<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<LensRegion>, D::Error> {
    let regions = Vec::<LensRegion>::deserialize(from)?;
    match fault(&regions) {
        Some(fault) => Err(D::Error::custom(fault)),
        None => Ok(regions),
    }
}

/// Error in a list of regions, if any.
fn fault(regions: &[LensRegion]) -> Option<String> {
    if regions.is_empty() || regions.len() > MAX_REGIONS as usize {
        return Some(format!("{} regions; it takes 1 to {MAX_REGIONS}", regions.len()));
    }
    if let Some(index) = regions.iter().position(|region| !region.is_proper()) {
        return Some(format!("region {index} has to lie within -1 and 1, each low end below its high end"));
    }
    let pairs = (0..regions.len()).flat_map(|b| (0..b).map(move |a| (a, b)));
    let overlap = pairs.into_iter().find(|&(a, b)| regions[a].overlaps(&regions[b]));
    overlap.map(|(a, b)| format!("regions {a} and {b} overlap; move them apart"))
}

impl LensRegions {
    /// The rectangles in order, or `None` if there are none, too many, or invalid or overlapping ones.
    pub fn rectangles(&self) -> Option<Vec<LensRegion>> {
        let sane = 1..=MAX_REGIONS;
        match self {
            Self::Whole => Some(vec![LensRegion::WHOLE]),
            Self::Across(count) => Self::Grid(*count, 1).rectangles(),
            Self::Grid(columns, rows) if sane.contains(columns) && sane.contains(rows) => Some(
                (0..columns * rows).map(|i| cell([i % columns, i / columns], [*columns, *rows])).collect(),
            ),
            Self::Grid(..) => None,
            Self::Rectangles(regions) => fault(regions).is_none().then(|| regions.clone()),
        }
    }
}

fn cell(place: [u32; 2], of: [u32; 2]) -> LensRegion {
    let edge = |at: u32, of: u32| (2.0 * f64::from(at) / f64::from(of) - 1.0) as f32;
    let [u, v] = [0, 1].map(|axis| (edge(place[axis], of[axis]), edge(place[axis] + 1, of[axis])));
    LensRegion { u, v }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_grid_tiles_the_lens() {
        for (columns, rows) in [(1, 1), (2, 1), (7, 1), (3, 5)] {
            let regions = LensRegions::Grid(columns, rows).rectangles().unwrap();
            assert_eq!(fault(&regions), None);
            let area: f64 = regions.iter().map(|r| f64::from(r.u.1 - r.u.0) * f64::from(r.v.1 - r.v.0)).sum();
            assert!((area - 4.0).abs() < 1e-5);
            for pair in regions.windows(2).filter(|pair| pair[0].v == pair[1].v) {
                assert_eq!(pair[0].u.1.to_bits(), pair[1].u.0.to_bits(), "strips share their border");
            }
        }
    }

    #[test]
    fn invalid_regions_are_refused() {
        let region = |a, b| LensRegion { u: (a, b), v: (-1.0, 1.0) };
        assert!(LensRegions::Across(0).rectangles().is_none());
        assert!(LensRegions::Rectangles(vec![]).rectangles().is_none());
        for pair in [[region(-1.0, 0.1), region(0.0, 1.0)], [region(0.5, 0.5), region(0.6, 0.7)]] {
            assert!(LensRegions::Rectangles(pair.to_vec()).rectangles().is_none(), "{pair:?}");
        }
        assert!(LensRegions::Rectangles(vec![region(-1.0, 0.0), region(0.0, 1.0)]).rectangles().is_some());
        assert!(LensRegions::Rectangles(vec![region(0.0, f32::NAN)]).rectangles().is_none());
    }

    #[test]
    fn the_corners_of_the_square_go_to_the_corners_of_the_region() {
        let region = LensRegion { u: (-0.75, -0.25), v: (0.1, 0.3) };
        assert_eq!(region.map([-1.0, 1.0]), [-0.75, 0.3]);
        assert_eq!(region.map([1.0, -1.0]), [-0.25, 0.1]);
        assert_eq!(LensRegion::WHOLE.map([0.123, -0.5]), [0.123, -0.5]);
    }
}
