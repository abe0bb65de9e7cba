//! Layering: allowed dependencies between crates and between modules, and rules of every crate.

mod modules;
mod opened;
mod packets;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use crate::support::{Inputs, root};
use cargo_metadata::{Metadata, MetadataCommand};

/// Workspace crates that each crate may use, in builds and in tests.
const ARROWS: [(&str, &[&str]); 13] = [
    ("warnings", &[]),
    ("activity", &[]),
    ("pipeline", &["activity"]),
    ("workloads", &["activity", "pipeline", "warnings"]),
    ("jls", &[]),
    ("traces", &["jls", "warnings"]),
    ("power-model", &["activity", "traces", "warnings"]),
    ("timing", &["activity", "warnings"]),
    ("output", &["activity", "pipeline", "power-model", "traces", "warnings"]),
    ("run", &["activity", "output", "pipeline", "power-model", "timing", "traces", "warnings", "workloads"]),
    ("experiments", BELOW_EXPERIMENTS),
    ("sweep", BELOW_SWEEP),
    ("sim", &BELOW_COMMAND),
];

/// Crates below the experiments.
const BELOW_EXPERIMENTS: &[&str] =
    &["activity", "output", "pipeline", "power-model", "run", "timing", "traces", "warnings", "workloads"];

/// Crates below the sweeps.
const BELOW_SWEEP: &[&str] =
    &["activity", "output", "pipeline", "power-model", "run", "timing", "traces", "workloads"];

/// Crates below the command.
const BELOW_COMMAND: [&str; 11] = [
    "activity",
    "experiments",
    "output",
    "pipeline",
    "power-model",
    "run",
    "sweep",
    "timing",
    "traces",
    "warnings",
    "workloads",
];

fn workspace() -> Metadata {
    let mut command = MetadataCommand::new();
    command.manifest_path(root().join("Cargo.toml")).no_deps().exec().expect("cargo metadata answers")
}

/// Workspace crates that each crate uses.
fn arrows() -> BTreeMap<String, BTreeSet<String>> {
    let metadata = workspace();
    let packages = metadata.workspace_packages();
    let names: BTreeSet<String> = packages.iter().map(|package| package.name.to_string()).collect();
    let uses = |package: &cargo_metadata::Package| {
        let used = package.dependencies.iter().map(|dependency| dependency.name.clone());
        used.filter(|name| names.contains(name)).collect()
    };
    packages.iter().map(|package| (package.name.to_string(), uses(package))).collect()
}

#[test]
fn crates_use_only_allowed_crates() {
    let arrows = arrows();
    for (name, allowed) in ARROWS {
        let allowed: BTreeSet<String> = allowed.iter().map(|name| (*name).to_owned()).collect();
        let against: Vec<_> = arrows[name].difference(&allowed).collect();
        assert!(against.is_empty(), "{name} must not use {against:?}");
    }
    let known: BTreeSet<&str> = ARROWS.iter().map(|(name, _)| *name).collect();
    let found: BTreeSet<&str> = arrows.keys().map(String::as_str).collect();
    assert_eq!(found, known, "a new crate needs its place in the arrows");
}

/// Every counted event comes from the pipeline: workloads, runs and experiments say what their code did, and
/// make no packets.
#[test]
fn packets_are_built_in_the_pipeline_alone() {
    let above = ["workloads/src", "sim/run/src", "sim/experiments/src", "sim/sweep/src", "sim/src"];
    let files: Vec<PathBuf> = above.iter().flat_map(|folder| rust_files(&root().join(folder))).collect();
    assert!(files.len() > 150, "{} files", files.len());
    let found = files.iter().flat_map(|file| {
        let found = packets::made(&fs::read_to_string(file).expect("a source file"));
        found.into_iter().map(|what| format!("{}: {what}", file.display())).collect::<Vec<_>>()
    });
    let found: Vec<String> = found.collect();
    assert!(found.is_empty(), "{}", found.join("\n"));
    // The clocks are tested and measured with synthetic streams.
    let timing = rust_files(&root().join("sim/timing/src"));
    let builds = |file: &&PathBuf| fs::read_to_string(file).expect("a source file").contains("Packet::new");
    let found: Vec<_> = timing.iter().filter(builds).filter_map(|file| file.file_name()).collect();
    assert_eq!(found, ["streams.rs"]);
}

/// All ways to a packet of one's own are found: from nothing, from another one, by a copy that is changed,
/// and after test modules.
#[test]
fn packets_made_of_others_and_after_tests_are_found() {
    for code in [
        "fn f() { emit(&Packet::new(kind, 0)) }",
        "fn f(first: &Packet) { emit(&Packet { batch: 2, ..*first }) }",
        "fn f(first: &Packet) { let mut copy = *first; copy.counts[Event::Draws] += 7; emit(&copy) }",
        "fn f(first: &Packet) { let mut copy = *first; copy.counts = of; emit(&copy) }",
        "fn f(first: &Packet) { let mut copy = first.clone(); copy.triangle = 3; emit(&copy) }",
        "fn f(first: &Packet) { let mut copy = *first; change(&mut copy.counts[Event::Draws]) }",
        "fn f(first: &Packet) { let mut copy = *first; copy.counts += &other.counts; emit(&copy) }",
        "fn f(first: &Packet) { let mut copy = first.clone(); change(&mut copy.counts); emit(&copy) }",
        "fn f(packet: &mut Packet) { fill(packet) }",
        "fn f() { vec![Packet { batch: 2, ..first }] }",
        "use activity::{Event, Packet as Work};",
        "type Work = activity::Packet;",
        "trait Fill { fn fill(&mut self); } impl Fill for Packet { fn fill(&mut self) { self.pass = 1 } }",
        "fn f(counts: &mut PacketCounts) {}",
    ] {
        assert!(!packets::made(code).is_empty(), "{code}");
        let behind = format!("#[cfg(test)] mod tests {{ fn g() {{}} }} {code}");
        assert!(!packets::made(&behind).is_empty(), "{behind}");
        let tested = format!("#[cfg(test)] mod tests {{ {code} }} fn g() {{}}");
        assert!(packets::made(&tested).is_empty(), "{tested}");
    }
    let reads = "fn f(p: &Packet) { sum.counts += &p.counts; self.pass = 1; seen(p.tile, p.draw != Packet::NONE, Level::Packet) }";
    assert!(packets::made(reads).is_empty(), "{:?}", packets::made(reads));
}

#[test]
fn documented_dependencies_exist() {
    let arrows = arrows();
    let drawn = [
        ("workloads", "pipeline"),
        ("pipeline", "activity"),
        ("power-model", "activity"),
        ("power-model", "traces"),
        ("traces", "jls"),
    ];
    let of_run = ARROWS[9].1.iter().map(|used| ("run", *used));
    for (name, used) in drawn.into_iter().chain(of_run) {
        assert!(arrows[name].contains(used), "{name} is to use {used}");
    }
}

#[test]
fn modules_have_no_circular_dependencies() {
    let mut circles = Vec::new();
    for package in workspace().workspace_packages() {
        let found = modules::circles(&package.manifest_path.as_std_path().with_file_name("src"));
        circles.extend(found.into_iter().map(|circle| format!("{}: {circle}", package.name)));
    }
    assert!(circles.is_empty(), "{}", circles.join("\n"));
}

#[test]
fn circles_are_found_through_imports_paths_parents_macros_and_attributes() {
    let crate_of = |files: &[(&str, &str)]| {
        let inputs = Inputs::new();
        for (name, text) in files {
            inputs.put(name, text);
        }
        modules::circles(Path::new(&inputs.path("")))
    };
    let root = ("lib.rs", "mod a;\nmod b;\nmod c;\npub use b::Two;\n");
    let [two, three] = [("b.rs", "pub struct Two;"), ("c.rs", "use crate::Two;\npub fn three(_: Two) {}")];
    assert!(crate_of(&[root, ("a.rs", "use crate::c::three;"), two, three]).is_empty());
    let tests = "#[cfg(test)]\nmod tests { use crate::c::three; }\npub struct Two;";
    assert!(crate_of(&[root, ("a.rs", ""), ("b.rs", tests), three]).is_empty());
    for back in [
        "use crate::c::three;\npub struct Two;",
        "pub struct Two;\nfn f() { super::c::three(Two) }",
        "pub struct Two;\nfn f() { println!(\"{:?}\", [super::c::three(Two)]) }",
        "#[error(\"{three}\", three = super::c::three(Two))]\npub struct Two;",
    ] {
        assert_eq!(crate_of(&[root, ("a.rs", ""), ("b.rs", back), three]), ["::{b, c}"]);
    }
}

#[test]
fn every_crate_takes_the_lints_of_the_workspace() {
    for package in workspace().workspace_packages() {
        let manifest = fs::read_to_string(&package.manifest_path).expect("a manifest");
        let table = manifest.split("\n[").find(|table| table.starts_with("lints]"));
        let shared = table.is_some_and(|table| table.lines().any(|line| line.trim() == "workspace = true"));
        assert!(shared, "{}: `[lints] workspace = true` is missing", package.manifest_path);
    }
}

#[test]
fn only_sim_ends_the_process() {
    let ways = ["process::exit", "process::abort", "ExitCode"];
    for package in
        workspace().workspace_packages().into_iter().filter(|package| package.name.as_str() != "sim")
    {
        let sources = package.manifest_path.as_std_path().with_file_name("src");
        for file in rust_files(&sources) {
            let text = fs::read_to_string(&file).expect("a source file");
            for way in ways {
                assert!(!text.contains(way), "{}: {way} belongs in `sim`", file.display());
            }
        }
    }
}

/// Inputs of a run are recorded where they are opened; no other place opens files there.
#[test]
fn inputs_are_opened_in_one_place() {
    let opener = Path::new("pipeline/activity/src/inputs.rs");
    for name in ["pipeline/activity", "pipeline", "workloads", "power-model"] {
        for file in rust_files(&root().join(name).join("src")).iter().filter(|file| !file.ends_with(opener)) {
            let found = opened::opened(&fs::read_to_string(file).expect("a source file"));
            assert!(found.is_empty(), "{}: {found:?}: use activity::inputs", file.display());
        }
    }
}

#[test]
fn opened_files_are_found_behind_items_of_tests_and_not_in_them() {
    let in_tests =
        "#[cfg(test)]\nuse std::fs::File;\n#[cfg(test)]\nmod tests { fn f() { File::open(\"a\"); } }\n";
    assert!(opened::opened(in_tests).is_empty());
    for code in [
        "fn f() { std::fs::read_to_string(\"a\"); }",
        "fn f() { File::open(\"a\"); }",
        "use std::fs::{self, read};",
        "use std::fs as files;",
        "use std::fs::*;",
        "fn f() { OpenOptions::new(); }",
        "fn f() { assert!(fs::read(\"a\").is_ok()); }",
        "struct A;\nimpl A { #[cfg(test)] fn g() {} fn f() { fs::read(\"a\"); } }",
    ] {
        assert_eq!(opened::opened(&format!("{in_tests}{code}")).len(), 1, "{code}");
    }
    assert!(opened::opened("impl A { #[cfg(test)] fn g() { fs::read(\"a\"); } }").is_empty());
}

/// Files and folders by which `sim/build.rs` knows that the program changed, from the root.
fn sources_of_the_revision() -> Vec<PathBuf> {
    let text = fs::read_to_string(root().join("sim/build.rs")).expect("the build script");
    let list = text.split("const SOURCES").nth(1).and_then(|rest| rest.split("];").next());
    list.expect("a list of sources").split('"').skip(1).step_by(2).map(|path| root().join(path)).collect()
}

/// Files and folders that a source file compiles in.
fn included(file: &Path, package: &Path) -> Vec<PathBuf> {
    let text = fs::read_to_string(file).expect("a source file");
    let calls = ["include_str!(", "include_bytes!("].into_iter().flat_map(|call| text.split(call).skip(1));
    let own = "concat!(env!(\"CARGO_MANIFEST_DIR\"), \"/";
    let path = |call: &str| {
        let (base, rest) = match call.strip_prefix(own) {
            Some(rest) => (package, rest),
            None => (file.parent().expect("a folder"), call.strip_prefix('"').expect("a path")),
        };
        let path = base.join(rest.split('"').next().unwrap_or_default());
        path.canonicalize().unwrap_or_else(|error| panic!("{}: {error}", path.display()))
    };
    calls.map(path).collect()
}

#[test]
fn the_revision_covers_all_that_is_compiled_in() {
    let sources = sources_of_the_revision();
    let sources = sources.iter().map(|path| path.canonicalize().expect("a source of the revision"));
    let sources: Vec<PathBuf> = sources.collect();
    let mut files = 0;
    for package in workspace().workspace_packages() {
        let folder = package.manifest_path.as_std_path().parent().expect("a package");
        let code = folder.join("src");
        let within = rust_files(&code).iter().flat_map(|file| included(file, folder)).collect::<Vec<_>>();
        files += within.len();
        for path in within.into_iter().chain([code.canonicalize().expect("a folder of sources")]) {
            let is_covered = sources.iter().any(|source| path.starts_with(source));
            assert!(is_covered, "{} is missing in SOURCES of sim/build.rs", path.display());
        }
    }
    assert!(files > 15, "only {files} files are compiled in");
}

fn rust_files(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display())) {
        let path = entry.expect("an entry of a source folder").path();
        if path.is_dir() {
            files.extend(rust_files(&path));
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            files.push(path);
        }
    }
    files
}
