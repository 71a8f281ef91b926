//! Where values come from, and what the functional needs to know there.

#![allow(clippy::needless_range_loop, reason = "lanes of several arrays go together")]

use multiversion::multiversion;

use super::super::cone::Cones;
use super::super::field::{AREA, SIDE, TensorField};
use super::super::source::Seeds;
use super::super::update::{
    How, Limits, Prepared, RING, Tile, UNREACHED, choose, greatest, lanes, least, pass, prepare,
    prepare_shifts,
};
use super::functional::{minimise, minimise_in_cone};
use super::patch::{Lanes, MARGIN, Patch, WIDE, patch, seen};

/// Where the values of a tile's nodes come from, and what the functional of second order adds there.
#[derive(Clone)]
pub(super) struct Feet {
    /// Index into [`TRIANGLES`]; [`FIXED`] for a node that is not corrected.
    pub(super) triangle: [u8; AREA],
    /// Share of the diagonal neighbour.
    pub(super) theta: [f32; AREA],
    pub(super) rho: [f32; AREA],
    /// Neighbours of the tile that it reads, one bit each as in [`RING`].
    pub(super) reads: u8,
    /// Sum of the directions from the nodes to where their values come from: east, south.
    pub(super) flow: [i32; 2],
}

pub(super) const FIXED: u8 = 8;

/// The triangles around a node: places in [`RING`] of the axis and the diagonal neighbour.
pub(super) const TRIANGLES: [(usize, usize); 8] =
    [(0, 1), (4, 5), (2, 1), (6, 5), (0, 7), (4, 3), (2, 3), (6, 7)];

/// What the feet of a tile are made from.
pub(super) struct Input<'a> {
    pub(super) field: &'a TensorField,
    pub(super) cones: &'a Cones,
    pub(super) values: &'a [[f32; AREA]],
    pub(super) total: &'a [[f32; AREA]],
    pub(super) seeds: &'a [Option<Box<Seeds>>],
}

/// Room to find the feet of a tile.
#[derive(Default)]
pub(super) struct Finder {
    prepared: Prepared,
    line: Line,
}

impl Finder {
    pub(super) fn find(&mut self, input: &Input<'_>, tile: usize, feet: &mut Feet) {
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
        let cone = input.cones.of_tile(tile).map(|cone| (cone, tiling.first(tile)));
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
    pub(super) const NONE: Self = Self {
        triangle: [FIXED; AREA],
        theta: [0.0; AREA],
        rho: [0.0; AREA],
        reads: 0,
        flow: [0; 2],
    };

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
    pub(super) fn transposed(&self) -> Self {
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
pub(super) struct Line {
    pub(super) triangle: [u32; SIDE],
    /// Difference `g(b) − g(a)` as the first-order update reads it, and the foot that follows.
    pub(super) slope: [f32; SIDE],
    pub(super) theta: [f32; SIDE],
    pub(super) rho: [f32; SIDE],
    /// `g + e` at `a`, `b`, `2a − b`, `2b − a` less that at the node; a large value where unreached.
    pub(super) rise: [[f32; SIDE]; 4],
    /// `M` at `a` and `b`: xx, xy, yy; xx is 0 where closed.
    pub(super) metric: [[f32; SIDE]; 6],
    /// `a` and `b − a` from the node.
    pub(super) a: [[f32; SIDE]; 2],
    pub(super) w: [[f32; SIDE]; 2],
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
        let at = (row as i32 + dy + MARGIN as i32) as usize;
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
