//! The folder of results: results appear together and whole, and what Quintile did not write stays.

use std::fs;
use std::path::Path;

use output::{Claim, Destination, OutDir, OutputError};

fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).unwrap();
    let mut names: Vec<String> =
        entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

fn claim() -> Claim {
    Claim::new("test").files(["a.csv", "b.csv", "images/1.png", "images/2.png", "summary.json"])
}

fn open(folder: &Path) -> Result<OutDir, OutputError> {
    Destination::new(folder).open([claim()])
}

/// Writes files whose content is `text`, and publishes them.
fn write(folder: &Path, files: &[&str], text: &str) -> Vec<String> {
    let mut dir = open(folder).unwrap();
    files.iter().for_each(|name| dir.write_file(name, |out| Ok(out.write_all(text.as_bytes())?)).unwrap());
    dir.publish().unwrap()
}

fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap()
}

#[test]
fn results_appear_together_and_replace_older_ones() {
    let temp = tempfile::tempdir().unwrap();
    let path = temp.path().join("a/b/out");
    let mut dir = open(&path).unwrap();
    dir.write_file("images/1.png", |out| Ok(out.write_all(b"old")?)).unwrap();
    assert_eq!(names(&path), [".quintile"]);
    dir.write_file("summary.json", |out| Ok(out.write_all(b"old")?)).unwrap();
    assert_eq!(dir.publish().unwrap(), ["images/1.png", "summary.json"]);
    drop(dir);
    assert_eq!(names(&path), ["images", "manifest.json", "summary.json"]);
    write(&path, &["a.csv", "summary.json"], "new");
    assert_eq!(names(&path), ["a.csv", "manifest.json", "summary.json"]);
    assert_eq!(read(&path.join("summary.json")), "new");
}

#[test]
fn without_publishing_nothing_changes() {
    let temp = tempfile::tempdir().unwrap();
    let path = temp.path().join("deep/out");
    let dir = open(&path).unwrap();
    dir.write_file("a.csv", |_| Ok(())).unwrap();
    drop(dir);
    assert_eq!(names(temp.path()), [""; 0], "folders that were made for nothing are left");
    write(&path, &["a.csv", "summary.json"], "old");
    let before = fs::read(path.join("manifest.json")).unwrap();
    let dir = open(&path).unwrap();
    dir.write_file("a.csv", |out| Ok(out.write_all(b"new")?)).unwrap();
    let error = dir.write_file("b.csv", |out| {
        out.write_all(b"half")?;
        Err("the encoder gave up".into())
    });
    let text = error.unwrap_err().to_string();
    assert!(text.contains("out/b.csv") && text.contains("the encoder gave up"), "{text}");
    let panicked = std::panic::catch_unwind(std::panic::AssertUnwindSafe(move || {
        let _ = dir.write_file("b.csv", |_| panic!("on purpose"));
    }));
    assert!(panicked.is_err());
    assert_eq!(names(&path), ["a.csv", "manifest.json", "summary.json"]);
    assert_eq!(read(&path.join("a.csv")), "old");
    assert_eq!(fs::read(path.join("manifest.json")).unwrap(), before);
}

#[test]
fn a_folder_that_cannot_be_made_is_named_with_what_to_do() {
    let temp = tempfile::tempdir().unwrap();
    let file = temp.path().join("file");
    fs::write(&file, "").unwrap();
    for path in [file.clone(), file.join("below")] {
        let error = open(&path).unwrap_err();
        let text = error.to_string();
        assert!(matches!(error, OutputError::Folder { .. }) && error.is_usage(), "{text}");
        assert!(text.contains(&path.display().to_string()) && text.contains("--out"), "{text}");
    }
    assert_eq!(names(temp.path()), ["file"]);
}

#[test]
fn files_of_others_stay_and_are_not_overwritten() {
    let temp = tempfile::tempdir().unwrap();
    let root = temp.path();
    fs::create_dir(root.join("images")).unwrap();
    fs::write(root.join("images/99.png"), "mine").unwrap();
    fs::write(root.join("notes.txt"), "mine").unwrap();
    write(root, &["images/1.png", "images/2.png"], "result");
    write(root, &["a.csv"], "result");
    assert_eq!(names(&root.join("images")), ["99.png"]);
    for (name, text) in [("b.csv", "mine"), ("a.csv", "result, with a note of mine")] {
        fs::write(root.join(name), text).unwrap();
        let error = open(root).unwrap_err();
        let says = error.to_string();
        assert!(error.is_usage() && says.contains(name) && says.contains("--force"), "{says}");
        assert_eq!(read(&root.join(name)), text);
        let mut forced = Destination { force: true, ..Destination::new(root) }.open([claim()]).unwrap();
        forced.write_file(name, |out| Ok(out.write_all(b"result")?)).unwrap();
        forced.publish().unwrap();
        assert_eq!(read(&root.join(name)), "result");
    }
    assert_eq!(
        (read(&root.join("notes.txt")), read(&root.join("images/99.png"))),
        ("mine".into(), "mine".into())
    );
}

/// A result that is not written again and was changed by the user is the user's.
#[test]
fn changed_results_are_not_removed() {
    let temp = tempfile::tempdir().unwrap();
    write(temp.path(), &["a.csv", "b.csv"], "result");
    let dir = open(temp.path()).unwrap();
    fs::write(temp.path().join("b.csv"), "changed meanwhile").unwrap();
    let mut dir = dir;
    dir.write_file("a.csv", |out| Ok(out.write_all(b"new")?)).unwrap();
    dir.publish().unwrap();
    assert_eq!(read(&temp.path().join("b.csv")), "changed meanwhile");
    assert_eq!(read(&temp.path().join("a.csv")), "new");
}

/// Even hours of work do not overwrite what the user put there in the meantime, and are not lost either.
#[test]
fn a_file_that_appears_meanwhile_makes_new_results_wait() {
    let temp = tempfile::tempdir().unwrap();
    let root = temp.path();
    write(root, &["summary.json"], "old");
    let mut dir = open(root).unwrap();
    ["b.csv", "summary.json"]
        .iter()
        .for_each(|name| dir.write_file(name, |out| Ok(out.write_all(b"new")?)).unwrap());
    fs::write(root.join("b.csv"), "mine").unwrap();
    assert!(matches!(dir.publish().unwrap_err(), OutputError::InTheWay { .. }));
    drop(dir);
    assert_eq!((read(&root.join("b.csv")), read(&root.join("summary.json"))), ("mine".into(), "old".into()));
    assert!(open(root).unwrap_err().to_string().contains("b.csv"));
    fs::rename(root.join("b.csv"), root.join("notes.csv")).unwrap();
    drop(open(root).unwrap());
    assert_eq!((read(&root.join("b.csv")), read(&root.join("summary.json"))), ("new".into(), "new".into()));
    assert_eq!(names(root), ["b.csv", "manifest.json", "notes.csv", "summary.json"]);
}

/// However far moving came before the process was killed, the next one finishes it.
#[test]
fn moving_that_was_killed_is_finished() {
    for moved in 0..=5 {
        let temp = tempfile::tempdir().unwrap();
        let root = temp.path();
        write(root, &["a.csv", "images/1.png", "summary.json"], "old");
        let other = temp.path().join("other");
        write(&other, &["a.csv", "b.csv", "summary.json"], "new");
        let work = root.join(".quintile");
        fs::create_dir_all(work.join("old/images")).unwrap();
        fs::create_dir_all(work.join("new")).unwrap();
        fs::rename(other.join("manifest.json"), work.join("manifest.json")).unwrap();
        for name in ["a.csv", "b.csv", "summary.json"] {
            fs::rename(other.join(name), work.join("new").join(name)).unwrap();
        }
        fs::remove_dir(&other).unwrap();
        let steps = [
            ("summary.json", ".quintile/old/summary.json"),
            ("images/1.png", ".quintile/old/images/1.png"),
            ("a.csv", ".quintile/old/a.csv"),
            ("manifest.json", ".quintile/old/manifest.json"),
            (".quintile/new/a.csv", "a.csv"),
        ];
        for (from, to) in &steps[..moved] {
            fs::rename(root.join(from), root.join(to)).unwrap();
        }
        drop(open(root).unwrap());
        assert!(!root.join(".quintile").exists() && !root.join("images/1.png").exists(), "{moved}");
        for name in ["a.csv", "b.csv", "summary.json"] {
            assert_eq!(read(&root.join(name)), "new", "{moved}: {name}");
        }
    }
}

#[test]
fn a_killed_process_leaves_nothing_that_blocks_or_stays() {
    let temp = tempfile::tempdir().unwrap();
    write(temp.path(), &["summary.json"], "old");
    fs::create_dir_all(temp.path().join(".quintile/new/images")).unwrap();
    fs::write(temp.path().join(".quintile/new/images/1.png"), "half").unwrap();
    fs::write(temp.path().join(".quintile/lock"), "4999999").unwrap();
    drop(open(temp.path()).unwrap());
    assert_eq!(names(temp.path()), ["manifest.json", "summary.json"]);
}

#[test]
fn two_at_once_are_refused_and_one_after_the_other_are_not() {
    let temp = tempfile::tempdir().unwrap();
    let first = open(temp.path()).unwrap();
    let error = open(temp.path()).unwrap_err();
    let says = error.to_string();
    assert!(matches!(error, OutputError::Busy { .. }) && error.is_usage(), "{says}");
    assert!(says.contains(&format!("process {}", std::process::id())) && says.contains("--out"), "{says}");
    #[cfg(target_os = "linux")]
    {
        let host = fs::read_to_string("/proc/sys/kernel/hostname").unwrap();
        assert!(says.contains(&format!(" on {})", host.trim())), "{says}");
    }
    first.write_file("a.csv", |_| Ok(())).unwrap();
    drop(first);
    drop(open(temp.path()).unwrap());
}

/// The result of another command is not an older result of this one.
#[test]
fn commands_keep_their_results_apart() {
    let temp = tempfile::tempdir().unwrap();
    write(temp.path(), &["a.csv", "summary.json"], "test");
    let other =
        |names: &[&str]| Destination::new(temp.path()).open([Claim::new("other").files(names.to_vec())]);
    let says = other(&["summary.json"]).unwrap_err().to_string();
    assert!(says.contains("`quintile test` wrote this file"), "{says}");
    let mut dir = other(&["c.csv"]).unwrap();
    dir.write_file("c.csv", |_| Ok(())).unwrap();
    dir.publish().unwrap();
    drop(dir);
    write(temp.path(), &["summary.json"], "again");
    assert_eq!(names(temp.path()), ["c.csv", "manifest.json", "summary.json"]);
}

#[test]
fn folders_and_files_in_the_place_of_results_are_refused() {
    let temp = tempfile::tempdir().unwrap();
    let force = || Destination { force: true, ..Destination::new(temp.path()) }.open([claim()]);
    fs::create_dir(temp.path().join("a.csv")).unwrap();
    let says = force().unwrap_err().to_string();
    assert!(says.contains("a.csv") && says.contains("it is a folder") && !says.contains("--force"), "{says}");
    fs::remove_dir(temp.path().join("a.csv")).unwrap();
    fs::write(temp.path().join("images"), "mine").unwrap();
    let says = force().unwrap_err().to_string();
    assert!(says.contains("images") && says.contains("it is not a folder"), "{says}");
    fs::remove_file(temp.path().join("images")).unwrap();
    fs::write(temp.path().join("manifest.json"), "{\"name\": \"my application\"}").unwrap();
    let says = open(temp.path()).unwrap_err().to_string();
    assert!(says.contains("manifest.json") && says.contains("--force"), "{says}");
    drop(force().unwrap());
    assert!(read(&temp.path().join("manifest.json")).contains("my application"));
}

#[cfg(unix)]
#[test]
fn links_to_folders_are_followed_and_links_to_files_are_not_written_through() {
    use std::os::unix::fs::symlink;
    let temp = tempfile::tempdir().unwrap();
    let [real, link, mine] = ["real", "link", "mine.csv"].map(|name| temp.path().join(name));
    fs::create_dir(&real).unwrap();
    symlink(&real, &link).unwrap();
    write(&link, &["a.csv"], "result");
    assert!(link.symlink_metadata().unwrap().is_symlink());
    assert_eq!(names(&real), ["a.csv", "manifest.json"]);
    fs::write(&mine, "mine").unwrap();
    symlink(&mine, real.join("b.csv")).unwrap();
    assert!(open(&link).unwrap_err().to_string().contains("b.csv"));
    let mut forced = Destination { force: true, ..Destination::new(&link) }.open([claim()]).unwrap();
    forced.write_file("b.csv", |out| Ok(out.write_all(b"result")?)).unwrap();
    forced.publish().unwrap();
    assert_eq!((read(&mine), read(&real.join("b.csv"))), ("mine".into(), "result".into()));
}

#[test]
fn only_claimed_names_are_written() {
    let temp = tempfile::tempdir().unwrap();
    let dir = open(temp.path()).unwrap();
    for path in ["", "../x", "/etc/x", "a/../../x", "c.csv", "images/../a.csv"] {
        let error = dir.write_file(path, |_| Ok(())).unwrap_err();
        assert!(matches!(error, OutputError::Unclaimed { .. }), "{path}: {error}");
    }
}
