//! The Fast Iterative Method over tiles: which tile is solved when.
//!
//! A tile is solved by Gauss–Seidel sweeps until it stands still, then wakes the neighbours that it could improve,
//! each with a *key*: the least changed value that matters there. Tiles are taken in rounds in order of key,
//! which makes the method nearly label-setting; in order of arrival it would solve whole regions again
//! each time a later, shorter front arrives. A round is a set of tiles no two of which touch, so they can be solved
//! at the same time and the outcome does not depend on who solves which.
//!
//! Jeong and Whitaker, "A Fast Iterative Method for Eikonal Equations", SIAM J. Sci. Comput. 30 (2008).

use rayon::prelude::*;

use super::board::{Board, LimitsBoard};
use super::crew;
use super::factors::Factors;
use super::field::{AREA, SIDE, TensorField, TensorTile, Tiling};
use super::queue::{Job, Queue};
use super::sides::{ITSELF, SIDES, neighbours, opposite};
use super::source::Seeds;
use super::stencil::UNREACHED;
use super::stop::{self, Standing, Stop};
use super::tile::kernel::{self, Problem, Rule, Workspace};
use super::tile::{Limits, Tile};
use crate::control::Control;
use crate::error::Result;

/// Values at the nodes, tile by tile, in the field's stored units: infinite where closed.
#[derive(Clone, Debug)]
pub(crate) struct Values {
    pub(crate) tiling: Tiling,
    pub(crate) tiles: Vec<[f32; AREA]>,
}

impl Values {
    /// The start values; the rest unreached.
    pub(crate) fn seeded(field: &TensorField, seeds: &[Option<Box<Seeds>>]) -> Self {
        let tiles = field.tiles.par_iter().zip(seeds);
        let tiles = tiles.map(|(tensors, seeds)| at_start(tensors, seeds.as_deref())).collect();
        Self { tiling: field.tiling, tiles }
    }

    /// Lowers values to those of the start.
    pub(super) fn seed(&mut self, seeds: &[Option<Box<Seeds>>]) {
        for (tile, seeds) in self.tiles.iter_mut().zip(seeds) {
            seeds.iter().for_each(|seeds| lower(tile, seeds));
        }
    }

    /// How many nodes have a value.
    fn reached(&self) -> usize {
        self.tiles.as_flattened().iter().filter(|&&value| value < UNREACHED).count()
    }

    pub(crate) fn get(&self, col: usize, row: usize) -> f32 {
        let (tile, place) = self.tiling.place(col, row);
        self.tiles[tile][place]
    }

    pub(crate) fn lower(&mut self, col: usize, row: usize, value: f32) {
        let (tile, place) = self.tiling.place(col, row);
        let old = &mut self.tiles[tile][place];
        *old = old.min(value);
    }
}

/// The values of a tile before the solve: those of the start, the rest unreached.
pub(super) fn at_start(tensors: &TensorTile, seeds: Option<&Seeds>) -> [f32; AREA] {
    let mut values = tensors.det.map(|det| if det > 0.0 { UNREACHED } else { f32::INFINITY });
    seeds.into_iter().for_each(|seeds| lower(&mut values, seeds));
    values
}

fn lower(values: &mut [f32; AREA], seeds: &Seeds) {
    for (value, seed) in values.iter_mut().zip(seeds) {
        *value = value.min(*seed);
    }
}

/// How much work a solve took: the same on every machine and for every number of threads.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Statistics {
    /// Tiles of the grid that were ever solved.
    pub tiles: usize,
    /// Times a tile was solved.
    pub activations: usize,
    /// Sweeps over a tile, whole or in part, all together.
    pub sweeps: usize,
    /// Sets of tiles solved side by side.
    pub rounds: usize,
}

/// What solving a tile brought.
#[derive(Clone, Copy, Debug)]
struct Outcome {
    /// For each of [`NEIGHBOURS`] the least changed value that could improve it; infinite if none.
    wakes: [f32; 8],
    /// The least value of the tile if it does not stand still yet; infinite if it does.
    unsettled: f32,
    /// See [`Limits::slack`].
    slack: f32,
    sweeps: u32,
}

impl Outcome {
    fn to_bits(self) -> [u32; 11] {
        let [e, se, s, sw, w, nw, n, ne] = self.wakes.map(f32::to_bits);
        [e, se, s, sw, w, nw, n, ne, self.unsettled.to_bits(), self.slack.to_bits(), self.sweeps]
    }

    fn from_bits([wakes @ .., unsettled, slack, sweeps]: [u32; 11]) -> Self {
        Self {
            wakes: wakes.map(f32::from_bits),
            unsettled: f32::from_bits(unsettled),
            slack: f32::from_bits(slack),
            sweeps,
        }
    }
}

/// Activations of a tile after which a solve is given up, without and with factors. Tiles of fields that settle took at
/// most 34 at ratio 400, 86 at 2500, 19 on rough isotropic ones.
const MOST_ACTIVATIONS: [u32; 2] = [5000, 500];

/// Width of the window of keys that one round may take, in mean cells. Wider gives more tiles to a round but solves
/// some too early. At 1001² 8, 10, 16, 24 take 30, 28, 28, 31 ms on a plane, 36, 39, 46, 54 at random speeds (one thread) and
/// 37, 36, 34, 33 at ratio 400 on two, before rounds took at least a share of the tiles that wait ([`Queue::horizon`]).
pub(super) const WINDOW_CELLS: f32 = 10.0;

/// What the solvers of a round share.
#[derive(Debug)]
pub(super) struct Shared {
    pub(super) board: Board,
    pub(super) limits: LimitsBoard,
}

/// The memory of a solve.
#[derive(Debug)]
pub(super) struct Desk {
    queue: Queue,
    /// How often each tile was solved.
    activations: Vec<u32>,
    pub(super) shared: Shared,
    /// How many nodes have a value from before.
    reached: usize,
    /// The greatest slack of any tile.
    slack: f32,
}

impl Desk {
    fn new(board: Board, limits: Vec<Limits>) -> Self {
        let slack = limits.iter().fold(0f32, |most, limits| most.max(limits.slack));
        Self {
            activations: vec![0; limits.len()],
            queue: Queue::new(limits.len()),
            shared: Shared { board, limits: LimitsBoard::new(limits) },
            reached: 0,
            slack,
        }
    }

    /// One with an unfilled board.
    pub(super) fn empty(tiling: Tiling) -> Self {
        let board = Board::unfilled(tiling, f32::INFINITY);
        Self::new(board, vec![Limits::default(); tiling.tiles()])
    }

    /// Wakes a tile that holds start values, and the neighbours that some lie beside.
    pub(super) fn wake(&mut self, tiling: &Tiling, tile: usize, seeds: &Seeds) {
        let [cols, rows] = tiling.size(tile);
        let line = |along: isize, count: usize| match along {
            0 => 0..count,
            1 => count - 1..count,
            _ => 0..1,
        };
        let least = |side: usize| {
            let (dx, dy) = SIDES[side];
            let (cols, rows) = (line(dx, cols), line(dy, rows));
            let places = rows.flat_map(|row| cols.clone().map(move |col| row * SIDE + col));
            places.map(|i| seeds[i]).fold(f32::INFINITY, f32::min)
        };
        self.queue.wake(tile, least(ITSELF), ITSELF);
        for (side, n) in neighbours(tiling, tile) {
            let key = least(side);
            if key < f32::INFINITY {
                self.queue.wake(n, key, opposite(side));
            }
        }
    }

    /// Wakes all tiles that hold start values or lie beside some.
    fn wake_start(&mut self, tiling: &Tiling, seeds: &[Option<Box<Seeds>>]) {
        for (tile, seeds) in seeds.iter().enumerate() {
            seeds.iter().for_each(|seeds| self.wake(tiling, tile, seeds));
        }
    }

    /// Whether the tile was solved.
    pub(super) fn is_solved(&self, tile: usize) -> bool {
        self.activations[tile] > 0
    }

    /// Forgets a solve of which only the given tiles were solved or beside ones that were. Their values stay.
    pub(super) fn clear(&mut self, tiles: &[usize]) {
        self.queue.clear(tiles);
        for &tile in tiles {
            self.activations[tile] = 0;
            self.shared.limits.forget(tile);
        }
        (self.reached, self.slack) = (0, 0.0);
    }
}

/// Which of the values given to a solve are news.
#[derive(Clone, Copy, Debug)]
pub(super) enum News<'a> {
    /// All of them: they are those of the start.
    All,
    /// Those of and beside the nodes that are unreached in `before`, and around the `edited` nodes; the others are final,
    /// or will be lowered by these.
    Since { before: &'a Values, edited: &'a [f32] },
    /// That nodes were edited and lost their values: for each tile the least of these, infinite if none. What came from
    /// them is to be forgotten as well, see [`Rule::Forget`].
    Lost(&'a [f32]),
}

/// What a solve comes to.
#[derive(Debug)]
pub(super) struct Solution {
    pub(super) values: Values,
    /// What is known of each tile: what can improve it.
    pub(super) limits: Vec<Limits>,
    pub(super) statistics: Statistics,
}

/// What is to be solved, and to which share of a step.
#[derive(Clone, Copy, Debug)]
pub(super) struct Equation<'a> {
    pub(super) field: &'a TensorField,
    pub(super) factors: &'a Factors,
    pub(super) seeds: &'a [Option<Box<Seeds>>],
    pub(super) tolerance: f32,
}

/// Relaxes `values` to the solution of the discrete equation, starting from those that are `news`, until `stop` allows to
/// end. What is not final then is unreached. `limits` are those of the solution that the values are from. `None` if the
/// values do not settle.
pub(super) fn solve(
    equation: &Equation<'_>,
    values: Values,
    limits: Vec<Limits>,
    news: News<'_>,
    stop: &Stop,
    control: &Control,
) -> Result<Option<Solution>> {
    let field = equation.field;
    let tiling = field.tiling;
    let mut desk = Desk::new(Board::new(values, f32::INFINITY), limits);
    match news {
        News::All => desk.wake_start(&tiling, equation.seeds),
        News::Since { before, edited } => {
            wake_front(&tiling, before, &desk.shared.board, edited, &mut desk.queue);
            desk.reached = before.reached();
        }
        News::Lost(keys) => {
            wake_around(&tiling, keys.iter().copied(), &mut desk.queue);
        }
    }
    let rule = if matches!(news, News::Lost(_)) { Rule::Forget } else { Rule::Lower };
    let End { settles, news, statistics } =
        relax(equation, rule, stop, &mut desk, |_, _| (), control)?;
    let Shared { board, limits } = desk.shared;
    let (mut values, limits) = (board.into_values(), limits.into_limits());
    if *stop != Stop::Never {
        stop::mask(&mut values, field, &limits, news, stop);
    }
    Ok(settles.then_some(Solution { values, limits, statistics }))
}

/// How a relaxation ended.
#[derive(Debug)]
pub(super) struct End {
    /// Whether all tiles came to a standstill, or would have.
    pub(super) settles: bool,
    /// Nothing below this value is news to any node; infinite when all is done.
    pub(super) news: f32,
    statistics: Statistics,
}

/// Solves the tiles that wait and those that they wake, in rounds, until `stop` allows to end. Before
/// a round `open` is told its jobs.
pub(super) fn relax(
    &Equation { field, factors, seeds, tolerance }: &Equation<'_>,
    rule: Rule,
    stop: &Stop,
    Desk { queue, activations, shared, reached, slack }: &mut Desk,
    mut open: impl FnMut(&[u64], &Shared),
    control: &Control,
) -> Result<End> {
    let tiling = field.tiling;
    let window = WINDOW_CELLS * field.mean_step;
    let most = MOST_ACTIVATIONS[usize::from(!factors.is_empty())];
    let mut news = f32::INFINITY;
    let mut settles = true;
    let mut statistics = Statistics::default();
    let shared = &*shared;
    let work = |workspace: &mut Workspace, job: u64| {
        let job = Job::from_bits(job);
        let tile = job.tile as usize;
        let first = tiling.first(tile);
        let factor = factors.of_tile(tile).map(|factor| (factor, first));
        let input =
            Tile { tensors: &field.tiles[tile], factor, tolerance, seeds: seeds[tile].as_deref() };
        solve_tile(workspace, &tiling, &input, rule, shared, job).to_bits()
    };
    let lead = |jobs: &mut Vec<u64>, outcomes: &[[u32; 11]]| -> Result<()> {
        for (job, &outcome) in jobs.drain(..).zip(outcomes) {
            let tile = Job::from_bits(job).tile as usize;
            let outcome = Outcome::from_bits(outcome);
            activations[tile] += 1;
            settles &= activations[tile] < most;
            statistics.activations += 1;
            statistics.tiles += usize::from(activations[tile] == 1);
            statistics.sweeps += outcome.sweeps as usize;
            *slack = slack.max(outcome.slack);
            settle(&tiling, queue, tile, &outcome);
        }
        control.check()?;
        if !settles {
            return Ok(());
        }
        if statistics.rounds.is_multiple_of(64) {
            control.report("solving distance", statistics.tiles as f64 / tiling.tiles() as f64);
        }
        news = queue.least_key();
        let reached = *reached + statistics.tiles * AREA;
        let Shared { board, limits } = shared;
        let standing = Standing { field, board, limits, reached, slack: *slack, news };
        if queue.is_empty() || standing.allows(stop) {
            return Ok(());
        }
        statistics.rounds += 1;
        let limit = queue.horizon(window).min(standing.last_news(stop));
        queue.take(&tiling, limit, statistics.rounds as u32, jobs);
        open(jobs, shared);
        Ok(())
    };
    crew::run(tiling.tiles(), lead, work)?;
    Ok(End { settles, news, statistics })
}

/// Wakes every tile whose key is finite, and its neighbours on the sides to it.
fn wake_around(tiling: &Tiling, keys: impl Iterator<Item = f32>, queue: &mut Queue) {
    for (tile, key) in keys.enumerate().filter(|&(_, key)| key < f32::INFINITY) {
        queue.wake(tile, key, ITSELF);
        for (side, n) in neighbours(tiling, tile) {
            queue.wake(n, key, opposite(side));
        }
    }
}

/// Wakes every tile with a node that was unreached before, and now has a value or is beside one. Also those around the
/// `edited` nodes: a node that was opened opens a diagonal step between others, which need not change themselves.
fn wake_front(tiling: &Tiling, before: &Values, board: &Board, edited: &[f32], queue: &mut Queue) {
    let is_edited = |tile: usize| edited.get(tile).is_some_and(|&key| key < f32::INFINITY);
    let mut block = [[f32::INFINITY; SIDE + 2]; SIDE + 2];
    for (tile, before) in before.tiles.iter().enumerate() {
        let all = is_edited(tile) || neighbours(tiling, tile).any(|(_, n)| is_edited(n));
        if !all && !before.contains(&UNREACHED) {
            continue;
        }
        board.load(tile, &mut block);
        let mut key = UNREACHED;
        for (rows, before) in block.windows(3).zip(before.chunks_exact(SIDE)) {
            let across: [f32; SIDE + 2] =
                std::array::from_fn(|i| rows[0][i].min(rows[1][i]).min(rows[2][i]));
            for (beside, &before) in across.windows(3).zip(before) {
                let least = beside[0].min(beside[1]).min(beside[2]);
                key = key.min(if all || before == UNREACHED { least } else { UNREACHED });
            }
        }
        if key < UNREACHED {
            queue.wake(tile, key, ITSELF);
        }
    }
}

/// Wakes the neighbours that a tile can improve.
fn settle(tiling: &Tiling, queue: &mut Queue, tile: usize, outcome: &Outcome) {
    if outcome.unsettled < f32::INFINITY {
        queue.wake(tile, outcome.unsettled, ITSELF);
    }
    for (side, n) in neighbours(tiling, tile) {
        if outcome.wakes[side] < f32::INFINITY {
            queue.wake(n, outcome.wakes[side], opposite(side));
        }
    }
}

/// Solves the tile of a job: from the shared values to the shared values.
fn solve_tile(
    workspace: &mut Workspace,
    tiling: &Tiling,
    input: &Tile<'_>,
    rule: Rule,
    Shared { board, limits }: &Shared,
    job: Job,
) -> Outcome {
    let tile = job.tile as usize;
    board.load(tile, workspace.values());
    let mut slacks = [0.0; 8];
    for (side, n) in neighbours(tiling, tile) {
        slacks[side] = limits.at(n).slack;
    }
    let problem = Problem {
        tile: *input,
        rule,
        size: tiling.size(tile),
        changed: job.sides,
        first: job.first,
        slacks,
        is_ring: tiling.is_ring(),
    };
    let solved = kernel::solve(workspace, &problem);
    limits.raise(tile, &solved.limits);
    if solved.is_changed {
        board.store(tile, workspace.values());
    }
    Outcome {
        wakes: solved.changes,
        unsettled: solved.unconverged,
        slack: solved.limits.slack,
        sweeps: solved.sweeps,
    }
}
