//! `quintile ccd`: the pairs of a file that may collide, as a table, as JSON and as CSV.

use crate::support::{Inputs, mts, quintile};

/// A triangle at rest, one that falls through it, and one far off.
fn falling() -> Vec<u8> {
    let floor = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let at = |x: f64, z: f64| [[x, 0.2, z], [x + 0.1, 0.2, z + 0.1], [x, 0.3, z + 0.1]];
    mts(&[[floor; 2], [at(0.2, 1.0), at(0.2, -1.0)], [at(9.0, 1.0), at(9.0, -1.0)]])
}

#[test]
fn pairs_come_as_csv_and_json_the_same_for_any_threads() {
    let inputs = Inputs::new();
    let file = inputs.put("fall.mts", falling());
    let mut seen = Vec::new();
    for threads in ["1", "2", "16"] {
        let csv = inputs.path("pairs.csv");
        let ended = quintile().call(["ccd", &file, "--csv", &csv, "--json", "--threads", threads]);
        assert_eq!(ended.code, Some(0), "{}", ended.stderr);
        let rows = std::fs::read_to_string(&csv).unwrap_or_default();
        assert_eq!(rows, "case_id,a,b,may_collide\nfall,0,1,1\nfall,0,2,0\nfall,1,2,0\n");
        seen.push(ended.stdout);
    }
    assert!(seen.iter().all(|json| *json == seen[0]));
    let json: serde_json::Value = serde_json::from_str(&seen[0]).unwrap_or_default();
    let pair = &json[0]["may_collide"][0];
    assert_eq!((&pair["a"], &pair["b"], &pair["seen"]), (&0.into(), &1.into(), &true.into()), "{json}");
    let time = [0, 1].map(|end| pair["time"][end].as_f64().unwrap_or(f64::NAN));
    assert!(time[0] <= 0.5 && time[1] >= 0.5, "{time:?}");
}

#[test]
fn invalid_arguments_are_refused() {
    let inputs = Inputs::new();
    let (good, cut) = (inputs.put("good.mts", falling()), inputs.put("cut.mts", &falling()[..100]));
    let alone = inputs.put("alone.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let cases: [(&[&str], i32, &str); 6] = [
        (&["/dev/null"], 2, "known: .mts, and .ply, .obj or .off two by two"),
        (&[&good, "--resolution", "0"], 2, "1..=1024"),
        (&[&good, "--method", "guess"], 2, "fragment-box"),
        (&[&good, "--csv", &good], 2, "name another file"),
        (&[&cut], 1, "cut.mts"),
        (&[&alone], 2, "two by two"),
    ];
    for (args, code, says) in cases {
        let ended = quintile().call(["ccd"].iter().chain(args));
        assert_eq!(ended.code, Some(code), "{args:?}: {}", ended.stderr);
        assert!(ended.stderr.contains(says), "{args:?}: {}", ended.stderr);
    }
    assert!(std::fs::read(&good).is_ok_and(|bytes| bytes == falling()));
}

/// The same with another first coordinate.
fn mts_at(number: f64) -> Vec<u8> {
    let mut data = falling();
    data[40..48].copy_from_slice(&number.to_le_bytes());
    data
}

#[test]
fn a_broken_case_does_not_stop_the_others() {
    let inputs = Inputs::new();
    let (first, last) = (inputs.put("first.mts", falling()), inputs.put("last.mts", falling()));
    let (csv, gone) = (inputs.path("pairs.csv"), inputs.path("gone.mts"));
    let mut bad: Vec<String> = [1e61, f64::NAN, f64::INFINITY]
        .into_iter()
        .zip(["far.mts", "nan.mts", "endless.mts"])
        .map(|(number, name)| inputs.put(name, mts_at(number)))
        .collect();
    bad.extend([inputs.put("cut.mts", &falling()[..100]), gone]);
    for bad in bad {
        let ended = quintile().call(["ccd", &first, &bad, &last, "--csv", &csv, "--json"]);
        assert_eq!(ended.code, Some(1), "{}", ended.stderr);
        assert!(ended.stderr.contains(&bad) && ended.stderr.contains("1 of 3 cases"), "{}", ended.stderr);
        let rows = |case: &str| format!("{case},0,1,1\n{case},0,2,0\n{case},1,2,0\n");
        let written = std::fs::read_to_string(&csv).unwrap_or_default();
        assert_eq!(written, format!("case_id,a,b,may_collide\n{}{}", rows("first"), rows("last")));
        let json: serde_json::Value = serde_json::from_str(&ended.stdout).unwrap_or_default();
        assert!(json[1]["error"].as_str().is_some_and(|error| error.contains(&bad)), "{json}");
        assert!(json[1].get("may_collide").is_none() && json[0].get("error").is_none(), "{json}");
        assert_eq!(json[2]["case_id"], "last");
        assert_eq!(json[2]["may_collide"].as_array().map(Vec::len), Some(1), "{json}");
    }
}

#[test]
fn cases_of_one_name_are_refused() {
    let inputs = [Inputs::new(), Inputs::new()];
    let [one, other] = inputs.each_ref().map(|inputs| inputs.put("x.mts", falling()));
    for (second, says) in [(&other, "both called `x`"), (&one, "give it once")] {
        let ended = quintile().call(["ccd", &one, second]);
        assert_eq!(ended.code, Some(2), "{}", ended.stderr);
        for says in [&one, second, says] {
            assert!(ended.stderr.contains(says), "{says}: {}", ended.stderr);
        }
        assert!(ended.stdout.is_empty());
    }
}

#[test]
fn meshes_of_different_topology_are_refused() {
    let inputs = Inputs::new();
    let corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
    let whole = inputs.put("whole.obj", format!("{corners}f 1 2 3\n"));
    let more = inputs.put("more.obj", format!("{corners}v 5 5 5\nf 1 2 3\n"));
    let [none, other] = ["none.obj", "other.obj"].map(|name| inputs.put(name, corners));
    let header = "element vertex 1\nproperty float x\nproperty float y\nproperty float z\nelement face 0";
    let empty = format!(
        "ply\nformat ascii 1.0\n{header}\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n"
    );
    let [hollow, bare] = ["hollow.ply", "bare.ply"].map(|name| inputs.put(name, &empty));
    for (open, close, says) in [
        (&whole, &more, [more.as_str(), "4 vertices"]),
        (&none, &other, [none.as_str(), "it has none"]),
        (&hollow, &bare, [hollow.as_str(), "it has none"]),
        (&whole, &none, [none.as_str(), "it has none"]),
    ] {
        let ended = quintile().call(["ccd", open, close]);
        assert_eq!(ended.code, Some(1), "{}", ended.stderr);
        assert!(says.iter().all(|says| ended.stderr.contains(says)), "{says:?}: {}", ended.stderr);
    }
}

/// Copies of one triangle: every pair touches everywhere, and no image separates them.
#[test]
fn coincident_triangles_are_reported_at_once() {
    let inputs = Inputs::new();
    let copies = 200;
    let corners = "v 0 0 0\nv 1 0 0.1\nv 0.1 1 0\n".repeat(copies);
    let faces: String =
        (0..copies).map(|n| format!("f {} {} {}\n", 3 * n + 1, 3 * n + 2, 3 * n + 3)).collect();
    let [open, close] = ["open.obj", "close.obj"].map(|name| inputs.put(name, format!("{corners}{faces}")));
    let ended = quintile().call(["ccd", &open, &close, "--csv", "-"]);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    let rows: Vec<&str> = ended.stdout.lines().skip(1).collect();
    assert_eq!(rows.len(), copies * (copies - 1) / 2);
    assert!(rows.iter().all(|row| row.ends_with(",1")));
}
