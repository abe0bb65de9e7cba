//! Light reflected once inside a ring.

use std::f64::consts::TAU;

use glam::DVec3;

use crate::caustics::Beam;
use crate::caustics::optics::reflect;

/// Light source of a ring.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// Parallel light along +x; the caustic is a nephroid.
    Parallel,
    /// A point of the ring at angle 0; the caustic is a cardioid.
    OnRing,
}

/// A cylindrical mirror around the y axis, as a strip of triangles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MirrorRing {
    /// Radius in metres.
    pub radius_m: f64,
    /// Height of the strip in metres.
    pub height_m: f64,
    /// Light source.
    pub source: Source,
    /// First and last lit angle, in radians.
    pub angles: [f64; 2],
    /// Number of segments.
    pub segments: u32,
}

impl MirrorRing {
    /// A point of the ring, and the direction of its reflected light, both horizontal.
    fn corner(&self, angle: f64) -> (DVec3, DVec3) {
        let outward = DVec3::new(libm::cos(angle), 0.0, libm::sin(angle));
        let position = self.radius_m * outward;
        let incoming = match self.source {
            Source::Parallel => DVec3::X,
            Source::OnRing => (position - self.radius_m * DVec3::X).normalize_or(-DVec3::X),
        };
        (position, reflect(incoming, outward))
    }

    /// Two beams per segment, each up to where its light meets the ring again. The source has one watt per
    /// square metre of cross-section, or one watt per radian.
    pub fn beams(&self) -> Vec<Beam> {
        let angle = |n: u32| {
            let [from, to] = self.angles;
            from + (to - from) * f64::from(n) / f64::from(self.segments)
        };
        let mut beams = Vec::new();
        for n in 0..self.segments {
            let [(a, along_a), (b, along_b)] = [angle(n), angle(n + 1)].map(|angle| self.corner(angle));
            let chord = |p: DVec3, along: DVec3| p - 2.0 * p.dot(along) * along;
            let (end_a, end_b) = (chord(a, along_a), chord(b, along_b));
            let up = self.height_m * DVec3::Y;
            let flux_w = 0.5 * self.height_m * self.across(a, b);
            beams.push(Beam { open: [a, b, b + up], close: [end_a, end_b, end_b + up], flux_w });
            beams.push(Beam { open: [a, b + up, a + up], close: [end_a, end_b + up, end_a + up], flux_w });
        }
        beams
    }

    /// Flux between two points, per metre of height.
    fn across(&self, a: DVec3, b: DVec3) -> f64 {
        match self.source {
            Source::Parallel => (b.z - a.z).abs(),
            // From a point of the ring, a chord subtends half of its central angle.
            Source::OnRing => 0.5 * TAU.min(libm::fabs(libm::atan2(a.cross(b).y, a.dot(b)))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Light source of a ring.
    fn caustic(ring: &MirrorRing) -> Vec<(f64, DVec3)> {
        let beams = ring.beams();
        let focus = |(n, beam): (usize, &Beam)| {
            let t = *beam.folds().first()?;
            let at = beam.corners(t);
            let share = (n / 2) as f64 + 0.5;
            let angle = ring.angles[0] + (ring.angles[1] - ring.angles[0]) * share / f64::from(ring.segments);
            Some((angle, DVec3::new((at[0].x + at[1].x) / 2.0, 0.0, (at[0].z + at[1].z) / 2.0)))
        };
        beams.iter().enumerate().step_by(2).filter_map(focus).collect()
    }

    /// Circular mirror in parallel light: the nephroid `(R / 4) (3 cos a - cos 3a, 3 sin a - sin 3a)`, with
    /// the focus at `(R / 2) cos a` along the reflected ray, and the cusp at `R / 2`.
    #[test]
    fn parallel_light_makes_a_nephroid() {
        let ring = MirrorRing {
            radius_m: 2.0,
            height_m: 1.0,
            source: Source::Parallel,
            angles: [-1.4, 1.4],
            segments: 3000,
        };
        let found = caustic(&ring);
        assert_eq!(found.len(), 3000);
        for (a, point) in found {
            let known =
                0.5 * DVec3::new(3.0 * a.cos() - (3.0 * a).cos(), 0.0, 3.0 * a.sin() - (3.0 * a).sin());
            assert!((point - known).length() < 2e-3, "{a}: {point} {known}");
            let along = (point - ring.corner(a).0).length();
            assert!((along - a.cos()).abs() < 2e-3, "{a}");
        }
    }

    /// Source on the circle: the cardioid `(2 cos a + cos 2a, 2 sin a + sin 2a) / 3` of the unit circle, with
    /// its cusp at -1/3, and the focus at a third of the incoming chord.
    #[test]
    fn light_from_the_ring_makes_a_cardioid() {
        let ring = MirrorRing {
            radius_m: 1.0,
            height_m: 1.0,
            source: Source::OnRing,
            angles: [0.5, 3.1],
            segments: 3000,
        };
        for (a, point) in caustic(&ring) {
            let known =
                DVec3::new(2.0 * a.cos() + (2.0 * a).cos(), 0.0, 2.0 * a.sin() + (2.0 * a).sin()) / 3.0;
            assert!((point - known).length() < 1e-3, "{a}: {point} {known}");
            let (at, _) = ring.corner(a);
            assert!(((point - at).length() - (at - DVec3::X).length() / 3.0).abs() < 1e-3, "{a}");
        }
    }

    /// At a distance `s` from the mirror, the light is denser by `1 / |1 - 2 s / (R cos a)|`.
    #[test]
    fn density_is_that_of_the_closed_form() {
        let ring = MirrorRing {
            radius_m: 1.0,
            height_m: 1.0,
            source: Source::Parallel,
            angles: [0.4, 0.4001],
            segments: 1,
        };
        let beam = ring.beams()[0];
        let chord = beam.path(0).length();
        let a: f64 = 0.40005;
        let areas = |t: f64| {
            let [x0, x1, x2] = beam.corners(t);
            (x1 - x0).cross(x2 - x0).dot(beam.path(0).normalize()).abs()
        };
        for t in [0.1, 0.2, 0.4, 0.6] {
            let known = (1.0 - 2.0 * t * chord / a.cos()).abs();
            assert!((areas(t) / areas(0.0) - known).abs() < 1e-3, "{t}: {} {known}", areas(t) / areas(0.0));
        }
    }
}
