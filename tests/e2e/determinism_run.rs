//! Determinism: equal bytes when run twice, and with any number of threads.

use crate::support::{Results, quintile, without_host};

fn assert_same(one: &Results, other: &Results, what: &str) {
    let (one, other) = (without_host(one.files()), without_host(other.files()));
    let names =
        |files: &std::collections::BTreeMap<_, _>| files.keys().cloned().collect::<Vec<std::path::PathBuf>>();
    assert_eq!(names(&one), names(&other), "{what}: other files");
    for (name, bytes) in &one {
        assert!(bytes == &other[name], "{what}: {} differs", name.display());
    }
}

fn same_for_any_number_of_threads(scene: &str, args: &[&str]) {
    let run = |threads: &[&str]| quintile().run(scene, &[args, threads].concat());
    let first = run(&[]);
    assert!(first.files().len() >= 15, "too few files to compare: {:?}", first.files().keys());
    assert_same(&first, &run(&[]), "a second run");
    for threads in ["1", "2", "16"] {
        assert_same(&first, &run(&["--threads", threads]), &format!("{threads} threads"));
    }
}

#[test]
fn tiny() {
    same_for_any_number_of_threads("tiny", &["--exr"]);
}

#[test]
fn the_default_scene() {
    same_for_any_number_of_threads("default", &["--size", "192x108", "--frames", "4..7", "--exr"]);
}

/// One frame alone is split among threads as well.
#[test]
fn one_frame_free_running() {
    let args = ["--size", "320x180", "--frames", "0..1", "--pacing", "free", "--exr", "--samples", "3"];
    let files = 14;
    let first = quintile().run("default", &args);
    assert!(first.files().len() >= files);
    for threads in ["1", "2", "16"] {
        let other = quintile().run("default", &[&args[..], &["--threads", threads]].concat());
        assert_same(&first, &other, &format!("{threads} threads"));
    }
}

#[test]
#[cfg_attr(not(real_scenes), ignore = "QUINTILE_SCENES is not set")]
fn a_real_animated_scene() {
    let fox = crate::support::real_scene("Fox.glb");
    same_for_any_number_of_threads(&fox, &["--size", "128x96", "--frames", "0..4", "--lens", "4"]);
}

/// Control: another seed gives other samples and other noise.
#[test]
fn another_seed_gives_another_run() {
    let run = |seed: &str| quintile().run("tiny", &["--seed", seed]);
    let (one, other) = (run("1"), run("2"));
    assert_ne!(one.bytes("images/frame_0000.png"), other.bytes("images/frame_0000.png"));
    assert_ne!(one.bytes("trace.parquet"), other.bytes("trace.parquet"));
}
