//! Random numbers and simple solids for the cases.

use core::f64::consts::TAU;

use glam::{DMat3, DQuat, DVec3};
use pipeline::random::{mix, unit};

use super::Case;
use crate::collision::Object;
use crate::scene::Mesh;
use crate::shapes;

/// Sequence of random numbers.
pub(super) struct Rng {
    seed: u64,
    drawn: u64,
}

impl Rng {
    pub fn new(seed: u64) -> Self {
        Self { seed: mix(seed), drawn: 0 }
    }

    pub fn within(&mut self, low: f64, high: f64) -> f64 {
        self.drawn += 1;
        low + (high - low) * unit(mix(self.seed.wrapping_add(self.drawn)))
    }

    pub fn coin(&mut self) -> bool {
        self.within(0.0, 1.0) < 0.5
    }

    pub fn vector(&mut self) -> DVec3 {
        DVec3::new(self.within(-1.0, 1.0), self.within(-1.0, 1.0), self.within(-1.0, 1.0))
    }

    /// A gap of 1e-7 to 1e-3, or a negative one if `overlap`.
    pub fn gap(&mut self, overlap: bool) -> f64 {
        let gap = 10_f64.powf(self.within(-7.0, -3.0));
        if overlap { -gap } else { gap }
    }

    /// A random rotation and scale, the same for all objects of a case.
    pub fn pose(&mut self) -> DMat3 {
        let axis = self.vector().try_normalize().unwrap_or(DVec3::X);
        let turn = DQuat::from_axis_angle(axis, self.within(0.0, TAU));
        DMat3::from_quat(turn) * 10_f64.powf(self.within(-6.0, 6.0))
    }

    /// Makes a case of objects in one pose.
    pub fn case(&mut self, moving: Vec<Moving>, collide: Vec<(usize, usize)>) -> Option<Case> {
        let pose = self.pose();
        let objects = moving.into_iter().map(|moving| moving.posed(&pose)).collect::<Option<Vec<_>>>()?;
        Some(Case { family: "", objects, collide })
    }

    pub fn pair(&mut self, moving: [Moving; 2], hit: bool) -> Option<Case> {
        self.case(moving.into(), if hit { vec![(0, 1)] } else { Vec::new() })
    }
}

/// Triangles at time 0 and time 1.
#[derive(Default)]
pub(super) struct Moving(pub Vec<[[DVec3; 3]; 2]>);

impl Moving {
    /// The triangles of a mesh, transformed by one function at each time.
    pub fn new(mesh: &Mesh, open: impl Fn(DVec3) -> DVec3, close: impl Fn(DVec3) -> DVec3) -> Self {
        let at = |vertex: u32| mesh.positions[vertex as usize].as_dvec3();
        let ends = |t: &[u32; 3]| [t.map(|v| open(at(v))), t.map(|v| close(at(v)))];
        Self(mesh.triangles.iter().map(ends).collect())
    }

    /// A mesh translated from one position to another.
    pub fn translating(mesh: &Mesh, from: DVec3, to: DVec3) -> Self {
        Self::new(mesh, |p| p + from, |p| p + to)
    }

    pub fn and(mut self, other: Self) -> Self {
        self.0.extend(other.0);
        self
    }

    /// The triangles translated at both times.
    pub fn moved(self, open: DVec3, close: DVec3) -> Self {
        let moved = |[from, to]: [[DVec3; 3]; 2]| [from.map(|p| p + open), to.map(|p| p + close)];
        Self(self.0.into_iter().map(moved).collect())
    }

    pub fn posed(self, pose: &DMat3) -> Option<Object> {
        self.placed(pose, DVec3::ZERO)
    }

    /// The object in a pose, with its origin at `place`.
    pub fn placed(self, pose: &DMat3, place: DVec3) -> Option<Object> {
        let at = |p: DVec3| (*pose * p + place).to_array();
        Object::from_ends(self.0.iter().map(|ends| ends.map(|end| end.map(at))).collect(), 0.0)
    }
}

pub(super) fn cube(side: f64) -> Mesh {
    shapes::cuboid(glam::Vec3::splat(side as f32), 0)
}

pub(super) fn ball(radius: f64) -> Mesh {
    shapes::sphere(radius, 12, 0)
}
