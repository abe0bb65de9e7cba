//! Minima of one stretch of the profile, such that stretches join without a seam.

use multiversion::multiversion;

/// Offsets in `from..to` of `profile` (which begins before `from` and reaches beyond `to`) that are lowest within less
/// than `spacing` on either side; `from` is a multiple of `spacing` in the whole. Of ties, the first of each stretch of
/// `spacing`; who joins stretches drops those nearer than `spacing` to the one before.
pub(super) fn minima(profile: &[f32], from: usize, to: usize, spacing: usize, mut take: impl FnMut(usize)) {
    let mut block = from;
    while block < to {
        let values = &profile[block..to.min(block + spacing)];
        let least = lowest(values);
        if let Some(at) = first(values, least) {
            let offset = block + at;
            let before = &profile[(offset + 1).saturating_sub(spacing)..offset];
            let after = &profile[offset + 1..profile.len().min(offset + spacing)];
            if least <= lowest(before) && least <= lowest(after) {
                take(offset);
            }
        }
        block += spacing;
    }
}

/// Values that are compared at once: what the compiler keeps in few registers.
const LANES: usize = 16;

/// The lowest value; infinity of none.
#[multiversion(targets("x86_64+avx2"))]
fn lowest(values: &[f32]) -> f32 {
    let less = |a: f32, b: f32| if b < a { b } else { a };
    let mut lanes = [f32::INFINITY; LANES];
    let (chunks, rest) = values.as_chunks::<LANES>();
    // The last lanes once more, rather than the rest one by one.
    let again = values.last_chunk::<LANES>().filter(|_| !rest.is_empty());
    for chunk in chunks.iter().chain(again) {
        for (low, &value) in lanes.iter_mut().zip(chunk) {
            *low = less(*low, value);
        }
    }
    let few = if chunks.is_empty() { rest } else { &[] };
    few.iter().copied().chain(lanes).fold(f32::INFINITY, less)
}

/// Where a value stands first.
#[multiversion(targets("x86_64+avx2"))]
fn first(values: &[f32], value: f32) -> Option<usize> {
    let (chunks, _) = values.as_chunks::<LANES>();
    // Without a way out from within a chunk.
    let without = chunks
        .iter()
        .take_while(|chunk| !chunk.iter().fold(false, |any, &other| any | (other == value)))
        .count();
    let from = without * LANES;
    Some(from + values[from..].iter().position(|&other| other == value)?)
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
