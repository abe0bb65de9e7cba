//! Cameras of a scene, and the pipeline's camera made from them for one frame.
//!
//! A camera may be placed so that everything stays in view. With the direction of the view given, a point at
//! `(a, b)` across and `c` along it is inside the left and right sides of a pinhole frustum with its eye at
//! `(x, y, z)` when `|a - x| <= tan_x (c - z)`. Over all points only the largest `a - tan_x c` and `-a -
//! tan_x c` matter, so one pass finds the nearest eye exactly. A lens of radius `R` focused at `F` moves a
//! point at depth `w` by at most `R |w/F - 1|`, which is convex in `w` and therefore largest at the nearest
//! or farthest depth; straight paths in time are convex, too.

use glam::{Affine3A, DAffine3, DMat3, DVec3};
use pipeline::{Camera, CameraError, Lane, Lens};
use serde::{Deserialize, Serialize};

use super::deform::Pose;
use super::track::{Instant, Track};

/// A point that may move along a track.
#[derive(Clone, Debug, PartialEq)]
pub struct Place {
    /// Position without a track.
    pub rest: DVec3,
    /// Positions over time.
    pub track: Option<Track>,
}

impl Place {
    /// A still point.
    pub fn fixed(rest: DVec3) -> Self {
        Self { rest, track: None }
    }

    /// Position at time `at`.
    pub fn at(&self, at: Instant) -> DVec3 {
        self.track.as_ref().map_or(self.rest, |track| track.vec3(at))
    }
}

/// Direction in which a camera looks.
#[derive(Clone, Debug, PartialEq)]
pub enum Aim {
    /// Towards a point. A lens is focused on it unless a focus depth is given.
    At(Place),
    /// Along a direction of any length.
    Along(DVec3),
}

/// Position and direction of a camera.
#[derive(Clone, Debug, PartialEq)]
pub struct LookAt {
    /// Position of the camera.
    pub position: Place,
    /// Direction of the view.
    pub aim: Aim,
    /// Upward direction.
    pub up: DVec3,
}

/// Placement of a camera.
#[derive(Clone, Debug, PartialEq)]
pub enum Rig {
    /// By position and target, or by position and direction.
    LookAt(Box<LookAt>),
    /// By a node: it looks along the node's -z, with +y up (glTF 2.0, 3.10).
    Node(usize),
    /// Automatic.
    Fitted(Side),
}

/// Side from which an automatically placed camera sees the scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Side {
    /// Inside if most of the scene's surface is enclosed by the rest of it, else outside.
    #[default]
    Auto,
    /// Inside, at eye height, along the deepest view.
    Inside,
    /// In front, above and to the right, with the whole scene in view over all frames.
    Outside,
}

impl Rig {
    /// A still camera at `position` that looks at `target`, with +y up.
    pub fn look_at(position: DVec3, target: DVec3) -> Self {
        let [position, target] = [position, target].map(Place::fixed);
        Self::LookAt(Box::new(LookAt { position, aim: Aim::At(target), up: DVec3::Y }))
    }
}

/// Extent of the view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Frustum {
    /// Perspective.
    Perspective {
        /// Tangent of half the vertical field of view.
        tan_half_height: f64,
    },
    /// Orthographic.
    Orthographic {
        /// Half the height of the view, in scene units.
        half_height: f64,
    },
}

impl Frustum {
    /// The view with a vertical field of view in degrees (40 by default), or with a height in scene units.
    ///
    /// # Errors
    /// A message if both are given.
    pub fn given(fov_deg: Option<f64>, view_height: Option<f64>) -> Result<Self, String> {
        match (fov_deg, view_height) {
            (Some(_), Some(_)) => Err(
                "`fov_deg` makes a perspective camera and `view_height` an orthographic one: remove one of them"
                    .to_owned(),
            ),
            (_, Some(height)) => Ok(Self::Orthographic { half_height: 0.5 * height }),
            (fov_deg, None) => {
                Ok(Self::Perspective { tan_half_height: tan_half(fov_deg.unwrap_or(DEFAULT_FOV_DEG)) })
            }
        }
    }

    /// The still pipeline camera with this view.
    pub(crate) fn camera(self, pose: Affine3A, near: f32) -> Result<Camera, CameraError> {
        match self {
            Self::Perspective { tan_half_height } => Camera::new(pose, tan_half_height as f32, near),
            Self::Orthographic { half_height } => Camera::orthographic(pose, half_height as f32, near),
        }
    }
}

impl Default for Frustum {
    fn default() -> Self {
        Self::Perspective { tan_half_height: tan_half(DEFAULT_FOV_DEG) }
    }
}

/// A scene's camera.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneCamera {
    /// Placement.
    pub rig: Rig,
    /// View; `None` for a field of view of 40 degrees (60 for a camera that is placed inside).
    pub view: Option<Frustum>,
    /// Near depth in scene units. `None` for a thousandth of the depth of the target (a quarter of the
    /// nearest vertex's depth for a fitted camera), or less if something nearer is in view.
    pub near: Option<f64>,
}

/// Default vertical field of view, in degrees.
pub const DEFAULT_FOV_DEG: f64 = 40.0;

/// Tangent of half an angle in degrees.
pub fn tan_half(fov_deg: f64) -> f64 {
    libm::tan(fov_deg.to_radians() / 2.0)
}

impl Default for SceneCamera {
    fn default() -> Self {
        Self { rig: Rig::Fitted(Side::Auto), view: None, near: None }
    }
}

/// Position and axes of a camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct CameraFrame {
    pub eye: DVec3,
    pub right: DVec3,
    pub up: DVec3,
    pub forward: DVec3,
}

impl CameraFrame {
    /// A camera at `eye` that looks along `forward`; `None` if `forward` has no length or is not finite. If `up`
    /// is parallel to `forward`, another axis is used as up.
    pub fn new(eye: DVec3, forward: DVec3, up: DVec3) -> Option<Self> {
        let forward = unit(forward)?;
        let right = [up, DVec3::Y, DVec3::NEG_Z, DVec3::X].into_iter().find_map(|up| {
            let across = forward.cross(unit(up)?);
            (across.length() > 1e-6).then(|| unit(across)).flatten()
        })?;
        eye.is_finite().then(|| Self { eye, right, up: right.cross(forward), forward })
    }

    /// A camera on a node with the world transform `world`; scale and shear are ignored.
    pub fn on_node(world: DAffine3) -> Option<Self> {
        Self::new(world.translation, -world.matrix3.z_axis, world.matrix3.y_axis)
    }

    /// Depth of a point in front of the camera, in scene units.
    pub fn depth(&self, point: DVec3) -> f64 {
        (point - self.eye).dot(self.forward)
    }

    /// Camera coordinates of a world point: x right, y up, z forward.
    pub fn view(&self, point: DVec3) -> DVec3 {
        self.view_on(&Lane::default(), point)
    }

    /// The same, computed on a lane.
    pub fn view_on(&self, lane: &Lane, point: DVec3) -> DVec3 {
        let from = lane.sub(point, self.eye);
        DVec3::new(lane.dot(from, self.right), lane.dot(from, self.up), lane.dot(from, self.forward))
    }

    /// Transform from the world to the camera: x right, y up, z forward.
    pub fn pose(&self) -> Affine3A {
        let to_axes = DMat3::from_cols(self.right, self.up, self.forward).transpose();
        let place = to_axes * -self.eye;
        Affine3A::from_mat3_translation(to_axes.as_mat3(), place.as_vec3())
    }
}

fn unit(v: DVec3) -> Option<DVec3> {
    let length = v.length();
    (length.is_finite() && length > 0.0).then(|| v / length)
}

impl SceneCamera {
    /// Position and axes in `pose`, relative to its origin; `None` for a camera that is not fitted yet or has
    /// no direction.
    pub(super) fn stand(&self, pose: &Pose, at: Instant) -> Option<CameraFrame> {
        match &self.rig {
            Rig::LookAt(sight) => {
                let eye = sight.position.at(at);
                let along = match &sight.aim {
                    Aim::At(target) => target.at(at) - eye,
                    Aim::Along(direction) => *direction,
                };
                CameraFrame::new(eye - pose.origin, along, sight.up)
            }
            Rig::Node(node) => CameraFrame::on_node(pose.world(*node)),
            Rig::Fitted(_) => None,
        }
    }

    /// Depth of the target, if the camera has one.
    pub(super) fn target_depth(&self, stand: &CameraFrame, (pose, at): (&Pose, Instant)) -> Option<f64> {
        let Rig::LookAt(sight) = &self.rig else { return None };
        let Aim::At(target) = &sight.aim else { return None };
        Some(stand.depth(target.at(at) - pose.origin))
    }

    /// Whether a track moves the camera. A camera on a node moves if the node does.
    pub(super) fn has_track(&self) -> bool {
        let Rig::LookAt(sight) = &self.rig else { return false };
        let aimed = matches!(&sight.aim, Aim::At(Place { track: Some(_), .. }));
        sight.position.track.is_some() || aimed
    }
}

/// A camera during one shutter interval.
#[derive(Clone, Copy, Debug)]
pub(super) struct Standing {
    pub open: CameraFrame,
    pub close: CameraFrame,
    /// Near depth in scene units.
    pub near: f64,
    /// Default focus depth in scene units.
    pub focus: f64,
}

/// The pipeline's camera.
pub(super) fn between(
    Standing { open, close, near, .. }: &Standing,
    view: Frustum,
    lens: Option<(f32, f64)>,
) -> Result<Camera, String> {
    let describe = |error: &dyn std::fmt::Display| error.to_string();
    let lens = match lens {
        Some((radius, focus)) => Some(Lens::new(radius, focus as f32).map_err(|e| describe(&e))?),
        None => None,
    };
    let camera = view.camera(open.pose(), *near as f32).map_err(|e| describe(&e))?;
    let camera = camera.moving(open.pose(), close.pose()).map_err(|e| describe(&e))?;
    Ok(camera.with_lens(lens))
}

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
    use glam::Vec3A;

    use super::*;

    #[test]
    fn camera_space_is_right_up_forward() {
        let stand = CameraFrame::new(DVec3::new(0.0, 0.0, 5.0), DVec3::NEG_Z, DVec3::Y).unwrap();
        let pose = stand.pose();
        assert_eq!(pose.transform_point3a(Vec3A::ZERO), Vec3A::new(0.0, 0.0, 5.0));
        assert_eq!(pose.transform_vector3a(Vec3A::X), Vec3A::X);
        assert_eq!(pose.transform_vector3a(Vec3A::Y), Vec3A::Y);
        assert_eq!(pose.transform_vector3a(Vec3A::Z), Vec3A::NEG_Z);
    }

    #[test]
    fn a_camera_that_looks_straight_up_still_has_axes() {
        let stand = CameraFrame::new(DVec3::ZERO, DVec3::Y, DVec3::Y).unwrap();
        assert!(stand.right.is_finite() && stand.right.dot(DVec3::Y).abs() < 1e-12);
        assert!(CameraFrame::new(DVec3::ZERO, DVec3::ZERO, DVec3::Y).is_none());
    }

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
