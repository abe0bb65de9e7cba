//! The terminal: errors, warnings, notes and details on standard error, coloured where it shows colours, and
//! progress bars below them.

use std::io::{IsTerminal, Write, stderr};

use anstream::AutoStream;
use anstyle::{AnsiColor, Style};
use indicatif::{MultiProgress, ProgressBar, ProgressDrawTarget, ProgressStyle};
use warnings::{Code, Warning};

pub use anstream::ColorChoice;

/// Amount of messages on standard error. Results on standard output do not depend on it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Verbosity {
    /// Errors only.
    Quiet,
    /// Errors, warnings, notes and, on a terminal, progress.
    #[default]
    Normal,
    /// The same with details.
    Verbose,
}

/// Standard error with its verbosity and colours. It is created once from the command line and usable from
/// any thread.
#[derive(Clone, Debug, Default)]
pub struct Terminal {
    verbosity: Verbosity,
    coloured: bool,
}

impl Terminal {
    /// A terminal for messages up to `verbosity`. With [`ColorChoice::Auto`] colours depend on standard error and on
    /// the variables `NO_COLOR`, `CLICOLOR`, `CLICOLOR_FORCE` and `TERM`.
    pub fn new(verbosity: Verbosity, colour: ColorChoice) -> Self {
        let coloured = match colour {
            ColorChoice::Always | ColorChoice::AlwaysAnsi => true,
            ColorChoice::Never => false,
            ColorChoice::Auto => AutoStream::choice(&stderr()) != ColorChoice::Never,
        };
        Self { verbosity, coloured }
    }

    /// Amount of messages.
    pub fn verbosity(&self) -> Verbosity {
        self.verbosity
    }

    /// Prints an error.
    pub fn error(&self, message: &str) {
        self.line("error", AnsiColor::Red.on_default().bold(), message);
    }

    /// Prints a warning with its code on one line, unless quiet. Under `--verbose` each detail has a line,
    /// too.
    pub fn warn(&self, warning: &Warning) {
        if self.verbosity < Verbosity::Verbose || warning.details.len() < 2 {
            return self.warn_of(warning.code, &warning.line());
        }
        self.warn_of(warning.code, &warning.message);
        warning.details.iter().for_each(|detail| self.detail(detail));
        if warning.omitted() > 0 {
            self.detail(&format!("and {} more", warning.omitted()));
        }
    }

    /// Prints a warning of this code, unless quiet.
    pub fn warn_of(&self, code: Code, message: &str) {
        if self.verbosity >= Verbosity::Normal {
            self.line("warning", AnsiColor::Yellow.on_default().bold(), &format!("[{code}] {message}"));
        }
    }

    /// Prints a note that does not affect results, unless quiet.
    pub fn note(&self, message: &str) {
        if self.verbosity >= Verbosity::Normal {
            self.line("note", AnsiColor::Cyan.on_default().bold(), message);
        }
    }

    /// Prints a detail under `--verbose`.
    pub fn detail(&self, message: &str) {
        if self.verbosity >= Verbosity::Verbose {
            self.line("detail", Style::new().dimmed(), message);
        }
    }

    /// Writes a line at once, so that lines of several threads do not mix. Errors of standard error are
    /// ignored.
    fn line(&self, kind: &str, style: Style, message: &str) {
        let line = match self.coloured {
            true => format!("{style}{kind}:{style:#} {message}\n"),
            false => format!("{kind}: {message}\n"),
        };
        let _ = stderr().lock().write_all(line.as_bytes());
    }
}

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
    fn colours_follow_the_choice() {
        let [always, never] =
            [ColorChoice::Always, ColorChoice::Never].map(|choice| Terminal::new(Verbosity::Normal, choice));
        assert!(always.coloured && !never.coloured);
    }

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
