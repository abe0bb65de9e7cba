//! Round generators: a ball of glass that refracts light, and a ring that reflects it once inside.

use std::f64::consts::TAU;

use glam::DVec3;
use pipeline::Lane;
use workloads::caustics::Beam;
use workloads::caustics::generator::{reflect, refract, transmission};

/// A glass ball at the origin, in parallel light along +x with one watt per square metre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BallLens {
    /// Radius in metres.
    pub radius_m: f64,
    /// Refractive index, relative to the surroundings.
    pub index: f64,
    /// Lit share of the radius, 0 to 1, from the axis.
    pub aperture: f64,
    /// Rings of triangles.
    pub rings: u32,
    /// Segments of a ring.
    pub segments: u32,
    /// End of the light along x, from the centre of the ball, in metres.
    pub reach_m: f64,
}

/// A ray behind the ball.
struct Ray {
    from: DVec3,
    along: DVec3,
    enters: f64,
}

impl BallLens {
    /// The ray at height `h` in the half-plane at `angle` around the axis. There is no total reflection
    /// inside: the ray leaves at its angle of incidence.
    fn ray(&self, h: f64, angle: f64) -> Option<Ray> {
        let across = DVec3::new(0.0, libm::cos(angle), libm::sin(angle));
        let normal =
            (h * across - libm::sqrt(self.radius_m * self.radius_m - h * h) * DVec3::X) / self.radius_m;
        let inside = refract(&Lane::default(), DVec3::X, normal, 1.0 / self.index)?;
        let entry = self.radius_m * normal;
        let from = entry - 2.0 * entry.dot(inside) * inside;
        let along = refract(&Lane::default(), inside, -from / self.radius_m, self.index)?;
        let enters = transmission(&Lane::default(), [-normal.x, -inside.dot(normal)], 1.0 / self.index);
        Some(Ray { from, along, enters: enters * enters })
    }

    /// Two beams per segment, from the back of the ball to the plane at `reach_m`.
    pub fn beams(&self) -> Vec<Beam> {
        let height = |ring: u32| self.aperture * self.radius_m * f64::from(ring) / f64::from(self.rings);
        let angle = |part: u32| TAU * f64::from(part) / f64::from(self.segments);
        let mut beams = Vec::new();
        for ring in 0..self.rings {
            for part in 0..self.segments {
                let corner = |r: u32, s: u32| (height(r), angle(s % self.segments));
                let [a, b] = [corner(ring, part), corner(ring, part + 1)];
                let [c, d] = [corner(ring + 1, part), corner(ring + 1, part + 1)];
                let three = if ring == 0 { vec![[a, c, d]] } else { vec![[a, c, d], [a, d, b]] };
                beams.extend(three.into_iter().filter_map(|three| self.beam(three)));
            }
        }
        beams
    }

    fn beam(&self, three: [(f64, f64); 3]) -> Option<Beam> {
        let [Some(a), Some(b), Some(c)] = three.map(|(h, angle)| self.ray(h, angle)) else { return None };
        let end = |ray: &Ray| ray.from + (self.reach_m - ray.from.x) / ray.along.x * ray.along;
        let before = three.map(|(h, angle)| DVec3::new(0.0, h * libm::cos(angle), h * libm::sin(angle)));
        let area = 0.5 * (before[1] - before[0]).cross(before[2] - before[0]).length();
        let flux_w = area * (a.enters + b.enters + c.enters) / 3.0;
        Some(Beam { open: [a.from, b.from, c.from], close: [end(&a), end(&b), end(&c)], flux_w })
    }
}

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

const BALL: BallLens =
    BallLens { radius_m: 1.0, index: 1.5, aperture: 0.7, rings: 400, segments: 720, reach_m: 6.0 };

/// With `sin i = h / R = n sin r` the ray is deflected by `D = 2 (i - r)` and crosses the axis at `R sin
/// i / sin D` from the centre.
#[test]
fn rays_cross_the_axis_at_the_closed_form() {
    for h in [0.01_f64, 0.2, 0.5, 0.69] {
        let (i, r) = (h.asin(), (h / 1.5).asin());
        let turned = 2.0 * (i - r);
        let ray = BALL.ray(h, 0.0).unwrap();
        let cut = ray.from.x - ray.from.y / ray.along.y * ray.along.x;
        assert!((cut - i.sin() / turned.sin()).abs() < 1e-9, "{h}: {cut}");
        assert!((ray.along.x - turned.cos()).abs() < 1e-12 && (ray.along.y + turned.sin()).abs() < 1e-12);
    }
    // Close to the axis: n R / (2 (n - 1)).
    let ray = BALL.ray(1e-4, 0.3).unwrap();
    let away = ray.from - ray.from.x * DVec3::X;
    let cut = ray.from.x + away.length() / (ray.along - ray.along.x * DVec3::X).length() * ray.along.x;
    assert!((cut - 1.5).abs() < 1e-6, "{cut}");
}

/// Neighbouring rays of a half-plane cross at `h (sin D, cos D) + h' (cos D, -sin D)`, `h' = R cos i / (2
/// (1 - cos i / (n cos r)))`.
#[test]
fn the_caustic_of_a_ball_is_that_of_the_closed_form() {
    for ring in [60, 150, 250, 390] {
        let h = 0.7 * (f64::from(ring) + 0.5) / 400.0;
        let (i, r) = (h.asin(), (h / 1.5).asin());
        let (turned, rate) = (2.0 * (i - r), i.cos() / (2.0 * (1.0 - i.cos() / (1.5 * r.cos()))));
        let known = [h * turned.sin() + rate * turned.cos(), h * turned.cos() - rate * turned.sin()];
        let beams = BALL.beams();
        // Both beams of the first segment of a ring have two corners on one half-plane.
        let beam = &beams[720 + (ring as usize - 1) * 1440];
        let found = beam.folds(&Lane::default()).into_iter().map(|t| {
            let at = beam.corners(t);
            let middle = 0.5 * (at[0] + at[1]);
            [middle.x, (middle.y * middle.y + middle.z * middle.z).sqrt()]
        });
        let near = |point: &[f64; 2]| (point[0] - known[0]).abs() + (point[1] - known[1].abs()).abs();
        let nearest = found.map(|point| near(&point)).fold(f64::INFINITY, f64::min);
        assert!(nearest < 0.02, "ring {ring}: {nearest}");
    }
}

#[test]
fn transmitted_light_is_incident_less_reflected() {
    let sum: f64 = BALL.beams().iter().map(|beam| beam.flux_w).sum();
    let falls = std::f64::consts::PI * 0.49;
    // Fresnel reflection is 4 % per surface near the axis, and more away from it.
    assert!(sum < 0.9217 * falls && sum > 0.90 * falls, "{}", sum / falls);
}

/// Light source of a ring.
fn caustic(ring: &MirrorRing) -> Vec<(f64, DVec3)> {
    let beams = ring.beams();
    let focus = |(n, beam): (usize, &Beam)| {
        let t = *beam.folds(&Lane::default()).first()?;
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
        let known = 0.5 * DVec3::new(3.0 * a.cos() - (3.0 * a).cos(), 0.0, 3.0 * a.sin() - (3.0 * a).sin());
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
        let known = DVec3::new(2.0 * a.cos() + (2.0 * a).cos(), 0.0, 2.0 * a.sin() + (2.0 * a).sin()) / 3.0;
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
