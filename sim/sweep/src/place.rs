//! Lines of a sweep file: where a field or an entry of a list stands.

/// `file` with the line of `place` in its RON `text`; `file` alone if it is not found. A place is a field of the sweep, such as `points`,
/// or an entry of its list, such as `axes[2]`.
pub(crate) fn placed(text: &str, file: &str, place: &str) -> String {
    match line_of(text, place) {
        Some(line) => format!("{file}:{line}"),
        None => file.to_owned(),
    }
}

fn line_of(text: &str, place: &str) -> Option<usize> {
    let (field, entry) = match place.split_once('[') {
        Some((field, rest)) => (field, Some(rest.strip_suffix(']')?.parse::<usize>().ok()?)),
        None => (place, None),
    };
    let bare = without_texts(text);
    let at = field_at(&bare, field)?;
    let at = match entry {
        Some(entry) => entry_at(&bare, at, entry)?,
        None => at,
    };
    Some(1 + text[..at].matches('\n').count())
}

/// Depth of brackets at each letter, itself excluded.
fn depths(text: &str) -> impl Iterator<Item = (usize, char, usize)> + '_ {
    let mut depth = 0_usize;
    text.char_indices().map(move |(at, letter)| {
        let here = depth;
        match letter {
            '(' | '[' | '{' => depth += 1,
            ')' | ']' | '}' => depth = depth.saturating_sub(1),
            _ => {}
        }
        (at, letter, here)
    })
}

fn field_at(bare: &str, field: &str) -> Option<usize> {
    let is_name = |letter: char| letter.is_alphanumeric() || letter == '_';
    let is_field = |at: usize| {
        let rest = bare[at..].strip_prefix(field).is_some_and(|rest| rest.trim_start().starts_with(':'));
        rest && !bare[..at].ends_with(is_name)
    };
    depths(bare).find(|&(at, _, depth)| depth == 1 && is_field(at)).map(|(at, ..)| at)
}

/// The entry of the list that follows `from`.
fn entry_at(bare: &str, from: usize, entry: usize) -> Option<usize> {
    let first = from + bare[from..].find('[')? + 1;
    let commas = depths(&bare[first..]).filter(|&(_, letter, depth)| letter == ',' && depth == 0);
    let start = match entry {
        0 => first,
        _ => first + commas.map(|(at, ..)| at).nth(entry - 1)? + 1,
    };
    Some(start + bare[start..].find(|letter: char| !letter.is_whitespace())?)
}

/// The text with blanks in place of comments and of what is in quotes, as long as before.
fn without_texts(text: &str) -> String {
    let mut bare = String::with_capacity(text.len());
    let blank = |bare: &mut String, part: &str| {
        part.chars().for_each(|letter| match letter {
            '\n' => bare.push('\n'),
            letter => bare.extend(std::iter::repeat_n(' ', letter.len_utf8())),
        });
    };
    let mut rest = text;
    while let Some(letter) = rest.chars().next() {
        let length = if rest.starts_with("//") {
            rest.find('\n').unwrap_or(rest.len())
        } else if rest.starts_with("/*") {
            rest.find("*/").map_or(rest.len(), |end| end + 2)
        } else if letter == '"' {
            bare.push('"');
            rest = &rest[1..];
            end_of_text(rest)
        } else {
            bare.push(letter);
            rest = &rest[letter.len_utf8()..];
            continue;
        };
        blank(&mut bare, &rest[..length]);
        rest = &rest[length..];
    }
    bare
}

/// Length of a text in quotes with the closing one.
fn end_of_text(rest: &str) -> usize {
    let mut is_escaped = false;
    let end = rest.char_indices().find(|&(_, letter)| {
        let ends = letter == '"' && !is_escaped;
        is_escaped = letter == '\\' && !is_escaped;
        ends
    });
    end.map_or(rest.len(), |(at, _)| at + 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const TEXT: &str = r#"( // axes: [
    name: "axes: [\", 1", doc: "é",
    axes: [
        Values(path: "a", values: [1, 2]), /* Values(), */ Values(
            path: "b", values: [3]),

        Linked(settings: {"c": [1], "axes": [2]}),
    ],
    constraints: ["a, b < 1",
        "b > 2"],
)"#;

    #[test]
    fn places_have_lines() {
        for (place, line) in [
            ("name", Some(2)),
            ("axes", Some(3)),
            ("axes[0]", Some(4)),
            ("axes[1]", Some(4)),
            ("axes[2]", Some(7)),
            ("constraints[0]", Some(9)),
            ("constraints[1]", Some(10)),
            ("points", None),
            ("axes[x]", None),
        ] {
            assert_eq!(line_of(TEXT, place), line, "{place}");
        }
        assert_eq!(placed(TEXT, "a.ron", "axes[2]"), "a.ron:7");
        assert_eq!(placed("", "a.ron", "axes[2]"), "a.ron");
    }

    proptest! {
        #[test]
        fn any_text_has_places_or_none(text in "[\\[\\](){}\"/*:, a\\\\é\n]{0,80}") {
            let bare = without_texts(&text);
            prop_assert_eq!(bare.len(), text.len());
            prop_assert!(line_of(&text, "a[2]").is_none_or(|line| line <= 1 + text.matches('\n').count()));
        }
    }
}
