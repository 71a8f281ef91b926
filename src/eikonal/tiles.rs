//! The Fast Iterative Method over tiles: which tile is solved when.
//!
//! A tile is solved by Gauss–Seidel sweeps until it stands still, then wakes the neighbours that could improve
//! by it, each with a *key*: the least changed value it can see. Tiles are taken in rounds in order of key,
//! which makes the method nearly label-setting; in order of arrival it would solve whole regions again
//! each time a later, shorter front arrives. A round is a set of tiles no two of which touch, so they can be solved
//! at the same time and the outcome does not depend on who solves which.
//!
//! Jeong and Whitaker, "A Fast Iterative Method for Eikonal Equations", SIAM J. Sci. Comput. 30 (2008).

use rayon::prelude::*;

use super::field::{AREA, SIDE, TensorField, Tiling};
use super::update::{Bench, Block, ROUNDING, UNREACHED};
use crate::{Control, Error, Result};

/// Values at the nodes, tile by tile, in the field's stored units.
#[derive(Clone, Debug)]
pub(crate) struct Values {
    pub(crate) tiling: Tiling,
    pub(crate) tiles: Vec<[f32; AREA]>,
}

impl Values {
    pub(crate) fn unreached(tiling: Tiling) -> Self {
        Self { tiling, tiles: vec![[UNREACHED; AREA]; tiling.tiles()] }
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

    /// A tile and the nodes around it.
    fn block(&self, tile: usize, block: &mut Block) {
        let (tx, ty) = (tile % self.tiling.across, tile / self.tiling.across);
        for (j, line) in block.iter_mut().enumerate() {
            // Row and column of the block, counted in nodes from the tile before the first.
            let row = ty * SIDE + SIDE + j - 1;
            let (ny, y) = (row / SIDE, row % SIDE);
            if ny == 0 || ny > self.tiling.down {
                *line = [UNREACHED; SIDE + 2];
                continue;
            }
            let base = (ny - 1) * self.tiling.across;
            let at = |nx: usize, x: usize| self.tiles[base + nx][y * SIDE + x];
            line[0] = if tx > 0 { at(tx - 1, SIDE - 1) } else { UNREACHED };
            line[1..=SIDE].copy_from_slice(&self.tiles[base + tx][y * SIDE..][..SIDE]);
            line[SIDE + 1] = if tx + 1 < self.tiling.across { at(tx + 1, 0) } else { UNREACHED };
        }
    }
}

/// How much work a solve took: the same on every machine and for every number of threads.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Statistics {
    /// Tiles of the grid that were ever solved.
    pub tiles: usize,
    /// Times a tile was solved.
    pub activations: usize,
    /// Sweeps over a tile, all together.
    pub sweeps: usize,
    /// Sets of tiles solved side by side.
    pub rounds: usize,
}

/// What solving a tile brought.
struct Outcome {
    tile: u32,
    values: [f32; AREA],
    /// Least changed value that each neighbour sees, see [`NEIGHBOURS`].
    wakes: [f32; 8],
    sweeps: usize,
    settled: bool,
}

/// Neighbours of a tile as (tiles east, tiles south), and the nodes of this tile that each sees: a
/// range of columns and of rows.
const NEIGHBOURS: [((isize, isize), [usize; 4]); 8] = {
    const L: usize = SIDE - 1;
    [
        ((1, 0), [L, SIDE, 0, SIDE]),
        ((1, 1), [L, SIDE, L, SIDE]),
        ((0, 1), [0, SIDE, L, SIDE]),
        ((-1, 1), [0, 1, L, SIDE]),
        ((-1, 0), [0, 1, 0, SIDE]),
        ((-1, -1), [0, 1, 0, 1]),
        ((0, -1), [0, SIDE, 0, 1]),
        ((1, -1), [L, SIDE, 0, 1]),
    ]
};

/// Sweeps of a tile before it goes back into the queue.
const MAX_SWEEPS: usize = 16;

/// Activations per tile, on average, after which a solve is given up. The hardest fields measured, mazes and
/// ratio 2500, take under 10; a solve that needs this many would not end.
const MAX_MEAN_ACTIVATIONS: usize = 2000;

/// The tiles that wait, and what is known of each.
struct Queue {
    waiting: Vec<u32>,
    /// Least value that may still change the tile; [`UNREACHED`] if it does not wait.
    key: Vec<f32>,
    /// News above this cannot improve the tile, see [`settle`].
    ceiling: Vec<f32>,
    /// Direction the last news came from, as the first sweep to make: bit 0 from the east, bit 1 from the south.
    heading: Vec<u8>,
    /// Number of the round that last took the tile or one of its neighbours.
    taken: Vec<u32>,
}

impl Queue {
    fn wake(&mut self, tile: usize, key: f32, heading: u8) {
        self.heading[tile] = heading;
        if self.key[tile] == UNREACHED {
            self.waiting.push(tile as u32);
        }
        self.key[tile] = self.key[tile].min(key);
    }

    fn least_key(&self) -> f32 {
        self.waiting.iter().map(|&t| self.key[t as usize]).fold(UNREACHED, f32::min)
    }

    /// Takes the waiting tiles with keys up to `limit` that do not touch, lowest key first.
    fn take(&mut self, tiling: &Tiling, limit: f32, round: u32, taken: &mut Vec<u32>) {
        taken.clear();
        let key = &self.key;
        let mut candidates: Vec<u32> =
            self.waiting.iter().copied().filter(|&t| key[t as usize] <= limit).collect();
        candidates
            .sort_unstable_by(|&a, &b| key[a as usize].total_cmp(&key[b as usize]).then(a.cmp(&b)));
        for tile in candidates {
            if self.taken[tile as usize] == round {
                continue;
            }
            taken.push(tile);
            self.key[tile as usize] = UNREACHED;
            self.taken[tile as usize] = round;
            for ((dx, dy), _) in NEIGHBOURS {
                if let Some(n) = neighbour(tiling, tile as usize, dx, dy) {
                    self.taken[n] = round;
                }
            }
        }
        let key = &self.key;
        self.waiting.retain(|&t| key[t as usize] != UNREACHED);
    }
}

fn neighbour(tiling: &Tiling, tile: usize, dx: isize, dy: isize) -> Option<usize> {
    let x = (tile % tiling.across).checked_add_signed(dx).filter(|&x| x < tiling.across)?;
    let y = (tile / tiling.across).checked_add_signed(dy).filter(|&y| y < tiling.down)?;
    Some(y * tiling.across + x)
}

/// Relaxes `values` to the solution of the discrete equation, starting from the tiles that hold any.
///
/// `done(limit, values)` is asked between rounds whether what is final is enough: values that are lower than `limit` by
/// more than the longest step of their tile.
pub(super) fn solve(
    field: &TensorField,
    values: &mut Values,
    tolerance: f32,
    mut done: impl FnMut(f32, &Values) -> bool,
    control: &Control,
) -> Result<Statistics> {
    let tiling = field.tiling;
    let mut queue = Queue {
        waiting: Vec::new(),
        key: vec![UNREACHED; tiling.tiles()],
        ceiling: vec![UNREACHED; tiling.tiles()],
        heading: vec![0; tiling.tiles()],
        taken: vec![0; tiling.tiles()],
    };
    wake_start(field, values, &mut queue);
    let window = WINDOW_CELLS * field.mean_step;
    let mut statistics = Statistics::default();
    let mut seen = vec![false; tiling.tiles()];
    let mut taken = Vec::new();
    let mut outcomes: Vec<Outcome> = Vec::new();
    while !queue.waiting.is_empty() {
        control.check()?;
        let least = queue.least_key();
        if done(least, values) {
            break;
        }
        statistics.rounds += 1;
        queue.take(&tiling, least + window, statistics.rounds as u32, &mut taken);
        let solve_one = |bench: &mut Workbench, &tile: &u32| {
            bench.solve(field, values, tile, queue.heading[tile as usize], tolerance)
        };
        if rayon::current_num_threads() > 1 && taken.len() >= MIN_PARALLEL {
            taken
                .par_iter()
                .map_init(Workbench::default, solve_one)
                .collect_into_vec(&mut outcomes);
        } else {
            let mut bench = Workbench::default();
            outcomes.clear();
            outcomes.extend(taken.iter().map(|tile| solve_one(&mut bench, tile)));
        }
        for outcome in &outcomes {
            statistics.activations += 1;
            statistics.sweeps += outcome.sweeps;
            seen[outcome.tile as usize] = true;
            settle(field, values, &mut queue, outcome);
        }
        if statistics.activations > MAX_MEAN_ACTIVATIONS * tiling.tiles() {
            return Err(Error::usage(
                "the distance does not settle on this metric; its tensors are too extreme",
            ));
        }
        if statistics.rounds.is_multiple_of(64) {
            let share = seen.iter().filter(|&&s| s).count() as f64 / tiling.tiles() as f64;
            control.report("solving distance", share);
        }
    }
    control.report("solving distance", 1.0);
    statistics.tiles = seen.iter().filter(|&&s| s).count();
    Ok(statistics)
}

/// Width of the window of keys that one round may take, in mean cells. Wider gives more tiles to a round but solves
/// some too early. On a range of 1001² nodes, curvature metric: 4, 8, 16, 32 give 4.6, 4.5, 4.4, 4.5
/// activations per tile in 1244, 875, 652, 545 rounds; isotropic 3.9, 3.7, 3.6, 3.6 in 1313, 1052, 799, 774.
const WINDOW_CELLS: f32 = 16.0;

/// Fewest tiles of a round that are worth waking other threads for.
const MIN_PARALLEL: usize = 4;

/// Wakes every tile that holds a start value, and its neighbours.
fn wake_start(field: &TensorField, values: &Values, queue: &mut Queue) {
    for tile in 0..field.tiling.tiles() {
        let least = values.tiles[tile].iter().copied().fold(UNREACHED, f32::min);
        if least < UNREACHED {
            queue.wake(tile, least, 0);
            for ((dx, dy), _) in NEIGHBOURS {
                if let Some(n) = neighbour(&field.tiling, tile, dx, dy) {
                    queue.wake(n, least, heading(dx, dy));
                }
            }
        }
    }
}

/// First sweep for news that travel (dx, dy).
fn heading(dx: isize, dy: isize) -> u8 {
    u8::from(dx < 0) | u8::from(dy < 0) << 1
}

/// Writes a solved tile back and wakes the neighbours it can improve.
///
/// On an anisotropic metric a node's value may come from a segment of which one end is *higher* than the node. The
/// other end `a` is lower, and the higher one `b` matters only while `gb − ga` is less than the length of the
/// segment, so news are of interest up to the largest value of a tile and its longest step.
fn settle(field: &TensorField, values: &mut Values, queue: &mut Queue, outcome: &Outcome) {
    let tile = outcome.tile as usize;
    values.tiles[tile] = outcome.values;
    let open = outcome.values.iter().zip(&field.tiles[tile].det).filter(|&(_, &det)| det > 0.0);
    queue.ceiling[tile] = open.map(|(&g, _)| g).fold(0.0, f32::max) + field.longest_step[tile];
    if !outcome.settled {
        let least = outcome.values.iter().copied().fold(UNREACHED, f32::min);
        queue.wake(tile, least, queue.heading[tile]);
    }
    for (((dx, dy), _), &key) in NEIGHBOURS.iter().zip(&outcome.wakes) {
        if key < UNREACHED
            && let Some(n) = neighbour(&field.tiling, tile, *dx, *dy)
            && key < queue.ceiling[n]
        {
            queue.wake(n, key, heading(*dx, *dy));
        }
    }
}

/// Room to solve tiles in.
#[derive(Debug)]
struct Workbench {
    bench: Bench,
    block: Block,
}

impl Default for Workbench {
    fn default() -> Self {
        Self { bench: Bench::default(), block: [[UNREACHED; SIDE + 2]; SIDE + 2] }
    }
}

impl Workbench {
    /// Sweeps a tile until it stands still: along the diagonal of the news forth and back, then along the other.
    fn solve(
        &mut self,
        field: &TensorField,
        values: &Values,
        tile: u32,
        heading: u8,
        tolerance: f32,
    ) -> Outcome {
        let tensors = &field.tiles[tile as usize];
        values.block(tile as usize, &mut self.block);
        let before = values.tiles[tile as usize];
        // Headings 0 (south-east) and 3 (north-west) share a diagonal, 1 (south-west) and 2 (north-east) the other.
        let mut mirrored = heading == 1 || heading == 2;
        let mut descending = heading == 1 || heading == 3;
        self.bench.load(tensors, &self.block, mirrored, tolerance);
        let mut sweeps = 0;
        let mut settled = false;
        while sweeps < MAX_SWEEPS {
            sweeps += 1;
            settled = !self.bench.sweep(descending);
            if settled {
                break;
            }
            descending = !descending;
            if sweeps % 2 == 0 {
                mirrored = !mirrored;
                self.bench.store(&mut self.block);
                self.bench.load(tensors, &self.block, mirrored, tolerance);
            }
        }
        self.bench.store(&mut self.block);
        let mut after = before;
        for (row, line) in after.chunks_exact_mut(SIDE).enumerate() {
            line.copy_from_slice(&self.block[row + 1][1..=SIDE]);
        }
        Outcome { tile, wakes: wakes(&before, &after), values: after, sweeps, settled }
    }
}

/// For each neighbour the least changed value it sees, [`UNREACHED`] if nothing changed.
fn wakes(before: &[f32; AREA], after: &[f32; AREA]) -> [f32; 8] {
    let news = |col: usize, row: usize| {
        let (old, new) = (before[row * SIDE + col], after[row * SIDE + col]);
        if old - new > ROUNDING * new { new } else { UNREACHED }
    };
    NEIGHBOURS.map(|(_, [c0, c1, r0, r1])| {
        let rows = r0..r1;
        rows.flat_map(|row| (c0..c1).map(move |col| (col, row)))
            .map(|(col, row)| news(col, row))
            .fold(UNREACHED, f32::min)
    })
}
