//! Smooth surfaces with exact derivatives over a grid of nodes.
//!
//! [`Surface`] is all that metrics, routes and regions ask of one. [`HeightSurface`] fits a tensor-product B-spline (`bspline/`)
//! to the heights of a terrain; [`NurbsGrid`] is a [`NurbsSurface`] of any form with nodes. A user's own needs three
//! methods: how many columns and rows, and the [`Jet`] at a point. `curvature` derives slope, normal and curvatures from a jet.

mod block;
mod bspline;
mod curvature;
mod height;
#[cfg(test)]
pub(crate) mod in_space;
mod jet;
mod measures;
mod nurbs;

use glam::{DVec2, DVec3};

use self::measures::measured;
use crate::grid::GridFrame;

pub(crate) use self::block::{BLOCK, Lanes, SpaceLanes};
pub use self::block::{Block, JetBlock};
pub(crate) use self::bspline::block::HeightBlock;
pub use self::bspline::residuals::Residuals;
pub use self::curvature::PrincipalCurvatures;
pub use self::height::{Degree, FitOptions, HeightSurface, Smoothing};
pub(crate) use self::jet::Forms;
pub use self::jet::{HeightJet, Jet, SurfaceJet};
pub use self::measures::Measures;
pub use self::nurbs::{Knots, NurbsCurve, NurbsGrid, NurbsSurface};

/// A smooth surface over a grid of nodes.
///
/// Places are grid coordinates `(column, row)`, nodes at whole numbers, so that a node's neighbours are one step away. In a
/// [periodic](Self::periodic) direction node `cols` (or `rows`) is node 0 again; in others the grid ends at node `cols − 1`.
///
/// A surface is one of two kinds, and gives jets of that kind everywhere:
///
/// | | jets | [`axes`](Self::axes) | [`frame`](Self::frame) |
/// |---|---|---|---|
/// | heights `z(x, y)`: [`HeightSurface`] | [`Jet::Height`] | ground axes: x east, y north, m | the grid's place on the map |
/// | a map `S(u)` into space: [`NurbsGrid`] | [`Jet::Space`] | grid coordinates | none |
///
/// The third axis of space is up.
pub trait Surface: Sync {
    /// Nodes along the first parameter.
    fn cols(&self) -> usize;

    /// Nodes along the second parameter.
    fn rows(&self) -> usize;

    /// The surface and its derivatives at grid coordinates.
    fn jet(&self, at: DVec2) -> Jet;

    /// Whether columns, and whether rows, close to a ring.
    fn periodic(&self) -> [bool; 2] {
        [false; 2]
    }

    /// Whether the node is missing: the surface there is only a continuation.
    fn is_void(&self, col: usize, row: usize) -> bool {
        let _ = (col, row);
        false
    }

    /// Whether any node is missing; by default every node is asked.
    fn has_voids(&self) -> bool {
        (0..self.rows()).any(|row| (0..self.cols()).any(|col| self.is_void(col, row)))
    }

    /// What one step along columns and one along rows measures around a row, in the axes of jets and tensors: metres east and
    /// metres north (negative: rows run south) on heights, `(1, 1)` in space.
    fn axes(&self, row: f64) -> DVec2 {
        let _ = row;
        DVec2::ONE
    }

    /// Where the grid lies on the map, if it does.
    fn frame(&self) -> Option<&GridFrame> {
        None
    }

    /// The place at grid coordinates: map coordinates and height in metres, or a point in space, m.
    fn point(&self, at: DVec2) -> DVec3 {
        let DVec3 { x, y, z } = self.space_jet(at).point;
        self.frame().map_or(DVec3::new(x, y, z), |frame| frame.to_map(at).extend(z))
    }

    /// Jets at the places of a block. To be overridden where many together are faster than one by one.
    fn block_jets(&self, block: &Block, jets: &mut JetBlock) {
        for (j, i, at) in block.places() {
            jets.set(j, i, self.jet(at));
        }
    }

    /// The jet in space at grid coordinates; heights lie in space as ground axes and height, from the north-west node,
    /// a row at its own spacing where meridians converge.
    fn space_jet(&self, at: DVec2) -> SurfaceJet {
        self.jet(at).in_space(at, self.axes(at.y))
    }

    /// The jets in space at the nodes of a row.
    fn row_space_jets(&self, row: usize) -> Vec<SurfaceJet> {
        let mut jets = Vec::with_capacity(self.cols());
        let (axes, mut room) = (self.axes(row as f64), JetBlock::default());
        for first in (0..self.cols()).step_by(BLOCK) {
            let cols = first..self.cols().min(first + BLOCK);
            let (count, at) = (cols.len(), DVec2::new(first as f64, row as f64));
            self.block_jets(&Block { cols, rows: row..row + 1, centres: false }, &mut room);
            room.add_row_in_space(0, count, at, axes, &mut jets);
        }
        jets
    }

    /// Area, curvature and extent, from the nodes that are not void.
    ///
    /// In space means go by the area of the surface, so that they do not depend on its parameters, and the extent is the
    /// diagonal of a rectangle as long as rows and columns of cells are on average. Heights are measured on their map: means
    /// go by its nodes, and the extent is the diagonal of the grid. A level plane has the same measures either way.
    fn measures(&self) -> Measures {
        measured(self, |_, _| true)
    }
}
