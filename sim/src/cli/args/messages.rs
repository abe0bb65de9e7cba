//! Options of every command: how much is printed on standard error, and in which colours.

use std::ffi::OsString;

use clap::{Args, ColorChoice, ValueEnum};

use output::terminal::{Terminal, Verbosity};

/// Options of every command.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Messages")]
pub struct MessageArgs {
    /// Print results and errors only: no warnings, notes or progress bars
    #[arg(short, long, global = true)]
    pub quiet: bool,
    /// Print details of warnings and of the work
    #[arg(short, long, global = true)]
    pub verbose: bool,
    /// Colours of messages; `auto` shows them on a terminal unless NO_COLOR is set
    #[arg(long, global = true, value_name = "WHEN", default_value_t = ColorChoice::Auto)]
    pub color: ColorChoice,
}

impl MessageArgs {
    /// The terminal that these options describe.
    pub fn terminal(&self) -> Terminal {
        let verbosity = match (self.quiet, self.verbose) {
            (true, _) => Verbosity::Quiet,
            (false, true) => Verbosity::Verbose,
            (false, false) => Verbosity::Normal,
        };
        Terminal::new(verbosity, self.color)
    }
}

/// Value of `--color` among `args`, for errors of the parser itself.
pub(in crate::cli) fn color_of(args: &[OsString]) -> ColorChoice {
    let words = args.iter().map(|arg| arg.to_str().unwrap_or_default()).take_while(|arg| *arg != "--");
    let words: Vec<&str> = words.collect();
    let after = words.windows(2).filter(|two| two[0] == "--color").map(|two| two[1]);
    let joined = words.iter().filter_map(|word| word.strip_prefix("--color="));
    after.chain(joined).find_map(|word| ColorChoice::from_str(word, false).ok()).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn color_is_found_before_parsing() {
        let color = |args: &[&str]| color_of(&args.iter().map(OsString::from).collect::<Vec<_>>());
        assert_eq!(color(&["quintile", "run", "--color", "never"]), ColorChoice::Never);
        assert_eq!(color(&["quintile", "--color=always", "run"]), ColorChoice::Always);
        for args in [&["quintile", "--color"] as &[_], &["--color", "blue"], &["--", "--color=never"]] {
            assert_eq!(color(args), ColorChoice::Auto, "{args:?}");
        }
    }
}
