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

#![allow(clippy::needless_range_loop, reason = "lanes of several arrays go together")]

use glam::DVec2;
use multiversion::multiversion;
use rayon::prelude::*;

use super::field::{SIDE, TensorField, TensorTile, Tiling};
use super::source::{POINT_RADIUS, StartRegion};
use super::stencil::ring::RING;
use crate::linalg::Sym2;
use crate::linalg::lanes::{choose, greatest, lanes, least};

/// Radius of the region around a point where the cone is taken out, as a share of the grid's longer side: fixed in
/// metres, not in cells, or first order would keep its logarithm. In a prototype at n = 1001 .05, .1, .2, .4 gave a ratio of 400
/// a mean error of 5.2, 2.3, .7, .3 e-4 (after one correction) and are alike on curvature tensors, which vary.
const RADIUS: f64 = 0.2;

/// The cone is taken out as far as all ground is like that of its point: the eigenvalues of `M(s) D` lie between the
/// inverse of this and this, ...
const ALIKE: f32 = 1.3;
/// ... and farther out where they lie in this wider range and no shift is more than this share of a step. On another ground
/// altogether the cone says nothing of the distance, and on rough ones large shifts would bring values below their
/// neighbours' without end.
const SIMILAR: f32 = 4.0;
const MOST_SHIFT: f32 = 0.5;
/// With more corners no cones are taken out: each is looked at for each tile, and the fans of the many corners of a fine outline
/// are narrow.
const MOST_CONES: usize = 1000;

/// A point that geodesics fan out from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Cone {
    pub(crate) at: DVec2,
    /// Stored metric at the point.
    pub(crate) metric: Sym2,
    /// Directions of the sides of the start region that end here; the fan is what both leave free, see [`Self::holds`].
    pub(crate) sides: [DVec2; 2],
    /// Distance at the point, in stored units.
    travelled: f64,
    /// Number of the point: its images around a periodic grid have the same.
    number: usize,
    /// In cells from the point: how far the cone is taken out, and how far all ground is alike.
    pub(crate) radius: f64,
    pub(crate) alike: f64,
}

impl Cone {
    pub(crate) fn new(
        field: &TensorField,
        at: DVec2,
        sides: [DVec2; 2],
        travelled: f64,
    ) -> Option<Self> {
        let metric = field.metric_at(at)?;
        Some(Self { at, metric, sides, travelled, number: 0, radius: 0.0, alike: 0.0 })
    }

    /// Whether the cone is to be taken out at a node of unlike ground: where `M(s) D` has this trace and determinant,
    /// `D` this trace, and the largest shift this length.
    #[inline(always)]
    pub(crate) fn applies(trace: f32, det: f32, trace_of_d: f32, shift: f32) -> bool {
        // No step is shorter than 1/√λ with the larger eigenvalue λ of D, λ ≤ tr D.
        let small = shift * shift * trace_of_d <= MOST_SHIFT * MOST_SHIFT;
        small & Self::in_range(trace, det, SIMILAR)
    }

    /// How far all ground is like that of the point, in rows and columns, up to `most` cells.
    fn alike(&self, field: &TensorField, most: f64) -> f64 {
        let tiling = field.tiling;
        let gap = |tile: usize| self.gap(&tiling, tile).max_element();
        let mut tiles: Vec<usize> =
            tiling.tiles_around(self.at, most).filter(|&tile| gap(tile) <= most).collect();
        tiles.sort_by(|&a, &b| gap(a).total_cmp(&gap(b)));
        let mut nearest = most as f32 + 1.0;
        for tile in tiles {
            if gap(tile) >= f64::from(nearest) {
                break;
            }
            let from = tiling.first(tile) - self.at.round();
            let unlike = nearest_unlike(&field.tiles[tile], self.metric, from);
            nearest = least(nearest, unlike);
        }
        f64::from(nearest - 1.0).max(0.0)
    }

    /// Columns and rows between the point and the nearest node of a tile; 0 inside.
    fn gap(&self, tiling: &Tiling, tile: usize) -> DVec2 {
        let half = 0.5 * (SIDE - 1) as f64;
        ((self.at - tiling.first(tile) - half).abs() - half).max(DVec2::ZERO)
    }

    /// Whether both roots of `λ² − trace λ + det` lie between `1/most` and `most`.
    #[inline(always)]
    fn in_range(trace: f32, det: f32, most: f32) -> bool {
        (trace <= 2.0 * most)
            & (most * most - trace * most + det >= 0.0)
            & (trace * most >= 2.0)
            & (1.0 - trace * most + det * (most * most) >= 0.0)
    }

    /// How far in cells from the point a way of `length`, in stored units, can lead while all ground is like that of the point, a node on
    /// either side included.
    fn extent(&self, length: f64) -> f64 {
        let d = self.metric.inverse();
        let fastest = 0.5 * (d.xx + d.yy) + (0.5 * (d.xx - d.yy)).hypot(d.xy);
        length * (f64::from(ALIKE) * fastest).sqrt() + 2.0
    }

    /// Its images around a periodic grid whose discs touch the nodes; of more than three in a direction, the middle ones.
    fn images(self, tiling: &Tiling) -> impl Iterator<Item = Self> {
        let period = DVec2::new(tiling.cols as f64, tiling.rows as f64);
        let reach = period.min(DVec2::splat(self.radius));
        let turns = tiling.turns(self.at, -reach, period - 1.0 + reach);
        turns.map(move |turn| Self { at: self.at + turn, ..self })
    }

    /// Whether both are the same function `g0`.
    fn is(&self, other: &Self) -> bool {
        let near = self.at.abs_diff_eq(other.at, 1e-9);
        near && self.metric == other.metric && self.sides == other.sides
    }

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

/// The cones of the start regions, and which of them each tile lies in.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Cones {
    tiling: Tiling,
    cones: Vec<Cone>,
    /// Index of the tile's cone plus one; 0 if it lies in none. Empty if the cones are those of one point: which is the tile's is
    /// then quickly told.
    of_tile: Vec<u32>,
}

impl Cones {
    pub(crate) fn new(field: &TensorField, starts: &[StartRegion]) -> Self {
        Self::within(field, starts, f64::INFINITY)
    }

    /// Cones that are the same up to a `distance` (stored units); only ground that can be reached so far is looked at.
    pub(crate) fn within(field: &TensorField, starts: &[StartRegion], distance: f64) -> Self {
        let of_start = |start: &StartRegion| {
            let travelled = start.value * field.root_scale();
            let corners = start.corners();
            corners
                .filter_map(|(at, sides)| Cone::new(field, at, sides, travelled))
                .collect::<Vec<_>>()
        };
        let tiling = field.tiling;
        // Nothing fans out from a corner outside the grid: no way leads there.
        let inside = |cone: &Cone| tiling.contains(cone.at);
        let mut cones: Vec<Cone> = starts.iter().flat_map(of_start).filter(inside).collect();
        let radius = RADIUS * (tiling.cols.max(tiling.rows) - 1) as f64;
        if cones.is_empty() || cones.len() > MOST_CONES || radius < POINT_RADIUS {
            return Self::default();
        }
        // No more nodes are looked at than there are, however many cones.
        let share = (tiling.cols * tiling.rows) as f64 / cones.len() as f64;
        for (number, cone) in cones.iter_mut().enumerate() {
            cone.number = number;
            cone.radius = radius;
            let most = radius.min(0.5 * share.sqrt()).min(cone.extent(distance));
            let alike = cone.images(&tiling).map(|image| image.alike(field, most));
            cone.alike = alike.fold(most, f64::min);
        }
        let tiles = if cones.len() > 1 { tiling.tiles() } else { 0 };
        let cones: Vec<Cone> = cones.into_iter().flat_map(|cone| cone.images(&tiling)).collect();
        let of_tile =
            (0..tiles).into_par_iter().map(|tile| nearest(&cones, &tiling, tile)).collect();
        Self { tiling, cones, of_tile }
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.cones.is_empty()
    }

    /// The cone that a tile lies in.
    pub(crate) fn of_tile(&self, tile: usize) -> Option<&Cone> {
        if self.is_empty() {
            return None;
        }
        let found = self.of_tile.get(tile).copied();
        let index = found.unwrap_or_else(|| nearest(&self.cones, &self.tiling, tile));
        self.cones.get(index.checked_sub(1)? as usize)
    }

    /// The cone that is taken out at all the given nodes, seen from there.
    pub(crate) fn around(
        &self,
        field: &TensorField,
        nodes: impl IntoIterator<Item = (isize, isize)>,
    ) -> Option<Cone> {
        let mut found: Option<Cone> = None;
        for (col, row) in nodes {
            let (c, r) = field.tiling.node(col, row)?;
            let (&cone, ..) = self.at_node(field, c, r)?;
            let turn = DVec2::new((col - c as isize) as f64, (row - r as isize) as f64);
            let cone = Cone { at: cone.at + turn, ..cone };
            if found.is_some_and(|found| !found.is(&cone)) {
                return None;
            }
            found = Some(cone);
        }
        found
    }

    /// What to add to the values on the ring of a node.
    pub(crate) fn shifts(&self, field: &TensorField, col: usize, row: usize) -> [f64; 8] {
        self.at_node(field, col, row).map_or([0.0; 8], |(_, _, shifts)| shifts)
    }

    /// The cone that is taken out at a node, the way to the node from its point, and the shifts.
    pub(crate) fn at_node(
        &self,
        field: &TensorField,
        col: usize,
        row: usize,
    ) -> Option<(&Cone, DVec2, [f64; 8])> {
        let cone = self.of_tile(field.tiling.place(col, row).0)?;
        let v = DVec2::new(col as f64, row as f64) - cone.at;
        let shifts = RING.map(|(i, j)| {
            let by = DVec2::new(i.into(), j.into());
            if cone.holds(v + by) { cone.shift(v, by) } else { 0.0 }
        });
        let (m, d) = (cone.metric, field.metric(col, row)?.inverse());
        let trace = m.xx * d.xx + 2.0 * m.xy * d.xy + m.yy * d.yy;
        let largest = -shifts.into_iter().fold(0.0, f64::min);
        let applies = v.length_squared() <= cone.alike * cone.alike
            || Cone::applies(
                trace as f32,
                (m.det() * d.det()) as f32,
                (d.xx + d.yy) as f32,
                largest as f32,
            );
        (cone.holds(v) && v.length_squared() <= cone.radius * cone.radius && applies)
            .then_some((cone, v, shifts))
    }
}

/// The cone that brings the least distance to all of a tile under its own metric, if it reaches into the tile, as for
/// [`Cones::of_tile`]. Where another that is not its image brings less somewhere, none may be taken out: its front would meet
/// the shifts of a foreign cone, each of which lowers it a little.
fn nearest(cones: &[Cone], tiling: &Tiling, tile: usize) -> u32 {
    let [cols, rows] = tiling.size(tile);
    let half = 0.5 * (DVec2::new(cols as f64, rows as f64) - 1.0);
    let middle = tiling.first(tile) + half;
    let nearest_to = |at: DVec2| {
        let length = |cone: &Cone| cone.travelled + cone.value(at - cone.at);
        let lengths = cones.iter().map(length).enumerate();
        lengths.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(index, _)| index)
    };
    let index = nearest_to(middle);
    let corners = [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)];
    let reaches = cones[index].gap(tiling, tile).length() <= cones[index].radius;
    let alone = || {
        // The places of one cone are convex where all are alike.
        let corner = |(x, y)| middle + DVec2::new(x, y) * (half + 1.0);
        let same = |other: usize| cones[other].number == cones[index].number;
        cones.iter().all(|cone| cone.number == 0)
            || corners.into_iter().all(|at| same(nearest_to(corner(at))))
    };
    if reaches && alone() { index as u32 + 1 } else { 0 }
}

/// How far the nearest open node of a tile is from the point, in rows or columns, whose ground is not like `metric`; the first
/// node lies at `from`.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl",
    "x86_64+avx2",
    "x86_64+sse4.1",
))]
fn nearest_unlike(tile: &TensorTile, metric: Sym2, from: DVec2) -> f32 {
    let (mxx, mxy, myy) = (metric.xx as f32, metric.xy as f32, metric.yy as f32);
    let mdet = metric.det() as f32;
    let mut nearest = [f32::INFINITY; SIDE];
    for row in 0..SIDE {
        let y = (from.y as f32 + row as f32).abs();
        let (xx, xy) = (lanes(&tile.xx, row * SIDE), lanes(&tile.xy, row * SIDE));
        let det = lanes(&tile.det, row * SIDE);
        for i in 0..SIDE {
            let yy = (det[i] + xy[i] * xy[i]) / xx[i];
            let trace = mxx * xx[i] + 2.0 * mxy * xy[i] + myy * yy;
            let like = (det[i] == 0.0) | Cone::in_range(trace, det[i] * mdet, ALIKE);
            let distance = greatest((from.x as f32 + i as f32).abs(), y);
            nearest[i] = least(nearest[i], choose(like, f32::INFINITY, distance));
        }
    }
    let mut least_of_all = f32::INFINITY;
    for distance in nearest {
        least_of_all = least(least_of_all, distance);
    }
    least_of_all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shift_continues_the_cone_as_its_tangent_plane() {
        let cone = Cone {
            at: DVec2::ZERO,
            metric: Sym2::new(3.0, -1.0, 0.7),
            sides: [DVec2::ZERO; 2],
            radius: 0.0,
            alike: 0.0,
            travelled: 0.0,
            number: 0,
        };
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
