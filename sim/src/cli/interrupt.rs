//! What an interrupt (Ctrl-C) does.

use std::io::{IsTerminal, Write, stderr};

use traces::io::unfinished;

use output::terminal::Terminal;

/// The exit code of a process that an interrupt ended, as shells have it: 128 and the number of the signal.
const CODE: i32 = 130;

/// From now on an interrupt removes unfinished files, says so and ends the process. So do a request to terminate and a hang-up.
pub(super) fn handle(terminal: Terminal) {
    let end = move || {
        // Nothing is made any more while this is held.
        let _held = unfinished::remove_all();
        if stderr().is_terminal() {
            // Off the line of a progress bar.
            let _ = writeln!(stderr());
        }
        terminal.error("interrupted: unfinished results were removed, earlier ones are as they were");
        std::process::exit(CODE);
    };
    // Whoever started the program with signals ignored or handled (nohup) wants them so. What a process then leaves behind, the next
    // one with the same folder removes.
    let _ = ctrlc::try_set_handler(end);
}
