//! Shading: what a shader is, where it is evaluated, and which quads a packet asks for.
//!
//! A sample is not shaded where it lies but at the cell of the shading grid its point of the surface falls into at the
//! reference lens position and time, `(u, v, t) = (0, 0, 1/2)` (decoupled sampling, Ragan-Kelley et al. 2011). The value
//! of a cell depends on the triangle and the cell alone. The alternative shades every sample where it lies; its quads are of
//! 2x2 pixels at one sample index.

mod grid;
mod quads;
mod shader;

pub use grid::{REFERENCE_TIME, cell, cell_weights, weights_at};
pub use quads::{QuadAccess, QuadSet};
pub use shader::{Shader, ShaderCost, ShadingPoint};
