//! What weighs steps, at the nodes.

use glam::DVec2;
use rayon::prelude::*;

use super::TensorField;
use super::prices::WeightTile;
use crate::grid::tiling::PADDED;
use crate::metric::MetricField;

impl TensorField {
    /// Takes over what a metric weighs steps by.
    pub(super) fn weigh(&mut self, metric: &MetricField<'_>) {
        if !metric.is_weighted() && !metric.is_known_at_nodes() {
            return;
        }
        let (tiling, surface) = (self.tiling, metric.surface());
        let climb = metric.climb_weight().sqrt() * self.root_scale;
        // Only differences count; `f32` holds those of heights above the first node best.
        let level = surface.point(DVec2::ZERO).z;
        let weights = |tile: usize| {
            let mut weights = WeightTile::NONE;
            for (k, owner) in tiling.places_around(tile).enumerate() {
                let Some((tile, place)) = owner else { continue };
                let (col, row) = tiling.node_at(tile, place);
                let (i, j) = (k % PADDED, k / PADDED);
                weights.cost[j][i] = metric.node_cost(col, row) as f32;
                if climb > 0.0 {
                    let z = surface.point(DVec2::new(col as f64, row as f64)).z;
                    weights.rise[j][i] = ((z - level) * climb) as f32;
                }
            }
            weights
        };
        self.weights = (0..tiling.tiles()).into_par_iter().map(weights).collect();
    }
}
