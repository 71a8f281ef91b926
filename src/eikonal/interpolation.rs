//! Distances, gradients and directions between the nodes.

use glam::DVec2;

use super::distance_map::DistanceMap;
use super::predecessor::best_foot;
use super::source::{self, sees};
use super::stencil::factoring::Factor;
use crate::linalg::bilinear::{CORNERS, corner_weights};

impl DistanceMap {
    /// Distance at grid coordinates; `None` outside the grid and where not reached.
    ///
    /// Near the start the length of the straight way; elsewhere cubic between the nodes where all around are
    /// reached, bilinear in a cell with four reached corners, and the solver's own update beside walls.
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

    /// Gradient of the distance at grid coordinates, in ground axes (x east, y north), per metre; `None` where
    /// [`at`](Self::at) is. By differences over half a cell, one-sided beside walls and borders.
    #[must_use]
    pub fn gradient_at(&self, at: DVec2) -> Option<DVec2> {
        const REACH: f64 = 0.25;
        let here = self.at(at)?;
        let slope = |by: DVec2| {
            let (before, after) = (self.at(at - by), self.at(at + by));
            let pieces = u8::from(before.is_some()) + u8::from(after.is_some());
            let rise = after.unwrap_or(here) - before.unwrap_or(here);
            (pieces > 0).then(|| rise / (REACH * f64::from(pieces)))
        };
        let (col, row) = (slope(REACH * DVec2::X)?, slope(REACH * DVec2::Y)?);
        let spacing = self.field.spacing(at.y);
        Some(DVec2::new(col, -row) / spacing)
    }

    /// Unit vector of travel away from the start at grid coordinates, in ground axes (x east, y north), along
    /// `D ∇g`; `None` where [`gradient_at`](Self::gradient_at) is and on the start.
    #[must_use]
    pub fn direction_at(&self, at: DVec2) -> Option<DVec2> {
        let spacing = self.field.spacing(at.y);
        let gradient = self.gradient_at(at)? * spacing;
        let speed = self.field.metric_at(at)?.inverse();
        let step = speed.apply(DVec2::new(gradient.x, -gradient.y));
        (DVec2::new(step.x, -step.y) * spacing).try_normalize()
    }

    /// Unit vector of travel away from the start at a node, in ground axes (x east, y north); `None` where not
    /// reached and on the start.
    #[must_use]
    pub fn direction(&self, col: usize, row: usize) -> Option<DVec2> {
        let spacing = self.field.spacing(row as f64);
        let foot = self.foot(col as isize, row as isize)?;
        (DVec2::new(-foot.x, foot.y) * spacing).try_normalize()
    }

    /// Step in grid coordinates from a node, as in [`reached`](Self::reached), to the point of its ring that its value came
    /// from.
    pub(crate) fn foot(&self, col: isize, row: isize) -> Option<DVec2> {
        let value = self.reached(col, row)?;
        let (col, row) = self.field.tiling.node(col, row)?;
        let node = DVec2::new(col as f64, row as f64);
        if let Some(foot) = self.straight_home(node, value) {
            return Some(foot - node);
        }
        self.best_foot(col, row).map(|(_, foot)| foot)
    }

    pub(super) fn best_foot(&self, col: usize, row: usize) -> Option<(f64, DVec2)> {
        best_foot(&self.field, &self.factors, |c, r| self.value(c, r), col, row)
    }

    /// The point of the start region to go to straight from `at`, if that is the shortest way.
    pub(crate) fn straight_home(&self, at: DVec2, value: f64) -> Option<DVec2> {
        let (foot, length) = self.straight(at)?;
        (length <= SLACK * value).then_some(foot)
    }

    /// The nearest point of the start in sight and the length of the way to it.
    fn straight(&self, at: DVec2) -> Option<(DVec2, f64)> {
        source::foot_on_any(&self.starts, &self.field, at, SEED_SIGHT)
    }

    /// Cubic convolution (Keys 1981) of what is left without the cone, where all sixteen nodes are reached; not
    /// where it leaves what the corners of the cell span, at a kink.
    fn cubic(&self, at: DVec2) -> Option<f64> {
        let (col, row) = (at.x.floor(), at.y.floor());
        let nodes = || (0..16).map(|k| (k % 4, k / 4));
        let place =
            |i: usize, j: usize| (col as isize + i as isize - 1, row as isize + j as isize - 1);
        let mut w = [[0.0; 4]; 4];
        for (i, j) in nodes() {
            let (c, r) = place(i, j);
            w[j][i] = self.reached(c, r)?;
        }
        let cone = self.factors.around(&self.field, nodes().map(|(i, j)| place(i, j)));
        let g0 = |at: DVec2| cone.map_or(0.0, |cone| cone.value(at - cone.at));
        for (i, j) in nodes() {
            let (c, r) = place(i, j);
            w[j][i] -= g0(DVec2::new(c as f64, r as f64));
        }
        let (u, v) = (keys(at.x - col), keys(at.y - row));
        let value: f64 = nodes().map(|(i, j)| u[i] * v[j] * w[j][i]).sum();
        let corners = [w[1][1], w[1][2], w[2][1], w[2][2]];
        let (least, most) = corners
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), &w| (a.min(w), b.max(w)));
        let margin = 0.25 * (most - least);
        ((least - margin..=most + margin).contains(&value)).then(|| (value + g0(at)).max(0.0))
    }

    /// The point of the start that the cone around `at` comes from, if nothing is in the way.
    pub(crate) fn centre_in_sight(&self, at: DVec2) -> Option<DVec2> {
        let cone = self.cone_around(at)?;
        sees(&self.field, at, cone.at).then_some(cone.at)
    }

    /// How much the cone around `at` lowers the value read at `to`, see [`super::stencil::factoring`].
    pub(super) fn shift(&self, at: DVec2, to: DVec2) -> f64 {
        self.cone_around(at).map_or(0.0, |cone| cone.term(at - cone.at, to - at))
    }

    /// The cone at the node nearest to `at`.
    fn cone_around(&self, at: DVec2) -> Option<Factor> {
        self.factors.around(&self.field, [(at.x.round() as isize, at.y.round() as isize)])
    }

    pub(crate) fn stored_at(&self, at: DVec2) -> Option<f64> {
        if !self.field.tiling.contains(at) {
            return None;
        }
        let straight = self.straight(at).map(|(_, length)| length).into_iter();
        straight.chain(self.interpolated(at)).min_by(f64::total_cmp).map(|g| g.max(0.0))
    }

    /// Bilinear where all corners of the cell are reached, else by way of the best corner in sight.
    fn interpolated(&self, at: DVec2) -> Option<f64> {
        let (col, row) = (at.x.floor() as isize, at.y.floor() as isize);
        let weights = corner_weights(at - DVec2::new(col as f64, row as f64));
        let used = || {
            let corners = CORNERS.into_iter().zip(weights);
            corners.filter(|corner| corner.1 > 0.0).map(|((i, j), w)| (col + i, row + j, w))
        };
        let linear: Option<f64> = used().map(|(c, r, w)| self.reached(c, r).map(|g| w * g)).sum();
        if let Some(linear) = linear {
            // Only what is smooth is interpolated.
            let bent =
                self.factors.around(&self.field, used().map(|(c, r, _)| (c, r))).map(|cone| {
                    let g0 = |at: DVec2| cone.value(at - cone.at);
                    let nodes = used().map(|(c, r, w)| w * g0(DVec2::new(c as f64, r as f64)));
                    g0(at) - nodes.sum::<f64>()
                });
            return Some((linear + bent.unwrap_or(0.0)).max(0.0));
        }
        let metric = self.field.metric_at(at)?;
        used()
            .filter_map(|(c, r, _)| Some((DVec2::new(c as f64, r as f64), self.reached(c, r)?)))
            .filter(|&(node, _)| sees(&self.field, at, node))
            .map(|(node, value)| value + metric.norm(node - at))
            .min_by(f64::total_cmp)
    }
}

/// The values of nodes are rounded to `f32`.
pub(super) const SLACK: f64 = 1.0 + 1e-6;

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

/// Within this many cells of the start the straight way to it is considered.
const SEED_SIGHT: f64 = 4.0;
