//! README and book: the two commands, a picture, and links that resolve.

use std::fs;
use std::path::Path;

use crate::support::root;

/// Commands that both `.ci/run` and the README contain.
const COMMANDS: [&str; 2] = ["cargo run --release -- run", "cargo test --workspace --release"];

fn text(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Targets of Markdown links and images, and of `src` and `href` in HTML, outside of code.
fn targets(markdown: &str) -> Vec<String> {
    let mut plain = String::new();
    for (place, part) in markdown.split("```").enumerate() {
        if place % 2 == 0 {
            let outside = part.split('`').step_by(2);
            outside.for_each(|part| plain.push_str(part));
        }
    }
    let until = |text: &str, ends: &[char]| text.split(ends).next().unwrap_or_default().to_owned();
    let links = plain.split("](").skip(1).map(|rest| until(rest, &[')', ' ']));
    let html = ["src=\"", "href=\""]
        .into_iter()
        .flat_map(|key| plain.split(key).skip(1))
        .map(|rest| until(rest, &['"']));
    links.chain(html).collect()
}

fn is_relative(target: &str) -> bool {
    !target.contains("://") && !target.starts_with("mailto:") && !target.starts_with('#')
}

/// Asserts that every relative link of the file leads to something in the repository.
fn assert_links_resolve(file: &Path) {
    let folder = file.parent().expect("a file is in a folder");
    for target in targets(&text(file)).into_iter().filter(|target| is_relative(target)) {
        let path = folder.join(target.split('#').next().unwrap_or_default());
        assert!(path.exists(), "{}: {target} leads nowhere", file.display());
    }
}

#[test]
fn both_commands_are_as_in_ci() {
    let readme = text(&root().join("README.md"));
    let ci = text(&root().join(".ci/run"));
    for command in COMMANDS {
        assert!(readme.lines().any(|line| line.trim() == command), "no line `{command}` in README.md");
    }
    assert!(ci.lines().any(|line| line.trim() == COMMANDS[1]), "CI does not run what the README says");
}

#[test]
fn there_is_a_picture_and_it_decodes() {
    let readme = root().join("README.md");
    let pictures: Vec<String> = targets(&text(&readme))
        .into_iter()
        .filter(|target| is_relative(target) && [".png", ".jpg"].iter().any(|end| target.ends_with(end)))
        .collect();
    assert!(!pictures.is_empty(), "README.md shows no picture");
    for name in pictures {
        let picture = image::open(root().join(&name)).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert!(picture.width() >= 200, "{name} is too small");
    }
}

#[test]
fn links_resolve() {
    assert_links_resolve(&root().join("README.md"));
    let book = root().join("docs");
    assert_links_resolve(&book.join("SUMMARY.md"));
    for chapter in targets(&text(&book.join("SUMMARY.md"))).into_iter().filter(|target| is_relative(target)) {
        assert_links_resolve(&book.join(chapter));
    }
}

#[test]
fn every_trace_format_is_in_the_book() {
    for page in ["docs/guide/traces.md", "docs/formats.md"] {
        let page_text = text(&root().join(page));
        for format in &traces::io::FORMATS {
            assert!(page_text.contains(&format!("`.{}`", format.ending)), "{page}: no `.{}`", format.ending);
        }
    }
}

/// Files and folders in back quotes of `ARCHITECTURE.md` and `CONTRIBUTING.md` that begin with a folder of
/// the repository.
#[test]
fn quoted_paths_exist() {
    for page in ["ARCHITECTURE.md", "CONTRIBUTING.md"] {
        let plain: String = text(&root().join(page)).split("```").step_by(2).collect();
        let quoted = plain.split('`').skip(1).step_by(2).filter(|quoted| !quoted.contains([' ', '*', '\n']));
        let paths: Vec<&str> = quoted
            .filter(|quoted| quoted.split_once('/').is_some_and(|(first, _)| root().join(first).is_dir()))
            .collect();
        assert!(paths.len() > 10, "{page}: {paths:?}");
        for path in paths {
            assert!(root().join(path).exists() || is_module(path), "{page}: `{path}` does not exist");
        }
    }
}

/// Whether a path without an ending is that of a module of Rust.
fn is_module(path: &str) -> bool {
    root().join(format!("{path}.rs")).exists()
}

/// Names of modules and of functions below `folder`.
fn names(folder: &Path, into: &mut Vec<String>) {
    for entry in fs::read_dir(folder).expect("a folder of tests").map(|entry| entry.expect("an entry").path())
    {
        into.extend(entry.file_stem().map(|stem| stem.to_string_lossy().into_owned()));
        if entry.is_dir() {
            names(&entry, into);
        } else if entry.extension().is_some_and(|ending| ending == "rs") {
            let functions = text(&entry);
            let named = functions.split("fn ").skip(1).filter_map(|rest| rest.split('(').next());
            into.extend(named.map(str::to_owned));
        }
    }
}

/// Pages of the book, with `CONTRIBUTING.md`.
fn pages(folder: &Path) -> Vec<std::path::PathBuf> {
    let entries =
        fs::read_dir(folder).expect("a folder of pages").map(|entry| entry.expect("an entry").path());
    let (folders, files): (Vec<_>, Vec<_>) = entries.partition(|entry| entry.is_dir());
    let markdown = files.into_iter().filter(|file| file.extension().is_some_and(|ending| ending == "md"));
    markdown.chain(folders.iter().flat_map(|folder| pages(folder))).collect()
}

#[test]
fn filters_of_tests_in_the_book_match_a_test() {
    let mut known = Vec::new();
    for folder in ["pipeline", "workloads", "traces", "power-model", "sim", "sim/timing"] {
        names(&root().join(folder).join("tests/suite"), &mut known);
    }
    names(&root().join("tests/e2e"), &mut known);
    let mut checked = 0;
    for page in pages(&root().join("docs")).into_iter().chain([root().join("CONTRIBUTING.md")]) {
        let text = text(&page);
        for rest in ["--test suite ", "--test e2e "].iter().flat_map(|key| text.split(key).skip(1)) {
            let end =
                rest.find(|c: char| !(c.is_ascii_lowercase() || c.is_ascii_digit() || "_:".contains(c)));
            for filter in rest[..end.unwrap_or(rest.len())].split("::").filter(|filter| !filter.is_empty()) {
                assert!(known.iter().any(|name| name.contains(filter)), "{}: {filter}", page.display());
                checked += 1;
            }
        }
    }
    assert!(checked > 5, "only {checked} filters were found");
}

/// The command that makes a picture of the book.
fn command_of(picture: &str) -> String {
    let is_of = |chart: &&experiments::study::StudyEntry| picture.starts_with(&chart.name.replace('-', "_"));
    match experiments::CHARTS.iter().find(is_of) {
        Some(chart) => format!("quintile chart {}", chart.name),
        None if picture.starts_with("stress_") => "quintile stress".to_owned(),
        None => "quintile run".to_owned(),
    }
}

#[test]
fn pictures_of_the_book_have_their_command_in_their_section() {
    let mut checked = 0;
    for page in pages(&root().join("docs")) {
        for section in text(&page).split("\n## ") {
            for picture in section.split("images/").skip(1).filter_map(|rest| rest.split_once(".png)")) {
                let command = command_of(picture.0);
                assert!(section.contains(&command), "{}: {}: no `{command}`", page.display(), picture.0);
                checked += 1;
            }
        }
    }
    assert!(checked > 30, "only {checked} pictures were found");
}

#[test]
fn there_is_a_licence() {
    let names = ["LICENSE", "LICENSE-MIT", "LICENSE-APACHE", "LICENCE"];
    let found = names.iter().any(|name| root().join(name).metadata().is_ok_and(|file| file.len() > 500));
    assert!(found, "no licence file");
}
