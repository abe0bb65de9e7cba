//! Dart throwing as it began.

use super::cells::Cells;
use crate::points::poisson::{PoissonError, PoissonSpec};
use crate::points::random::Stream;

/// Darts thrown until `misses` in a row have missed (Cook 1986).
///
/// # Errors
/// As [`crate::points::poisson::poisson_disk`].
pub fn plain_darts<const D: usize>(spec: &PoissonSpec, misses: u64) -> Result<Vec<[f64; D]>, PoissonError> {
    let (mut cells, stream) = (Cells::new(spec)?, Stream::new(spec.seed, 0x914E));
    let (mut missed, mut number) = (0, 0);
    while missed < misses {
        let at = std::array::from_fn(|k| grain(stream.unit(number + k as u64)));
        number += D as u64;
        let free = cells.is_free(&at);
        missed = if free { 0 } else { missed + 1 };
        if free {
            cells.add(at);
        }
    }
    Ok(cells.points)
}

/// The multiple of 2^-52 below.
pub(super) fn grain(x: f64) -> f64 {
    let whole = (1_u64 << 52) as f64;
    (x * whole).floor() / whole
}
