//! Progress bars: on a terminal, and nowhere else; and the messages printed above them.

use std::io::{IsTerminal, stderr};

use indicatif::{MultiProgress, ProgressBar, ProgressDrawTarget, ProgressStyle};
use warnings::Warning;

use super::terminal::{Terminal, Verbosity};

/// The bars of a run, drawn to standard error, and messages between them. They may be used from any thread.
#[derive(Clone, Debug)]
pub struct Progress {
    bars: MultiProgress,
    terminal: Terminal,
}

impl Progress {
    /// Bars without colours on standard error; with `quiet` no bars and no messages.
    pub fn new(quiet: bool) -> Self {
        let verbosity = if quiet { Verbosity::Quiet } else { Verbosity::Normal };
        Self::on(&Terminal::new(verbosity, clap::ColorChoice::Never), quiet)
    }

    /// Bars on standard error; none where the terminal is quiet, where `hidden`, or where standard error is no terminal.
    pub fn on(terminal: &Terminal, hidden: bool) -> Self {
        let silent = hidden || terminal.verbosity() == Verbosity::Quiet || !stderr().is_terminal();
        let target = if silent { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr() };
        Self { bars: MultiProgress::with_draw_target(target), terminal: terminal.clone() }
    }

    /// Whether nothing will be drawn.
    pub fn is_silent(&self) -> bool {
        self.bars.is_hidden()
    }

    /// A new bar below the others, for `length` steps of the work called `label`.
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

    /// Prints a note above the bars, unless the terminal is quiet; also where no bars are drawn.
    pub fn note(&self, message: &str) {
        self.bars.suspend(|| self.terminal.note(message));
    }

    /// Prints a warning above the bars, unless the terminal is quiet; also where no bars are drawn.
    pub fn warn(&self, warning: &Warning) {
        self.bars.suspend(|| self.terminal.warn(warning));
    }

    /// Prints a detail above the bars where details are wanted.
    pub fn detail(&self, message: &str) {
        self.bars.suspend(|| self.terminal.detail(message));
    }
}

/// One bar; it stays on the screen, where it got to, when dropped.
#[derive(Debug)]
pub struct Bar {
    bar: ProgressBar,
}

impl Bar {
    /// One step done.
    pub fn inc(&self) {
        self.bar.inc(1);
    }

    /// So many steps done.
    pub fn set(&self, position: u64) {
        self.bar.set_position(position);
    }

    /// Steps done so far.
    pub fn position(&self) -> u64 {
        self.bar.position()
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
    fn quiet_means_silent() {
        let progress = Progress::new(true);
        assert!(progress.is_silent() && Progress::on(&Terminal::default(), true).is_silent());
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
        assert_eq!(bar.position(), 400);
    }
}
