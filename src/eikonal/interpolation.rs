//! Distances between the nodes.

use glam::DVec2;

use super::distance_map::DistanceMap;
use super::source::{self, has_line_of_sight};
use super::stencil::factoring::Factor;
use crate::linalg::bilinear::{CORNERS, corner_weights};

/// Within this many cells of the start the straight path to it is considered.
const SEED_SIGHT: f64 = 4.0;
/// The values of nodes are rounded to `f32`.
pub(super) const ROUNDED_UP: f64 = 1.0 + 1e-6;

impl DistanceMap {
    /// Distance at grid coordinates; `None` outside the grid and where not reached.
    ///
    /// Near the start the length of the straight path; elsewhere cubic interpolation where all 16 nodes around are reached,
    /// bilinear in a cell with four reached corners, and next to walls the best straight step to a corner in sight.
    #[must_use]
    pub fn at(&self, at: DVec2) -> Option<f64> {
        if !self.field.tiling.contains(at) {
            return None;
        }
        let value = match (self.straight(at), self.cubic(at)) {
            (Some((_, length)), Some(value)) => length.min(value),
            (None, Some(value)) => value,
            _ => self.stored_at(at)?,
        };
        Some(value / self.field.root_scale())
    }

    /// The foot of `at` on the start regions, if the straight path to it is the shortest.
    pub(crate) fn straight_foot(&self, at: DVec2, value: f64) -> Option<DVec2> {
        let (foot, length) = self.straight(at)?;
        (length <= ROUNDED_UP * value).then_some(foot)
    }

    /// The nearest point of the start in sight and the length of the path to it.
    fn straight(&self, at: DVec2) -> Option<(DVec2, f64)> {
        source::foot_on_any(&self.starts, &self.field, at, SEED_SIGHT)
    }

    /// Cubic convolution (Keys 1981) of `w = g − g0`, the value without the factor. `None` unless all sixteen nodes are reached, and
    /// where it lies far outside the range of the corners of the cell, as at a kink.
    fn cubic(&self, at: DVec2) -> Option<f64> {
        let cell = at.floor();
        let nodes = || (0..16).map(|k| (k % 4, k / 4));
        let node = |i: usize, j: usize| {
            (cell.x as isize + i as isize - 1, cell.y as isize + j as isize - 1)
        };
        let mut w = [[0.0; 4]; 4];
        for (i, j) in nodes() {
            let (col, row) = node(i, j);
            w[j][i] = self.reached(col, row)?;
        }
        let factor = self.factors.around(&self.field, nodes().map(|(i, j)| node(i, j)));
        let g0 = |at: DVec2| factor.map_or(0.0, |factor| factor.value(at - factor.at));
        for (i, j) in nodes() {
            w[j][i] -= g0(point(node(i, j)));
        }
        let (u, v) = (keys(at.x - cell.x), keys(at.y - cell.y));
        let value: f64 = nodes().map(|(i, j)| u[i] * v[j] * w[j][i]).sum();
        is_near_span(value, [w[1][1], w[1][2], w[2][1], w[2][2]]).then(|| (value + g0(at)).max(0.0))
    }

    /// The point of the start to which the factor around `at` belongs, if it is in sight.
    pub(crate) fn factor_point_in_sight(&self, at: DVec2) -> Option<DVec2> {
        let factor = self.factor_around(at)?;
        has_line_of_sight(&self.field, at, factor.at).then_some(factor.at)
    }

    /// What the factor around `at` adds to the value read at `to`, see [`super::stencil::factoring`].
    pub(super) fn factoring_term(&self, at: DVec2, to: DVec2) -> f64 {
        self.factor_around(at).map_or(0.0, |factor| factor.term(at - factor.at, to - at))
    }

    /// The factor at the node nearest to `at`.
    fn factor_around(&self, at: DVec2) -> Option<Factor> {
        self.factors.around(&self.field, [(at.x.round() as isize, at.y.round() as isize)])
    }

    /// [`at`](Self::at) in stored units and without the cubic: what routes descend on.
    pub(crate) fn stored_at(&self, at: DVec2) -> Option<f64> {
        if !self.field.tiling.contains(at) {
            return None;
        }
        let straight = self.straight(at).map(|(_, length)| length).into_iter();
        straight.chain(self.interpolated(at)).min_by(f64::total_cmp).map(|g| g.max(0.0))
    }

    /// Bilinear where all corners of the cell are reached, else the value through the best corner in sight.
    fn interpolated(&self, at: DVec2) -> Option<f64> {
        let cell = at.floor();
        let weights = corner_weights(at - cell);
        let corners = CORNERS.into_iter().zip(weights).filter(|&(_, weight)| weight > 0.0);
        let corners =
            corners.map(|((i, j), weight)| ((cell.x as isize + i, cell.y as isize + j), weight));
        self.bilinear(at, corners.clone()).or_else(|| {
            let metric = self.field.metric_at(at)?;
            corners
                .filter_map(|(node, _)| Some((point(node), self.reached(node.0, node.1)?)))
                .filter(|&(node, _)| has_line_of_sight(&self.field, at, node))
                .map(|(node, value)| value + metric.norm(node - at))
                .min_by(f64::total_cmp)
        })
    }

    /// Bilinear between corners, each with its weight, of `w = g − g0`, the value without the factor. `None` if one is not reached.
    fn bilinear(
        &self,
        at: DVec2,
        corners: impl Iterator<Item = ((isize, isize), f64)> + Clone,
    ) -> Option<f64> {
        let values = corners.clone().map(|((c, r), weight)| self.reached(c, r).map(|g| weight * g));
        let linear: Option<f64> = values.sum();
        let factor = self.factors.around(&self.field, corners.clone().map(|(node, _)| node));
        let g0_less_linear = factor.map_or(0.0, |factor| {
            let g0 = |at: DVec2| factor.value(at - factor.at);
            g0(at) - corners.map(|(node, weight)| weight * g0(point(node))).sum::<f64>()
        });
        Some((linear? + g0_less_linear).max(0.0))
    }
}

/// Coordinates of a node.
fn point((col, row): (isize, isize)) -> DVec2 {
    DVec2::new(col as f64, row as f64)
}

/// Whether a value lies between the least and the greatest of the corners, or at most a quarter of their span outside.
fn is_near_span(value: f64, corners: [f64; 4]) -> bool {
    let least = corners.into_iter().fold(f64::INFINITY, f64::min);
    let most = corners.into_iter().fold(f64::NEG_INFINITY, f64::max);
    let margin = 0.25 * (most - least);
    (least - margin..=most + margin).contains(&value)
}

/// Weights of the four nodes around a point `t` beyond the second, exact for quadratics.
fn keys(t: f64) -> [f64; 4] {
    let (t2, t3) = (t * t, t * t * t);
    [
        0.5 * (-t3 + 2.0 * t2 - t),
        0.5 * (3.0 * t3 - 5.0 * t2 + 2.0),
        0.5 * (-3.0 * t3 + 4.0 * t2 + t),
        0.5 * (t3 - t2),
    ]
}
