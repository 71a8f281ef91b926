//! What steps cost: the tensors of nodes and cells and the weights of a tile, and the steps from one node.

use glam::DVec2;

use super::TensorField;
use crate::eikonal::stencil::foot::Steps;
use crate::eikonal::stencil::ring::{RING, TRIANGLES, Triangle};
use crate::eikonal::stencil::segment::diagonal_cost;
use crate::grid::tiling::{AREA, PADDED, PaddedTile, SIDE};
use crate::linalg::Sym2;

/// `D` of a tile's nodes, row by row: `xx`, `xy` and the determinant, which is 0 where the node is closed.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct TensorTile {
    pub(crate) xx: [f32; AREA],
    pub(crate) xy: [f32; AREA],
    pub(crate) det: [f32; AREA],
}

impl TensorTile {
    pub(super) const CLOSED: Self = Self { xx: [0.0; AREA], xy: [0.0; AREA], det: [0.0; AREA] };
}

/// Cells that touch the nodes of a row of a tile: one more than there are nodes.
pub(crate) const CELLS: usize = SIDE + 1;

/// `D` in the middles of the cells that touch the nodes of a tile, row by row from the cell north-west of the first node; as in
/// [`TensorTile`]. The determinant is 0 beyond the grid.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct CellTile {
    pub(crate) xx: [f32; CELLS * CELLS],
    pub(crate) xy: [f32; CELLS * CELLS],
    pub(crate) det: [f32; CELLS * CELLS],
}

impl CellTile {
    pub(super) const CLOSED: Self =
        Self { xx: [0.0; CELLS * CELLS], xy: [0.0; CELLS * CELLS], det: [0.0; CELLS * CELLS] };

    pub(super) fn get(&self, cell: usize) -> [f32; 3] {
        [self.xx[cell], self.xy[cell], self.det[cell]]
    }

    pub(super) fn set(&mut self, cell: usize, [xx, xy, det]: [f32; 3]) {
        (self.xx[cell], self.xy[cell], self.det[cell]) = (xx, xy, det);
    }
}

/// What weighs the steps of a tile, at its nodes and around it: the length of a step under the tensor of its cell and the climb are added in
/// squares, and their root is multiplied by the mean of the costs at both ends.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct WeightTile {
    /// Infinite beyond the grid and where it is unknown.
    pub(crate) cost: PaddedTile,
    /// Heights times the root of the climb weight, in stored units of distance.
    pub(crate) rise: PaddedTile,
}

/// What steps in a tile cost.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StepPrices<'a> {
    /// The tensors of its nodes: for the factor, and where nodes are closed.
    pub(crate) nodes: &'a TensorTile,
    /// The tensors of the cells around its nodes: what steps are priced by; `None` to price them by the node where they arrive.
    pub(crate) cells: Option<&'a CellTile>,
    /// What else steps cost, if anything.
    pub(crate) weights: Option<&'a WeightTile>,
    /// Whether the metric is known at the nodes only, so that functionals of second order take it from there.
    pub(crate) is_by_nodes: bool,
}

impl StepPrices<'_> {
    /// Whether nodes are closed and steps priced in the same way.
    pub(crate) fn are_like(&self, other: &Self) -> bool {
        self.nodes == other.nodes && self.cells == other.cells && self.weights == other.weights
    }
}

impl TensorField {
    /// What steps in a tile cost.
    pub(crate) fn prices(&self, tile: usize) -> StepPrices<'_> {
        let (nodes, cells) = (&self.tiles[tile], self.cells.get(tile));
        StepPrices { nodes, cells, weights: self.weights(tile), is_by_nodes: self.is_by_nodes }
    }

    /// What steps from a node cost.
    pub(crate) fn steps(&self, col: usize, row: usize) -> Steps {
        let (tile, place) = self.tiling.locate(col, row);
        let node = [place % SIDE, place / SIDE];
        let Some(cells) = self.cells.get(tile) else {
            let metric = self.metric(col, row);
            return Steps { metrics: [metric; 8], ring: [1.0; 8], own: 1.0 };
        };
        let mut metrics = TRIANGLES.map(|t| cells.metric(node, RING[t.b]));
        let Some(weights) = self.weights(tile) else {
            return Steps { metrics, ring: [1.0; 8], own: 1.0 };
        };
        for (t, metric) in TRIANGLES.iter().zip(&mut metrics) {
            *metric = metric.map(|metric| metric + Sym2::outer(weights.climb(node, t)));
        }
        let (mut ring, own) = (weights.ring_costs(node), weights.cost_at(node, (0, 0)));
        for b in [1, 3, 5, 7] {
            ring[b] = diagonal_cost(own, ring[b - 1], ring[b], ring[(b + 1) % 8]);
        }
        Steps { metrics, ring: ring.map(f64::from), own: own.into() }
    }
}

impl CellTile {
    /// `M` in the cell on a diagonal side of a node; `None` beyond the grid.
    fn metric(&self, [i, j]: [usize; 2], (dx, dy): (i32, i32)) -> Option<Sym2> {
        let cell = (j + usize::from(dy > 0)) * CELLS + i + usize::from(dx > 0);
        let [xx, xy, det] = self.get(cell).map(f64::from);
        (det > 0.0).then(|| Sym2::new((det + xy * xy) / xx, -xy, xx) * det.recip())
    }
}

impl WeightTile {
    /// No node has a cost, and the ground is level.
    pub(super) const NONE: Self =
        Self { cost: [[f32::INFINITY; PADDED]; PADDED], rise: [[0.0; PADDED]; PADDED] };

    /// The cost at an offset from a node.
    fn cost_at(&self, [i, j]: [usize; 2], (x, y): (i32, i32)) -> f32 {
        self.cost[beside(j, y)][beside(i, x)]
    }

    fn ring_costs(&self, node: [usize; 2]) -> [f32; 8] {
        RING.map(|offset| self.cost_at(node, offset))
    }

    /// The gradient of the weighted heights in a triangle at a node.
    fn climb(&self, [i, j]: [usize; 2], t: &Triangle) -> DVec2 {
        let rise = |(x, y): (i32, i32)| f64::from(self.rise[beside(j, y)][beside(i, x)]);
        let (own, a, b) = (rise((0, 0)), rise(RING[t.a]), rise(RING[t.b]));
        let (dx, dy) = RING[t.b];
        let (x, y) = if t.along_y { (b - a, a - own) } else { (a - own, b - a) };
        DVec2::new(x * f64::from(dx), y * f64::from(dy))
    }
}

/// The place in a padded tile of a column or row beside that of a node.
fn beside(at: usize, by: i32) -> usize {
    (at + 1).wrapping_add_signed(by as isize)
}
