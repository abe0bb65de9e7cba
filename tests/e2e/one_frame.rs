//! A run of one frame: no other start may be found.

use crate::support::quintile;
use serde_json::Value;

#[test]
fn a_lone_frame_is_found_once_however_long_it_is() {
    for samples in ["4", "64"] {
        let args = ["--size", "320x180", "--frames", "18..19", "--samples", samples];
        let summary: Value = serde_json::from_slice(&quintile().run("default", &args).bytes("summary.json"))
            .expect("the summary is JSON");
        assert_eq!(summary["detection"]["found_frames"], 1, "{samples} samples");
        let codes: Vec<_> =
            summary["warnings"].as_array().into_iter().flatten().map(|w| &w["code"]).collect();
        assert!(!codes.iter().any(|code| **code == "frames-missed" || **code == "only-mark"), "{codes:?}");
    }
}

#[test]
fn a_lone_frame_has_no_deviation() {
    let [one, two] = ["0..1", "0..2"].map(|frames| {
        let results = quintile().run("tiny", &["--frames", frames]);
        ["report.html", "plots/frame_energy.svg"]
            .map(|file| String::from_utf8(results.bytes(file)).expect("text"))
            .concat()
    });
    let deviations =
        |text: &str| text.split(" ± ").skip(1).filter(|rest| rest.starts_with(char::is_numeric)).count();
    assert_eq!(deviations(&one), 0);
    assert!(deviations(&two) > 4);
}
