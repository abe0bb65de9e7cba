//! Drawing of beams into an image.

use pipeline::Lane;
use rayon::prelude::*;

use super::cover::{Cover, TILE_PX, times};
use super::eye::Seen;
use super::light::PixelInBeam;
use super::{Beam, Eye, Light, Method};

/// An image of light with its work; pixels row by row from the top left.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Light of each pixel, in the unit of the requested [`Light`]; empty if none was requested.
    pub light: Vec<f64>,
    /// Shader executions of each pixel.
    pub runs: Vec<u32>,
    /// Shader executions that found light.
    pub useful: u64,
    /// Tiles of 8x8 pixels touched, by beams or faces of bounding volumes.
    pub tiles: u64,
    /// Pixels tested.
    pub tests: u64,
    /// Beams that were skipped, because they have no volume or reach behind the camera.
    pub skipped: u64,
}

/// One tile of one beam, in the order in which hardware processes it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Covered {
    /// Index of the beam.
    pub beam: u32,
    /// Tile of 8x8 pixels, row by row from the top left.
    pub tile: u32,
    /// Mask of shaded pixels, row by row.
    pub pixels: u64,
}

/// Rows of tiles per parallel task.
const BAND_TILES: u32 = 2;

impl Picture {
    /// Total shader executions.
    pub fn total_runs(&self) -> u64 {
        self.runs.iter().map(|runs| u64::from(*runs)).sum()
    }

    /// Share of shader executions that find light; 0 if there are none.
    pub fn useful_share(&self) -> f64 {
        self.useful as f64 / self.total_runs().max(1) as f64
    }

    /// Largest difference of a pixel's light from that in another image of the same view.
    pub fn farthest(&self, other: &Self) -> f64 {
        self.light.iter().zip(&other.light).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }
}

/// Draws `beams` by `method`. With `light`, sums the light in the order of the beams; otherwise counts
/// executions only.
pub fn draw(beams: &[Beam], eye: &Eye, method: Method, light: Option<Light>) -> Picture {
    draw_with_work(beams, eye, method, light, false).0
}

/// The same, with the work of every tile if `log`, sorted by beam and tile.
pub(super) fn draw_with_work(
    beams: &[Beam],
    eye: &Eye,
    method: Method,
    light: Option<Light>,
    log: bool,
) -> (Picture, Vec<Covered>) {
    let seen: Vec<Option<Seen>> = beams.par_iter().map(|beam| eye.see(beam)).collect();
    let rows = eye.viewport().height().div_ceil(TILE_PX);
    let bands: Vec<Band> = (0..rows.div_ceil(BAND_TILES))
        .into_par_iter()
        .map(|band| {
            let mut band =
                Band::new(eye, light.is_some(), [band * BAND_TILES, ((band + 1) * BAND_TILES).min(rows)]);
            band.draw(&seen, eye, method, light, log);
            band
        })
        .collect();
    let skipped = seen.iter().filter(|seen| seen.is_none()).count() as u64;
    let mut all = Picture { light: Vec::new(), runs: Vec::new(), useful: 0, tiles: 0, tests: 0, skipped };
    let mut work = Vec::new();
    for band in bands {
        all.light.extend(band.light);
        all.runs.extend(band.runs);
        (all.useful, all.tiles, all.tests) =
            (all.useful + band.useful, all.tiles + band.tiles, all.tests + band.tests);
        work.extend(band.work);
    }
    work.sort_by_key(|work| (work.beam, work.tile));
    (all, work)
}

/// A band of rows of tiles.
struct Band {
    rows: [u32; 2],
    light: Vec<f64>,
    runs: Vec<u32>,
    useful: u64,
    tiles: u64,
    tests: u64,
    work: Vec<Covered>,
}

impl Band {
    fn new(eye: &Eye, lit: bool, rows: [u32; 2]) -> Self {
        let height = (rows[1] * TILE_PX).min(eye.viewport().height()) - rows[0] * TILE_PX;
        let pixels = (height * eye.viewport().width()) as usize;
        let light = if lit { vec![0.0; pixels] } else { Vec::new() };
        Self { rows, light, runs: vec![0; pixels], useful: 0, tiles: 0, tests: 0, work: Vec::new() }
    }

    fn draw(&mut self, seen: &[Option<Seen>], eye: &Eye, method: Method, light: Option<Light>, log: bool) {
        let mut cover = Cover::new(eye, method, self.rows[0]..self.rows[1]);
        let columns = eye.viewport().width().div_ceil(TILE_PX);
        for (number, seen) in (0..).zip(seen) {
            let Some(seen) = seen else { continue };
            cover.each(seen, |first, pixels| {
                self.shade(eye, seen, light, first, pixels);
                if log {
                    let tile = first[1] / TILE_PX * columns + first[0] / TILE_PX;
                    self.work.push(Covered { beam: number, tile, pixels });
                }
            });
        }
        (self.tiles, self.tests) = (cover.tiles, cover.tests);
    }

    fn shade(&mut self, eye: &Eye, seen: &Seen, light: Option<Light>, first: [u32; 2], pixels: u64) {
        let mut unshaded = pixels;
        while unshaded != 0 {
            let bit = unshaded.trailing_zeros();
            unshaded &= unshaded - 1;
            let pixel = [first[0] + bit % TILE_PX, first[1] + bit / TILE_PX];
            let place = ((pixel[1] - self.rows[0] * TILE_PX) * eye.viewport().width() + pixel[0]) as usize;
            self.runs[place] += 1;
            if let Some(light) = light {
                let at = eye.pixel_centre(pixel);
                let times = Some(times(eye, seen, at));
                let found = light.shade(&Lane::default(), &PixelInBeam { eye, seen, at, times });
                self.light[place] += found;
                self.useful += u64::from(found > 0.0);
            }
        }
    }
}
