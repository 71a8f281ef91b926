//! A surface whose nodes are labelled by region, and sums over them.

use rayon::prelude::*;

use crate::control::Control;
use crate::error::Result;
use crate::grid::tiling::wrap;
use crate::surface::{BLOCK, Block, JetBlock, Lanes, SpaceLanes, Surface};

/// A surface whose nodes are labelled by region.
pub(super) struct LabelledSurface<'a> {
    pub(super) surface: &'a dyn Surface,
    pub(super) cols: usize,
    pub(super) rows: usize,
    pub(super) periodic: [bool; 2],
    /// Region of each node, row-major.
    pub(super) labels: &'a [Option<u32>],
    pub(super) regions: usize,
}

/// Neighbouring nodes of a row, at most [`BLOCK`].
pub(super) struct Run<'a> {
    /// Column and row of the first.
    pub(super) node: [usize; 2],
    pub(super) labels: &'a [Option<u32>],
    pub(super) jets: SpaceLanes,
}

/// What is added up over the nodes of a region.
pub(super) trait Sum: Clone + Default + Send {
    fn add(&mut self, other: &Self);
}

impl Run<'_> {
    /// `of` the region of each node; `NaN` at nodes of none.
    pub(super) fn of_regions(&self, of: impl Fn(usize) -> f64) -> Lanes {
        let mut lanes = [0.0; BLOCK];
        for (lane, label) in lanes.iter_mut().zip(self.labels) {
            *lane = label.map_or(f64::NAN, |region| of(region as usize));
        }
        lanes
    }
}

impl LabelledSurface<'_> {
    /// Goes through the nodes of [`BLOCK`] rows from row `first` on, run by run: from left to right in each row.
    pub(super) fn visit(&self, first: usize, control: &Control, mut visit: impl FnMut(&Run<'_>)) {
        let mut run = Run { node: [0; 2], labels: &[], jets: SpaceLanes::default() };
        let mut jets = JetBlock::default();
        for col in (0..self.cols).step_by(BLOCK) {
            if control.cancel.is_cancelled() {
                return;
            }
            let block = Block::from(self.surface, col, first);
            self.surface.block_jets(&block, &mut jets);
            for (j, row) in block.rows.enumerate() {
                run.node = [col, row];
                run.labels = &self.labels[row * self.cols..][block.cols.clone()];
                run.jets.load(&jets, j, self.surface.axes(row as f64));
                visit(&run);
            }
        }
    }

    /// The sum of each region over its nodes, of which `values` says what to add. Added in the order of the rows, so that the
    /// number of threads changes nothing.
    pub(super) fn sums<T: Sum>(
        &self,
        control: &Control,
        values: impl Fn(&Run<'_>, &mut [T; BLOCK]) + Sync,
    ) -> Result<Vec<T>> {
        let bands: Vec<_> = (0..self.rows.div_ceil(BLOCK))
            .into_par_iter()
            .map(|band| self.sums_of_rows(band * BLOCK, control, &values))
            .collect();
        control.check()?;
        let mut sums = vec![T::default(); self.regions];
        for (region, sum) in bands.iter().flatten().flatten() {
            sums[*region as usize].add(sum);
        }
        Ok(sums)
    }

    /// The sums along each of [`BLOCK`] rows, one for as long as nodes of one region follow each other: mostly they do.
    fn sums_of_rows<T: Sum>(
        &self,
        first: usize,
        control: &Control,
        values: impl Fn(&Run<'_>, &mut [T; BLOCK]),
    ) -> [Vec<(u32, T)>; BLOCK] {
        let mut rows: [Vec<(u32, T)>; BLOCK] = Default::default();
        let mut of_nodes = std::array::from_fn(|_| T::default());
        self.visit(first, control, |run| {
            values(run, &mut of_nodes);
            let sums = &mut rows[run.node[1] - first];
            for (value, label) in of_nodes.iter().zip(run.labels) {
                let Some(region) = *label else { continue };
                match sums.last_mut() {
                    Some((last, sum)) if *last == region => sum.add(value),
                    _ => sums.push((region, value.clone())),
                }
            }
        });
        rows
    }

    /// Index of the node at a column and row in the grid or next to it, over the seam of a closed direction; `None` beyond a border.
    pub(super) fn node(&self, col: isize, row: isize) -> Option<usize> {
        let [across, down] = self.periodic;
        Some(wrap(row, self.rows, down)? * self.cols + wrap(col, self.cols, across)?)
    }

    /// Whether each node is the first corner of a cell all of whose corners belong to one region; cells over a seam do not count.
    pub(super) fn inner_cells(&self) -> Vec<bool> {
        let cols = self.cols;
        let mut inner = vec![false; self.labels.len()];
        inner.par_chunks_mut(cols.max(1)).enumerate().for_each(|(row, inner)| {
            let here = &self.labels[row * cols..];
            if row + 1 < self.rows {
                let corners = here.windows(2).zip(here[cols..].windows(2));
                for (inner, (a, b)) in inner[..cols - 1].iter_mut().zip(corners) {
                    *inner = a[0].is_some() && a[1] == a[0] && b[0] == a[0] && b[1] == a[0];
                }
            }
        });
        inner
    }
}
