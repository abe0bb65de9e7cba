//! Progress bars on a terminal, and messages printed above them.

use std::io::{IsTerminal, stderr};

use indicatif::{MultiProgress, ProgressBar, ProgressDrawTarget, ProgressStyle};
use warnings::Warning;

use super::terminal::{ColorChoice, Terminal, Verbosity};

/// Progress bars and messages on standard error; usable from any thread.
#[derive(Clone, Debug)]
pub struct Progress {
    bars: MultiProgress,
    terminal: Terminal,
}

impl Progress {
    /// Bars without colours on standard error; `quiet` hides bars and messages.
    pub fn new(quiet: bool) -> Self {
        let verbosity = if quiet { Verbosity::Quiet } else { Verbosity::Normal };
        Self::on(&Terminal::new(verbosity, ColorChoice::Never), quiet)
    }

    /// Bars on standard error. They are hidden if the terminal is quiet, if `hidden`, or if standard error is
    /// not a terminal.
    pub fn on(terminal: &Terminal, hidden: bool) -> Self {
        let silent = hidden || terminal.verbosity() == Verbosity::Quiet || !stderr().is_terminal();
        let target = if silent { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr() };
        Self { bars: MultiProgress::with_draw_target(target), terminal: terminal.clone() }
    }

    /// Adds a bar below the others, for `length` steps of the work `label`.
    pub fn bar(&self, label: &str, length: u64) -> Bar {
        let bar = self.bars.add(ProgressBar::new(length));
        if let Ok(style) =
            ProgressStyle::with_template("{prefix:>12} {bar:32} {pos}/{len} {elapsed} (left {eta})")
        {
            bar.set_style(style);
        }
        bar.set_prefix(label.to_owned());
        Bar { bar }
    }

    /// Prints a note above the bars, also if bars are hidden; not on a quiet terminal.
    pub fn note(&self, message: &str) {
        self.bars.suspend(|| self.terminal.note(message));
    }

    /// Prints a warning above the bars, also if bars are hidden; not on a quiet terminal.
    pub fn warn(&self, warning: &Warning) {
        self.bars.suspend(|| self.terminal.warn(warning));
    }

    /// Prints a detail above the bars, under `--verbose`.
    pub fn detail(&self, message: &str) {
        self.bars.suspend(|| self.terminal.detail(message));
    }
}

/// A progress bar. It stays on the screen when dropped.
#[derive(Debug)]
pub struct Bar {
    bar: ProgressBar,
}

impl Bar {
    /// Adds one finished step.
    pub fn inc(&self) {
        self.bar.inc(1);
    }

    /// Sets the number of finished steps.
    pub fn set(&self, position: u64) {
        self.bar.set_position(position);
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        self.bar.abandon();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quiet_hides_bars() {
        let progress = Progress::new(true);
        assert!(progress.bars.is_hidden() && Progress::on(&Terminal::default(), true).bars.is_hidden());
        progress.note("unseen");
    }

    #[test]
    fn threads_share_a_bar() {
        let progress = Progress::new(true);
        let bar = progress.bar("frames", 400);
        std::thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| (0..100).for_each(|_| bar.inc()));
            }
        });
        assert_eq!(bar.bar.position(), 400);
    }
}
