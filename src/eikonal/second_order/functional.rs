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

    /// The root and its first two derivatives in `θ`. Unless exact, to five digits: derivatives only locate the foot, whose error counts squared.
    #[inline(always)]
    fn jet(self, t: f32) -> [f32; 3] {
        self.root_jet::<false>(t, [0.0; 3])
    }

    /// [`jet`](Self::jet) of the root of the form and the square of a climb, which is given with its derivatives.
    #[inline(always)]
    fn root_jet<const IS_EXACT: bool>(self, t: f32, [climb, d1, d2]: [f32; 3]) -> [f32; 3] {
        let square = greatest(self.at(t) + climb * climb, 1e-12);
        let (root, inverse) = if IS_EXACT {
            (square.sqrt(), 0.0)
        } else {
            let inverse = inverse_root(square);
            (square * inverse, inverse)
        };
        let first = (self.1 + t * self.2 + climb * d1) * inverse;
        let second = self.2 + d1 * d1 + climb * d2;
        [root, first, (second - first * first) * inverse]
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

/// The functional of second order at a node, in a triangle.
#[derive(Clone, Copy)]
pub(super) struct Functional {
    /// By how much the values at (1, 0), (1, 1), (1, −1) and (1, 2) exceed that of the node; a large number where unreached.
    pub(super) rise: [f32; 4],
    /// `g(b) − g(a)` as the first-order update reads it, factoring terms included.
    pub(super) slope: f32,
    /// `M` in the cell of the triangle, and in that on the other side of the edge to `a`; 0 beyond the grid.
    pub(super) own: Quadratic,
    pub(super) beside: Quadratic,
    /// `M` at the node, `a` and `b`, with all that weighs steps there; 0 where closed.
    pub(super) nodes: [Quadratic; 3],
    /// Costs at the node, `a` and `b`.
    pub(super) costs: [f32; 3],
    /// The largest cost on the ring by the smallest.
    pub(super) cost_ratio: f32,
    /// By how much the weighted heights at (1, 0), (1, 1) and (1, −1) exceed that of the node.
    pub(super) climb: [f32; 3],
    /// See [`Tile`](crate::eikonal::tile::Tile).
    pub(super) is_by_nodes: bool,
    pub(super) factor: FactorAt,
    /// `θ` of the round before; negative if it was in another triangle.
    pub(super) known: f32,
}

/// The minimum of a functional.
pub(super) struct Minimum {
    /// The share of `b` in the foot.
    pub(super) theta: f32,
    /// The defect `ρ`. It is 0 where the metric turns or jumps so much between the two cells, or the costs between the nodes, that a
    /// functional of second order means nothing: there the value of first order stays.
    pub(super) defect: f32,
    /// The size of the defect that was put aside there.
    pub(super) rejected: f32,
    /// The length of the step.
    pub(super) length: f32,
}

impl Functional {
    /// The minimum after a step of Newton's method.
    #[inline(always)]
    pub(super) fn minimise<const IS_FACTORED: bool, const IS_WEIGHTED: bool>(self) -> Minimum {
        let Self { rise: [ra, rb, rc, rd], slope, factor, known, .. } = self;
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
        let g0_square = factor.square();

        let first_order = self.first_order::<IS_WEIGHTED>(choose(free, slope, 0.0));
        let t = greatest(lo, least(hi, choose(known >= 0.0, known, first_order)));
        // At the border of the grid there is no cell on the other side.
        let by_cells = (self.beside.0 > 0.0) & !self.is_by_nodes;
        let (of_cells, of_nodes) =
            (self.length_jet::<IS_WEIGHTED, false>(t), self.length_jet_by_nodes(t));
        let d1_c = choose(by_cells, of_cells[1], of_nodes[0]);
        let d2_c = choose(by_cells, of_cells[2], of_nodes[1]);
        let (mut d1_g0, mut d2_g0) = (0.0, 0.0);
        if IS_FACTORED {
            let [_, first, second] = g0_square.jet(t);
            (d1_g0, d2_g0) = (factor.on * first, factor.on * second);
        }
        let first = d1_g0 + rise - 0.5 * (1.0 - 2.0 * t) * curvature + d1_c;
        let second = d2_g0 + curvature + d2_c;
        let step = choose(second > 1e-6, first / second, 0.0);
        let t = greatest(lo, least(hi, t - greatest(-0.3, least(0.3, step))));
        let by_nodes = self.length_by_nodes(t);
        let length = choose(by_cells, self.length_jet::<IS_WEIGHTED, true>(t)[0], by_nodes);
        // Beyond, it is the curvature of a kink.
        let most = choose(self.is_by_nodes, 8.0 * MOST_CURVATURE, MOST_CURVATURE) * length;
        let bend = 0.5 * t * (1.0 - t) * greatest(-most, least(most, curvature));
        let mut defect = base + t * rise + length - bend;
        if IS_FACTORED {
            defect += factor.rise(t);
        }
        let share = choose(self.is_by_nodes, 1.0, self.smooth_share::<IS_WEIGHTED>(t));
        let at_first_order = greatest(lo, least(hi, first_order));
        Minimum {
            theta: at_first_order + share * (t - at_first_order),
            defect: share * defect,
            rejected: (1.0 - share) * defect.abs(),
            length,
        }
    }

    /// The first-order foot, see [`segment`](crate::eikonal::stencil::segment::segment): here `γ = wᵀMw`, `β = aᵀMw` and `α = aᵀMa`.
    #[inline(always)]
    fn first_order<const IS_WEIGHTED: bool>(&self, d: f32) -> f32 {
        let mut metric = self.own;
        let mut mean = 1.0;
        if IS_WEIGHTED {
            let (x, y) = (self.climb[0], self.climb[1] - self.climb[0]);
            metric = Quadratic(metric.0 + x * x, metric.1 + x * y, metric.2 + y * y);
            mean = 0.5 * self.costs[0] + 0.25 * (self.costs[1] + self.costs[2]);
        }
        let d = d / mean;
        let inverse = inverse_root(metric.2);
        let middle = metric.1 * (inverse * inverse);
        let across = greatest(metric.0 - metric.1 * middle, 0.0);
        let steep = metric.2 * greatest(metric.2 - d * d, 1e-12 * metric.2);
        let phi = -d * across * inverse_root(greatest(across * steep, 1e-30));
        phi - middle
    }

    /// The length of the step to `θ` and its first two derivatives: at its middle the length is linear between those under the metrics of the two
    /// cells. Their squares, or the metrics, would do as well where they differ little; at a pole the widths of cells are linear.
    #[inline(always)]
    fn length_jet<const IS_WEIGHTED: bool, const IS_EXACT: bool>(&self, t: f32) -> [f32; 3] {
        let beside = open(self.beside, self.own);
        let climb = if IS_WEIGHTED { self.climb_jet(t) } else { [0.0; 3] };
        let own = self.own.root_jet::<IS_EXACT>(t, climb);
        let beside = beside.root_jet::<IS_EXACT>(t, climb);
        let (near, far) = (0.5 * (1.0 + t), 0.5 * (1.0 - t));
        let jet = [
            near * own[0] + far * beside[0],
            near * own[1] + far * beside[1] + 0.5 * (own[0] - beside[0]),
            near * own[2] + far * beside[2] + (own[1] - beside[1]),
        ];
        if !IS_WEIGHTED {
            return jet;
        }
        let [cost, slope] = self.cost(t);
        [cost * jet[0], cost * jet[1] + slope * jet[0], cost * jet[2] + 2.0 * slope * jet[1]]
    }

    /// By how much the weighted heights at `(1, θ)` exceed that of the node, quadratic along the ring, and its first two derivatives.
    #[inline(always)]
    fn climb_jet(&self, t: f32) -> [f32; 3] {
        let [at_a, at_b, at_c] = self.climb;
        let bend = at_b - 2.0 * at_a + at_c;
        let climb = at_a + t * (at_b - at_a) - 0.5 * t * (1.0 - t) * bend;
        [climb, at_b - at_a - 0.5 * (1.0 - 2.0 * t) * bend, bend]
    }

    /// The mean cost of the step to `θ`, and its derivative.
    #[inline(always)]
    fn cost(&self, t: f32) -> [f32; 2] {
        let [own, a, b] = self.costs;
        [0.5 * (own + a + t * (b - a)), 0.5 * (b - a)]
    }

    /// How much of the defect counts: 1 where the metric and the costs around the step to `θ` are smooth, 0 where they turn or jump within a
    /// cell.
    #[inline(always)]
    fn smooth_share<const IS_WEIGHTED: bool>(&self, t: f32) -> f32 {
        let beside = open(self.beside, self.own);
        let (mut own, mut beside) = (self.own.at(t), beside.at(t));
        if IS_WEIGHTED {
            // Where the heights bend at `a`, the climb goes on from the other side by another slope.
            let [at_a, at_b, at_c] = self.climb;
            let (climb, straight) = (at_a + t * (at_b - at_a), at_a + t * (at_a - at_c));
            own += climb * climb;
            beside += straight * straight;
        }
        let mut ratio = (greatest(own, beside) / least(own, beside)).sqrt();
        if IS_WEIGHTED {
            ratio = greatest(ratio, self.cost_ratio);
        }
        greatest(0.0, least(1.0, (ROUGH - ratio) / (ROUGH - SMOOTH)))
    }

    /// The first two derivatives of what the step to `θ` costs by the trapezoidal rule over the nodes.
    #[inline(always)]
    fn length_jet_by_nodes(&self, t: f32) -> [f32; 2] {
        let [own, a, b] = self.nodes;
        let ([_, d1_x, d2_x], [l_a, d1_a, d2_a], [l_b, d1_b, d2_b]) =
            (own.jet(t), open(a, own).jet(t), open(b, own).jet(t));
        [
            0.5 * (d1_x + d1_a + t * (d1_b - d1_a) + l_b - l_a),
            0.5 * (d2_x + d2_a + t * (d2_b - d2_a) + 2.0 * (d1_b - d1_a)),
        ]
    }

    /// What the step to `θ` costs by the trapezoidal rule over the nodes.
    #[inline(always)]
    fn length_by_nodes(&self, t: f32) -> f32 {
        let [own, a, b] = self.nodes;
        let (own, a, b) = (own.root(t), open(a, own).root(t), open(b, own).root(t));
        0.5 * (own + a + t * (b - a))
    }
}

/// The ground is smooth where lengths of a step under the metrics of the two cells beside it, or costs at its ends, differ by no more than the
/// first factor, and rough where by more than the second; in between the defect counts in part, so that rounding decides nothing.
const SMOOTH: f32 = 1.05;
const ROUGH: f32 = 1.15;

/// Largest second difference along the ring in lengths of a step; eight times as much where the metric is known at the nodes only.
const MOST_CURVATURE: f32 = 0.5;

/// `M` in the cell on the other side of the edge; beyond the grid, `M` in the own cell.
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
