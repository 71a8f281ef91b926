//! Progress on the terminal, and Ctrl-C.

use std::io::IsTerminal;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressFinish, ProgressStyle};
use ridgeway::{CancelToken, Control};

use crate::args::RunArgs;

/// Work shorter than this shows no bar.
const PATIENCE: Duration = Duration::from_secs(1);

/// How to run: cancelled by Ctrl-C, progress as the flags ask.
pub(crate) fn control(run: &RunArgs) -> Control {
    let terminal = std::io::stderr().is_terminal();
    let progress = if run.quiet {
        None
    } else if terminal {
        Some(bar(if run.progress { Duration::ZERO } else { PATIENCE }))
    } else if run.progress {
        Some(lines())
    } else {
        None
    };
    Control { cancel: cancel_on_interrupt(), progress }
}

/// The first Ctrl-C asks the work to stop and tidy up, the second one ends the process.
fn cancel_on_interrupt() -> CancelToken {
    let token = CancelToken::default();
    let handler = token.clone();
    // Without a handler Ctrl-C ends the process as usual, so a failure to install one is harmless.
    let _ = ctrlc::set_handler(move || {
        if handler.is_cancelled() {
            std::process::exit(130);
        }
        handler.cancel();
    });
    token
}

/// A bar with the name of the stage; it vanishes when the stage is done.
fn bar(patience: Duration) -> ridgeway::Progress {
    let style = ProgressStyle::with_template("{msg:>20} {wide_bar} {percent:>3} %")
        .unwrap_or_else(|_| ProgressStyle::default_bar());
    let begun = Instant::now();
    let current: Mutex<Option<ProgressBar>> = Mutex::new(None);
    Arc::new(move |stage: &str, done: f64| {
        let Ok(mut current) = current.lock() else { return };
        if done >= 1.0 {
            if let Some(bar) = current.take() {
                bar.finish_and_clear();
            }
        } else if begun.elapsed() >= patience {
            let new = || ProgressBar::new(1000).with_style(style.clone());
            let bar = current.get_or_insert_with(|| new().with_finish(ProgressFinish::AndClear));
            if bar.message() != stage {
                bar.set_message(stage.to_owned());
            }
            bar.set_position((done * 1000.0) as u64);
        }
    })
}

/// A line per stage, for logs.
fn lines() -> ridgeway::Progress {
    let last = Mutex::new(String::new());
    Arc::new(move |stage: &str, _: f64| {
        let Ok(mut last) = last.lock() else { return };
        if *last != stage {
            eprintln!("{stage}");
            stage.clone_into(&mut last);
        }
    })
}
