//! Sample test: whether a sample at its own `(x, y, u, v, t)` is inside the triangle, and its depth.
//!
//! The three vertices are moved to the time of the sample, sheared to its lens position, and translated so
//! that the sample is the origin of the image plane:
//!
//! ```text
//! x' = x + u (a w - s) - X w = (x - u s) - (X - u a) w        and y' likewise
//! e_ij = x_i' y_j' - x_j' y_i'
//! ```
//!
//! In an orthographic view `X` is subtracted without the factor `w`, and `u a w` stays. With a base and a
//! slope of its own, `(x - base) - slope w`, a sample covers both forms ([`crate::geometry::Shear::ray`]).
//!
//! The first form equals `(p_i x p_j) . (X, Y, 1)` and has far smaller intermediate values. The sample is
//! inside if all three edges have one sign. Its depth is the convex combination `sum(e_k w_k) / sum(e_k)`,
//! which has to be beyond the near depth.
//!
//! Every operation rounds once, so `e_ji = -e_ij` holds to the last bit, and neighbours agree on a shared
//! edge without a common vertex order. Rounding is monotone, so a strict sign of the rounded difference is
//! the exact sign. If the rounded products tie, [`exact`] decides by the exact products in `f64`. The test is
//! therefore *exact* for the rounded points `(x', y')`. That makes it watertight, and allows proofs that
//! culling changes nothing: points on one side of a line through the sample cannot surround it.

pub(crate) mod block;
pub mod exact;
mod kernel;

pub use crate::simd::Width;
pub use kernel::{Covered, Hits, PixelHits, SampleTest, Target, madds, test_run};
