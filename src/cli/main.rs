//! The `ridgeway` command.

mod args;
mod commands;
mod output;
mod places;
mod plan;
mod progress;
mod report;

use std::process::ExitCode;

use clap::Parser;

fn main() -> ExitCode {
    match commands::run(&args::Cli::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {}", report::explain(&error));
            ExitCode::from(report::exit_code(&error))
        }
    }
}
