//! The singularity of a point source, taken out of the equation.
//!
//! Around a point of the start the distance is a cone, whose curvature `1/r` makes the error of any scheme on the nodes
//! `h log h`. There `g = g0 + w` with `g0(x) = ‖x − s‖` under the metric `M(s)` frozen at the point, and `w` is smooth. Only
//! `w` is interpolated: a neighbour `y` of `x` is read as
//!
//! ```text
//!   g(y) + c(x, y),     c(x, y) = g0(x) − g0(y) + ∇g0(x)·(y − x),
//! ```
//!
//! that is, with `g0` continued as the plane that touches it at `x`. The update itself stays the same, so the unknown is
//! still `g`, and first order is clean. (Additive factoring: Luo and Qian, J. Comput. Phys. 230 (2011), 5.)

use glam::DVec2;

use super::field::{SIDE, TensorField, Tiling};
use super::source::StartRegion;
use super::update::RING;
use crate::Sym2;

/// Radius of the region around a point where the cone is taken out, as a share of the grid's longer side: fixed in
/// metres, not in cells, or first order would keep its logarithm. At n = 1001 .05, .1, .2, .4 give a ratio of 400
/// a mean error of 5.2, 2.3, .7, .3 e-4 (after one correction) and are alike on curvature tensors, which vary.
const RADIUS: f64 = 0.2;

/// A point that geodesics fan out from.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cone {
    pub(crate) at: DVec2,
    /// Stored metric at the point.
    pub(crate) metric: Sym2,
    /// Directions of the sides of the start region that end here; the fan is what both leave free, see [`Self::holds`].
    pub(crate) sides: [DVec2; 2],
}

impl Cone {
    /// Whether `v` from the point leads into the fan: the point is then the nearest of the start region.
    pub(crate) fn holds(&self, v: DVec2) -> bool {
        let mv = self.metric.apply(v);
        self.sides.iter().all(|side| mv.dot(*side) <= 0.0)
    }

    /// `g0` at `v` from the point.
    pub(crate) fn value(&self, v: DVec2) -> f64 {
        self.metric.norm(v)
    }

    /// `c(x, x + by)` for `x` at `v` from the point, without cancellation: with `A = vᵀM by`, `B = byᵀM by`,
    /// `g = g0(x)`, `G = g0(x + by)` it is `(A (2A + B)/(G + g) − g B) / (g (G + g))`.
    pub(crate) fn shift(&self, v: DVec2, by: DVec2) -> f64 {
        let (a, b, g) = (self.metric.apply(v).dot(by), self.metric.form(by), self.metric.norm(v));
        let sum = g + (g * g + 2.0 * a + b).max(0.0).sqrt();
        if g > 0.0 { (a * (2.0 * a + b) / sum - g * b) / (g * sum) } else { 0.0 }
    }
}

/// The cones of a start region, and which of them each tile lies in.
#[derive(Clone, Debug, Default)]
pub(crate) struct Cones {
    cones: Vec<Cone>,
    /// Index of the tile's cone plus one; 0 if it lies in none. Empty if there are no cones.
    of_tile: Vec<u32>,
}

impl Cones {
    pub(crate) fn new(field: &TensorField, start: &StartRegion) -> Self {
        let cones: Vec<Cone> = start
            .corners()
            .filter_map(|(at, sides)| Some(Cone { at, metric: field.metric_at(at)?, sides }))
            .collect();
        if cones.is_empty() {
            return Self::default();
        }
        let tiling = field.tiling;
        let radius = RADIUS * (tiling.cols.max(tiling.rows) - 1) as f64;
        let of_tile =
            (0..tiling.tiles()).map(|tile| nearest(&cones, &tiling, tile, radius)).collect();
        Self { cones, of_tile }
    }

    /// The cone that a tile lies in.
    pub(crate) fn of_tile(&self, tile: usize) -> Option<&Cone> {
        let index = self.of_tile.get(tile)?.checked_sub(1)?;
        self.cones.get(index as usize)
    }

    /// What to add to the values on the ring of a node.
    pub(crate) fn shifts(&self, tiling: &Tiling, col: usize, row: usize) -> [f64; 8] {
        let v = |cone: &Cone| DVec2::new(col as f64, row as f64) - cone.at;
        match self.of_tile(tiling.place(col, row).0).filter(|cone| cone.holds(v(cone))) {
            Some(cone) => RING.map(|(i, j)| cone.shift(v(cone), DVec2::new(i.into(), j.into()))),
            None => [0.0; 8],
        }
    }
}

/// The cone nearest to the middle of a tile under its own metric, if within `radius` cells.
fn nearest(cones: &[Cone], tiling: &Tiling, tile: usize, radius: f64) -> u32 {
    let corner = DVec2::new((tile % tiling.across) as f64, (tile / tiling.across) as f64);
    let middle = corner * SIDE as f64 + 0.5 * (SIDE - 1) as f64;
    let near = cones.iter().enumerate().filter(|(_, cone)| cone.at.distance(middle) <= radius);
    let nearest =
        near.min_by(|a, b| a.1.value(middle - a.1.at).total_cmp(&b.1.value(middle - b.1.at)));
    nearest.map_or(0, |(index, _)| index as u32 + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shift_continues_the_cone_as_its_tangent_plane() {
        let cone =
            Cone { at: DVec2::ZERO, metric: Sym2::new(3.0, -1.0, 0.7), sides: [DVec2::ZERO; 2] };
        for v in [DVec2::new(1.0, 2.0), DVec2::new(-7.0, 3.5), DVec2::new(0.3, -2.0)] {
            for by in RING.map(|(i, j)| DVec2::new(i.into(), j.into())) {
                let slope = cone.metric.apply(v) / cone.value(v);
                let plain = cone.value(v) - cone.value(v + by) + slope.dot(by);
                assert!((cone.shift(v, by) - plain).abs() < 1e-12);
            }
        }
        assert_eq!(cone.shift(DVec2::ZERO, DVec2::X), 0.0);
    }
}
