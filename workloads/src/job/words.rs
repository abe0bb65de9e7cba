//! What `serde` finds wrong with a value, in words of those who type it.

use std::borrow::Cow;

use activity::spec::suggestion;

/// Kinds of values as Rust calls them, and what they are.
const KINDS: [(&str, &str); 11] = [
    ("u8", "a whole number from 0 to 255"),
    ("u16", "a whole number from 0 to 65535"),
    ("u32", "a whole number from 0 to 4294967295"),
    ("u64", "a whole number from 0 on"),
    ("usize", "a whole number from 0 on"),
    ("f32", "a finite number"),
    ("f64", "a finite number"),
    ("a boolean", "true or false"),
    ("a string", "text"),
    ("path string", "the path of a file"),
    ("a sequence", "a list in brackets, with commas between"),
];

/// `error`, which deserializing `value` ended with, as a sentence about it.
pub(super) fn plain(value: &str, error: &str) -> String {
    let expected = error.split_once(", expected ").map_or("", |(_, expected)| expected);
    let value = &*clipped(value);
    if error.starts_with("unknown variant") {
        let names: Vec<&str> = expected.split('`').skip(1).step_by(2).collect();
        return format!("there is no `{value}`; {}", suggestion(value, &names));
    }
    if expected == "fewer elements in array" {
        return format!("`{value}` has too many values in a list");
    }
    if error.starts_with("invalid") && !expected.is_empty() {
        return format!("`{value}` is not {}", kind(expected));
    }
    format!("`{value}`: {error}")
}

/// What was typed, or how it begins.
pub(super) fn clipped(value: &str) -> Cow<'_, str> {
    const MOST: usize = 60;
    match value.char_indices().nth(MOST) {
        None => value.into(),
        Some((end, _)) => format!("{}...", &value[..end]).into(),
    }
}

fn kind(expected: &str) -> String {
    let list = |count: &str| format!("a list of {count} values in brackets, with commas between");
    if let Some(count) = expected.strip_prefix("an array of length ") {
        return list(count);
    }
    if let Some(rest) = expected.strip_prefix("a tuple of size ") {
        return list(rest);
    }
    let known = KINDS.iter().find(|(name, _)| *name == expected);
    known.map_or_else(|| expected.to_owned(), |(_, what)| (*what).to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told<T: serde::de::DeserializeOwned>(value: serde_json::Value, typed: &str) -> String {
        plain(typed, &serde_json::from_value::<T>(value).err().unwrap().to_string())
    }

    #[test]
    fn kinds_are_told_in_plain_words() {
        assert_eq!(told::<u32>((-1).into(), "-1"), "`-1` is not a whole number from 0 to 4294967295");
        assert_eq!(told::<f64>("wide".into(), "wide"), "`wide` is not a finite number");
        assert_eq!(told::<bool>(2.into(), "2"), "`2` is not true or false");
        assert!(told::<[f64; 3]>(2.into(), "2").starts_with("`2` is not a list of 3 values"));
        assert_eq!(
            told::<[f64; 1]>(serde_json::json!([1, 2]), "[1, 2]"),
            "`[1, 2]` has too many values in a list"
        );
        assert!(
            told::<(f64, f64)>(serde_json::json!([1]), "[1]").starts_with("`[1]` is not a list of 2 values")
        );
    }

    #[test]
    fn words_of_serde_are_nowhere() {
        for told in
            [told::<u8>(300.into(), "300"), told::<String>(1.into(), "1"), told::<Vec<u8>>(1.into(), "1")]
        {
            assert!(!told.contains("invalid") && !told.contains("expected"), "{told}");
        }
    }
}
