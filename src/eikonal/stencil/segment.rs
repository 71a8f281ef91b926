//! The minimum over one segment of the ring: in plain form, and in the closed form of the fast kernels.

use glam::DVec2;

use crate::linalg::Sym2;
use crate::linalg::lanes::{greatest, least};

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
}
