//! Words: the project uses the terms of the glossary. Words of its own that stood for them are refused.

use std::fs;
use std::path::{Path, PathBuf};

use crate::support::{Inputs, root};

/// Refused words and phrases, each with its replacement. They are compared as whole words, in any case.
const REFUSED: [(&str, &str); 68] = [
    ("a fault of the program", "internal error"),
    ("alike", "in the same way, likewise"),
    ("are told", "are reported; are distinguished"),
    ("as it wants", "as configured"),
    ("asked for", "requested, queried"),
    ("at hand", "available"),
    ("beams and bodies", "light volumes, bounding volumes"),
    ("beaten by", "dominated by"),
    ("bodies and beams", "bounding volumes, light volumes"),
    ("const least", "const MIN_"),
    ("const most", "const MAX_"),
    ("doubt", "warning, low confidence"),
    ("doubted", "flagged"),
    ("doubts", "warnings"),
    ("easel", "output"),
    ("for a look", "for a preview"),
    ("held against", "compared with"),
    ("held up to", "validated against"),
    ("hold against", "compare with"),
    ("how sure", "confidence"),
    ("in vain", "false positive, wasted"),
    ("is no file", "is not a file"),
    ("is no name", "is not a name"),
    ("is no time", "is not a valid time"),
    ("is to be had", "is available"),
    ("is told", "is reported"),
    ("keeps time", "is periodic"),
    ("leaving the camera aside", "camera motion is not considered"),
    ("mend", "fix, repair, fill"),
    ("mended", "fixed, repaired, filled"),
    ("mending", "repair"),
    ("mends", "repairs, fixes"),
    ("numbers apart", "ulp"),
    ("of the house", "of the project"),
    ("on the front", "Pareto-optimal"),
    ("outlook", "expected cost"),
    ("owe", "service demand"),
    ("owed", "service demand"),
    ("owes", "has a service demand of"),
    ("places on the lens", "lens samples"),
    ("places on the light", "light samples"),
    ("pour", "read into"),
    ("poured", "read into"),
    ("pours", "reads into"),
    ("remark", "note, flag"),
    ("remarkable", "flagged"),
    ("remarks", "notes, flags"),
    ("rested", "after an idle gap"),
    ("seldom", "rarely"),
    ("spacing of numbers", "ulp"),
    ("standings", "trade-off points"),
    ("stretch", "segment, range"),
    ("tell", "report, print, distinguish"),
    ("telling", "reporting"),
    ("tells", "reports, prints, distinguishes"),
    ("there is no `", "unknown"),
    ("there is no camera `", "unknown camera"),
    ("there is no folder", "does not exist"),
    ("there is no such", "does not exist"),
    ("unrested", "without an idle gap"),
    ("voids", "uncovered regions"),
    ("watcher", "observer"),
    ("what is asked for", "request, target"),
    ("what the papers report", "reproduction"),
    ("where methods fail", "limitations, failure modes"),
    ("wish", "request, target"),
    ("yard", "scene with walls"),
    ("yardstick", "reference"),
];

/// Files that may hold them: this list, the changelog, which names fields that were renamed, and settings of
/// papers, which do not change after their first number.
const EXEMPT: [&str; 3] = ["tests/e2e/words.rs", "CHANGELOG.md", "sim/experiments/papers"];

/// Endings of files that are read.
const ENDINGS: [&str; 7] = ["rs", "md", "ron", "html", "toml", "py", "sh"];

/// Files below `folder` with one of these endings, without build results and hidden folders.
pub(super) fn files_with(endings: &[&str], folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display())) {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if path.is_dir() {
            if !name.starts_with('.') && name != "target" {
                files.extend(files_with(endings, &path));
            }
        } else if path.extension().is_some_and(|ending| endings.iter().any(|known| ending == *known)) {
            files.push(path);
        }
    }
    files
}

/// Whether `line`, in the form of [`as_words`], holds `phrase` between characters
/// that are not part of a word.
fn holds(line: &str, phrase: &str) -> bool {
    let inside = |c: Option<char>| c.is_some_and(char::is_alphanumeric);
    line.match_indices(phrase).any(|(at, _)| {
        let (before, after) = (line[..at].chars().next_back(), line[at + phrase.len()..].chars().next());
        let open = phrase.ends_with(|c: char| !c.is_alphanumeric());
        !inside(before) && (open || !inside(after))
    })
}

/// A line as single words in small letters: identifiers are split at `_` and before capital letters.
fn as_words(line: &str) -> String {
    let mut words = String::new();
    let mut before = ' ';
    for c in line.chars() {
        if c.is_uppercase() && before.is_lowercase() {
            words.push(' ');
        }
        words.extend(c.to_lowercase());
        before = c;
    }
    words.replace('_', " ")
}

/// Text of a line that is a comment alone.
fn comment(line: &str) -> Option<&str> {
    let text = line.trim_start().strip_prefix("//")?;
    Some(text.trim_start_matches(['/', '!']).trim())
}

/// Whether a phrase begins at the end of a comment line and goes on in the comment line after it.
fn is_wrapped(line: &str, next: &str, phrase: &str) -> bool {
    let (Some(line), Some(next)) = (comment(line), comment(next)) else { return false };
    holds(&format!("{line} {next}"), phrase) && !holds(line, phrase) && !holds(next, phrase)
}

/// Refused words in a file of this name, each as `file:line: what to write`.
fn refused(name: &str, text: &str) -> Vec<String> {
    let mut found = Vec::new();
    let lines: Vec<String> = text.lines().map(as_words).collect();
    for (index, line) in lines.iter().enumerate() {
        let next = lines.get(index + 1).map_or("", String::as_str);
        let is_held = |phrase: &str| holds(line, phrase) || is_wrapped(line, next, phrase);
        let held = REFUSED.iter().filter(|(phrase, _)| is_held(phrase));
        found.extend(held.map(|(phrase, instead)| {
            format!("{name}:{}: `{phrase}` is not a word of this project: write `{instead}`", index + 1)
        }));
    }
    found
}

#[test]
fn texts_use_the_words_of_the_glossary() {
    let root = root();
    let files = files_with(&ENDINGS, &root);
    assert!(files.len() > 300, "only {} files were read", files.len());
    let mut found = Vec::new();
    for file in files {
        let name = file.strip_prefix(&root).unwrap().to_string_lossy().into_owned();
        if !EXEMPT.iter().any(|exempt| name.starts_with(exempt)) {
            found.extend(refused(&name, &fs::read_to_string(&file).unwrap()));
        }
    }
    found.sort();
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn refused_words_are_found_with_file_and_line() {
    let inputs = Inputs::new();
    inputs.put("page.md", "Fine.\nIt was Mended.\nfn kept_in_vain() {}\n");
    inputs.put("data.csv", "mend");
    let files = files_with(&ENDINGS, Path::new(&inputs.path("")));
    assert_eq!(files.len(), 1, "{files:?}");
    let found = refused("page.md", &fs::read_to_string(&files[0]).unwrap());
    assert_eq!(
        found,
        [
            "page.md:2: `mended` is not a word of this project: write `fixed, repaired, filled`",
            "page.md:3: `in vain` is not a word of this project: write `false positive, wasted`"
        ]
    );
    assert!(refused("a.rs", "a mending, amended, recommend, intelligible\n").len() == 1);
    for found in [
        "const LEAST: u32 = 1;",
        "const MOST_LIGHTS: u32 = 1;",
        "struct KeptInVain;",
        "/// It is kept in\n/// vain.",
        "fn wishes() { let oneWish = 1; }",
    ] {
        assert_eq!(refused("a.rs", found).len(), 1, "{found}");
    }
    assert!(refused("a.rs", "// kept in\nlet vain = 1;\nconst LEASTWISE: u32 = 1;\n").is_empty());
    assert!(refused("a.rs", "there is no `x`; there is no `\n").len() == 1);
}

#[test]
fn the_list_is_sorted_and_in_small_letters() {
    assert!(REFUSED.is_sorted());
    assert!(REFUSED.iter().all(|(phrase, instead)| *phrase == phrase.to_lowercase() && !instead.is_empty()));
}
