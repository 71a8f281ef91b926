//! The part of a grid that is corrected, and where the values in it come from.

use rayon::prelude::*;

use super::super::stencil::UNREACHED;
use super::feet::{Feet, Input, Roughness, Surroundings};
use super::first_order::FirstOrder;
use super::halo::BATCH;
use crate::control::Control;
use crate::error::Result;
use crate::grid::tiling::{AREA, SIDE, Tiling};
use crate::linalg::lanes::least;

/// Tiles, in batches of [`BATCH`] next to each other, with their feet. Grows where the correction is carried out of it.
pub(super) struct Domain<'a> {
    pub(super) solution: &'a FirstOrder<'a>,
    /// Least distance of each tile.
    pub(super) keys: Vec<f32>,
    batches: Vec<FeetOfBatch>,
    /// The index in `batches` of each batch of the grid, row by row; `None` if it does not belong to the domain.
    places: Vec<Option<u32>>,
}

/// The feet of a batch of tiles.
struct FeetOfBatch {
    first: usize,
    tiles: usize,
    feet: [Feet; BATCH],
    /// The neighbours that each tile reads, one bit each as in [`RING`](crate::eikonal::stencil::ring::RING).
    reads: [u8; BATCH],
    /// For how many rounds of correction they have been found.
    rounds: usize,
}

impl<'a> Domain<'a> {
    /// The `changed` tiles and their neighbours, which read them.
    pub(super) fn around(solution: &'a FirstOrder<'a>, changed: &[bool]) -> Self {
        let Tiling { across, down, .. } = solution.field.tiling;
        let batches = across.div_ceil(BATCH) * down;
        let mut domain = Self {
            solution,
            keys: (0..solution.field.tiling.tiles())
                .into_par_iter()
                .map(|tile| least_of(&solution.values.tile(tile)))
                .collect(),
            // Reserved at once: moving feet when the vector grows would take longer than finding some.
            batches: Vec::with_capacity(batches),
            places: vec![None; batches],
        };
        for (tile, _) in changed.iter().enumerate().filter(|&(_, &changed)| changed) {
            domain.add_around(tile);
        }
        domain
    }

    /// Adds the neighbours of all its tiles.
    pub(super) fn widen(&mut self) {
        for i in 0..self.batches.len() {
            let FeetOfBatch { first, tiles, .. } = self.batches[i];
            (first..first + tiles).for_each(|tile| self.add_around(tile));
        }
    }

    fn add_around(&mut self, tile: usize) {
        self.add(tile);
        self.solution.field.tiling.neighbours(tile).for_each(|(_, n)| self.add(n));
    }

    /// Adds the batch that a tile lies in.
    pub(super) fn add(&mut self, tile: usize) {
        let (batch, place) = self.place(tile);
        if self.places[batch].is_none() {
            self.places[batch] = Some(self.batches.len() as u32);
            let across = self.solution.field.tiling.across;
            self.batches.push(FeetOfBatch {
                first: tile - place,
                tiles: BATCH.min(across - (tile - place) % across),
                feet: [Feet::NONE; BATCH],
                reads: [0; BATCH],
                rounds: 0,
            });
        }
    }

    /// The batch of the grid that a tile lies in, and its place there.
    fn place(&self, tile: usize) -> (usize, usize) {
        let across = self.solution.field.tiling.across;
        let (x, y) = (tile % across, tile / across);
        (y * across.div_ceil(BATCH) + x / BATCH, x % BATCH)
    }

    /// The feet of a tile and the neighbours that it reads, one bit each; `None` if it does not belong to the domain.
    pub(super) fn feet(&self, tile: usize) -> Option<(&Feet, u8)> {
        let (batch, place) = self.place(tile);
        let batch = &self.batches[self.places[batch]? as usize];
        Some((&batch.feet[place], batch.reads[place]))
    }

    /// The roughness of all its tiles.
    pub(super) fn roughness(&self) -> Roughness {
        let feet = self.batches.iter().flat_map(|batch| &batch.feet[..batch.tiles]);
        let mut sum = [0.0f64; 2];
        let mut nodes = 0;
        for Roughness { nodes: count, rejected, lengths } in feet.map(|feet| feet.roughness) {
            nodes += count;
            sum = [sum[0] + f64::from(rejected), sum[1] + f64::from(lengths)];
        }
        Roughness { nodes, rejected: sum[0] as f32, lengths: sum[1] as f32 }
    }

    /// Finds the feet of batches that have none for this round; returns the reached tiles of these in order of distance.
    pub(super) fn find(
        &mut self,
        total: Option<&[[f32; AREA]]>,
        control: &Control,
    ) -> Result<Vec<u32>> {
        let rounds = 1 + usize::from(total.is_some());
        let behind = self.batches.iter().filter(|batch| batch.rounds < rounds);
        let tiles = behind.flat_map(|batch| batch.first..batch.first + batch.tiles);
        let mut order: Vec<u32> =
            tiles.filter(|&tile| self.keys[tile] < UNREACHED).map(|tile| tile as u32).collect();
        let key = |tile: u32| self.keys[tile as usize];
        order.sort_unstable_by(|&a, &b| key(a).total_cmp(&key(b)).then(a.cmp(&b)));
        let solution = self.solution;
        self.batches.par_iter_mut().try_for_each_init(Surroundings::default, |around, batch| {
            control.check()?;
            let FeetOfBatch { first, tiles, feet, reads, .. } = batch;
            for round in batch.rounds..rounds {
                let input = Input { solution, total: total.filter(|_| round > 0) };
                around.find(&input, *first, &mut feet[..*tiles], &mut reads[..*tiles]);
            }
            batch.rounds = rounds;
            Ok(())
        })?;
        Ok(order)
    }
}

/// The least value of a tile.
fn least_of(tile: &[f32]) -> f32 {
    let mut lowest = [f32::INFINITY; SIDE];
    for row in tile.as_chunks::<SIDE>().0 {
        for i in 0..SIDE {
            lowest[i] = least(row[i], lowest[i]);
        }
    }
    lowest.into_iter().fold(f32::INFINITY, f32::min)
}
