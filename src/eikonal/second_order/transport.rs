//! Transport of the correction along the feet.

#![allow(clippy::needless_range_loop, reason = "lanes of several arrays go together")]

use std::iter::{Copied, Peekable};
use std::slice;

use super::super::schedule::active_set::{ActiveSet, ITSELF, Job};
use super::super::schedule::memory::SharedValues;
use super::super::schedule::rounds::WINDOW_CELLS;
use super::super::schedule::worker_pool;
use super::super::tile::transpose::transpose_block;
use super::super::tile::{ALL, LineMask};
use super::domain::Domain;
use super::feet::{self, BEFORE, BEHIND, Feet, Line};
use super::triangle::LaneTriangle;
use crate::control::Control;
use crate::error::Result;
use crate::grid::tiling::{AREA, PaddedTile, SIDE, Tiling, opposite};
use crate::linalg::lanes::{choose, lanes};
use crate::linalg::simd::{self, Kernel};

/// Sweeps over a tile before it is activated again, and the most activations of a tile.
const MOST_SWEEPS: usize = 40;
const MOST_ACTIVATIONS: u32 = 40;

/// What carrying the correction through a tile brought.
#[derive(Clone, Copy)]
struct Outcome {
    converged: bool,
    /// The neighbours next to which something changed, one bit each as in [`RING`](crate::eikonal::stencil::ring::RING).
    changed: u8,
}

impl Outcome {
    fn to_bits(self) -> [u32; 2] {
        [self.converged.into(), self.changed.into()]
    }

    fn from_bits([converged, changed]: [u32; 2]) -> Self {
        Self { converged: converged != 0, changed: changed as u8 }
    }
}

/// Solves `e = (1−θ) e(a) + θ e(b) + ρ` in a domain, tiles in the given `order`, that of their least distance. Returns `e`, and the tiles
/// beyond the domain next to which `e` changed.
pub(super) fn carry(
    domain: &Domain<'_>,
    order: &[u32],
    e: Vec<[f32; AREA]>,
    tolerance: f32,
    control: &Control,
) -> Result<(Vec<[f32; AREA]>, Vec<usize>)> {
    let tiling = domain.solution.field.tiling;
    let tiles = tiling.tiles();
    let e = SharedValues::new(tiling, e, 0.0);
    let work = |_: &mut (), job: u64| {
        let tile = Job::from_bits(job).tile as usize;
        let outcome = match domain.feet(tile) {
            Some((feet, _)) => carry_tile(&tiling, feet, &e, tile, tolerance),
            None => Outcome { converged: true, changed: 0 },
        };
        outcome.to_bits()
    };
    let mut leader = Leader {
        domain,
        order: order.iter().copied().peekable(),
        active: ActiveSet::new(tiles),
        activations: vec![0; tiles],
        round: 0,
        beyond: Vec::new(),
    };
    let lead = |jobs: &mut Vec<u64>, outcomes: &[[u32; 2]]| {
        control.check()?;
        for (job, &outcome) in jobs.drain(..).zip(outcomes) {
            leader.account_for(Job::from_bits(job).tile as usize, Outcome::from_bits(outcome));
        }
        leader.next_round(jobs);
        Ok(())
    };
    worker_pool::run(tiles, lead, work)?;
    Ok((e.into_tiles(), leader.beyond))
}

/// What happens between the rounds, on one thread.
struct Leader<'a> {
    domain: &'a Domain<'a>,
    /// The tiles of the domain that have not been activated yet, in order of their least distance.
    order: Peekable<Copied<slice::Iter<'a, u32>>>,
    active: ActiveSet,
    activations: Vec<u32>,
    round: u32,
    /// Tiles beyond the domain next to which the correction changed.
    beyond: Vec<usize>,
}

impl Leader<'_> {
    /// Takes the outcome of a tile into account: activates it again unless it converged, and the neighbours that read its changes.
    fn account_for(&mut self, tile: usize, outcome: Outcome) {
        self.activations[tile] += 1;
        if !outcome.converged {
            self.activate(tile);
        }
        for (direction, n) in self.domain.solution.field.tiling.neighbours(tile) {
            if outcome.changed & 1 << direction == 0 {
                continue;
            }
            match self.domain.feet(n) {
                Some((_, reads)) if reads & 1 << opposite(direction) != 0 => self.activate(n),
                Some(_) => {}
                None => self.beyond.push(n),
            }
        }
    }

    fn activate(&mut self, tile: usize) {
        if self.activations[tile] < MOST_ACTIVATIONS {
            self.active.activate(tile, self.domain.keys[tile], ITSELF);
        }
    }

    /// Chooses the jobs of the next round; none if all tiles have converged.
    fn next_round(&mut self, jobs: &mut Vec<u64>) {
        let Domain { solution, keys, .. } = self.domain;
        let next = self.order.peek().map_or(f32::INFINITY, |&tile| keys[tile as usize]);
        let window = WINDOW_CELLS * solution.field.mean_step;
        let limit = self.active.least_key().min(next) + window;
        while let Some(tile) = self.order.next_if(|&tile| keys[tile as usize] <= limit) {
            self.active.activate(tile as usize, keys[tile as usize], ITSELF);
        }
        if limit.is_finite() {
            self.round += 1;
            self.active.take(&solution.field.tiling, limit, self.round, jobs);
        }
    }
}

/// Carries the correction through a tile until it converges.
fn carry_tile(
    tiling: &Tiling,
    feet: &Feet,
    e: &SharedValues,
    tile: usize,
    tolerance: f32,
) -> Outcome {
    let mut block = [[0.0; SIDE + 2]; SIDE + 2];
    e.read(tile, &mut block);
    let converged = simd::dispatch(Carry { block: &mut block, feet, tolerance });
    let changed = changed_neighbours(tiling, e, tile, &block, tolerance);
    e.write(tile, &block);
    Outcome { converged, changed }
}

/// Sweeps the correction through a tile; the output is whether it converged.
struct Carry<'a> {
    block: &'a mut PaddedTile,
    feet: &'a Feet,
    tolerance: f32,
}

impl Kernel for Carry<'_> {
    type Output = bool;

    #[inline(always)]
    fn run(self) -> bool {
        let Self { block, feet, tolerance } = self;
        if feet.by_columns {
            transpose_block(block);
        }
        let mut descending = feet.descending;
        let mut sweeps = 0;
        let mut dirty = ALL;
        while dirty != 0 && sweeps < MOST_SWEEPS {
            dirty = sweep(block, feet, tolerance, descending, dirty);
            descending = !descending;
            sweeps += 1;
        }
        if feet.by_columns {
            transpose_block(block);
        }
        dirty == 0
    }
}

/// The neighbours, as in [`Outcome`], next to which the block differs from the values before by more than `tolerance`.
fn changed_neighbours(
    tiling: &Tiling,
    e: &SharedValues,
    tile: usize,
    block: &PaddedTile,
    tolerance: f32,
) -> u8 {
    let [cols, rows] = tiling.size(tile);
    let (east, south) = (cols - 1, rows - 1);
    let changed = |col: usize, row: usize| {
        (block[row + 1][col + 1] - e.at(tile, row * SIDE + col)).abs() > tolerance
    };
    let neighbours = [
        (0..rows).any(|row| changed(east, row)),
        changed(east, south),
        (0..cols).any(|col| changed(col, south)),
        changed(0, south),
        (0..rows).any(|row| changed(0, row)),
        changed(0, 0),
        (0..cols).any(|col| changed(col, 0)),
        changed(east, 0),
    ];
    neighbours
        .into_iter()
        .enumerate()
        .fold(0, |set, (direction, bit)| set | u8::from(bit) << direction)
}

/// One sweep over the lines in `dirty`; returns the lines that read nodes which have changed since by more than `tolerance`.
#[inline(always)]
fn sweep(
    block: &mut PaddedTile,
    feet: &Feet,
    tolerance: f32,
    descending: bool,
    mut dirty: LineMask,
) -> LineMask {
    for step in 0..SIDE {
        let row = if descending { SIDE - 1 - step } else { step };
        if dirty & 1 << row == 0 {
            continue;
        }
        dirty &= !(1 << row);
        let reads = |line: usize, bit: u32| u32::from(feet.reads[line]) & bit != 0;
        // A line that reads itself is iterated until it converges, before others read it.
        let most = if reads(row, feet::ITSELF) { SIDE } else { 1 };
        let changes = carry_line(block, feet, row, most, tolerance);
        if changes == 0 {
            continue;
        }
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
    dirty
}

/// Carries the correction to the nodes of a line, `most` times or until none changes by more than `tolerance`; returns the number of
/// times that one did.
#[inline(always)]
fn carry_line(
    block: &mut PaddedTile,
    feet: &Feet,
    row: usize,
    most: usize,
    tolerance: f32,
) -> usize {
    let [above, here, below] = [&block[row], &block[row + 1], &block[row + 2]];
    let (s, n) = (lanes(below, 1), lanes(above, 1));
    let (se, nw, ne, sw) = (lanes(below, 2), lanes(above, 0), lanes(above, 2), lanes(below, 0));
    let mut old = lanes(here, 1);
    let Line { triangle: bits, theta, defect, .. } = feet.line(row);
    // What comes from the neighbouring lines, and the shares of the neighbours east and west in the line itself.
    let (mut from_lines, mut from_east, mut from_west) = ([0f32; SIDE], [0f32; SIDE], [0f32; SIDE]);
    for i in 0..SIDE {
        let triangle = LaneTriangle::from_bits(bits[i]);
        let moves = bits[i] & LaneTriangle::NONE == 0;
        let [b, _] = triangle.diagonals([0.0, se[i], 0.0, sw[i], 0.0, nw[i], 0.0, ne[i]]);
        let across = triangle.negative.choose(n[i], s[i]);
        let own = 1.0 - theta[i];
        let a = triangle.along_y.choose(own * across, 0.0);
        from_lines[i] = choose(moves, a + theta[i] * b + defect[i], old[i]);
        let along = triangle.along_y.choose(0.0, choose(moves, own, 0.0));
        from_west[i] = triangle.negative.choose(along, 0.0);
        from_east[i] = along - from_west[i];
    }
    let line = &mut block[row + 1];
    let mut changes = 0;
    while changes < most {
        // Not read back from the line in memory, which would have to wait for the writes.
        let (mut e, mut w) = ([line[SIDE + 1]; SIDE], [line[0]; SIDE]);
        e[..SIDE - 1].copy_from_slice(&old[1..]);
        w[1..].copy_from_slice(&old[..SIDE - 1]);
        let mut changed = 0;
        for i in 0..SIDE {
            let new = from_lines[i] + from_east[i] * e[i] + from_west[i] * w[i];
            changed |= u32::from((new - old[i]).abs() > tolerance);
            old[i] = new;
        }
        if changed == 0 {
            break;
        }
        changes += 1;
    }
    line[1..=SIDE].copy_from_slice(&old);
    changes
}
