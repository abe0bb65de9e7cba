//! `run --set path=value`: values in the files of GPU, platform, energy table and scene.

use std::fs;

use crate::support::{Inputs, Results, quintile, root};

const TINY: [&str; 2] = ["--frames", "0..1"];

fn run(scene: &str, args: &[&str]) -> Results {
    quintile().run(scene, &[&TINY, args].concat())
}

/// Keys of the summary that do not depend on how a value was given.
fn numbers(results: &Results) -> Vec<serde_json::Value> {
    let summary = results.summary();
    ["truth", "counts", "frames", "energy_by_part_j"].map(|key| summary[key].clone()).into()
}

#[test]
fn a_changed_file_is_written_and_gives_the_same_run() {
    let set = [
        "gpu.pipeline.tile_px=4",
        "gpu.core_hz=200e6",
        "platform.v_v=0.85",
        "table.rows.draws.nominal_pj=700",
    ];
    let sets: Vec<&str> = set.iter().flat_map(|set| ["--set", set]).collect();
    let (plain, changed) = (run("tiny", &[]), run("tiny", &sets));
    assert_ne!(numbers(&plain), numbers(&changed));
    let file = |name: &str| changed.folder().join("inputs").join(name).display().to_string();
    let [gpu, platform, table] = ["gpu.ron", "platform.ron", "table.ron"].map(file);
    let text = fs::read_to_string(&gpu).unwrap();
    assert!(
        text.starts_with("// reference, changed by --set gpu.pipeline.tile_px=4, gpu.core_hz=200e6\n"),
        "{text}"
    );
    assert!(text.contains("tile_px: 4,") && text.contains("core_hz: 200e6,"), "{text}");
    let again = run("tiny", &["--gpu", &gpu, "--platform", &platform, "--energy", &table]);
    assert_eq!(numbers(&again), numbers(&changed));
    assert!(!plain.folder().join("inputs").exists());
    // By the summary, too.
    let out = Inputs::new();
    let summary = changed.folder().join("summary.json").display().to_string();
    let ended = quintile().call(["run", "--again", &summary, "--out", &out.path("again")]);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    assert_eq!(numbers(&Results::in_folder(out.path("again").as_ref(), ended)), numbers(&changed));
}

#[test]
fn a_scene_file_is_changed_and_its_meshes_are_found() {
    let inputs = Inputs::new();
    inputs.put("a.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
    let scene = inputs.put(
        "scene.ron",
        "(settings: (width: 32, height: 24, frames: (0, 1)), objects: [(name: \"a\", file: \"a.off\")])",
    );
    let sets = ["--set", "scene.settings.samples=2", "--set", "scene.objects.a.velocity=(3, 0, 0)"];
    let changed = run(&scene, &sets);
    assert_eq!(changed.summary()["settings"]["samples"], 2);
    let copy = changed.folder().join("inputs/scene.ron").display().to_string();
    assert_eq!(numbers(&run(&copy, &[])), numbers(&changed));
    assert_ne!(numbers(&run(&scene, &sets[..2])), numbers(&changed));
}

#[test]
fn wrong_paths_and_values_are_refused_by_name() {
    let scene = root().join("workloads/scenes/carousel.ron").display().to_string();
    for (scene, set, says) in [
        ("tiny", "gpu.pipeline.tile_pix=8", "unknown field `tile_pix`, did you mean `tile_px`?"),
        ("tiny", "gpu.pipline.tile_px=8", "unknown field `pipline`, did you mean `pipeline`?"),
        ("tiny", "gpu.pipeline.tile_px=abc", "`tile_px`: "),
        ("tiny", "gpu.pipeline.tile_px=7", "`pipeline`: "),
        ("tiny", "gpu.pipeline.tile_px=8, batch_triangles: 1", "is not one value"),
        ("tiny", "gpu.core_hz.x=8", "`core_hz` is a single value"),
        ("tiny", "gpu.core_hz=1", "a clock has to be 1e6 to 1e11 hertz"),
        ("tiny", "platform.units.shade.idle_unit_w=1", "did you mean `shader`?"),
        ("tiny", "platform.v_v=99", "99 V is not a number from 0.1 to 48 V"),
        ("tiny", "table.rows.draws.nominal_pj=-1", "-1 pJ is not a number"),
        ("deferred", "light=3", "--set light=3: unknown option `light`"),
        ("tiny", "gpo.core_hz=1", "did you mean `gpu.core_hz`?"),
        ("tiny", "scene.objects.0.velocity=(1, 0, 0)", "is not a scene in a .ron file"),
        (&scene, "scene.setings.samples=2", "unknown field `setings`, did you mean `settings`?"),
        (&scene, "scene.settings.samples=0", "samples"),
    ] {
        let out = Inputs::new();
        let ended = quintile().call(["run", scene, "--set", set, "--out", &out.path("out")]);
        assert_eq!(ended.code, Some(2), "{set}: {}", ended.stderr);
        let path = set.split('=').next().unwrap();
        assert!(
            ended.stderr.contains(&format!("--set {path}")) && ended.stderr.contains(says),
            "{set}: {}",
            ended.stderr
        );
        assert!(!ended.stderr.contains(".ron:"), "{}", ended.stderr);
    }
}

#[test]
fn options_of_a_scene_and_several_gpus_are_refused_by_flag() {
    let inputs = Inputs::new();
    let (file, out) = (inputs.put("options.ron", "(bins: 8)"), inputs.path("out"));
    for (args, says) in [
        (["run", "tiny", "--options", &file], "--options: `tiny` is a scene"),
        (["run", "tiny", "--gpu", "reference,mobile"], "--set gpu=reference,mobile"),
        (["record", "tiny", "--gpu", "a.ron,b.ron"], "`quintile sweep`"),
    ] {
        let ended = quintile().call(args.iter().chain(&["--out", &out]));
        assert!(ended.code == Some(2) && ended.stderr.contains(says), "{}", ended.stderr);
    }
}

#[test]
fn a_file_in_the_way_of_the_second_of_several_runs_is_refused_before_the_first() {
    let inputs = Inputs::new();
    let out = inputs.path("out");
    fs::create_dir_all(inputs.path("out/seed=2")).unwrap();
    let mine = inputs.put("out/seed=2/summary.json", "mine");
    let call = || quintile().call(["run", "tiny", "--set", "seed=1,2", "--frames", "0..1", "--out", &out]);
    let ended = call();
    assert!(ended.code == Some(2) && ended.stderr.contains(&mine), "{}", ended.stderr);
    assert!(!std::path::Path::new(&inputs.path("out/seed=1")).exists());
    assert_eq!(fs::read(&mine).unwrap(), b"mine");
    fs::remove_file(&mine).unwrap();
    assert_eq!(call().code, Some(0));
}

#[test]
fn several_values_are_several_runs_that_a_table_compares() {
    let inputs = Inputs::new();
    let out = inputs.path("out");
    let sets = ["--set", "gpu.pipeline.tile_px=4,8", "--set", "samples=2", "--set", "workload.bins=4"];
    let ended = quintile().call(["run", "tiny", "--out", &out].iter().chain(&TINY).chain(&sets[..4]));
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    let table: Vec<&str> = ended.stdout.lines().rev().take(3).collect();
    assert!(table[2].contains("gpu.pipeline.tile_px") && table[2].contains("busy time"), "{table:?}");
    assert!(table[1].contains("1.0000") && !table[0].contains(" 1.0000"), "{table:?}");
    for value in ["4", "8"] {
        let alone = run("tiny", &["--set", &format!("gpu.pipeline.tile_px={value}"), "--set", "samples=2"]);
        let folder = std::path::Path::new(&out).join(format!("gpu.pipeline.tile_px={value}"));
        assert_eq!(numbers(&Results::in_folder(&folder, ended.clone())), numbers(&alone));
    }
    // As JSON they are a list.
    let json = quintile()
        .call(["run", "tiny", "--json", "--out", &inputs.path("json")].iter().chain(&TINY).chain(&sets[..4]));
    let list: serde_json::Value = serde_json::from_str(&json.stdout).unwrap();
    let folders: Vec<&str> =
        list.as_array().unwrap().iter().map(|run| run["out"].as_str().unwrap()).collect();
    assert!(folders.len() == 2 && folders[1].ends_with("gpu.pipeline.tile_px=8"), "{folders:?}");
    // Nothing is run if one value is wrong, or belongs to something else.
    for wrong in [&["--set", "gpu.pipeline.tile_px=4,7"][..], &sets] {
        let new = inputs.path("new");
        let ended = quintile().call(["run", "tiny", "--out", &new].iter().chain(&TINY).chain(wrong));
        assert_eq!(ended.code, Some(2), "{}", ended.stderr);
        assert!(!std::path::Path::new(&new).exists());
    }
}
