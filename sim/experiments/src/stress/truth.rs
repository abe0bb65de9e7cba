//! The true interval of lens and time in which a triangle touches a tile.
//!
//! Before a pinhole it is exact ([`Sweep`]). Under a lens it is found from below: places where a point of the triangle is seen at a
//! point of the tile (solved for `u, v`), then, from the outermost of these, exact roots along `t`, `u` and `v` in turn.

use glam::{DVec2, DVec3};
use pipeline::Shear;
use pipeline::setup::Triangle;
use pipeline::traversal::TileRect;

use super::sweep::{Rect, Sweep};

/// Hulls of what is true of `u`, `v` and `t`, the lens in [-1, 1].
pub type Hulls = [[f64; 2]; 3];

/// A place on the lens and a time, as `[u, v, t]`.
type Look = [f64; 3];

/// A triangle, a lens and a tile.
#[derive(Clone, Copy, Debug)]
pub struct Truth {
    ends: Sweep,
    s: DVec2,
    a: DVec2,
    rect: Rect,
    near: f64,
    moving: bool,
}

impl Truth {
    /// For `triangle` as seen by a camera with `shear` and the near depth `near`.
    pub fn new(triangle: &Triangle, shear: &Shear, tile: &TileRect, near: f32) -> Self {
        let wide = |p: [f32; 3]| DVec3::from(p.map(f64::from));
        let from = triangle.corners.map(|corner| wide(corner.open));
        let to = triangle.corners.map(|corner| wide(corner.open) + wide(corner.delta));
        let [s, a] = [shear.s, shear.a].map(|c| DVec2::from(c.map(f64::from)));
        let (near, moving) = (f64::from(near), triangle.moving);
        Self { ends: Sweep { from, to }, s, a, rect: Rect::new(tile), near, moving }
    }

    /// Whether [`Self::hulls`] is exact rather than found from below.
    pub fn is_exact(&self) -> bool {
        self.s == DVec2::ZERO && self.ends.is_beyond(self.near)
    }

    /// The hulls, or `None` where nothing was found to touch.
    pub fn hulls(&self) -> Option<Hulls> {
        let whole = [[-1.0, 1.0], [-1.0, 1.0]];
        if self.s == DVec2::ZERO {
            let t = self.ends.touching(&self.rect, self.near)?;
            return Some([whole[0], whole[1], t]);
        }
        let mut found = Found::default();
        self.seeds(&mut found);
        for _ in 0..3 {
            let Some(outermost) = found.outermost else { break };
            outermost.as_flattened().iter().for_each(|look| self.along_axes(*look, &mut found));
            if found.outermost == Some(outermost) {
                break;
            }
        }
        found.hulls()
    }

    /// A vertex seen from `(u, v)` of the lens.
    fn sheared(&self, p: DVec3, u: f64, v: f64) -> DVec3 {
        (p.truncate() + DVec2::new(u, v) * (self.a * p.z - self.s)).extend(p.z)
    }

    /// Places where points of the triangle are seen at points of the tile, and times along a few places of the lens.
    fn seeds(&self, found: &mut Found) {
        const STEPS: i32 = 4;
        for place in 0..9 {
            let [u, v] = [place % 3, place / 3].map(|step| f64::from(step) - 1.0);
            self.along_axes([u, v, 0.5], found);
        }
        for instant in 0..if self.moving { 9 } else { 1 } {
            let t = f64::from(instant) / 8.0;
            let corners = self.ends.at(t);
            for step in 0..(STEPS + 1) * (STEPS + 1) {
                let [i, j] = [step % (STEPS + 1), step / (STEPS + 1)];
                if i + j <= STEPS {
                    let [i, j] = [i, j].map(|weight| f64::from(weight) / f64::from(STEPS));
                    let p = corners[0] + i * (corners[1] - corners[0]) + j * (corners[2] - corners[0]);
                    self.seen(p, t, found);
                }
            }
        }
    }

    /// From where on the lens `p` is seen at points of the tile.
    fn seen(&self, p: DVec3, t: f64, found: &mut Found) {
        let sway = self.a * p.z - self.s;
        for place in 0..9 {
            let at = self.rect.at(f64::from(place % 3) * 0.5, f64::from(place / 3) * 0.5);
            let lens = (at * p.z - p.truncate()) / sway;
            if p.z > self.near && lens.abs().max_element() <= 1.0 {
                found.add([lens.x, lens.y, t]);
            }
        }
    }

    /// Exact roots along each axis through `look`.
    fn along_axes(&self, [u, v, t]: Look, found: &mut Found) {
        let along = |sweep: Sweep| sweep.touching(&self.rect, self.near);
        let ends = |look: fn(f64, Look) -> Look, hull: [f64; 2], found: &mut Found| {
            hull.into_iter().for_each(|s| found.add(look(s, [u, v, t])));
        };
        let of = |corners: [DVec3; 3], u: f64, v: f64| corners.map(|p| self.sheared(p, u, v));
        let now = self.ends.at(t);
        if let Some(hull) = along(Sweep { from: of(self.ends.from, u, v), to: of(self.ends.to, u, v) }) {
            ends(|s, [u, v, _]| [u, v, s], hull, found);
        }
        if let Some(hull) = along(Sweep { from: of(now, -1.0, v), to: of(now, 1.0, v) }) {
            ends(|s, [_, v, t]| [2.0 * s - 1.0, v, t], hull, found);
        }
        if let Some(hull) = along(Sweep { from: of(now, u, -1.0), to: of(now, u, 1.0) }) {
            ends(|s, [u, _, t]| [u, 2.0 * s - 1.0, t], hull, found);
        }
    }
}

/// The outermost places found so far: for each of `u, v, t` the lowest and the highest.
#[derive(Clone, Copy, Debug, Default)]
struct Found {
    outermost: Option<[[Look; 2]; 3]>,
}

impl Found {
    fn add(&mut self, look: Look) {
        let outermost = self.outermost.get_or_insert([[look; 2]; 3]);
        for (axis, [low, high]) in outermost.iter_mut().enumerate() {
            if look[axis] < low[axis] {
                *low = look;
            }
            if look[axis] > high[axis] {
                *high = look;
            }
        }
    }

    fn hulls(&self) -> Option<Hulls> {
        let outermost = self.outermost?;
        Some([0, 1, 2].map(|axis| outermost[axis].map(|look| look[axis])))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pipeline::setup::{Outcome, set_up};
    use pipeline::{Cull, MovingVertex};

    fn truth(open: [[f32; 3]; 3], close: [[f32; 3]; 3], shear: Shear, tile: TileRect) -> Truth {
        let v = [0, 1, 2].map(|k| MovingVertex { open: open[k], close: close[k] });
        let Outcome::Ready(triangle) = set_up(0, [&v[0], &v[1], &v[2]], Cull::None, &shear, 0.1, [64.0; 2])
        else {
            panic!("the triangle is visible");
        };
        Truth::new(&triangle, &shear, &tile, 0.1)
    }

    const TILE: TileRect = TileRect { x: [0.0, 8.0], y: [0.0, 8.0] };

    #[test]
    fn before_a_pinhole_it_is_exact() {
        let open = [[-20.0, 4.0, 2.0], [-12.0, 4.0, 2.0], [-20.0, 12.0, 2.0]];
        let close = open.map(|[x, y, w]| [x + 60.0, y, w]);
        let truth = truth(open, close, Shear::default(), TILE);
        let [_, _, t] = truth.hulls().unwrap();
        assert!(truth.is_exact());
        // Pixels are halves of these: the front at -6, the rear at -10, 30 to go.
        assert!((t[0] - 0.2).abs() < 1e-12 && (t[1] - 0.6).abs() < 1e-12, "{t:?}");
    }

    #[test]
    fn a_point_out_of_focus_is_seen_from_where_it_should() {
        // At depth 4 and focus 2 with s = 80 the blur is 20 px in radius: u moves the image by 20 px. A triangle of a hundredth
        // of a pixel about (-10, 4) touches the tile for u from 0.5 to 0.9, v from -0.2 to 0.2.
        let corner = |x: f32, y: f32| [4.0 * (-10.0 + x), 4.0 * (4.0 + y), 4.0];
        let open = [corner(0.0, 0.0), corner(0.01, 0.0), corner(0.0, 0.01)];
        let truth = truth(open, open, Shear::new([80.0, -80.0], [40.0, -40.0]), TILE);
        let [u, v, t] = truth.hulls().unwrap();
        let expected = [[0.5, 0.9], [-0.2, 0.2], [0.0, 1.0]];
        for (found, expected) in [u, v, t].into_iter().zip(expected) {
            for end in [0, 1] {
                assert!((found[end] - expected[end]).abs() < 1e-3, "{u:?} {v:?} {t:?}");
            }
        }
        assert!(!truth.is_exact());
    }
}
