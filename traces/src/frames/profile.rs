//! The distance of a template to every stretch of a trace.

/// Offsets handled at once: their sums stay in registers while the template streams by.
const LANES: usize = 16;

/// Summed squared difference `d[k] = sum over j of (power[k + j] - template[j])^2`, in W^2 for powers in W.
///
/// One value per offset at which the template fits, `power.len() - template.len() + 1`; none if it does not fit or
/// is empty. Terms are added in the order of the template, so the result does not depend on how it is blocked.
/// Time: `O(n m)`, `O(n)` memory.
pub fn summed_squared_difference(power: &[f64], template: &[f64]) -> Vec<f64> {
    let width = template.len();
    if width == 0 || power.len() < width {
        return Vec::new();
    }
    let count = power.len() - width + 1;
    let mut profile = vec![0.0; count];
    let mut blocks = profile.chunks_exact_mut(LANES);
    let mut offset = 0;
    for block in &mut blocks {
        block.copy_from_slice(&lanes(&power[offset..offset + width + LANES - 1], template));
        offset += LANES;
    }
    for value in blocks.into_remainder() {
        *value = difference(&power[offset..offset + width], template);
        offset += 1;
    }
    profile
}

/// [`LANES`] successive offsets; `power` is `LANES - 1` longer than the template.
fn lanes(power: &[f64], template: &[f64]) -> [f64; LANES] {
    let mut sums = [0.0; LANES];
    for (stretch, &reference) in power.windows(LANES).zip(template) {
        for (sum, &value) in sums.iter_mut().zip(stretch) {
            let difference = value - reference;
            *sum += difference * difference;
        }
    }
    sums
}

/// The summed squared difference of two stretches of the same length.
pub(super) fn difference(power: &[f64], template: &[f64]) -> f64 {
    power.iter().zip(template).map(|(&value, &reference)| (value - reference) * (value - reference)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn templates_that_do_not_fit_give_nothing() {
        assert!(summed_squared_difference(&[1.0], &[]).is_empty());
        assert!(summed_squared_difference(&[1.0], &[1.0, 2.0]).is_empty());
    }

    proptest! {
        #[test]
        fn oracle_every_offset_is_the_definition_to_the_bit(
            power in prop::collection::vec(-5.0..50.0_f64, 1..200),
            template in prop::collection::vec(-5.0..50.0_f64, 1..40),
        ) {
            let profile = summed_squared_difference(&power, &template);
            prop_assert_eq!(profile.len(), (power.len() + 1).saturating_sub(template.len()));
            for (offset, &value) in profile.iter().enumerate() {
                let mut sum = 0.0;
                for (j, reference) in template.iter().enumerate() {
                    sum += (power[offset + j] - reference) * (power[offset + j] - reference);
                }
                prop_assert_eq!(value, sum);
            }
        }
    }
}
