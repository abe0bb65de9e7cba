//! Folder of results: earlier results stay complete until new ones are, and files of the user stay.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use crate::support::{Inputs, Quintile, Results, Running, quintile};

/// Frames that take minutes on two cores, and are more than a host draws at once: after the first image the run
/// goes on for far longer than a signal takes.
const LONG: [&str; 8] = ["run", "default", "--timing", "stepped", "--size", "640x360", "--frames", "0..360"];

fn run(out: &str) -> Results {
    quintile().run_in(Path::new(out), "tiny", &[])
}

/// A long run into `out` that has rendered at least one frame.
fn long_run(out: &str) -> Running {
    quintile().spawn(LONG.iter().chain(&["--out", out])).once(|| has_begun(out))
}

/// Whether a run has drawn its first image.
fn has_begun(out: &str) -> bool {
    let images = Path::new(out).join(".quintile/new/images");
    fs::read_dir(&images).is_ok_and(|mut images| images.next().is_some())
}

/// Contents of `out` without the folder of new results.
fn visible(results: &Results) -> BTreeMap<PathBuf, Vec<u8>> {
    results.files().into_iter().filter(|(name, _)| !name.starts_with(".quintile")).collect()
}

#[test]
fn a_run_that_fails_leaves_the_results_of_the_run_before() {
    let inputs = Inputs::new();
    let results = run(&inputs.path("out"));
    let before = results.files();
    let huge = inputs.put("huge2.obj", "v 1e38 0 0\nv 0 -3e38 0\nv 0 0 3e38\nf 1 2 3\n");
    let ended = quintile().call(["run", &huge, "--out", &inputs.path("out")]);
    assert!(matches!(ended.code, Some(1 | 2)), "{}", ended.stderr);
    assert!(
        ended.stderr.contains("huge2.obj") && ended.stderr.contains("scale the scene"),
        "{}",
        ended.stderr
    );
    assert!(before == results.files());
}

#[cfg(unix)]
#[test]
fn a_run_that_is_killed_leaves_the_results_of_the_run_before() {
    let inputs = Inputs::new();
    let results = run(&inputs.path("out"));
    let before = results.files();
    let ended = long_run(&inputs.path("out")).signal("KILL").end();
    assert_eq!(ended.code, None);
    assert!(before == visible(&results));
    // Its files do not block the next run, which removes them.
    run(&inputs.path("out"));
    assert!(before == results.files());
}

#[cfg(unix)]
#[test]
fn an_interrupt_ends_a_run_with_a_message_and_nothing_left() {
    let inputs = Inputs::new();
    let results = run(&inputs.path("out"));
    let before = results.files();
    for (signal, code, out) in [("INT", 130, inputs.path("out")), ("TERM", 143, inputs.path("new"))] {
        let ended = long_run(&out).signal(signal).end();
        assert_eq!(ended.code, Some(code), "{}", ended.stderr);
        let lines: Vec<&str> = ended.stderr.lines().collect();
        assert!(lines[0].starts_with("note: expected time"), "{}", ended.stderr);
        assert!(lines[1].starts_with("error: interrupted") && lines.len() == 2, "{}", ended.stderr);
    }
    assert!(before == results.files());
    assert!(!Path::new(&inputs.path("new")).exists(), "a folder that was made for nothing");
}

/// Scripts start background jobs with interrupts ignored, and `nohup` ignores hang-ups.
#[cfg(unix)]
#[test]
fn a_signal_that_the_caller_ignores_stays_ignored() {
    let inputs = Inputs::new();
    let out = inputs.path("out");
    let start = ["-c", "trap '' INT HUP; exec \"$@\"", "sh", env!("CARGO_BIN_EXE_quintile")];
    let running = Quintile::new("sh").spawn(start.iter().chain(&LONG).chain(&["--out", out.as_str()]));
    let ended = running.once(|| has_begun(&out)).signal("INT").signal("HUP").signal("TERM").end();
    assert_eq!(ended.code, Some(143), "{}", ended.stderr);
    assert!(!Path::new(&out).exists(), "a folder that was made for nothing");
}

#[cfg(unix)]
#[test]
fn the_second_of_two_at_once_is_refused() {
    let inputs = Inputs::new();
    let out = inputs.path("out");
    let first = long_run(&out);
    let ended = quintile().call(["run", "tiny", "--out", &out]);
    assert_eq!(ended.code, Some(2), "{}", ended.stderr);
    for says in [out.as_str(), "another quintile (process ", "--out"] {
        assert!(ended.stderr.contains(says), "{}", ended.stderr);
    }
    assert_eq!(first.signal("KILL").end().code, None);
    run(&out);
}

#[test]
fn files_of_the_user_stay() {
    let inputs = Inputs::new();
    let out = PathBuf::from(inputs.path("out"));
    let mine = ["images/frame_0099.png", "images/notes.txt", "heat/my.png", "plots/mine.svg", "mine.csv"];
    for name in mine {
        fs::create_dir_all(out.join(name).parent().expect("a folder")).expect("a folder can be made");
        fs::write(out.join(name), "mine").expect("a file can be written");
    }
    for frames in ["0..3", "0..1"] {
        let args = ["--frames", frames, "--heat", "samples_tested"];
        quintile().run_in(&out, "tiny", &args);
        for name in mine {
            assert_eq!(fs::read_to_string(out.join(name)).ok().as_deref(), Some("mine"), "{name}");
        }
    }
    assert!(!out.join("images/frame_0002.png").exists(), "a frame of the run before");
    quintile().run_in(&out, "tiny", &[]);
    let left: Vec<_> = fs::read_dir(out.join("heat")).expect("a folder").flatten().collect();
    assert_eq!(left.len(), 1, "maps of the run before: {left:?}");
}

#[test]
fn files_of_the_user_in_the_way_are_refused_before_any_work() {
    for name in ["frames.csv", "report.html", "images/frame_0000.png", "summary.json", "plots/stalls.svg"] {
        let inputs = Inputs::new();
        let out = PathBuf::from(inputs.path("out"));
        let path = out.join(name);
        fs::create_dir_all(path.parent().expect("a folder")).expect("a folder can be made");
        fs::write(&path, "mine").expect("a file can be written");
        let call = |extra: &[&str]| {
            let out = out.display().to_string();
            quintile().call(["run", "tiny", "--timing", "stepped", "--out", &out].iter().chain(extra))
        };
        let ended = call(&[]);
        assert_eq!(ended.code, Some(2), "{name}: {}", ended.stderr);
        for says in [path.display().to_string().as_str(), "--force", "--out"] {
            assert!(ended.stderr.contains(says), "{name}: {}", ended.stderr);
        }
        assert_eq!(fs::read_to_string(&path).ok().as_deref(), Some("mine"), "{name}");
        let ended = call(&["--force"]);
        assert_eq!(ended.code, Some(0), "{name}: {}", ended.stderr);
        assert_ne!(fs::read(&path).ok().as_deref(), Some("mine".as_bytes()), "{name}");
    }
}

/// Modified results are not overwritten without `--force`, and every file of a run is listed with its hash.
#[test]
fn changed_results_are_the_users() {
    let inputs = Inputs::new();
    let results = run(&inputs.path("out"));
    let listed: serde_json::Value = serde_json::from_str(&results.text("manifest.json")).expect("JSON");
    let mut names: Vec<String> = listed["files"].as_object().expect("files").keys().cloned().collect();
    names.push("manifest.json".to_owned());
    names.sort();
    let found: Vec<String> = results.files().keys().map(|name| name.display().to_string()).collect();
    assert_eq!(names, found);
    fs::write(results.path("frames.csv"), "frame,note\n0,mine\n").expect("a file can be written");
    let ended = quintile().call(["run", "tiny", "--out", &inputs.path("out")]);
    assert_eq!(ended.code, Some(2), "{}", ended.stderr);
    for says in ["frames.csv: this file was changed after Quintile wrote it", "--force"] {
        assert!(ended.stderr.contains(says), "{}", ended.stderr);
    }
    assert!(results.text("frames.csv").contains("mine"));
}

#[cfg(unix)]
#[test]
fn links_and_the_current_directory_may_be_the_folder() {
    let inputs = Inputs::new();
    let (real, link) = (PathBuf::from(inputs.path("real")), PathBuf::from(inputs.path("link")));
    fs::create_dir(&real).expect("a folder can be made");
    std::os::unix::fs::symlink(&real, &link).expect("a link can be made");
    for _ in 0..2 {
        quintile().run_in(&link, "tiny", &[]);
        assert!(link.symlink_metadata().is_ok_and(|metadata| metadata.is_symlink()));
    }
    let here = PathBuf::from(inputs.path("here"));
    fs::create_dir(&here).expect("a folder can be made");
    for _ in 0..2 {
        let ended = quintile().call_in(&here, ["run", "tiny", "--out", "."]);
        assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    }
    let names = |folder: &Path| {
        let entries = fs::read_dir(folder).expect("a folder").flatten();
        entries.map(|entry| entry.file_name()).collect::<std::collections::BTreeSet<_>>()
    };
    assert_eq!(names(&real), names(&here));
    assert!(here.join("summary.json").exists());
}

/// A limit on file size simulates a full disk: writing fails in the middle of a file.
#[cfg(unix)]
#[test]
fn a_full_disk_leaves_the_results_of_the_run_before() {
    let inputs = Inputs::new();
    let out = inputs.path("out");
    let results = run(&out);
    let before = results.files();
    let program = env!("CARGO_BIN_EXE_quintile");
    let limited = ["-c", "trap '' XFSZ; ulimit -f 100; exec \"$0\" run tiny --out \"$1\"", program, &out];
    let ended = Quintile::new("sh").call(limited);
    assert_eq!(ended.code, Some(1), "{}", ended.stderr);
    assert!(ended.stderr.contains("cannot write it") && ended.stderr.contains(&out), "{}", ended.stderr);
    assert!(before == results.files());
}

#[cfg(unix)]
#[test]
#[cfg_attr(superuser, ignore = "no permission stops this user")]
fn a_read_only_folder_is_refused_before_any_work() {
    use std::os::unix::fs::PermissionsExt;
    let inputs = Inputs::new();
    let results = run(&inputs.path("out"));
    let before = results.files();
    let permit = |folder: &Path, mode| {
        fs::set_permissions(folder, fs::Permissions::from_mode(mode)).expect("permissions can be set");
    };
    for folder in [results.folder().to_owned(), results.path("images")] {
        permit(&folder, 0o555);
        let ended = quintile().call(["run", "tiny", "--out", &inputs.path("out")]);
        assert_eq!(ended.code, Some(1), "{}", ended.stderr);
        assert!(ended.stderr.contains("--out"), "{}", ended.stderr);
        permit(&folder, 0o755);
        assert!(before == results.files());
    }
}

/// No folder can have the name, so the request is at fault.
#[test]
fn a_name_that_is_too_long_is_a_wrong_request() {
    let inputs = Inputs::new();
    let out = inputs.path(&"x".repeat(300));
    for command in [&["run", "tiny"][..], &["chart", "memory"], &["stress"], &["reproduce", "II"]] {
        let ended = quintile().call(command.iter().chain(&["--out", out.as_str()]));
        assert_eq!(ended.code, Some(2), "{}", ended.stderr);
        assert!(ended.stderr.contains("cannot use it as the folder for results"), "{}", ended.stderr);
    }
}

/// Every command that writes a folder follows the same rules, and none overwrites the results of another.
#[test]
fn commands_that_share_a_folder() {
    let inputs = Inputs::new();
    let out = inputs.path("out");
    let stress = ["stress", "slivers", "--quick", "--out", &out];
    assert_eq!(quintile().call(stress).code, Some(0));
    let before = fs::read(Path::new(&out).join("summary.json")).expect("a summary");
    let ended = quintile().call(["run", "tiny", "--out", &out]);
    assert_eq!(ended.code, Some(2), "{}", ended.stderr);
    assert!(ended.stderr.contains("summary.json: `quintile stress` wrote this file"), "{}", ended.stderr);
    assert_eq!(fs::read(Path::new(&out).join("summary.json")).ok(), Some(before));
    let chart = ["chart", "soft-shadows", "--quick", "--out", &out];
    fs::write(Path::new(&out).join("soft_shadows.csv"), "mine").expect("a file can be written");
    let ended = quintile().call(chart);
    assert_eq!(ended.code, Some(2), "{}", ended.stderr);
    assert!(
        ended.stderr.contains("soft_shadows.csv") && ended.stderr.contains("--force"),
        "{}",
        ended.stderr
    );
    let reproduce = ["reproduce", "II", "--quick", "--out", &out];
    fs::write(Path::new(&out).join("reproduce_II.json"), "mine").expect("a file can be written");
    assert_eq!(quintile().call(reproduce).code, Some(2));
    assert_eq!(quintile().call(stress).code, Some(0));
}

/// A manifest that names files outside of the folder is invalid.
#[test]
fn names_in_a_list_of_results_stay_in_the_folder() {
    let inputs = Inputs::new();
    let victim = inputs.put("victim", "mine");
    let sha256 = "1e4fb01d5ac0e76f4a8ea6b1a8f6a5b5";
    for name in ["../victim", "images/../../victim", &victim, ".quintile/lock"] {
        let out = inputs.path("out");
        let results = run(&out);
        let mut list: serde_json::Value = serde_json::from_str(&results.text("manifest.json")).expect("JSON");
        list["files"][name] = serde_json::json!({"by": "run", "bytes": 4, "sha256": sha256});
        fs::write(results.path("manifest.json"), list.to_string()).expect("a list");
        let ended = quintile().call(["run", "tiny", "--out", &out]);
        assert_eq!(ended.code, Some(2), "{name}: {}", ended.stderr);
        assert!(ended.stderr.contains("manifest.json"), "{}", ended.stderr);
        assert_eq!(fs::read_to_string(&victim).ok().as_deref(), Some("mine"), "{name}");
        fs::remove_dir_all(&out).expect("results can be removed");
    }
}

#[cfg(unix)]
#[test]
fn new_results_are_not_made_behind_a_link() {
    let inputs = Inputs::new();
    let [mine, out] = [inputs.path("mine"), inputs.path("out")];
    for folder in [&format!("{mine}/new"), &out] {
        fs::create_dir_all(folder).expect("a folder");
    }
    fs::write(format!("{mine}/new/a.txt"), "mine").expect("a file");
    std::os::unix::fs::symlink(&mine, format!("{out}/.quintile")).expect("a link");
    let ended = quintile().call(["run", "tiny", "--out", &out]);
    assert_eq!(ended.code, Some(2), "{}", ended.stderr);
    assert!(ended.stderr.contains(".quintile: it is a link"), "{}", ended.stderr);
    assert!(Path::new(&format!("{mine}/new/a.txt")).exists());
}

#[test]
fn a_dry_run_reports_files_in_the_way() {
    let inputs = Inputs::new();
    let out = inputs.path("out");
    fs::create_dir(&out).expect("a folder");
    fs::write(format!("{out}/summary.json"), "mine").expect("a file");
    let ended = quintile().call(["run", "tiny", "--dry-run", "--out", &out]);
    assert_eq!(ended.code, Some(2), "{}", ended.stderr);
    assert!(ended.stderr.contains("summary.json"), "{}", ended.stderr);
    let fresh = inputs.path("fresh");
    assert_eq!(quintile().call(["run", "tiny", "--dry-run", "--out", &fresh]).code, Some(0));
    assert!(!Path::new(&fresh).exists());
}
