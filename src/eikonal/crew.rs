//! Rounds of independent jobs on all threads, with little between them.
//!
//! A round lasts 10 to 100 µs. Waking sleeping threads for each would cost as much as it gains, so the helpers, threads of the
//! pool, stay awake for the whole solve, watching for the next round. The leader never waits for a helper that has not
//! taken a job, so one that is busy elsewhere delays no round; only the end of a solve that is led from outside the pool waits until
//! its threads have looked. (Threads made for a solve were at times put on the leader's own core and
//! stayed there for milliseconds: two threads then gained 1.3 to 1.6 instead of 1.65 to 1.75.)
//!
//! What one core has written costs another some 100 ns per cache line to read. So jobs come in order of place, and each thread
//! begins at a place of its own: from round to round it gets jobs near those it had. And so little is shared: the
//! number of the round, the jobs as plain numbers side by side, who took which, and a tray of outcomes for each thread. For a round of
//! twelve two threads need 1.4 µs more than half of what one needs; with a lock around the jobs and one around each outcome it was 1.9.

use std::cell::Cell;
use std::sync::atomic::{AtomicU32, AtomicU64, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::{hint, thread};

use crate::Result;

/// Fewest jobs of a round that are worth calling helpers for.
const MIN_PARALLEL: usize = 4;
/// Jobs that the leader does alone before it calls helpers: some 50 µs, so that the smallest solves, of which there are thousands in
/// a segmentation, have none. With 256 a solve at 200² took a quarter longer on two threads, at 400² a tenth.
const ALONE: usize = 16;
/// Glances at the next round before a helper lets other threads run.
const GLANCES: u32 = 1000;

/// What the crew shares. Aligned so that what is written at different times lies in different cache lines.
#[derive(Debug)]
struct Deck<O> {
    round: Apart<AtomicU64>,
    /// How many jobs of the round are done.
    done: Apart<AtomicUsize>,
    jobs: Vec<AtomicU64>,
    /// The last round in which somebody took each job.
    taken: Vec<AtomicU32>,
    /// What each member brought.
    trays: Vec<Apart<Tray<O>>>,
}

/// Outcomes with the places of their jobs.
type Tray<O> = Mutex<Vec<(usize, O)>>;

#[derive(Debug, Default)]
#[repr(align(128))]
struct Apart<T>(T);

/// A round as a number: its own, counted from 1, and that of its jobs.
#[derive(Clone, Copy, PartialEq, Eq)]
struct Round {
    number: u32,
    jobs: u32,
}

impl Round {
    /// After the last round.
    const OVER: u64 = 0;

    fn to_bits(self) -> u64 {
        u64::from(self.number) << 32 | u64::from(self.jobs)
    }

    fn from_bits(bits: u64) -> Self {
        Self { number: (bits >> 32) as u32, jobs: bits as u32 }
    }
}

/// Alternates `lead`, which is given the jobs of a round and their outcomes and puts those of the next in their place, with `work`
/// on these by all threads, until there are none. A round has at most `most` jobs. `work` has a bench to itself.
///
/// # Errors
/// What `lead` returns.
pub(super) fn run<O: Default + Send, B: Default>(
    most: usize,
    mut lead: impl FnMut(&mut Vec<u64>, &[O]) -> Result<()>,
    work: impl Fn(&mut B, u64) -> O + Sync,
) -> Result<()> {
    let members = rayon::current_num_threads();
    let mut bench = B::default();
    let (mut jobs, mut outcomes) = (Vec::new(), Vec::new());
    let mut before = 0;
    loop {
        lead(&mut jobs, &outcomes)?;
        if jobs.is_empty() {
            return Ok(());
        }
        if members > 1 && before >= ALONE && jobs.len() >= MIN_PARALLEL {
            break;
        }
        before += jobs.len();
        outcomes.clear();
        outcomes.extend(jobs.iter().map(|&job| work(&mut bench, job)));
    }
    let deck = Deck {
        round: Apart::default(),
        done: Apart::default(),
        jobs: (0..most).map(|_| AtomicU64::new(0)).collect(),
        taken: (0..most).map(|_| AtomicU32::new(0)).collect(),
        trays: (0..members).map(|_| Apart::default()).collect(),
    };
    deck.round.0.store(Round { number: 1, jobs: 0 }.to_bits(), Ordering::Relaxed);
    rayon::in_place_scope(|scope| {
        let _over = OnDrop(|| deck.round.0.store(Round::OVER, Ordering::Release));
        let (deck, work) = (&deck, &work);
        for helper in 1..members {
            scope.spawn(move |_| deck.help(helper, work));
        }
        let mut mine = Vec::new();
        for number in 2.. {
            let round = deck.begin(number, &jobs);
            deck.take_jobs(0, round, &mut mine, |job| work(&mut bench, job));
            while deck.done.0.load(Ordering::Acquire) < jobs.len() {
                hint::spin_loop();
            }
            deck.collect(jobs.len(), &mut outcomes);
            lead(&mut jobs, &outcomes)?;
            if jobs.is_empty() {
                break;
            }
        }
        Ok(())
    })
}

impl<O: Default> Deck<O> {
    fn begin(&self, number: u32, jobs: &[u64]) -> Round {
        for (place, &job) in self.jobs.iter().zip(jobs) {
            place.store(job, Ordering::Relaxed);
        }
        self.done.0.store(0, Ordering::Relaxed);
        let round = Round { number, jobs: jobs.len() as u32 };
        self.round.0.store(round.to_bits(), Ordering::Release);
        round
    }

    /// Does jobs until all of the round are taken. `mine` is empty before and after.
    fn take_jobs(
        &self,
        member: usize,
        round: Round,
        mine: &mut Vec<(usize, O)>,
        mut work: impl FnMut(u64) -> O,
    ) {
        let claimed = Cell::new(0);
        // Last of all, so that what was brought can be collected.
        let _done = OnDrop(|| {
            if claimed.get() > 0 {
                self.done.0.fetch_add(claimed.get(), Ordering::Release);
            }
        });
        for place in order(member, self.trays.len(), round.jobs as usize) {
            if self.claims(place, round.number) {
                claimed.set(claimed.get() + 1);
                mine.push((place, work(self.jobs[place].load(Ordering::Relaxed))));
            }
        }
        if !mine.is_empty() {
            self.trays[member].0.lock().unwrap_or_else(PoisonError::into_inner).append(mine);
        }
    }

    /// Takes a job, if nobody has. One who comes late, in a later round, finds all jobs of his taken.
    fn claims(&self, place: usize, round: u32) -> bool {
        let taken = &self.taken[place];
        let last = taken.load(Ordering::Relaxed);
        last < round
            && taken.compare_exchange(last, round, Ordering::Relaxed, Ordering::Relaxed).is_ok()
    }

    /// The outcomes of a round in the order of its jobs.
    fn collect(&self, jobs: usize, outcomes: &mut Vec<O>) {
        outcomes.resize_with(jobs, O::default);
        for tray in &self.trays {
            let mut tray = tray.0.lock().unwrap_or_else(PoisonError::into_inner);
            for (place, outcome) in tray.drain(..) {
                outcomes[place] = outcome;
            }
        }
    }

    /// Joins every round until all is over.
    fn help<B: Default>(&self, member: usize, work: &impl Fn(&mut B, u64) -> O) {
        let (mut bench, mut mine) = (B::default(), Vec::new());
        let mut seen = Round::OVER;
        let mut glances = 0;
        loop {
            match self.round.0.load(Ordering::Acquire) {
                Round::OVER => return,
                round if round != seen => {
                    (seen, glances) = (round, 0);
                    let round = Round::from_bits(round);
                    self.take_jobs(member, round, &mut mine, |job| work(&mut bench, job));
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
