//! Aperture shapes, and disjoint regions of the lens for several views from one sample table.

use std::f64::consts::{FRAC_PI_4, TAU};

use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize};

/// Shape of the aperture, inscribed in the square [-1, 1]^2 of lens coordinates.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum LensShape {
    /// Round aperture.
    #[default]
    Disk,
    /// The whole square.
    Square,
    /// Regular polygon with its corners on the unit circle, like an iris of blades.
    Polygon {
        /// Number of blades and sides, 3 to 64.
        #[serde(deserialize_with = "blades")]
        blades: u32,
        /// Rotation of the first corner from `+u` towards `+v`, in degrees.
        #[serde(default)]
        rotation_deg: u16,
    },
}

fn blades<'de, D: Deserializer<'de>>(from: D) -> Result<u32, D::Error> {
    let blades = u32::deserialize(from)?;
    let fits = LensShape::BLADES.contains(&blades);
    fits.then_some(blades).ok_or_else(|| D::Error::custom(format!("{blades} blades; it takes 3 to 64")))
}

impl LensShape {
    /// Allowed number of blades.
    pub const BLADES: std::ops::RangeInclusive<u32> = 3..=64;

    /// Map a point of the unit square to the aperture, preserving area ratios. The disk uses the concentric
    /// map of Shirley and Chiu 1997. The polygon uses that map followed by `polygon`.
    pub fn map(self, unit: [f32; 2]) -> [f32; 2] {
        let [a, b] = unit.map(|c| f64::from(c) * 2.0 - 1.0);
        let on_lens = match self {
            Self::Square => [a, b],
            Self::Disk => {
                let (radius, angle) = concentric(a, b);
                [radius * libm::cos(angle), radius * libm::sin(angle)]
            }
            Self::Polygon { blades, rotation_deg } => polygon(concentric(a, b), blades, rotation_deg),
        };
        // Half an ulp may be outside the square.
        on_lens.map(|c| (c as f32).clamp(-1.0, 1.0))
    }

    /// Whether a lens position is in the aperture, border included; for rejection sampling.
    pub fn contains(self, [u, v]: [f32; 2]) -> bool {
        let [u, v] = [u, v].map(f64::from);
        match self {
            Self::Square => u.abs() <= 1.0 && v.abs() <= 1.0,
            Self::Disk => u * u + v * v <= 1.0,
            Self::Polygon { blades, rotation_deg } => (0..blades).all(|side| {
                let [from, to] = [side, side + 1].map(|k| corner(k, blades, rotation_deg));
                (to[0] - from[0]) * (v - from[1]) - (to[1] - from[1]) * (u - from[0]) >= 0.0
            }),
        }
    }
}

/// Signed radius and angle in the unit disk of a point of [-1, 1]^2 (Shirley and Chiu 1997). Equal areas of
/// the square are equal steps of angle times equal steps of squared radius.
fn concentric(a: f64, b: f64) -> (f64, f64) {
    if a == 0.0 && b == 0.0 {
        (0.0, 0.0)
    } else if a.abs() > b.abs() {
        (a, FRAC_PI_4 * b / a)
    } else {
        (b, FRAC_PI_4 * (2.0 - a / b))
    }
}

/// Map from the disk to the polygon. The angle selects a triangle between the centre and a side, and the
/// position along that side; the radius is the distance from the centre. In a triangle, area is proportional
/// to the squared distance (Turk 1990), as in the disk to the squared radius, so equal areas stay equal.
fn polygon((radius, angle): (f64, f64), blades: u32, rotation_deg: u16) -> [f64; 2] {
    let turned = if radius < 0.0 { angle + TAU / 2.0 } else { angle };
    let sides = turned.rem_euclid(TAU) / TAU * f64::from(blades);
    let side = (sides as u32).min(blades - 1);
    let along = sides - f64::from(side);
    let [from, to] = [side, side + 1].map(|k| corner(k, blades, rotation_deg));
    [0, 1].map(|axis| radius.abs() * (from[axis] + along * (to[axis] - from[axis])))
}

fn corner(index: u32, blades: u32, rotation_deg: u16) -> [f64; 2] {
    let angle = TAU * f64::from(index % blades) / f64::from(blades) + f64::from(rotation_deg).to_radians();
    [libm::cos(angle), libm::sin(angle)]
}

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

    const SHAPES: [LensShape; 6] = [
        LensShape::Disk,
        LensShape::Square,
        LensShape::Polygon { blades: 3, rotation_deg: 0 },
        LensShape::Polygon { blades: 5, rotation_deg: 17 },
        LensShape::Polygon { blades: 6, rotation_deg: 30 },
        LensShape::Polygon { blades: 12, rotation_deg: 359 },
    ];

    /// Images of the centres of `n` x `n` cells of the unit square.
    fn grid(shape: LensShape, n: u32) -> impl Iterator<Item = [f32; 2]> {
        let at = move |i: u32| (i as f32 + 0.5) / n as f32;
        (0..n * n).map(move |i| shape.map([at(i % n), at(i / n)]))
    }

    #[test]
    fn points_stay_in_the_aperture() {
        for shape in SHAPES {
            for point in grid(shape, 150) {
                assert!(shape.contains(point.map(|c| c * 0.999_999)), "{shape:?}: {point:?}");
            }
        }
    }

    #[test]
    fn equal_areas_hold_equal_shares() {
        // Each cell of a coarse grid gets its share of the points; areas of the aperture in cells are
        // measured by rejection on a finer grid.
        let (n, cells) = (250, 8);
        let cell = |[u, v]: [f32; 2]| {
            let at = |c: f32| (((c + 1.0) * 0.5 * cells as f32) as usize).min(cells - 1);
            at(v) * cells + at(u)
        };
        for shape in SHAPES {
            let (mut found, mut due) = (vec![0_u32; cells * cells], vec![0_u32; cells * cells]);
            grid(shape, n).for_each(|point| found[cell(point)] += 1);
            grid(LensShape::Square, 2 * n).filter(|p| shape.contains(*p)).for_each(|p| due[cell(p)] += 1);
            let total: u32 = due.iter().sum();
            let area = 4.0 * f64::from(total) / f64::from(4 * n * n);
            let exact = match shape {
                LensShape::Square => 4.0,
                LensShape::Disk => TAU / 2.0,
                LensShape::Polygon { blades, .. } => {
                    let n = f64::from(blades);
                    0.5 * n * libm::sin(TAU / n)
                }
            };
            assert!((area - exact).abs() < 0.01, "{shape:?}: area {area} for {exact}");
            for (found, due) in found.iter().zip(&due) {
                let (found, due) = (f64::from(*found) / f64::from(n * n), f64::from(*due) / f64::from(total));
                assert!((found - due).abs() < 0.0015, "{shape:?}: share {found} for {due}");
            }
        }
    }

    #[test]
    fn a_quarter_of_the_points_lies_within_half_the_size() {
        for shape in SHAPES {
            let inner = grid(shape, 200).filter(|p| shape.contains(p.map(|c| 2.0 * c))).count();
            let share = inner as f64 / 40_000.0;
            assert!((share - 0.25).abs() < 0.005, "{shape:?}: {share}");
        }
    }

    #[test]
    fn a_polygon_is_turned_as_asked() {
        let tip = |rotation_deg| LensShape::Polygon { blades: 3, rotation_deg }.contains([0.99, 0.0]);
        assert!(tip(0) && !tip(60) && tip(120));
    }

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
