//! The git revision that the program is built from, in release builds within a clone; and what there is to
//! test with: real scenes, Slurm, packages of Python.

use std::path::Path;
use std::process::Command;

/// Sources of the program, from the root of the repository. A change of these builds the program anew anyway,
/// so that asking git costs nothing more.
const SOURCES: [&str; 25] = [
    "Cargo.toml",
    "Cargo.lock",
    "pipeline/src",
    "pipeline/activity/src",
    "power-model/platforms",
    "power-model/src",
    "power-model/tables",
    "sim/experiments/assets",
    "sim/experiments/papers",
    "sim/experiments/parts",
    "sim/experiments/src",
    "sim/output/assets",
    "sim/output/src",
    "sim/run/gpus",
    "sim/run/src",
    "sim/run/stated_errors.csv",
    "sim/src",
    "sim/sweep/assets",
    "sim/sweep/src",
    "sim/timing/src",
    "sim/warnings/src",
    "traces/jls/src",
    "traces/src",
    "workloads/scenes",
    "workloads/src",
];

fn main() {
    // Tests on real scenes count as ignored where there are none.
    println!("cargo:rerun-if-env-changed=QUINTILE_SCENES");
    println!(
        "cargo:rustc-check-cfg=cfg(real_scenes, collision_data, superuser, may_mount, slurm, ray, readers, optuna)"
    );
    if let Some(scenes) = std::env::var_os("QUINTILE_SCENES") {
        println!("cargo:rustc-cfg=real_scenes");
        if Path::new(&scenes).join("../ccd").is_dir() {
            println!("cargo:rustc-cfg=collision_data");
        }
    }
    if has_slurm() {
        println!("cargo:rustc-cfg=slurm");
    }
    let packages = python_packages();
    let has = |names: &[&str]| names.iter().all(|name| packages.iter().any(|package| package == name));
    for (cfg, names) in [
        ("ray", &["ray"][..]),
        ("optuna", &["optuna"]),
        ("readers", &["pandas", "pyarrow", "polars", "duckdb"]),
    ] {
        if has(names) {
            println!("cargo:rustc-cfg={cfg}");
        }
    }
    if may_write_anywhere() {
        println!("cargo:rustc-cfg=superuser");
    }
    if may_mount() {
        println!("cargo:rustc-cfg=may_mount");
    }
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    if std::env::var("PROFILE").is_ok_and(|profile| profile == "release") {
        SOURCES.iter().for_each(|source| println!("cargo:rerun-if-changed={}", root.join(source).display()));
        revision(&root).iter().for_each(|revision| println!("cargo:rustc-env=QUINTILE_REVISION={revision}"));
    } else {
        println!("cargo:rerun-if-changed=build.rs");
    }
}

/// Whether a cluster of Slurm can be started here; tests of it count as ignored otherwise.
fn has_slurm() -> bool {
    // Its package puts the daemons there, which changes the folder.
    let folder = Path::new("/usr/sbin");
    if folder.is_dir() {
        println!("cargo:rerun-if-changed={}", folder.display());
    }
    ["slurmctld", "slurmd", "munged"].iter().all(|daemon| folder.join(daemon).is_file())
}

/// Packages of Python that tests need and that are there.
fn python_packages() -> Vec<String> {
    println!("cargo:rerun-if-env-changed=QUINTILE_PYTHON");
    let python = std::env::var("QUINTILE_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let find =
        "import sys, importlib.util as u; print(*[name for name in sys.argv[1:] if u.find_spec(name)])";
    let names = ["ray", "optuna", "pandas", "pyarrow", "polars", "duckdb"];
    let found = Command::new(python).args(["-c", find]).args(names).output();
    let text = found.map(|found| String::from_utf8_lossy(&found.stdout).into_owned()).unwrap_or_default();
    text.split_whitespace().map(str::to_owned).collect()
}

/// Whether permissions of folders do not hold for this user; tests of them then count as ignored.
fn may_write_anywhere() -> bool {
    #[cfg(unix)]
    return std::fs::metadata("/proc/self").is_ok_and(|this| std::os::unix::fs::MetadataExt::uid(&this) == 0);
    #[cfg(not(unix))]
    return false;
}

/// Whether this user may mount file systems (`CAP_SYS_ADMIN`); tests of a full disk count as ignored otherwise.
fn may_mount() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let capabilities = status.lines().find_map(|line| line.strip_prefix("CapEff:"));
    let mask = capabilities.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0);
    mask >> 21 & 1 == 1
}

/// The revision, with `+changes` where the sources are not quite its.
fn revision(root: &Path) -> Option<String> {
    let git = |arguments: &[&str]| {
        let output = Command::new("git").arg("-C").arg(root).args(arguments).output().ok()?;
        let text = String::from_utf8(output.stdout).ok()?;
        output.status.success().then(|| text.trim().to_owned())
    };
    // An archive may lie in the clone of something else.
    git(&["ls-files", "--error-unmatch", "sim/build.rs"])?;
    let revision = git(&["rev-parse", "--short=12", "HEAD"])?;
    let changes = git(&[&["status", "--porcelain", "--"], &SOURCES[..]].concat())?;
    Some(if changes.is_empty() { revision } else { revision + "+changes" })
}
