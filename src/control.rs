//! How a long computation runs: cancelling and progress.
//!
//! Threads are rayon's: work runs on the current rayon pool, so a caller chooses their number with
//! [`rayon::ThreadPool::install`] or the global pool. No result depends on it, not in one bit.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::error::{Error, Result};

/// A flag that asks running work to stop. Clones share the flag.
#[derive(Clone, Debug, Default)]
pub struct CancelToken(Arc<AtomicBool>);

impl CancelToken {
    /// Asks the work to stop at its next check.
    pub fn cancel(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Whether the work was asked to stop.
    #[must_use]
    pub fn is_cancelled(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// Called with the name of the stage and the share of it that is done, 0 to 1; from any thread that works on it.
pub type Progress = Arc<dyn Fn(&str, f64) + Send + Sync>;

/// How to run: where to look for a request to cancel, where to report progress.
#[derive(Clone, Default)]
pub struct Control {
    /// Checked often while surfaces are fitted, metrics sampled, distances solved, regions cut and maps painted; not while files
    /// are read and routes traced.
    pub cancel: CancelToken,
    /// Called with progress; `None` (the default) for silence.
    pub progress: Option<Progress>,
}

impl Control {
    /// Reports that a share `done` (0 to 1) of `stage` is complete.
    pub fn report(&self, stage: &str, done: f64) {
        if let Some(progress) = &self.progress {
            progress(stage, done);
        }
    }

    /// The same for a part of the work whose progress is not reported.
    pub(crate) fn quiet(&self) -> Self {
        Self { cancel: self.cancel.clone(), progress: None }
    }

    /// Lets the work go on unless it was cancelled.
    ///
    /// # Errors
    /// [`Error::Cancelled`] if it was.
    pub fn check(&self) -> Result<()> {
        if self.cancel.is_cancelled() { Err(Error::Cancelled) } else { Ok(()) }
    }
}

impl fmt::Debug for Control {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Control")
            .field("cancel", &self.cancel)
            .field("progress", &self.progress.is_some())
            .finish()
    }
}
