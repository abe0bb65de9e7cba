//! What is rasterized to find the pixels that a beam may light.
//!
//! The bodies are our reading of the papers, whose full texts we could not reach (see the book).

mod hull;
mod prism;
mod refined;

use glam::DVec3;

use super::Beam;

/// How a beam is rasterized.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// As a moving triangle, with the exact times at each pixel (Paper VI).
    #[default]
    Moving,
    /// In the tetrahedra about its sides, cut where it folds (after Liktor and Dachsbacher 2011, "Real-time volume caustics with adaptive beam
    /// tracing").
    Refined,
    /// The same without cuts, as it is published: it loses light where a beam folds, so it is for comparison only and not to be chosen.
    #[serde(skip)]
    Uncut,
    /// In the convex hull of its corners.
    Hull,
    /// In a prism with touching planes (after Ernst, Akenine-Moeller and Jensen 2005, "Interactive rendering of caustics using
    /// interpolated warped volumes").
    Prism,
}

/// A body around (a part of) a beam: triangles that are clockwise or counter-clockwise alike seen from outside, their normals outward.
pub(super) type Body = Vec<[DVec3; 3]>;

impl Method {
    /// Every method that loses no light, that of the paper first.
    pub const ALL: [Self; 4] = [Self::Moving, Self::Refined, Self::Hull, Self::Prism];

    /// Its name in files and pictures.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Moving => "moving triangle",
            Self::Refined => "refined bound",
            Self::Uncut => "refined bound, uncut",
            Self::Hull => "convex hull",
            Self::Prism => "prism",
        }
    }

    /// Triangles that are set up for a beam: itself, or so many faces of a body, where it does not fold.
    pub const fn triangles(self) -> usize {
        match self {
            Self::Moving => 1,
            _ => 8,
        }
    }

    /// The bodies of a beam; none where the triangle itself is rasterized.
    pub(super) fn bodies(self, beam: &Beam, into: &mut Body) {
        into.clear();
        match self {
            Self::Moving => {}
            Self::Refined => refined::faces(beam, into),
            Self::Uncut => refined::uncut(beam, into),
            Self::Hull => hull::faces(beam, into),
            Self::Prism => prism::faces(beam, into),
        }
    }
}

/// The six corners of a beam.
fn corners(beam: &Beam) -> [DVec3; 6] {
    let ([a, b, c], [d, e, f]) = (beam.open, beam.close);
    [a, b, c, d, e, f]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::caustics::generator::tests::{Uniform, turned, warped};

    /// Whether a ray meets a back face (Moeller and Trumbore 1997).
    fn leaves(body: &[[DVec3; 3]], from: DVec3, along: DVec3) -> bool {
        body.iter().any(|[a, b, c]| {
            let (ab, ac) = (*b - *a, *c - *a);
            let det = ab.dot(along.cross(ac));
            let to = from - *a;
            let u = to.dot(along.cross(ac)) / det;
            let v = along.dot(to.cross(ab)) / det;
            let t = ac.dot(to.cross(ab)) / det;
            u >= -1e-9 && v >= -1e-9 && u + v <= 1.0 + 1e-9 && t >= 0.0 && along.dot(ab.cross(ac)) > 0.0
        })
    }

    /// From every point of a beam there is a back face of every body about it in every direction, so every pixel that sees the beam is
    /// covered.
    #[test]
    fn bodies_hold_their_beam() {
        for method in [Method::Refined, Method::Hull, Method::Prism] {
            let (mut random, mut body) = (Uniform::new(11), Body::new());
            for round in 0..1200 {
                let beam = match round % 6 {
                    0 => turned(&mut random),
                    kind => warped(&mut random, [0.0, 0.15, 0.4, 0.8, 1.5][kind - 1]),
                };
                method.bodies(&beam, &mut body);
                for _ in 0..20 {
                    let hit = random.hit();
                    let along = DVec3::from_array([0; 3].map(|_| random.within(-1.0, 1.0)));
                    assert!(leaves(&body, beam.point(&hit), along), "{method:?} {round}: {hit:?}");
                }
            }
        }
    }

    #[test]
    fn a_straight_beam_is_its_own_prism() {
        let mut random = Uniform::new(2);
        for _ in 0..50 {
            let beam = warped(&mut random, 0.0);
            for method in [Method::Refined, Method::Hull, Method::Prism] {
                let mut body = Body::new();
                method.bodies(&beam, &mut body);
                let volume: f64 = body.iter().map(|[a, b, c]| a.cross(*b).dot(*c) / 6.0).sum();
                let [a, b, c] = beam.open;
                let own = 0.5 * (b - a).cross(c - a).dot(beam.path(0)).abs();
                if method != Method::Hull {
                    // A hull lists both triangulations of a flat side.
                    assert!((volume - own).abs() < 1e-6 * own, "{method:?}: {volume} {own}");
                }
                assert!(volume >= own * (1.0 - 1e-6));
            }
        }
    }
}
