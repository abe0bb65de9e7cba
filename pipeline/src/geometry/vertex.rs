//! Triangles to be drawn, validated once for all later stages, and the projection of their vertices from
//! world space to the homogeneous image plane.

use glam::{DAffine3, DVec3, Vec2, Vec3, Vec4};
use rayon::prelude::*;

use super::{Camera, Clip, Viewport};
use crate::shader::Lane;

/// A vertex on the image plane at both ends of the shutter, as `[x, y, w]`; `w` is its depth in scene units.
/// In perspective `x, y` are homogeneous: its image is `(x / w, y / w)` pixels from the centre of the image,
/// `y` downwards. In an orthographic view its image is `(x, y)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MovingVertex {
    /// Position when the shutter opens.
    pub open: [f32; 3],
    /// Position when the shutter closes.
    pub close: [f32; 3],
}

impl MovingVertex {
    /// Whether both ends are equal to the last bit.
    pub fn is_still(&self) -> bool {
        self.open == self.close
    }
}

/// Shear of points by the lens. From `(X, Y)` of the image and `(u, v)` of a thin lens, a sample sees a point
/// at
///
/// ```text
/// x' = x + u (a.x w - s.x) - X w        in perspective
/// x' = x + u (a.x w - s.x) - X          in an orthographic view
/// ```
///
/// relative to the sample, and likewise in y. `s` is projection scale times lens radius, and `a = s / F`. The
/// lens of an orthographic view is an oblique shear: zero at the focus depth and linear in depth, like a
/// distant lens.
///
/// Both forms are `(x - base) - slope w` with a `base` and a `slope` of the sample, so one sample test serves
/// both; see [`Self::ray`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Shear<C = f32> {
    /// Projection scale times lens radius: pixels times scene units, or pixels in an orthographic view.
    pub s: [C; 2],
    /// `s` over the focus depth.
    pub a: [C; 2],
    /// Whether the view is orthographic.
    pub parallel: bool,
}

impl Shear {
    /// Shear of a perspective view through a lens.
    pub const fn new(s: [f32; 2], a: [f32; 2]) -> Self {
        Self { s, a, parallel: false }
    }

    /// Whether the camera is a pinhole, so the lens dimensions can be dropped.
    pub fn is_none(&self) -> bool {
        *self == self.sharp()
    }

    /// The same view through a pinhole.
    #[must_use]
    pub fn sharp(&self) -> Self {
        Self { parallel: self.parallel, ..Self::default() }
    }

    /// Factor of an image coordinate for a point at this depth: its depth, or 1 in an orthographic view.
    pub fn weight(&self, depth: f32) -> f32 {
        if self.parallel { 1.0 } else { depth }
    }

    /// The vertex `[x, y, w]` as a homogeneous point of the image plane.
    pub fn homogeneous(&self, [x, y, depth]: [f32; 3]) -> [f32; 3] {
        [x, y, self.weight(depth)]
    }

    /// Slope and base along `axis` of the sample at image coordinate `at` and lens position `lens`. It sees
    /// the points with `x = base + slope w`.
    pub fn ray(&self, axis: usize, at: f32, lens: f32) -> [f32; 2] {
        let (s, a) = (self.s[axis], self.a[axis]);
        if self.parallel { [-(lens * a), at + lens * s] } else { [at - lens * a, lens * s] }
    }

    /// Signed distance in pixels along `axis` that the image of a point at this depth moves between the
    /// middle and the rim of the lens.
    pub fn circle(&self, axis: usize, depth: f64) -> f64 {
        let (s, a) = (f64::from(self.s[axis]), f64::from(self.a[axis]));
        if self.parallel { a * depth - s } else { a - s / depth }
    }
}

/// A camera fitted to a viewport. It computes in `f64` and rounds once, so equal input gives equal vertices.
#[derive(Clone, Copy, Debug)]
pub struct Projection {
    open: DAffine3,
    close: DAffine3,
    scale_px: f64,
    shift_px: [f64; 2],
    /// Projection and lens of the samples.
    pub shear: Shear,
    /// Smallest visible depth in scene units.
    pub near: f32,
}

impl Projection {
    /// Projection of `camera` onto an image of the size of `viewport`.
    pub fn new(camera: &Camera, viewport: Viewport) -> Self {
        let height = f64::from(viewport.height());
        let scale_px = 0.5 * height / f64::from(camera.half_height());
        let shear = camera.lens().map_or(Shear::default(), |lens| {
            let s = scale_px * f64::from(lens.radius());
            let a = s / f64::from(lens.focus());
            // v points up on the lens, y down in the image.
            Shear::new([s as f32, -s as f32], [a as f32, -a as f32])
        });
        let shear = Shear { parallel: camera.is_orthographic(), ..shear };
        Self {
            open: widen(camera.open()),
            close: widen(camera.close()),
            scale_px,
            shift_px: camera.shift().to_array().map(|shift| f64::from(shift) * height),
            shear,
            near: camera.near(),
        }
    }

    /// Image of a vertex at `open` and `close` in world space, at the ends of the shutter.
    pub fn vertex(&self, open: Vec3, close: Vec3) -> MovingVertex {
        MovingVertex { open: self.image(&self.open, open), close: self.image(&self.close, close) }
    }

    /// Images of all vertices of `geometry`.
    pub(crate) fn images(&self, geometry: &Geometry<'_>) -> Vec<MovingVertex> {
        if self.open == self.close && geometry.is_still() {
            let still = |&world: &Vec3| {
                let open = self.image(&self.open, world);
                MovingVertex { open, close: open }
            };
            return geometry.open().par_iter().with_min_len(1024).map(still).collect();
        }
        geometry
            .open()
            .par_iter()
            .zip(geometry.close())
            .with_min_len(1024)
            .map(|(&open, &close)| self.vertex(open, close))
            .collect()
    }

    /// The same, computed on a lane; a still vertex before a still camera once for both ends.
    pub fn vertex_on(&self, lane: &Lane, ends: [Vec3; 2], is_still: bool) -> MovingVertex {
        let open = self.image_on(lane, &self.open, ends[0]);
        let close = if is_still { open } else { self.image_on(lane, &self.close, ends[1]) };
        MovingVertex { open, close }
    }

    fn image(&self, pose: &DAffine3, world: Vec3) -> [f32; 3] {
        self.image_on(&Lane::default(), pose, world)
    }

    fn image_on(&self, lane: &Lane, pose: &DAffine3, world: Vec3) -> [f32; 3] {
        let p = lane.transform_f64(pose, DVec3::from(world));
        let weight = if self.shear.parallel { 1.0 } else { p.z };
        let x = lane.madd(self.scale_px, p.x, lane.mul(self.shift_px[0], weight));
        let y = lane.madd(-self.scale_px, p.y, lane.mul(self.shift_px[1], weight));
        [x as f32, y as f32, p.z as f32]
    }

    /// Operations of moving one vertex to the image plane at one end of the shutter.
    pub fn vertex_ops(&self) -> u32 {
        let lane = Lane::default();
        self.image_on(&lane, &self.open, Vec3::ZERO);
        lane.ops()
    }

    /// Camera in world space at mid-shutter as a homogeneous point: its position, or in an orthographic view
    /// the direction towards it.
    pub fn eye(&self) -> Vec4 {
        let at = |pose: &DAffine3| {
            let world = pose.inverse();
            if self.shear.parallel { -world.matrix3.z_axis } else { world.translation }
        };
        let middle = 0.5 * (at(&self.open) + at(&self.close));
        middle.as_vec3().extend(if self.shear.parallel { 0.0 } else { 1.0 })
    }
}

fn widen(pose: glam::Affine3A) -> DAffine3 {
    DAffine3::from_cols_array(&pose.to_cols_array().map(f64::from))
}

/// Culled faces. A face is front if its vertices appear counter-clockwise on the screen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Cull {
    /// No face is culled.
    #[default]
    None,
    /// Back faces are culled, for each sample separately: a triangle may turn over while the shutter is open.
    Back,
    /// Front faces are culled.
    Front,
}

/// Triangles in world space at both ends of the shutter. Vertices move linearly in between.
#[derive(Clone, Copy, Debug)]
pub struct Geometry<'a> {
    open: &'a [Vec3],
    close: &'a [Vec3],
    normals: &'a [Vec3],
    uvs: &'a [Vec2],
    colors: &'a [Vec3],
    triangles: &'a [[u32; 3]],
    clip: Clip,
}

/// Why triangles are invalid.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DrawError {
    /// Arrays over the same vertices differ in length.
    #[error("{what} has {found} entries for {expected} vertices")]
    Length {
        /// Name of the array.
        what: &'static str,
        /// Entries of the array.
        found: usize,
        /// Number of vertices.
        expected: usize,
    },
    /// A triangle has an invalid vertex index.
    #[error("triangle {triangle} uses vertex {vertex}, but there are only {vertices}")]
    Index {
        /// Triangle, from 0.
        triangle: usize,
        /// Vertex index.
        vertex: u32,
        /// Number of vertices.
        vertices: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("{what} of vertex {vertex} is not finite")]
    NotFinite {
        /// Name of the array.
        what: &'static str,
        /// Vertex, from 0.
        vertex: usize,
    },
}

impl<'a> Geometry<'a> {
    /// Triangles with vertices at `open` when the shutter opens and at `close` when it closes. Still
    /// triangles use the same slice twice.
    ///
    /// # Errors
    /// [`DrawError`] if the lengths differ, an index is out of range, or a coordinate is not finite.
    pub fn new(open: &'a [Vec3], close: &'a [Vec3], triangles: &'a [[u32; 3]]) -> Result<Self, DrawError> {
        same_length("the closing positions", close.len(), open.len())?;
        finite("position at the opening", open.iter().map(|p| p.is_finite()))?;
        if !std::ptr::eq(open, close) {
            finite("position at the closing", close.iter().map(|p| p.is_finite()))?;
        }
        for (triangle, corners) in triangles.iter().enumerate() {
            if let Some(&vertex) = corners.iter().find(|&&v| v as usize >= open.len()) {
                return Err(DrawError::Index { triangle, vertex, vertices: open.len() });
            }
        }
        Ok(Self { open, close, normals: &[], uvs: &[], colors: &[], triangles, clip: Clip::NONE })
    }

    /// One still triangle of finite corners.
    pub(crate) fn triangle(corners: &'a [Vec3; 3]) -> Self {
        let triangles = &[[0, 1, 2]];
        Self {
            open: corners,
            close: corners,
            normals: &[],
            uvs: &[],
            colors: &[],
            triangles,
            clip: Clip::NONE,
        }
    }

    /// The geometry with one normal per vertex (at mid-shutter, in world space, of any length).
    ///
    /// # Errors
    /// [`DrawError`] if the length differs or a normal is not finite.
    pub fn with_normals(self, normals: &'a [Vec3]) -> Result<Self, DrawError> {
        same_length("the normals", normals.len(), self.open.len())?;
        finite("normal", normals.iter().map(|n| n.is_finite()))?;
        Ok(Self { normals, ..self })
    }

    /// The geometry with one texture coordinate per vertex; (0, 0) is the first texel of the first row.
    ///
    /// # Errors
    /// [`DrawError`] if the length differs or a coordinate is not finite.
    pub fn with_uvs(self, uvs: &'a [Vec2]) -> Result<Self, DrawError> {
        same_length("the texture coordinates", uvs.len(), self.open.len())?;
        finite("texture coordinate", uvs.iter().map(|uv| uv.is_finite()))?;
        Ok(Self { uvs, ..self })
    }

    /// The geometry with one colour per vertex, in linear RGB, for use by its shader.
    ///
    /// # Errors
    /// [`DrawError`] if the length differs or a colour is not finite.
    pub fn with_colors(self, colors: &'a [Vec3]) -> Result<Self, DrawError> {
        same_length("the colours", colors.len(), self.open.len())?;
        finite("colour", colors.iter().map(|color| color.is_finite()))?;
        Ok(Self { colors, ..self })
    }

    /// The geometry with clip planes across lens and shutter, which limit where it is drawn.
    #[must_use]
    pub fn with_clip(self, clip: Clip) -> Self {
        Self { clip, ..self }
    }

    /// Part of lens and shutter in which it is drawn.
    pub fn clip(&self) -> Clip {
        self.clip
    }

    /// Positions when the shutter opens.
    pub fn open(&self) -> &'a [Vec3] {
        self.open
    }

    /// Positions when the shutter closes.
    pub fn close(&self) -> &'a [Vec3] {
        self.close
    }

    /// Whether both ends are the same array, so nothing moves.
    pub fn is_still(&self) -> bool {
        std::ptr::eq(self.open, self.close)
    }

    /// Normals; empty for flat faces.
    pub fn normals(&self) -> &'a [Vec3] {
        self.normals
    }

    /// Texture coordinates, if any.
    pub fn uvs(&self) -> &'a [Vec2] {
        self.uvs
    }

    /// Colours in linear RGB, if any.
    pub fn colors(&self) -> &'a [Vec3] {
        self.colors
    }

    /// Vertex indices of every triangle, all in range.
    pub fn triangles(&self) -> &'a [[u32; 3]] {
        self.triangles
    }

    /// Bytes per fetched vertex: positions (of both ends if they differ) and attributes.
    pub fn vertex_bytes(&self) -> u32 {
        let bytes = |size: u32, present: bool| if present { size } else { 0 };
        12 + bytes(12, !self.is_still())
            + bytes(12, !self.normals.is_empty())
            + bytes(8, !self.uvs.is_empty())
            + bytes(12, !self.colors.is_empty())
    }
}

fn same_length(what: &'static str, found: usize, expected: usize) -> Result<(), DrawError> {
    if found == expected { Ok(()) } else { Err(DrawError::Length { what, found, expected }) }
}

fn finite(what: &'static str, mut values: impl Iterator<Item = bool>) -> Result<(), DrawError> {
    values.position(|finite| !finite).map_or(Ok(()), |vertex| Err(DrawError::NotFinite { what, vertex }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Affine3A;

    use crate::geometry::Lens;

    #[test]
    fn the_corner_of_the_view_is_the_corner_of_the_image() {
        let camera = Camera::new(Affine3A::IDENTITY, 0.5, 0.1).unwrap();
        let projection = Projection::new(&camera, Viewport::new(400, 200).unwrap());
        let [x, y, w] = projection.vertex(Vec3::new(2.0, 1.0, 2.0), Vec3::ZERO).open;
        assert_eq!((x / w, y / w, w), (200.0, -100.0, 2.0));
    }

    #[test]
    fn a_lens_does_not_move_points_in_focus() {
        let lens = Lens::new(0.25, 8.0).unwrap();
        let camera = Camera::new(Affine3A::IDENTITY, 1.0, 0.1).unwrap().with_lens(Some(lens));
        let shear = Projection::new(&camera, Viewport::new(512, 512).unwrap()).shear;
        assert_eq!(shear.a[0] * 8.0 - shear.s[0], 0.0);
        assert!(shear.s[0] > 0.0 && shear.s[1] < 0.0);
    }

    #[test]
    fn an_orthographic_view_is_as_high_at_any_depth() {
        let camera = Camera::orthographic(Affine3A::IDENTITY, 2.0, 0.1).unwrap();
        let camera = camera.with_shift(Vec2::new(0.25, 0.0)).unwrap();
        let projection = Projection::new(&camera, Viewport::new(400, 200).unwrap());
        for depth in [-1.0, 0.0, 2.0, 50.0] {
            let corner = projection.vertex(Vec3::new(4.0, 2.0, depth), Vec3::ZERO).open;
            assert_eq!(corner, [250.0, -100.0, depth]);
        }
        assert_eq!(projection.eye(), Vec4::new(0.0, 0.0, -1.0, 0.0));
        assert_eq!(projection.shear.homogeneous([3.0, 4.0, 5.0]), [3.0, 4.0, 1.0]);
    }

    /// Slope and base of a ray agree with the formula of the shear, for all views and lenses.
    #[test]
    fn rays_are_the_formula() {
        let (s, a, [x, w], [at, lens]) = ([6.0, -6.0], [2.0, -2.0], [7.0_f32, 5.0], [-3.0_f32, 0.5]);
        for parallel in [false, true] {
            let shear = Shear { parallel, ..Shear::new(s, a) };
            for axis in [0, 1] {
                let [slope, base] = shear.ray(axis, at, lens);
                let seen = x + lens * (a[axis] * w - s[axis]) - at * shear.weight(w);
                assert_eq!((x - base) - slope * w, seen, "{parallel} {axis}");
            }
        }
    }

    #[test]
    fn viewports_have_an_area() {
        assert!(Viewport::new(0, 4).is_none());
        assert!(Viewport::new(4, 16_385).is_none());
        assert_eq!(Viewport::new(3, 5).unwrap().pixels(), 15);
    }

    const CORNERS: [Vec3; 3] = [Vec3::ZERO, Vec3::X, Vec3::Y];

    #[test]
    fn an_index_out_of_range_is_named() {
        let error = Geometry::new(&CORNERS, &CORNERS, &[[0, 1, 2], [0, 1, 3]]).unwrap_err();
        assert_eq!(error, DrawError::Index { triangle: 1, vertex: 3, vertices: 3 });
    }

    #[test]
    fn a_nan_vertex_is_named() {
        let bad = [Vec3::ZERO, Vec3::new(0.0, f32::NAN, 0.0), Vec3::Y];
        let error = Geometry::new(&CORNERS, &bad, &[[0, 1, 2]]).unwrap_err();
        assert_eq!(error, DrawError::NotFinite { what: "position at the closing", vertex: 1 });
    }

    #[test]
    fn a_moving_vertex_costs_both_ends() {
        let still = Geometry::new(&CORNERS, &CORNERS, &[[0, 1, 2]]).unwrap();
        let end = CORNERS;
        let moving = Geometry::new(&CORNERS, &end, &[[0, 1, 2]]).unwrap();
        assert_eq!((still.vertex_bytes(), moving.vertex_bytes()), (12, 24));
        assert_eq!(still.with_colors(&CORNERS).unwrap().vertex_bytes(), 24);
    }
}
