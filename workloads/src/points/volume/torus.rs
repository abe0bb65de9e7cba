//! A torus whose axis is time, bounded by triangles that move (Fig. 9).

use std::f64::consts::{PI, TAU};

use pipeline::conservative::{Grid, MovingTriangle};

use super::Inside;
use super::bounds::{Bounds, Hull};

/// A torus about the middle of the unit cube, its axis along the third coordinate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Torus {
    /// From the axis to the middle of the tube.
    pub ring: f64,
    /// Radius of the tube, less than that of the ring; both together at most a half.
    pub tube: f64,
}

impl Default for Torus {
    fn default() -> Self {
        Self { ring: 0.3, tube: 0.15 }
    }
}

/// Triangles over a span of time, at its ends.
pub(super) struct Layer {
    pub t: [f64; 2],
    /// Vertices at time 0 and time 1, `[x, y]`: the lines on which they move, followed all the way.
    pub ends: [Vec<[f64; 2]>; 2],
    pub triangles: Vec<[u32; 3]>,
}

/// The bounds are wider by this, so that rounding to single precision takes nothing off the torus.
const MARGIN: f64 = 1e-5;

impl Torus {
    /// Its volume (Pappus).
    pub fn volume(&self) -> f64 {
        2.0 * PI * PI * self.ring * self.tube * self.tube
    }

    /// The integral over it of the squared distance from its axis.
    pub fn moment(&self) -> f64 {
        self.volume() * (self.ring * self.ring + 0.75 * self.tube * self.tube)
    }

    /// Half the width of the ring at a time.
    fn half_width(&self, t: f64) -> f64 {
        (self.tube * self.tube - (t - 0.5) * (t - 0.5)).max(0.0).sqrt()
    }

    /// Generalized prisms around it, side by side: rings of `sectors` quadrilaterals, each two triangles, over `layers` spans of time. Within a
    /// span the half width, which is concave, is below its tangent at the middle; corners are pushed out so that chords do not cut
    /// the circle.
    pub(super) fn layers(&self, layers: u32, sectors: u32) -> Vec<Layer> {
        let first = 0.5 - self.tube;
        let height = 2.0 * self.tube / f64::from(layers);
        let span = |layer: u32| first + f64::from(layer) * height;
        (0..layers).map(|layer| self.layer([span(layer), span(layer + 1)], sectors)).collect()
    }

    fn layer(&self, t: [f64; 2], sectors: u32) -> Layer {
        let middle = 0.5 * (t[0] + t[1]);
        let slope = -(middle - 0.5) / self.half_width(middle);
        let chord = 1.0 / (PI / f64::from(sectors)).cos();
        // Narrower than nothing only outside the span.
        let width = |at: f64| self.half_width(middle) + slope * (at - middle) + MARGIN;
        let radius = |outer: bool, at: f64| {
            if outer { (self.ring + width(at)) * chord } else { self.ring - width(at) }
        };
        let corner = |at: f64, number: u32| {
            let (angle, radius) =
                (TAU * f64::from(number / 2) / f64::from(sectors), radius(number % 2 == 1, at));
            [0.5 + radius * libm::cos(angle), 0.5 + radius * libm::sin(angle)]
        };
        let ends = [0.0, 1.0].map(|at| (0..2 * sectors).map(|number| corner(at, number)).collect());
        let quad = |sector: u32| {
            let [a, b] = [2 * sector, 2 * ((sector + 1) % sectors)];
            [[a, a + 1, b + 1], [a, b + 1, b]]
        };
        Layer { t, ends, triangles: (0..sectors).flat_map(quad).collect() }
    }

    /// Its bounds over `tiles` times `tiles` tiles of the unit square, from prisms as in [`super::standard_mode`].
    pub fn bounds(&self, tiles: u32) -> Bounds {
        let (mut triangles, mut times) = (Vec::new(), Vec::new());
        for layer in self.layers(16, 32) {
            let at = |end: usize, vertex: u32| {
                let [x, y] = layer.ends[end][vertex as usize];
                [x, y, 0.0]
            };
            let moving = |corners: &[u32; 3]| {
                MovingTriangle::new(corners.map(|vertex| at(0, vertex)), corners.map(|vertex| at(1, vertex)))
            };
            triangles.extend(layer.triangles.iter().filter_map(moving));
            times.resize(triangles.len(), layer.t);
        }
        let side = 1.0 / f64::from(tiles);
        let grid = Grid { origin: [0.0; 2], tile: [side; 2], columns: tiles, rows: tiles };
        Bounds::new(&Hull { triangles: &triangles, times: &times, by_time: true }, grid)
    }
}

impl Inside for Torus {
    fn contains(&self, point: &[f64; 3], _tile: usize) -> bool {
        let [x, y, t] = point.map(|at| at - 0.5);
        let from_ring = (x * x + y * y).sqrt() - self.ring;
        from_ring * from_ring + t * t <= self.tube * self.tube
    }
}
