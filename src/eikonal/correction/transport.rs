//! Transport of the correction along the feet.

#![allow(clippy::needless_range_loop, reason = "lanes of several arrays go together")]

use multiversion::multiversion;
use rayon::prelude::*;

use super::super::crew;
use super::super::field::{AREA, SIDE, TensorField, Tiling};
use super::super::tiles::{ITSELF, Job, NEIGHBOURS, Queue, WINDOW_CELLS, neighbour};
use super::super::update::{ALL, Lines, RING, UNREACHED, around, choose, lanes};
use super::feet::{Feet, TRIANGLES};
use super::patch::{Lanes, MARGIN, Patch, patch, seen, transpose};
use crate::{Control, Result};

/// Sweeps over a tile before it goes back into the queue, and times it may come back.
const MOST_SWEEPS: usize = 40;
const MOST_ACTIVATIONS: u32 = 40;

/// What the transport shares between rounds.
struct Shared {
    e: Vec<[f32; AREA]>,
    queue: Queue,
    taken: Vec<Job>,
}

#[derive(Default)]
struct Outcome {
    e: Option<Box<[f32; AREA]>>,
    settled: bool,
    changed: bool,
}

/// Solves `e = (1−θ) e(a) + θ e(b) + ρ`, tiles in the order of their least distance.
pub(super) fn carry(
    field: &TensorField,
    values: &[[f32; AREA]],
    feet: &[Feet],
    tolerance: f32,
    control: &Control,
) -> Result<Vec<[f32; AREA]>> {
    let tiling = field.tiling;
    let tiles = tiling.tiles();
    let least = |tile: &[f32; AREA]| tile.iter().copied().fold(f32::INFINITY, f32::min);
    let keys: Vec<f32> = values.par_iter().map(least).collect();
    let mut order: Vec<u32> = (0..tiles as u32).filter(|&t| keys[t as usize] < UNREACHED).collect();
    order.sort_unstable_by(|&a, &b| keys[a as usize].total_cmp(&keys[b as usize]).then(a.cmp(&b)));
    let mut order = order.into_iter().peekable();
    let mut activations = vec![0u32; tiles];
    let mut round = 0;
    let shared =
        Shared { e: vec![[0.0; AREA]; tiles], queue: Queue::new(tiles), taken: Vec::new() };
    let work = |_: &mut (), shared: &Shared, index: usize| {
        let tile = shared.taken[index].tile as usize;
        carry_tile(&tiling, &feet[tile], &shared.e, tile, tolerance)
    };
    let lead = |shared: &mut Shared, outcomes: &mut dyn Iterator<Item = Outcome>| {
        control.check()?;
        let Shared { e, queue, taken } = shared;
        for (job, outcome) in taken.iter().zip(outcomes) {
            let tile = job.tile as usize;
            activations[tile] += 1;
            if let Some(new) = &outcome.e {
                e[tile] = **new;
            }
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
                        && feet[n].reads & 1 << ((side + 4) % 8) != 0
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
    Ok(crew::run(shared, lead, work)?.e)
}

/// Sweeps the correction through a tile until it stands still.
fn carry_tile(
    tiling: &Tiling,
    feet: &Feet,
    e: &[[f32; AREA]],
    tile: usize,
    tolerance: f32,
) -> Outcome {
    let mut outcome = Outcome::default();
    let mut block = patch(tiling, tile, 0.0, |t| &e[t]);
    // By columns where most comes along the rows, and against the direction it comes from.
    let turned = (feet.flow[0].abs() > feet.flow[1].abs()).then(|| feet.transposed());
    let feet = turned.as_ref().unwrap_or(feet);
    if turned.is_some() {
        transpose(&mut block);
    }
    let weights = weights(feet);
    let mut descending = feet.flow[1] > 0;
    let mut sweeps = 0;
    let mut dirty = ALL;
    while dirty != 0 && sweeps < MOST_SWEEPS {
        dirty = carry_once(&mut block, &weights, &feet.rho, tolerance, descending, dirty);
        outcome.changed |= dirty != 0;
        descending = !descending;
        sweeps += 1;
    }
    outcome.settled = dirty == 0;
    if turned.is_some() {
        transpose(&mut block);
    }
    let mut new = Box::new([0.0; AREA]);
    for (row, line) in new.chunks_exact_mut(SIDE).enumerate() {
        line.copy_from_slice(&block[row + MARGIN][MARGIN..MARGIN + SIDE]);
    }
    outcome.e = Some(new);
    outcome
}

/// Weights of the ring in each node's value, by rows.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl",
    "x86_64+avx2",
    "x86_64+sse4.1",
))]
fn weights(feet: &Feet) -> [[Lanes; 8]; SIDE] {
    let mut weights = [[[0f32; SIDE]; 8]; SIDE];
    for (row, weights) in weights.iter_mut().enumerate() {
        let theta = lanes(&feet.theta, row * SIDE);
        let mut triangle = [0u8; SIDE];
        triangle.copy_from_slice(&feet.triangle[row * SIDE..(row + 1) * SIDE]);
        for t in 0..8 {
            let (a, b) = TRIANGLES[t];
            for i in 0..SIDE {
                let here = triangle[i] == t as u8;
                weights[a][i] += choose(here, 1.0 - theta[i], 0.0);
                weights[b][i] += choose(here, theta[i], 0.0);
            }
        }
    }
    weights
}

/// One sweep over the rows in `dirty`; the rows next to which something changed by more than `tolerance`.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl",
    "x86_64+avx2",
    "x86_64+sse4.1",
))]
fn carry_once(
    block: &mut Patch,
    weights: &[[[f32; SIDE]; 8]; SIDE],
    rho: &[f32; AREA],
    tolerance: f32,
    descending: bool,
    mut dirty: Lines,
) -> Lines {
    for step in 0..SIDE {
        let row = if descending { SIDE - 1 - step } else { step };
        if dirty & 1 << row == 0 {
            continue;
        }
        dirty &= !(1 << row);
        let mut new = lanes(rho, row * SIDE);
        for n in 0..8 {
            let (dx, dy) = RING[n];
            let e = seen(block, row, dx, dy);
            for i in 0..SIDE {
                new[i] += weights[row][n][i] * e[i];
            }
        }
        let old = seen(block, row, 0, 0);
        let mut changed = 0;
        for i in 0..SIDE {
            changed |= u32::from((new[i] - old[i]).abs() > tolerance);
        }
        block[row + MARGIN][MARGIN..MARGIN + SIDE].copy_from_slice(&new);
        if changed != 0 {
            dirty |= around(row);
        }
    }
    dirty
}
