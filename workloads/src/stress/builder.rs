//! Builder of stress scenes: image positions in pixels, depths in scene units, random numbers from a hash.

use glam::{Affine3A, DVec2, DVec3};
use pipeline::random::{mix, unit};
use pipeline::{Camera, CameraError, Lens, SampleTable, Viewport};

use super::{Size, StressScene};

/// Uniform random numbers from a hash of the seed and a counter.
#[derive(Clone, Copy, Debug)]
struct Rng {
    seed: u64,
    drawn: u64,
}

/// A scene under construction. The camera looks along z, with a field of view of 90 degrees, from one unit
/// before everything.
pub(super) struct SceneBuilder {
    pub size: Size,
    rng: Rng,
    scene: StressScene,
}

/// Near depth of the camera.
pub(super) const NEAR: f64 = 0.25;

impl SceneBuilder {
    pub fn new(size: Size, viewport: Viewport, samples: SampleTable, seed: u64) -> Result<Self, CameraError> {
        let camera = Camera::new(Affine3A::IDENTITY, 1.0, NEAR as f32)?;
        let (open, close, triangles) = (Vec::new(), Vec::new(), Vec::new());
        let scene = StressScene { camera, viewport, samples, open, close, triangles };
        Ok(Self { size, rng: Rng { seed: mix(seed), drawn: 0 }, scene })
    }

    pub fn finish(self) -> StressScene {
        self.scene
    }

    /// Adds a lens whose circle of confusion has a radius of `blur_px` at infinity, focused at `focus`.
    pub fn lens(&mut self, blur_px: f64, focus: f64) -> Result<(), CameraError> {
        self.lens_of(blur_px / self.scale() * focus, focus)
    }

    /// Adds a lens of `radius` in scene units; none if it is zero.
    pub fn lens_of(&mut self, radius: f64, focus: f64) -> Result<(), CameraError> {
        let lens = if radius > 0.0 { Some(Lens::new(radius as f32, focus as f32)?) } else { None };
        self.scene.camera = self.scene.camera.with_lens(lens);
        Ok(())
    }

    /// Scales the geometry so far, the lens and the near depth by `factor`.
    pub fn enlarge(&mut self, factor: f64) -> Result<(), CameraError> {
        for vertex in self.scene.open.iter_mut().chain(&mut self.scene.close) {
            *vertex = (vertex.as_dvec3() * factor).as_vec3();
        }
        let lens = self.scene.camera.lens();
        self.scene.camera = Camera::new(Affine3A::IDENTITY, 1.0, (NEAR * factor) as f32)?;
        lens.map_or(Ok(()), |l| self.lens_of(f64::from(l.radius()) * factor, f64::from(l.focus()) * factor))
    }

    /// Replaces the samples.
    pub fn sample_with(&mut self, samples: SampleTable) {
        self.scene.samples = samples;
    }

    pub fn samples(&self) -> &SampleTable {
        &self.scene.samples
    }

    pub fn side(&self) -> f64 {
        f64::from(self.size.side_px)
    }

    /// Pixels per unit at depth one.
    pub fn scale(&self) -> f64 {
        0.5 * self.side()
    }

    /// World point at image position `px` (from the image centre, y upwards) and depth `w`.
    pub fn at(&self, px: DVec2, w: f64) -> DVec3 {
        (px / self.scale() * w).extend(w)
    }

    /// Random number between `low` and `high`.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.rng.next()
    }

    /// Random number between `low` and `high`, uniform in its logarithm.
    pub fn octaves(&mut self, low: f64, high: f64) -> f64 {
        low * libm::exp2(self.between(0.0, libm::log2(high / low)))
    }

    /// Random image position.
    pub fn position(&mut self) -> DVec2 {
        let half = 0.5 * self.side();
        DVec2::new(self.between(-half, half), self.between(-half, half))
    }

    /// Random direction in the image.
    pub fn direction(&mut self) -> DVec2 {
        let turn = self.between(0.0, std::f64::consts::TAU);
        DVec2::new(libm::cos(turn), libm::sin(turn))
    }

    /// Corners of a randomly rotated equilateral triangle around the origin, with sides of `size_px`.
    pub fn corners(&mut self, size_px: f64) -> [DVec2; 3] {
        let first = self.direction() * (size_px / libm::sqrt(3.0));
        let (sin, cos) = (libm::sqrt(0.75), -0.5);
        [0, 1, 2].map(|k| {
            let turn = [DVec2::X, DVec2::new(cos, sin), DVec2::new(cos, -sin)][k];
            turn.rotate(first)
        })
    }

    /// Adds a triangle with its own vertices, given at both ends of the shutter.
    pub fn triangle(&mut self, open: [DVec3; 3], close: [DVec3; 3]) {
        let corners = [0, 1, 2].map(|k| self.vertex(open[k], close[k]));
        self.face(corners);
    }

    /// Adds a vertex and returns its index.
    pub fn vertex(&mut self, open: DVec3, close: DVec3) -> u32 {
        self.scene.open.push(open.as_vec3());
        self.scene.close.push(close.as_vec3());
        self.scene.open.len() as u32 - 1
    }

    /// Adds a triangle of existing vertices.
    pub fn face(&mut self, corners: [u32; 3]) {
        self.scene.triangles.push(corners);
    }
}

impl Rng {
    fn next(&mut self) -> f64 {
        self.drawn += 1;
        let word = mix(self.seed.wrapping_add(self.drawn.wrapping_mul(0x9E37_79B9_7F4A_7C15)));
        unit(word)
    }
}
