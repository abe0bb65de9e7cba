//! Messages on standard error: errors, warnings, notes and details, coloured where the terminal shows colours.

use std::io::{Write, stderr};

use anstream::AutoStream;
use anstyle::{AnsiColor, Style};
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_follow_the_choice() {
        let [always, never] =
            [ColorChoice::Always, ColorChoice::Never].map(|choice| Terminal::new(Verbosity::Normal, choice));
        assert!(always.coloured && !never.coloured);
    }
}
