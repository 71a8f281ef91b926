//! The functional of second order at a node and its minimum over the segment that the value comes from.
//!
//! All triangles are mirrored onto one: with the axis neighbour `a` at (1, 0) and the diagonal one `b` at (1, 1), so that the
//! step to the foot is `v = (1, θ)`.

use crate::linalg::lanes::{choose_bits as choose, greatest, inverse_root, least};

/// `vᵀMv` for `v = (1, θ)`: `α + 2βθ + γθ²`, that is `M` as xx, xy, yy.
#[derive(Clone, Copy)]
pub(super) struct Quadratic(pub(super) f32, pub(super) f32, pub(super) f32);

impl Quadratic {
    #[inline(always)]
    fn at(self, t: f32) -> f32 {
        self.0 + t * (2.0 * self.1 + t * self.2)
    }

    #[inline(always)]
    fn root(self, t: f32) -> f32 {
        greatest(self.at(t), 0.0).sqrt()
    }

    /// The root and its first two derivatives in `θ`, to five digits: they only locate the foot, whose error counts squared.
    #[inline(always)]
    fn jet(self, t: f32) -> [f32; 3] {
        let square = greatest(self.at(t), 1e-12);
        let inverse = inverse_root(square);
        let first = (self.1 + t * self.2) * inverse;
        [square * inverse, first, (self.2 - first * first) * inverse]
    }
}

/// The factor `g0` around a node at `v` from the point of the factor, times `on` (1 where it applies, else 0).
#[derive(Clone, Copy)]
pub(super) struct FactorAt {
    on: f32,
    /// `M(s)` at the point of the factor.
    m0: Quadratic,
    v: [f32; 2],
    /// `M(s) v`, `g0²` and `g0` at the node.
    mv: [f32; 2],
    g2: f32,
    g: f32,
}

impl FactorAt {
    #[inline(always)]
    pub(super) fn new(on: f32, m0: Quadratic, v: [f32; 2]) -> Self {
        let mv = [m0.0 * v[0] + m0.1 * v[1], m0.1 * v[0] + m0.2 * v[1]];
        let g2 = greatest(mv[0] * v[0] + mv[1] * v[1], 1e-12);
        Self { on, m0, v, mv, g2, g: g2.sqrt() }
    }

    /// `g0(x + (1, θ)) − g0(x)`.
    #[inline(always)]
    fn rise(&self, t: f32) -> f32 {
        let more = 2.0 * (self.mv[0] + self.mv[1] * t) + self.m0.at(t);
        self.on * more / (self.g + greatest(self.g2 + more, 0.0).sqrt())
    }

    /// `g0²` at `x + (1, θ)`.
    #[inline(always)]
    fn square(&self) -> Quadratic {
        let Quadratic(xx, xy, yy) = self.m0;
        let [x, y] = [self.v[0] + 1.0, self.v[1]];
        let (mx, my) = (xx * x + xy * y, xy * x + yy * y);
        Quadratic(mx * x + my * y, my, yy)
    }
}

/// What a node's functional is made of.
#[derive(Clone, Copy)]
pub(super) struct Foot {
    /// By how much the values at (1, 0), (1, 1), (1, −1) and (1, 2) exceed that of the node; a large number where unreached.
    pub(super) rise: [f32; 4],
    /// `g(b) − g(a)` as the first-order update reads it, factoring terms included.
    pub(super) slope: f32,
    /// `M` at the node and at the neighbours `a` and `b`; 0 where closed.
    pub(super) here: Quadratic,
    pub(super) at_a: Quadratic,
    pub(super) at_b: Quadratic,
    pub(super) factor: FactorAt,
    /// `θ` of the round before; negative if it was in another triangle.
    pub(super) known: f32,
}

impl Foot {
    /// `θ` after a step of Newton's method, and the defect `ρ` there.
    #[inline(always)]
    pub(super) fn minimise<const IS_FACTORED: bool>(self) -> (f32, f32) {
        let Self { rise: [ra, rb, rc, rd], slope, here, factor, known, .. } = self;
        let (mut wa, mut wb, mut wc, mut wd) = (ra, rb, rc, rd);
        if IS_FACTORED {
            wa -= factor.rise(0.0);
            wb -= factor.rise(1.0);
            wc -= factor.rise(-1.0);
            wd -= factor.rise(2.0);
        }
        let (has_a, has_b) = (ra < 1e17, rb < 1e17);
        let free = has_a & has_b;
        let curvature = choose(free, curvature(wa, wb, wc, wd, rc < 1e17, rd < 1e17), 0.0);
        // Where one of `a` and `b` is not reached, the foot is the other.
        let lo = choose(has_a, 0.0, 1.0);
        let hi = choose(has_b, 1.0, lo);
        let base = choose(has_a, wa, wb);
        let rise = choose(free, wb - wa, 0.0);
        let (metric_a, metric_b) = (open(self.at_a, here), open(self.at_b, here));
        let g0_square = factor.square();

        // The first-order foot, see `segment`: here γ = wᵀMw, β = aᵀMw and α = aᵀMa.
        let d = choose(free, slope, 0.0);
        let inverse = inverse_root(here.2);
        let middle = here.1 * (inverse * inverse);
        let across = greatest(here.0 - here.1 * middle, 0.0);
        let steep = here.2 * greatest(here.2 - d * d, 1e-12 * here.2);
        let phi = -d * across * inverse_root(greatest(across * steep, 1e-30));
        let first_order = phi - middle;
        let t = greatest(lo, least(hi, choose(known >= 0.0, known, first_order)));
        // Lengths ‖v‖ and their derivatives in θ under the metrics at x, a and b; then those of C(θ) by the product rule.
        let ([_, d1_x, d2_x], [l_a, d1_a, d2_a], [l_b, d1_b, d2_b]) =
            (here.jet(t), metric_a.jet(t), metric_b.jet(t));
        let (mut d1_g0, mut d2_g0) = (0.0, 0.0);
        if IS_FACTORED {
            let [_, first, second] = g0_square.jet(t);
            (d1_g0, d2_g0) = (factor.on * first, factor.on * second);
        }
        let first = d1_g0 + rise - 0.5 * (1.0 - 2.0 * t) * curvature
            + 0.5 * (d1_x + d1_a + t * (d1_b - d1_a) + l_b - l_a);
        let second =
            d2_g0 + curvature + 0.5 * (d2_x + d2_a + t * (d2_b - d2_a) + 2.0 * (d1_b - d1_a));
        let step = choose(second > 1e-6, first / second, 0.0);
        let t = greatest(lo, least(hi, t - greatest(-0.3, least(0.3, step))));
        let length = 0.5 * (here.root(t) + (1.0 - t) * metric_a.root(t) + t * metric_b.root(t));
        let bend = greatest(-0.5 * length, least(0.5 * length, 0.5 * t * (1.0 - t) * curvature));
        let mut defect = base + t * rise + length - bend;
        if IS_FACTORED {
            defect += factor.rise(t);
        }
        (t, defect)
    }
}

/// `M` at a neighbour; where that is closed, `M` at the node.
#[inline(always)]
fn open(there: Quadratic, here: Quadratic) -> Quadratic {
    let open = there.0 > 0.0;
    Quadratic(
        choose(open, there.0, here.0),
        choose(open, there.1, here.1),
        choose(open, there.2, here.2),
    )
}

/// Second difference `S` along the ring at the segment between `a` and `b`: the mean of those at both ends, with the MC limiter (van
/// Leer), so that a kink beyond one end does not curve a straight segment.
#[inline(always)]
fn curvature(a: f32, b: f32, before: f32, after: f32, has_before: bool, has_after: bool) -> f32 {
    let (at_a, at_b) = (b - 2.0 * a + before, after - 2.0 * b + a);
    let size = least(0.5 * (at_a + at_b).abs(), 2.0 * least(at_a.abs(), at_b.abs()));
    let limited = choose(at_a * at_b > 0.0, choose(at_a > 0.0, size, -size), 0.0);
    let single = choose(has_before, at_a, choose(has_after, at_b, 0.0));
    choose(has_before & has_after, limited, single)
}
