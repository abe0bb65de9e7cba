//! Minima of one stretch of the profile, such that stretches join without a seam.

/// Offsets in `from..to` of `profile` (which begins before `from` and reaches beyond `to`) that are lowest within less
/// than `spacing` on either side; `from` is a multiple of `spacing` in the whole. Of ties, the first of each stretch of
/// `spacing`; who joins stretches drops those nearer than `spacing` to the one before.
pub(super) fn minima(profile: &[f32], from: usize, to: usize, spacing: usize, mut take: impl FnMut(usize)) {
    let mut block = from;
    while block < to {
        let values = &profile[block..to.min(block + spacing)];
        let lowest = values.iter().fold(f32::INFINITY, |low, &value| if value < low { value } else { low });
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
