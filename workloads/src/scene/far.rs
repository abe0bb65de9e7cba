//! Coordinates far from the origin: positions relative to the middle of the scene, and loss of precision.

use glam::{DAffine3, DVec3};
use warnings::{Code, Warning};

/// Distance from the origin, in sizes of the scene, beyond which positions are relative to the scene's middle.
const FAR: f64 = 100.0;

/// Least number of f32 values along the longest side of a mesh; with fewer, rounding is visible.
const MIN_STEPS: f64 = 4096.0;

/// A bounding box of points.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bounds {
    low: DVec3,
    high: DVec3,
}

impl Default for Bounds {
    fn default() -> Self {
        Self { low: DVec3::INFINITY, high: DVec3::NEG_INFINITY }
    }
}

impl Bounds {
    /// The bounding box of `points`.
    pub fn of(points: impl IntoIterator<Item = DVec3>) -> Self {
        let mut bounds = Self::default();
        points.into_iter().for_each(|point| bounds.add(point));
        bounds
    }

    pub fn add(&mut self, point: DVec3) {
        self.low = self.low.min(point);
        self.high = self.high.max(point);
    }

    /// Includes a box that is transformed by `matrix`.
    pub fn add_placed(&mut self, other: &Self, matrix: &DAffine3) {
        for corner in 0..8 {
            let choose =
                |axis: usize| if corner >> axis & 1 == 0 { other.low[axis] } else { other.high[axis] };
            self.add(matrix.transform_point3(DVec3::new(choose(0), choose(1), choose(2))));
        }
    }

    /// The longest side, and the largest coordinate; `None` if the box is empty, a point or not finite.
    fn size_and_distance(&self) -> Option<[f64; 2]> {
        let size = (self.high - self.low).max_element();
        let distance = self.low.abs().max(self.high.abs()).max_element();
        (size > 0.0 && distance.is_finite()).then_some([size, distance])
    }

    /// Origin to subtract from positions before rounding to f32, so that the shape keeps its precision; zero unless
    /// the box is far from the origin for its size.
    pub fn origin(&self) -> DVec3 {
        match self.size_and_distance() {
            // Rounded to few bits, so that the subtraction is exact.
            Some([size, distance]) if distance > FAR * size => {
                (0.5 * self.low + 0.5 * self.high).as_vec3().as_dvec3()
            }
            _ => DVec3::ZERO,
        }
    }

    /// Number of f32 values along the longest side, if it is too small for the shape.
    fn too_few_steps(&self) -> Option<f64> {
        let [size, distance] = self.size_and_distance()?;
        let steps = size / (distance * f64::from(f32::EPSILON));
        (steps < MIN_STEPS).then_some(steps)
    }

    /// Warns if the surface `name`, whose positions are f32 and fill the box, is distorted by rounding.
    pub fn rounded(&self, name: &str) -> Option<Warning> {
        let steps = self.too_few_steps()?;
        let what = "stored so far from the origin that 32-bit positions lose the shape: move the geometry to the origin in the \
                    program that made it";
        let detail =
            format!("`{name}`: about {:.0} different positions along its longest side", steps.max(1.0));
        Some(Warning::about(Code::CoordinatesFarFromOrigin, "surface", what, detail))
    }
}

/// Reports the origin of positions.
pub(super) fn recentred(origin: DVec3) -> Warning {
    let message = format!(
        "the scene is more than {FAR} times its size away from its origin, so positions are computed relative to ({}, {}, {}), \
         which keeps its shape; coordinates in files and flags stay as they are",
        origin.x, origin.y, origin.z
    );
    Warning::new(Code::CoordinatesRecentred, message)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn patch(at: DVec3) -> Bounds {
        Bounds::of([at - 0.5, at + 0.5])
    }

    #[test]
    fn only_what_is_far_for_its_size_is_recentred() {
        let utm = DVec3::new(500_000.0, 0.0, 4_000_000.0);
        assert_eq!(patch(utm).origin(), utm);
        for near in [DVec3::ZERO, DVec3::new(50.0, -90.0, 0.0)] {
            assert_eq!(patch(near).origin(), DVec3::ZERO);
        }
        for nothing in [Bounds::default(), Bounds::of([utm]), Bounds::of([utm, DVec3::INFINITY])] {
            assert_eq!((nothing.origin(), nothing.too_few_steps()), (DVec3::ZERO, None));
        }
    }

    #[test]
    fn a_mesh_that_f32_cannot_hold_is_reported() {
        let square =
            |x: f64, side: f64| Bounds::of([DVec3::new(x, 0.0, 0.0), DVec3::new(x + side, 1.0, 0.0)]);
        assert!(square(4e6, 1.0).rounded("a").unwrap().to_string().contains("`a`: about 2 different"));
        // Four kilometres at the same distance have a resolution of half a metre, which is enough.
        assert!(square(4e6, 4e3).rounded("b").is_none());
        assert!(square(100.0, 1.0).rounded("c").is_none() && Bounds::default().rounded("d").is_none());
    }

    #[test]
    fn a_placed_box_holds_its_corners() {
        let turn = DAffine3::from_rotation_z(std::f64::consts::FRAC_PI_2);
        let mut all = Bounds::default();
        all.add_placed(&Bounds::of([DVec3::ZERO, DVec3::new(2.0, 1.0, 0.0)]), &turn);
        assert!((all.low - DVec3::new(-1.0, 0.0, 0.0)).length() < 1e-12);
        assert!((all.high - DVec3::new(0.0, 2.0, 0.0)).length() < 1e-12);
    }
}
