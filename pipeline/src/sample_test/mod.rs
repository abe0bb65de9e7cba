//! The sample test: is this sample, at its own `(x, y, u, v, t)`, inside the triangle, and how deep?
//!
//! The three vertices are moved to the time of the sample, sheared to its place on the lens and translated so that
//! the sample is the origin of the image plane:
//!
//! ```text
//! x' = x + u (a w - s) - X w = (x - u s) - (X - u a) w        and y' alike
//! e_ij = x_i' y_j' - x_j' y_i'
//! ```
//!
//! In an orthographic view `X` is taken off as it is, not times `w`, and `u a w` stays: of a base and a slope of its own,
//! `(x - base) - slope w`, a sample has both forms ([`crate::geometry::Shear::ray`]).
//!
//! The first equals `(p_i x p_j) . (X, Y, 1)` and has far smaller intermediate values. The sample is inside when all three
//! edges have one sign, and its depth is the convex combination `sum(e_k w_k) / sum(e_k)` beyond the near depth.
//!
//! Why this form: every operation rounds once, so `e_ji = -e_ij` holds to the last bit and neighbours agree on a shared
//! edge without agreeing on an order; a strict sign of the rounded difference is the sign of the exact one, since
//! rounding is monotone; and where the rounded products tie, [`exact`] decides on the exact ones in `f64`. The
//! test is therefore *exact* for the rounded points `(x', y')`, which is what makes it watertight and lets culling
//! be proved to change nothing: points that lie on one side of a line through the sample cannot surround it.

pub(crate) mod block;
pub mod exact;
mod kernel;
mod madds;

pub use crate::simd::Width;
pub use kernel::{Hits, PixelHits, Target, test_run, test_run_at, test_screened};
pub use madds::madds;
