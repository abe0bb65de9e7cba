//! A triangle and a bin, as the bounds over cells see them.

use super::bin::BinSamples;
use super::facing::Facing;
use crate::geometry::Shear;
use crate::setup::Triangle;
use crate::simd::Row;

/// What rounding may do to a sum of products of `f32`, as a share of the sum of magnitudes.
pub(super) const ROUNDING: f32 = 1.0 / 524_288.0;

/// What a worker needs to know of triangle, camera and bin.
#[derive(Clone, Copy)]
pub(super) struct Scene<'a> {
    pub triangle: &'a Triangle,
    pub facing: &'a Facing,
    pub shear: &'a Shear,
    pub near: f32,
    pub bin: &'a BinSamples,
    /// The largest |X| and |Y| of the image.
    pub half_px: [f32; 2],
    /// Height of a block, and rows of blocks in a bin.
    pub block_px: u32,
    pub block_rows: u32,
}

/// An edge by cell.
#[derive(Clone, Debug)]
pub(super) struct EdgeRows {
    /// By face: what the edge is at most anywhere in the cell, in the sign of the face, less its slopes times X and Y.
    pub most: [Row; 2],
    pub slope_x: Row,
    pub slope_y: Row,
}

/// Half the extents of a cell and what follows from them.
pub(super) struct Extent<V> {
    pub screen: [V; 2],
    pub lens: [V; 2],
    pub t: V,
    /// The largest `a du - dX`, in x and y.
    pub turn: [V; 2],
    /// The largest `s du`.
    pub shift: [V; 2],
}
