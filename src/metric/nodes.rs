//! What is known at the nodes only, and bilinear between them.

use std::ops::{Deref, Range};

use glam::DVec2;

use super::{SpeedBlock, SpeedTensor};
use crate::linalg::Sym2;
use crate::linalg::bilinear::corner_weights;
use crate::surface::{Block, Jet, JetBlock, Surface};

/// The nodes of a surface as places in a row-major raster.
#[derive(Clone, Copy, Debug)]
pub(super) struct Nodes {
    counts: [usize; 2],
    periodic: [bool; 2],
}

impl Nodes {
    pub(super) fn of(surface: &dyn Surface) -> Self {
        Self { counts: [surface.cols(), surface.rows()], periodic: surface.periodic() }
    }

    pub(super) fn index(&self, col: usize, row: usize) -> usize {
        row * self.counts[0] + col
    }

    /// The columns and rows of the corners of cells whose north-west corners are the nodes of a block; `None` if the grid is periodic.
    pub(super) fn with_far_corners(&self, block: &Block) -> Option<[Range<usize>; 2]> {
        let corners =
            |nodes: &Range<usize>, axis: usize| nodes.start..self.counts[axis].min(nodes.end + 1);
        (self.periodic == [false; 2]).then(|| [corners(&block.cols, 0), corners(&block.rows, 1)])
    }

    /// The values of a raster at the nodes of a block, row by row within it, each with column and value.
    pub(super) fn of_block<'a, T>(
        &self,
        raster: &'a [T],
        block: &Block,
    ) -> impl Iterator<Item = (usize, usize, &'a T)> + use<'a, T> {
        let (nodes, cols) = (*self, block.cols.clone());
        block.rows.clone().enumerate().flat_map(move |(j, row)| {
            let start = nodes.index(cols.start, row);
            let values = raster[start..start + cols.len()].iter().enumerate();
            values.map(move |(i, value)| (j, i, value))
        })
    }

    /// The corners of the cell around grid coordinates as places in the raster, each with its bilinear weight. Beyond an
    /// edge that is not closed those of the nearest point of the grid.
    pub(super) fn corners(&self, at: DVec2) -> [(usize, f64); 4] {
        let [(west, east, u), (north, south, v)] = [0, 1].map(|axis| {
            let (count, periodic) = (self.counts[axis], self.periodic[axis]);
            let last = (count - 1) as f64;
            let at = if periodic {
                at[axis].rem_euclid(count as f64)
            } else {
                at[axis].clamp(0.0, last)
            };
            let first = at as usize;
            let next = if periodic { (first + 1) % count } else { (first + 1).min(count - 1) };
            (first % count, next, at - first as f64)
        });
        let [nw, ne, sw, se] = corner_weights(DVec2::new(u, v));
        [
            (self.index(west, north), nw),
            (self.index(east, north), ne),
            (self.index(west, south), sw),
            (self.index(east, south), se),
        ]
    }
}

/// Speed tensors at the nodes in the axes of the surface, bilinear between those that have one.
pub(super) struct NodeTensors<T> {
    pub(super) nodes: Nodes,
    /// Row-major.
    pub(super) tensors: T,
}

impl<T: Deref<Target = [Sym2]>> NodeTensors<T> {
    /// The tensor of determinant 1 in the middle of a cell: the mean of those of its corners.
    fn shape(&self, at: DVec2) -> Sym2 {
        let corners = self.nodes.corners(at).into_iter().map(|(node, _)| self.tensors[node]);
        let shapes =
            corners.filter(|d| d.is_positive_definite()).map(|d| d * d.det().sqrt().recip());
        let sum = shapes.fold(Sym2::default(), |sum, d| sum + d);
        sum * sum.det().sqrt().recip()
    }
}

impl<T: Deref<Target = [Sym2]> + Send + Sync> SpeedTensor for NodeTensors<T> {
    fn speed(&self, at: DVec2, _: &Jet) -> Sym2 {
        self.nodes
            .corners(at)
            .into_iter()
            .map(|(node, weight)| (self.tensors[node], weight))
            .filter(|(d, weight)| *weight > 0.0 && d.is_positive_definite())
            .fold(Sym2::default(), |sum, (d, weight)| sum + d * weight)
    }

    fn is_known_at_nodes(&self) -> bool {
        true
    }

    fn node_cost(&self, col: usize, row: usize) -> f64 {
        let d = self.tensors[self.nodes.index(col, row)];
        if d.is_positive_definite() { d.det().powf(-0.25) } else { f64::INFINITY }
    }

    fn block(&self, block: &Block, _: &JetBlock, speeds: &mut SpeedBlock) {
        if block.centres {
            for (j, i, at) in block.places() {
                speeds.set(j, i, self.shape(at));
            }
            return;
        }
        for (j, i, d) in self.nodes.of_block(&self.tensors, block) {
            speeds.set(j, i, if d.is_positive_definite() { *d } else { Sym2::default() });
        }
    }

    fn is_open(&self, col: usize, row: usize) -> bool {
        self.tensors[self.nodes.index(col, row)].is_positive_definite()
    }
}
