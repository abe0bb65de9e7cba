//! Shortest decimals of numbers.

/// Appends a number as [`f64`]'s `Display` writes it: the shortest decimal that reads back the same, without
/// an exponent.
pub(crate) fn push(out: &mut Vec<u8>, value: f64) {
    let mut buffer = zmij::Buffer::new();
    let text = buffer.format(value);
    // An exponent has four characters at most.
    let exponent = text.bytes().rev().take(5).any(|byte| byte == b'e');
    if value.is_finite() && !exponent {
        out.extend_from_slice(text.strip_suffix(".0").unwrap_or(text).as_bytes());
    } else {
        out.extend_from_slice(value.to_string().as_bytes());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn pushed(value: f64) -> String {
        let mut out = Vec::new();
        push(&mut out, value);
        String::from_utf8(out).unwrap()
    }

    #[test]
    fn ends_of_the_range_and_what_is_no_number_are_as_displayed() {
        for value in
            [0.0, -0.0, 1.0, -7.0, 1e15, 1e16, 1e300, 1e-5, 1.5e-6, f64::MAX, f64::MIN_POSITIVE, 5e-324]
        {
            assert_eq!(pushed(value), value.to_string());
        }
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert_eq!(pushed(value), value.to_string());
        }
    }

    proptest! {
        #[test]
        fn property_any_number_is_as_displayed(bits: u64, count in -1_000_000_i64..1_000_000, places in 0_i32..9) {
            prop_assert_eq!(pushed(f64::from_bits(bits)), f64::from_bits(bits).to_string());
            let short = count as f64 / 10_f64.powi(places);
            prop_assert_eq!(pushed(short), short.to_string());
        }
    }
}
