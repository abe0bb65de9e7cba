//! All beams, one after the other, into an image.

use rayon::prelude::*;

use super::cover::{Cover, TILE_PX};
use super::eye::Seen;
use super::{Beam, Eye, Light, Method};

/// What was drawn, pixels row by row from the top left.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// The light of each pixel, in the unit of what was asked for ([`Light`]); empty where nothing was.
    pub light: Vec<f64>,
    /// Shader executions of each pixel.
    pub runs: Vec<u32>,
    /// Executions that found light.
    pub useful: u64,
    /// Tiles of 8x8 pixels found to be touched, of beams or faces of bodies.
    pub tiles: u64,
    /// Pixels whose middle was tested.
    pub tests: u64,
    /// Beams that could not be drawn: without any volume, or reaching behind the camera.
    pub left_out: u64,
}

/// One tile of one beam, told in the order in which hardware would meet it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Covered {
    /// The beam.
    pub beam: u32,
    /// The tile of 8x8 pixels, row by row from the top left.
    pub tile: u32,
    /// Its pixels that are shaded, one bit each, row by row.
    pub pixels: u64,
}

/// Rows of tiles that are drawn together.
const BAND_TILES: u32 = 2;

impl Picture {
    /// Shader executions in all.
    pub fn total_runs(&self) -> u64 {
        self.runs.iter().map(|runs| u64::from(*runs)).sum()
    }

    /// The share of them that finds light; 0 where nothing runs.
    pub fn useful_share(&self) -> f64 {
        self.useful as f64 / self.total_runs().max(1) as f64
    }

    /// The largest difference of the light of a pixel from that of another picture of the same view.
    pub fn farthest(&self, other: &Self) -> f64 {
        self.light.iter().zip(&other.light).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }
}

/// Draws `beams` by `method`. With `light` it is summed up, in the order of the beams; without, executions are counted only.
pub fn draw(beams: &[Beam], eye: &Eye, method: Method, light: Option<Light>) -> Picture {
    draw_with_work(beams, eye, method, light, false).0
}

/// The same, with the work of every tile where that is asked for: beam by beam, and tile by tile in each band of rows.
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
    let left_out = seen.iter().filter(|seen| seen.is_none()).count() as u64;
    let mut all = Picture { light: Vec::new(), runs: Vec::new(), useful: 0, tiles: 0, tests: 0, left_out };
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

/// Some rows of the image.
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
        let mut left = pixels;
        while left != 0 {
            let bit = left.trailing_zeros();
            left &= left - 1;
            let pixel = [first[0] + bit % TILE_PX, first[1] + bit / TILE_PX];
            let place = ((pixel[1] - self.rows[0] * TILE_PX) * eye.viewport().width() + pixel[0]) as usize;
            self.runs[place] += 1;
            if let Some(light) = light {
                let found = light.shade(eye, seen, eye.middle(pixel));
                self.light[place] += found;
                self.useful += u64::from(found > 0.0);
            }
        }
    }
}
