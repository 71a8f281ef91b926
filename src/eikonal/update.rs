//! The heart: the best value of one node from its eight neighbours.
//!
//! Semi-Lagrangian update on the eight triangles around a node `x` (index units, spacing 1): the distance
//! at `x` is the least, over the ring of its neighbours, of the distance on the ring plus the length of the
//! straight step to it,
//!
//! ```text
//!   g(x) = min over y on the ring  of  g(y) + √((y−x)ᵀ M (y−x)),       M = D⁻¹ at x,
//!
//!     (−1,−1) ── (0,−1) ── (1,−1)
//!        │    ╲    │    ╱    │         g is linear along each of the
//!     (−1, 0) ──   x   ── (1, 0)       ring's eight segments
//!        │    ╱    │    ╲    │
//!     (−1, 1) ── (0, 1) ── (1, 1)
//! ```
//!
//! [`segment`] is that minimum over one segment in plain form; [`sweep`] is the closed form over all eight at
//! once, many nodes at a time.

use glam::DVec2;
use multiversion::multiversion;

use super::field::{AREA, SIDE, TensorTile};
use crate::Sym2;

/// Value of a node that no front has reached. Far above any distance, and its square still a finite `f32`.
pub(crate) const UNREACHED: f32 = 1e18;

/// The ring of neighbours, counter-clockwise in index coordinates, axis neighbours at even places.
pub(crate) const RING: [(i32, i32); 8] =
    [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)];

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

/// Side of a block: a tile and one node of each neighbour around it.
const BLOCK: usize = SIDE + 2;
/// Anti-diagonals of a tile.
const STEPS: usize = 2 * SIDE - 1;
/// Anti-diagonals of a block, and one more on either side.
const ROWS: usize = STEPS + 4;

/// What the update needs of `D` at a node, [`SIDE`] nodes of one anti-diagonal at a time.
#[derive(Clone, Copy, Debug)]
struct Coefficients {
    xx: [f32; SIDE],
    xy: [f32; SIDE],
    yy: [f32; SIDE],
    det: [f32; SIDE],
    /// `1/xx`, `1/yy`.
    ixx: [f32; SIDE],
    iyy: [f32; SIDE],
    /// Lengths of the steps (1,0), (0,1), (1,1), (1,−1).
    east: [f32; SIDE],
    south: [f32; SIDE],
    rising: [f32; SIDE],
    falling: [f32; SIDE],
    /// A change below this is no reason to go on.
    tolerance: [f32; SIDE],
}

impl Coefficients {
    /// A node that is never updated: `xx < 0` invalidates every triangle, the steps are endless.
    const CLOSED: Self = Self {
        xx: [-1.0; SIDE],
        xy: [0.0; SIDE],
        yy: [-1.0; SIDE],
        det: [0.0; SIDE],
        ixx: [0.0; SIDE],
        iyy: [0.0; SIDE],
        east: [UNREACHED; SIDE],
        south: [UNREACHED; SIDE],
        rising: [UNREACHED; SIDE],
        falling: [UNREACHED; SIDE],
        tolerance: [UNREACHED; SIDE],
    };
}

/// A tile on the workbench: its values and coefficients, sheared so that the nodes of one anti-diagonal,
/// which do not depend on each other in a sweep along the diagonal, lie side by side.
///
/// `values[c + r + 2][r + 1]` is the node in column `c`, row `r` of the tile, both from −1 to 16. With
/// `mirrored`, row `r` counts from the last row upwards and the sweep runs along the other diagonal.
#[derive(Debug)]
pub(crate) struct Bench {
    mirrored: bool,
    values: [[f32; BLOCK]; ROWS],
    coefficients: [Coefficients; STEPS],
}

impl Default for Bench {
    fn default() -> Self {
        Self {
            mirrored: false,
            values: [[UNREACHED; BLOCK]; ROWS],
            coefficients: [Coefficients::CLOSED; STEPS],
        }
    }
}

/// Values of a tile and of the nodes around it, row by row, each `(column, row)` from −1 to 16.
pub(crate) type Block = [[f32; BLOCK]; BLOCK];

impl Bench {
    /// Puts a tile on the bench. A relative change of `tolerance` of a node's shortest step is small.
    pub(crate) fn load(
        &mut self,
        tensors: &TensorTile,
        block: &Block,
        mirrored: bool,
        tolerance: f32,
    ) {
        self.mirrored = mirrored;
        self.load_values(block);
        let turn = if mirrored { -1.0 } else { 1.0 };
        for row in 0..SIDE {
            let lane = if mirrored { SIDE - 1 - row } else { row };
            let of = |values: &[f32; AREA]| -> [f32; SIDE] {
                std::array::from_fn(|col| values[row * SIDE + col])
            };
            let line = row_coefficients(
                of(&tensors.xx),
                of(&tensors.xy),
                of(&tensors.det),
                turn,
                tolerance,
            );
            for col in 0..SIDE {
                let to = &mut self.coefficients[col + lane];
                to.xx[lane] = line.xx[col];
                to.xy[lane] = line.xy[col];
                to.yy[lane] = line.yy[col];
                to.det[lane] = line.det[col];
                to.ixx[lane] = line.ixx[col];
                to.iyy[lane] = line.iyy[col];
                to.east[lane] = line.east[col];
                to.south[lane] = line.south[col];
                to.rising[lane] = line.rising[col];
                to.falling[lane] = line.falling[col];
                to.tolerance[lane] = line.tolerance[col];
            }
        }
    }

    fn load_values(&mut self, block: &Block) {
        for (row, line) in block.iter().enumerate() {
            let lane = if self.mirrored { BLOCK - 1 - row } else { row };
            for (col, &value) in line.iter().enumerate() {
                self.values[col + lane][lane] = value;
            }
        }
    }

    /// Takes the values back off the bench.
    pub(crate) fn store(&self, block: &mut Block) {
        for (row, line) in block.iter_mut().enumerate() {
            let lane = if self.mirrored { BLOCK - 1 - row } else { row };
            for (col, value) in line.iter_mut().enumerate() {
                *value = self.values[col + lane][lane];
            }
        }
    }

    /// One Gauss–Seidel sweep along the diagonal, away from (`descending`: towards) the first node.
    /// Whether any node changed by more than its tolerance.
    pub(crate) fn sweep(&mut self, descending: bool) -> bool {
        sweep(&mut self.values, &self.coefficients, descending)
    }
}

/// Coefficients of a row of nodes; `turn = −1` mirrors the row axis.
#[inline]
fn row_coefficients(
    xx: [f32; SIDE],
    xy: [f32; SIDE],
    det: [f32; SIDE],
    turn: f32,
    tolerance: f32,
) -> Coefficients {
    let mut k = Coefficients::CLOSED;
    for i in 0..SIDE {
        let open = det[i] > 0.0;
        let xy = turn * xy[i];
        // D is stored as (xx, xy, det): the determinant of a very anisotropic tensor would be lost in
        // the rounding of xx·yy − xy².
        let yy = (det[i] + xy * xy) / xx[i];
        let idet = 1.0 / det[i];
        let steps = [
            (yy * idet).sqrt(),
            (xx[i] * idet).sqrt(),
            ((xx[i] + yy - 2.0 * xy).max(0.0) * idet).sqrt(),
            ((xx[i] + yy + 2.0 * xy).max(0.0) * idet).sqrt(),
        ];
        if open {
            k.xx[i] = xx[i];
            k.xy[i] = xy;
            k.yy[i] = yy;
            k.det[i] = det[i];
            k.ixx[i] = 1.0 / xx[i];
            k.iyy[i] = 1.0 / yy;
            [k.east[i], k.south[i], k.rising[i], k.falling[i]] = steps;
            k.tolerance[i] =
                tolerance * least(least(steps[0], steps[1]), least(steps[2], steps[3]));
        }
    }
    k
}

/// The smaller of two; compiles to one instruction because NaN is not its business.
#[inline(always)]
fn least(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// One triangle: the value through the segment from axis neighbour `a` to diagonal neighbour `b`.
///
/// For `D = [s β; β q]` in the basis where `a = (1,0)`, `b = (1,1)`, and `d = gb − ga`, the eikonal equation
/// `s t² − 2β t d + q d² = 1`, `t = u − ga`, has the causal root `t = (β d + √(s − det d²))/s`. It is valid where
/// the step `−D∇g` points between `a` and `b`, that is, where both weights are not negative.
#[inline(always)]
fn triangle(a: f32, b: f32, [s, is, beta, q, det]: [f32; 5]) -> f32 {
    let d = b - a;
    let root = s - det * d * d;
    let t = (beta * d + (if root > 0.0 { root } else { 0.0 }).sqrt()) * is;
    let weight_b = beta * t - q * d;
    let weight_a = s * t - beta * d - weight_b;
    let valid = (root >= 0.0) & (weight_a >= 0.0) & (weight_b >= 0.0);
    if valid { a + t } else { UNREACHED }
}

/// See [`Bench::sweep`]. No fused multiply-add, so every instruction set gives the same bits.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl",
    "x86_64+avx2",
    "x86_64+sse4.1",
))]
fn sweep(
    values: &mut [[f32; BLOCK]; ROWS],
    coefficients: &[Coefficients; STEPS],
    descending: bool,
) -> bool {
    let mut changed = [0u32; SIDE];
    for step in 0..STEPS {
        let step = if descending { STEPS - 1 - step } else { step };
        let k = &coefficients[step];
        // Lanes of anti-diagonal `step + 2 + along`, rows shifted by `across`.
        let lanes = |along: usize, across: usize| -> [f32; SIDE] {
            let line = &values[step + along];
            std::array::from_fn(|i| line[i + across])
        };
        let (old, east, west) = (lanes(2, 1), lanes(3, 1), lanes(1, 1));
        let (south, north) = (lanes(3, 2), lanes(1, 0));
        let (south_east, north_west) = (lanes(4, 2), lanes(0, 0));
        let (north_east, south_west) = (lanes(2, 0), lanes(2, 2));
        let mut new = [0f32; SIDE];
        for i in 0..SIDE {
            let (e, w, s, n) = (east[i], west[i], south[i], north[i]);
            // A diagonal step between two nodes that are both walls would leak through. Between two that
            // are only not reached yet it is allowed one update later, so the solution is the same.
            let pass = |diagonal: f32, a: f32, b: f32| {
                if least(a, b) < UNREACHED { diagonal } else { UNREACHED }
            };
            let (se, nw) = (pass(south_east[i], s, e), pass(north_west[i], n, w));
            let (ne, sw) = (pass(north_east[i], n, e), pass(south_west[i], s, w));
            let edges = least(
                least(least(e, w) + k.east[i], least(s, n) + k.south[i]),
                least(least(se, nw) + k.rising[i], least(ne, sw) + k.falling[i]),
            );
            let along_x = [k.xx[i], k.ixx[i], k.xy[i], k.yy[i], k.det[i]];
            let along_y = [k.yy[i], k.iyy[i], k.xy[i], k.xx[i], k.det[i]];
            let across_x = [k.xx[i], k.ixx[i], -k.xy[i], k.yy[i], k.det[i]];
            let across_y = [k.yy[i], k.iyy[i], -k.xy[i], k.xx[i], k.det[i]];
            let rising = least(
                least(triangle(e, se, along_x), triangle(w, nw, along_x)),
                least(triangle(s, se, along_y), triangle(n, nw, along_y)),
            );
            let falling = least(
                least(triangle(e, ne, across_x), triangle(w, sw, across_x)),
                least(triangle(s, sw, across_y), triangle(n, ne, across_y)),
            );
            let u = least(least(rising, falling), edges);
            let floor = ROUNDING * u;
            let significant = if k.tolerance[i] > floor { k.tolerance[i] } else { floor };
            changed[i] |= u32::from(old[i] - u > significant);
            new[i] = least(u, old[i]);
        }
        values[step + 2][1..=SIDE].copy_from_slice(&new);
    }
    changed.iter().any(|&c| c != 0)
}

/// Four units in the last place of an `f32`: changes below are rounding.
pub(crate) const ROUNDING: f32 = 2.4e-7;
