//! Failure modes of the folder of results: nothing half-written ever looks whole.

#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::Path;

use sim::output::{OutDir, OutputError};

fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

#[test]
fn a_new_run_takes_away_the_mark_of_the_old_one() {
    let temp = tempfile::tempdir().unwrap();
    let path = temp.path().join("a/b/out");
    OutDir::create(&path).unwrap().complete(|out| Ok(out.write_all(b"{}")?)).unwrap();
    assert_eq!(names(&path), ["summary.json"]);
    OutDir::create(&path).unwrap();
    assert!(names(&path).is_empty());
}

#[test]
fn a_failed_write_leaves_nothing_and_keeps_the_old_file() {
    let temp = tempfile::tempdir().unwrap();
    let dir = OutDir::create(temp.path()).unwrap();
    dir.write_atomic("images/a.png", |out| Ok(out.write_all(b"old")?)).unwrap();
    let error = dir.write_atomic("images/a.png", |out| {
        out.write_all(b"half")?;
        Err("the encoder gave up".into())
    });
    let text = error.unwrap_err().to_string();
    assert!(text.contains("images/a.png") && text.contains("the encoder gave up"), "{text}");
    assert_eq!(fs::read(temp.path().join("images/a.png")).unwrap(), b"old");
    assert_eq!(names(&temp.path().join("images")), ["a.png"]);
}

#[test]
fn a_panic_on_the_way_leaves_nothing() {
    let temp = tempfile::tempdir().unwrap();
    let dir = OutDir::create(temp.path()).unwrap();
    let result = std::panic::catch_unwind(|| {
        let _ = dir.write_atomic("a.csv", |out| {
            out.write_all(b"half")?;
            panic!("on purpose")
        });
    });
    assert!(result.is_err());
    assert!(names(temp.path()).is_empty());
}

#[test]
fn a_folder_that_cannot_be_made_is_named_with_a_mend() {
    let temp = tempfile::tempdir().unwrap();
    let file = temp.path().join("file");
    fs::write(&file, "").unwrap();
    for path in [file.clone(), file.join("below")] {
        let error = OutDir::create(&path).unwrap_err();
        let text = error.to_string();
        assert!(matches!(error, OutputError::Folder { .. }), "{text}");
        assert!(text.contains(&path.display().to_string()) && text.contains("--out"), "{text}");
    }
}

#[test]
fn a_summary_that_cannot_be_removed_is_an_error() {
    let temp = tempfile::tempdir().unwrap();
    fs::create_dir_all(temp.path().join("summary.json")).unwrap();
    let error = OutDir::create(temp.path()).unwrap_err();
    assert!(matches!(error, OutputError::Stale { .. }), "{error}");
}

#[test]
fn a_target_that_is_a_folder_is_an_error_and_leaves_no_temporary() {
    let temp = tempfile::tempdir().unwrap();
    let dir = OutDir::create(temp.path()).unwrap();
    fs::create_dir_all(temp.path().join("trace.csv/x")).unwrap();
    assert!(dir.write_atomic("trace.csv", |out| Ok(out.write_all(b"a")?)).is_err());
    assert_eq!(names(temp.path()), ["trace.csv"]);
}

#[test]
fn paths_do_not_lead_out() {
    let temp = tempfile::tempdir().unwrap();
    let dir = OutDir::create(temp.path()).unwrap();
    for path in ["", "../x", "/etc/x", "a/../../x"] {
        let error = dir.write_atomic(path, |_| Ok(())).unwrap_err();
        assert!(matches!(error, OutputError::Path { .. }), "{path}: {error}");
    }
}

#[test]
fn only_stale_files_of_the_kind_asked_for_go() {
    let temp = tempfile::tempdir().unwrap();
    let dir = OutDir::create(temp.path()).unwrap();
    dir.remove_stale("images", "frame_", &["png"]).unwrap();
    for name in ["images/frame_0.png", "images/frame_0.txt", "images/mine.png"] {
        dir.write_atomic(name, |_| Ok(())).unwrap();
    }
    dir.remove_stale("images", "frame_", &["png", "exr"]).unwrap();
    assert_eq!(names(&temp.path().join("images")), ["frame_0.txt", "mine.png"]);
}

#[test]
fn temporaries_of_a_run_that_was_killed_go_and_those_of_a_living_one_stay() {
    let root = tempfile::tempdir().unwrap();
    let living = format!(".trace.csv.{}.tmp", std::process::id());
    // No process has this number: Linux ends at 2^22.
    for name in [".trace.csv.4999999.tmp", living.as_str(), "mine.tmp", ".hidden"] {
        fs::write(root.path().join(name), "x").unwrap();
    }
    OutDir::create(root.path()).unwrap();
    let left = |name: &str| root.path().join(name).exists();
    assert!(left(&living) && left("mine.tmp") && left(".hidden"));
    assert_eq!(left(".trace.csv.4999999.tmp"), !Path::new("/proc/self").exists());
}

#[test]
fn stale_files_of_the_root_go_by_name() {
    let root = tempfile::tempdir().unwrap();
    for name in ["report.html", "reports.html", "frames.csv"] {
        fs::write(root.path().join(name), "x").unwrap();
    }
    OutDir::create(root.path()).unwrap().remove_stale("", "report.", &["html"]).unwrap();
    let left = |name: &str| root.path().join(name).exists();
    assert!(!left("report.html") && left("reports.html") && left("frames.csv"));
}
