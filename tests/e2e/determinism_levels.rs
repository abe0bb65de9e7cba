//! Determinism: equal bytes at every timing level, for any number of threads and any set of outputs. Counters do
//! not depend on timing level or energy table.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use crate::support::{Results, quintile, without_host};
use serde_json::Value;

/// Twelve frames, of which `sampled` simulates six.
const SMALL: [&str; 6] = ["--size", "96x54", "--samples", "2", "--frames", "0..12"];

fn run(level: &str, args: &[&str]) -> Results {
    quintile().run("default", &[&SMALL[..], &["--timing", level], args].concat())
}

/// Files of a run.
type Files = BTreeMap<PathBuf, Vec<u8>>;

/// Runs at every level without further arguments, which several tests compare with.
static PLAIN: [(&str, LazyLock<Files>); 4] = [
    ("stepped", LazyLock::new(|| run("stepped", &[]).files())),
    ("packet", LazyLock::new(|| run("packet", &[]).files())),
    ("bound", LazyLock::new(|| run("bound", &[]).files())),
    ("sampled", LazyLock::new(|| run("sampled", &[]).files())),
];

/// Levels, and the files of their plain runs.
fn plain() -> impl Iterator<Item = (&'static str, &'static Files)> {
    PLAIN.iter().map(|(level, files)| (*level, &**files))
}

fn summary(files: &Files) -> Value {
    serde_json::from_slice(&files[Path::new("summary.json")]).expect("summary.json is JSON")
}

fn assert_same(one: &Files, other: &Files, what: &str) {
    let (one, other) = (without_host(one.clone()), without_host(other.clone()));
    assert!(one.len() > 10, "{what}: too few files to compare");
    assert_eq!(one.keys().collect::<Vec<_>>(), other.keys().collect::<Vec<_>>(), "{what}: other files");
    for (name, bytes) in &one {
        assert!(bytes == &other[name], "{what}: {} differs", name.display());
    }
}

fn frames(summary: &Value) -> Vec<Value> {
    summary["frames"].as_array().cloned().expect("frames")
}

#[test]
fn any_number_of_threads_gives_the_same_bytes_at_every_level() {
    for (level, files) in plain() {
        for threads in ["1", "16"] {
            let other = run(level, &["--threads", threads]).files();
            assert_same(files, &other, &format!("{level}, {threads} threads"));
        }
    }
}

/// Without a budget, the choice of a probe does not depend on measured times.
#[test]
fn a_choice_by_accuracy_does_not_depend_on_threads() {
    let choose = |threads: &str| {
        let args = ["--accuracy", "5%", "--verify", "--threads", threads];
        quintile().run("default", &[&SMALL[..], &args].concat()).files()
    };
    assert_same(&choose("1"), &choose("16"), "--accuracy with 16 threads");
}

/// Additional files change no other file, except for those that list them: request, report and manifest.
#[test]
fn additional_outputs_leave_the_others_unchanged() {
    for (level, files) in plain() {
        let compared = |files: &Files| {
            let mut summary = summary(files);
            let mut files = without_host(files.clone());
            ["request", "host"].iter().for_each(|key| drop(summary[key].take()));
            files.insert("summary.json".into(), summary.to_string().into_bytes());
            files.retain(|name, _| !name.ends_with("report.html") && !name.ends_with("manifest.json"));
            files
        };
        let plain = compared(files);
        let more = compared(&run(level, &["--exr", "--heat", "samples_tested", "--json"]).files());
        assert!(more.len() > plain.len());
        for (name, bytes) in &plain {
            assert!(bytes == &more[name], "{level}: {} differs", name.display());
        }
    }
}

/// Power follows from time: another energy table changes neither cycles nor counters nor images.
#[test]
fn energy_tables_do_not_change_timing() {
    for (level, nominal) in plain().filter(|(level, _)| *level != "sampled") {
        let high = run(level, &["--bound", "high"]).files();
        let of = |summary: &Value| {
            let cycles: Vec<Value> = frames(summary).iter().map(|row| row["cycles"].clone()).collect();
            (cycles, summary["counts"].clone(), summary["counts_hash"].clone())
        };
        let [one, other] = [nominal, &high].map(summary);
        assert_eq!(of(&one), of(&other), "{level}");
        assert_ne!(one["energy_by_part_j"], other["energy_by_part_j"], "{level}: nothing was changed");
        let image = Path::new("images/frame_0003.png");
        assert!(nominal[image] == high[image], "{level}");
    }
}

/// Events do not depend on timing.
#[test]
fn counters_and_their_hash_agree_at_all_levels() {
    let [stepped, packet, bound, sampled] = PLAIN.each_ref().map(|(_, files)| summary(files));
    let of = |summary: &Value| (summary["counts"].clone(), summary["counts_hash"].clone());
    assert_eq!(of(&stepped), of(&packet));
    assert_eq!(of(&packet), of(&bound));
    let hash = |row: &Value| row["counts_hash"].as_str().map(str::to_owned);
    let whole: Vec<_> = frames(&packet).iter().map(hash).collect();
    assert!(whole.iter().all(Option::is_some));
    assert_ne!(whole[0], whole[6], "frames that differ have equal hashes");
    // Simulated frames of `sampled` equal those of `packet` in all counters and cycles; predicted ones have
    // no counters.
    let pairs = frames(&sampled);
    let known: Vec<_> =
        pairs.iter().zip(frames(&packet)).filter(|(row, _)| row["predicted"] == false).collect();
    assert_eq!(known.len(), 6);
    for (row, other) in known {
        assert_eq!(row["counts_hash"], other["counts_hash"]);
        assert_eq!(row["cycles"], other["cycles"]);
    }
    assert!(pairs.iter().all(|row| hash(row).is_some() == (row["predicted"] == false)));
}

/// Control: another seed gives other samples, and so other counters.
#[test]
fn another_seed_has_another_hash() {
    let other = run("bound", &["--seed", "2"]).summary();
    assert_ne!(summary(&PLAIN[2].1)["counts_hash"], other["counts_hash"]);
}
