//! Second order by deferred correction.
//!
//! The first-order distance `g` tells where each node's value comes from: a point between two neighbours `a` and `b`, its
//! foot. There a functional of second order is evaluated,
//!
//! ```text
//!   F(θ) = (1−θ) w(a) + θ w(b) + g0(x + v) + C(θ) − θ(1−θ) S/2,     v = (1−θ)(a−x) + θ(b−x),
//!   C(θ) = ½ (‖v‖_x + (1−θ) ‖v‖_a + θ ‖v‖_b),
//! ```
//!
//! with the metric by the trapezoidal rule along the step, `w = g − g0` curved between the two by its limited
//! second difference `S`, and the cone `g0` (see [`mod@super::cone`]) exact. What the functional says more than
//! the value itself, `ρ = F − g`, travels with the front: the correction solves the linear equation
//!
//! ```text
//!   e(x) = (1−θ) e(a) + θ e(b) + ρ(x).
//! ```
//!
//! Feet are frozen, so there is nothing that could oscillate: `e` is a sum of `ρ` along feet, and `|S/8| ≤ C/2`. A foot is
//! the least point of its functional, so that an error in it counts only squared. A second round with `g + e` brings
//! most of what is left.

use multiversion::multiversion;
use rayon::prelude::*;

use super::cone::Cones;
use super::crew;
use super::field::{AREA, SIDE, TensorField, Tiling};
use super::source::Seeds;
use super::tiles::{ITSELF, NEIGHBOURS, Queue, WINDOW_CELLS, neighbour};
use super::update::{
    ALL, How, Limits, Lines, Prepared, RING, ROUNDING, Tile, UNREACHED, around, choose, greatest, lanes, least, pass,
    prepare, prepare_shifts, tensors,
};
use crate::{Control, Result};

/// Rounds of correction. The first leaves .3 to 7 % of the first-order error, the second gains up to a factor of 6 at
/// ratios of 100 and more, and further ones little.
const ROUNDS: usize = 2;
/// Newton steps from the first-order foot to that of the functional.
const NEWTON_STEPS: usize = 2;
/// The transport of a round stands still when nothing changes by more than this many mean cells. What the first leaves
/// undone the second sees.
const TOLERANCE_CELLS: [f32; ROUNDS] = [1e-4, 1e-5];
/// Sweeps over a tile before it goes back into the queue, and times it may come back.
const MOST_SWEEPS: usize = 40;
const MOST_ACTIVATIONS: u32 = 40;

/// Corrections of the nodes of each tile, and estimates of the error that is left.
pub(super) struct Correction {
    pub(super) values: Vec<[f32; AREA]>,
    pub(super) errors: Vec<[f32; AREA]>,
}

/// Where the values of a tile's nodes come from, and what the functional of second order adds there.
#[derive(Clone)]
struct Feet {
    /// Index into [`TRIANGLES`]; [`FIXED`] for a node that is not corrected.
    triangle: [u8; AREA],
    /// Share of the diagonal neighbour.
    theta: [f32; AREA],
    rho: [f32; AREA],
    /// Neighbours of the tile that it reads, one bit each as in [`RING`].
    reads: u8,
    /// Sum of the directions from the nodes to where their values come from: east, south.
    flow: [i32; 2],
}

const FIXED: u8 = 8;

/// The triangles around a node: places in [`RING`] of the axis and the diagonal neighbour.
const TRIANGLES: [(usize, usize); 8] =
    [(0, 1), (4, 5), (2, 1), (6, 5), (0, 7), (4, 3), (2, 3), (6, 7)];

/// Nodes around a tile that the functional looks at.
const MARGIN: usize = 2;
const WIDE: usize = SIDE + 2 * MARGIN;
type Patch = [[f32; WIDE]; WIDE];

/// A tile and the nodes around it, `outside` beyond the grid.
fn patch<'a>(
    tiling: &Tiling,
    tile: usize,
    outside: f32,
    values: impl Fn(usize) -> &'a [f32; AREA],
) -> Patch {
    let mut patch = [[outside; WIDE]; WIDE];
    let column = |dy: isize| {
        [-1, 0, 1].map(|dx| Some(values(neighbour(tiling, tile, dx, dy)?).as_chunks::<SIDE>().0))
    };
    let rows = [(-1, SIDE - MARGIN..SIDE, 0), (0, 0..SIDE, MARGIN), (1, 0..MARGIN, MARGIN + SIDE)];
    for (dy, from, to) in rows {
        let [west, middle, east] = column(dy);
        for (row, line) in from.zip(&mut patch[to..]) {
            if let Some(west) = west {
                line[..MARGIN].copy_from_slice(&west[row][SIDE - MARGIN..]);
            }
            if let Some(middle) = middle {
                line[MARGIN..MARGIN + SIDE].copy_from_slice(&middle[row]);
            }
            if let Some(east) = east {
                line[MARGIN + SIDE..].copy_from_slice(&east[row][..MARGIN]);
            }
        }
    }
    patch
}

/// Corrects first-order values; nodes of the start keep theirs.
pub(super) fn correct(
    field: &TensorField,
    cones: &Cones,
    values: &[[f32; AREA]],
    seeds: &[Option<Box<Seeds>>],
    control: &Control,
) -> Result<Correction> {
    let tiles = field.tiling.tiles();
    let mut total = vec![[0f32; AREA]; tiles];
    let mut last = Vec::new();
    let mut feet = vec![Feet::NONE; tiles];
    for tolerance in TOLERANCE_CELLS {
        let input = Input { field, cones, values, total: &total, seeds };
        feet.par_iter_mut().enumerate().try_for_each_init(Bench::default, |bench, (tile, feet)| {
            control.check()?;
            bench.find(&input, tile, feet);
            Ok(())
        })?;
        last = transport(field, values, &feet, tolerance * field.mean_step, control)?;
        total.par_iter_mut().zip(&last).for_each(|(total, last)| {
            total.iter_mut().zip(last).for_each(|(total, last)| *total += last);
        });
    }
    let errors = total.par_iter().zip(&last).zip(values).map(|((total, last), values)| {
        std::array::from_fn(|i| error_left(values[i], total[i], last[i]))
    });
    let errors = errors.collect();
    Ok(Correction { values: total, errors })
}

/// What may be wrong with a corrected value: the last round's change, the share of the correction that is typically
/// left after it, and rounding.
fn error_left(value: f32, total: f32, last: f32) -> f32 {
    const SHARE_LEFT: f32 = 0.1;
    last.abs() + SHARE_LEFT * total.abs() + ROUNDING * value
}

/// What the feet of a tile are made from.
struct Input<'a> {
    field: &'a TensorField,
    cones: &'a Cones,
    values: &'a [[f32; AREA]],
    total: &'a [[f32; AREA]],
    seeds: &'a [Option<Box<Seeds>>],
}

/// Room to find the feet of a tile.
#[derive(Default)]
struct Bench {
    prepared: Prepared,
    line: Line,
}

impl Bench {
    fn find(&mut self, input: &Input<'_>, tile: usize, feet: &mut Feet) {
        let field = input.field;
        let tiling = &field.tiling;
        *feet = Feet::NONE;
        if input.values[tile].iter().all(|&g| g >= UNREACHED) {
            return;
        }
        let g = patch(tiling, tile, f32::INFINITY, |t| &input.values[t]);
        let e = patch(tiling, tile, 0.0, |t| &input.total[t]);
        let mut metric = [
            patch(tiling, tile, 0.0, |t| &field.tiles[t].xx),
            patch(tiling, tile, 0.0, |t| &field.tiles[t].xy),
            patch(tiling, tile, 0.0, |t| &field.tiles[t].det),
        ];
        invert(&mut metric);
        let cone = input.cones.of_tile(tile).map(|(cone, alike)| (cone, alike, tiling.first(tile)));
        let seeds = input.seeds[tile].as_deref();
        let this = Tile { tensors: &field.tiles[tile], cone, tolerance: 0.0, seeds };
        for row in 0..SIDE {
            find_triangles(&this, &mut self.prepared, &g, &e, row, &mut self.line);
            gather(&g, &e, &metric, row, &mut self.line);
            let shifts = &self.prepared.shifts[row];
            if cone.is_some() {
                minimise_in_cone(&this, row, shifts, &mut self.line);
            } else {
                minimise(&this, row, shifts, &mut self.line);
            }
            let places = row * SIDE..(row + 1) * SIDE;
            feet.theta[places.clone()].copy_from_slice(&self.line.theta);
            feet.rho[places.clone()].copy_from_slice(&self.line.rho);
            for (triangle, from) in feet.triangle[places].iter_mut().zip(self.line.triangle) {
                *triangle = from as u8;
            }
        }
        for place in 0..AREA {
            let seeded = seeds.is_some_and(|seeds| seeds[place] < UNREACHED);
            if seeded || input.values[tile][place] >= UNREACHED {
                (feet.triangle[place], feet.theta[place], feet.rho[place]) = (FIXED, 0.0, 0.0);
            }
        }
        feet.find_reads();
        feet.find_flow();
    }
}

impl Feet {
    const NONE: Self =
        Self { triangle: [FIXED; AREA], theta: [0.0; AREA], rho: [0.0; AREA], reads: 0, flow: [0; 2] };

    fn find_flow(&mut self) {
        for (&triangle, &theta) in self.triangle.iter().zip(&self.theta) {
            if triangle != FIXED {
                let (a, b) = TRIANGLES[triangle as usize];
                let (dx, dy) = RING[if theta < 0.5 { a } else { b }];
                self.flow[0] += dx;
                self.flow[1] += dy;
            }
        }
    }

    /// The tile mirrored on its diagonal.
    fn transposed(&self) -> Self {
        /// What becomes of [`TRIANGLES`].
        const MIRRORED: [u8; 9] = [2, 3, 0, 1, 6, 7, 4, 5, FIXED];
        let [east, south] = self.flow;
        let mut turned = Self { flow: [south, east], ..Self::NONE };
        for row in 0..SIDE {
            for col in 0..SIDE {
                let (from, to) = (row * SIDE + col, col * SIDE + row);
                turned.triangle[to] = MIRRORED[self.triangle[from] as usize];
                turned.theta[to] = self.theta[from];
                turned.rho[to] = self.rho[from];
            }
        }
        turned
    }

    fn find_reads(&mut self) {
        const LAST: usize = SIDE - 1;
        for place in 0..AREA {
            let (row, col) = (place / SIDE, place % SIDE);
            let inside = (1..LAST).contains(&row) && (1..LAST).contains(&col);
            if !inside && self.triangle[place] != FIXED {
                let (a, b) = TRIANGLES[self.triangle[place] as usize];
                self.reads |= outside(col, row, a, 1.0 - self.theta[place]);
                self.reads |= outside(col, row, b, self.theta[place]);
            }
        }
    }
}

/// The neighbouring tile, if any, that holds the ring's place `k` of a node, as a bit.
fn outside(col: usize, row: usize, k: usize, weight: f32) -> u8 {
    /// Bits of the places in [`RING`], by row and column from −1.
    const BITS: [[u8; 3]; 3] = [[1 << 5, 1 << 6, 1 << 7], [1 << 4, 0, 1], [1 << 3, 1 << 2, 1 << 1]];
    let side = |at: usize, by: i32| (at as i32 + by + SIDE as i32) as usize / SIDE;
    if weight > 0.0 { BITS[side(row, RING[k].1)][side(col, RING[k].0)] } else { 0 }
}

/// Intermediate results of a line of a tile.
#[derive(Default)]
struct Line {
    triangle: [u32; SIDE],
    /// Difference `g(b) − g(a)` as the first-order update reads it, and the foot that follows.
    slope: [f32; SIDE],
    theta: [f32; SIDE],
    rho: [f32; SIDE],
    /// `g + e` at `a`, `b`, `2a − b`, `2b − a` less that at the node; a large value where unreached.
    rise: [[f32; SIDE]; 4],
    /// `M` at `a` and `b`: xx, xy, yy; xx is 0 where closed.
    metric: [[f32; SIDE]; 6],
    /// `a` and `b − a` from the node.
    a: [[f32; SIDE]; 2],
    w: [[f32; SIDE]; 2],
}

/// The triangle that gives each node of a line its first-order value.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl",
    "x86_64+avx2",
    "x86_64+sse4.1",
))]
fn find_triangles(
    tile: &Tile<'_>,
    prepared: &mut Prepared,
    g: &Patch,
    e: &Patch,
    row: usize,
    line: &mut Line,
) {
    let how = How { by_columns: false, descending: false };
    let mut limits = Limits::default();
    prepare(tile, row, how, &mut prepared.lines[row], &mut limits);
    prepared.shifts[row] = [[0.0; SIDE]; 8];
    if tile.cone.is_some() {
        prepare_shifts(tile, row, how, &mut prepared.shifts[row], &mut limits);
    }
    let k = &prepared.lines[row];
    let mut ring = [[0f32; SIDE]; 8];
    for (n, ring) in ring.iter_mut().enumerate() {
        let (dx, dy) = RING[n];
        let at = (row as i32 + dy) as usize + MARGIN;
        let from = (dx + MARGIN as i32) as usize;
        let (g, e) = (lanes(&g[at], from), lanes(&e[at], from));
        for i in 0..SIDE {
            ring[i] = g[i] + (e[i] + prepared.shifts[row][n][i]);
        }
    }
    for n in [1, 3, 5, 7] {
        for i in 0..SIDE {
            ring[n][i] = pass(ring[n][i], ring[n - 1][i], ring[(n + 1) % 8][i]);
        }
    }
    let mut best = Best { value: [f32::INFINITY; SIDE], ..Best::default() };
    let [e, se, s, sw, w, nw, n, ne] = &ring;
    let (hx, hy, bx, by) = (negated(&k.hx), negated(&k.hy), negated(&k.bx), negated(&k.by));
    let x = (&k.rx, &k.hx, &k.ix, &k.ex, &k.bx, &k.rising);
    let y = (&k.ry, &k.hy, &k.iy, &k.ey, &k.by, &k.rising);
    let across_x = (&k.fx, &hx, &k.ix, &k.ex, &bx, &k.falling);
    let across_y = (&k.fy, &hy, &k.iy, &k.ey, &by, &k.falling);
    best.offer(0, e, se, x);
    best.offer(1, w, nw, x);
    best.offer(2, s, se, y);
    best.offer(3, n, nw, y);
    best.offer(4, e, ne, across_x);
    best.offer(5, w, sw, across_x);
    best.offer(6, s, sw, across_y);
    best.offer(7, n, ne, across_y);
    line.triangle = best.triangle;
    line.slope = best.slope;
}

type Lanes = [f32; SIDE];

#[inline(always)]
fn negated(lanes: &Lanes) -> Lanes {
    let mut negated = *lanes;
    for lane in &mut negated {
        *lane = -*lane;
    }
    negated
}

/// The best triangle so far of each node.
#[derive(Default)]
struct Best {
    value: Lanes,
    slope: Lanes,
    triangle: [u32; SIDE],
}

impl Best {
    /// The triangle `t` between `a` and `b`, with `lo`, `hi`, `1/s`, `det D/s²`, `β/s` and the length of the step to `b`.
    #[inline(always)]
    fn offer(
        &mut self,
        t: u32,
        a: &Lanes,
        b: &Lanes,
        (lo, hi, ix, ex, beta, length): (&Lanes, &Lanes, &Lanes, &Lanes, &Lanes, &Lanes),
    ) {
        for i in 0..SIDE {
            let d = b[i] - a[i];
            let c = greatest(least(d, hi[i]), lo[i]);
            let between = a[i] + (beta[i] * c + greatest(ix[i] - ex[i] * (c * c), 0.0).sqrt());
            let value = choose(d < lo[i], b[i] + length[i], between);
            let better = value < self.value[i];
            self.value[i] = choose(better, value, self.value[i]);
            self.slope[i] = choose(better, d, self.slope[i]);
            self.triangle[i] = if better { t } else { self.triangle[i] };
        }
    }
}

/// `M = D⁻¹` as xx, xy, yy from `D` as xx, xy, det; xx is 0 where closed.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl",
    "x86_64+avx2",
    "x86_64+sse4.1",
))]
fn invert(d: &mut [Patch; 3]) {
    let [xx, xy, det] = d;
    for row in 0..WIDE {
        for i in 0..WIDE {
            let (dxx, dxy, ddet) = (xx[row][i], xy[row][i], det[row][i]);
            let (open, idet) = (ddet > 0.0, 1.0 / ddet);
            xx[row][i] = choose(open, (ddet + dxy * dxy) / dxx * idet, 0.0);
            xy[row][i] = choose(open, -dxy * idet, 0.0);
            det[row][i] = choose(open, dxx * idet, 0.0);
        }
    }
}

/// A line of a patch, seen `(dx, dy)` from the nodes of a row.
#[inline(always)]
fn seen(patch: &Patch, row: usize, dx: i32, dy: i32) -> Lanes {
    lanes(&patch[(row as i32 + dy) as usize + MARGIN], (dx + MARGIN as i32) as usize)
}

/// How much higher than the nodes of a row those at `(dx, dy)` from them are.
#[inline(always)]
fn rise(g: &Patch, e: &Patch, row: usize, dx: i32, dy: i32) -> Lanes {
    let (g0, e0) = (seen(g, row, 0, 0), seen(e, row, 0, 0));
    let (g1, e1) = (seen(g, row, dx, dy), seen(e, row, dx, dy));
    let mut rise = [0f32; SIDE];
    for i in 0..SIDE {
        rise[i] = (g1[i] - g0[i]) + (e1[i] - e0[i]);
    }
    rise
}

/// What the functional needs from around each node's foot.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl",
    "x86_64+avx2",
    "x86_64+sse4.1",
))]
fn gather(g: &Patch, e: &Patch, metric: &[Patch; 3], row: usize, line: &mut Line) {
    let triangle = line.triangle;
    let (mut rises, mut metrics) = ([[0f32; SIDE]; 4], [[0f32; SIDE]; 6]);
    let (mut a, mut w) = ([[0f32; SIDE]; 2], [[0f32; SIDE]; 2]);
    for t in 0..8 {
        let (axis, diagonal) = TRIANGLES[t];
        let ((ax, ay), (bx, by)) = (RING[axis], RING[diagonal]);
        let (wx, wy) = (bx - ax, by - ay);
        blend(t, triangle, rise(g, e, row, ax, ay), &mut rises[0]);
        blend(t, triangle, rise(g, e, row, bx, by), &mut rises[1]);
        blend(t, triangle, rise(g, e, row, ax - wx, ay - wy), &mut rises[2]);
        blend(t, triangle, rise(g, e, row, bx + wx, by + wy), &mut rises[3]);
        for n in 0..3 {
            blend(t, triangle, seen(&metric[n], row, ax, ay), &mut metrics[n]);
            blend(t, triangle, seen(&metric[n], row, bx, by), &mut metrics[3 + n]);
        }
        blend(t, triangle, [ax as f32; SIDE], &mut a[0]);
        blend(t, triangle, [ay as f32; SIDE], &mut a[1]);
        blend(t, triangle, [wx as f32; SIDE], &mut w[0]);
        blend(t, triangle, [wy as f32; SIDE], &mut w[1]);
    }
    line.rise = rises;
    line.metric = metrics;
    line.a = a;
    line.w = w;
}

/// Takes the lanes of triangle `t`.
#[inline(always)]
fn blend(t: usize, triangle: [u32; SIDE], from: Lanes, to: &mut Lanes) {
    let (old, mut new) = (*to, [0f32; SIDE]);
    for i in 0..SIDE {
        new[i] = choose(triangle[i] == t as u32, from[i], old[i]);
    }
    *to = new;
}

/// `vᵀMv` along a segment, `α + 2βθ + γθ²`.
#[derive(Clone, Copy)]
struct Quadratic(f32, f32, f32);

impl Quadratic {
    #[inline(always)]
    fn new([xx, xy, yy]: [f32; 3], [ax, ay]: [f32; 2], [wx, wy]: [f32; 2]) -> Self {
        let (mx, my) = (xx * ax + xy * ay, xy * ax + yy * ay);
        Self(mx * ax + my * ay, mx * wx + my * wy, xx * wx * wx + 2.0 * xy * wx * wy + yy * wy * wy)
    }

    #[inline(always)]
    fn root(self, t: f32) -> f32 {
        greatest(self.0 + t * (2.0 * self.1 + t * self.2), 0.0).sqrt()
    }

    /// The root and its first two derivatives, to five digits: they only lead to the foot, whose error counts squared.
    #[inline(always)]
    fn jet(self, t: f32) -> [f32; 3] {
        let square = greatest(self.0 + t * (2.0 * self.1 + t * self.2), 1e-12);
        let inverse = inverse_root(square);
        let first = (self.1 + t * self.2) * inverse;
        [square * inverse, first, (self.2 - first * first) * inverse]
    }
}

/// `1/√x` to five digits, from the bits of `x` and two Newton steps; a fraction of the time of a root and a division, and
/// the same on every machine.
#[inline(always)]
fn inverse_root(x: f32) -> f32 {
    let mut y = f32::from_bits(0x5f37_59df - (x.to_bits() >> 1));
    for _ in 0..2 {
        y *= 1.5 - 0.5 * x * y * y;
    }
    y
}

/// Finds the foot and the value of the functional for each node of a line.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl",
    "x86_64+avx2",
    "x86_64+sse4.1",
))]
fn minimise(tile: &Tile<'_>, row: usize, shifts: &[Lanes; 8], line: &mut Line) {
    minimise_line::<false>(tile, row, shifts, line);
}

/// The same in a tile that lies in a cone.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl",
    "x86_64+avx2",
    "x86_64+sse4.1",
))]
fn minimise_in_cone(tile: &Tile<'_>, row: usize, shifts: &[Lanes; 8], line: &mut Line) {
    minimise_line::<true>(tile, row, shifts, line);
}

#[inline(always)]
fn minimise_line<const IN_CONE: bool>(
    tile: &Tile<'_>,
    row: usize,
    shifts: &[Lanes; 8],
    line: &mut Line,
) {
    let how = How { by_columns: false, descending: false };
    let [dxx, dxy, ddet] = tensors(tile, row, how);
    let (m0, from) = match tile.cone {
        Some((cone, _, first)) => (
            [cone.metric.xx as f32, cone.metric.xy as f32, cone.metric.yy as f32],
            [(first.x - cone.at.x) as f32, (first.y + row as f64 - cone.at.y) as f32],
        ),
        None => ([1.0, 0.0, 1.0], [1.0, 0.0]),
    };
    // Where the cone is taken out some shift is negative.
    let mut on = [0f32; SIDE];
    for shift in shifts {
        for i in 0..SIDE {
            on[i] = choose(shift[i] < 0.0, 1.0, on[i]);
        }
    }
    let [ra, rb, rc, rd] = line.rise;
    let [axx, axy, ayy, bxx, bxy, byy] = line.metric;
    let ([ax, ay], [wx, wy]) = (line.a, line.w);
    let slopes = line.slope;
    let (mut theta, mut rho) = ([0f32; SIDE], [0f32; SIDE]);
    for i in 0..SIDE {
        let idet = 1.0 / ddet[i];
        let dyy = (ddet[i] + dxy[i] * dxy[i]) / dxx[i];
        let m = [dyy * idet, -dxy[i] * idet, dxx[i] * idet];
        let local = Local {
            a: [ax[i], ay[i]],
            w: [wx[i], wy[i]],
            m,
            at_a: choose3(axx[i] > 0.0, [axx[i], axy[i], ayy[i]], m),
            at_b: choose3(bxx[i] > 0.0, [bxx[i], bxy[i], byy[i]], m),
            cone: ConeAt::new(on[i], m0, [from[0] + i as f32, from[1]]),
        };
        (theta[i], rho[i]) = local.minimise::<IN_CONE>([ra[i], rb[i], rc[i], rd[i]], slopes[i]);
    }
    line.theta = theta;
    line.rho = rho;
}

/// The cone seen from a node at `v` from its point, times `on`.
#[derive(Clone, Copy)]
struct ConeAt {
    on: f32,
    m0: [f32; 3],
    v: [f32; 2],
    mv: [f32; 2],
    g2: f32,
    g: f32,
}

impl ConeAt {
    #[inline(always)]
    fn new(on: f32, m0: [f32; 3], v: [f32; 2]) -> Self {
        let mv = [m0[0] * v[0] + m0[1] * v[1], m0[1] * v[0] + m0[2] * v[1]];
        let g2 = greatest(mv[0] * v[0] + mv[1] * v[1], 1e-12);
        Self { on, m0, v, mv, g2, g: g2.sqrt() }
    }

    /// `g0(x + by) − g0(x)`.
    #[inline(always)]
    fn rise(&self, x: f32, y: f32) -> f32 {
        let a = self.mv[0] * x + self.mv[1] * y;
        let b = self.m0[0] * (x * x) + 2.0 * self.m0[1] * (x * y) + self.m0[2] * (y * y);
        let more = 2.0 * a + b;
        self.on * more / (self.g + greatest(self.g2 + more, 0.0).sqrt())
    }
}

/// What a node's functional is made of: the neighbour `a` from the node, `w = b − a`, `M` at the three, and the cone.
#[derive(Clone, Copy)]
struct Local {
    a: [f32; 2],
    w: [f32; 2],
    m: [f32; 3],
    at_a: [f32; 3],
    at_b: [f32; 3],
    cone: ConeAt,
}

impl Local {
    /// `θ` and `ρ`, from how much `a`, `b`, `a − w` and `b + w` are above the node, and the first-order slope.
    #[inline(always)]
    fn minimise<const IN_CONE: bool>(self, [ra, rb, rc, rd]: [f32; 4], slope: f32) -> (f32, f32) {
        let Self { a, w, m, at_a, at_b, cone } = self;
        let (mut wa, mut wb, mut wc, mut wd) = (ra, rb, rc, rd);
        if IN_CONE {
            wa -= cone.rise(a[0], a[1]);
            wb -= cone.rise(a[0] + w[0], a[1] + w[1]);
            wc -= cone.rise(a[0] - w[0], a[1] - w[1]);
            wd -= cone.rise(a[0] + 2.0 * w[0], a[1] + 2.0 * w[1]);
        }
        let (has_a, has_b) = (ra < 1e17, rb < 1e17);
        let free = has_a & has_b;
        let curvature = choose(free, curvature(wa, wb, wc, wd, rc < 1e17, rd < 1e17), 0.0);
        // Between a node and a wall there is only the node.
        let lo = choose(has_a, 0.0, 1.0);
        let hi = choose(has_b, 1.0, lo);
        let base = choose(has_a, wa, wb);
        let rise = choose(free, wb - wa, 0.0);

        let here = Quadratic::new(m, a, w);
        let (ca, cb) = (Quadratic::new(at_a, a, w), Quadratic::new(at_b, a, w));
        let far = Quadratic::new(cone.m0, [cone.v[0] + a[0], cone.v[1] + a[1]], w);

        // The first-order foot, see `segment`.
        let d = choose(free, slope, 0.0);
        let middle = here.1 / here.2;
        let across = greatest(here.0 - here.1 * middle, 0.0);
        let steep = here.2 * greatest(here.2 - d * d, 1e-12 * here.2);
        let phi = -d * across * inverse_root(greatest(across * steep, 1e-30));
        let mut t = greatest(lo, least(hi, phi - middle));
        for _ in 0..NEWTON_STEPS {
            let [_, p0, h0] = here.jet(t);
            let [va, pa, ha] = ca.jet(t);
            let [vb, pb, hb] = cb.jet(t);
            let (mut pc, mut hc) = (0.0, 0.0);
            if IN_CONE {
                let [_, first, second] = far.jet(t);
                (pc, hc) = (cone.on * first, cone.on * second);
            }
            let first = pc + rise - 0.5 * (1.0 - 2.0 * t) * curvature
                + 0.5 * (p0 + pa + t * (pb - pa) + vb - va);
            let second =
                hc + curvature + 0.5 * (h0 + ha + t * (hb - ha) + 2.0 * (pb - pa));
            let step = choose(second > 1e-6, first / second, 0.0);
            t = greatest(lo, least(hi, t - greatest(-0.3, least(0.3, step))));
        }
        let length = 0.5 * (here.root(t) + (1.0 - t) * ca.root(t) + t * cb.root(t));
        let bend = greatest(-0.5 * length, least(0.5 * length, 0.5 * t * (1.0 - t) * curvature));
        let mut rho = base + t * rise + length - bend;
        if IN_CONE {
            rho += cone.rise(a[0] + t * w[0], a[1] + t * w[1]);
        }
        (t, rho)
    }
}

/// Second difference along the ring at the segment between `a` and `b`: the mean of those at both, limited (MC) so that
/// a kink does not bend what is straight.
#[inline(always)]
fn curvature(a: f32, b: f32, before: f32, after: f32, has_before: bool, has_after: bool) -> f32 {
    let (at_a, at_b) = (b - 2.0 * a + before, after - 2.0 * b + a);
    let size = least(0.5 * (at_a + at_b).abs(), 2.0 * least(at_a.abs(), at_b.abs()));
    let limited = choose(at_a * at_b > 0.0, choose(at_a > 0.0, size, -size), 0.0);
    let single = choose(has_before, at_a, choose(has_after, at_b, 0.0));
    choose(has_before & has_after, limited, single)
}

#[inline(always)]
fn choose3(yes: bool, a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [choose(yes, a[0], b[0]), choose(yes, a[1], b[1]), choose(yes, a[2], b[2])]
}

/// What the transport shares between rounds.
struct Shared {
    e: Vec<[f32; AREA]>,
    queue: Queue,
    taken: Vec<u32>,
}

#[derive(Default)]
struct Outcome {
    e: Option<Box<[f32; AREA]>>,
    settled: bool,
    changed: bool,
}

/// Solves `e = (1−θ) e(a) + θ e(b) + ρ`, tiles in the order of their least distance.
fn transport(
    field: &TensorField,
    values: &[[f32; AREA]],
    feet: &[Feet],
    tolerance: f32,
    control: &Control,
) -> Result<Vec<[f32; AREA]>> {
    let tiling = field.tiling;
    let tiles = tiling.tiles();
    let least = |tile: &[f32; AREA]| tile.iter().copied().fold(f32::INFINITY, f32::min);
    let keys: Vec<f32> = values.par_iter().map(least).collect();
    let mut order: Vec<u32> = (0..tiles as u32).filter(|&t| keys[t as usize] < UNREACHED).collect();
    order.sort_unstable_by(|&a, &b| keys[a as usize].total_cmp(&keys[b as usize]).then(a.cmp(&b)));
    let mut order = order.into_iter().peekable();
    let mut activations = vec![0u32; tiles];
    let mut round = 0;
    let shared =
        Shared { e: vec![[0.0; AREA]; tiles], queue: Queue::new(tiles), taken: Vec::new() };
    let work = |_: &mut (), shared: &Shared, index: usize, outcome: &mut Outcome| {
        let tile = shared.taken[index] as usize;
        carry(&tiling, &feet[tile], &shared.e, tile, tolerance, outcome);
    };
    let lead = |shared: &mut Shared, outcomes: &mut dyn Iterator<Item = &Outcome>| {
        control.check()?;
        let Shared { e, queue, taken } = shared;
        for (&tile, outcome) in taken.iter().zip(outcomes) {
            let tile = tile as usize;
            activations[tile] += 1;
            if let Some(new) = &outcome.e {
                e[tile] = **new;
            }
            let mut wake = |tile: usize| {
                if activations[tile] < MOST_ACTIVATIONS {
                    queue.wake(tile, keys[tile], ITSELF);
                }
            };
            if !outcome.settled {
                wake(tile);
            }
            if outcome.changed {
                for (side, (dx, dy)) in NEIGHBOURS.into_iter().enumerate() {
                    if let Some(n) = neighbour(&tiling, tile, dx, dy)
                        && feet[n].reads & 1 << ((side + 4) % 8) != 0
                    {
                        wake(n);
                    }
                }
            }
        }
        taken.clear();
        let next = order.peek().map_or(f32::INFINITY, |&tile| keys[tile as usize]);
        let limit = queue.least_key().min(next) + WINDOW_CELLS * field.mean_step;
        while let Some(tile) = order.next_if(|&tile| keys[tile as usize] <= limit) {
            queue.wake(tile as usize, keys[tile as usize], ITSELF);
        }
        if limit.is_finite() {
            round += 1;
            queue.take(&tiling, limit, round, taken);
        }
        Ok(taken.len())
    };
    Ok(crew::run(shared, lead, work)?.e)
}

/// Sweeps the correction through a tile until it stands still.
fn carry(
    tiling: &Tiling,
    feet: &Feet,
    e: &[[f32; AREA]],
    tile: usize,
    tolerance: f32,
    outcome: &mut Outcome,
) {
    let mut block = patch(tiling, tile, 0.0, |t| &e[t]);
    // By columns where most comes along the rows, and against the direction it comes from.
    let turned = (feet.flow[0].abs() > feet.flow[1].abs()).then(|| feet.transposed());
    let feet = turned.as_ref().unwrap_or(feet);
    if turned.is_some() {
        transpose(&mut block);
    }
    let weights = weights(feet);
    let mut descending = feet.flow[1] > 0;
    let mut sweeps = 0;
    let mut dirty = ALL;
    outcome.changed = false;
    while dirty != 0 && sweeps < MOST_SWEEPS {
        dirty = carry_once(&mut block, &weights, &feet.rho, tolerance, descending, dirty);
        outcome.changed |= dirty != 0;
        descending = !descending;
        sweeps += 1;
    }
    outcome.settled = dirty == 0;
    if turned.is_some() {
        transpose(&mut block);
    }
    let new = outcome.e.get_or_insert_with(|| Box::new([0.0; AREA]));
    for (row, line) in new.chunks_exact_mut(SIDE).enumerate() {
        line.copy_from_slice(&block[row + MARGIN][MARGIN..MARGIN + SIDE]);
    }
}

fn transpose(block: &mut Patch) {
    for row in 0..WIDE {
        for col in 0..row {
            let value = block[row][col];
            block[row][col] = block[col][row];
            block[col][row] = value;
        }
    }
}

/// Weights of the ring in each node's value, by rows.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl",
    "x86_64+avx2",
    "x86_64+sse4.1",
))]
fn weights(feet: &Feet) -> [[Lanes; 8]; SIDE] {
    let mut weights = [[[0f32; SIDE]; 8]; SIDE];
    for (row, weights) in weights.iter_mut().enumerate() {
        let theta = lanes(&feet.theta, row * SIDE);
        let mut triangle = [0u8; SIDE];
        triangle.copy_from_slice(&feet.triangle[row * SIDE..(row + 1) * SIDE]);
        for t in 0..8 {
            let (a, b) = TRIANGLES[t];
            for i in 0..SIDE {
                let here = triangle[i] == t as u8;
                weights[a][i] += choose(here, 1.0 - theta[i], 0.0);
                weights[b][i] += choose(here, theta[i], 0.0);
            }
        }
    }
    weights
}

/// One sweep over the rows in `dirty`; the rows next to which something changed by more than `tolerance`.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl",
    "x86_64+avx2",
    "x86_64+sse4.1",
))]
fn carry_once(
    block: &mut Patch,
    weights: &[[[f32; SIDE]; 8]; SIDE],
    rho: &[f32; AREA],
    tolerance: f32,
    descending: bool,
    mut dirty: Lines,
) -> Lines {
    for step in 0..SIDE {
        let row = if descending { SIDE - 1 - step } else { step };
        if dirty & 1 << row == 0 {
            continue;
        }
        dirty &= !(1 << row);
        let mut new = lanes(rho, row * SIDE);
        for n in 0..8 {
            let (dx, dy) = RING[n];
            let e = seen(block, row, dx, dy);
            for i in 0..SIDE {
                new[i] += weights[row][n][i] * e[i];
            }
        }
        let old = seen(block, row, 0, 0);
        let mut changed = 0;
        for i in 0..SIDE {
            changed |= u32::from((new[i] - old[i]).abs() > tolerance);
        }
        block[row + MARGIN][MARGIN..MARGIN + SIDE].copy_from_slice(&new);
        if changed != 0 {
            dirty |= around(row);
        }
    }
    dirty
}
