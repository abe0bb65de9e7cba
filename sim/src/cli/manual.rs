//! `quintile completions` and `quintile man`, generated from the declarations of arguments.

use std::io;
use std::path::Path;

use clap::CommandFactory;
use clap_mangen::Man;
use traces::io::atomic;

use super::{Cli, CompletionsArgs, Failure, ManArgs};

use super::outputs::print;

pub(super) fn completions(args: &CompletionsArgs) -> Result<(), Failure> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::command(), "quintile", &mut script);
    print(&String::from_utf8_lossy(&script))
}

pub(super) fn man(args: &ManArgs) -> Result<(), Failure> {
    let mut command = Cli::command();
    command.build();
    let Some(folder) = args.folder.as_ref().or(args.out.as_ref()) else {
        return print(&String::from_utf8_lossy(
            &page(&command).map_err(|error| failed("manual page", &error))?,
        ));
    };
    std::fs::create_dir_all(folder).map_err(|error| failed(&folder.display().to_string(), &error))?;
    let pages = write_pages(&command, folder)?;
    print(&format!("{}: {pages} manual pages", folder.display()))
}

/// Writes the pages of `command` and its subcommands; returns their number.
fn write_pages(command: &clap::Command, folder: &Path) -> Result<usize, Failure> {
    // The built name of a subcommand contains that of its parent, separated by a hyphen.
    let name = command.get_display_name().unwrap_or_else(|| command.get_name());
    let path = folder.join(format!("{name}.1"));
    let bytes = page(command).map_err(|error| failed(&path.display().to_string(), &error))?;
    atomic::write_file(&path, |file| io::Write::write_all(file, &bytes))?;
    let below = command.get_subcommands().filter(|below| below.get_name() != "help" && !below.is_hide_set());
    below.map(|below| write_pages(below, folder)).try_fold(1, |pages, more| Ok(pages + more?))
}

fn page(command: &clap::Command) -> io::Result<Vec<u8>> {
    let mut page = Vec::new();
    Man::new(command.clone()).render(&mut page)?;
    Ok(page)
}

fn failed(what: &str, error: &io::Error) -> Failure {
    Failure { message: format!("{what}: cannot be written: {error}"), code: 1 }
}
