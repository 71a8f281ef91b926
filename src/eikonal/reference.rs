//! A slow and simple solver of the same equation, which tests compare with.

use glam::DVec2;

use super::factors::Factors;
use super::predecessor::best_foot;
use super::schedule::memory::MemoryStore;
use super::schedule::tile_store::TileStore;
use super::schedule::values::Values;
use super::start::StartRegion;
use super::stencil::ring::{RING, TRIANGLES};
use super::tensor_field::TensorField;
use super::tile::Limits;
use super::tile::coefficients::ceiling;
use super::{DistanceMap, Statistics, source};
use crate::control::Control;
use crate::error::{Error, Result};

/// Sweeps after which a solve is given up.
const MOST_SWEEPS: usize = 2000;

/// The same start values and the same discrete equation as [`Solver`](super::Solver), but each node's update is the plain
/// minimum over the ring and whole-grid Gauss–Seidel sweeps go on until no node changes at all.
///
/// # Errors
/// As [`Solver::solve`](super::Solver::solve).
pub fn solve(field: TensorField, starts: &[StartRegion], control: &Control) -> Result<DistanceMap> {
    let factors = Factors::new(&field, starts);
    let seeds = source::seeds(&field, starts)?;
    let store = MemoryStore::seeded(&field, &seeds);
    let value = |col, row| {
        let (tile, place) = field.tiling.locate(col, row);
        store.values.at(tile, place)
    };
    let (cols, rows) = (field.cols(), field.rows());
    let mut changed = true;
    let mut sweep = 0;
    while changed {
        control.check()?;
        changed = false;
        for j in 0..rows {
            let row = if sweep & 2 == 0 { j } else { rows - 1 - j };
            for i in 0..cols {
                let col = if sweep & 1 == 0 { i } else { cols - 1 - i };
                let (tile, place) = field.tiling.locate(col, row);
                let old = store.values.at(tile, place);
                let new = best_foot(&field, &factors, value, col, row)
                    .map_or(f32::INFINITY, |(g, _)| g as f32);
                let seed = seeds[tile].as_ref().map_or(f32::INFINITY, |seeds| seeds[place]);
                if new < old.min(ceiling(seed, shortest(&field, col, row))) {
                    store.values.set(tile, place, new);
                    changed = true;
                }
            }
        }
        sweep += 1;
        if sweep > MOST_SWEEPS {
            let activations = sweep * field.tiling.tiles();
            return Err(Error::NotConverged { activations, at: None });
        }
    }
    let statistics = Statistics { sweeps: sweep, ..Statistics::default() };
    // Nothing is known of the margins, so that nothing counts as final.
    let unknown = Limits { margin: f32::MAX, longest_step: f32::MAX };
    (0..field.tiling.tiles()).try_for_each(|tile| store.set_limits(tile, &unknown))?;
    Ok(DistanceMap {
        values: Values::new(field.tiling, store),
        field,
        factors,
        correction: None,
        starts: starts.into(),
        statistics,
    })
}

/// Cost of the cheapest step from a node to its ring.
fn shortest(field: &TensorField, col: usize, row: usize) -> f32 {
    let steps = field.steps(col, row);
    let triangles = TRIANGLES.iter().zip(steps.metrics);
    let costs = triangles.flat_map(|(t, metric)| {
        [t.a, t.b].map(|k| {
            let by = DVec2::new(RING[k].0.into(), RING[k].1.into());
            metric.map_or(f64::INFINITY, |m| 0.5 * (steps.own + steps.ring[k]) * m.norm(by))
        })
    });
    costs.fold(f64::INFINITY, f64::min) as f32
}
