//! Programs in Python: the driver for Ray, and readers of the table. The variable `QUINTILE_PYTHON` names the
//! interpreter.

use std::fs;
use std::path::Path;
use std::process::Command;

use serde_json::{Value, json};

use super::{SWEEP, merged, point_files, run_all};
use crate::support::{Inputs, root};

/// Standard output of `script` of this repository with `args`, which ends with `code`.
fn python(script: &str, args: &[&str], code: i32) -> String {
    let program = std::env::var("QUINTILE_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let ended = Command::new(program).arg(root().join(script)).args(args).output().unwrap();
    let stderr = String::from_utf8_lossy(&ended.stderr);
    assert_eq!(ended.status.code(), Some(code), "{script} {args:?}: {stderr}");
    String::from_utf8(ended.stdout).unwrap()
}

#[test]
#[cfg_attr(not(ray), ignore = "Python has no package `ray`; QUINTILE_PYTHON names another interpreter")]
fn ray_merges_to_the_bytes_of_a_local_run() {
    let inputs = Inputs::new();
    let file = inputs.put("tiles.ron", SWEEP);
    let [local, out] = ["local", "out"].map(|name| inputs.path(name));
    let driver = "sim/sweep/drivers/ray_sweep.py";
    let program = env!("CARGO_BIN_EXE_quintile");
    python(driver, &[&file, "--out", &out, "--shards", "3", "--quintile", program], 1);
    assert_eq!(point_files(&out).len(), 4);
    let table = fs::read(Path::new(&out).join("results.parquet")).unwrap();
    run_all(&file, &local);
    assert!(table == merged(&local));
}

#[test]
#[cfg_attr(not(optuna), ignore = "Python has no package `optuna`; QUINTILE_PYTHON names another interpreter")]
fn a_search_is_compared_with_random_points_and_with_all() {
    let inputs = Inputs::new();
    let file = inputs.put(
        "space.ron",
        r#"(
            name: "space",
            settings: {"scene": "tiny", "frames": (0, 1), "size": (16, 12), "samples": 1},
            axes: [
                Range(path: "gpu.core_hz", from: 100e6, to: 800e6, step: 2, log: true),
                Values(path: "gpu.units.dram.channels", values: [1, 2, 4]),
                Values(path: "gpu.units.shader.cores", values: [1, 2, 4]),
            ],
        )"#,
    );
    let out = inputs.path("out");
    let arguments =
        [&*file, "--out", &out, "--points", "12", "--truth", "--quintile", env!("CARGO_BIN_EXE_quintile")];
    let driver = "sim/sweep/drivers/optuna_sweep.py";
    let found: Value = serde_json::from_str(&python(driver, &arguments, 0)).unwrap();
    assert_eq!(found["all"], json!({"points": 36, "hypervolume": 1.0}));
    for method in ["nsga2", "random"] {
        let share = found[method]["hypervolume"].as_f64().unwrap();
        assert!(share > 0.0 && share <= 1.0, "{found}");
        assert!((1..=12).contains(&found[method]["points"].as_u64().unwrap()), "{found}");
    }
    assert_eq!(point_files(&out).len(), 36);
    // The search is a sweep as any other.
    assert!(!merged(&out).is_empty());
    assert_eq!(found, serde_json::from_str::<Value>(&python(driver, &arguments, 0)).unwrap(), "by its seed");
}

#[test]
#[cfg_attr(
    not(readers),
    ignore = "Python lacks one of pandas, pyarrow, polars and duckdb; QUINTILE_PYTHON names another interpreter"
)]
fn pandas_polars_and_duckdb_read_types_nulls_and_the_order_of_rows() {
    let inputs = Inputs::new();
    let flags = "axes: [Values(path: \"gpu.pipeline.features.z_max\", values: [true, false]), ";
    let file = inputs.put("tiles.ron", SWEEP.replace("axes: [", flags));
    let out = inputs.path("out");
    run_all(&file, &out);
    merged(&out);
    let table = Path::new(&out).join("results.parquet").display().to_string();
    let plan = fs::read_to_string(Path::new(&out).join("plan.jsonl")).unwrap();
    let points = plan.lines().skip(1).map(|line| serde_json::from_str::<Value>(line).unwrap()["id"].clone());
    let ids: Vec<Value> = points.collect();
    for reader in ["pandas", "polars", "duckdb"] {
        let read: Value =
            serde_json::from_str(&python("tests/e2e/sweep/readers.py", &[reader, &table], 0)).unwrap();
        let kind = |column: &str| read["kinds"][column].as_str().unwrap_or_else(|| panic!("{column}"));
        let wholes = ["gpu.pipeline.tile_px", "cycles", "dram_bytes", "seed", "count.samples_tested"];
        let numbers = ["busy_ms", "frame_mJ", "energy_per_pixel_nJ"];
        let texts = ["id", "scene", "timing", "error", "accuracy_warnings"];
        assert!(wholes.iter().all(|column| kind(column) == "whole"), "{reader}: {read}");
        assert!(numbers.iter().all(|column| kind(column) == "number"), "{reader}: {read}");
        assert!(texts.iter().all(|column| kind(column) == "text"), "{reader}: {read}");
        assert_eq!(kind("gpu.pipeline.features.z_max"), "flag", "{reader}");
        let column = |name: &str| &read["values"][name];
        assert_eq!(*column("id"), Value::from(ids.clone()), "{reader}");
        assert_eq!(*column("gpu.pipeline.tile_px"), json!([4, 4, 8, 8, 4, 4, 8, 8]), "{reader}");
        assert_eq!(
            *column("gpu.pipeline.features.z_max"),
            json!([true, true, true, true, false, false, false, false]),
            "{reader}"
        );
        // A tile of 8 pixels does not fit into a coarse tile of 4.
        for name in ["cycles", "busy_ms", "count.samples_tested", "error"] {
            let is_null: Vec<bool> = (0..8).map(|row| column(name)[row].is_null()).collect();
            let fails = [false, false, true, false, false, false, true, false];
            assert_eq!(is_null, fails.map(|fails| fails != (name == "error")), "{reader}: {name}");
        }
    }
}
