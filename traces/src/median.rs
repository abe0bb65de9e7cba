//! The middle of many values.

/// The (upper) median; 0 for no values. They are left in another order.
pub(crate) fn median(values: &mut [f64]) -> f64 {
    let middle = values.len() / 2;
    if values.is_empty() { 0.0 } else { *values.select_nth_unstable_by(middle, f64::total_cmp).1 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_upper_of_two_middles_and_nothing_of_nothing() {
        assert_eq!((median(&mut [3.0, 1.0, 2.0, 9.0]), median(&mut [])), (3.0, 0.0));
    }
}
