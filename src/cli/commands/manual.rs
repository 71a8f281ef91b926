//! `ridgeway completions` and `ridgeway man`.

use clap::CommandFactory;
use ridgeway::Error;

use crate::args::Cli;
use crate::failure::Result;
use crate::report::print;

pub(super) fn completions(shell: clap_complete::Shell) -> Result<()> {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut Cli::command(), "ridgeway", &mut script);
    print(&String::from_utf8_lossy(&script))
}

/// The page of the command, followed by one for each of its own.
pub(super) fn page() -> Result<()> {
    let mut command = Cli::command();
    command.build();
    let commands = command.get_subcommands().filter(|c| !c.is_hide_set() && c.get_name() != "help");
    let mut pages = Vec::new();
    for command in std::iter::once(&command).chain(commands) {
        clap_mangen::Man::new(command.clone())
            .render(&mut pages)
            .map_err(|source| Error::io("standard output", source))?;
    }
    print(&String::from_utf8_lossy(&pages))
}
