//! A NURBS surface with nodes.

use glam::DVec2;

use super::{Basis, NurbsSurface, SMALL, size};
use crate::error::{Error, Result};
use crate::surface::measures::measured;
use crate::surface::{Block, Jet, JetBlock, Measures, Surface, SurfaceJet};

/// A [`NurbsSurface`] whose parameters are those of a grid: equal steps of the surface's own, from end to end of its domain or,
/// where it is closed, once round.
///
/// # Poles
/// Where an edge of the surface shrinks to a point, as at the top of a surface of revolution, its nodes are all one place, which has
/// no derivative along the edge. They take the jet a thousandth of a cell inside. There the ring around the pole is some 0.006
/// cells long, which is next to nothing: distances go through the pole as they should, and directions and curvatures
/// are their limits.
#[derive(Clone, Debug)]
pub struct NurbsGrid {
    surface: NurbsSurface,
    nodes: [usize; 2],
    /// Least and greatest coordinate at which jets are taken, in directions that are not closed.
    bounds: [[f64; 2]; 2],
    /// The splines of the first parameter at each column.
    columns: Vec<Basis>,
}

/// How far from a pole its jet is taken, in cells. At ten times as far, distances from a pole are wrong by the length of that ring: on
/// a sphere of 200 rows 1.3 and, at high accuracy, 10 times as much. The tensor there is as extreme as `f32` can take on
/// grids of up to some 100 000 columns.
const POLE_INSET: f64 = 0.001;
/// The most nodes along a direction.
const MAX_NODES: usize = 100_000;

impl NurbsSurface {
    /// The surface with `cols` nodes along its first and `rows` along its second parameter.
    ///
    /// # Errors
    /// [`Error::Argument`] for fewer than 2 nodes in a direction, 3 in a closed one, or more than 100 000.
    pub fn on_grid(self, cols: usize, rows: usize) -> Result<NurbsGrid> {
        let nodes = [cols, rows];
        let mut bounds = [[0.0; 2]; 2];
        for axis in [0, 1] {
            let least = if self.closed[axis] { 3 } else { 2 };
            if !(least..=MAX_NODES).contains(&nodes[axis]) {
                return Err(Error::argument(
                    format!(
                        "the number of nodes in the {} direction of the surface",
                        ["first", "second"][axis]
                    ),
                    nodes[axis],
                    format!("between {least} and {MAX_NODES}"),
                ));
            }
            let [first, last] = self.edges(axis).map(|edge| size(&edge) <= SMALL * self.size());
            let inside = |is_pole: bool| if is_pole { POLE_INSET } else { 0.0 };
            bounds[axis] = [inside(first), (nodes[axis] - 1) as f64 - inside(last)];
        }
        let mut grid = NurbsGrid { surface: self, nodes, bounds, columns: Vec::new() };
        let surface = &grid.surface;
        let basis = |u: f64| surface.knots[0].basis(surface.wrapped(0, u));
        grid.columns = (0..cols).map(|col| basis(grid.parameter(0, col as f64))).collect();
        Ok(grid)
    }
}

impl NurbsGrid {
    /// The surface.
    #[must_use]
    pub fn surface(&self) -> &NurbsSurface {
        &self.surface
    }

    /// Grid coordinates of the surface's own parameters.
    #[must_use]
    pub fn to_grid(&self, u: DVec2) -> DVec2 {
        (u - self.origin()) / self.steps()
    }

    fn origin(&self) -> DVec2 {
        DVec2::from(self.surface.knots.each_ref().map(|knots| knots.domain()[0]))
    }

    /// Parameters per node.
    fn steps(&self) -> DVec2 {
        DVec2::from([0, 1].map(|axis| {
            let [from, to] = self.surface.knots[axis].domain();
            let steps = self.nodes[axis] - usize::from(!self.surface.closed[axis]);
            (to - from) / steps as f64
        }))
    }

    /// The surface's own parameter at which the jet of a grid coordinate is taken.
    fn parameter(&self, axis: usize, at: f64) -> f64 {
        let [least, most] = self.bounds[axis];
        let at = if self.surface.closed[axis] { at } else { at.clamp(least, most) };
        self.origin()[axis] + at * self.steps()[axis]
    }

    /// Whether the nodes of a column (`axis` 0) or a row (1) are all one point.
    fn is_pole(&self, axis: usize, at: usize) -> bool {
        let [least, most] = self.bounds[axis];
        (at as f64) < least || at as f64 > most
    }

    /// A jet by the surface's parameters as one by grid coordinates.
    fn by_nodes(&self, jet: SurfaceJet) -> SurfaceJet {
        let DVec2 { x, y } = self.steps();
        let [a, b] = jet.first;
        let [aa, ab, bb] = jet.second;
        SurfaceJet {
            point: jet.point,
            first: [a * x, b * y],
            second: [aa * (x * x), ab * (x * y), bb * (y * y)],
        }
    }
}

impl Surface for NurbsGrid {
    fn cols(&self) -> usize {
        self.nodes[0]
    }

    fn rows(&self) -> usize {
        self.nodes[1]
    }

    fn periodic(&self) -> [bool; 2] {
        self.surface.closed
    }

    /// Without the nodes of poles: they have no area, and the curvature of a tip would outweigh all else.
    fn measures(&self) -> Measures {
        measured(self, |col, row| !self.is_pole(0, col) && !self.is_pole(1, row))
    }

    fn jet(&self, at: DVec2) -> Jet {
        let u = DVec2::new(self.parameter(0, at.x), self.parameter(1, at.y));
        Jet::Space(self.by_nodes(self.surface.jet(u)))
    }

    fn block_jets(&self, block: &Block, jets: &mut JetBlock) {
        if block.centres {
            return block.places().for_each(|(j, i, at)| jets.set(j, i, self.jet(at)));
        }
        let columns = &self.columns[block.cols.clone()];
        for (j, row) in block.rows.clone().enumerate() {
            let row = self.surface.row_jets(columns, self.parameter(1, row as f64));
            for (i, jet) in row.enumerate() {
                jets.set(j, i, Jet::Space(self.by_nodes(jet)));
            }
        }
    }
}
