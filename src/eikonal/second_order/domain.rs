//! The part of a grid that is corrected, and where the values in it come from.

use rayon::prelude::*;

use super::super::stencil::UNREACHED;
use super::feet::{Feet, Input, Surroundings};
use super::first_order::FirstOrder;
use super::halo::STRIP;
use crate::control::Control;
use crate::error::Result;
use crate::grid::tiling::{AREA, SIDE, Tiling};
use crate::linalg::lanes::least;

/// Tiles, in strips of [`STRIP`] side by side, with their feet. Grows where the correction is carried beyond.
pub(super) struct Domain<'a> {
    pub(super) solution: &'a FirstOrder<'a>,
    /// Least distance of each tile.
    pub(super) keys: Vec<f32>,
    strips: Vec<FeetOfStrip>,
    /// The place in `strips` of each strip of the grid, row by row; `None` if it does not belong to the domain.
    places: Vec<Option<u32>>,
}

/// The feet of tiles side by side.
struct FeetOfStrip {
    first: usize,
    tiles: usize,
    feet: [Feet; STRIP],
    /// The neighbours that each tile reads, one bit each as in [`RING`](crate::eikonal::stencil::ring::RING).
    reads: [u8; STRIP],
    /// In how many rounds they were found.
    rounds: usize,
}

impl<'a> Domain<'a> {
    /// The `changed` tiles and those that look at them.
    pub(super) fn around(solution: &'a FirstOrder<'a>, changed: &[bool]) -> Self {
        let Tiling { across, down, .. } = solution.field.tiling;
        let strips = across.div_ceil(STRIP) * down;
        let mut domain = Self {
            solution,
            keys: (0..solution.field.tiling.tiles())
                .into_par_iter()
                .map(|tile| least_of(solution.values.tile(tile)))
                .collect(),
            // Moving feet to a larger place would take longer than finding some.
            strips: Vec::with_capacity(strips),
            places: vec![None; strips],
        };
        for (tile, _) in changed.iter().enumerate().filter(|&(_, &changed)| changed) {
            domain.add_around(tile);
        }
        domain
    }

    /// Adds all tiles around.
    pub(super) fn widen(&mut self) {
        for i in 0..self.strips.len() {
            let FeetOfStrip { first, tiles, .. } = self.strips[i];
            (first..first + tiles).for_each(|tile| self.add_around(tile));
        }
    }

    fn add_around(&mut self, tile: usize) {
        self.add(tile);
        self.solution.field.tiling.neighbours(tile).for_each(|(_, n)| self.add(n));
    }

    /// Adds the strip that a tile lies in.
    pub(super) fn add(&mut self, tile: usize) {
        let (strip, place) = self.place(tile);
        if self.places[strip].is_none() {
            self.places[strip] = Some(self.strips.len() as u32);
            let across = self.solution.field.tiling.across;
            self.strips.push(FeetOfStrip {
                first: tile - place,
                tiles: STRIP.min(across - (tile - place) % across),
                feet: [Feet::NONE; STRIP],
                reads: [0; STRIP],
                rounds: 0,
            });
        }
    }

    /// The strip of the grid that a tile lies in, and its place there.
    fn place(&self, tile: usize) -> (usize, usize) {
        let across = self.solution.field.tiling.across;
        let (x, y) = (tile % across, tile / across);
        (y * across.div_ceil(STRIP) + x / STRIP, x % STRIP)
    }

    /// The feet of a tile and the neighbours that it reads, one bit each; `None` if it does not belong to the domain.
    pub(super) fn feet(&self, tile: usize) -> Option<(&Feet, u8)> {
        let (strip, place) = self.place(tile);
        let strip = &self.strips[self.places[strip]? as usize];
        Some((&strip.feet[place], strip.reads[place]))
    }

    /// Finds the feet of strips that have none of this round; the reached tiles of these in order of distance.
    pub(super) fn find(
        &mut self,
        total: Option<&[[f32; AREA]]>,
        control: &Control,
    ) -> Result<Vec<u32>> {
        let rounds = 1 + usize::from(total.is_some());
        let behind = self.strips.iter().filter(|strip| strip.rounds < rounds);
        let tiles = behind.flat_map(|strip| strip.first..strip.first + strip.tiles);
        let mut order: Vec<u32> =
            tiles.filter(|&tile| self.keys[tile] < UNREACHED).map(|tile| tile as u32).collect();
        let key = |tile: u32| self.keys[tile as usize];
        order.sort_unstable_by(|&a, &b| key(a).total_cmp(&key(b)).then(a.cmp(&b)));
        let solution = self.solution;
        self.strips.par_iter_mut().try_for_each_init(Surroundings::default, |around, strip| {
            control.check()?;
            let FeetOfStrip { first, tiles, feet, reads, .. } = strip;
            for round in strip.rounds..rounds {
                let input = Input { solution, total: total.filter(|_| round > 0) };
                around.find(&input, *first, &mut feet[..*tiles], &mut reads[..*tiles]);
            }
            strip.rounds = rounds;
            Ok(())
        })?;
        Ok(order)
    }
}

/// The least value of a tile.
fn least_of(tile: &[f32; AREA]) -> f32 {
    let mut lowest = [f32::INFINITY; SIDE];
    for row in tile.as_chunks::<SIDE>().0 {
        for i in 0..SIDE {
            lowest[i] = least(row[i], lowest[i]);
        }
    }
    lowest.into_iter().fold(f32::INFINITY, f32::min)
}
