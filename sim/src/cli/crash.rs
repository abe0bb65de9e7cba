//! Unusual ends: the report of a crash (its place, and the command that repeats the frame), interrupts
//! (Ctrl-C), and the request of a scheduler to end, which work in steps follows between two steps.

use std::any::Any;
use std::backtrace::{Backtrace, BacktraceStatus};
use std::io::{IsTerminal, Write, stderr};
use std::sync::atomic::{AtomicI32, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
#[cfg(unix)]
use std::time::Duration;

use output::table::shell_line;
use output::terminal::Terminal;
use run::{CrashedFrame, panic_message};
use traces::io::atomic;

/// Panics in all threads of this process.
#[derive(Clone, Default)]
pub(super) struct Crashes {
    recorded: Arc<Mutex<Vec<Crash>>>,
}

#[derive(Clone)]
struct Crash {
    /// File and line.
    place: String,
    message: String,
    /// Present if the variable `RUST_BACKTRACE` is set.
    backtrace: Option<String>,
}

impl Crashes {
    /// Installs a panic hook that records panics; [`Self::report`] prints them.
    pub fn record() -> Self {
        let crashes = Self::default();
        let recorded = crashes.recorded.clone();
        std::panic::set_hook(Box::new(move |info| {
            let place = info.location().map(|at| format!("{}:{}", at.file(), at.line()));
            let backtrace = Backtrace::capture();
            let is_captured = backtrace.status() == BacktraceStatus::Captured;
            let crash = Crash {
                place: place.unwrap_or_else(|| "an unknown place".to_owned()),
                message: panic_message(info.payload()),
                backtrace: is_captured.then(|| backtrace.to_string()),
            };
            recorded.lock().unwrap_or_else(PoisonError::into_inner).push(crash);
        }));
        crashes
    }

    /// Message about the panic with this payload, in a call with these arguments.
    pub fn report(&self, payload: &(dyn Any + Send), arguments: &[String]) -> String {
        let frame = payload.downcast_ref::<CrashedFrame>();
        let message = panic_message(payload);
        let recorded = self.recorded.lock().unwrap_or_else(PoisonError::into_inner);
        // Several threads may panic; take the one whose payload arrived.
        let crash = recorded.iter().find(|crash| crash.message == message).or(recorded.first());
        let place = crash.map_or("an unknown place", |crash| &crash.place);
        let (within, again) = match frame {
            Some(CrashedFrame { frame, .. }) => (format!(" in frame {frame}"), alone(arguments, *frame)),
            None => (String::new(), arguments.to_vec()),
        };
        let backtrace = crash.and_then(|crash| crash.backtrace.as_deref()).unwrap_or_default();
        let version = env!("CARGO_PKG_VERSION");
        let program = "quintile".to_owned();
        let again = shell_line([&program].into_iter().chain(&again));
        format!(
            "{place}: internal error{within}: {message}\n  please report it with these lines; Quintile {version}; to see it \
             again: {again}\n{backtrace}"
        )
        .trim_end()
        .to_owned()
    }
}

/// Arguments that run one frame, with its own folder of results; arguments of other commands are unchanged.
fn alone(arguments: &[String], frame: u32) -> Vec<String> {
    // Global options may stand before the subcommand.
    if !arguments.iter().any(|word| word == "run") {
        return arguments.to_vec();
    }
    let mut kept = Vec::new();
    let mut rest = arguments.iter();
    while let Some(argument) = rest.next() {
        match argument.as_str() {
            "--frames" | "--out" => drop(rest.next()),
            other if other.starts_with("--frames=") || other.starts_with("--out=") => {}
            _ => kept.push(argument.clone()),
        }
    }
    let frames = format!("{frame}..{}", frame.saturating_add(1));
    kept.extend(["--frames".to_owned(), frames, "--out".to_owned(), format!("frame_{frame}")]);
    kept
}

/// How long steps that have begun may go on after a termination, in seconds. Schedulers kill after 30 s.
#[cfg(unix)]
const GRACE_S: u64 = 20;

/// Handles interrupt, termination and hang-up: unfinished files are removed, a message is printed, and the
/// process ends with 128 plus the number of the signal, as in shells. Signals that the caller ignores
/// (`nohup`, background jobs of scripts) stay ignored.
///
/// Work that follows `stop` ends by itself after USR1, and within 20 s after a first termination.
#[cfg(unix)]
pub(super) fn handle(terminal: Terminal, stop: Option<Stop>) {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGUSR1};

    let ignored = ignored_signals();
    let handled = [SIGINT, SIGTERM, SIGHUP].into_iter().chain(stop.is_some().then_some(SIGUSR1));
    let handled = handled.filter(|signal| ignored >> (signal - 1) & 1 == 0);
    // Without a handler the next process with the same folder removes unfinished files.
    let Ok(mut signals) = signal_hook::iterator::Signals::new(handled) else { return };
    std::thread::spawn(move || {
        let mut is_terminated = false;
        for signal in signals.forever() {
            match &stop {
                Some(stop) if signal == SIGUSR1 => stop.ask(signal),
                Some(stop) if signal == SIGTERM && !is_terminated => {
                    is_terminated = true;
                    stop.ask(signal);
                    let terminal = terminal.clone();
                    std::thread::spawn(move || {
                        std::thread::sleep(Duration::from_secs(GRACE_S));
                        end(&terminal, 128 + signal);
                    });
                }
                _ => end(&terminal, 128 + signal),
            }
        }
    });
}

/// Without signals the next process with the same folder removes unfinished files.
#[cfg(not(unix))]
pub(super) fn handle(_: Terminal, _: Option<Stop>) {}

/// Signals that this process ignores, one bit each from signal 1 on; none where the system does not list them.
#[cfg(unix)]
fn ignored_signals() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    ignored.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0)
}

/// Removes unfinished files and ends the process.
#[cfg(unix)]
fn end(terminal: &Terminal, code: i32) {
    // No file is created while this guard is held.
    let _held = atomic::remove_all();
    if stderr().is_terminal() {
        // Leave the line of the progress bar.
        let _ = writeln!(stderr());
    }
    terminal.error("interrupted: files that are not finished were removed, earlier ones are as they were");
    std::process::exit(code);
}

/// A request to end. It comes by a signal and stays.
#[derive(Clone, Debug, Default)]
pub(super) struct Stop {
    /// Number of the signal; 0 before it.
    signal: Arc<AtomicI32>,
}

impl Stop {
    /// Whether it is time to end.
    pub fn is_asked(&self) -> bool {
        self.signal.load(Ordering::Relaxed) != 0
    }

    /// Exit code of a command that ended for it: 128 plus the number of the signal, as in shells.
    pub fn code(&self) -> u8 {
        u8::try_from(128 + self.signal.load(Ordering::Relaxed)).unwrap_or(u8::MAX)
    }

    /// Asks to end because of a signal. The exit code is that of the last one.
    #[cfg(unix)]
    pub fn ask(&self, signal: i32) {
        self.signal.store(signal, Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(line: &str) -> Vec<String> {
        line.split(' ').map(str::to_owned).collect()
    }

    #[test]
    fn one_frame_is_run_again_into_a_folder_of_its_own() {
        let again = |line| alone(&words(line), 7).join(" ");
        assert_eq!(again("run a.ron --out x --lens 2"), "run a.ron --lens 2 --frames 7..8 --out frame_7");
        assert_eq!(again("run --frames=0..9 a.ron --out=x"), "run a.ron --frames 7..8 --out frame_7");
        assert_eq!(again("chart timing --out x"), "chart timing --out x");
    }

    #[test]
    fn the_report_has_place_message_frame_and_command() {
        let crashes = Crashes::default();
        let crash = |place: &str, message: &str| Crash {
            place: place.to_owned(),
            message: message.to_owned(),
            backtrace: None,
        };
        crashes.recorded.lock().unwrap().extend([crash("a.rs:1", "other"), crash("b.rs:2", "broken")]);
        let payload = CrashedFrame { frame: 3, panic: Box::new("broken") };
        let report = crashes.report(&payload, &words("run tiny --seed 2"));
        for says in [
            "b.rs:2: internal error in frame 3: broken\n",
            env!("CARGO_PKG_VERSION"),
            "quintile run tiny --seed 2 --frames 3..4 --out frame_3",
        ] {
            assert!(report.contains(says), "{report}");
        }
        let plain = crashes.report(&"other".to_owned(), &words("list --json"));
        assert!(plain.starts_with("a.rs:1: internal error: other\n"), "{plain}");
        assert!(plain.ends_with("quintile list --json"), "{plain}");
    }

    #[cfg(unix)]
    #[test]
    fn a_request_stays_and_gives_the_exit_code() {
        let stop = Stop::default();
        assert!(!stop.is_asked());
        stop.clone().ask(10);
        assert!(stop.is_asked() && stop.code() == 138);
    }
}
