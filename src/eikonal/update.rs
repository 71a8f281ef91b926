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

use super::field::{SIDE, TensorTile};
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

impl Coefficients {
    /// Sets one lane from the tensor of an open node. `D` is stored as (xx, xy, det): the determinant of a very
    /// anisotropic tensor would be lost in the rounding of xx·yy − xy².
    #[inline(always)]
    fn set(&mut self, i: usize, xx: f32, xy: f32, det: f32, tolerance: f32) {
        let open = det > 0.0;
        let choose = |value: f32, closed: f32| if open { value } else { closed };
        let yy = (det + xy * xy) / xx;
        let idet = 1.0 / det;
        let diagonal = |sum: f32| (if sum > 0.0 { sum } else { 0.0 } * idet).sqrt();
        let (east, south) = ((yy * idet).sqrt(), (xx * idet).sqrt());
        let (rising, falling) = (diagonal(xx + yy - 2.0 * xy), diagonal(xx + yy + 2.0 * xy));
        self.xx[i] = choose(xx, -1.0);
        self.xy[i] = choose(xy, 0.0);
        self.yy[i] = choose(yy, -1.0);
        self.det[i] = choose(det, 0.0);
        self.ixx[i] = choose(1.0 / xx, 0.0);
        self.iyy[i] = choose(1.0 / yy, 0.0);
        self.east[i] = choose(east, UNREACHED);
        self.south[i] = choose(south, UNREACHED);
        self.rising[i] = choose(rising, UNREACHED);
        self.falling[i] = choose(falling, UNREACHED);
        let shortest = least(least(east, south), least(rising, falling));
        self.tolerance[i] = choose(tolerance * shortest, UNREACHED);
    }

    #[inline(always)]
    fn copy_lane(&mut self, lane: usize, from: &Self, i: usize) {
        self.xx[lane] = from.xx[i];
        self.xy[lane] = from.xy[i];
        self.yy[lane] = from.yy[i];
        self.det[lane] = from.det[i];
        self.ixx[lane] = from.ixx[i];
        self.iyy[lane] = from.iyy[i];
        self.east[lane] = from.east[i];
        self.south[lane] = from.south[i];
        self.rising[lane] = from.rising[i];
        self.falling[lane] = from.falling[i];
        self.tolerance[lane] = from.tolerance[i];
    }
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
        load_coefficients(tensors, &mut self.coefficients, mirrored, tolerance);
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

/// The coefficients of a tile, sheared like its values.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl",
    "x86_64+avx2",
    "x86_64+sse4.1",
))]
fn load_coefficients(
    tensors: &TensorTile,
    coefficients: &mut [Coefficients; STEPS],
    mirrored: bool,
    tolerance: f32,
) {
    let turn = if mirrored { -1.0 } else { 1.0 };
    for row in 0..SIDE {
        let lane = if mirrored { SIDE - 1 - row } else { row };
        let xx = lanes(&tensors.xx, row * SIDE);
        let xy = lanes(&tensors.xy, row * SIDE);
        let det = lanes(&tensors.det, row * SIDE);
        let mut line = Coefficients::CLOSED;
        for i in 0..SIDE {
            line.set(i, xx[i], turn * xy[i], det[i], tolerance);
        }
        for col in 0..SIDE {
            coefficients[col + lane].copy_lane(lane, &line, col);
        }
    }
}

/// The smaller of two; compiles to one instruction because NaN is not its business.
#[inline(always)]
fn least(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// As many values as a tile has rows, from `shift` on.
#[inline(always)]
fn lanes(line: &[f32], shift: usize) -> [f32; SIDE] {
    // Not `array::from_fn` or an iterator: what is not inlined here is not compiled for the wide registers.
    let mut lanes = [0.0; SIDE];
    lanes.copy_from_slice(&line[shift..shift + SIDE]);
    lanes
}

/// A diagonal neighbour, hidden where both nodes beside the step to it are unreached: between two walls the step
/// would leak through. Where they are only not reached yet the step is taken one update later, so the
/// solution is the same.
#[inline(always)]
fn pass(diagonal: f32, a: f32, b: f32) -> f32 {
    if least(a, b) < UNREACHED { diagonal } else { UNREACHED }
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
        let line = |along: usize| &values[step + along];
        let (old, east, west) = (lanes(line(2), 1), lanes(line(3), 1), lanes(line(1), 1));
        let (south, north) = (lanes(line(3), 2), lanes(line(1), 0));
        let (south_east, north_west) = (lanes(line(4), 2), lanes(line(0), 0));
        let (north_east, south_west) = (lanes(line(2), 0), lanes(line(2), 2));
        let mut new = [0f32; SIDE];
        for i in 0..SIDE {
            let (e, w, s, n) = (east[i], west[i], south[i], north[i]);
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
