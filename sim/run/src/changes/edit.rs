//! Changing one value in RON text. The rest of the text stays as it is, comments included, so that the
//! changed text is read and checked as any file.

use std::ops::Range;

use activity::spec::suggestion;

/// Deepest nesting of brackets; that of the RON parser.
const MAX_DEPTH: usize = 128;

/// Fields by which an entry of a list is named in a path, such as the `unit` of a row of `units`.
const NAMES: [&str; 3] = ["name", "event", "unit"];

/// A value in RON text.
#[derive(Debug)]
struct Node {
    /// Bytes of the text, from the name of a variant to the closing bracket.
    span: Range<usize>,
    group: Option<Group>,
}

/// Contents of a pair of brackets.
#[derive(Debug)]
struct Group {
    /// Byte offset of the closing bracket.
    close: usize,
    /// The closing bracket.
    bracket: u8,
    /// Whether a comma has to come before a further item.
    needs_comma: bool,
    items: Vec<Item>,
}

/// A field, an entry of a map, or an element of a list.
#[derive(Debug)]
struct Item {
    /// Name of a field, or key of a map without its quotes.
    name: Option<String>,
    value: Node,
}

/// Text being scanned.
struct Scanner<'a> {
    text: &'a str,
    at: usize,
}

/// The value that `text` holds; `None` if it does not hold exactly one.
fn parse(text: &str) -> Option<Node> {
    let mut scanner = Scanner { text, at: 0 };
    let value = scanner.value(0)?;
    scanner.skip_blank();
    (scanner.at == text.len()).then_some(value)
}

impl Scanner<'_> {
    fn rest(&self) -> &str {
        &self.text[self.at..]
    }

    fn peek(&self) -> Option<u8> {
        self.text.as_bytes().get(self.at).copied()
    }

    /// Skips blanks, comments, attributes such as `#![enable(...)]` and a byte order mark.
    fn skip_blank(&mut self) {
        loop {
            let rest = self.rest();
            let blank =
                rest.len() - rest.trim_start_matches(|c: char| c.is_whitespace() || c == '\u{feff}').len();
            let skipped = match rest.get(blank..).unwrap_or_default() {
                rest if rest.starts_with("//") || rest.starts_with("#!") => {
                    rest.find('\n').unwrap_or(rest.len())
                }
                rest if rest.starts_with("/*") => rest.find("*/").map_or(rest.len(), |end| end + 2),
                _ => 0,
            };
            self.at += blank + skipped;
            if blank + skipped == 0 {
                return;
            }
        }
    }

    fn value(&mut self, depth: usize) -> Option<Node> {
        self.skip_blank();
        let start = self.at;
        match self.peek()? {
            b'"' => self.quoted("\"")?,
            b'(' | b'[' | b'{' => {}
            b'r' if self.rest()[1..].starts_with(['"', '#']) => self.raw()?,
            _ => self.word()?,
        }
        let end = self.at;
        self.skip_blank();
        let is_group = matches!(self.peek(), Some(b'(')) || end == start;
        let group = if is_group { Some(self.group(depth)?) } else { None };
        if group.is_none() {
            self.at = end;
        }
        Some(Node { span: start..self.at, group })
    }

    /// Skips a string that ends with `quote`.
    fn quoted(&mut self, quote: &str) -> Option<()> {
        self.at += 1;
        loop {
            let rest = self.rest();
            self.at += rest.find([quote.chars().next()?, '\\'])?;
            if self.peek()? != b'\\' {
                self.at += 1;
                return Some(());
            }
            self.at += 1 + self.rest()[1..].chars().next()?.len_utf8();
        }
    }

    /// Skips a raw string such as `r#"text"#`.
    fn raw(&mut self) -> Option<()> {
        let hashes = self.rest()[1..].bytes().take_while(|&byte| byte == b'#').count();
        let open = 1 + hashes + 1;
        let body = self.rest().get(open..).filter(|_| self.rest().as_bytes()[open - 1] == b'"')?;
        let close = format!("\"{}", "#".repeat(hashes));
        self.at += open + body.find(&close)? + close.len();
        Some(())
    }

    /// Skips a number, a name or a character.
    fn word(&mut self) -> Option<()> {
        if self.peek() == Some(b'\'') {
            return self.quoted("'");
        }
        let is_end = |c: char| c.is_whitespace() || "()[]{},:\"/".contains(c);
        let length = self.rest().find(is_end).unwrap_or(self.rest().len());
        self.at += length;
        (length > 0).then_some(())
    }

    fn group(&mut self, depth: usize) -> Option<Group> {
        let bracket = match self.peek()? {
            b'(' => b')',
            b'[' => b']',
            _ => b'}',
        };
        self.at += 1;
        let (mut items, mut needs_comma) = (Vec::new(), false);
        loop {
            self.skip_blank();
            let next = self.peek()?;
            if next == bracket {
                let close = self.at;
                self.at += 1;
                return Some(Group { close, bracket, needs_comma, items });
            }
            if needs_comma || depth >= MAX_DEPTH {
                return None;
            }
            items.push(self.item(depth)?);
            self.skip_blank();
            needs_comma = self.peek()? != b',';
            self.at += usize::from(!needs_comma);
        }
    }

    fn item(&mut self, depth: usize) -> Option<Item> {
        let value = self.value(depth + 1)?;
        self.skip_blank();
        if self.peek()? != b':' {
            return Some(Item { name: None, value });
        }
        self.at += 1;
        let name = unquoted(&self.text[value.span]).to_owned();
        Some(Item { name: Some(name), value: self.value(depth + 1)? })
    }
}

/// Text without the quotes of a plain string.
fn unquoted(text: &str) -> &str {
    text.strip_prefix('"').and_then(|text| text.strip_suffix('"')).unwrap_or(text)
}

fn is_string(text: &str) -> bool {
    text.starts_with(['"', 'r']) && text.ends_with(['"', '#'])
}

/// `text` with `value` at `path`, a list of field names, map keys, and indices or names of list entries. A
/// field that is missing in the text is added; whether it is known is for the deserializer to say.
///
/// # Errors
/// In words, if the path does not lead to a value or `value` is not one.
pub(super) fn set(text: &str, path: &[&str], value: &str) -> Result<String, String> {
    let mut node = parse(text).ok_or("the file cannot be changed: it is not one value in RON")?;
    for (depth, &name) in path.iter().enumerate() {
        node = unwrapped(node, text);
        let span = node.span.clone();
        let group = node.group.ok_or_else(|| {
            format!("`{}` is a single value, it has no `{name}`", shown(&path[..depth], &text[span.clone()]))
        })?;
        match position(&group, name, text)? {
            Some(at) => node = group.items.into_iter().nth(at).ok_or("an item is missing")?.value,
            None => return added(text, &group, &path[depth..], value),
        }
    }
    let new = written(&text[node.span.clone()], &node, text, value)?;
    Ok(format!("{}{new}{}", &text[..node.span.start], &text[node.span.end..]))
}

fn shown<'a>(path: &[&'a str], value: &'a str) -> &'a str {
    path.last().copied().unwrap_or(value)
}

/// The value inside `Some(...)`.
fn unwrapped(node: Node, text: &str) -> Node {
    let is_some = text[node.span.clone()].starts_with("Some");
    match node.group {
        Some(mut group) if is_some && group.items.len() == 1 && group.items[0].name.is_none() => {
            group.items.remove(0).value
        }
        group => Node { span: node.span, group },
    }
}

/// Index of the item called `name`; `None` if a field of that name may be added.
fn position(group: &Group, name: &str, text: &str) -> Result<Option<usize>, String> {
    let is_named = group.items.iter().any(|item| item.name.is_some());
    let names: Vec<Option<&str>> = group
        .items
        .iter()
        .map(|item| if is_named { item.name.as_deref() } else { entry_name(&item.value, text) })
        .collect();
    let index = || name.parse().ok().filter(|&at| !is_named && at < group.items.len());
    let found = names.iter().position(|known| *known == Some(name)).or_else(index);
    if found.is_some() || is_named || (group.bracket != b']' && group.items.is_empty()) {
        return Ok(found);
    }
    let known: Vec<&str> = names.into_iter().flatten().collect();
    let count = group.items.len();
    Err(match known.is_empty() {
        true => format!("no entry `{name}` in a list of {count}: give a number from 0 to below {count}"),
        false => format!("no entry `{name}`, {}", suggestion(name, &known)),
    })
}

/// Name of a list entry: the text of its field `name`, `event` or `unit`.
fn entry_name<'a>(entry: &Node, text: &'a str) -> Option<&'a str> {
    let items = &entry.group.as_ref()?.items;
    let is_name = |item: &&Item| item.name.as_deref().is_some_and(|name| NAMES.contains(&name));
    Some(unquoted(&text[items.iter().find(is_name)?.value.span.clone()]))
}

/// `text` with a field added to `group`, and below it structs for the rest of `path`.
fn added(text: &str, group: &Group, path: &[&str], value: &str) -> Result<String, String> {
    let [name, inner @ ..] = path else { return Err("the path is empty".to_owned()) };
    check(value)?;
    if let Some(wrong) = path.iter().find(|name| name.is_empty()) {
        return Err(format!("`{}` has an empty name (`{wrong}`)", path.join(".")));
    }
    let value = inner.iter().rev().fold(value.to_owned(), |value, name| format!("({name}: {value})"));
    let comma = if group.needs_comma { ", " } else { "" };
    let quote = if group.bracket == b'}' { "\"" } else { "" };
    let (before, after) = text.split_at(group.close);
    Ok(format!("{before}{comma}{quote}{name}{quote}: {value}{after}"))
}

fn check(value: &str) -> Result<(), String> {
    match parse(value) {
        Some(_) => Ok(()),
        None => Err(format!("`{value}` is not one value: write it as in the file")),
    }
}

/// Text of `value` in place of `old`. Text is put in quotes where `old` is text. A number with its source, such as
/// `Assumed(0.9, "reason")`, takes a number, and its source becomes the change.
fn written(old: &str, node: &Node, text: &str, value: &str) -> Result<String, String> {
    if is_string(old) {
        return Ok(if is_string(value) && parse(value).is_some() {
            value.to_owned()
        } else {
            format!("{value:?}")
        });
    }
    check(value)?;
    let items = node.group.as_ref().map_or(&[][..], |group| &group.items);
    let is_sourced = matches!(items, [number, source] if number.name.is_none() && is_string(&text[source.value.span.clone()]));
    if is_sourced && value.parse::<f64>().is_ok() {
        return Ok(format!("Assumed({value}, \"set for this run\")"));
    }
    Ok(value.to_owned())
}

/// `text` with the strings of fields called one of `names` replaced where `change` returns another.
pub(super) fn replace_strings(text: &str, names: &[&str], change: &dyn Fn(&str) -> Option<String>) -> String {
    let mut found = Vec::new();
    if let Some(node) = parse(text) {
        strings(&node, text, names, &mut found);
    }
    let mut changed = text.to_owned();
    for span in found.into_iter().rev() {
        if let Some(new) = change(unquoted(&text[span.clone()])) {
            changed.replace_range(span, &format!("{new:?}"));
        }
    }
    changed
}

/// Spans of the strings in fields called one of `names`, in the order of the text.
fn strings(node: &Node, text: &str, names: &[&str], found: &mut Vec<Range<usize>>) {
    for item in node.group.iter().flat_map(|group| &group.items) {
        let is_named = item.name.as_deref().is_some_and(|name| names.contains(&name));
        if is_named && text[item.value.span.clone()].starts_with('"') {
            found.push(item.value.span.clone());
        }
        strings(&item.value, text, names, found);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = r#"// a file (not: this)
(
    name: "a, (b", /* tile_px: 3 */ tile_px: 8,
    memory: Some((l2: (ways: 8), rates: {"lines": 1})),
    rows: [(event: "draws", pj: 1), (event: "lines", pj: 2,)], v_v: Assumed(0.9, "why"),
    shape: Sphere(radius: 1.0), clock: Memory, at: (1, 2)
)"#;

    fn changed(path: &str, value: &str) -> Result<String, String> {
        set(TEXT, &path.split('.').collect::<Vec<_>>(), value)
    }

    #[test]
    fn one_value_is_replaced_and_all_else_stays() {
        for (path, value, from, to) in [
            ("tile_px", "16", "tile_px: 8", "tile_px: 16"),
            ("name", "c", "\"a, (b\"", "\"c\""),
            ("name", "\"c\"", "\"a, (b\"", "\"c\""),
            ("memory.l2.ways", "4", "ways: 8", "ways: 4"),
            ("memory.rates.lines", "2", "\"lines\": 1", "\"lines\": 2"),
            ("rows.lines.pj", "3", "pj: 2", "pj: 3"),
            ("rows.0.pj", "3", "pj: 1", "pj: 3"),
            ("v_v", "1.1", "Assumed(0.9, \"why\")", "Assumed(1.1, \"set for this run\")"),
            ("v_v.0", "1.1", "Assumed(0.9", "Assumed(1.1"),
            ("shape.radius", "2", "radius: 1.0", "radius: 2"),
            ("shape", "Box(size: (1, 1, 1))", "Sphere(radius: 1.0)", "Box(size: (1, 1, 1))"),
            ("clock", "Core", "Memory", "Core"),
            ("at.1", "5", "(1, 2)", "(1, 5)"),
        ] {
            assert_eq!(changed(path, value).unwrap(), TEXT.replacen(from, to, 1), "{path}");
        }
    }

    #[test]
    fn a_missing_field_is_added() {
        for (path, value, from, to) in [
            ("cores", "2", "at: (1, 2)\n)", "at: (1, 2)\n, cores: 2)"),
            ("memory.l2.lines", "64", "(ways: 8)", "(ways: 8, lines: 64)"),
            ("memory.rates.hits", "2", "\"lines\": 1", "\"lines\": 1, \"hits\": 2"),
            ("rows.lines.low", "1", "pj: 2,", "pj: 2,low: 1"),
            ("shape.a.b", "1", "radius: 1.0", "radius: 1.0, a: (b: 1)"),
        ] {
            assert_eq!(changed(path, value).unwrap(), TEXT.replacen(from, to, 1), "{path}");
        }
        assert_eq!(set("()", &["a"], "1").unwrap(), "(a: 1)");
    }

    #[test]
    fn wrong_paths_and_values_are_refused() {
        for (path, value, says) in [
            ("tile_px.side", "1", "`tile_px` is a single value, it has no `side`"),
            ("rows.line.pj", "1", "no entry `line`, did you mean `lines`?"),
            ("at.2", "1", "no entry `2` in a list of 2"),
            ("tile_px", "8, clock: Core", "is not one value"),
            ("tile_px", "(8", "is not one value"),
            ("tile_px", "", "is not one value"),
            ("cores", "8)", "is not one value"),
            ("memory..ways", "8", "empty name"),
        ] {
            let error = changed(path, value).unwrap_err();
            assert!(error.contains(says), "{path}: {error}");
        }
    }

    #[test]
    fn strings_of_named_fields_are_replaced() {
        let change = |text: &str| (text == "a.ply").then(|| "/b/a.ply".to_owned());
        let text = r#"(objects: [(file: "a.ply", name: "a.ply"), (file: "b.ply"), (file: "a.ply")])"#;
        let expected =
            r#"(objects: [(file: "/b/a.ply", name: "a.ply"), (file: "b.ply"), (file: "/b/a.ply")])"#;
        assert_eq!(replace_strings(text, &["file"], &change), expected);
    }

    #[test]
    fn any_text_is_scanned_without_a_panic() {
        let deep = "(".repeat(100_000);
        for text in [
            "",
            "(",
            "\"",
            "r",
            "r#",
            "r#\"",
            "'",
            "'\\",
            "/*",
            "(a:",
            "(a: 1",
            "é",
            "(é: \"\\é\")",
            "#!",
            &deep,
        ] {
            let _ = set(text, &["a"], "1");
            let _ = set("(a: 1)", &["a"], text);
        }
        for end in (0..TEXT.len()).filter(|&end| TEXT.is_char_boundary(end)) {
            assert!(set(&TEXT[..end], &["tile_px"], "1").is_err(), "{end}");
        }
    }
}
