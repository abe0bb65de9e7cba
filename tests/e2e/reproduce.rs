//! `quintile reproduce`: fields, files, exit codes, and the same bytes for any number of threads.

use std::fs;
use std::io::Write;
use std::path::Path;

use crate::support::{Ended, Inputs, quintile, real_scene, root};
use flate2::Compression;
use flate2::write::GzEncoder;
use serde_json::Value;
use sha2::{Digest, Sha256};
use tempfile::TempDir;

const FIELDS: [&str; 12] = [
    "id",
    "kind",
    "claim",
    "paper",
    "holds_when",
    "limits",
    "ours",
    "verdict",
    "band",
    "ran",
    "settings",
    "figure",
];

fn reproduce(paper: &str, out: &Path, args: &[&str]) -> (Ended, Value) {
    let out = out.display().to_string();
    let ended = quintile().call(["reproduce", paper, "--quick", "--json", "--out", &out].iter().chain(args));
    let json =
        serde_json::from_str(&ended.stdout).unwrap_or_else(|error| panic!("{error}: {}", ended.stderr));
    (ended, json)
}

/// The committed settings of a paper.
fn committed(number: u32) -> String {
    fs::read_to_string(root().join(format!("sim/experiments/papers/paper{number}.ron")))
        .expect("a file of settings")
}

fn sha256(text: &str) -> String {
    Sha256::digest(text).iter().map(|byte| format!("{byte:02x}")).collect()
}

/// One row of Paper VI or III, computed with the committed settings after `changes`, each of which has to
/// change something.
fn planted(id: &str, changes: &[(&str, &str)]) -> (Ended, Value) {
    let (paper, number) = if id.starts_with("VI") { ("VI", 6) } else { ("III", 3) };
    let text = changes.iter().fold(committed(number), |text, (from, to)| {
        assert!(text.contains(from), "`{from}` is not in the settings");
        text.replace(from, to)
    });
    let inputs = Inputs::new();
    let file = inputs.put("settings.ron", &text);
    let temporary = TempDir::new().expect("a folder");
    let (ended, json) = reproduce(paper, temporary.path(), &["--row", id, "--settings", &file]);
    assert_eq!(json["settings"]["committed"], changes.is_empty());
    assert_eq!(json["settings"]["sha256"], sha256(&text), "{id}");
    assert_eq!(json["rows"].as_array().map(Vec::len), Some(1));
    (ended, row(&json, id).clone())
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

fn rows_are_whole(json: &Value, (ids, number): (&[&str], u32), folder: &Path) {
    assert_eq!(json["settings"]["sha256"], sha256(&committed(number)));
    assert_eq!(json["settings"]["committed"], true);
    let rows = json["rows"].as_array().expect("a list");
    assert_eq!(rows.iter().map(|row| row["id"].as_str().unwrap_or_default()).collect::<Vec<_>>(), ids);
    for row in rows {
        for field in FIELDS {
            assert!(row.get(field).is_some(), "{field} is missing in {row}");
        }
        let verdict = row["verdict"].as_str().unwrap_or_default();
        assert!(["holds", "differs", "depends", "not yet"].contains(&verdict), "{verdict}");
        assert_eq!(row["settings_sha256"], json["settings"]["sha256"]);
        ran_something(row);
        verdict_follows_from_band(row);
        quick_verdict_says_so(row);
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

/// A verdict of the quick form is never a bare one: it says at how many of the settings of the full form it
/// was reached.
fn quick_verdict_says_so(row: &Value) {
    assert_eq!(row["form"], "quick");
    let [verdict, text] = ["verdict", "verdict_text"].map(|field| row[field].as_str().unwrap_or_default());
    let less = row["less_work"].as_array().expect("a list").is_empty();
    let less = if less { "quick form" } else { "quick form, less work" };
    let expected = match row["band"]["tried"].as_u64() {
        _ if verdict == "not yet" => verdict.to_owned(),
        Some(tried) => {
            let full = row["band"]["full"].as_u64().expect("a number");
            assert!(tried <= full, "{row}");
            format!("{verdict} at {tried} of {full} settings ({less})")
        }
        None => format!("{verdict} ({less})"),
    };
    assert_eq!(text, expected, "{row}");
}

/// A row reports how much was run; the amount is not zero. Those of Paper VI have what the modelled hardware drew.
fn ran_something(row: &Value) {
    let ran = row["ran"].as_array().expect("a list");
    let counts = ran.iter().map(|number| number["value"].as_f64().unwrap_or(0.0));
    assert!(!ran.is_empty() && counts.min_by(f64::total_cmp).is_some_and(|least| least > 0.0), "{row}");
    if row["id"].as_str().is_some_and(|id| id.starts_with("VI-")) {
        for name in ["passes", "draws", "fragments"] {
            assert!(ran.iter().any(|number| number["name"] == name), "{name} are missing in {row}");
        }
    }
}

/// Holds at every value tried, differs at all of them, or depends, with the least and the greatest number.
fn verdict_follows_from_band(row: &Value) {
    let Some(cases) = row["band"]["cases"].as_array() else {
        assert!(row["verdict"] != "depends", "without a band: {row}");
        return;
    };
    let held = cases.iter().filter(|case| case["holds"] == true).count();
    let expected = match held {
        0 => "differs",
        held if held == cases.len() => "holds",
        _ => "depends",
    };
    assert_eq!(row["verdict"], expected, "{row}");
    let numbers: Vec<f64> = cases.iter().filter_map(|case| case["number"].as_f64()).collect();
    assert_eq!(numbers.len(), cases.len());
    let ends = [f64::min, f64::max].map(|pick: fn(f64, f64) -> f64| numbers.iter().copied().reduce(pick));
    assert_eq!(ends, [row["band"]["min"].as_f64(), row["band"]["max"].as_f64()]);
    for case in cases {
        let number = case["number"].as_f64().expect("a number");
        condition_is_about_the_number(row["id"].as_str().unwrap_or_default(), number, case);
    }
}

/// The verdict of a condition follows from the number.
fn condition_is_about_the_number(id: &str, number: f64, case: &Value) {
    let holds = case["holds"] == true;
    let exactly = match id {
        "VI-1" | "VI-7" => Some(number == 0.0),
        "VI-5" => Some(number > 2.0),
        "VI-6" | "III-5" => Some(number < 1.0),
        "VI-8" if case["setting"] == "seed" => Some(number <= 3.0),
        "VI-10" => Some((0.01..=0.99).contains(&number)),
        "VI-13" => Some((number - 10.0).abs() <= 5.0),
        "VI-14" => Some((number - 15.0).abs() <= 7.0),
        "III-3" => Some(number <= 2.0),
        "III-4" => Some(number > 0.0 && number < 1.0),
        _ => None,
    };
    assert!(exactly.is_none_or(|expected| expected == holds), "{id}: {case}");
    // Of conditions in several parts the number is one of them.
    let collides = case["setting"].as_str().is_some_and(|setting| setting.contains("that collide"));
    let necessary = match id {
        "VI-2" => (number > 0.0) == collides,
        "VI-4" => number > 0.0,
        "VI-11" | "VI-15" => number < 1.0,
        "III-6" => number == 1.0,
        _ => true,
    };
    assert!(!holds || necessary, "{id}: {case}");
}

#[test]
fn paper_three_is_whole_and_the_same_for_any_number_of_threads() {
    let temporary = TempDir::new().expect("a folder");
    let [one, four] = ["1", "4"].map(|threads| temporary.path().join(threads));
    let (ended, json) = reproduce("III", &one, &["--threads", "1"]);
    let ids = ["III-1", "III-2", "III-3", "III-4", "III-5", "III-6"];
    rows_are_whole(&json, (&ids, 3), &one);
    let written = fs::read_to_string(one.join("reproduce_III.json")).expect("the JSON");
    assert_eq!(written.trim(), ended.stdout.trim());
    // The exit code says whether the one equality holds.
    assert_eq!(row(&json, "III-2")["kind"], "E");
    assert_eq!(ended.code == Some(0), row(&json, "III-2")["verdict"] == "holds");
    verdicts_follow_from_numbers(&json);
    assert_eq!(row(&json, "III-3")["verdict_text"], "holds at 2 of 4 settings (quick form, less work)");
    // The other rows are made of the same parts: runs, traces and searches of frames.
    let some = ["III-1", "III-2", "III-4"].iter().flat_map(|id| ["--row", id]);
    let args: Vec<&str> = ["--threads", "4"].into_iter().chain(some).collect();
    let (_, again) = reproduce("III", &four, &args);
    for other in again["rows"].as_array().expect("a list") {
        assert_eq!(other, row(&json, other["id"].as_str().expect("an id")));
    }
    for (name, bytes) in files(&four).into_iter().filter(|(name, _)| name.starts_with("plots")) {
        assert!(fs::read(one.join(&name)).is_ok_and(|whole| whole == bytes), "{name} differs");
    }
}

/// Verdicts follow from the numbers.
fn verdicts_follow_from_numbers(json: &Value) {
    let sums = row(json, "III-2");
    let whole = number(sums, "whole_J");
    assert!(
        (number(sums, "start_to_start_J") / whole - 1.0).abs() < 1e-9
            && number(sums, "begin_to_finish_J") < whole
    );
    let found = row(json, "III-1");
    let enough = number(found, "vsync_f1") >= 0.99 && number(found, "free_f1") >= 0.9;
    assert_eq!(found["verdict"] == "holds", enough);
    // 48 frames are found where 48 were planted.
    let launch = row(json, "III-3");
    assert_eq!(number(launch, "planted_frames"), 48.0);
    let methods = row(json, "III-4");
    assert!(number(methods, "longest_work_ms") < 1e3 / 30.0, "the phone does not keep up: {methods}");
    // Without a waiting processor the old method never gives more; with both cores it does.
    assert_eq!(methods["verdict"], "depends", "{methods}");
    let pc = row(json, "III-5");
    let difference = (number(pc, "with_mean_J") - number(pc, "without_mean_J")).abs();
    assert!((difference - number(pc, "difference_J")).abs() < 1e-12);
    assert_eq!(pc["verdict"], "depends", "a core that spins at 15 W changes a lot: {pc}");
    assert!(number(row(json, "III-6"), "touched_frames") > 0.0);
}

const ROWS_OF_SIX: [&str; 16] = [
    "VI-1", "VI-2", "VI-3", "VI-4", "VI-5", "VI-6", "VI-7", "VI-8", "VI-9", "VI-10", "VI-11", "VI-12",
    "VI-13", "VI-14", "VI-15", "VI-16",
];

/// Verdict that the page on reproduction gives for a row, if it has one.
fn verdict_on_page<'a>(page: &'a str, id: &str) -> Option<&'a str> {
    let (_, after) = page.split_once(&format!("\n- **{id} "))?;
    after.split_once("**").map(|(verdict, _)| verdict)
}

/// The page has a verdict for each row, and its first lines count them.
#[test]
fn the_page_has_a_verdict_for_each_row() {
    let page = fs::read_to_string(root().join("docs/guide/reproduce.md")).expect("the page");
    let of_six = ROWS_OF_SIX.map(str::to_owned);
    let others = (1..=2).map(|n| format!("II-{n}")).chain((1..=6).map(|n| format!("III-{n}")));
    let mut counts = [("holds", 0), ("depends", 0), ("differs", 0)];
    for id in others.chain(of_six) {
        let verdict = verdict_on_page(&page, &id).unwrap_or_else(|| panic!("no verdict of {id}"));
        let count = counts.iter_mut().find(|(word, _)| *word == verdict);
        count.unwrap_or_else(|| panic!("{id}: {verdict}")).1 += 1;
    }
    let [holds, depends, differs] = counts.map(|(_, count)| count);
    let total = format!("Of {} rows, {holds} hold, {depends} depend", holds + depends + differs);
    assert!(page.contains(&total) && differs == 2, "{total}, {differs} differ");
}

#[test]
fn paper_six_is_whole_in_its_quick_form() {
    let temporary = TempDir::new().expect("a folder");
    let (ended, json) = reproduce("VI", temporary.path(), &[]);
    rows_are_whole(&json, (&ROWS_OF_SIX, 6), temporary.path());
    assert_eq!(json["form"], "quick");
    let rows = json["rows"].as_array().expect("a list");
    let equalities = rows.iter().filter(|row| row["kind"] == "E");
    let held = equalities.clone().all(|row| row["verdict"] == "holds");
    assert_eq!((ended.code == Some(0), json["equalities_hold"] == true), (held, held), "{}", ended.stderr);
    // Light, collisions and visibility are not lost.
    for id in ["VI-1", "VI-7", "VI-12", "VI-16"] {
        assert_eq!(row(&json, id)["verdict"], "holds", "{}", row(&json, id));
    }
    assert!(row(&json, "VI-1")["ours"].as_str().is_some_and(|ours| ours.contains("no public case")));
    for (id, tried, full) in [("VI-4", 3, 6), ("VI-10", 2, 2), ("VI-11", 1, 4), ("VI-15", 4, 8)] {
        let band = &row(&json, id)["band"];
        assert_eq!((&band["tried"], &band["full"]), (&tried.into(), &full.into()), "{id}");
    }
    let says = |id: &str, field: &str, words: &str| {
        let text = row(&json, id)[field].as_str().unwrap_or_default();
        assert!(text.contains(words), "{id}: {text}");
    };
    // What is varied, and how, is part of every band.
    for id in ["VI-4", "VI-6", "VI-11"] {
        says(id, "note", "one at a time about the values given");
    }
    for id in ["VI-13", "VI-14"] {
        says(id, "note", "eyes and size_px jointly, and two corners");
        says(id, "ours", "every open setting at the value of its range that lowers or raises");
        says(id, "limits", "64 entries (");
        assert_eq!(row(&json, id)["band"]["full"], if id == "VI-13" { 23 } else { 25 });
        let [low, high] = ["lowering", "raising"]
            .map(|corner| number(row(&json, id), &format!("increase_{corner}_corner_percent")));
        assert!(low < high, "{id}");
    }
    // Lens lines alone are compared with brute force as all other machines are.
    says("VI-16", "ours", "lens lines and no other tile test: 0 of ");
    assert_eq!(number(row(&json, "VI-16"), "machines"), 10.0);
    // What planes gain beyond the tile's own time.
    says("VI-15", "ours", "null, vertices within the tile's time");
    says("VI-15", "note", "against the null");
    assert!(!row(&json, "VI-8")["limits"].as_str().is_some_and(|limits| limits.contains("generous")));
    // The words are those of the file whose hash is printed.
    for field in ["holds_when", "limits"] {
        let words = row(&json, "VI-8")[field].as_str().expect("words");
        assert!(committed(6).contains(&format!("{field}: \"{words}\"")), "{field}: {words}");
    }
    scatter_is_judged(row(&json, "VI-8"));
    says("VI-1", "note", "no public case that collides was tested");
    let worse =
        number(row(&json, "VI-3"), "cases_more") > 0.0 || number(row(&json, "VI-3"), "cases_fewer") == 0.0;
    assert_eq!(row(&json, "VI-3")["verdict"] == "differs", worse);
    // Settings that the paper leaves open are listed with what was tried and why.
    let settings = row(&json, "VI-13")["settings"].as_array().expect("a list");
    let of = |name: &str| settings.iter().find(|setting| setting["name"] == name).expect("a setting");
    assert_eq!((&of("entries")["basis"], &of("entries")["value"]), (&"stated".into(), &1024.into()));
    assert!(of("entries")["source"].as_str().is_some_and(|source| source.contains("1024 entries")));
    assert_eq!(of("eyes")["basis"], "open");
    assert!(of("eyes")["tried"].as_array().is_some_and(|tried| tried.len() > 1));
    let markdown = fs::read_to_string(temporary.path().join("reproduce_VI.md")).expect("the table");
    assert!(markdown.contains(&sha256(&committed(6))) && markdown.contains("| `eyes` | open |"));
}

/// The deviations of VI-8 together: a case of its own, by the chance of their mean square.
fn scatter_is_judged(row: &Value) {
    let cases = row["band"]["cases"].as_array().expect("a list");
    let scatter = cases.iter().find(|case| case["setting"] == "scatter").expect("a case");
    // By chance one deviation of 370 is beyond 3 standard errors.
    assert_eq!(scatter["holds"] == true, number(row, "p_of_scatter") >= 0.0027, "{row}");
    assert_eq!(scatter["number"].as_f64(), Some(number(row, "scatter_in_standard_errors")));
    // Count and mean in eight octants of each seed.
    assert_eq!(number(row, "deviations"), 16.0 * (cases.len() as f64 - 1.0));
    let beyond = ["1_standard_error", "2_standard_errors", "3_standard_errors"]
        .map(|errors| number(row, &format!("beyond_{errors}")));
    assert!(beyond[0] >= beyond[1] && beyond[1] >= beyond[2], "{row}");
    let chance = [1, 2, 3].map(|errors| number(row, &format!("by_chance_beyond_{errors}")));
    let shares = chance.map(|chance| (1e4 * chance / number(row, "deviations")).round());
    assert_eq!(shares, [3173.0, 455.0, 27.0]);
    let note = row["note"].as_str().unwrap_or_default();
    assert!(note.contains("Beyond 1, 2 and 3 standard errors are"), "{note}");
}

/// Where objects really meet, three passes that keep them are right, and a claim that they do not is refuted.
#[test]
fn planted_a_plate_on_the_bar_is_not_cleared() {
    let (ended, row) =
        planted("VI-2", &[("from: (-2.5, 1, 0), to: (0.5, 1, 0)", "from: (-0.5, 1, 0), to: (2.5, 1, 0)")]);
    assert_eq!((ended.code, &row["verdict"]), (Some(0), &"depends".into()), "{row}");
    let cases = row["band"]["cases"].as_array().expect("a list");
    for case in cases {
        let kept = case["setting"].as_str().is_some_and(|setting| setting.contains("(bar and plate,"));
        assert_eq!(case["holds"] == true, !kept, "{case}");
    }
}

/// The same number compared with another reported number, and with another tolerance.
#[test]
fn planted_numbers_of_the_paper_flip_the_verdict_of_views() {
    let small = (
        "over: [(320, 180), (640, 360), (1280, 720)], quick: [(320, 180)]",
        "over: [(64, 36), (640, 360)], quick: [(64, 36)]",
    );
    let (_, far) = planted(
        "VI-13",
        &[small, ("increase_percent: Stated(value: 10.0", "increase_percent: Stated(value: 900.0")],
    );
    assert_eq!(far["verdict"], "differs", "{far}");
    let (_, wide) =
        planted("VI-13", &[small, ("within_points: Ours(value: 5.0", "within_points: Ours(value: 5000.0")]);
    assert_eq!(wide["verdict"], "holds", "{wide}");
    assert_eq!(far["band"]["min"], wide["band"]["min"], "the number itself is computed");
}

/// A row whose passes cull nothing has not shown that culling changes nothing.
#[test]
fn planted_hardware_that_culls_nothing_fails() {
    let (ended, row) = planted("VI-16", &[("z_min: true", "z_min: false")]);
    assert_eq!((ended.code, &row["verdict"]), (Some(1), &"differs".into()), "{row}");
    let note = row["note"].as_str().unwrap_or_default();
    assert!(note.starts_with("nothing was run (depth_reads_spared_by_z_min)"), "{note}");
    assert!(ended.stderr.contains("ran nothing: VI-16"), "{}", ended.stderr);
}

/// Waves that no bounding volume could follow, a query that has to be a million times cheaper: settings are
/// what is computed with.
#[test]
fn planted_conditions_flip_rows() {
    let (_, cheap) = planted("VI-5", &[("far_fewer: Ours(value: 2.0", "far_fewer: Ours(value: 1e6")]);
    assert_eq!(cheap["verdict"], "differs", "{cheap}");
    let (_, seeds) =
        planted("VI-8", &[("standard_errors: Ours(value: 3.0", "standard_errors: Ours(value: 0.0")]);
    assert_eq!(seeds["verdict"], "differs", "{seeds}");
    let asleep = "quick: [0.2, 0.0, 0.05, 0.5], why: \"W that the waiting";
    let (_, phone) = planted("III-4", &[(asleep, "quick: [0.0], why: \"W that the waiting")]);
    assert_eq!(phone["verdict"], "differs", "{phone}");
}

/// A query file like the public ones: one point that meets a face, and one that stays above it.
#[test]
fn public_cases_are_run_where_their_folder_is_given() {
    let point = |z: i32, truth: u32| format!("1,4,1,4,{z},1,{truth}\n");
    let face = |truth: u32| {
        ["0,1,0,1,0,1", "1,1,0,1,0,1", "0,1,1,1,0,1"].map(|at| format!("{at},{truth}\n")).concat()
    };
    let query = |to: i32, truth: u32| {
        format!("{}{}{}{}", point(1, truth), face(truth), point(to, truth), face(truth))
    };
    let folder = TempDir::new().expect("a folder");
    let kind = folder.path().join("queries/made/vertex-face");
    fs::create_dir_all(&kind).expect("folders");
    let write = |text: &str| {
        let file = fs::File::create(kind.join("data_0_0.csv.gz")).expect("a file");
        let mut out = GzEncoder::new(file, Compression::fast());
        out.write_all(text.as_bytes()).and_then(|()| out.finish().map(|_| ())).expect("rows");
    };
    write(&format!("{}{}", query(-1, 1), query(2, 0)));
    let out = TempDir::new().expect("a folder");
    let data = folder.path().display().to_string();
    // Generated cases, which the whole form draws, at a low resolution.
    let resolutions = "resolution_px: Open(value: 32, over: [8, 32, 128], quick: [8, 32]";
    let low = "resolution_px: Open(value: 8, over: [8, 32, 128], quick: [8]";
    let inputs = Inputs::new();
    let settings = inputs.put("settings.ron", committed(6).replace(resolutions, low));
    let args = ["--row", "VI-1", "--settings", &settings, "--collision-data", &data];
    let (ended, json) = reproduce("VI", out.path(), &args);
    assert_eq!(json["settings"]["committed"], false);
    let row = row(&json, "VI-1");
    assert_eq!((ended.code, &row["verdict"]), (Some(0), &"holds".into()), "{row}");
    assert_eq!([number(row, "public_queries"), number(row, "public_cases_that_collide_drawn")], [2.0, 1.0]);
    let ours = row["ours"].as_str().unwrap_or_default();
    assert!(ours.contains("2 public queries in 1 files, all drawn, of which 1 collide"), "{ours}");
    assert!(ours.contains("false positives of 1 public queries that do not collide, all drawn"), "{ours}");
    assert_eq!(number(row, "public_queries_that_do_not_collide_drawn"), 1.0);
    assert_eq!(number(row, "most_false_positives_percent"), 0.0);
    let ran = row["ran"].as_array().expect("a list");
    let of_kind =
        |end: &str| ran.iter().filter(|n| n["name"].as_str().is_some_and(|name| name.ends_with(end))).count();
    assert_eq!(["that_collide", "that_do_not"].map(of_kind), [2, 2], "{row}");
    assert!(!row["note"].as_str().unwrap_or_default().contains("no public case"), "{row}");
    // Where nothing public collides, nothing public was tested.
    write(&query(2, 0));
    let (_, json) = reproduce("VI", out.path(), &args);
    let note = self::row(&json, "VI-1")["note"].as_str().unwrap_or_default();
    assert!(note.starts_with("no public case that collides was tested"), "{note}");
    // A truth that is wrong shows: the point that stays above does not collide, so it is missed.
    write(&query(2, 1));
    let (ended, json) = reproduce("VI", out.path(), &args);
    assert_eq!((ended.code, &self::row(&json, "VI-1")["verdict"]), (Some(1), &"differs".into()));
    write("1,2,3\n");
    let out = out.path().display().to_string();
    let broken = quintile().call(["reproduce", "VI", "--out", &out].iter().chain(&args));
    assert_eq!(broken.code, Some(2));
    assert!(broken.stderr.contains("data_0_0.csv.gz:1: seven numbers are expected"), "{}", broken.stderr);
}

/// The public data that the book's row is made with, where they are: beside the real scenes.
#[test]
#[cfg_attr(not(collision_data), ignore = "no folder ccd beside QUINTILE_SCENES")]
fn no_public_case_is_missed() {
    let scenes = real_scene("");
    let data = Path::new(&scenes).join("../ccd");
    let out = TempDir::new().expect("a folder");
    let (ended, json) =
        reproduce("VI", out.path(), &["--row", "VI-1", "--collision-data", &data.display().to_string()]);
    let row = row(&json, "VI-1");
    assert_eq!((ended.code, &row["verdict"]), (Some(0), &"holds".into()), "{row}");
    assert_eq!([number(row, "public_scenes"), number(row, "public_query_files")], [5.0, 42.0]);
    // 132 pairs of scenes that are identified, and 435 queries.
    assert_eq!(number(row, "public_cases_that_collide_drawn"), 567.0);
    assert_eq!(number(row, "public_queries_that_do_not_collide_drawn"), 6844.0);
}

#[test]
fn settings_that_cannot_be_are_refused_with_their_place() {
    let inputs = Inputs::new();
    let out = inputs.path("out");
    let refused = |text: &str, parts: &[&str]| {
        let file = inputs.put("settings.ron", text);
        let ended = quintile().call(["reproduce", "VI", "--settings", &file, "--out", &out]);
        assert_eq!(ended.code, Some(2), "{}", ended.stderr);
        for part in parts {
            assert!(ended.stderr.contains(part), "{part}: {}", ended.stderr);
        }
    };
    let text = committed(6);
    let eyes = "eyes: Open(value: 0.065, over: [0.02, 0.065, 0.14, 0.28]";
    refused(
        &text.replace(eyes, "eyes: Open(value: -1.0, over: [-1.0, 0.065]"),
        &["settings.ron: `vi_13.eyes` is -1.0"],
    );
    refused(
        &text.replace(eyes, "eyes: Open(value: 0.5, over: [0.02, 0.065]"),
        &["`vi_13.eyes` is open", "among them"],
    );
    refused(
        &text.replace("vi_16: (", "vi_61: ("),
        &["settings.ron:", "unknown field `vi_61`, did you mean `vi_1`?"],
    );
    refused(
        &text.replace("paper: \"VI\"", "paper: \"III\""),
        &["settings.ron: `paper` is \"III\"; settings of Paper VI have \"VI\""],
    );
    let missing = quintile().call(["reproduce", "VI", "--settings", &inputs.path("none.ron"), "--out", &out]);
    assert_eq!(missing.code, Some(2));
    let row = quintile().call(["reproduce", "VI", "--row", "VI-99", "--out", &out]);
    assert_eq!(row.code, Some(2));
    assert!(row.stderr.contains("no row `VI-99` in Paper VI; its rows: VI-1, VI-2"), "{}", row.stderr);
    let folder =
        quintile().call(["reproduce", "VI", "--collision-data", &inputs.path("none"), "--out", &out]);
    assert_eq!(folder.code, Some(2));
    assert!(
        folder.stderr.contains("--collision-data") && folder.stderr.contains("name a folder"),
        "{}",
        folder.stderr
    );
}

#[test]
fn paper_two_adds_up_its_passes_and_not_inverse_units() {
    let temporary = TempDir::new().expect("a folder");
    let out = temporary.path().join("out");
    let (ended, json) = reproduce("ii", &out, &[]);
    rows_are_whole(&json, (&["II-1", "II-2"], 2), &out);
    let passes = row(&json, "II-1");
    assert_eq!(passes["verdict"], "holds");
    let parts = ["g_buffer", "lighting", "rest"].map(|name| number(passes, &format!("{name}_nJ_per_pixel")));
    assert!(parts.iter().all(|part| *part > 0.0), "{parts:?}");
    let sum: f64 = parts.iter().sum();
    assert!((sum / number(passes, "frame_nJ_per_pixel") - 1.0).abs() < 1e-9);
    let cut = number(passes, "share_cut_at_ends_of_passes");
    assert!(cut > 0.0 && cut < 1.0, "some of the sum is not by construction: {cut}");
    assert!(passes["limits"].as_str().is_some_and(|limits| limits.contains("by construction")));
    assert!(passes["ours"].as_str().is_some_and(|ours| ours.contains("paper 135 = 47 + 84 + 4")));
    let inverses = row(&json, "II-2");
    assert_eq!(inverses["verdict"], "holds");
    assert!(inverses["ours"].as_str().is_some_and(|ours| ours.contains("WRONG")));
    let [wrong, right, whole] = ["mean_of_inverses", "inverse_of_mean", "whole_animation"]
        .map(|name| number(inverses, &format!("{name}_pixels_per_J")));
    assert!(wrong > right && (right / whole - 1.0).abs() < 1e-9);
    assert_eq!((ended.code, json["equalities_hold"].as_bool()), (Some(0), Some(true)), "{}", ended.stderr);
    one_row_does_not_replace_both(&out);
}

/// A row run alone into the folder of a whole result.
fn one_row_does_not_replace_both(out: &Path) {
    let before = files(out);
    let folder = out.display().to_string();
    let alone = ["reproduce", "II", "--quick", "--row", "II-2", "--out", &folder];
    let refused = quintile().call(alone);
    assert_eq!((refused.code, files(out)), (Some(2), before), "{}", refused.stderr);
    for part in
        [&folder, "quick result of Paper II with 2 rows (II-1, II-2)", "1 of them", "--out", "--force"]
    {
        assert!(refused.stderr.contains(part), "{part}: {}", refused.stderr);
    }
    let forced = quintile().call(alone.iter().chain(&["--force"]));
    assert_eq!(forced.code, Some(0), "{}", forced.stderr);
    let again = quintile().call(alone);
    assert_eq!(again.code, Some(0), "the same row again loses nothing: {}", again.stderr);
}

/// Data that no row reads are no data that were run.
#[test]
fn collision_data_without_the_row_that_reads_them_are_refused() {
    let inputs = Inputs::new();
    let (data, out) = (inputs.path(""), inputs.path("out"));
    for paper in [&["II"][..], &["III"], &["VI", "--row", "VI-2", "--row", "VI-12"]] {
        let args = ["--collision-data", data.as_str(), "--quick", "--out", &out];
        let ended = quintile().call(["reproduce"].iter().chain(paper).chain(&args));
        assert_eq!(ended.code, Some(2), "{}", ended.stderr);
        assert!(ended.stderr.contains("--collision-data is read by row VI-1 alone"), "{}", ended.stderr);
    }
    assert!(!Path::new(&out).exists());
}

#[test]
fn invalid_arguments_are_refused_before_the_work() {
    let unknown = quintile().call(["reproduce", "VII"]);
    assert_eq!(unknown.code, Some(2));
    assert!(unknown.stderr.contains("VII") && unknown.stderr.contains("II, III"), "{}", unknown.stderr);
    assert_eq!(quintile().call(["reproduce"]).code, Some(2));
    let temporary = TempDir::new().expect("a folder");
    let file = temporary.path().join("file");
    fs::write(&file, "not a folder").expect("a file");
    let blocked = quintile().call(["reproduce", "II", "--quick", "--out", &file.display().to_string()]);
    assert_eq!(blocked.code, Some(2));
    assert!(blocked.stderr.contains("cannot use it as the folder for results"), "{}", blocked.stderr);
    let help = quintile().call(["help", "reproduce"]);
    assert!(help.stdout.contains("quintile reproduce III --quick --out claims"), "{}", help.stdout);
}
