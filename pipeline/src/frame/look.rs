//! Shading a sample where it is: its point of the surface at its own place, lens position and time.

use glam::{Vec2, Vec3, Vec4};

use super::pass::Pass;
use super::surface::Surface;
use crate::geometry::Viewport;
use crate::sampling::{Sample, TileSamples};
use crate::setup::Corner;
use crate::shading::{QuadAccess, weights_at};
use crate::texture::{Footprint, Sampler};

/// A triangle as one sample sees it.
pub(super) struct Look {
    /// The vertices at the sample's time, moved by the lens as far as that does not depend on depth. In an orthographic view they are
    /// homogeneous points seen from the sample.
    vertices: [[f32; 3]; 3],
    /// Where the sample looks, the other part of the lens included.
    at: [f32; 2],
    t: f32,
}

impl Look {
    /// The look of the sample in `slot` of a tile.
    pub fn of_slot(corners: &[Corner; 3], samples: &TileSamples, slot: usize) -> Self {
        let rays = [0, 1].map(|axis| [samples.slope[axis][slot], samples.lens[axis][slot]]);
        Self::new(corners, rays, samples.t[slot], samples.parallel)
    }

    /// The look of a sample of pixel (`px`, `py`).
    fn of_sample(corners: &[Corner; 3], pass: &Pass<'_>, [px, py]: [u32; 2], s: &Sample) -> Self {
        let (shear, viewport) = (&pass.projection.shear, pass.settings.viewport);
        let x = Viewport::edge(px, viewport.width()) + s.x;
        let y = Viewport::edge(py, viewport.height()) + s.y;
        Self::new(corners, [shear.ray(0, x, s.u), shear.ray(1, y, s.v)], s.t, shear.parallel)
    }

    /// Along each axis a slope and a base ([`crate::geometry::Shear::ray`]).
    fn new(corners: &[Corner; 3], [across, down]: [[f32; 2]; 2], t: f32, parallel: bool) -> Self {
        let vertices = corners.map(|corner| {
            let [x, y, w] = corner.at(t);
            let [x, y] = [x - across[1], y - down[1]];
            if parallel { [x - across[0] * w, y - down[0] * w, 1.0] } else { [x, y, w] }
        });
        Self { vertices, at: if parallel { [0.0; 2] } else { [across[0], down[0]] }, t }
    }

    /// Barycentric weights of the point seen so many pixels to the right and below, at the same lens position and time.
    fn weights(&self, right: f32, below: f32) -> [f32; 3] {
        weights_at(&self.vertices, [self.at[0] + right, self.at[1] + below])
    }
}

impl Surface<'_> {
    /// Linear RGB radiance at a sample's own point.
    pub fn shade_at(&self, look: &Look) -> Vec3 {
        let weights = look.weights(0.0, 0.0);
        let texel = self.sampler().map_or(Vec4::ONE, |sampler| {
            sampler.sample(self.uv(weights), &self.footprint_at(&sampler, look))
        });
        self.shader().shade(&self.point_at(weights, look.t), texel)
    }

    /// Bilinear fetches of the four lanes of a quad of pixels at one sample index, and each line of memory they read.
    /// `samples` holds those of each pixel of the quad; a helper lane works at the sample of its own pixel.
    pub fn fetch_at(
        &self,
        pass: &Pass<'_>,
        access: &QuadAccess,
        samples: &[Vec<Sample>; 4],
        mut line: impl FnMut(u64),
    ) -> u32 {
        let Some(sampler) = self.sampler() else { return 0 };
        let corners = self.corners();
        let lanes = [[0, 0], [1, 0], [0, 1], [1, 1]].into_iter().zip(samples);
        lanes.fold(0, |fetches, (place, of_pixel)| {
            let pixel = [0, 1].map(|axis| (2 * access.quad[axis] + place[axis]) as u32);
            let look = Look::of_sample(corners, pass, pixel, &of_pixel[access.sample as usize]);
            let footprint = self.footprint_at(&sampler, &look);
            sampler.lines(self.uv(look.weights(0.0, 0.0)), &footprint, &mut line);
            fetches + Sampler::fetches(&footprint)
        })
    }

    /// The footprint of a pixel about the sample's point.
    fn footprint_at(&self, sampler: &Sampler<'_>, look: &Look) -> Footprint {
        let uv = |right, below| -> Vec2 { self.uv(look.weights(right, below)) };
        let here = uv(0.0, 0.0);
        sampler.footprint(uv(1.0, 0.0) - here, uv(0.0, 1.0) - here)
    }
}
