//! The report of a crash: its place, and the command that repeats the frame.

use std::any::Any;
use std::backtrace::{Backtrace, BacktraceStatus};
use std::sync::{Arc, Mutex, PoisonError};

use output::table::shell_line;
use run::{CrashedFrame, panic_message};

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
}
