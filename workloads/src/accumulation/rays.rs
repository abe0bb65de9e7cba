//! Ray casting against moving triangles by brute force.

use glam::{DVec3, Vec3};
use pipeline::Draw;

use crate::scene::hit;

/// A triangle in world space, at both ends of the shutter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Face {
    /// Corners at shutter open and at shutter close.
    pub ends: [[Vec3; 3]; 2],
    /// Index of its draw.
    pub draw: usize,
}

impl Face {
    /// Corners at time `t`.
    pub fn at(&self, t: f32) -> [DVec3; 3] {
        let [open, close] = self.ends.map(|end| end.map(|corner| corner.as_dvec3()));
        std::array::from_fn(|k| open[k] + f64::from(t) * (close[k] - open[k]))
    }
}

/// Triangles for ray casting, numbered as in a pass.
#[derive(Clone, Debug, Default)]
pub struct Rays {
    faces: Vec<Face>,
}

impl Rays {
    /// The triangles of `draws`.
    pub fn new(draws: &[Draw<'_>]) -> Self {
        let faces = draws.iter().enumerate().flat_map(|(draw, of)| {
            let geometry = of.geometry;
            let ends = move |corners: &[u32; 3]| {
                [geometry.open(), geometry.close()].map(|end| corners.map(|vertex| end[vertex as usize]))
            };
            geometry.triangles().iter().map(move |corners| Face { ends: ends(corners), draw })
        });
        Self { faces: faces.collect() }
    }

    /// The triangles.
    pub fn faces(&self) -> &[Face] {
        &self.faces
    }

    /// Whether a triangle other than `but` lies between two points at time `t`.
    pub fn is_blocked(&self, from: DVec3, to: DVec3, t: f32, but: u32) -> bool {
        let inside = (1e-6, 1.0 - 1e-6);
        let others = self.faces.iter().enumerate().filter(|(id, _)| *id != but as usize);
        others
            .map(|(_, face)| hit(from, to - from, &face.at(t)))
            .any(|at| at.is_some_and(|(distance, _)| inside.0 < distance && distance < inside.1))
    }

    /// First triangle along a ray at time `t` beyond `nearest` times `along`, with its distance in lengths of
    /// `along`.
    pub fn first(&self, from: DVec3, along: DVec3, t: f32, nearest: f64) -> Option<(usize, f64)> {
        let hits = self.faces.iter().enumerate().filter_map(|(id, face)| {
            let (distance, _) = hit(from, along, &face.at(t))?;
            (distance > nearest).then_some((id, distance))
        });
        hits.min_by(|a, b| a.1.total_cmp(&b.1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ray_hits_a_moving_triangle_at_its_time() {
        let at = |x: f32| [Vec3::new(x, -1.0, 2.0), Vec3::new(x + 2.0, -1.0, 2.0), Vec3::new(x, 3.0, 2.0)];
        let rays = Rays { faces: vec![Face { ends: [at(-4.5), at(3.5)], draw: 0 }] };
        let first = |t| rays.first(DVec3::ZERO, DVec3::Z, t, 0.0);
        assert_eq!(first(0.5), Some((0, 2.0)));
        assert_eq!((first(0.0), first(1.0)), (None, None));
        assert!(rays.is_blocked(DVec3::ZERO, DVec3::Z * 4.0, 0.5, 7));
        assert!(!rays.is_blocked(DVec3::ZERO, DVec3::Z * 4.0, 0.5, 0), "its own triangle does not count");
        assert!(!rays.is_blocked(DVec3::ZERO, DVec3::Z * 1.9, 0.5, 7));
    }
}
