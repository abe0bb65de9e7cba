//! Minima of one stretch of the profile, such that stretches join without a seam.

use multiversion::multiversion;

/// Offsets in `from..to` of `profile` (which begins before `from` and reaches beyond `to`) that are lowest within less
/// than `spacing` on either side; `from` is a multiple of `spacing` in the whole. Of ties, the first of each stretch of
/// `spacing`; who joins stretches drops those nearer than `spacing` to the one before.
pub(super) fn minima(profile: &[f32], from: usize, to: usize, spacing: usize, mut take: impl FnMut(usize)) {
    let mut block = from;
    while block < to {
        let values = &profile[block..to.min(block + spacing)];
        let lowest = lowest(values);
        let Some(at) = values.iter().position(|&value| value == lowest) else {
            block += spacing;
            continue;
        };
        let offset = block + at;
        let before = &profile[(offset + 1).saturating_sub(spacing)..offset];
        let after = &profile[offset + 1..profile.len().min(offset + spacing)];
        if !before.iter().chain(after).any(|&other| other < lowest) {
            take(offset);
        }
        block += spacing;
    }
}

/// The lowest value, in lanes that the compiler keeps in one register.
#[multiversion(targets("x86_64+avx2"))]
fn lowest(values: &[f32]) -> f32 {
    let less = |a: f32, b: f32| if b < a { b } else { a };
    let mut lanes = [f32::INFINITY; 16];
    let chunks = values.chunks_exact(16);
    let rest = chunks.remainder().iter().fold(f32::INFINITY, |low, &value| less(low, value));
    for chunk in chunks {
        for (low, &value) in lanes.iter_mut().zip(chunk) {
            *low = less(*low, value);
        }
    }
    lanes.into_iter().fold(rest, less)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn oracle_by_comparing_all() {
        let profile: Vec<f32> = (0..5000_u32).map(|i| (i * 7919 % 4999) as f32).collect();
        for spacing in [1, 2, 7, 40, 125] {
            let (from, to) = (spacing * 3, 4000);
            let mut found = Vec::new();
            minima(&profile, from, to, spacing, |offset| found.push(offset));
            let alone = |k: &usize| {
                let around = (k + 1).saturating_sub(spacing)..(k + spacing).min(profile.len());
                around.filter(|other| other != k).all(|other| profile[other] > profile[*k])
            };
            assert_eq!(found, (from..to).filter(alone).collect::<Vec<_>>(), "{spacing}");
        }
    }
}
