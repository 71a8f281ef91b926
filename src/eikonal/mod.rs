//! Distances: `√(∇gᵀ D ∇g) = 1`, `g = 0` on the start region.

use glam::DVec2;

use crate::{Control, GridFrame, MetricField, Result};

/// Where distance is zero, in grid coordinates.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StartRegion {
    /// Single points, on nodes or between them.
    pub points: Vec<DVec2>,
    /// Polylines.
    pub lines: Vec<Vec<DVec2>>,
    /// Areas as closed rings by the even-odd rule.
    pub areas: Vec<Vec<Vec<DVec2>>>,
}

/// Solves the eikonal equation.
#[derive(Clone, Debug)]
pub struct Solver {}

/// Distance from the start region at every node.
#[derive(Clone, Debug)]
pub struct DistanceMap {}

impl Solver {
    /// Distance from `start`; stops early once every point of `goals` is settled (never, if there are none).
    ///
    /// # Errors
    /// No open node at the start; cancelled.
    pub fn solve(
        &self,
        metric: &MetricField<'_>,
        start: &StartRegion,
        goals: &[DVec2],
        control: &Control,
    ) -> Result<DistanceMap> {
        todo!()
    }
}

impl DistanceMap {
    /// The grid.
    #[must_use]
    pub fn frame(&self) -> &GridFrame {
        todo!()
    }

    /// Unit of the values: `m` or `AG units`.
    #[must_use]
    pub fn unit(&self) -> &str {
        todo!()
    }

    /// Distance at a node; infinite where not reached.
    #[must_use]
    pub fn at_node(&self, col: usize, row: usize) -> f64 {
        todo!()
    }

    /// Distances at all nodes, row-major, infinite where not reached.
    #[must_use]
    pub fn to_row_major(&self) -> Vec<f32> {
        todo!()
    }

    /// Distance at grid coordinates; `None` where not reached.
    #[must_use]
    pub fn at(&self, at: DVec2) -> Option<f64> {
        todo!()
    }

    /// Unit vector (ground axes) of travel from the start at a node; `None` where not reached.
    #[must_use]
    pub fn direction(&self, col: usize, row: usize) -> Option<DVec2> {
        todo!()
    }
}
