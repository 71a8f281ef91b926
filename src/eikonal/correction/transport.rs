//! Transport of the correction along the feet.

#![allow(clippy::needless_range_loop, reason = "lanes of several arrays go together")]

use multiversion::multiversion;

use super::super::board::Board;
use super::super::crew;
use super::super::field::{AREA, SIDE, TensorField};
use super::super::tiles::{ITSELF, Job, NEIGHBOURS, Queue, Values, WINDOW_CELLS, neighbour};
use super::super::update::{ALL, Block, Lines, choose, lanes};
use super::feet::{self, BEFORE, BEHIND, Feet};
use super::strip::Lanes;
use super::triangle::Triangle;
use crate::{Control, Result};

/// Sweeps over a tile before it goes back into the queue, and times it may come back.
const MOST_SWEEPS: usize = 40;
const MOST_ACTIVATIONS: u32 = 40;

/// What the transport shares between rounds.
struct Shared {
    e: Board,
    queue: Queue,
    taken: Vec<Job>,
}

#[derive(Default)]
struct Outcome {
    settled: bool,
    changed: bool,
}

/// The feet of a field's tiles: what the transport follows.
pub(super) struct Ways<'a> {
    pub(super) feet: &'a [Feet],
    /// Neighbours that each tile reads, one bit each as in [`RING`](super::super::update::RING).
    pub(super) reads: &'a [u8],
    /// Least distance of each tile, and the tiles in order of it.
    pub(super) keys: &'a [f32],
    pub(super) order: &'a [u32],
}

/// Solves `e = (1−θ) e(a) + θ e(b) + ρ`, tiles in the order of their least distance.
pub(super) fn carry(
    field: &TensorField,
    &Ways { feet, reads, keys, order }: &Ways<'_>,
    tolerance: f32,
    control: &Control,
) -> Result<Vec<[f32; AREA]>> {
    let tiling = field.tiling;
    let tiles = tiling.tiles();
    let mut order = order.iter().copied().peekable();
    let mut activations = vec![0u32; tiles];
    let mut round = 0;
    let e = Board::new(Values { tiling, tiles: vec![[0.0; AREA]; tiles] });
    let shared = Shared { e, queue: Queue::new(tiles), taken: Vec::new() };
    let work = |_: &mut (), shared: &Shared, index: usize| {
        let tile = shared.taken[index].tile as usize;
        carry_tile(&feet[tile], &shared.e, tile, tolerance)
    };
    let lead = |shared: &mut Shared, outcomes: &mut dyn Iterator<Item = Outcome>| {
        control.check()?;
        let Shared { queue, taken, .. } = shared;
        for (job, outcome) in taken.iter().zip(outcomes) {
            let tile = job.tile as usize;
            activations[tile] += 1;
            let mut wake = |tile: usize| {
                if activations[tile] < MOST_ACTIVATIONS {
                    queue.wake(tile, keys[tile], ITSELF);
                }
            };
            if !outcome.settled {
                wake(tile);
            }
            if outcome.changed {
                for (side, (dx, dy)) in NEIGHBOURS.into_iter().enumerate() {
                    if let Some(n) = neighbour(&tiling, tile, dx, dy)
                        && reads[n] & 1 << ((side + 4) % 8) != 0
                    {
                        wake(n);
                    }
                }
            }
        }
        taken.clear();
        let next = order.peek().map_or(f32::INFINITY, |&tile| keys[tile as usize]);
        let limit = queue.least_key().min(next) + WINDOW_CELLS * field.mean_step;
        while let Some(tile) = order.next_if(|&tile| keys[tile as usize] <= limit) {
            queue.wake(tile as usize, keys[tile as usize], ITSELF);
        }
        if limit.is_finite() {
            round += 1;
            queue.take(&tiling, limit, round, taken);
        }
        Ok(taken.len())
    };
    Ok(crew::run(shared, lead, work)?.e.into_values().tiles)
}

/// Sweeps the correction through a tile until it stands still.
fn carry_tile(feet: &Feet, e: &Board, tile: usize, tolerance: f32) -> Outcome {
    let mut block = [[0.0; SIDE + 2]; SIDE + 2];
    e.load(tile, &mut block);
    // Nothing comes from beyond the grid.
    for value in block.as_flattened_mut() {
        *value = choose(*value < f32::INFINITY, *value, 0.0);
    }
    if feet.by_columns {
        transpose(&mut block);
    }
    let mut descending = feet.descending;
    let mut sweeps = 0;
    let mut dirty = ALL;
    let mut outcome = Outcome::default();
    while dirty != 0 && sweeps < MOST_SWEEPS {
        let changed;
        (dirty, changed) = sweep(&mut block, feet, tolerance, descending, dirty);
        outcome.changed |= changed;
        descending = !descending;
        sweeps += 1;
    }
    outcome.settled = dirty == 0;
    if feet.by_columns {
        transpose(&mut block);
    }
    e.store(tile, &block);
    outcome
}

/// Mirrors a block on its diagonal.
fn transpose(block: &mut Block) {
    for row in 0..block.len() {
        for col in 0..row {
            let value = block[row][col];
            block[row][col] = block[col][row];
            block[col][row] = value;
        }
    }
}

/// One sweep over the lines in `dirty`; those that read what changed since by more than `tolerance`, and whether
/// anything did.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl",
    "x86_64+avx2",
    "x86_64+sse4.1",
))]
fn sweep(
    block: &mut Block,
    feet: &Feet,
    tolerance: f32,
    descending: bool,
    mut dirty: Lines,
) -> (Lines, bool) {
    let mut any = false;
    for step in 0..SIDE {
        let row = if descending { SIDE - 1 - step } else { step };
        if dirty & 1 << row == 0 {
            continue;
        }
        dirty &= !(1 << row);
        let reads = |line: usize, bit: u32| u32::from(feet.reads[line]) & bit != 0;
        // A line that reads itself is carried until it stands still before others read it.
        let most = if reads(row, feet::ITSELF) { SIDE } else { 1 };
        let changes = (0..most).take_while(|_| carry_line(block, feet, row, tolerance)).count();
        if changes == 0 {
            continue;
        }
        any = true;
        if row > 0 && reads(row - 1, BEHIND) {
            dirty |= 1 << (row - 1);
        }
        if row + 1 < SIDE && reads(row + 1, BEFORE) {
            dirty |= 1 << (row + 1);
        }
        if changes == most && most > 1 {
            dirty |= 1 << row;
        }
    }
    (dirty, any)
}

/// Carries the correction to the nodes of a line; whether one changed by more than `tolerance`.
#[inline(always)]
fn carry_line(block: &mut Block, feet: &Feet, row: usize, tolerance: f32) -> bool {
    let [above, here, below] = [&block[row], &block[row + 1], &block[row + 2]];
    let (e, w, s, n) = (lanes(here, 2), lanes(here, 0), lanes(below, 1), lanes(above, 1));
    let (se, nw, ne, sw) = (lanes(below, 2), lanes(above, 0), lanes(above, 2), lanes(below, 0));
    let old = lanes(here, 1);
    let (theta, rho) = (lanes(&feet.theta, row * SIDE), lanes(&feet.rho, row * SIDE));
    let mut triangles = [0u8; SIDE];
    triangles.copy_from_slice(&feet.triangle[row * SIDE..(row + 1) * SIDE]);
    let mut new: Lanes = [0.0; SIDE];
    let mut changed = 0;
    for i in 0..SIDE {
        let bits = u32::from(triangles[i]);
        let triangle = Triangle::from_bits(bits);
        let ring = [e[i], se[i], s[i], sw[i], w[i], nw[i], n[i], ne[i]];
        let (a, b) = (triangle.axis(ring), triangle.diagonal(ring));
        new[i] = choose(bits & Triangle::NONE != 0, old[i], a + theta[i] * (b - a) + rho[i]);
        changed |= u32::from((new[i] - old[i]).abs() > tolerance);
    }
    block[row + 1][1..=SIDE].copy_from_slice(&new);
    changed != 0
}
