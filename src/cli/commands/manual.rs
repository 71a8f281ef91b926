//! `ridgeway completions` and `ridgeway man`.

use clap::CommandFactory;
use ridgeway::{Error, Result};

use crate::args::Cli;
use crate::report::print;

pub(super) fn completions(shell: clap_complete::Shell) -> Result<()> {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut Cli::command(), "ridgeway", &mut script);
    print(&String::from_utf8_lossy(&script))
}

pub(super) fn page() -> Result<()> {
    let mut page = Vec::new();
    clap_mangen::Man::new(Cli::command())
        .render(&mut page)
        .map_err(|source| Error::io("standard output", source))?;
    print(&String::from_utf8_lossy(&page))
}
