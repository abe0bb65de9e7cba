//! References: sources and pages name what the repository has, and nothing outside it.

use std::fs;
use std::path::{Path, PathBuf};

use crate::support::root;
use crate::words::files_with;

/// The top-level folders that hold tracked files.
const FOLDERS: [&str; 7] = ["docs", "pipeline", "power-model", "sim", "tests", "traces", "workloads"];

/// Paths in back-ticks that begin with a top-level folder, each with the number of its line.
fn paths_in(text: &str) -> Vec<(usize, &str)> {
    let mut found = Vec::new();
    for (index, line) in text.lines().enumerate() {
        let quoted = line.split('`').skip(1).step_by(2);
        let is_path = |quoted: &&str| {
            let first = quoted.split_once('/').map(|(first, _)| first);
            first.is_some_and(|first| FOLDERS.contains(&first)) && !quoted.contains(char::is_whitespace)
        };
        found.extend(quoted.filter(is_path).map(|path| (index + 1, path)));
    }
    found
}

/// Whether `path` is there; a `*` at its end stands for any end of a name.
fn exists(root: &Path, path: &str) -> bool {
    let Some(start) = path.strip_suffix('*') else { return root.join(path).exists() };
    let start = root.join(start);
    let name = start.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let mut entries = start.parent().and_then(|folder| fs::read_dir(folder).ok()).into_iter().flatten();
    entries.any(|entry| entry.is_ok_and(|entry| entry.file_name().to_string_lossy().starts_with(&name)))
}

/// Pages about the repository as a whole, and all of the book.
fn pages(root: &Path) -> Vec<PathBuf> {
    let pages = ["ARCHITECTURE.md", "CONTRIBUTING.md", "README.md"].map(|page| root.join(page));
    pages.into_iter().chain(files_with(&["md"], &root.join("docs"))).collect()
}

#[test]
fn paths_in_pages_exist() {
    let root = root();
    let (mut missing, mut count) = (Vec::new(), 0);
    for page in pages(&root) {
        let text = fs::read_to_string(&page).unwrap();
        for (line, path) in paths_in(&text) {
            count += 1;
            if !exists(&root, path) {
                missing.push(format!("{}:{line}: {path}", page.display()));
            }
        }
    }
    assert!(count > 50, "only {count} paths were found");
    assert!(missing.is_empty(), "{}", missing.join("\n"));
}

#[test]
fn sources_and_pages_name_no_file_outside_the_repository() {
    let (root, outside) = (root(), ["shared", "/"].concat());
    let files = files_with(&["rs", "md", "ron", "html", "py", "toml"], &root);
    assert!(files.len() > 300, "only {} files were read", files.len());
    let named = files.iter().filter(|file| fs::read_to_string(file).unwrap().contains(&outside));
    let named: Vec<_> = named.collect();
    assert!(named.is_empty(), "{named:?}");
}

#[test]
fn paths_are_found_in_back_ticks_and_missing_ones_are_noticed() {
    let text = "see `docs/formats.md`, docs/no.md\nand `cargo run -p sim`, `plots/a.svg`, `tests/e2e/re*`";
    assert_eq!(paths_in(text), [(1, "docs/formats.md"), (2, "tests/e2e/re*")]);
    let root = root();
    assert!(exists(&root, "docs/formats.md") && exists(&root, "tests/e2e/re*"));
    assert!(!exists(&root, "docs/no.md") && !exists(&root, "tests/e2e/no*") && !exists(&root, "no/e2e*"));
}
