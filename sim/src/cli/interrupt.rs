//! Handling of interrupts (Ctrl-C).

use std::io::{IsTerminal, Write, stderr};

use traces::io::unfinished;

use output::terminal::Terminal;

/// Exit code after an interrupt, as in shells: 128 plus the number of the signal.
const EXIT_CODE: i32 = 130;

/// Installs a handler for interrupt, termination and hang-up. It removes unfinished files, prints a message
/// and ends the process.
pub(super) fn handle(terminal: Terminal) {
    let end = move || {
        // No file is created while this guard is held.
        let _held = unfinished::remove_all();
        if stderr().is_terminal() {
            // Leave the line of the progress bar.
            let _ = writeln!(stderr());
        }
        terminal.error("interrupted: unfinished results were removed, earlier ones are as they were");
        std::process::exit(EXIT_CODE);
    };
    // Signals that are already ignored or handled (nohup) stay so. The next process with the same folder then
    // removes unfinished files.
    let _ = ctrlc::try_set_handler(end);
}
