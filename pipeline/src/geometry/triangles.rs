//! Triangles to be drawn, validated once for all later stages.

use glam::{Vec2, Vec3};

use super::Clip;

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
        /// Its length.
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
