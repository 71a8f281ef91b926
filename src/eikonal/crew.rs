//! Rounds of independent jobs on all threads, with little between them.
//!
//! A round lasts 10 to 100 µs. Waking sleeping threads for each would cost as much as it gains, so the helpers, threads of the
//! pool, stay awake for the whole solve, watching for the next round. The leader never waits for a helper that has not
//! taken a job, so one that is busy elsewhere delays no round; only the end of a solve that is led from outside the pool waits until
//! its threads have looked. (Threads made for a solve were at times put on the leader's own core and
//! stayed there for milliseconds: two threads then gained 1.3 to 1.6 instead of 1.65 to 1.75.)
//!
//! What one core has written costs another some 100 ns per cache line to read. So jobs come in order of place, and each member
//! of the crew begins at a place of its own: from round to round it gets jobs near those it had (dealt out in turn, they took 10 %
//! longer). And so little is shared: jobs and outcomes as plain numbers side by side, and for each member how many jobs of its part are
//! taken and how many it has done. For a round of twelve two threads need 1.4 µs more than half of what one needs; with a flag
//! for each job and outcomes behind a lock it was 1.7.

use std::cell::Cell;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};
use std::{hint, thread};

use crate::error::Result;

/// Fewest jobs of a round that are worth calling helpers for.
const MIN_PARALLEL: usize = 4;
/// Jobs that the leader does alone before it calls helpers: some 50 µs, so that the smallest solves, of which there are thousands in
/// a segmentation, have none. With 256 a solve at 200² took a quarter longer on two threads, at 400² a tenth.
const ALONE: usize = 16;
/// Glances at the next round before a helper lets other threads run.
const GLANCES: u32 = 1000;

/// What the crew shares. What is written at different times, or by different members, lies in different cache lines.
#[derive(Debug)]
struct Deck<const N: usize> {
    round: Apart<AtomicU64>,
    jobs: Vec<AtomicU64>,
    /// `N` numbers for each job.
    outcomes: Vec<AtomicU32>,
    /// The last round in which jobs of each member's part were taken, and how many were.
    taken: Vec<Apart<AtomicU64>>,
    /// The last round in which each member did jobs, and how many.
    done: Vec<Apart<AtomicU64>>,
}

#[derive(Debug, Default)]
#[repr(align(128))]
struct Apart<T>(T);

/// The number of a round, counted from 1, and a number of its jobs.
#[derive(Clone, Copy, PartialEq, Eq)]
struct Round {
    number: u32,
    count: u32,
}

impl Round {
    /// After the last round.
    const OVER: u64 = 0;

    /// The count of jobs in `bits`, if they are of this round.
    fn count_in(self, bits: u64) -> u32 {
        let Self { number, count } = Self::from_bits(bits);
        if number == self.number { count } else { 0 }
    }

    fn to_bits(self) -> u64 {
        u64::from(self.number) << 32 | u64::from(self.count)
    }

    fn from_bits(bits: u64) -> Self {
        Self { number: (bits >> 32) as u32, count: bits as u32 }
    }
}

/// Alternates `lead`, which is given the jobs of a round and their outcomes and puts those of the next in their place, with `work`
/// on these by all threads, until there are none. A round has at most `most` jobs. A job comes to `N` numbers. `work` has a bench to itself.
///
/// # Errors
/// What `lead` returns.
pub(super) fn run<const N: usize, B: Default>(
    most: usize,
    mut lead: impl FnMut(&mut Vec<u64>, &[[u32; N]]) -> Result<()>,
    work: impl Fn(&mut B, u64) -> [u32; N] + Sync,
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
        jobs: bytemuck::zeroed_vec(most),
        outcomes: bytemuck::zeroed_vec(most * N),
        taken: (0..members).map(|_| Apart::default()).collect(),
        done: (0..members).map(|_| Apart::default()).collect(),
    };
    deck.round.0.store(Round { number: 1, count: 0 }.to_bits(), Ordering::Relaxed);
    rayon::in_place_scope(|scope| {
        let _over = OnDrop(|| deck.round.0.store(Round::OVER, Ordering::Release));
        let (deck, work) = (&deck, &work);
        for helper in 1..members {
            scope.spawn(move |_| deck.help(helper, work));
        }
        for number in 2.. {
            let round = deck.begin(number, &jobs);
            deck.take_jobs(0, round, |job| work(&mut bench, job));
            while !deck.is_done(round) {
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

impl<const N: usize> Deck<N> {
    fn begin(&self, number: u32, jobs: &[u64]) -> Round {
        for (place, &job) in self.jobs.iter().zip(jobs) {
            place.store(job, Ordering::Relaxed);
        }
        let round = Round { number, count: jobs.len() as u32 };
        self.round.0.store(round.to_bits(), Ordering::Release);
        round
    }

    /// Does jobs until all of the round are taken: those of the member's own part, then what is left of the others'.
    fn take_jobs(&self, member: usize, round: Round, mut work: impl FnMut(u64) -> [u32; N]) {
        let claimed = Cell::new(0);
        // Last of all, so that the outcomes can be collected.
        let _done = OnDrop(|| {
            if claimed.get() > 0 {
                let done = Round { count: claimed.get(), ..round };
                self.done[member].0.store(done.to_bits(), Ordering::Release);
            }
        });
        let members = self.taken.len();
        for part in (member..members).chain(0..member) {
            while let Some(place) = self.claim(part, round) {
                claimed.set(claimed.get() + 1);
                let outcome = work(self.jobs[place].load(Ordering::Relaxed));
                for (word, bits) in self.outcomes[place * N..].iter().zip(outcome) {
                    word.store(bits, Ordering::Relaxed);
                }
            }
        }
    }

    /// Takes the next job of a part, if any is left. One who comes late, in a later round, finds all jobs of his taken.
    ///
    /// Every other part is taken backwards, so that two members meet in the middle.
    fn claim(&self, part: usize, round: Round) -> Option<usize> {
        let (members, jobs) = (self.taken.len(), round.count as usize);
        let (first, end) = (part * jobs / members, (part + 1) * jobs / members);
        let one_more = |bits: u64| {
            let count = round.count_in(bits) + 1;
            let is_left =
                Round::from_bits(bits).number <= round.number && count as usize <= end - first;
            is_left.then(|| Round { count, ..round }.to_bits())
        };
        let taken = &self.taken[part].0;
        let before = taken.fetch_update(Ordering::Relaxed, Ordering::Relaxed, one_more).ok()?;
        let taken = round.count_in(before) as usize;
        Some(if part.is_multiple_of(2) { first + taken } else { end - 1 - taken })
    }

    fn is_done(&self, round: Round) -> bool {
        let done = |member: &Apart<AtomicU64>| round.count_in(member.0.load(Ordering::Acquire));
        self.done.iter().map(done).sum::<u32>() == round.count
    }

    /// The outcomes of a round in the order of its jobs.
    fn collect(&self, jobs: usize, outcomes: &mut Vec<[u32; N]>) {
        outcomes.clear();
        outcomes.extend((0..jobs).map(|place| {
            std::array::from_fn(|k| self.outcomes[place * N + k].load(Ordering::Relaxed))
        }));
    }

    /// Joins every round until all is over.
    fn help<B: Default>(&self, member: usize, work: &impl Fn(&mut B, u64) -> [u32; N]) {
        let mut bench = B::default();
        let mut seen = Round::OVER;
        let mut glances = 0;
        loop {
            match self.round.0.load(Ordering::Acquire) {
                Round::OVER => return,
                round if round != seen => {
                    (seen, glances) = (round, 0);
                    let round = Round::from_bits(round);
                    self.take_jobs(member, round, |job| work(&mut bench, job));
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
