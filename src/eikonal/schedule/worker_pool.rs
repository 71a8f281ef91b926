//! Rounds of independent jobs on the threads of a rayon pool, which other work shares.
//!
//! A round lasts 10 to 100 µs. Waking sleeping threads for each would cost as much as it gains, so the workers, threads of the
//! pool, spin until the next round begins. The leader, the thread that called [`run`], never waits for a worker that has not taken a job, so one that is busy elsewhere
//! delays no round. (Threads made for a solve were at times put on the leader's own core and stayed there for milliseconds: two
//! threads then gained 1.3 to 1.6 instead of 1.65 to 1.75.)
//!
//! # Sharing the pool
//! No solve keeps a thread of the pool for long while other work waits for it:
//! * a worker leaves after [`WORKER_JOBS`] jobs, or when no round begins for a while; the leader calls it again with its next round;
//! * a leader that is itself a thread of the pool yields after every [`SLICE_JOBS`] jobs: it runs one other piece of work of the pool, such
//!   as a solve that has not begun, and goes on when that is done. A solve shorter than a time slice is never interrupted in this way;
//! * a thread that leads a solve does not work for others: it would be missing where it leads.
//!
//! So a 300² solve on two threads that are busy with three of 2500² begins within two time slices, some 30 ms; without this it waited
//! for the end of a large one, more than a second.
//!
//! # Few cache lines
//! What one core has written costs another some 100 ns per cache line to read. So jobs come in the order of the tiles, and each worker
//! begins in a part of its own: from round to round it gets jobs near those it had (dealt out one by one, they took 10 %
//! longer). And so little is shared: jobs and outcomes as plain numbers, and for each worker how many jobs of its part
//! are taken and how many it has done. For a round of twelve two threads need 1.4 µs more than half of what one needs; with a
//! flag for each job and outcomes behind a lock it was 1.7.

use std::cell::Cell;
use std::sync::atomic::Ordering::{Acquire, Relaxed, Release};
use std::sync::atomic::{AtomicU8, AtomicU32, AtomicU64};
use std::{hint, thread};

use rayon::{Scope, Yield};

use crate::error::Result;

/// Fewest jobs of a round that are worth calling workers for the first time.
const MIN_PARALLEL: usize = 4;
/// Jobs that the leader does alone before it calls workers: some 50 µs, so that the smallest solves, of which there are thousands in
/// a segmentation, need none. With 256 a solve at 200² took a quarter longer on two threads, at 400² a tenth.
const SERIAL_JOBS: usize = 16;
/// Jobs after which a worker returns its thread to the pool: some 2 ms.
const WORKER_JOBS: u32 = 256;
/// Jobs after which a leader yields to other work of the pool, a time slice: some 15 ms. Solves at 301² take 700 (plane) to 1900 (rotating, ratio 100), at 401² 1100 to 3400.
const SLICE_JOBS: usize = 2048;
/// So many solves may be under way on one thread, each begun while the one before yielded. Each keeps its memory and some of the
/// thread's stack.
const MOST_NESTED: u32 = 4;
/// Times a thread that waits looks without pause; afterwards it yields its core to other threads in between.
const SPINS_BEFORE_YIELD: u32 = 1000;
/// Times a worker looks for a new round in vain before it leaves.
const SPINS_BEFORE_LEAVING: u32 = 1500;

/// Runs rounds until one has no jobs: `lead` is given the jobs of a round and their outcomes and replaces the jobs by those of the next
/// round, then all threads call `work` on these. A round has at most `max_jobs` jobs; the outcome of a job is `N` numbers. Each thread
/// calls `work` with a workspace of its own.
///
/// # Errors
/// What `lead` returns.
pub(in crate::eikonal) fn run<const N: usize, W: Default>(
    max_jobs: usize,
    mut lead: impl FnMut(&mut Vec<u64>, &[[u32; N]]) -> Result<()>,
    work: impl Fn(&mut W, u64) -> [u32; N] + Sync,
) -> Result<()> {
    let workers = rayon::current_num_threads();
    let mut slice = TimeSlice::begin();
    let mut workspace = W::default();
    let (mut jobs, mut outcomes) = (Vec::new(), Vec::new());
    let mut serial = 0;
    loop {
        lead(&mut jobs, &outcomes)?;
        if jobs.is_empty() {
            return Ok(());
        }
        if workers > 1 && serial >= SERIAL_JOBS && jobs.len() >= MIN_PARALLEL {
            break;
        }
        serial += jobs.len();
        outcomes.clear();
        outcomes.extend(jobs.iter().map(|&job| work(&mut workspace, job)));
        slice.count(jobs.len());
    }
    let rounds = Rounds::new(workers, max_jobs);
    rayon::in_place_scope(|scope| {
        let _over = OnDrop(|| rounds.round.0.store(Round::OVER, Release));
        for number in 2.. {
            let round = rounds.begin(number, &jobs);
            if jobs.len() > 1 {
                rounds.call_workers(scope, &work);
            }
            rounds.take_jobs(0, round, |job| work(&mut workspace, job));
            rounds.wait_for(round);
            rounds.collect(jobs.len(), &mut outcomes);
            slice.count(jobs.len());
            if let Err(error) = lead(&mut jobs, &outcomes) {
                rounds.dismiss();
                return Err(error);
            }
            if jobs.is_empty() {
                break;
            }
        }
        rounds.dismiss();
        Ok(())
    })
}

/// What leader and workers share. What is written at different times, or by different threads, lies in different cache lines.
#[derive(Debug)]
struct Rounds<const N: usize> {
    round: CachePadded<AtomicU64>,
    jobs: Vec<AtomicU64>,
    /// `N` numbers for each job.
    outcomes: Vec<AtomicU32>,
    /// The last round in which jobs of each worker's part were taken, and how many were. The leader is worker 0.
    taken: Vec<CachePadded<AtomicU64>>,
    /// The last round in which each worker did jobs, and how many.
    done: Vec<CachePadded<AtomicU64>>,
    /// The state of each worker: [`ABSENT`], [`CALLED`] or [`PRESENT`].
    states: Vec<CachePadded<AtomicU8>>,
}

/// In cache lines of its own; 128 bytes, as processors fetch lines in pairs.
#[derive(Debug, Default)]
#[repr(align(128))]
struct CachePadded<T>(T);

/// Not called yet, or gone.
const ABSENT: u8 = 0;
/// Waiting for a thread of the pool.
const CALLED: u8 = 1;
/// On a thread of the pool.
const PRESENT: u8 = 2;

/// The number of a round, counted from 1, and a count of its jobs.
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

impl<const N: usize> Rounds<N> {
    fn new(workers: usize, max_jobs: usize) -> Self {
        Self {
            round: CachePadded(Round { number: 1, count: 0 }.to_bits().into()),
            jobs: bytemuck::zeroed_vec(max_jobs),
            outcomes: bytemuck::zeroed_vec(max_jobs * N),
            taken: (0..workers).map(|_| CachePadded::default()).collect(),
            done: (0..workers).map(|_| CachePadded::default()).collect(),
            states: (0..workers).map(|_| CachePadded::default()).collect(),
        }
    }

    fn begin(&self, number: u32, jobs: &[u64]) -> Round {
        for (place, &job) in self.jobs.iter().zip(jobs) {
            place.store(job, Relaxed);
        }
        let round = Round { number, count: jobs.len() as u32 };
        self.round.0.store(round.to_bits(), Release);
        round
    }

    /// Asks the pool for a thread for each worker that is absent.
    fn call_workers<'scope, W: Default>(
        &'scope self,
        scope: &Scope<'scope>,
        work: &'scope (impl Fn(&mut W, u64) -> [u32; N] + Sync),
    ) {
        for (worker, place) in self.states.iter().enumerate().skip(1) {
            if place.0.load(Acquire) == ABSENT {
                place.0.store(CALLED, Relaxed);
                scope.spawn(move |_| self.work_on_rounds(worker, work));
            }
        }
    }

    /// Works on rounds, on a thread of the pool, until it is time to leave.
    fn work_on_rounds<W: Default>(&self, worker: usize, work: &impl Fn(&mut W, u64) -> [u32; N]) {
        let place = &self.states[worker].0;
        let _absent = OnDrop(|| place.store(ABSENT, Release));
        if THREAD.with(Thread::refuses) {
            return;
        }
        place.store(PRESENT, Relaxed);
        let mut workspace = W::default();
        let mut seen = Round::OVER;
        let (mut spins, mut jobs) = (0, 0);
        while jobs < WORKER_JOBS && spins < SPINS_BEFORE_LEAVING {
            match self.round.0.load(Acquire) {
                Round::OVER => return,
                round if round != seen => {
                    (seen, spins) = (round, 0);
                    let round = Round::from_bits(round);
                    jobs += self.take_jobs(worker, round, |job| work(&mut workspace, job));
                }
                _ => spin(&mut spins),
            }
        }
    }

    /// Does jobs until all of the round are taken: those of the worker's own part, then what is left of the others'. Returns how many
    /// it did.
    fn take_jobs(&self, worker: usize, round: Round, mut work: impl FnMut(u64) -> [u32; N]) -> u32 {
        let claimed = Cell::new(0);
        // Last of all, so that the outcomes can be collected.
        let _done = OnDrop(|| {
            if claimed.get() > 0 {
                let done = Round { count: claimed.get(), ..round };
                self.done[worker].0.store(done.to_bits(), Release);
            }
        });
        let workers = self.taken.len();
        for part in (worker..workers).chain(0..worker) {
            while let Some(place) = self.claim(part, round) {
                claimed.set(claimed.get() + 1);
                let outcome = work(self.jobs[place].load(Relaxed));
                for (word, bits) in self.outcomes[place * N..].iter().zip(outcome) {
                    word.store(bits, Relaxed);
                }
            }
        }
        claimed.get()
    }

    /// Takes the next job of a part, if any is left. A worker that comes too late, when a later round has begun, finds all jobs taken.
    ///
    /// Every other part is taken backwards, so that the last jobs of two workers, which the faster takes over from the slower, lie together.
    fn claim(&self, part: usize, round: Round) -> Option<usize> {
        let (workers, jobs) = (self.taken.len(), round.count as usize);
        let (first, end) = (part * jobs / workers, (part + 1) * jobs / workers);
        let one_more = |bits: u64| {
            let count = round.count_in(bits) + 1;
            let is_left =
                Round::from_bits(bits).number <= round.number && count as usize <= end - first;
            is_left.then(|| Round { count, ..round }.to_bits())
        };
        let taken = &self.taken[part].0;
        let before = taken.fetch_update(Relaxed, Relaxed, one_more).ok()?;
        let taken = round.count_in(before) as usize;
        Some(if part.is_multiple_of(2) { first + taken } else { end - 1 - taken })
    }

    /// Waits until all jobs of the round are done.
    fn wait_for(&self, round: Round) {
        let done = |worker: &CachePadded<AtomicU64>| round.count_in(worker.0.load(Acquire));
        let mut spins = 0;
        while self.done.iter().map(done).sum::<u32>() < round.count {
            spin(&mut spins);
        }
    }

    /// The outcomes of a round in the order of its jobs.
    fn collect(&self, jobs: usize, outcomes: &mut Vec<[u32; N]>) {
        outcomes.clear();
        outcomes.extend(
            (0..jobs).map(|job| std::array::from_fn(|k| self.outcomes[job * N + k].load(Relaxed))),
        );
    }

    /// Ends the rounds and waits until the workers have left. The end of the scope would wait as well, but take up other work of the
    /// pool meanwhile, perhaps another solve, many times as long.
    fn dismiss(&self) {
        self.round.0.store(Round::OVER, Release);
        let any = |state| self.states.iter().any(|place| place.0.load(Acquire) == state);
        // Calls that no thread has taken up are the last tasks that this thread has spawned, so that it takes them up itself.
        while any(CALLED) && rayon::yield_local() == Some(Yield::Executed) {}
        let mut spins = 0;
        while any(PRESENT) {
            spin(&mut spins);
        }
    }
}

/// Waits for a moment.
fn spin(spins: &mut u32) {
    if *spins < SPINS_BEFORE_YIELD {
        hint::spin_loop();
    } else {
        thread::yield_now();
    }
    *spins += 1;
}

/// The time slices of a leader on this thread, which leads until this is dropped.
struct TimeSlice {
    /// Jobs done since it began or last yielded.
    jobs: usize,
}

impl TimeSlice {
    fn begin() -> Self {
        THREAD.with(|thread| thread.leaders.set(thread.leaders.get() + 1));
        Self { jobs: 0 }
    }

    /// Counts jobs as done, and at the end of the time slice lets the pool run another piece of work on this thread, if it has any.
    fn count(&mut self, jobs: usize) {
        self.jobs += jobs;
        if self.jobs >= SLICE_JOBS {
            self.jobs = 0;
            THREAD.with(Thread::yield_to_pool);
        }
    }
}

impl Drop for TimeSlice {
    fn drop(&mut self) {
        THREAD.with(|thread| {
            thread.leaders.set(thread.leaders.get() - 1);
            thread.refused.set(false);
        });
    }
}

thread_local! {
    static THREAD: Thread = const { Thread { leaders: Cell::new(0), refused: Cell::new(false) } };
}

/// The state of a thread.
struct Thread {
    /// How many leaders are on it, each but the last having yielded to the next.
    leaders: Cell<u32>,
    /// Whether the last piece of work that it took up was a call to be a worker, which it refused since it leads.
    refused: Cell<bool>,
}

impl Thread {
    /// Whether the thread leads, and so refuses to be a worker.
    fn refuses(&self) -> bool {
        let leads = self.leaders.get() > 0;
        self.refused.set(leads);
        leads
    }

    fn yield_to_pool(&self) {
        if self.leaders.get() >= MOST_NESTED {
            return;
        }
        // Calls to be a worker come first, and are refused; the first other piece of work ends the loop.
        while rayon::yield_now() == Some(Yield::Executed) && self.refused.take() {}
    }
}

/// Runs a closure when dropped: also when a job panics, so that no thread waits for it for ever.
struct OnDrop<F: Fn()>(F);

impl<F: Fn()> Drop for OnDrop<F> {
    fn drop(&mut self) {
        (self.0)();
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicBool, AtomicUsize};

    use rayon::ThreadPoolBuilder;

    use super::*;
    use crate::error::Error;

    /// Jobs of a solve that is over in less than a slice.
    const FEW: usize = 1500;
    /// Jobs of a solve that seems never to end.
    const MANY: usize = 20_000_000;

    /// Does jobs in rounds of 12 until there were `max_jobs` or it is `over`, and counts them. Each outcome is the job.
    fn solve(max_jobs: usize, over: &AtomicBool, done: &AtomicUsize) {
        let lead = |jobs: &mut Vec<u64>, outcomes: &[[u32; 1]]| {
            assert!(jobs.iter().zip(outcomes).all(|(&job, &[outcome])| job == u64::from(outcome)));
            let before = done.fetch_add(jobs.len(), Relaxed) + jobs.len();
            jobs.clear();
            if before < max_jobs && !over.load(Relaxed) {
                jobs.extend((before as u64..).take(12));
            }
            Ok(())
        };
        let work = |spins: &mut u32, job| {
            *spins += 1;
            (0..10).for_each(|_| hint::spin_loop());
            [job as u32]
        };
        run(12, lead, work).unwrap();
    }

    /// Three long solves and a short one, started by `begin`; all end with the short one, which waits until the others have done `first`
    /// jobs each. Returns how many jobs the long ones did.
    fn jobs_while_a_short_one_runs(
        first: usize,
        begin: impl Fn(&[&(dyn Fn() + Sync)]),
    ) -> [usize; 3] {
        let over = AtomicBool::new(false);
        let done = [const { AtomicUsize::new(0) }; 3];
        let long = |i: usize| solve(MANY, &over, &done[i]);
        let short = || {
            while done.iter().any(|jobs| jobs.load(Relaxed) < first) {
                thread::yield_now();
            }
            solve(FEW, &AtomicBool::new(false), &AtomicUsize::new(0));
            over.store(true, Relaxed);
        };
        begin(&[&|| long(0), &|| long(1), &|| long(2), &short]);
        done.map(AtomicUsize::into_inner)
    }

    #[test]
    fn a_short_solve_in_a_pool_that_is_busy_waits_no_longer_than_a_time_slice_of_each() {
        for threads in [1, 2, 3] {
            let pool = ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let in_pool = |solves: &[&(dyn Fn() + Sync)]| {
                pool.in_place_scope(|scope| {
                    solves.iter().for_each(|&solve| scope.spawn(move |_| solve()));
                });
            };
            let done = jobs_while_a_short_one_runs(0, in_pool);
            if threads == 1 {
                assert!(done.iter().all(|&jobs| jobs <= SLICE_JOBS + 24), "{done:?}");
            }
            assert!(done.iter().all(|&jobs| jobs < MANY), "{threads}: {done:?}");
        }
    }

    #[test]
    fn a_short_solve_beside_others_led_from_outside_does_not_wait_for_their_end() {
        let outside = |solves: &[&(dyn Fn() + Sync)]| {
            thread::scope(|scope| {
                solves.iter().for_each(|&solve| drop(scope.spawn(solve)));
            });
        };
        let done = jobs_while_a_short_one_runs(10_000, outside);
        assert!(done.iter().all(|&jobs| jobs < MANY), "{done:?}");
    }

    #[test]
    fn a_short_solve_is_not_put_off_by_those_begun_after_it() {
        let pool = ThreadPoolBuilder::new().num_threads(2).build().unwrap();
        let in_pool = |solves: &[&(dyn Fn() + Sync)]| {
            pool.in_place_scope(|scope| {
                solves.iter().rev().for_each(|&solve| scope.spawn(move |_| solve()));
            });
        };
        for _ in 0..10 {
            let done = jobs_while_a_short_one_runs(0, in_pool);
            assert!(done.iter().all(|&jobs| jobs < MANY), "{done:?}");
        }
    }

    #[test]
    fn one_that_fails_does_not_disturb_the_others() {
        let pool = ThreadPoolBuilder::new().num_threads(2).build().unwrap();
        let over = AtomicBool::new(false);
        let cancelled = || {
            let mut rounds = 0;
            let lead = |jobs: &mut Vec<u64>, _: &[[u32; 1]]| {
                rounds += 1;
                jobs.clear();
                jobs.extend(0..12);
                if rounds < 50 { Ok(()) } else { Err(Error::Cancelled) }
            };
            run(12, lead, |_: &mut (), _| [0])
        };
        pool.in_place_scope(|scope| {
            for i in 0..12 {
                let (over, cancelled) = (&over, &cancelled);
                scope.spawn(move |_| match i % 2 {
                    0 => assert!(matches!(cancelled(), Err(Error::Cancelled))),
                    _ => {
                        let done = AtomicUsize::new(0);
                        solve(20 * FEW, over, &done);
                        assert!(done.into_inner() >= 20 * FEW);
                    }
                });
            }
        });
    }
}
