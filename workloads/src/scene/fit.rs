//! Placing a camera so that everything stays in view.
//!
//! With the direction of the view given, a point at `(a, b)` across and `c` along it is inside the left and
//! right sides of a pinhole frustum with its eye at `(x, y, z)` when `|a - x| <= tan_x (c - z)`. Over all
//! points only the largest `a - tan_x c` and `-a - tan_x c` matter, so one pass finds the nearest eye exactly.
//! A lens of radius `R` focused at `F` moves a point at depth `w` by at most `R |w/F - 1|`, which is convex in
//! `w` and therefore largest at the nearest or farthest depth; straight paths in time are convex, too.

use glam::DVec3;

use super::camera::CameraFrame;

/// Share of the image's width and height that a fitted scene fills.
const FILL: f64 = 0.92;

/// Most steps back that are tried for a lens.
const STEPS: u32 = 64;

/// Accepted excess of a lens over the free room, well below the margin of [`FILL`].
const SLACK: f64 = 1.001;

/// Largest distance with a lens, relative to that of a pinhole; farther away the scene is too small to see.
const FARTHEST: f64 = 32.0;

/// Direction from the scene to the camera: the front (glTF's +z), a little to the right and above.
const TOWARD_EYE: DVec3 = DVec3::new(0.55, 0.42, 1.0);

/// Extremes of all points, from which a camera is fitted.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Extent {
    axes: CameraFrame,
    slopes: [f64; 2],
    /// Largest `a - tan_x c`, `-a - tan_x c`, and the same for `b`.
    sides: [f64; 4],
    low: DVec3,
    high: DVec3,
}

/// Position of a fitted camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Fit {
    pub stand: CameraFrame,
    /// Direction of the view before normalization; up is +y.
    pub direction: DVec3,
    /// A depth nearer than the nearest point.
    pub near: f64,
    /// Depth of the middle of the scene.
    pub focus: f64,
    /// Whether all points are in view from the whole lens.
    pub holds_lens: bool,
}

impl Extent {
    /// No points yet, for a view with these tangents of half its width and height.
    pub fn new(tan_half_width: f64, tan_half_height: f64) -> Option<Self> {
        Some(Self {
            axes: CameraFrame::new(DVec3::ZERO, -TOWARD_EYE, DVec3::Y)?,
            slopes: [tan_half_width * FILL, tan_half_height * FILL],
            sides: [f64::NEG_INFINITY; 4],
            low: DVec3::INFINITY,
            high: DVec3::NEG_INFINITY,
        })
    }

    pub fn add(&mut self, point: DVec3) {
        let axes = &self.axes;
        let p = DVec3::new(point.dot(axes.right), point.dot(axes.up), point.dot(axes.forward));
        let [tx, ty] = self.slopes;
        let reach = [p.x - tx * p.z, -p.x - tx * p.z, p.y - ty * p.z, -p.y - ty * p.z];
        for (side, reach) in self.sides.iter_mut().zip(reach) {
            *side = side.max(reach);
        }
        self.low = self.low.min(p);
        self.high = self.high.max(p);
    }

    /// The nearest camera that sees all points; `lens` is its radius and, if given, its focus depth.
    /// `None` without points. If the lens is so large that not all points are in view from the whole lens, or
    /// the scene would be too small, the camera has the position of a pinhole.
    pub fn fit(&self, lens: Option<(f64, Option<f64>)>) -> Option<Fit> {
        if !(self.low.is_finite() && self.high.is_finite()) {
            return None;
        }
        let mut fit = self.place(0.0);
        let Some((radius, focus)) = lens else { return Some(fit) };
        let pinhole = fit;
        let mut room = 0.0;
        for _ in 0..STEPS {
            let needed = self.blur(&fit, radius, focus);
            if needed <= SLACK * room {
                return Some(fit);
            }
            room = needed;
            fit = self.place(room);
            // A step back blurs points beyond a fixed focus depth further. It cannot succeed if
            // the lens is wider than the view at that depth.
            if fit.focus > FARTHEST * pinhole.focus {
                break;
            }
        }
        Some(Fit { holds_lens: false, ..pinhole })
    }

    /// Whether a point is in the image of the fitted camera, seen from the centre of the lens.
    pub fn sees(&self, fit: &Fit, point: DVec3) -> bool {
        let p = fit.stand.view(point);
        let [across, up] = self.slopes.map(|slope| slope / FILL * p.z);
        p.x.abs() <= across && p.y.abs() <= up
    }

    /// Largest displacement of any point across the view by the lens, in scene units.
    fn blur(&self, fit: &Fit, radius: f64, focus: Option<f64>) -> f64 {
        let focus = focus.unwrap_or(fit.focus);
        let eye = fit.stand.eye.dot(self.axes.forward);
        let at = |depth: f64| radius * (depth / focus - 1.0).abs();
        at(self.low.z - eye).max(at(self.high.z - eye))
    }

    /// The nearest position that leaves `room` scene units beside every point.
    fn place(&self, room: f64) -> Fit {
        let [right, left, top, bottom] = self.sides.map(|side| side + room);
        let [tx, ty] = self.slopes;
        let size = (self.high - self.low).max_element();
        let size = if size > 0.0 { size } else { 1.0 };
        let z = (-(right + left) / (2.0 * tx)).min(-(top + bottom) / (2.0 * ty)).min(self.low.z - 0.1 * size);
        let (x, y) = ((right - left) / 2.0, (top - bottom) / 2.0);
        let eye = x * self.axes.right + y * self.axes.up + z * self.axes.forward;
        Fit {
            stand: CameraFrame { eye, ..self.axes },
            direction: -TOWARD_EYE,
            near: 0.25 * (self.low.z - z),
            focus: (self.low.z + self.high.z) / 2.0 - z,
            holds_lens: true,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_single_point_is_in_front_of_the_camera() {
        let mut extent = Extent::new(0.6, 0.4).unwrap();
        assert!(extent.fit(None).is_none());
        extent.add(DVec3::new(3.0, -2.0, 7.0));
        let fit = extent.fit(None).unwrap();
        let depth = fit.stand.depth(DVec3::new(3.0, -2.0, 7.0));
        assert!(depth > fit.near && fit.near > 0.0, "{depth} {}", fit.near);
        assert!((depth - fit.focus).abs() < 1e-9);
    }

    #[test]
    fn the_fit_is_tight() {
        let mut extent = Extent::new(0.5, 0.5).unwrap();
        let corners = (0..8).map(|i| {
            DVec3::new(f64::from(i & 1), f64::from((i >> 1) & 1), f64::from((i >> 2) & 1)) * 2.0 - 1.0
        });
        corners.clone().for_each(|corner| extent.add(corner));
        let stand = extent.fit(None).unwrap().stand;
        let widest = corners.flat_map(|corner| {
            let p = corner - stand.eye;
            let depth = p.dot(stand.forward);
            [(p.dot(stand.right) / depth / 0.5).abs(), (p.dot(stand.up) / depth / 0.5).abs()]
        });
        let widest = widest.fold(0.0, f64::max);
        assert!((widest - FILL).abs() < 1e-9, "{widest}");
    }
}
