//! The minimum over one segment of the ring: in plain form, and in the closed form of the fast kernels.

use glam::DVec2;

use super::UNREACHED;
use crate::linalg::Sym2;
use crate::linalg::lanes::{choose, greatest, least};

/// The minimum of `(1−θ) ga + θ gb + ‖(1−θ) a + θ b‖_M` over `0 ≤ θ ≤ 1`, and its `θ`.
///
/// Let `w = b − a`, `d = gb − ga`, `ww = wᵀMw`, `aw = aᵀMw` and `c = aᵀMa − aw²/ww`. The length is `√(ww φ² + c)` with
/// `φ = θ + aw/ww`; its slope `ww φ/√(ww φ² + c)` is `−d` at `φ = −d √(c / (ww (ww − d²)))`. The sum is convex, so that an end is
/// best when this lies outside the segment.
pub(crate) fn segment(ga: f64, a: DVec2, gb: f64, b: DVec2, metric: Sym2) -> (f64, f64) {
    let w = b - a;
    let d = gb - ga;
    let ww = metric.form(w);
    let aw = a.dot(metric.apply(w));
    let c = (metric.form(a) - aw * aw / ww).max(0.0);
    let theta = if d * d < ww {
        let phi = -d * (c / (ww * (ww - d * d))).sqrt();
        (phi - aw / ww).clamp(0.0, 1.0)
    } else if d < 0.0 {
        1.0
    } else {
        0.0
    };
    (ga + theta * d + metric.norm(a.lerp(b, theta)), theta)
}

/// The cost at a diagonal neighbour `b` with which the mean of both ends is right for a step across the cell from a node to it, between the
/// corners `a` and `o`. The integral of a bilinear cost along the diagonal is, by Simpson's rule, `(2c + 2cb + ca + co)/6`: a cheap line does
/// not lead across a dear cell by its corners. Where the middle of the cell is cheap, the mean of the ends stays.
#[inline(always)]
pub(crate) fn diagonal_cost(c: f32, ca: f32, cb: f32, co: f32) -> f32 {
    let bilinear = (2.0 * cb + ca + co - c) * (1.0 / 3.0);
    let open = (ca < f32::INFINITY) & (co < f32::INFINITY) & (c < f32::INFINITY);
    choose(open & (bilinear > cb), bilinear, cb)
}

/// Steps of the search for the minimum over a segment where costs differ.
const STEPS: usize = 3;

/// `N(θ)` of [`ClosedForm::through_weighted`].
#[inline(always)]
fn length(gamma: f32, inv_s: f32, phi: f32) -> f32 {
    greatest(gamma * phi * phi + inv_s, 1e-30).sqrt()
}

/// [`segment`] where a step costs its length times the mean of the costs at both ends, `c` at the node, linear between `ca` and `cb` on the
/// segment: the `θ` of the minimum, by the method of [`ClosedForm::through_weighted`].
pub(crate) fn weighted_segment(
    [ga, gb]: [f64; 2],
    [a, b]: [DVec2; 2],
    metric: Sym2,
    [c, ca, cb]: [f64; 3],
) -> f64 {
    let (p, q) = (0.5 * (c + ca), 0.5 * (cb - ca));
    if q == 0.0 {
        return segment(ga, a, gb, b, metric * (p * p)).1;
    }
    let (mut theta, mut best) = (0.5, (f64::INFINITY, 0.0));
    for _ in 0..STEPS {
        let (cost, length) = (p + q * theta, metric.norm(a.lerp(b, theta)));
        let slope = gb - ga + q * length;
        theta = segment(0.0, a, slope, b, metric * (cost * cost)).1;
        let value = theta * (gb - ga) + (p + q * theta) * metric.norm(a.lerp(b, theta));
        best = if value < best.0 { (value, theta) } else { best };
    }
    best.1
}

/// The same minimum for a triangle with axis neighbour `a` and diagonal neighbour `b`, in terms of `D = M⁻¹`.
///
/// Let `w = b − a`, `d = gb − ga`, and `D = [s β; β q]` in the basis `(a, w)`. The eikonal equation
/// `s t² − 2β t d + q d² = 1`, `t = u − ga`, has the causal root
///
/// ```text
///   t(d) = (β/s) d + √(1/s − (det D/s²) d²)
/// ```
///
/// It is the minimum over the segment where the slope of the sum (see [`segment()`]) changes sign between the ends:
/// `lo ≤ d ≤ hi` with `lo = −bᵀMw/‖b‖`, `hi = −aᵀMw/‖a‖`. Otherwise the minimum is at an end.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ClosedForm {
    pub(crate) inv_s: f32,
    pub(crate) det_over_s2: f32,
    pub(crate) beta_over_s: f32,
    pub(crate) lo: f32,
    pub(crate) hi: f32,
}

impl ClosedForm {
    /// The value through the segment; where the minimum is at an end, no less than the value through that end.
    #[inline(always)]
    pub(crate) fn through(self, ga: f32, gb: f32) -> f32 {
        let Self { inv_s, det_over_s2, beta_over_s, lo, hi } = self;
        let d = greatest(least(gb - ga, hi), lo);
        ga + (beta_over_s * d + greatest(inv_s - det_over_s2 * (d * d), 0.0).sqrt())
    }

    /// The value through the segment where a step costs its length times the mean of the costs at both ends, at the node `c` and on the
    /// segment linear between `ca` and `cb`: the minimum over `θ` of
    ///
    /// ```text
    ///   f(θ) = ga + θ d + (p + q θ) N(θ),    p = (c + ca)/2,  q = (cb − ca)/2,
    ///   N(θ)² = γ φ² + 1/s,    φ = θ − β/s,  γ = (1/s)/(det D/s²)
    /// ```
    ///
    /// With the product taken as `C N(θ) + q (θ − θ₀) N(θ₀)` around a `θ₀` of cost `C`, this is the minimum under a constant cost, and by the
    /// envelope theorem at `θ = dt/dd`; repeated [`STEPS`] times from the middle on. However near that is, `f(θ)` is the price of a path.
    /// Infinite where an end is not reached.
    #[inline(always)]
    pub(crate) fn through_weighted(self, ga: f32, gb: f32, [c, ca, cb]: [f32; 3]) -> f32 {
        let Self { inv_s, det_over_s2, beta_over_s, lo, hi } = self;
        let (p, q) = (0.5 * (c + ca), 0.5 * (cb - ca));
        let valid = (ga < UNREACHED) & (gb < UNREACHED) & (inv_s < f32::INFINITY);
        let d = gb - ga;
        let gamma = inv_s / det_over_s2;
        let (mut theta, mut best) = (0.5, f32::INFINITY);
        for _ in 0..STEPS {
            let (cost, slope) = (p + q * theta, d + q * length(gamma, inv_s, theta - beta_over_s));
            let inside = greatest(least(slope, hi * cost), lo * cost);
            let square = inv_s * (cost * cost) - det_over_s2 * (inside * inside);
            let root = greatest(square, 1e-30).sqrt();
            theta = greatest(least(beta_over_s - det_over_s2 * inside / root, 1.0), 0.0);
            let step = (p + q * theta) * length(gamma, inv_s, theta - beta_over_s);
            best = least(best, ga + theta * d + step);
        }
        choose(valid, best, f32::INFINITY)
    }
}
