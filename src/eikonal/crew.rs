//! Rounds of independent jobs on all threads, with little between them.
//!
//! A round lasts some 100 µs. Waking sleeping threads for each would cost as much as it gains, so the helpers stay
//! awake for the whole solve, watching for the next round. The leader never waits for a helper that has not
//! taken a job, so a helper that the system does not run delays nobody.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError, RwLock};
use std::{hint, thread};

use crate::Result;

/// Fewest jobs of a round that are worth calling helpers for.
const MIN_PARALLEL: usize = 4;
/// Glances at the next round before a helper lets other threads run.
const GLANCES: u32 = 1000;

/// What the crew shares.
#[derive(Debug)]
struct Deck<S, O> {
    table: RwLock<Table<S, O>>,
    /// The next job of the round to be taken.
    next: AtomicUsize,
    /// How many jobs of the round are done.
    done: AtomicUsize,
    /// Number of the round; 0 when all is over.
    round: AtomicUsize,
}

/// Written by the leader between rounds, read by all in them.
#[derive(Debug)]
struct Table<S, O> {
    state: S,
    jobs: usize,
    outcomes: Vec<Mutex<O>>,
}

/// Alternates `lead`, which alone changes the state and says how many jobs the next round has, with `work` on those
/// jobs by all threads, until there are none. `lead` is given the outcomes of the round before in the order of the
/// jobs. `work` has a bench to itself.
///
/// # Errors
/// What `lead` returns.
pub(super) fn run<S: Send + Sync, O: Default + Send, B: Default>(
    state: S,
    mut lead: impl FnMut(&mut S, &mut dyn Iterator<Item = &O>) -> Result<usize>,
    work: impl Fn(&mut B, &S, usize, &mut O) + Sync,
) -> Result<S> {
    let deck = Deck {
        table: RwLock::new(Table { state, jobs: 0, outcomes: Vec::new() }),
        next: AtomicUsize::new(0),
        done: AtomicUsize::new(0),
        round: AtomicUsize::new(1),
    };
    thread::scope(|scope| {
        let _over = OnDrop(|| deck.round.store(0, Ordering::Release));
        let mut bench = B::default();
        let mut helpers = 0;
        loop {
            let jobs = deck.begin_round(&mut lead)?;
            if jobs == 0 {
                return Ok(());
            }
            if jobs >= MIN_PARALLEL {
                while helpers + 1 < rayon::current_num_threads() {
                    scope.spawn(|| deck.help(&work));
                    helpers += 1;
                }
            }
            deck.round.fetch_add(1, Ordering::Release);
            deck.take_jobs(&mut bench, &work);
            while deck.done.load(Ordering::Acquire) < jobs {
                hint::spin_loop();
            }
        }
    })?;
    Ok(deck.table.into_inner().unwrap_or_else(PoisonError::into_inner).state)
}

impl<S, O: Default> Deck<S, O> {
    fn begin_round(
        &self,
        lead: &mut impl FnMut(&mut S, &mut dyn Iterator<Item = &O>) -> Result<usize>,
    ) -> Result<usize> {
        let mut table = self.table.write().unwrap_or_else(PoisonError::into_inner);
        let Table { state, jobs, outcomes } = &mut *table;
        let mut finished = outcomes[..*jobs]
            .iter_mut()
            .map(|outcome| &*outcome.get_mut().unwrap_or_else(PoisonError::into_inner));
        *jobs = lead(state, &mut finished)?;
        if *jobs > outcomes.len() {
            outcomes.resize_with(*jobs, Mutex::default);
        }
        self.next.store(0, Ordering::Relaxed);
        self.done.store(0, Ordering::Relaxed);
        Ok(*jobs)
    }

    /// Does jobs until all of the round are taken.
    fn take_jobs<B>(&self, bench: &mut B, work: &impl Fn(&mut B, &S, usize, &mut O)) {
        // Jobs are taken under the lock, so that job and round belong together.
        let table = self.table.read().unwrap_or_else(PoisonError::into_inner);
        loop {
            let index = self.next.fetch_add(1, Ordering::Relaxed);
            if index >= table.jobs {
                return;
            }
            let _done = OnDrop(|| {
                self.done.fetch_add(1, Ordering::Release);
            });
            let mut outcome = table.outcomes[index].lock().unwrap_or_else(PoisonError::into_inner);
            work(bench, &table.state, index, &mut outcome);
        }
    }

    /// Joins every round until all is over.
    fn help<B: Default>(&self, work: &impl Fn(&mut B, &S, usize, &mut O)) {
        let mut bench = B::default();
        let mut seen = 0;
        let mut glances = 0;
        loop {
            match self.round.load(Ordering::Acquire) {
                0 => return,
                round if round != seen => {
                    (seen, glances) = (round, 0);
                    self.take_jobs(&mut bench, work);
                }
                _ if glances < GLANCES => {
                    glances += 1;
                    hint::spin_loop();
                }
                _ => thread::yield_now(),
            }
        }
    }
}

/// Also when a job panics, so that nobody waits for it for ever.
struct OnDrop<F: Fn()>(F);

impl<F: Fn()> Drop for OnDrop<F> {
    fn drop(&mut self) {
        (self.0)();
    }
}
