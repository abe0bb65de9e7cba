//! `quintile reproduce` as a user meets it: fields, files, exit codes, and the same bytes for any number of threads.

use std::fs;
use std::path::Path;

use serde_json::Value;
use tempfile::TempDir;
use tests::{Ended, quintile};

const FIELDS: [&str; 6] = ["id", "kind", "paper", "ours", "verdict", "figure"];

fn reproduce(paper: &str, out: &Path, args: &[&str]) -> (Ended, Value) {
    let out = out.display().to_string();
    let ended = quintile!().call(["reproduce", paper, "--quick", "--json", "--out", &out].iter().chain(args));
    let json =
        serde_json::from_str(&ended.stdout).unwrap_or_else(|error| panic!("{error}: {}", ended.stderr));
    (ended, json)
}

fn row<'a>(json: &'a Value, id: &str) -> &'a Value {
    let rows = json["rows"].as_array().expect("a list");
    rows.iter().find(|row| row["id"] == id).unwrap_or_else(|| panic!("no row {id}"))
}

fn number(row: &Value, name: &str) -> f64 {
    let numbers = row["numbers"].as_array().expect("a list");
    let found = numbers.iter().find(|number| number["name"] == name);
    found.and_then(|number| number["value"].as_f64()).unwrap_or_else(|| panic!("no number {name} in {row}"))
}

/// Every file below a folder, in order.
fn files(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let mut list = Vec::new();
    for sub in ["", "plots"] {
        for entry in
            fs::read_dir(folder.join(sub)).expect("a folder").flatten().filter(|e| e.path().is_file())
        {
            let name = format!("{sub}/{}", entry.file_name().to_string_lossy());
            list.push((name, fs::read(entry.path()).expect("a file")));
        }
    }
    list.sort();
    list
}

fn rows_are_whole(json: &Value, ids: &[&str], folder: &Path) {
    let rows = json["rows"].as_array().expect("a list");
    assert_eq!(rows.iter().map(|row| row["id"].as_str().unwrap_or_default()).collect::<Vec<_>>(), ids);
    for row in rows {
        for field in FIELDS {
            assert!(row.get(field).is_some(), "{field} is missing in {row}");
        }
        let verdict = row["verdict"].as_str().unwrap_or_default();
        assert!(["holds", "differs", "not yet"].contains(&verdict), "{verdict}");
        assert!(!row["ours"].as_str().unwrap_or_default().is_empty());
        assert!(
            row["numbers"].as_array().is_some_and(|list| list.iter().all(|n| n["value"].is_f64())),
            "{row}"
        );
        for figure in row["figures"].as_array().expect("a list") {
            let path = folder.join(figure.as_str().expect("a path"));
            let svg = fs::read_to_string(&path).expect("an SVG");
            assert!(svg.contains("<svg") && !svg.contains("nothing to show"), "{}", path.display());
            assert!(fs::read(path.with_extension("png")).expect("a PNG").starts_with(b"\x89PNG"));
        }
    }
}

#[test]
fn paper_three_is_whole_and_the_same_for_any_number_of_threads() {
    let temporary = TempDir::new().expect("a folder");
    let folders = ["1", "4"].map(|threads| (threads, temporary.path().join(threads)));
    let runs = folders.each_ref().map(|(threads, out)| reproduce("III", out, &["--threads", threads]));
    let ids = ["III-1", "III-2", "III-3", "III-4", "III-5", "III-6"];
    let (ended, json) = &runs[0];
    rows_are_whole(json, &ids, &folders[0].1);
    assert_eq!(ended.stdout, runs[1].0.stdout);
    assert_eq!(files(&folders[0].1), files(&folders[1].1));
    let written = fs::read_to_string(folders[0].1.join("reproduce_III.json")).expect("the JSON");
    assert_eq!(written.trim(), ended.stdout.trim());
    // The exit code says whether the one equality holds.
    assert_eq!(row(json, "III-2")["kind"], "E");
    assert_eq!(ended.code == Some(0), row(json, "III-2")["verdict"] == "holds");
    verdicts_follow_from_numbers(json);
}

/// A verdict is no opinion.
fn verdicts_follow_from_numbers(json: &Value) {
    let holds = |id: &str| row(json, id)["verdict"] == "holds";
    let sums = row(json, "III-2");
    let whole = number(sums, "whole_J");
    assert!(
        (number(sums, "start_to_start_J") / whole - 1.0).abs() < 1e-9
            && number(sums, "begin_to_finish_J") < whole
    );
    let launch = row(json, "III-3");
    let near = |name: &str| (number(launch, name) - 48.0).abs() <= 2.0;
    assert_eq!(holds("III-3"), near("fewest_frames") && near("most_frames"));
    let methods = row(json, "III-4");
    assert_eq!(
        holds("III-4"),
        number(methods, "frames_higher") > 0.0 && number(methods, "frames_lower") > 0.0
    );
    assert!(number(methods, "longest_work_ms") < 1e3 / 30.0, "the phone does not keep up: {methods}");
    let pc = row(json, "III-5");
    let difference = (number(pc, "with_mean_J") - number(pc, "without_mean_J")).abs();
    let least = number(pc, "with_pooled_deviation_J").min(number(pc, "without_pooled_deviation_J"));
    assert_eq!(holds("III-5"), difference < least);
    let hits = row(json, "III-6");
    let [touched, flagged, both] =
        ["touched", "flagged", "both"].map(|kind| number(hits, &format!("{kind}_frames")));
    assert!(touched > 0.0 && (!holds("III-6") || (touched == both && flagged == both)));
}

#[test]
fn paper_two_waits_for_its_passes_and_says_so() {
    let temporary = TempDir::new().expect("a folder");
    let out = temporary.path().join("out");
    fs::create_dir_all(out.join("plots")).expect("a folder");
    fs::write(out.join("plots/II_fig9.svg"), "stale").expect("a file");
    let (ended, json) = reproduce("ii", &out, &[]);
    rows_are_whole(&json, &["II-1", "II-2"], &out);
    assert!(!out.join("plots/II_fig9.svg").exists());
    let passes = row(&json, "II-1");
    assert_eq!(passes["verdict"], "not yet");
    assert!(passes["note"].as_str().is_some_and(|note| note.contains("deferred renderer")));
    let sum = number(passes, "pass_nJ_per_pixel") + number(passes, "rest_nJ_per_pixel");
    assert!((sum / number(passes, "frame_nJ_per_pixel") - 1.0).abs() < 1e-9);
    let inverses = row(&json, "II-2");
    assert_eq!(inverses["verdict"], "holds");
    assert!(inverses["ours"].as_str().is_some_and(|ours| ours.contains("WRONG")));
    let [wrong, right, whole] = ["mean_of_inverses", "inverse_of_mean", "whole_animation"]
        .map(|name| number(inverses, &format!("{name}_pixels_per_J")));
    assert!(wrong > right && (right / whole - 1.0).abs() < 1e-9);
    assert_eq!((ended.code, json["equalities_hold"].as_bool()), (Some(1), Some(false)));
    assert!(ended.stderr.contains("II-1") && !ended.stderr.contains("II-2"), "{}", ended.stderr);
}

#[test]
fn what_makes_no_sense_is_told_before_any_work() {
    let unknown = quintile!().call(["reproduce", "VII"]);
    assert_eq!(unknown.code, Some(2));
    assert!(unknown.stderr.contains("VII") && unknown.stderr.contains("II, III"), "{}", unknown.stderr);
    assert_eq!(quintile!().call(["reproduce"]).code, Some(2));
    let temporary = TempDir::new().expect("a folder");
    let file = temporary.path().join("file");
    fs::write(&file, "not a folder").expect("a file");
    let blocked = quintile!().call(["reproduce", "II", "--quick", "--out", &file.display().to_string()]);
    assert_eq!(blocked.code, Some(1));
    assert!(blocked.stderr.contains("cannot use it as the folder for results"), "{}", blocked.stderr);
    let help = quintile!().call(["help", "reproduce"]);
    assert!(help.stdout.contains("quintile reproduce III --quick --out claims"), "{}", help.stdout);
}
