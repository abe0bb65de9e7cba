//! Distances compared without rounding.

use super::Domain;

/// Coordinates are multiples of this, 2^-52 (or of a coarser power of two).
pub(super) const FINEST_BITS: u32 = 52;

/// Whether two points are closer than `radius` (0 to 1/2), exactly: of multiples of 2^-52 squares fit in 128 bits.
pub fn closer<const D: usize>(a: &[f64; D], b: &[f64; D], radius: f64, domain: Domain) -> bool {
    let whole = 1_u64 << FINEST_BITS;
    let square = |k: usize| {
        let apart = ((a[k] - b[k]).abs() * whole as f64) as u64;
        let apart = if domain == Domain::Torus { apart.min(whole - apart) } else { apart };
        u128::from(apart) * u128::from(apart)
    };
    let sum: u128 = (0..D).map(square).sum();
    // radius = mantissa 2^exponent, and the sum is in units of 2^-104.
    let bits = radius.to_bits();
    let (mantissa, exponent) = ((bits & ((1 << 52) - 1)) | 1 << 52, (bits >> 52) as i32 - 1075);
    let shift = (-(2 * exponent + 2 * FINEST_BITS as i32)).max(0) as u32;
    sum.leading_zeros() >= shift && sum << shift < u128::from(mantissa) * u128::from(mantissa)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_bit_decides() {
        let tick = 1.0 / (1_u64 << 52) as f64;
        for radius in [0.3, 0.5, 0.001, 1.0 / 3.0, 1e-6, 0.25] {
            let across = (radius / tick).ceil() * tick;
            let at = |x: f64| [[0.0, 0.5], [x, 0.5]];
            let [a, b] = at(across);
            assert!(!closer(&a, &b, radius, Domain::Box), "{radius}");
            let [a, b] = at(across - tick);
            assert!(closer(&a, &b, radius, Domain::Box) == (across - tick < radius), "{radius}");
        }
        // 3-4-5: exactly at the radius is not closer.
        assert!(!closer(&[0.0, 0.0], &[0.1875, 0.25], 0.3125, Domain::Box));
        assert!(closer(&[0.0, 0.0], &[0.1875, 0.25 - tick], 0.3125, Domain::Box));
    }

    #[test]
    fn a_torus_has_no_border() {
        assert!(closer(&[0.001, 0.5], &[0.999, 0.5], 0.01, Domain::Torus));
        assert!(!closer(&[0.001, 0.5], &[0.999, 0.5], 0.01, Domain::Box));
    }
}
