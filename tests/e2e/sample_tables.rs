//! Sample tables by name, by description and in a file; and heat maps.

use std::fs;
use std::path::Path;

use crate::support::quintile;

fn text(path: &Path) -> String {
    path.display().to_string()
}

#[test]
fn a_table_written_to_a_file_gives_the_image_it_came_from() {
    let folder = tempfile::tempdir().unwrap();
    let file = text(&folder.path().join("mine.smp"));
    for table in ["owen", "jittered"] {
        let ended = quintile().call([
            "samples",
            table,
            "--samples",
            "4",
            "--size",
            "64x48",
            "--out",
            &file,
            "--json",
        ]);
        assert_eq!(ended.code, Some(0), "{}", ended.stderr);
        let written: serde_json::Value = serde_json::from_str(&ended.stdout).unwrap();
        assert_eq!(written["samples"], 64 * 48 * 4);
        let image = |table: &str| {
            let results = quintile().run("tiny", &["--frames", "1..2", "--table", table]);
            fs::read(results.path("images/frame_0001.png")).unwrap()
        };
        assert!(image(table) == image(&file), "{table}: the file draws another image");
        assert!(image(table) != image("random"), "{table} draws what random draws");
    }
}

#[test]
fn a_file_decides_how_many_samples_there_are() {
    let folder = tempfile::tempdir().unwrap();
    let file = text(&folder.path().join("nine.smp"));
    let ended = quintile().call(["samples", "random", "--samples", "9", "--out", &file]);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    let results = quintile().run("tiny", &["--frames", "0..1", "--table", &file]);
    assert_eq!(results.summary()["settings"]["samples"], 9);
    let out = text(&folder.path().join("out"));
    let ended = quintile().call(["run", "tiny", "--table", &file, "--samples", "8", "--out", &out]);
    assert_eq!(ended.code, Some(2));
    assert!(ended.stderr.contains("9 samples per pixel, not 8"), "{}", ended.stderr);
}

#[test]
fn a_scene_names_a_table_beside_it() {
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("s.ron");
    let body = "settings: (width: 32, height: 16, samples: 4, lens_radius: 0.2, frames: (0, 1), table: \"t.ron\"), \
                objects: [(shape: Sphere(radius: 1))]";
    fs::write(&scene, format!("({body})")).unwrap();
    let out = text(&folder.path().join("out"));
    let call = |table: &str| {
        fs::write(folder.path().join("t.ron"), table).unwrap();
        quintile().call(["run", &text(&scene), "--out", &out])
    };
    assert_eq!(call("(pattern: Jittered, lens: Polygon(blades: 5))").code, Some(0));
    let ended = call("(\n  pattern: Jitterd,\n)");
    assert_eq!(ended.code, Some(2));
    assert!(ended.stderr.contains("t.ron:2:") && ended.stderr.contains("`Jittered`"), "{}", ended.stderr);
    let ended = call("(regions: Across(3))");
    assert_eq!(ended.code, Some(2));
    assert!(ended.stderr.contains("take a multiple of 3"), "{}", ended.stderr);
}

#[test]
fn heat_maps_add_up_to_the_counters() {
    let events = ["samples_tested", "tiles_visited", "dram_write_bytes"];
    let args: Vec<&str> = events.iter().flat_map(|event| ["--heat", event]).collect();
    let results = quintile().run("tiny", &[&["--frames", "0..2"], &args[..]].concat());
    let (mut report, summary) = (0, results.summary());
    for event in events {
        let mut placed = 0;
        for frame in 0..2 {
            let file = |end: &str| results.path(&format!("heat/{event}_{frame:04}.{end}"));
            let csv = fs::read_to_string(file("csv")).unwrap();
            let count = |row: &str| row.rsplit(',').next().unwrap().parse::<u64>().unwrap();
            placed += csv.lines().skip(1).map(count).sum::<u64>();
            assert_eq!(image::open(file("exr")).unwrap().width(), 64);
            assert!(image::open(file("png")).unwrap().width() >= 760);
        }
        let counted = summary["counts"][event].as_u64().unwrap();
        // The caches are written back at the end, at no position in the image.
        let all_placed = event != "dram_write_bytes";
        assert!(
            if all_placed { placed == counted } else { placed < counted },
            "{event}: {placed} of {counted}"
        );
        let page = fs::read_to_string(results.path("report.html")).unwrap();
        report += usize::from(page.contains(&format!("{event}_0001.png")));
    }
    assert_eq!(report, events.len(), "the report shows the frame in the middle");
}

/// Joules of pixels are events times energies: those of all tiles and of nowhere add up to the energy of all events.
#[test]
fn heat_maps_of_energy_add_up_to_that_of_the_events() {
    for (name, args) in [("tiny", &[][..]), ("occlusion", &["--size", "64x36", "--frames", "0..1"])] {
        let results = quintile().run(name, &[args, &["--heat", "joules"]].concat());
        let csv = fs::read_to_string(results.path("heat/joules_0000.csv")).unwrap();
        assert!(csv.starts_with("x_px,y_px,width_px,height_px,energy_J\n"), "{csv}");
        let joules = |row: &str| row.rsplit(',').next().unwrap().parse::<f64>().unwrap();
        let placed: f64 = csv.lines().skip(1).map(joules).sum();
        let summary = results.summary();
        let passes = summary["passes"].as_array().unwrap();
        let events: f64 = passes.iter().map(|pass| pass["events_j"].as_f64().unwrap()).sum();
        let frames = summary["frames"].as_array().unwrap().len() as f64;
        assert!(placed > 0.5 * events / frames && placed < events / frames, "{name}: {placed} of {events}");
        let exr = image::open(results.path("heat/joules_0000.exr")).unwrap().to_rgb32f();
        let pixels: f64 = exr.pixels().map(|pixel| f64::from(pixel.0[0])).sum();
        assert!((pixels / placed - 1.0).abs() < 1e-3, "{name}: {pixels} in pixels, {placed} in tiles");
        assert!(results.text("report.html").contains("joules_000"));
    }
}

/// The maps of single passes add up to that of the frame, and each to at most what the summary has for its pass.
#[test]
fn heat_maps_of_passes_add_up_to_that_of_the_frame() {
    let args = ["--size", "48x32", "--samples", "2", "--frames", "0..1", "--heat", "joules"];
    let summary = quintile().run("deferred", &args).summary();
    let passes: Vec<(String, f64)> = summary["passes"]
        .as_array()
        .unwrap()
        .iter()
        .map(|pass| (pass["name"].as_str().unwrap().to_owned(), pass["events_j"].as_f64().unwrap()))
        .filter(|(name, _)| name != "write back")
        .collect();
    assert!(passes.len() > 2, "{passes:?}");
    let requests: Vec<String> = passes.iter().map(|(name, _)| format!("joules@{name}")).collect();
    let more = requests.iter().flat_map(|request| ["--heat", request]);
    let results = quintile().run("deferred", &args.into_iter().chain(more).collect::<Vec<_>>());
    let placed = |file: &str| {
        let csv = results.text(&format!("heat/{file}_0000.csv"));
        csv.lines().skip(1).map(|row| row.rsplit(',').next().unwrap().parse::<f64>().unwrap()).sum::<f64>()
    };
    let mut sum_j = 0.0;
    for (name, events_j) in passes {
        let file = format!("joules_{}", name.replace(|symbol: char| !symbol.is_alphanumeric(), "-"));
        let pass_j = placed(&file);
        assert!(pass_j > 0.0 && pass_j <= events_j * (1.0 + 1e-9), "{name}: {pass_j} of {events_j}");
        sum_j += pass_j;
    }
    assert!((sum_j / placed("joules") - 1.0).abs() < 1e-9, "{sum_j}");
    for more in [&[][..], &["--dry-run"], &["--frames", "3..4"]] {
        let ended = quintile().call([&["run", "tiny", "--heat", "joules@sceen"], more].concat());
        assert_eq!(ended.code, Some(2), "{}", ended.stderr);
        let frame = if more.contains(&"3..4") { 3 } else { 0 };
        let expected = format!("frame {frame} has no such pass; it has `scene`");
        assert!(ended.stderr.contains(&expected), "{}", ended.stderr);
    }
    let ended = quintile().call(["run", "tiny", "--heat", "joules@"]);
    assert!(ended.code == Some(2) && ended.stderr.contains("name a pass after the @"), "{}", ended.stderr);
    let ended = quintile().call(["run", "tiny", "--heat", "joules@a b", "--heat", "joules@a-b"]);
    assert!(ended.code == Some(2) && ended.stderr.contains("are both written to"), "{}", ended.stderr);
}

/// Of a workload, all passes of the size of the image are on one map.
#[test]
fn heat_maps_of_workloads_show_all_passes() {
    let args = ["--size", "48x32", "--samples", "4", "--set", "map_px=32", "--frames", "0..1"];
    let heat = ["--heat", "shader_ops", "--heat", "samples_tested"];
    let results = quintile().run("soft-shadows", &[&args[..], &heat].concat());
    let counts = &results.summary()["counts"];
    let placed = |event: &str| {
        let csv = fs::read_to_string(results.path(&format!("heat/{event}_0000.csv"))).unwrap();
        let count = |row: &str| row.rsplit(',').next().unwrap().parse::<u64>().unwrap();
        (csv.lines().skip(1).map(count).sum::<u64>(), counts[event].as_u64().unwrap())
    };
    let (shaded, all) = placed("shader_ops");
    assert!(shaded > all / 2 && shaded < all, "look-ups without the vertices: {shaded} of {all}");
    let (tested, all) = placed("samples_tested");
    assert!(tested > 0 && tested < all, "the map has another size: {tested} of {all}");
}

#[test]
fn counters_without_a_position_are_refused() {
    for (counter, message) in [("draws", "before it is known where"), ("samples_testd", "`samples_tested`")] {
        let ended = quintile().call(["run", "tiny", "--heat", counter]);
        assert_eq!(ended.code, Some(2));
        assert!(ended.stderr.contains(message), "{}", ended.stderr);
    }
}
