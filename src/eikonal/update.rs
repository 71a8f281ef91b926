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

/// What the update needs of `D` at the [`SIDE`] nodes of a row.
///
/// For a triangle with axis neighbour `a` and diagonal neighbour `b`, `w = b − a`, `d = gb − ga`, let `D = [s β; β q]` in the
/// basis `(a, w)`. The eikonal equation `s t² − 2β t d + q d² = 1`, `t = u − ga`, has the causal root
///
/// ```text
///   t(d) = (β/s) d + √(1/s − (det D/s²) d²)
/// ```
///
/// It is the least over the segment where the slope of the sum (see [`segment`]) changes sign between the ends:
/// `lo ≤ d ≤ hi` with `lo = −bᵀMw/‖b‖`, `hi = −aᵀMw/‖a‖`. Outside, the least is at an end.
#[derive(Clone, Copy, Debug)]
struct Coefficients {
    /// `1/s`, `det D/s²` and `β/s` for triangles along x, then along y; `β` changes its sign in the other two quadrants.
    ix: [f32; SIDE],
    ex: [f32; SIDE],
    bx: [f32; SIDE],
    iy: [f32; SIDE],
    ey: [f32; SIDE],
    by: [f32; SIDE],
    /// `hi` along x and y; with the other sign in the other two quadrants.
    hx: [f32; SIDE],
    hy: [f32; SIDE],
    /// `lo` of the triangles with a diagonal (1,1) along x and y, then with (1,−1).
    rx: [f32; SIDE],
    ry: [f32; SIDE],
    fx: [f32; SIDE],
    fy: [f32; SIDE],
    /// Lengths of the steps (1,0), (0,1), (1,1), (1,−1).
    east: [f32; SIDE],
    south: [f32; SIDE],
    rising: [f32; SIDE],
    falling: [f32; SIDE],
    /// A change below this is no reason to go on.
    tolerance: [f32; SIDE],
}

impl Coefficients {
    /// Nodes that are never updated: all steps are endless.
    const CLOSED: Self = Self {
        ix: [f32::INFINITY; SIDE],
        ex: [0.0; SIDE],
        bx: [0.0; SIDE],
        iy: [f32::INFINITY; SIDE],
        ey: [0.0; SIDE],
        by: [0.0; SIDE],
        hx: [0.0; SIDE],
        hy: [0.0; SIDE],
        rx: [0.0; SIDE],
        ry: [0.0; SIDE],
        fx: [0.0; SIDE],
        fy: [0.0; SIDE],
        east: [f32::INFINITY; SIDE],
        south: [f32::INFINITY; SIDE],
        rising: [f32::INFINITY; SIDE],
        falling: [f32::INFINITY; SIDE],
        tolerance: [f32::INFINITY; SIDE],
    };
}

/// A tile on the workbench: its values and what the update needs of its tensors, by rows, and by columns when that is asked
/// for. A sweep updates a whole row at a time, so it carries news across the tile in the directions within 45° of
/// its own.
#[derive(Debug)]
pub(crate) struct Bench {
    transposed: bool,
    values: Block,
    loaded: [bool; 2],
    coefficients: [[Coefficients; SIDE]; 2],
    /// By how much the value of a neighbour may exceed that of a node and still improve it. A node's least over a segment
    /// is above both ends unless the directions to them make an obtuse angle under `M`; then one end `a` may
    /// exceed it by up to `−aᵀMb/‖b‖`.
    pub(crate) slack: f32,
    /// The longest step of any node.
    pub(crate) longest_step: f32,
}

impl Default for Bench {
    fn default() -> Self {
        Self {
            transposed: false,
            values: [[UNREACHED; BLOCK]; BLOCK],
            loaded: [false; 2],
            coefficients: [[Coefficients::CLOSED; SIDE]; 2],
            slack: 0.0,
            longest_step: 0.0,
        }
    }
}

/// Values of a tile and of the nodes around it, row by row, each `(column, row)` from −1 to 16.
pub(crate) type Block = [[f32; BLOCK]; BLOCK];

impl Bench {
    /// Puts a tile on the bench.
    pub(crate) fn load(&mut self, block: &Block) {
        self.transposed = false;
        self.values = *block;
        self.loaded = [false; 2];
    }

    /// Takes the values back off the bench.
    pub(crate) fn store(&mut self, block: &mut Block) {
        self.turn(false);
        *block = self.values;
    }

    fn turn(&mut self, transposed: bool) {
        if self.transposed != transposed {
            self.transposed = transposed;
            for row in 0..BLOCK {
                for col in 0..row {
                    let value = self.values[row][col];
                    self.values[row][col] = self.values[col][row];
                    self.values[col][row] = value;
                }
            }
        }
    }

    /// One Gauss–Seidel sweep over the rows (`transposed`: columns), from the first to the last or the other way (`descending`).
    /// Whether any node changed by more than its tolerance, a relative change of `tolerance` of its shortest step.
    pub(crate) fn sweep(
        &mut self,
        tensors: &TensorTile,
        tolerance: f32,
        transposed: bool,
        descending: bool,
    ) -> bool {
        self.turn(transposed);
        let side = usize::from(transposed);
        if !self.loaded[side] {
            self.loaded[side] = true;
            let turned = transposed.then(|| tensors.transposed());
            let tensors = turned.as_ref().unwrap_or(tensors);
            (self.slack, self.longest_step) =
                load(tensors, tolerance, &mut self.coefficients[side]);
        }
        sweep(&mut self.values, &self.coefficients[side], descending)
    }
}

/// The coefficients of a tile. `D` is stored as (xx, xy, det): the determinant of a very anisotropic tensor would be lost in the rounding of xx·yy − xy².
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl",
    "x86_64+avx2",
    "x86_64+sse4.1",
))]
fn load(
    tensors: &TensorTile,
    tolerance: f32,
    coefficients: &mut [Coefficients; SIDE],
) -> (f32, f32) {
    let mut slack = [0f32; SIDE];
    let mut longest = [0f32; SIDE];
    for (row, k) in coefficients.iter_mut().enumerate() {
        let xx = lanes(&tensors.xx, row * SIDE);
        let xy = lanes(&tensors.xy, row * SIDE);
        let det = lanes(&tensors.det, row * SIDE);
        for i in 0..SIDE {
            let (xx, xy, det) = (xx[i], xy[i], det[i]);
            let open = det > 0.0;
            let ix = 1.0 / xx;
            let yy = (det + xy * xy) * ix;
            let (iy, idet) = (1.0 / yy, 1.0 / det);
            let (east, south) = ((yy * idet).sqrt(), (xx * idet).sqrt());
            let rising2 = greatest(xx + yy - 2.0 * xy, 1e-30) * idet;
            let falling2 = greatest(xx + yy + 2.0 * xy, 1e-30) * idet;
            let (rising, falling) = (rising2.sqrt(), falling2.sqrt());
            let (irising, ifalling) = (idet / rising, idet / falling);
            let shortest = least(least(east, south), least(rising, falling));
            k.ix[i] = choose(open, ix, f32::INFINITY);
            k.ex[i] = choose(open, det * ix * ix, 0.0);
            k.bx[i] = choose(open, xy * ix, 0.0);
            k.iy[i] = choose(open, iy, f32::INFINITY);
            k.ey[i] = choose(open, det * iy * iy, 0.0);
            k.by[i] = choose(open, xy * iy, 0.0);
            k.hx[i] = choose(open, xy * east * iy, 0.0);
            k.hy[i] = choose(open, xy * south * ix, 0.0);
            k.rx[i] = choose(open, (xy - xx) * irising, 0.0);
            k.ry[i] = choose(open, (xy - yy) * irising, 0.0);
            k.fx[i] = choose(open, -(xx + xy) * ifalling, 0.0);
            k.fy[i] = choose(open, -(yy + xy) * ifalling, 0.0);
            k.east[i] = choose(open, east, f32::INFINITY);
            k.south[i] = choose(open, south, f32::INFINITY);
            k.rising[i] = choose(open, rising, f32::INFINITY);
            k.falling[i] = choose(open, falling, f32::INFINITY);
            k.tolerance[i] = choose(open, tolerance * shortest, f32::INFINITY);
            let obtuse = greatest(
                greatest(k.hx[i].abs() - east, k.hy[i].abs() - south),
                greatest(
                    greatest(-k.rx[i] - rising, -k.ry[i] - rising),
                    greatest(-k.fx[i] - falling, -k.fy[i] - falling),
                ),
            );
            slack[i] = greatest(slack[i], choose(open, obtuse, 0.0));
            longest[i] = greatest(longest[i], choose(open, greatest(rising, falling), 0.0));
        }
    }
    (slack.into_iter().fold(0.0, f32::max), longest.into_iter().fold(0.0, f32::max))
}

#[inline(always)]
fn choose(yes: bool, a: f32, b: f32) -> f32 {
    if yes { a } else { b }
}

/// The smaller of two; compiles to one instruction because NaN is not its business.
#[inline(always)]
fn least(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[inline(always)]
fn greatest(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// As many values as a tile has columns, from `shift` on.
#[inline(always)]
fn lanes(line: &[f32], shift: usize) -> [f32; SIDE] {
    // Not `array::from_fn` or an iterator: what is not inlined here is not compiled for the wide registers.
    let mut lanes = [0.0; SIDE];
    lanes.copy_from_slice(&line[shift..shift + SIDE]);
    lanes
}

/// A diagonal neighbour, hidden where both nodes beside the step to it are closed: the step would leak through.
#[inline(always)]
fn pass(diagonal: f32, a: f32, b: f32) -> f32 {
    if least(a, b) < f32::INFINITY { diagonal } else { f32::INFINITY }
}

/// One triangle: the value through the segment from axis neighbour `a` to diagonal neighbour `b`; where the least over
/// the segment is at an end, not below that.
#[inline(always)]
fn triangle(a: f32, b: f32, lo: f32, hi: f32, [i, e, beta]: [f32; 3]) -> f32 {
    let d = greatest(least(b - a, hi), lo);
    let root = i - e * (d * d);
    a + (beta * d + greatest(root, 0.0).sqrt())
}

/// See [`Bench::sweep`]. No fused multiply-add, so every instruction set gives the same bits.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl",
    "x86_64+avx2",
    "x86_64+sse4.1",
))]
fn sweep(values: &mut Block, coefficients: &[Coefficients; SIDE], descending: bool) -> bool {
    let mut changed = [0u32; SIDE];
    for row in 0..SIDE {
        let row = if descending { SIDE - 1 - row } else { row };
        let k = &coefficients[row];
        let (above, here, below) = (&values[row], &values[row + 1], &values[row + 2]);
        let (old, east, west) = (lanes(here, 1), lanes(here, 2), lanes(here, 0));
        let (south, north) = (lanes(below, 1), lanes(above, 1));
        let (south_east, north_west) = (lanes(below, 2), lanes(above, 0));
        let (north_east, south_west) = (lanes(above, 2), lanes(below, 0));
        let mut new = [0f32; SIDE];
        for i in 0..SIDE {
            let (e, w, s, n) = (east[i], west[i], south[i], north[i]);
            let (se, nw) = (pass(south_east[i], s, e), pass(north_west[i], n, w));
            let (ne, sw) = (pass(north_east[i], n, e), pass(south_west[i], s, w));
            let edges = least(
                least(least(e, w) + k.east[i], least(s, n) + k.south[i]),
                least(least(se, nw) + k.rising[i], least(ne, sw) + k.falling[i]),
            );
            let x = [k.ix[i], k.ex[i], k.bx[i]];
            let y = [k.iy[i], k.ey[i], k.by[i]];
            let across_x = [k.ix[i], k.ex[i], -k.bx[i]];
            let across_y = [k.iy[i], k.ey[i], -k.by[i]];
            let (hx, hy) = (k.hx[i], k.hy[i]);
            let rising = least(
                least(triangle(e, se, k.rx[i], hx, x), triangle(w, nw, k.rx[i], hx, x)),
                least(triangle(s, se, k.ry[i], hy, y), triangle(n, nw, k.ry[i], hy, y)),
            );
            let falling = least(
                least(
                    triangle(e, ne, k.fx[i], -hx, across_x),
                    triangle(w, sw, k.fx[i], -hx, across_x),
                ),
                least(
                    triangle(s, sw, k.fy[i], -hy, across_y),
                    triangle(n, ne, k.fy[i], -hy, across_y),
                ),
            );
            let u = least(least(rising, falling), edges);
            let floor = ROUNDING * u;
            let significant = greatest(k.tolerance[i], floor);
            changed[i] |= u32::from(old[i] - u > significant);
            new[i] = least(u, old[i]);
        }
        values[row + 1][1..=SIDE].copy_from_slice(&new);
    }
    changed.iter().any(|&c| c != 0)
}

/// Four units in the last place of an `f32`: changes below are rounding.
pub(crate) const ROUNDING: f32 = 2.4e-7;
