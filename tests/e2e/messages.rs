//! Messages of every command: one style, with colours and verbosity as configured.

use crate::support::{Ended, Inputs, quintile};

/// Runs `tiny` with `args` and a recorder too slow for it, which is warned of; the folder of the results goes away.
fn tiny(args: &[&str]) -> Ended {
    let inputs = Inputs::new();
    let out = inputs.path("out");
    quintile().call(["run", "tiny", "--trace-rate", "50000", "--out", &out].iter().chain(args))
}

#[test]
fn warnings_are_on_standard_error_and_quiet_removes_them() {
    let [normal, quiet, short] = [&[] as &[_], &["--quiet"], &["-q"]].map(tiny);
    for ended in [&normal, &quiet, &short] {
        assert_eq!(ended.code, Some(0), "{}", ended.stderr);
        assert!(!ended.stdout.contains("warning") && ended.stdout.contains("results:"), "{}", ended.stdout);
    }
    assert!(normal.stderr.lines().any(|line| line.starts_with("warning: [")), "{}", normal.stderr);
    assert_eq!((quiet.stderr.as_str(), short.stderr.as_str()), ("", ""));
}

#[test]
fn errors_are_printed_with_quiet() {
    let normal = quintile().call(["run", "no_such_scene"]);
    let quiet = quintile().call(["--quiet", "run", "no_such_scene"]);
    assert_eq!((normal.code, quiet.code), (Some(2), Some(2)));
    assert!(quiet.stderr.starts_with("error: "), "{}", quiet.stderr);
    assert_eq!(normal.stderr, quiet.stderr);
}

#[test]
fn errors_of_parser_and_program_have_one_style() {
    let calls: [(&[&str], i32); 3] = [
        (&["run", "no_such_scene"], 2),
        (&["run", "tiny", "--no-such-option"], 2),
        (&["trace", "convert", "no_such.csv", "no_such.parquet"], 2),
    ];
    for (call, code) in calls {
        let plain = quintile().call(call);
        assert!(
            plain.code == Some(code) && plain.stderr.starts_with("error: "),
            "{call:?}: {}",
            plain.stderr
        );
        let coloured = quintile().call(["--color", "always"].iter().chain(call));
        assert!(coloured.stderr.starts_with("\u{1b}[1m\u{1b}[31merror:\u{1b}[0m "), "{:?}", coloured.stderr);
    }
}

#[test]
fn color_follows_the_option_wherever_it_is_written() {
    for args in [&["--color", "always"] as &[_], &["--color=always"]] {
        let ended = tiny(args);
        assert!(ended.stderr.contains("\u{1b}[1m\u{1b}[33mwarning:\u{1b}[0m ["), "{:?}", ended.stderr);
        assert!(!ended.stdout.contains('\u{1b}'), "{}", ended.stdout);
    }
    for args in [&[] as &[_], &["--color", "never"], &["--color", "auto"]] {
        let ended = tiny(args);
        assert!(!ended.stderr.contains('\u{1b}') && !ended.stderr.is_empty(), "{args:?}: {:?}", ended.stderr);
    }
    let wrong = tiny(&["--color", "blue"]);
    assert!(wrong.code == Some(2) && wrong.stderr.contains("auto, always, never"), "{}", wrong.stderr);
}

#[test]
fn quiet_and_verbose_exclude_each_other() {
    for call in [["-q", "-v", "list"], ["-q", "list", "-v"], ["list", "-q", "-v"]] {
        let ended = quintile().call(call);
        assert_eq!(ended.code, Some(2), "{call:?}: {}", ended.stderr);
        assert!(
            ended.stderr.contains("'--quiet'") && ended.stderr.contains("'--verbose'"),
            "{}",
            ended.stderr
        );
    }
}

#[test]
fn completions_and_manual_pages_know_every_command() {
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let ended = quintile().call(["completions", shell]);
        assert_eq!((ended.code, ended.stderr.as_str()), (Some(0), ""), "{shell}");
        for word in ["trace-rate", "visibility", "current-range", "verbose"] {
            assert!(ended.stdout.contains(word), "{shell} has no {word}");
        }
    }
    let page = quintile().call(["man"]);
    assert!(page.code == Some(0) && page.stdout.contains(".TH quintile 1"), "{}", page.stdout);
    let inputs = Inputs::new();
    let folder = inputs.path("man1");
    let ended = quintile().call(["man", &folder]);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    for (page, says) in [
        ("quintile.1", "visibility"),
        ("quintile-run.1", "trace\\-rate"),
        ("quintile-trace-sample.1", "current\\-range"),
    ] {
        let text = std::fs::read_to_string(format!("{folder}/{page}"))
            .unwrap_or_else(|error| panic!("{page}: {error}"));
        assert!(text.contains(says), "{page} has no {says}");
    }
}
