//! Output files: refused before the work, unchanged without results.

use std::fs::read_to_string;

use crate::support::{Inputs, mts, quintile};

/// Two triangles that cross.
fn crossing() -> Vec<u8> {
    let floor = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let blade = [[0.2, 0.2, -0.5], [0.3, 0.2, 0.5], [0.2, 0.3, 0.5]];
    mts(&[[floor; 2], [blade; 2]])
}

#[test]
fn a_missing_folder_is_reported_before_the_work() {
    let inputs = Inputs::new();
    let case = inputs.put("cross.mts", crossing());
    let cut = inputs.put("cut.mts", &crossing()[..60]);
    let [csv, points, samples] =
        ["no/pairs.csv", "no/points.csv", "no/table.smp"].map(|name| inputs.path(name));
    let [hits, plot] = ["no/a.hit", "no/a.svg"].map(|name| inputs.path(name));
    let calls: [&[&str]; 7] = [
        &["ccd", &case, "--csv", &csv],
        // Errors in the contents of a file are found later.
        &["ccd", &cut, "--csv", &csv],
        // Long work starts later.
        &["sample", "poisson", "--dim", "4", "--count", "1000000", "-o", &points],
        &["sample", "volume", "--count", "100000000", "-o", &points],
        &["samples", "--out", &samples],
        &["visibility", &case, "--out", &hits],
        &["trace", "plot", &case, "--out", &plot],
    ];
    for call in calls {
        let ended = quintile().call(call);
        assert_eq!(ended.code, Some(2), "{call:?}: {}", ended.stderr);
        let folder = inputs.path("no");
        for says in [
            &format!("the folder {folder} does not exist;"),
            "create it, or name a file in an existing folder",
        ] {
            assert!(ended.stderr.contains(says), "{call:?}: {}", ended.stderr);
        }
        assert!(ended.stdout.is_empty() && ended.stderr.lines().count() == 1, "{call:?}");
    }
}

#[test]
fn an_old_file_stays_without_new_results() {
    let inputs = Inputs::new();
    let (cut, whole) = (inputs.put("cut.mts", &crossing()[..60]), inputs.put("cross.mts", crossing()));
    let csv = inputs.put("pairs.csv", "old");
    for (cases, code, left) in [
        (vec![&cut], 1, "old"),
        (vec![&cut, &whole], 1, "case_id,a,b,may_collide\ncross,0,1,1\n"),
        (vec![&whole], 0, "case_id,a,b,may_collide\ncross,0,1,1\n"),
    ] {
        let ended =
            quintile().call(["ccd", "--csv", &csv].into_iter().chain(cases.iter().map(|case| case.as_str())));
        assert_eq!(ended.code, Some(code), "{}", ended.stderr);
        assert_eq!(read_to_string(&csv).unwrap_or_default(), left, "{cases:?}");
    }
}

#[test]
fn rows_go_to_standard_output_on_request() {
    let inputs = Inputs::new();
    let case = inputs.put("cross.mts", crossing());
    for printed in ["-", "/dev/stdout"] {
        let ended = quintile().call(["ccd", &case, "--csv", printed]);
        assert_eq!(ended.code, Some(0), "{}", ended.stderr);
        assert_eq!(ended.stdout, "case_id,a,b,may_collide\ncross,0,1,1\n");
        let ended = quintile().call(["ccd", &case, "--csv", printed, "--json"]);
        assert_eq!(ended.code, Some(2), "{}", ended.stderr);
        for says in [&format!("--csv {printed}: "), "the rows or --json, not both", "name a file for --csv"] {
            assert!(ended.stderr.contains(says), "{}", ended.stderr);
        }
        assert!(ended.stdout.is_empty());
    }
    assert!(!std::path::Path::new("-").exists());
}
