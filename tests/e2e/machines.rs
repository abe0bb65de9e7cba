//! GPU, platform and energy table: `--gpu` chooses all three, `list` shows which belong together.

use std::fs;

use crate::support::{Inputs, Results, quintile, root};
use serde_json::Value;

/// Names of GPU, platform and energy table of a run.
fn machine(results: &Results) -> [String; 3] {
    let summary = results.summary();
    ["/gpu", "/platform", "/energy_table/0"]
        .map(|at| summary.pointer(at).and_then(Value::as_str).unwrap_or_default().to_owned())
}

fn mismatch(results: &Results) -> bool {
    results.warning_codes().contains(&"platform-mismatch".to_owned())
}

#[test]
fn a_gpu_brings_its_platform_and_its_table() {
    for (gpu, platform) in [("reference", "reference"), ("mobile", "iphone_4s"), ("hd_4000", "hd_4000")] {
        let results = quintile().run("tiny", &["--gpu", gpu]);
        assert_eq!(machine(&results), [gpu, platform, "28nm"]);
        assert!(!mismatch(&results), "{gpu}");
        // Naming them explicitly gives the same numbers.
        let explicit = quintile().run("tiny", &["--gpu", gpu, "--platform", platform, "--energy", "28nm"]);
        let (one, other) = (results.summary(), explicit.summary());
        for key in ["truth", "measured", "energy_by_part_j", "counts", "frames", "warnings"] {
            assert!(one[key] == other[key], "{gpu}: {key}");
        }
    }
}

/// Traffic is counted after each level; a GPU without levels does not mention them.
#[test]
fn a_gpu_with_levels_below_the_l2_counts_traffic_after_each() {
    let [one, four] =
        ["1", "4"].map(|threads| quintile().run("tiny", &["--gpu", "iris_pro", "--threads", threads]));
    let (summary, plain) = (one.summary(), quintile().run("tiny", &["--gpu", "reference"]).summary());
    let count = |event: &str| summary["counts"][event].as_u64().expect("a count");
    assert!(count("llc_reads") > 0 && count("llc_misses") > 0);
    assert_eq!(count("llc_writebacks"), count("edram_writes"));
    assert_eq!(64 * count("edram_writebacks"), count("dram_write_bytes"));
    assert!(64 * count("edram_reads") >= count("dram_read_bytes"));
    for level in ["llc", "edram"] {
        assert!(summary["energy_by_part_j"][level].as_f64() > Some(0.0), "{level}");
        assert!(summary["power_by_part_w"][level].is_number() && plain["power_by_part_w"][level].is_null());
        assert!(plain["energy_by_part_j"][level].is_null());
    }
    assert!(plain["counts"]["llc_reads"].is_null());
    for key in ["truth", "counts", "frames", "energy_by_part_j"] {
        assert_eq!(summary[key], four.summary()[key], "{key}");
    }
}

#[test]
fn another_platform_is_reported() {
    let discrete = quintile().run("tiny", &["--gpu", "discrete"]);
    assert_eq!(machine(&discrete), ["discrete", "reference", "28nm"]);
    assert!(mismatch(&discrete));
    let crossed = quintile().run("tiny", &["--gpu", "mobile", "--platform", "reference"]);
    let message = crossed.summary()["warnings"].to_string();
    assert!(mismatch(&crossed) && message.contains("`mobile` belongs to platform `iphone_4s`"), "{message}");
}

/// A copy of `file` with another name and the changes of `change`.
fn copy(inputs: &Inputs, file: &str, name: &str, change: impl Fn(String) -> String) -> String {
    let path = root().join(file);
    let text = fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let named = text.replacen("name: \"reference\"", &format!("name: \"{name}\""), 1);
    assert_ne!(text, named, "{file} is named otherwise now");
    inputs.put(&format!("{name}.ron"), change(named))
}

#[test]
fn user_files_of_gpu_and_platform_name_each_other() {
    let inputs = Inputs::new();
    let platform = copy(&inputs, "power-model/platforms/reference.ron", "board", |text| text);
    let own = "power: (platform: \"board.ron\", energy: \"28nm\")";
    let gpu = copy(&inputs, "sim/run/gpus/reference.ron", "chip", |text| {
        text.replacen("power: (platform: \"reference\", energy: \"28nm\")", own, 1)
    });
    // The platform's file is relative to the folder of the GPU's.
    let together = quintile().run("tiny", &["--gpu", &gpu]);
    assert_eq!(machine(&together), ["chip", "board", "28nm"]);
    assert!(!mismatch(&together));
    assert!(!mismatch(&quintile().run("tiny", &["--gpu", &gpu, "--platform", &platform])));
    assert!(mismatch(&quintile().run("tiny", &["--platform", &platform])));
    let alone = copy(&inputs, "sim/run/gpus/reference.ron", "alone", |text| {
        text.replacen("    power: (platform: \"reference\", energy: \"28nm\"),\n", "", 1)
    });
    let alone = quintile().run("tiny", &["--gpu", &alone]);
    assert_eq!(machine(&alone), ["alone", "reference", "28nm"]);
    assert!(mismatch(&alone));
}

#[test]
fn list_shows_the_pairs() {
    let text = quintile().call(["list"]).stdout;
    for line in ["[platform iphone_4s, energy table 28nm]", "[no platform of its own]"] {
        assert!(text.contains(line), "{text}");
    }
    let listing: Value = serde_json::from_str(&quintile().call(["list", "--json"]).stdout).expect("JSON");
    let pairs: Vec<(&str, Option<&str>, Option<&str>)> = listing["gpus"]
        .as_array()
        .into_iter()
        .flatten()
        .map(|gpu| {
            (gpu["name"].as_str().unwrap_or_default(), gpu["platform"].as_str(), gpu["energy_table"].as_str())
        })
        .collect();
    assert_eq!(
        pairs,
        [
            ("reference", Some("reference"), Some("28nm")),
            ("mobile", Some("iphone_4s"), Some("28nm")),
            ("discrete", None, None),
            ("hd_4000", Some("hd_4000"), Some("28nm")),
            ("iris_pro", None, None),
        ]
    );
}
