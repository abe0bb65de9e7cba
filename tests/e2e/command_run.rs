//! `quintile run` and `quintile list`.

use std::path::PathBuf;

use crate::support::{Results, quintile};
use serde_json::Value;
use traces::Trace;
use traces::energy::TABLE_COLUMNS;

const FILES: [&str; 9] = [
    "summary.json",
    "frames.csv",
    "trace.parquet",
    "trace.csv",
    "timeline.perfetto-trace",
    "report.html",
    "images/frame_0000.png",
    "plots/power_run.svg",
    "plots/power_run.png",
];

fn tiny(args: &[&str]) -> Results {
    quintile().run("tiny", args)
}

#[test]
fn every_documented_file_exists_and_is_not_empty() {
    let results = tiny(&[]);
    for name in FILES {
        assert!(!results.bytes(name).is_empty(), "{name} is empty");
    }
    for plot in ["power_run", "frame_power", "frame_energy"] {
        assert!(results.text(&format!("plots/{plot}.svg")).contains("<svg"));
        let bytes = results.bytes(&format!("plots/{plot}.png"));
        let picture = image::load_from_memory(&bytes).expect("a plot decodes");
        assert!(picture.width() > 300 && picture.height() > 100, "{plot} is too small to read");
    }
    let leftovers: Vec<PathBuf> = results.files().into_keys().filter(|path| is_temporary(path)).collect();
    assert!(leftovers.is_empty(), "{leftovers:?}");
}

fn is_temporary(path: &std::path::Path) -> bool {
    path.extension().is_some_and(|extension| extension == "tmp")
}

#[test]
fn images_have_the_requested_size_and_are_not_empty() {
    let results = tiny(&["--size", "50x30", "--frames", "1..3", "--exr"]);
    for number in 1..3 {
        let picture = results.image(number);
        assert_eq!(picture.dimensions(), (50, 30));
        let first = picture.get_pixel(0, 0);
        let other = picture.pixels().filter(|pixel| *pixel != first).count();
        assert!(other > 100, "frame {number} shows nothing");
    }
    assert!(!results.path("images/frame_0000.png").exists());
    let exr = image::load_from_memory(&results.bytes("images/frame_0001.exr")).expect("EXR decodes");
    assert_eq!((exr.width(), exr.height()), (50, 30));
}

#[test]
fn a_shorter_run_leaves_no_images_of_a_longer_one() {
    let results = tiny(&[]);
    let out = results.folder().display().to_string();
    let again = quintile().call(["run", "tiny", "--frames", "0..1", "--out", &out]);
    assert_eq!(again.code, Some(0), "{}", again.stderr);
    let images: Vec<_> = results.files().into_keys().filter(|path| path.starts_with("images")).collect();
    assert_eq!(images, [PathBuf::from("images/frame_0000.png")]);
}

#[test]
fn both_trace_files_hold_the_same_samples() {
    let results = tiny(&[]);
    let parquet = results.trace();
    let csv = traces::io::csv::read(&results.path("trace.csv")).expect("trace.csv is a trace");
    let parts = |trace: &Trace| (trace.samples(), trace.rate_hz(), trace.start_s());
    assert_eq!(parts(&parquet), parts(&csv));
    assert!(parquet.samples() > 1000);
    assert_eq!(parquet.rate_hz(), 200e3);
    let bits = |values: &[f32]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(parquet.voltage_v()), bits(csv.voltage_v()));
    assert_eq!(bits(parquet.current_a()), bits(csv.current_a()));
    assert_eq!(parquet.metadata, csv.metadata);
    let text = results.text("trace.csv");
    assert_eq!(text.lines().next(), Some("time_s,voltage_V,current_A"));
    assert_eq!(text.lines().count(), parquet.samples() + 1);
}

#[test]
fn frames_csv_has_its_columns_and_a_row_for_each_found_frame() {
    let results = tiny(&[]);
    let text = results.text("frames.csv");
    assert_eq!(text.lines().next(), Some(TABLE_COLUMNS.join(",").as_str()));
    let found = results.summary()["detection"]["found_frames"].as_u64();
    assert_eq!(Some(results.frames().len() as u64), found);
}

#[test]
fn the_summary_describes_the_run() {
    let summary = tiny(&["--samples", "3", "--seed", "7", "--rate", "30"]).summary();
    let settings = &summary["settings"];
    assert_eq!(summary["scene"], "tiny");
    assert_eq!(settings["samples"], 3);
    assert_eq!(settings["seed"], 7);
    assert_eq!(settings["frame_rate_hz"], 30.0);
    assert_eq!(summary["modelled"]["dimensions"], 5);
    assert_eq!(summary["frames"].as_array().map(Vec::len), Some(4));
    let pinhole = tiny(&["--lens", "0", "--shutter", "0"]).summary();
    assert_eq!(pinhole["modelled"]["dimensions"], 2);
    assert!(pinhole["counts"]["sample_madds"].as_u64() < summary["counts"]["sample_madds"].as_u64());
}

/// References that a browser would fetch. Those with `data:` or `#` need no network, and links are followed
/// only on a click.
#[test]
fn the_report_needs_no_network_and_no_other_files() {
    let results = tiny(&[]);
    let report = results.text("report.html");
    for tag in
        ["<link", "<iframe", "<object", "<embed", "@import", "<base", "fetch(", "XMLHttpRequest", "import("]
    {
        assert!(!report.contains(tag), "{tag}");
    }
    for part in report.split("src=\"").skip(1) {
        assert!(part.starts_with("data:"), "src=\"{}", &part[..part.len().min(60)]);
    }
    for part in report.split("url(").skip(1) {
        let target = part.trim_start_matches(['"', '\'']);
        assert!(
            target.starts_with("data:") || target.starts_with('#'),
            "url({}",
            &part[..part.len().min(60)]
        );
    }
    assert!(!report.contains("<script src"), "a script of its own file");
}

#[test]
fn links_of_the_report_lead_to_existing_files() {
    let results = tiny(&[]);
    let report = results.text("report.html");
    let mut links = 0;
    for part in report.split("<a href=\"").skip(1) {
        let target = part.split('"').next().unwrap_or_default().replace("&#x2f;", "/");
        if let Some(anchor) = target.strip_prefix('#') {
            assert!(report.contains(&format!("id=\"{anchor}\"")), "no place called {anchor}");
        } else if !target.contains("://") {
            assert!(results.path(&target).exists(), "{target} is not there");
            links += 1;
        }
    }
    assert!(links >= FILES.len());
}

#[test]
fn json_alone_goes_to_standard_output() {
    let results = tiny(&["--json"]);
    let printed: Value = serde_json::from_str(&results.ended.stdout).expect("nothing but JSON");
    assert_eq!(results.ended.stderr, "");
    let mut expected = results.summary();
    expected["out"] = results.folder().display().to_string().into();
    for (key, value) in expected.as_object().into_iter().flatten() {
        assert_eq!(&printed[key], value, "{key}");
    }
    assert_eq!(printed.as_object().map(serde_json::Map::len), expected.as_object().map(serde_json::Map::len));
}

#[test]
fn a_pipe_gets_results_and_no_progress() {
    let Results { ended, .. } = &tiny(&[]);
    assert_eq!(ended.stderr.lines().count(), 1, "{}", ended.stderr);
    assert!(ended.stderr.starts_with("note: expected time: about "), "{}", ended.stderr);
    assert!(!ended.stdout.contains(['\u{1b}', '\r']), "{}", ended.stdout);
    for part in ["modelled:", "results:", "report.html", "energy per pixel"] {
        assert!(ended.stdout.contains(part), "no `{part}` in {}", ended.stdout);
    }
}

#[test]
fn list_names_everything_in_text_and_in_json() {
    let text = quintile().call(["list"]);
    let json = quintile().call(["list", "--json"]);
    assert_eq!((text.code, json.code), (Some(0), Some(0)));
    assert_eq!((text.stderr.as_str(), json.stderr.as_str()), ("", ""));
    let listing: Value = serde_json::from_str(&json.stdout).expect("list --json prints JSON");
    for group in ["scenes", "gpus", "platforms", "workloads", "figures"] {
        let entries = listing[group].as_array().unwrap_or_else(|| panic!("no {group}"));
        assert!(!entries.is_empty(), "{group} is empty");
        for entry in entries {
            let [name, what] = ["name", "what"].map(|key| entry[key].as_str().unwrap_or_default());
            assert!(!what.is_empty() && text.stdout.contains(name) && text.stdout.contains(what), "{entry}");
        }
    }
    let scenes = listing["scenes"].as_array().into_iter().flatten();
    let names: Vec<_> = scenes.filter_map(|scene| scene["name"].as_str()).collect();
    assert_eq!(names, ["default", "tiny"]);
}

#[test]
fn list_shows_the_options_and_facts_of_a_workload() {
    let text = quintile().call(["list", "occlusion"]);
    let json = quintile().call(["list", "occlusion", "--json"]);
    assert_eq!((text.code, json.code), (Some(0), Some(0)), "{}{}", text.stderr, json.stderr);
    let listing: Value = serde_json::from_str(&json.stdout).expect("list --json prints JSON");
    assert_eq!(listing["name"], "occlusion");
    let options = listing["options"].as_array().expect("a list of options");
    assert!(options.len() > 5);
    for option in options {
        let [name, range, meaning] =
            ["name", "range", "meaning"].map(|key| option[key].as_str().unwrap_or_default());
        let line = text.stdout.lines().find(|line| line.split_whitespace().next() == Some(name));
        let line = line.unwrap_or_else(|| panic!("no {name} in {}", text.stdout));
        assert!(!range.is_empty() && line.contains(range) && line.contains(meaning), "{line}");
    }
    let facts = listing["facts"].as_array().expect("a list of facts");
    assert!(facts.len() > 3);
    for fact in facts {
        let [name, unit, meaning] =
            ["name", "unit", "meaning"].map(|key| fact[key].as_str().unwrap_or_default());
        let line = text.stdout.lines().rfind(|line| line.split_whitespace().next() == Some(name));
        let line = line.unwrap_or_else(|| panic!("no {name} in {}", text.stdout));
        assert!(line.contains(unit) && line.contains(meaning), "{line}");
    }
    let unknown = quintile().call(["list", "oclusion"]);
    assert_eq!(unknown.code, Some(2));
    assert!(unknown.stderr.contains("unknown workload `oclusion`, did you mean `occlusion`?"), "{unknown:?}");
}

#[test]
fn former_names_of_charts_suggest_those_of_today() {
    for (former, today) in [("collision", "ccd"), ("shadows", "soft-shadows"), ("views", "multiview")] {
        let ended = quintile().call(["chart", former]);
        assert_eq!(ended.code, Some(2), "{}", ended.stderr);
        assert!(ended.stderr.contains(&format!("a similar value exists: '{today}'")), "{}", ended.stderr);
        assert!(!quintile().call(["list"]).stdout.contains(&format!("  {former} ")), "{former}");
    }
}

#[test]
fn help_shows_usage() {
    let help = quintile().call(["--help"]);
    assert_eq!((help.code, help.stderr.as_str()), (Some(0), ""));
    assert!(help.stdout.contains("run") && help.stdout.contains("list"));
    let help = quintile().call(["run", "--help"]);
    assert_eq!(help.code, Some(0));
    let flags = [
        "--out",
        "--frames",
        "--samples",
        "--size",
        "--lens",
        "--focus",
        "--shutter",
        "--gpu",
        "--threads",
        "--json",
    ];
    for part in flags.into_iter().chain(["Example:", "[default: out]", "[default: default]"]) {
        assert!(help.stdout.contains(part), "no {part}");
    }
    assert!(quintile().call(["--version"]).stdout.starts_with("quintile "));
}

#[test]
fn the_timeline_holds_units_and_power() {
    let results = tiny(&[]);
    let timeline = results.bytes("timeline.perfetto-trace");
    let has = |name: &str| timeline.windows(name.len()).any(|part| part == name.as_bytes());
    for name in ["sample_test", "shader", "dram", "power, total", "energy_mJ"] {
        assert!(has(name), "no track called {name}");
    }
}
