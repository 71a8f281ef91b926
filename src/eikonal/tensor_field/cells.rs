//! The tensors in the middles of the cells.

use std::array::from_fn;
use std::collections::BTreeSet;

use rayon::prelude::*;

use super::TensorField;
use super::nodes::Store;
use super::prices::{CELLS, CellTile, TensorTile};
use crate::control::Control;
use crate::error::Result;
use crate::grid::tiling::{PADDED, SIDE, Tiling};
use crate::linalg::Sym2;
use crate::linalg::simd;
use crate::metric::{MetricField, SpeedBlock};

impl TensorField {
    /// Gives the cells the tensors of a metric. Those at a row that is stretched by more than `widest`, a pole, are closed.
    pub(super) fn sample_cells(
        &mut self,
        metric: &MetricField<'_>,
        widest: f64,
        control: &Control,
    ) -> Result<()> {
        let surface = metric.surface();
        let at = |row: f64| surface.axes(row).recip();
        let is_open = |row: usize| [0.0, 1.0].iter().all(|by| at(row as f64 + by).x < widest);
        let stretch: Vec<_> = (0..surface.rows()).map(|row| at(row as f64 + 0.5)).collect();
        let (tiling, shrink) = (self.tiling, self.root_scale.recip());
        let own_cells = |speeds: &mut SpeedBlock, tile: usize| {
            let mut cells = CellTile::CLOSED;
            if control.cancel.is_cancelled() {
                return cells;
            }
            let (col, row) = ((tile % tiling.across) * SIDE, (tile / tiling.across) * SIDE);
            metric.block_cells(col, row, speeds);
            let mut tensors = TensorTile::CLOSED;
            let stretch = &stretch[row..];
            simd::dispatch(Store { speeds, stretch, shrink, tile: &mut tensors });
            let [cols, rows] = cells_of(&tiling, tile);
            for j in (0..rows).filter(|j| is_open(row + j)) {
                for i in 0..cols {
                    let place = j * SIDE + i;
                    let d = [tensors.xx[place], tensors.xy[place], tensors.det[place]];
                    cells.set((j + 1) * CELLS + i + 1, d);
                }
            }
            cells
        };
        self.cells = (0..tiling.tiles())
            .into_par_iter()
            .with_min_len(tiling.across)
            .map_init(SpeedBlock::default, own_cells)
            .collect();
        control.check()?;
        self.share_borders();
        Ok(())
    }

    /// Gives each tile the cells north and west of it, which its neighbours have.
    fn share_borders(&mut self) {
        let (tiling, cells) = (self.tiling, &self.cells);
        let border = |tile: usize| -> [[f32; 3]; 2 * CELLS - 1] {
            from_fn(|k| {
                let (i, j) = border_cell(k);
                let at = tiling.seen_from(tile, i as isize - 1, j as isize - 1);
                at.map_or([0.0; 3], |(tile, place)| {
                    cells[tile].get((place / SIDE + 1) * CELLS + place % SIDE + 1)
                })
            })
        };
        let borders: Vec<_> = (0..tiling.tiles()).into_par_iter().map(border).collect();
        self.cells.par_iter_mut().zip(borders).for_each(|(cells, border)| {
            for (k, d) in border.into_iter().enumerate() {
                let (i, j) = border_cell(k);
                cells.set(j * CELLS + i, d);
            }
        });
    }

    /// Gives the cells around a node the means of the tensors of their corners, without the costs.
    pub(super) fn update_around(&mut self, col: usize, row: usize) {
        let around = (-1..=1).flat_map(|j| (-1..=1).map(move |i| (i, j)));
        let nodes =
            around.filter_map(|(i, j)| self.tiling.node(col as isize + i, row as isize + j));
        let tiles: BTreeSet<usize> =
            nodes.map(|(col, row)| self.tiling.locate(col, row).0).collect();
        let own = self.tiling.locate(col, row);
        for tile in tiles {
            let places: Vec<_> = self.tiling.places_around(tile).collect();
            for at in (0..places.len()).filter(|&at| places[at] == Some(own)) {
                let (i, j) = (at % PADDED, at / PADDED);
                for (i, j) in [
                    (i, j),
                    (i.wrapping_sub(1), j),
                    (i, j.wrapping_sub(1)),
                    (i.wrapping_sub(1), j.wrapping_sub(1)),
                ] {
                    if i < CELLS && j < CELLS {
                        self.average_cell(tile, [i, j], &places);
                    }
                }
            }
        }
    }

    /// Gives a cell of a tile, whose nodes and those around lie at `places`, the mean of its open corners.
    fn average_cell(&mut self, tile: usize, [i, j]: [usize; 2], places: &[Option<(usize, usize)>]) {
        let (mut sum, mut count) = (Sym2::default(), 0.0);
        for (i, j) in [(i, j), (i + 1, j), (i, j + 1), (i + 1, j + 1)] {
            let Some((owner, place)) = places[j * PADDED + i] else { continue };
            let nodes = &self.tiles[owner];
            let [xx, xy, det] = [nodes.xx[place], nodes.xy[place], nodes.det[place]].map(f64::from);
            if det > 0.0 {
                let cost = f64::from(self.weights(tile).map_or(1.0, |weights| weights.cost[j][i]));
                sum = sum + Sym2::new(xx, xy, (det + xy * xy) / xx) * (cost * cost);
                count += 1.0;
            }
        }
        if count > 0.0 {
            let d = sum * f64::recip(count);
            self.cells[tile].set(j * CELLS + i, [d.xx as f32, d.xy as f32, d.det() as f32]);
        }
    }
}

/// Column and row of the `k`-th of the cells that touch a tile from the north and the west.
fn border_cell(k: usize) -> (usize, usize) {
    if k < CELLS { (k, 0) } else { (0, k - CELLS + 1) }
}

/// Columns and rows of the cells of which a node of the tile is the north-western corner.
fn cells_of(tiling: &Tiling, tile: usize) -> [usize; 2] {
    let [cols, rows] = tiling.size(tile);
    let is_last =
        [tile % tiling.across + 1 == tiling.across, tile / tiling.across + 1 == tiling.down];
    let beyond = |axis: usize| usize::from(is_last[axis] && !tiling.periodic[axis]);
    [cols - beyond(0), rows - beyond(1)]
}
