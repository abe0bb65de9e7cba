//! Interrupts (Ctrl-C), and the request of a scheduler to end, which work in steps follows between two steps.

#[cfg(unix)]
use std::io::{IsTerminal, Write, stderr};
use std::sync::Arc;
use std::sync::atomic::{AtomicI32, Ordering};
#[cfg(unix)]
use std::time::Duration;

use output::terminal::Terminal;
#[cfg(unix)]
use traces::io::atomic;

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
                Some(stop) if signal == SIGUSR1 => stop.request(signal),
                Some(stop) if signal == SIGTERM && !is_terminated => {
                    is_terminated = true;
                    stop.request(signal);
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
    pub fn is_requested(&self) -> bool {
        self.signal.load(Ordering::Relaxed) != 0
    }

    /// Exit code of a command that ended for it: 128 plus the number of the signal, as in shells.
    pub fn code(&self) -> u8 {
        u8::try_from(128 + self.signal.load(Ordering::Relaxed)).unwrap_or(u8::MAX)
    }

    /// Requests the end because of a signal. The exit code is that of the last one.
    #[cfg(unix)]
    pub fn request(&self, signal: i32) {
        self.signal.store(signal, Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    #[cfg(unix)]
    use super::*;

    #[cfg(unix)]
    #[test]
    fn a_request_stays_and_gives_the_exit_code() {
        let stop = Stop::default();
        assert!(!stop.is_requested());
        stop.clone().request(10);
        assert!(stop.is_requested() && stop.code() == 138);
    }
}
