//! The least over one segment of the ring.

use glam::DVec2;

use crate::linalg::Sym2;

/// The least of `(1−θ) ga + θ gb + ‖(1−θ) a + θ b‖_M` over `0 ≤ θ ≤ 1`, and the `θ`.
///
/// With `w = b − a` the length is `√(ww φ² + c)` in `φ = θ + aw/ww`, a hyperbola; its slope `ww φ/√(ww φ² + c)`
/// meets `−d`, `d = gb − ga`, at `φ = −d √(c / (ww (ww − d²)))`. The sum is convex, so an end is best when
/// that lies outside.
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
