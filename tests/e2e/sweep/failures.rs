//! What can go wrong with the folder of a sweep: nothing half-written counts, and nothing finished is lost.

use std::fs;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, SystemTime};

use output::dir::sha256_of_text;

use super::{SWEEP, done, merged, point_files, run_all, sweep, unfinished_files};
use crate::support::{Inputs, Quintile, quintile};

/// 240 points.
fn many() -> String {
    SWEEP.replace("axes: [", "repetitions: 60, axes: [")
}

/// A file system in memory.
struct Mount<'a> {
    folder: &'a str,
}

impl<'a> Mount<'a> {
    fn new(folder: &'a str, options: &str) -> Self {
        fs::create_dir(folder).unwrap();
        mount(&["-t", "tmpfs", "-o", options, "quintile-test", folder]);
        Self { folder }
    }

    fn change(&self, options: &str) {
        mount(&["-o", &format!("remount,{options}"), self.folder]);
    }
}

impl Drop for Mount<'_> {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg(self.folder).status();
    }
}

fn mount(args: &[&str]) {
    let ended = Command::new("mount").args(args).output().unwrap();
    assert!(ended.status.success(), "mount {args:?}: {}", String::from_utf8_lossy(&ended.stderr));
}

#[test]
#[cfg_attr(not(may_mount), ignore = "this user may not mount a small disk")]
fn a_full_disk_ends_a_sweep_that_goes_on_when_there_is_room() {
    let inputs = Inputs::new();
    let (file, whole, disk) = (inputs.put("tiles.ron", many()), inputs.path("whole"), inputs.path("disk"));
    let mounted = Mount::new(&disk, "size=400k");
    let out = Path::new(&disk).join("out").display().to_string();
    let ended = sweep(&["run", &file, "--out", &out]);
    assert_eq!(ended.code, Some(1), "{}", ended.stderr);
    for says in
        [disk.as_str(), "No space left on device", "what is finished is kept: call it again to continue"]
    {
        assert!(ended.stderr.contains(says), "{says}: {}", ended.stderr);
    }
    let finished = point_files(&out).len();
    assert!((1..240).contains(&finished) && unfinished_files(&out).is_empty(), "{finished}");
    let status = done(&["status", &out]);
    assert!(status.stdout.contains(&format!("{finished} of 240 runs finished")), "{}", status.stdout);
    let ended = sweep(&["merge", &out, "--partial"]);
    assert_eq!(ended.code, Some(1), "{}", ended.stderr);
    assert!(ended.stderr.contains(&out) && ended.stderr.contains("No space left"), "{}", ended.stderr);
    assert!(!Path::new(&out).join("results.parquet").exists());
    mounted.change("size=64m");
    let again = run_all(&file, &out);
    assert!(again.stderr.contains(&format!("{} of 240 runs to do", 240 - finished)), "{}", again.stderr);
    run_all(&file, &whole);
    assert!(merged(&out) == merged(&whole));
}

#[test]
#[cfg_attr(not(may_mount), ignore = "this user may not mount a disk that is read-only")]
fn a_read_only_folder_is_refused_before_anything_runs_and_can_be_read() {
    let inputs = Inputs::new();
    let (file, disk) = (inputs.put("tiles.ron", SWEEP), inputs.path("disk"));
    let mounted = Mount::new(&disk, "size=64m");
    let out = Path::new(&disk).join("out").display().to_string();
    run_all(&file, &out);
    mounted.change("ro");
    for args in [
        &["run", &file, "--out", &out][..],
        &["run", &file, "--out", &format!("{disk}/new")],
        &["merge", &out],
    ] {
        let ended = sweep(args);
        assert_eq!(ended.code, Some(1), "{args:?}: {}", ended.stderr);
        let says = ended.stderr.contains(&disk) && ended.stderr.contains("Read-only file system");
        assert!(says && !ended.stderr.contains("runs to do"), "{}", ended.stderr);
        let remedy = [
            "name a file in a folder that is there and may be written to",
            "give a folder that you may read and write",
        ];
        let has_remedy = remedy.iter().any(|remedy| ended.stderr.trim_end().ends_with(remedy));
        assert!(has_remedy && !ended.stderr.contains("call it again"), "{}", ended.stderr);
    }
    assert!(done(&["status", &out]).stdout.contains("4 of 4 runs finished"));
}

/// Each file that a step writes, with what a user could have there.
#[test]
fn a_file_of_the_user_is_never_overwritten() {
    let inputs = Inputs::new();
    let (file, out) = (inputs.put("tiles.ron", SWEEP), inputs.path("out"));
    run_all(&file, &out);
    let slurm = ["slurm", &file, "--out", &out, "--tasks", "2"];
    let steps: [(&[&str], &[&str]); 3] = [
        (&["merge", &out], &["results.parquet"]),
        (&["report", &out], &["designs.csv", "shares.csv", "frontier.svg", "report.html"]),
        (&slurm, &["array.sh", "merge.sh"]),
    ];
    for (step, names) in steps {
        let refused = |why: &str| {
            for path in names.iter().map(|name| Path::new(&out).join(name)) {
                fs::write(&path, "mine").unwrap();
                let ended = sweep(step);
                assert_eq!(ended.code, Some(2), "{step:?}: {}", ended.stderr);
                let says = format!("{}: {why}", path.display());
                assert!(
                    ended.stderr.contains(&says) && ended.stderr.contains("move or rename it"),
                    "{}",
                    ended.stderr
                );
                assert_eq!(fs::read(&path).unwrap(), b"mine");
                fs::remove_file(&path).unwrap();
            }
        };
        refused("Quintile did not write");
        done(step);
        done(step);
        refused("this file was changed after Quintile wrote it");
    }
}

#[test]
fn a_report_that_cannot_be_written_leaves_the_earlier_one_whole() {
    let inputs = Inputs::new();
    let (file, out) = (inputs.put("tiles.ron", SWEEP), inputs.path("out"));
    done(&["run", &file, "--out", &out, "--shard", "2/2"]);
    done(&["report", &out]);
    let files = || {
        ["designs.csv", "winners.csv", "shares.csv"].map(|name| fs::read(Path::new(&out).join(name)).unwrap())
    };
    let (earlier, page) = (files(), Path::new(&out).join("report.html"));
    run_all(&file, &out);
    fs::remove_file(&page).unwrap();
    fs::create_dir(&page).unwrap();
    let ended = sweep(&["report", &out]);
    assert!(
        ended.code == Some(2) && ended.stderr.contains("report.html: it is a folder"),
        "{}",
        ended.stderr
    );
    assert!(files() == earlier);
    fs::remove_dir(&page).unwrap();
    done(&["report", &out]);
    assert!(files() != earlier && page.is_file());
}

#[test]
fn two_sweeps_at_once_share_no_folder() {
    let inputs = Inputs::new();
    let out = inputs.path("out");
    let first = inputs.put("first.ron", many());
    let other = inputs.put("other.ron", SWEEP.replace("\"tiles\"", "\"other\""));
    let begun = || !point_files(&out).is_empty();
    let running = quintile().spawn(["sweep", "run", &first, "--out", &out]).once(begun);
    let refused = sweep(&["run", &other, "--out", &out]);
    assert_eq!(refused.code, Some(2), "{}", refused.stderr);
    assert!(refused.stderr.contains("holds the sweep `tiles`, and this is `other`"), "{}", refused.stderr);
    let ended = running.end();
    assert!(ended.code == Some(1) && point_files(&out).len() == 240, "{}", ended.stderr);
}

#[test]
fn a_shard_that_runs_twice_at_once_does_no_harm() {
    let inputs = Inputs::new();
    let (file, [out, whole]) =
        (inputs.put("tiles.ron", many()), ["out", "whole"].map(|name| inputs.path(name)));
    let start = || quintile().spawn(["sweep", "run", &file, "--out", &out]);
    for ended in [start(), start(), start()].map(|running| running.end()) {
        assert_eq!(ended.code, Some(1), "{}", ended.stderr);
    }
    assert!(unfinished_files(&out).is_empty());
    run_all(&file, &whole);
    assert!(merged(&out) == merged(&whole));
}

/// Nothing depends on the time of a file, which clocks that jump make wrong.
#[test]
fn times_of_files_decide_nothing() {
    let inputs = Inputs::new();
    let (file, out) = (inputs.put("tiles.ron", SWEEP), inputs.path("out"));
    run_all(&file, &out);
    let table = merged(&out);
    let plan = Path::new(&out).join("plan.jsonl");
    let century = Duration::from_secs(100 * 365 * 86_400);
    for (time, of_inputs) in [
        (SystemTime::UNIX_EPOCH, SystemTime::now() + century),
        (SystemTime::now() + century, SystemTime::UNIX_EPOCH),
    ] {
        let set = |path: &Path, time| {
            fs::File::options().write(true).open(path).unwrap().set_modified(time).unwrap()
        };
        point_files(&out).iter().chain([&plan]).for_each(|path| set(path, time));
        set(Path::new(&file), of_inputs);
        let ended = run_all(&file, &out);
        assert!(ended.stderr.contains("0 of 4 runs to do"), "{}", ended.stderr);
        assert!(merged(&out) == table);
    }
}

#[test]
fn processes_that_are_killed_while_they_write_leave_nothing_that_counts() {
    let inputs = Inputs::new();
    let (file, [out, whole]) =
        (inputs.put("tiles.ron", many()), ["out", "whole"].map(|name| inputs.path(name)));
    for kill in 1..=4 {
        let begun = || point_files(&out).len() >= 20 * kill;
        let ended = quintile().spawn(["sweep", "run", &file, "--out", &out]).once(begun).signal("KILL").end();
        assert_eq!(ended.code, None);
        for path in point_files(&out) {
            let point: serde_json::Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
            assert_eq!(point["id"].as_str(), path.file_stem().unwrap().to_str());
        }
    }
    // One more that was killed at the worst moment of each point.
    let plan = fs::read_to_string(Path::new(&out).join("plan.jsonl")).unwrap();
    for line in plan.lines().skip(1) {
        let id = serde_json::from_str::<serde_json::Value>(line).unwrap()["id"].as_str().unwrap().to_owned();
        let folder = Path::new(&out).join("points").join(&id[..2]);
        fs::create_dir_all(&folder).unwrap();
        fs::write(folder.join(format!(".{id}.json.1.part")), format!("{{\"id\":\"{id}\",\"mea")).unwrap();
    }
    let killed = point_files(&out);
    let finished = done(&["status", &out]).stdout;
    assert!(finished.contains(&format!("{} of 240 runs finished", killed.len())), "{finished}");
    run_all(&file, &out);
    assert!(unfinished_files(&out).is_empty(), "{:?}", unfinished_files(&out));
    run_all(&file, &whole);
    assert!(merged(&out) == merged(&whole));
}

#[test]
fn a_damaged_file_of_a_point_is_named_and_its_point_runs_again() {
    let inputs = Inputs::new();
    let (file, out) = (inputs.put("tiles.ron", SWEEP), inputs.path("out"));
    run_all(&file, &out);
    let table = merged(&out);
    // The point that fails has no cycles; which file comes first depends on the program.
    let mut files = point_files(&out).into_iter().map(|path| (fs::read_to_string(&path).unwrap(), path));
    let (whole, path) = files.find(|(text, _)| text.contains("\"cycles\":")).unwrap();
    let name = path.display().to_string();
    let edited = whole.replace("\"cycles\":", "\"cycles\":1");
    for (bytes, says) in [
        (edited.as_bytes(), "it was changed after it was written"),
        (&whole.as_bytes()[..whole.len() / 2], "cut off or damaged"),
        (b"", "it is empty"),
        (b"\xff\0rubbish", "damaged"),
    ] {
        fs::write(&path, bytes).unwrap();
        let merge = sweep(&["merge", &out]);
        assert_eq!(merge.code, Some(1), "{}", merge.stderr);
        let status = done(&["status", &out]);
        assert!(status.stdout.contains("3 of 4 runs finished"), "{}", status.stdout);
        let run = run_all(&file, &out);
        assert!(run.stderr.contains("1 of 4 runs to do"), "{}", run.stderr);
        for stderr in [merge.stderr, status.stderr, run.stderr] {
            assert!(
                stderr.contains(&name) && stderr.contains(says) && stderr.contains("runs its point again"),
                "{stderr}"
            );
        }
        assert!(merged(&out) == table);
    }
}

#[test]
fn a_changed_program_runs_its_points_again() {
    let inputs = Inputs::new();
    let (file, out, program) = (inputs.put("tiles.ron", SWEEP), inputs.path("out"), inputs.path("quintile"));
    run_all(&file, &out);
    // The same program under another name is the same.
    fs::copy(env!("CARGO_BIN_EXE_quintile"), &program).unwrap();
    let run = || Quintile::new(&program).call(["sweep", "run", &file, "--out", &out]);
    assert!(run().stderr.contains("0 of 4 runs to do"));
    // Bytes after the end of a program change nothing but its contents.
    let mut bytes = fs::read(&program).unwrap();
    bytes.push(0);
    fs::write(&program, bytes).unwrap();
    let program = Quintile::new(&program);
    for step in ["status", "merge", "report"] {
        let ended = program.call(["sweep", step, &out]);
        assert!(
            ended.code == Some(0) && ended.stderr.contains("run by another build of quintile"),
            "{}",
            ended.stderr
        );
    }
    let ended = run();
    assert!(ended.code == Some(1) && ended.stderr.contains("4 of 4 runs to do"), "{}", ended.stderr);
    // Nothing is lost without a request.
    let status = program.call(["sweep", "status", &out]).stderr;
    assert!(status.contains("4 results of other builds") && !status.contains("another build"), "{status}");
    assert_eq!(point_files(&out).len(), 8);
    let cleaned = program.call(["sweep", "clean", &out]);
    assert!(cleaned.stdout.contains("4 results removed"), "{}", cleaned.stdout);
    assert!(point_files(&out).len() == 4 && program.call(["sweep", "status", &out]).stderr.is_empty());
}

#[test]
fn a_result_with_other_numbers_is_of_another_build() {
    let inputs = Inputs::new();
    let (file, out) = (inputs.put("tiles.ron", SWEEP), inputs.path("out"));
    run_all(&file, &out);
    for path in point_files(&out) {
        let text = fs::read_to_string(&path).unwrap().replace("\"cycles\":", "\"ticks\":");
        let (_, rest) = text.split_once("\",").unwrap();
        let sha256 = sha256_of_text(&format!("{{{rest}"));
        fs::write(&path, format!("{{\"sha256\":\"{sha256}\",{rest}")).unwrap();
    }
    let status = done(&["status", &out]);
    assert!(status.stdout.contains("1 of 4 runs finished, 1 failed"), "{}", status.stdout);
    let says = "3 results written by another build of quintile";
    assert!(status.stderr.contains(says) && !status.stderr.contains("damaged"), "{}", status.stderr);
    let run = run_all(&file, &out).stderr;
    assert!(run.contains(says) && run.contains("3 of 4 runs to do"), "{run}");
}
