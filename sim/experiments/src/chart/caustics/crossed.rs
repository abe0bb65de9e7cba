//! Sides that cross: the same light through the same number of triangles, which stand ever more along it.

use glam::DVec3;
use serde::Serialize;
use workloads::caustics::generator::Ocean as Water;
use workloads::caustics::{
    Beam, Eye, Floor, Light, Method, Picture, Squares, accuracy_warnings, crossing, draw, error,
};

use super::Effort;
use super::view::{SQUARE_PX, above, from_the_side, water};
use crate::study::StudyError;
use output::progress::Bar;

/// Depth of the water in metres: half of all beams fold above the floor.
const DEPTH_M: f64 = 8.0;
/// Slope of the waves.
const SLOPE: f64 = 0.3;
/// Beams go on below the floor, so that it does not lie at their ends, where pleats would not matter.
const OVERSHOOT: f64 = 0.25;
/// Photons in the volume, of all beams.
const PHOTONS: usize = 8_000_000;

/// One pleat of one surface.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Crossed {
    /// Squares along a side.
    pub cells: u32,
    /// How far every other column of corners lies down its light, as a part of its length.
    pub pleat: f64,
    /// For how much of their length sides of beams cross.
    pub crossing: f64,
    /// Mean difference of the light on the floor from photons refracted at the waves themselves, as a part of its mean.
    pub floor_error: f64,
    /// That of other photons of that kind.
    pub noise: f64,
    /// Mean difference of the light in the volume from photons through the same triangles, as a part of its mean.
    pub volume_error: f64,
    /// The part of the light in the volume that all methods miss, by the same photons.
    pub missing: f64,
    /// The part of the light in the volume that the refined bound without cuts loses.
    pub lost: f64,
    /// Shader executions by method, in the order of [`Method::ALL`].
    pub executions: [u64; 4],
    /// The share of them that finds light, likewise.
    pub useful: [f64; 4],
    /// Largest difference of a pixel from the image of the moving triangles, by any method of [`Method::ALL`].
    pub difference: f64,
    /// Whether the run warns of crossed sides.
    pub warned: bool,
}

/// Surfaces, views and photons of one number of triangles.
struct Bench {
    surface: Water,
    above: Eye,
    aside: Eye,
    /// Light on the floor, and by other photons.
    known: [Vec<f64>; 2],
}

/// Every pleat of every number of triangles.
pub(super) fn measure(effort: &Effort, bar: &Bar) -> Result<Vec<Crossed>, StudyError> {
    let mut rows = Vec::new();
    for &cells in effort.pleated_cells {
        let bench = Bench::new(effort, cells)?;
        for &pleat in effort.pleats {
            rows.push(bench.row(pleat));
            bar.inc();
        }
    }
    Ok(rows)
}

fn floor() -> Floor {
    Floor { height_m: -DEPTH_M }
}

impl Bench {
    fn new(effort: &Effort, cells: u32) -> Result<Self, StudyError> {
        let surface = Water { overshoot: OVERSHOOT, depth_m: DEPTH_M, ..water(cells, SLOPE) };
        let middle = DVec3::new(1.5, -0.6 * DEPTH_M, 1.0);
        let aside = from_the_side(middle, DEPTH_M, effort.sweep_px)?;
        let above = above(effort.floor_px)?;
        let squares = Squares { eye: &above, side_px: SQUARE_PX };
        let known = [1, 2].map(|seed| squares.on_floor(&surface, 0.0, &floor(), [effort.rays, seed]));
        Ok(Self { surface, above, aside, known })
    }

    fn row(&self, pleat: f64) -> Crossed {
        let surface = Water { pleat, ..self.surface.clone() };
        let beams = surface.beams(0.0);
        let pictures = Method::ALL.map(|method| draw(&beams, &self.aside, method, Some(Light::Volume)));
        let ours = &pictures[0];
        let uncut = draw(&beams, &self.aside, Method::Uncut, Some(Light::Volume));
        let sum = |picture: &Picture| picture.light.iter().sum::<f64>();
        let (volume_error, missing) = self.volume(&beams, ours);
        Crossed {
            cells: surface.cells,
            pleat,
            crossing: crossing(&beams),
            floor_error: self.floor_error(&beams),
            noise: error(&self.known[1], &self.known[0]),
            volume_error,
            missing,
            lost: 1.0 - sum(&uncut) / sum(ours),
            executions: pictures.each_ref().map(Picture::total_runs),
            useful: pictures.each_ref().map(Picture::useful_share),
            difference: pictures.iter().map(|other| ours.farthest(other)).fold(0.0, f64::max),
            warned: accuracy_warnings(&surface, &beams)
                .iter()
                .any(|warning| warning.code == "caustics-crossed"),
        }
    }

    fn floor_error(&self, beams: &[Beam]) -> f64 {
        let squares = Squares { eye: &self.above, side_px: SQUARE_PX };
        let image = draw(beams, &self.above, Method::Moving, Some(Light::Floor(floor())));
        error(&squares.of_image(&image.light), &self.known[0])
    }

    /// The error of the light in the volume, and the part of it that is missing.
    fn volume(&self, beams: &[Beam], ours: &Picture) -> (f64, f64) {
        let squares = Squares { eye: &self.aside, side_px: SQUARE_PX };
        let (found, photons) =
            (squares.of_image(&ours.light), squares.in_volume(beams, (PHOTONS / beams.len()) as u32));
        (error(&found, &photons), 1.0 - found.iter().sum::<f64>() / photons.iter().sum::<f64>())
    }
}
