//! Rounds of independent jobs on all threads, with little between them.
//!
//! A round lasts less than 100 µs. Waking sleeping threads for each would cost as much as it gains, so the helpers stay
//! awake for the whole solve, watching for the next round. The leader never waits for a helper that has not
//! taken a job, so a helper that the system does not run delays nobody.
//!
//! What one core has written costs another some 100 ns per cache line to read. So jobs come in order of place, and each thread
//! begins at a place of its own: from round to round it gets jobs near those it had.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError, RwLock};
use std::{hint, thread};

use crate::Result;

/// Fewest jobs of a round that are worth calling helpers for.
const MIN_PARALLEL: usize = 4;
/// Jobs that the leader does alone before it calls helpers: half a millisecond, ten times what calling one takes. Small solves, of
/// which there are thousands in a segmentation, have none.
const ALONE: usize = 128;
/// Glances at the next round before a helper lets other threads run.
const GLANCES: u32 = 1000;

/// What the crew shares.
#[derive(Debug)]
struct Deck<S, O> {
    table: RwLock<Table<S, O>>,
    /// How many jobs of the round are done.
    done: AtomicUsize,
    /// Number of the round, also in the table; 0 when all is over.
    round: AtomicUsize,
}

/// Written by the leader between rounds, read by all in them.
#[derive(Debug)]
struct Table<S, O> {
    state: S,
    round: usize,
    jobs: usize,
    crew: usize,
    slots: Vec<Slot<O>>,
}

/// A job of the round.
#[derive(Debug, Default)]
struct Slot<O> {
    /// The last round in which somebody took it.
    taken: AtomicUsize,
    outcome: Mutex<O>,
}

/// Alternates `lead`, which alone changes the state and says how many jobs the next round has, with `work` on those
/// jobs by all threads, until there are none. `lead` is given the outcomes of the round before in the order of the
/// jobs. `work` has a bench to itself.
///
/// # Errors
/// What `lead` returns.
pub(super) fn run<S: Send + Sync, O: Default + Send, B: Default>(
    state: S,
    mut lead: impl FnMut(&mut S, &mut dyn Iterator<Item = O>) -> Result<usize>,
    work: impl Fn(&mut B, &S, usize) -> O + Sync,
) -> Result<S> {
    let deck = Deck {
        table: RwLock::new(Table { state, round: 1, jobs: 0, crew: 1, slots: Vec::new() }),
        done: AtomicUsize::new(0),
        round: AtomicUsize::new(1),
    };
    thread::scope(|scope| {
        let _over = OnDrop(|| deck.round.store(0, Ordering::Release));
        let mut bench = B::default();
        let mut crew = 1;
        let mut before = 0;
        loop {
            let jobs = deck.begin_round(crew, &mut lead)?;
            if jobs == 0 {
                return Ok(());
            }
            let deck = &deck;
            let work = &work;
            let pays = jobs >= MIN_PARALLEL && before >= ALONE;
            before += jobs;
            while pays && crew < rayon::current_num_threads() {
                scope.spawn(move || deck.help(crew, work));
                crew += 1;
            }
            deck.round.fetch_add(1, Ordering::Release);
            deck.take_jobs(0, &mut bench, work);
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
        crew: usize,
        lead: &mut impl FnMut(&mut S, &mut dyn Iterator<Item = O>) -> Result<usize>,
    ) -> Result<usize> {
        let mut table = self.table.write().unwrap_or_else(PoisonError::into_inner);
        table.crew = crew;
        table.round += 1;
        let Table { state, jobs, slots, .. } = &mut *table;
        let mut finished = slots[..*jobs].iter_mut().map(|slot| {
            std::mem::take(slot.outcome.get_mut().unwrap_or_else(PoisonError::into_inner))
        });
        *jobs = lead(state, &mut finished)?;
        if *jobs > slots.len() {
            slots.resize_with(*jobs, Slot::default);
        }
        self.done.store(0, Ordering::Relaxed);
        Ok(*jobs)
    }

    /// Does jobs until all of the round are taken.
    fn take_jobs<B>(&self, member: usize, bench: &mut B, work: &impl Fn(&mut B, &S, usize) -> O) {
        // Jobs are taken under the lock, so that job and round belong together.
        let table = self.table.read().unwrap_or_else(PoisonError::into_inner);
        for index in order(member, table.crew, table.jobs) {
            let slot = &table.slots[index];
            if slot.taken.load(Ordering::Relaxed) == table.round
                || slot.taken.swap(table.round, Ordering::Relaxed) == table.round
            {
                continue;
            }
            let _done = OnDrop(|| {
                self.done.fetch_add(1, Ordering::Release);
            });
            let outcome = work(bench, &table.state, index);
            *slot.outcome.lock().unwrap_or_else(PoisonError::into_inner) = outcome;
        }
    }

    /// Joins every round until all is over.
    fn help<B: Default>(&self, member: usize, work: &impl Fn(&mut B, &S, usize) -> O) {
        let mut bench = B::default();
        let mut seen = 0;
        let mut glances = 0;
        loop {
            match self.round.load(Ordering::Acquire) {
                0 => return,
                round if round != seen => {
                    (seen, glances) = (round, 0);
                    self.take_jobs(member, &mut bench, work);
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

/// The order in which a member of the crew looks for jobs: the jobs in a circle, from its own part on; every other
/// member backwards from the end of its part, so that two meet in the middle.
fn order(member: usize, crew: usize, jobs: usize) -> impl Iterator<Item = usize> {
    let backwards = member % 2 == 1;
    let first = (member + usize::from(backwards)) * jobs / crew.max(member + 1);
    (0..jobs).map(move |step| match backwards {
        false => (first + step) % jobs,
        true => (first + jobs - 1 - step) % jobs,
    })
}

/// Also when a job panics, so that nobody waits for it for ever.
struct OnDrop<F: Fn()>(F);

impl<F: Fn()> Drop for OnDrop<F> {
    fn drop(&mut self) {
        (self.0)();
    }
}
