//! Ends of a sweep by signals of a scheduler.

use std::path::Path;
use std::time::Duration;

use super::{SWEEP, merged, point_files, run_all, unfinished_files};
use crate::support::{Ended, Inputs, quintile};

/// Ends a sweep of 240 points after some of them by `signal`.
fn ended_by(signal: &str, file: &str, out: &str) -> Ended {
    let begun = || point_files(out).len() >= 3;
    quintile().spawn(["sweep", "run", file, "--out", out]).once(begun).signal(signal).end()
}

#[test]
fn a_signal_of_the_scheduler_ends_between_points() {
    let inputs = Inputs::new();
    let file = inputs.put("tiles.ron", SWEEP.replace("axes: [", "repetitions: 60, axes: ["));
    let whole = inputs.path("whole");
    run_all(&file, &whole);
    for (signal, code) in [("USR1", 138), ("TERM", 143)] {
        let out = inputs.path(signal);
        let ended = ended_by(signal, &file, &out);
        assert_eq!(ended.code, Some(code), "{}", ended.stderr);
        let finished = point_files(&out).len();
        let says = format!("stopped by a signal: {} runs not finished; call it again", 240 - finished);
        assert!(finished < 240 && ended.stderr.contains(&says), "{finished}: {}", ended.stderr);
        assert!(ended.stdout.contains(&format!("{finished} of 240 runs finished")), "{}", ended.stdout);
        // What was in flight is finished and counted.
        let lines = ended.stderr.lines().filter(|line| line.contains("/240 ")).count();
        assert_eq!(lines, finished, "{}", ended.stderr);
        assert!(unfinished_files(&out).is_empty());
        let again = run_all(&file, &out);
        assert!(again.stderr.contains(&format!("{} of 240 runs to do", 240 - finished)), "{}", again.stderr);
        assert!(merged(&out) == merged(&whole));
    }
}

#[test]
fn a_second_termination_drops_what_is_in_flight() {
    let inputs = Inputs::new();
    let file = inputs.put(
        "long.ron",
        "(name: \"long\", settings: {\"scene\": \"default\"}, axes: [Values(path: \"seed\", values: [1, 2])])",
    );
    let out = inputs.path("out");
    let planned = || Path::new(&out).join("plan.jsonl").exists();
    let started = quintile().spawn(["sweep", "run", &file, "--out", &out]).once(planned);
    // The first runs begin soon after the plan is written, and take far longer than this.
    std::thread::sleep(Duration::from_secs(2));
    let first = started.signal("TERM");
    // Two signals at once are one.
    std::thread::sleep(Duration::from_millis(300));
    let ended = first.signal("TERM").end();
    assert_eq!(ended.code, Some(143), "{}", ended.stderr);
    assert!(
        ended.stderr.contains("interrupted: files that are not finished were removed"),
        "{}",
        ended.stderr
    );
    assert!(point_files(&out).is_empty() && unfinished_files(&out).is_empty());
}
