//! The commands, one file each.

mod compare;
mod distance;
mod info;
mod manual;
mod matching;
mod render;
mod route;
mod segment;
mod surface;
mod synth;

use crate::args::{Cli, Command};
use crate::failure::{Failure, Result};
use crate::progress;

/// Runs what the user asked for.
pub(crate) fn run(cli: &Cli) -> Result<()> {
    if let Some(threads) = cli.run.threads {
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads.into())
            .build_global()
            .map_err(|error| Failure::usage(format!("--threads {threads}: {error}")))?;
    }
    let control = progress::control(&cli.run);
    let run = &cli.run;
    match &cli.command {
        Command::Info(args) => info::run(args, run),
        Command::Synth(args) => synth::run(args, run, &control),
        Command::Surface(args) => surface::run(args, run, &control),
        Command::Distance(args) => distance::run(args, run, &control),
        Command::Route(args) => route::run(args, run, &control),
        Command::Compare(args) => compare::run(args, run, &control),
        Command::Segment(args) => segment::run(args, run, &control),
        Command::Match(args) => matching::run(args, run, &control),
        Command::Render(args) => render::run(args, run, &control),
        Command::Completions { shell } => manual::completions(*shell),
        Command::Man => manual::page(),
    }
}
