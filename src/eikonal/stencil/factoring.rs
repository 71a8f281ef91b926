//! Source factoring: the singularity of the distance at a point of the start is removed analytically.
//!
//! Around such a point `s` the distance has the shape of a cone, whose curvature `1/r` makes the error of a first-order scheme
//! `h log h`. There `g = g0 + w`: the factor `g0(x) = ‖x − s‖` under the metric `M(s)` frozen at the point, and `w`, which is smooth. Only
//! `w` is interpolated: the value at a neighbour `y` of `x` is read as
//!
//! ```text
//!   g(y) + c(x, y),     c(x, y) = g0(x) − g0(y) + ∇g0(x)·(y − x),
//! ```
//!
//! where `c` is the *factoring term*: `g0` is replaced by its tangent plane at `x`. The update itself stays the same, the unknown is
//! still `g`, and the order is 1 without the logarithm. (Additive factoring: Luo and Qian, J. Comput. Phys. 230 (2011), 5.)

#![allow(clippy::needless_range_loop, reason = "lanes of several arrays go together")]

use glam::{DVec2, Vec2Swizzles as _};

use super::ring::RING;
use crate::linalg::Sym2;
use crate::linalg::lanes::{LANES, Lanes, choose, greatest};

/// `g0` applies up to the radius within which the metric at all nodes is nearly that of its point: the eigenvalues of `M(s) D` lie
/// between the inverse of this and this, ...
pub(crate) const UNIFORM_RATIO: f32 = 1.3;
/// ... and farther out at nodes where they lie in this wider range and no term exceeds this share of a step. Under an altogether
/// different metric `g0` says nothing of the distance, and where metrics vary much, large terms would lower values below those of
/// their neighbours again and again.
const SIMILAR_RATIO: f32 = 4.0;
const MAX_TERM: f32 = 0.5;

/// The factor `g0` of a point that geodesics fan out from: a start point, or a corner of a start region.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Factor {
    pub(crate) at: DVec2,
    /// Stored metric at the point.
    pub(crate) metric: Sym2,
    /// Directions of the edges of the start region that meet here, zero for none. The factor applies in the fan of directions for which
    /// the point is the nearest of the region, see [`Self::is_in_fan`].
    pub(crate) edges: [DVec2; 2],
    /// Distance at the point, in stored units.
    pub(crate) travelled: f64,
    /// Number of the point: its images around a periodic grid have the same.
    pub(crate) number: usize,
    /// In cells from the point: how far `g0` may apply, and how far it applies at all nodes, see [`UNIFORM_RATIO`].
    pub(crate) radius: f64,
    pub(crate) uniform_radius: f64,
}

impl Factor {
    /// One that applies nowhere yet: its radii are zero.
    pub(crate) fn new(at: DVec2, metric: Sym2, edges: [DVec2; 2], travelled: f64) -> Self {
        Self { at, metric, edges, travelled, number: 0, radius: 0.0, uniform_radius: 0.0 }
    }

    /// Whether `v` from the point leads into the fan, `eᵀMv ≤ 0` for both edges `e`: the point is then the nearest of the start region.
    pub(crate) fn is_in_fan(&self, v: DVec2) -> bool {
        let mv = self.metric.apply(v);
        self.edges.iter().all(|edge| mv.dot(*edge) <= 0.0)
    }

    /// `g0` at `v` from the point.
    pub(crate) fn value(&self, v: DVec2) -> f64 {
        self.metric.norm(v)
    }

    /// The factoring term `c(x, x + by)` for `x` at `v` from the point. In a form without cancellation, with `A = vᵀM by`, `B = byᵀM by`,
    /// `g = g0(x)` and `G = g0(x + by)`, it is `(A (2A + B)/(G + g) − g B) / (g (G + g))`.
    pub(crate) fn term(&self, v: DVec2, by: DVec2) -> f64 {
        let (a, b, g) = (self.metric.apply(v).dot(by), self.metric.form(by), self.metric.norm(v));
        let sum = g + (g * g + 2.0 * a + b).max(0.0).sqrt();
        if g > 0.0 { (a * (2.0 * a + b) / sum - g * b) / (g * sum) } else { 0.0 }
    }

    /// Whether both are the same function `g0`.
    pub(crate) fn is(&self, other: &Self) -> bool {
        let near = self.at.abs_diff_eq(other.at, 1e-9);
        near && self.metric == other.metric && self.edges == other.edges
    }

    /// The factoring terms at a node, given its `D` and the vector to it from the point; `None` where `g0` does not apply.
    pub(crate) fn terms(&self, v: DVec2, d: Sym2) -> Option<[f64; 8]> {
        let terms = RING.map(|(i, j)| {
            let by = DVec2::new(i.into(), j.into());
            if self.is_in_fan(v + by) { self.term(v, by) } else { 0.0 }
        });
        let m = self.metric;
        let trace = m.xx * d.xx + 2.0 * m.xy * d.xy + m.yy * d.yy;
        let largest = -terms.into_iter().fold(0.0, f64::min);
        let applies = v.length_squared() <= self.uniform_radius * self.uniform_radius
            || is_similar(
                trace as f32,
                (m.det() * d.det()) as f32,
                (d.xx + d.yy) as f32,
                largest as f32,
            );
        let is_near = v.length_squared() <= self.radius * self.radius;
        (self.is_in_fan(v) && is_near && applies).then_some(terms)
    }

    /// The terms at a line of nodes along x, given the vector to the first from the point and `D` as xx, xy and the determinant; 0 where
    /// `g0` does not apply. Returns for each node the most by which a term lowers a neighbour's value.
    #[inline(always)]
    pub(crate) fn terms_of_line(
        &self,
        from: DVec2,
        [dxx, dxy, ddet]: &[Lanes; 3],
        terms: &mut [Lanes; 8],
    ) -> Lanes {
        let [p, q] = self.edges.map(|edge| self.metric.apply(edge));
        let (px, py, qx, qy) = (p.x as f32, p.y as f32, q.x as f32, q.y as f32);
        let m = self.metric;
        let (xx, xy, yy, det) = (m.xx as f32, m.xy as f32, m.yy as f32, m.det() as f32);
        let radius2 = (self.radius * self.radius) as f32;
        let uniform2 = (self.uniform_radius * self.uniform_radius) as f32;
        let y = from.y as f32;
        let mut largest = [0f32; LANES];
        for i in 0..LANES {
            // Rounded once, so that sweeps by rows and by columns agree at which nodes it applies.
            let x = (from.x + i as f64) as f32;
            let r2 = x * x + y * y;
            let (mx, my) = (xx * x + xy * y, xy * x + yy * y);
            let g2 = greatest(mx * x + my * y, 0.0);
            let g = g2.sqrt();
            let inv_g = choose(g > 0.0, 1.0 / g, 0.0);
            for k in 0..8 {
                let (dx, dy) = (RING[k].0 as f32, RING[k].1 as f32);
                let a = mx * dx + my * dy;
                let b = xx * (dx * dx) + 2.0 * xy * (dx * dy) + yy * (dy * dy);
                let sum = g + greatest(g2 + (2.0 * a + b), 0.0).sqrt();
                let isum = choose(sum > 0.0, 1.0 / sum, 0.0);
                let holds =
                    (px * (x + dx) + py * (y + dy) <= 0.0) & (qx * (x + dx) + qy * (y + dy) <= 0.0);
                terms[k][i] =
                    choose(holds, (a * (2.0 * a + b) * isum - g * b) * (isum * inv_g), 0.0);
                largest[i] = greatest(largest[i], -terms[k][i]);
            }
            let dyy = (ddet[i] + dxy[i] * dxy[i]) / dxx[i];
            let trace = xx * dxx[i] + 2.0 * xy * dxy[i] + yy * dyy;
            let applies = (px * x + py * y <= 0.0)
                & (qx * x + qy * y <= 0.0)
                & (r2 <= radius2)
                & ((r2 <= uniform2) | is_similar(trace, ddet[i] * det, dxx[i] + dyy, largest[i]));
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
            edges: self.edges.map(|edge| edge.yx()),
            ..*self
        }
    }
}

/// Whether `g0` applies at a node beyond the uniform radius, where `M(s) D` has this trace and determinant, `D` this trace, and the
/// largest term this size.
#[inline(always)]
fn is_similar(trace: f32, det: f32, trace_of_d: f32, term: f32) -> bool {
    // No step is shorter than 1/√λ with the larger eigenvalue λ of D, λ ≤ tr D.
    let small = term * term * trace_of_d <= MAX_TERM * MAX_TERM;
    small & are_roots_within(trace, det, SIMILAR_RATIO)
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
    fn a_term_replaces_the_factor_by_its_tangent_plane() {
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
