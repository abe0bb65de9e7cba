//! Failed runs leave no partial results, and the results of the previous run stay complete.

use std::fs;
use std::path::Path;

use crate::support::{Inputs, Refusals, quintile};

/// A file has the name of the folder, because permissions do not stop tests that run as root.
#[test]
fn results_that_cannot_be_written() {
    let mut refusals = Refusals::default();
    let inputs = Inputs::new();
    let file = inputs.put("taken", "not a folder");
    for out in [file.clone(), inputs.path("taken/below")] {
        let ended = quintile().call(["run", "tiny", "--out", &out]);
        refusals.check(
            &ended,
            2,
            &[&out, "cannot use it as the folder for results"],
            "name another with --out",
        );
    }
    assert_eq!(fs::read_to_string(&file).ok().as_deref(), Some("not a folder"));
    refusals.done();
}

/// Files that cannot be overwritten are reported before the work, and the previous results stay unchanged.
#[test]
fn unwritable_files_leave_previous_results_unchanged() {
    let mut refusals = Refusals::default();
    for (name, is_folder) in [
        ("images", false),
        ("plots", false),
        ("trace.parquet", true),
        ("frames.csv", true),
        ("report.html", true),
        ("manifest.json", true),
    ] {
        let inputs = Inputs::new();
        let out = inputs.path("out");
        let results = quintile().run_in(Path::new(&out), "tiny", &[]);
        block(&results.path(name), is_folder);
        let before = results.files();
        assert!(before.contains_key(Path::new("summary.json")));
        for force in [&[][..], &["--force"]] {
            let ended = quintile().call(["run", "tiny", "--out", &out].iter().chain(force));
            refusals.check(&ended, 2, &[&format!("out/{name}: "), "--out"], "move it away");
            assert!(before == results.files(), "{name}: something was changed");
        }
    }
    refusals.done();
}

/// Replaces `path` with something that a run cannot overwrite.
fn block(path: &Path, with_folder: bool) {
    if path.is_dir() {
        fs::remove_dir_all(path).expect("results can be removed");
    } else {
        fs::remove_file(path).expect("results can be removed");
    }
    if with_folder {
        fs::create_dir_all(path.join("taken")).expect("a folder can be made");
    } else {
        fs::write(path, "taken").expect("a file can be written");
    }
}

/// A usage error leaves the results of the previous run complete.
#[test]
fn a_usage_error_leaves_previous_results_unchanged() {
    let mut refusals = Refusals::default();
    let results = quintile().run("tiny", &[]);
    let out = results.folder().display().to_string();
    let before = results.files();
    let ended = quintile().call(["run", "tiny", "--samples", "0", "--out", &out]);
    refusals.check(&ended, 2, &["--samples"], "it has to be 1 to 256");
    assert!(before == results.files());
    refusals.done();
}

/// Runs that exceed memory are refused at once, without an abort. The limits are those of a small machine: 4
/// GB and 20 s.
#[cfg(target_os = "linux")]
#[test]
fn runs_that_exceed_memory() {
    let mut refusals = Refusals::default();
    let inputs = Inputs::new();
    let still =
        inputs.put("still.ron", "(settings: (width: 16, height: 16), objects: [(shape: Sphere(radius: 1))])");
    let cases: [(&[&str], &str, &str); 3] = [
        (&[&still, "--frames", "0..10000000"], "frames", "at most 100000, ask for fewer"),
        (&[&still, "--size", "16384x16384", "--samples", "256"], "size and samples", "ask for fewer"),
        (&["tiny", "--rate", "0.2", "--trace-rate", "1e7"], "the trace", "a lower --trace-rate"),
    ];
    for (args, says, remedy) in cases {
        let out = inputs.path("out");
        let program = env!("CARGO_BIN_EXE_quintile");
        let limited = ["-c", "ulimit -v 4000000; exec timeout 20 \"$0\" run \"$@\"", program];
        let ended =
            crate::support::Quintile::new("sh").call(limited.iter().chain(args).chain(&["--out", &out]));
        refusals.check(&ended, 2, &[says], remedy);
    }
    refusals.done();
}
