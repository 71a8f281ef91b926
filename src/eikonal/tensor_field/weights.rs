//! What weighs steps, at the nodes.

use glam::DVec2;
use rayon::prelude::*;

use super::TensorField;
use super::prices::{TensorTile, WeightTile};
use crate::grid::tiling::{AREA, PADDED, SIDE};
use crate::metric::MetricField;
use crate::surface::{Block, Jet, JetBlock, Surface};

impl TensorField {
    /// Takes over what a metric weighs steps by.
    pub(super) fn weigh(&mut self, metric: &MetricField<'_>) {
        if !metric.is_weighted() && !metric.is_known_at_nodes() {
            return;
        }
        let (tiling, surface) = (self.tiling, metric.surface());
        let climb = metric.climb_weight().sqrt() * self.root_scale;
        let rises = if climb > 0.0 { self.rises(surface, climb) } else { Vec::new() };
        let weights = |tile: usize| {
            let mut weights = WeightTile::NONE;
            for (k, owner) in tiling.places_around(tile).enumerate() {
                let Some((tile, place)) = owner else { continue };
                let (col, row) = tiling.node_at(tile, place);
                let (i, j) = (k % PADDED, k / PADDED);
                weights.cost[j][i] = metric.node_cost(col, row) as f32;
                weights.rise[j][i] = rises.get(tile).map_or(0.0, |rises| rises[place]);
            }
            weights
        };
        self.weights = (0..tiling.tiles()).into_par_iter().map(weights).collect();
    }

    /// Column and row of an open node.
    fn first_open(&self) -> Option<(usize, usize)> {
        let place = |tile: &TensorTile| tile.det.iter().position(|&det| det > 0.0);
        let (tile, place) =
            self.tiles.iter().enumerate().find_map(|(i, tile)| Some((i, place(tile)?)))?;
        Some(self.tiling.node_at(tile, place))
    }

    /// Heights times `climb`, tile by tile.
    fn rises(&self, surface: &dyn Surface, climb: f64) -> Vec<[f32; AREA]> {
        // Only differences count; `f32` holds those of heights above one that is typical best.
        let Some((col, row)) = self.first_open() else { return Vec::new() };
        let level = surface.point(DVec2::new(col as f64, row as f64)).z;
        let tile = |jets: &mut JetBlock, tile: usize| {
            let mut rises = [0.0; AREA];
            let (col, row) = self.tiling.node_at(tile, 0);
            let block = Block::from(surface, col, row);
            surface.block_jets(&block, jets);
            for (j, i, _) in block.places() {
                let z = match jets.get(j, i) {
                    Jet::Height(jet) => jet.z,
                    Jet::Space(jet) => jet.point.z,
                };
                // In the middle of voids there is no surface.
                let above = if z.is_finite() { z - level } else { 0.0 };
                rises[j * SIDE + i] = (above * climb) as f32;
            }
            rises
        };
        let tiles = (0..self.tiling.tiles()).into_par_iter();
        tiles.map_init(JetBlock::default, tile).collect()
    }
}
