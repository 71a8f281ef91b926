//! Source factoring: the singularity of a point of the start, taken out of the equation.
//!
//! Around such a point the distance is a cone, whose curvature `1/r` makes the error of any scheme on the nodes
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

use glam::{DVec2, Vec2Swizzles as _};

use super::ring::RING;
use crate::linalg::Sym2;
use crate::linalg::lanes::{LANES, Lanes, choose, greatest};

/// `g0` is taken out as far as all ground is like that of its point: the eigenvalues of `M(s) D` lie between the
/// inverse of this and this, ...
pub(crate) const ALIKE: f32 = 1.3;
/// ... and farther out where they lie in this wider range and no term is more than this share of a step. On another ground
/// altogether `g0` says nothing of the distance, and on rough ones large terms would bring values below their
/// neighbours' without end.
const SIMILAR: f32 = 4.0;
const MOST_TERM: f32 = 0.5;

/// `g0` of a point that geodesics fan out from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Factor {
    pub(crate) at: DVec2,
    /// Stored metric at the point.
    pub(crate) metric: Sym2,
    /// Directions of the sides of the start region that end here; the fan is what both leave free, see [`Self::holds`].
    pub(crate) sides: [DVec2; 2],
    /// Distance at the point, in stored units.
    pub(crate) travelled: f64,
    /// Number of the point: its images around a periodic grid have the same.
    pub(crate) number: usize,
    /// In cells from the point: how far `g0` is taken out, and how far all ground is alike.
    pub(crate) radius: f64,
    pub(crate) alike: f64,
}

impl Factor {
    /// One that is taken out nowhere yet.
    pub(crate) fn new(at: DVec2, metric: Sym2, sides: [DVec2; 2], travelled: f64) -> Self {
        Self { at, metric, sides, travelled, number: 0, radius: 0.0, alike: 0.0 }
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

    /// The factoring term `c(x, x + by)` for `x` at `v` from the point, without cancellation: with `A = vᵀM by`, `B = byᵀM by`,
    /// `g = g0(x)`, `G = g0(x + by)` it is `(A (2A + B)/(G + g) − g B) / (g (G + g))`.
    pub(crate) fn term(&self, v: DVec2, by: DVec2) -> f64 {
        let (a, b, g) = (self.metric.apply(v).dot(by), self.metric.form(by), self.metric.norm(v));
        let sum = g + (g * g + 2.0 * a + b).max(0.0).sqrt();
        if g > 0.0 { (a * (2.0 * a + b) / sum - g * b) / (g * sum) } else { 0.0 }
    }

    /// Whether both are the same function `g0`.
    pub(crate) fn is(&self, other: &Self) -> bool {
        let near = self.at.abs_diff_eq(other.at, 1e-9);
        near && self.metric == other.metric && self.sides == other.sides
    }

    /// The factoring terms at a node, given its `D` and the vector to it from the point; `None` where `g0` is not taken out.
    pub(crate) fn terms(&self, v: DVec2, d: Sym2) -> Option<[f64; 8]> {
        let terms = RING.map(|(i, j)| {
            let by = DVec2::new(i.into(), j.into());
            if self.holds(v + by) { self.term(v, by) } else { 0.0 }
        });
        let m = self.metric;
        let trace = m.xx * d.xx + 2.0 * m.xy * d.xy + m.yy * d.yy;
        let largest = -terms.into_iter().fold(0.0, f64::min);
        let applies = v.length_squared() <= self.alike * self.alike
            || is_similar(
                trace as f32,
                (m.det() * d.det()) as f32,
                (d.xx + d.yy) as f32,
                largest as f32,
            );
        let is_near = v.length_squared() <= self.radius * self.radius;
        (self.holds(v) && is_near && applies).then_some(terms)
    }

    /// The terms at a line of nodes along x, given the vector to the first from the point and `D` as xx, xy and the determinant: 0 where
    /// `g0` is not taken out. Also by how much each lowers a neighbour at most.
    #[inline(always)]
    pub(crate) fn terms_of_line(
        &self,
        from: DVec2,
        [dxx, dxy, ddet]: &[Lanes; 3],
        terms: &mut [Lanes; 8],
    ) -> Lanes {
        let [p, q] = self.sides.map(|side| self.metric.apply(side));
        let (px, py, qx, qy) = (p.x as f32, p.y as f32, q.x as f32, q.y as f32);
        let m = self.metric;
        let (xx, xy, yy, det) = (m.xx as f32, m.xy as f32, m.yy as f32, m.det() as f32);
        let radius2 = (self.radius * self.radius) as f32;
        let alike2 = (self.alike * self.alike) as f32;
        let y = from.y as f32;
        let mut largest = [0f32; LANES];
        for i in 0..LANES {
            // Rounded once, so that rows and columns agree on which nodes it reaches.
            let x = (from.x + i as f64) as f32;
            let r2 = x * x + y * y;
            let (mx, my) = (xx * x + xy * y, xy * x + yy * y);
            let g2 = greatest(mx * x + my * y, 0.0);
            let g = g2.sqrt();
            let share = choose(g > 0.0, 1.0 / g, 0.0);
            for k in 0..8 {
                let (dx, dy) = (RING[k].0 as f32, RING[k].1 as f32);
                let a = mx * dx + my * dy;
                let b = xx * (dx * dx) + 2.0 * xy * (dx * dy) + yy * (dy * dy);
                let sum = g + greatest(g2 + (2.0 * a + b), 0.0).sqrt();
                let isum = choose(sum > 0.0, 1.0 / sum, 0.0);
                let holds =
                    (px * (x + dx) + py * (y + dy) <= 0.0) & (qx * (x + dx) + qy * (y + dy) <= 0.0);
                terms[k][i] =
                    choose(holds, (a * (2.0 * a + b) * isum - g * b) * (isum * share), 0.0);
                largest[i] = greatest(largest[i], -terms[k][i]);
            }
            let dyy = (ddet[i] + dxy[i] * dxy[i]) / dxx[i];
            let trace = xx * dxx[i] + 2.0 * xy * dxy[i] + yy * dyy;
            let applies = (px * x + py * y <= 0.0)
                & (qx * x + qy * y <= 0.0)
                & (r2 <= radius2)
                & ((r2 <= alike2) | is_similar(trace, ddet[i] * det, dxx[i] + dyy, largest[i]));
            largest[i] = choose(applies, largest[i], 0.0);
            for k in 0..8 {
                terms[k][i] = choose(applies, terms[k][i], 0.0);
            }
        }
        largest
    }

    /// The same with x and y exchanged.
    #[inline(always)]
    pub(crate) fn transposed(&self) -> Self {
        let m = self.metric;
        Self {
            at: self.at.yx(),
            metric: Sym2::new(m.yy, m.xy, m.xx),
            sides: self.sides.map(|side| side.yx()),
            ..*self
        }
    }
}

/// Whether `g0` is to be taken out at a node of unlike ground: where `M(s) D` has this trace and determinant,
/// `D` this trace, and the largest term this size.
#[inline(always)]
fn is_similar(trace: f32, det: f32, trace_of_d: f32, term: f32) -> bool {
    // No step is shorter than 1/√λ with the larger eigenvalue λ of D, λ ≤ tr D.
    let small = term * term * trace_of_d <= MOST_TERM * MOST_TERM;
    small & are_roots_within(trace, det, SIMILAR)
}

/// Whether both roots of `λ² − trace λ + det` lie between `1/most` and `most`.
#[inline(always)]
pub(crate) fn are_roots_within(trace: f32, det: f32, most: f32) -> bool {
    (trace <= 2.0 * most)
        & (most * most - trace * most + det >= 0.0)
        & (trace * most >= 2.0)
        & (1.0 - trace * most + det * (most * most) >= 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_term_continues_the_cone_as_its_tangent_plane() {
        let metric = Sym2::new(3.0, -1.0, 0.7);
        let factor = Factor::new(DVec2::ZERO, metric, [DVec2::ZERO; 2], 0.0);
        for v in [DVec2::new(1.0, 2.0), DVec2::new(-7.0, 3.5), DVec2::new(0.3, -2.0)] {
            for by in RING.map(|(i, j)| DVec2::new(i.into(), j.into())) {
                let slope = factor.metric.apply(v) / factor.value(v);
                let plain = factor.value(v) - factor.value(v + by) + slope.dot(by);
                assert!((factor.term(v, by) - plain).abs() < 1e-12);
            }
        }
        assert_eq!(factor.term(DVec2::ZERO, DVec2::X), 0.0);
    }
}
