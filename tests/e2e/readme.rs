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
fn there_is_a_licence() {
    let names = ["LICENSE", "LICENSE-MIT", "LICENSE-APACHE", "LICENCE"];
    let found = names.iter().any(|name| root().join(name).metadata().is_ok_and(|file| file.len() > 500));
    assert!(found, "no licence file");
}
