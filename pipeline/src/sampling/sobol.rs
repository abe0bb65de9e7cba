//! Five dimensions of the Sobol sequence with Owen scrambling.
//!
//! Direction numbers: Joe and Kuo 2008, `new-joe-kuo-6`, dimensions 1 to 5. Scrambling: Laine and Karras 2011 as
//! improved by Burley 2020 ("Practical Hash-based Owen Scrambling"), equation of listing 3.

/// Primitive polynomial degree, coefficients and initial odd numbers of dimensions 2 to 5.
const JOE_KUO: [(usize, u32, &[u32]); 4] =
    [(1, 0, &[1]), (2, 1, &[1, 3]), (3, 1, &[1, 3, 1]), (3, 2, &[1, 1, 1])];

const fn directions() -> [[u32; 32]; 5] {
    let mut v = [[0_u32; 32]; 5];
    let mut bit = 0;
    while bit < 32 {
        v[0][bit] = 1 << (31 - bit);
        bit += 1;
    }
    let mut dim = 0;
    while dim < 4 {
        let (degree, coefficients, initial) = JOE_KUO[dim];
        let mut i = 0;
        while i < 32 {
            v[dim + 1][i] = if i < degree {
                initial[i] << (31 - i)
            } else {
                let mut value = v[dim + 1][i - degree] ^ (v[dim + 1][i - degree] >> degree);
                let mut k = 1;
                while k < degree {
                    if (coefficients >> (degree - 1 - k)) & 1 == 1 {
                        value ^= v[dim + 1][i - k];
                    }
                    k += 1;
                }
                value
            };
            i += 1;
        }
        dim += 1;
    }
    v
}

const DIRECTIONS: [[u32; 32]; 5] = directions();

/// Point `index` of dimension `dim` (0 to 4) as a 32-bit fraction.
pub(super) fn sobol(index: u32, dim: usize) -> u32 {
    let mut bits = index;
    let mut value = 0;
    while bits != 0 {
        value ^= DIRECTIONS[dim][bits.trailing_zeros() as usize];
        bits &= bits - 1;
    }
    value
}

/// Nested uniform scrambling of a 32-bit fraction: keeps the net structure, randomizes all else.
pub(super) fn owen(value: u32, seed: u32) -> u32 {
    let mut x = value.reverse_bits();
    x ^= x.wrapping_mul(0x3D20_ADEA);
    x = x.wrapping_add(seed);
    x = x.wrapping_mul((seed >> 16) | 1);
    x ^= x.wrapping_mul(0x0552_6C56);
    x ^= x.wrapping_mul(0x53A2_2864);
    x.reverse_bits()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn first_points_are_the_published_ones() {
        let point = |i| [0, 1, 2, 3, 4].map(|d| f64::from(sobol(i, d)) / 4_294_967_296.0);
        assert_eq!(point(1), [0.5; 5]);
        // scipy 1.17's qmc.Sobol(5, scramble=False), whose Gray code order has them the other way round.
        assert_eq!(point(2), [0.25, 0.75, 0.75, 0.75, 0.25]);
        assert_eq!(point(3), [0.75, 0.25, 0.25, 0.25, 0.75]);
    }

    #[test]
    fn every_dimension_is_stratified_scrambled_or_not() {
        for dim in 0..5 {
            for seed in [None, Some(1), Some(0xDEAD_BEEF)] {
                let mut strata: Vec<u32> =
                    (0..16).map(|i| seed.map_or(sobol(i, dim), |s| owen(sobol(i, dim), s)) >> 28).collect();
                strata.sort_unstable();
                assert_eq!(strata, (0..16).collect::<Vec<_>>(), "dimension {dim}, seed {seed:?}");
            }
        }
    }
}
