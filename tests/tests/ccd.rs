//! `quintile ccd`: the pairs of a file that may collide, as a table, as JSON and as CSV.

use tests::{Inputs, quintile};

/// A triangle at rest, one that falls through it, and one far off, as `.mts` of 8-byte scalars.
fn mts() -> Vec<u8> {
    let floor = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let at = |x: f64, z: f64| [[x, 0.2, z], [x + 0.1, 0.2, z + 0.1], [x, 0.3, z + 0.1]];
    let objects: [[[[f64; 3]; 3]; 2]; 3] =
        [[floor; 2], [at(0.2, 1.0), at(0.2, -1.0)], [at(9.0, 1.0), at(9.0, -1.0)]];
    let mut data = b"MTS1".to_vec();
    [8_u32, 3, 0].iter().for_each(|word| data.extend(word.to_le_bytes()));
    objects.iter().for_each(|_| [3_u32, 1].iter().for_each(|word| data.extend(word.to_le_bytes())));
    for ends in objects {
        ends.as_flattened().as_flattened().iter().for_each(|number| data.extend(number.to_le_bytes()));
        [0_u32, 1, 2].iter().for_each(|index| data.extend(index.to_le_bytes()));
    }
    data
}

#[test]
fn pairs_come_as_csv_and_json_the_same_for_any_threads() {
    let inputs = Inputs::new();
    let file = inputs.put("fall.mts", mts());
    let mut seen = Vec::new();
    for threads in ["1", "2", "16"] {
        let csv = inputs.path("pairs.csv");
        let ended = quintile!().call(["ccd", &file, "--csv", &csv, "--json", "--threads", threads]);
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
fn what_cannot_be_is_told() {
    let inputs = Inputs::new();
    let (good, cut) = (inputs.put("good.mts", mts()), inputs.put("cut.mts", &mts()[..100]));
    let alone = inputs.put("alone.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let cases: [(&[&str], i32, &str); 5] = [
        (&[&good, "--resolution", "0"], 2, "1..=1024"),
        (&[&good, "--method", "guess"], 2, "fragment-box"),
        (&[&good, "--csv", &good], 2, "name another file"),
        (&[&cut], 1, "cut.mts"),
        (&[&alone], 2, "two by two"),
    ];
    for (args, code, says) in cases {
        let ended = quintile!().call(["ccd"].iter().chain(args));
        assert_eq!(ended.code, Some(code), "{args:?}: {}", ended.stderr);
        assert!(ended.stderr.contains(says), "{args:?}: {}", ended.stderr);
    }
    assert!(std::fs::read(&good).is_ok_and(|bytes| bytes == mts()));
}
