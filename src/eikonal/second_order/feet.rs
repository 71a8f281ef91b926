//! Feet: where values come from, and the defect of the functional there.

#![allow(clippy::needless_range_loop, reason = "lanes of several arrays go together")]

use super::first_order::FirstOrder;
use super::functional::{FactorAt, Functional};
use super::halo::{BatchBlock, MARGIN, WIDTH, at_offset, fill, rings_of};
use super::triangle::LaneTriangle;
use crate::eikonal::stencil::UNREACHED;
use crate::eikonal::stencil::ring::{RING, ring_of, rings};
use crate::eikonal::tile::Tile;
use crate::eikonal::tile::coefficients::{
    CellLanes, CellLimits, CellLine, LaneLimits, LineCosts, block_line, cell_tensors,
    factoring_terms, line_costs, line_tensors,
};
use crate::eikonal::tile::transpose::transpose;
use crate::grid::tiling::{AREA, SIDE};
use crate::linalg::lanes::{Lanes, choose_bits as choose, lanes};
use crate::linalg::simd::{self, Kernel};

/// The feet of a tile's nodes, that is where their values come from, and the defects `ρ` there; stored row by row or, where
/// `by_columns`, column by column.
#[derive(Clone)]
pub(super) struct Feet {
    /// The bits of a [`LaneTriangle`], and above them the share `θ` of the diagonal neighbour in units of `1/`[`SHARES`]. Transport
    /// reads all feet of a grid, more than the caches hold: unpacked, it took longer.
    packed: [u16; AREA],
    pub(super) defect: [f32; AREA],
    /// Whether most values come from along the rows (transport then sweeps column by column), and whether sweeps begin at the last line.
    pub(super) by_columns: bool,
    pub(super) descending: bool,
    /// Which lines each line reads: [`BEFORE`], [`ITSELF`] and [`BEHIND`].
    pub(super) reads: [u8; SIDE],
    pub(super) roughness: Roughness,
}

/// How rough the ground is for a functional of second order.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Roughness {
    /// Nodes at which the defect was put aside.
    pub(super) nodes: u32,
    /// Sums of the defects put aside and of the lengths of all steps.
    pub(super) rejected: f32,
    pub(super) lengths: f32,
}

/// Largest share in twelve bits: the second round corrects the rounding of the first, and carries little itself.
const SHARES: f32 = 4095.0;

/// Bits of the lines that a line reads: the one before it, itself, the one behind.
pub(super) const BEFORE: u32 = 1;
pub(super) const ITSELF: u32 = 2;
pub(super) const BEHIND: u32 = 4;

/// What the feet of a tile are found from.
pub(super) struct Input<'a> {
    pub(super) solution: &'a FirstOrder<'a>,
    /// Sum of the corrections of the rounds before; `None` in the first.
    pub(super) total: Option<&'a [[f32; AREA]]>,
}

/// What finding the feet of a batch reads, on the batch and its halo.
pub(super) struct Surroundings {
    g: BatchBlock,
    e: BatchBlock,
    /// `M` at the nodes as xx, xy, yy; 0 where closed.
    metric: [BatchBlock; 3],
}

impl Default for Surroundings {
    fn default() -> Self {
        let batch = [[0.0; WIDTH]; SIDE + 2 * MARGIN];
        Self { g: batch, e: batch, metric: [batch; 3] }
    }
}

impl Surroundings {
    /// Finds the feet of a batch, the tile `first` and those after it, given those of the round before; and the neighbours
    /// that each tile reads, one bit each as in [`RING`].
    pub(super) fn find(
        &mut self,
        input: &Input<'_>,
        first: usize,
        feet: &mut [Feet],
        reads: &mut [u8],
    ) {
        let &FirstOrder { field, factors, values, seeds } = input.solution;
        let tiling = &field.tiling;
        let reached = |tile: usize| values.tile(tile).iter().any(|&g| g < UNREACHED);
        let tiles = feet.len();
        if !(first..first + tiles).any(reached) {
            feet.fill(Feet::NONE);
            return reads.fill(0);
        }
        let part = (first, tiles);
        fill(&mut self.g, tiling, part, f32::INFINITY, |t| values.tile(t));
        match input.total {
            Some(total) => fill(&mut self.e, tiling, part, 0.0, |t| &total[t][..]),
            None => self.e.as_flattened_mut().fill(0.0),
        }
        let [xx, xy, yy] = &mut self.metric;
        fill(xx, tiling, part, 0.0, |t| &field.tensors(t).xx[..]);
        fill(xy, tiling, part, 0.0, |t| &field.tensors(t).xy[..]);
        fill(yy, tiling, part, 0.0, |t| &field.tensors(t).det[..]);
        simd::dispatch(Invert { metric: &mut self.metric });
        let again = input.total.is_some();
        for (k, (feet, reads)) in feet.iter_mut().zip(reads).enumerate() {
            let (tile, from) = (first + k, k * SIDE);
            let size = tiling.size(tile);
            let factor = factors.of_tile(tile).map(|factor| (factor, tiling.first(tile)));
            let seeds = seeds[tile].as_deref();
            let tile = Tile { prices: field.prices(tile), factor, tolerance: 0.0, seeds };
            let around = &*self;
            *reads = match (tile.prices.weights.is_some(), factor.is_some()) {
                (true, _) => Input::find::<4, true>(around, from, tile, size, feet, again),
                (false, true) => Input::find::<1, true>(around, from, tile, size, feet, again),
                (false, false) => Input::find::<1, false>(around, from, tile, size, feet, again),
            };
        }
    }
}

impl Feet {
    pub(super) const NONE: Self = Self {
        packed: [LaneTriangle::NONE as u16; AREA],
        defect: [0.0; AREA],
        by_columns: false,
        descending: false,
        reads: [0; SIDE],
        roughness: Roughness { nodes: 0, rejected: 0.0, lengths: 0.0 },
    };

    /// The feet of a line.
    #[inline(always)]
    pub(super) fn line(&self, line: usize) -> Line {
        let place = line * SIDE;
        let (mut triangle, mut theta) = ([0; SIDE], [0.0; SIDE]);
        for i in 0..SIDE {
            let bits = u32::from(self.packed[place + i]);
            triangle[i] = bits & LaneTriangle::ALL;
            theta[i] = (bits >> LaneTriangle::BITS) as f32 * (1.0 / SHARES);
        }
        Line { triangle, theta, defect: lanes(&self.defect, place), ..Line::UNKNOWN }
    }

    #[inline(always)]
    fn set_line(&mut self, row: usize, line: &Line) {
        let places = row * SIDE..(row + 1) * SIDE;
        self.defect[places.clone()].copy_from_slice(&line.defect);
        let mut packed = [0; SIDE];
        for i in 0..SIDE {
            // The last bits of an `f32` from 2²³ on are its units: this rounds, while `as` would saturate, which is not vectorised.
            let share = (line.theta[i] * SHARES + 8_388_608.0).to_bits() & 0xfff;
            packed[i] = (share << LaneTriangle::BITS | line.triangle[i]) as u16;
        }
        self.packed[places].copy_from_slice(&packed);
    }

    /// Transposes the tile.
    #[inline(always)]
    fn transpose(&mut self) {
        for row in 0..SIDE {
            for col in 0..row {
                self.packed.swap(row * SIDE + col, col * SIDE + row);
            }
        }
        transpose(self.defect.as_chunks_mut::<SIDE>().0, 0);
        for bits in &mut self.packed {
            *bits ^= LaneTriangle::ALONG_Y as u16;
        }
    }
}

/// Makes `M = D⁻¹` as xx, xy, yy, 0 where closed, from `D` as xx, xy, det.
struct Invert<'a> {
    metric: &'a mut [BatchBlock; 3],
}

impl Kernel for Invert<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let [xx, xy, yy] = self.metric;
        for row in MARGIN - 1..SIDE + MARGIN + 1 {
            for i in 0..WIDTH {
                let (dxx, dxy, ddet) = (xx[row][i], xy[row][i], yy[row][i]);
                let (open, inverse) = (ddet > 0.0, 1.0 / (dxx * ddet));
                let idet = dxx * inverse;
                xx[row][i] = choose(open, (ddet + dxy * dxy) * inverse, 0.0);
                xy[row][i] = choose(open, -dxy * idet, 0.0);
                yy[row][i] = choose(open, dxx * idet, 0.0);
            }
        }
    }
}

impl Input<'_> {
    /// Finds the feet of a tile with the kernel for its equation.
    fn find<const T: usize, const IS_FACTORED: bool>(
        around: &Surroundings,
        from: usize,
        tile: Tile<'_>,
        size: [usize; 2],
        feet: &mut Feet,
        again: bool,
    ) -> u8 {
        if again {
            simd::dispatch(Find::<T, IS_FACTORED, true> { around, from, tile, size, feet })
        } else {
            simd::dispatch(Find::<T, IS_FACTORED, false> { around, from, tile, size, feet })
        }
    }
}

/// The cells of a line: the coefficients of the update, and `M` as xx, xy, yy, which is 0 beyond the grid.
struct Cells<const T: usize> {
    update: CellLine<T>,
    metric: [CellLanes; 3],
}

impl<const T: usize> Cells<T> {
    #[inline(always)]
    fn new(tile: &Tile<'_>, line: usize) -> Self {
        let mut update = CellLine::CLOSED;
        update.prepare(tile, line, false, &mut CellLimits::default());
        let [mut xx, mut xy, mut yy] = cell_tensors(tile, line, false);
        for i in 0..xx.len() {
            let (dxx, dxy, ddet) = (xx[i], xy[i], yy[i]);
            let (open, inverse) = (ddet > 0.0, 1.0 / (dxx * ddet));
            let idet = dxx * inverse;
            xx[i] = choose(open, (ddet + dxy * dxy) * inverse, 0.0);
            xy[i] = choose(open, -dxy * idet, 0.0);
            yy[i] = choose(open, dxx * idet, 0.0);
        }
        Self { update, metric: [xx, xy, yy] }
    }
}

/// What the weights of a tile say about the nodes of a line: costs, and how much higher the ring is than each node.
struct Weights {
    costs: LineCosts,
    climb: [Lanes; 8],
}

impl Weights {
    #[inline(always)]
    fn new(tile: &Tile<'_>, line: usize) -> Self {
        let costs = line_costs(tile, line, false);
        let mut climb = [[0.0; SIDE]; 8];
        if let Some(weights) = tile.prices.weights {
            let lines =
                [line, line + 1, line + 2].map(|line| block_line(&weights.rise, line, false));
            climb = rings([&lines[0], &lines[1], &lines[2]], 1);
            let own = lanes(&lines[1], 1);
            for k in 0..8 {
                for i in 0..SIDE {
                    climb[k][i] -= own[i];
                }
            }
        }
        Self { costs, climb }
    }
}

/// How much higher the (corrected) values at offsets from the nodes of a row are than those of the nodes.
#[inline(always)]
fn rises<const N: usize>(
    g: &BatchBlock,
    e: &BatchBlock,
    at: (usize, usize),
    places: [(i32, i32); N],
) -> [Lanes; N] {
    let (g0, e0) = (at_offset(g, at, (0, 0)), at_offset(e, at, (0, 0)));
    let mut rises = [[0f32; SIDE]; N];
    for k in 0..N {
        let (g1, e1) = (at_offset(g, at, places[k]), at_offset(e, at, places[k]));
        for i in 0..SIDE {
            rises[k][i] = (g1[i] - g0[i]) + (e1[i] - e0[i]);
        }
    }
    rises
}

/// Finds the feet of a tile, if `AGAIN` from those of the round before; the output is the neighbours that it reads. A kernel for
/// each case: one that reads feet in the first round too is 3 % slower.
struct Find<'a, const T: usize, const IS_FACTORED: bool, const AGAIN: bool> {
    around: &'a Surroundings,
    /// The column of the batch at which the tile begins.
    from: usize,
    tile: Tile<'a>,
    size: [usize; 2],
    feet: &'a mut Feet,
}

impl<const T: usize, const IS_FACTORED: bool, const AGAIN: bool> Kernel
    for Find<'_, T, IS_FACTORED, AGAIN>
{
    type Output = u8;

    #[inline(always)]
    fn run(self) -> u8 {
        let Self { around, from, tile, size, feet } = self;
        let mut dependencies = Dependencies::default();
        if AGAIN && feet.by_columns {
            feet.transpose();
        }
        let mut north = Cells::<T>::new(&tile, 0);
        feet.roughness = Roughness::default();
        for row in 0..SIDE {
            let south = Cells::new(&tile, row + 1);
            let cells = [&north, &south];
            let at = (from, row);
            let line = if AGAIN {
                find_line_again::<T, IS_FACTORED>(around, at, &tile, cells, &feet.line(row))
            } else {
                find_line::<T, IS_FACTORED>(around, at, &tile, cells, &Line::UNKNOWN)
            };
            north = south;
            dependencies.add(row, &line);
            feet.roughness.add(&line);
            feet.set_line(row, &line);
        }
        dependencies.set(feet, size)
    }
}

/// Finds the feet of a row of a tile from those of the round before. Where one is in another triangle now, which is seldom, the row
/// is done without them, and with two Newton steps: with one, the error near the pole of a sphere falls with order 0.9 instead
/// of 1.3.
#[inline(always)]
fn find_line_again<const T: usize, const IS_FACTORED: bool>(
    around: &Surroundings,
    at: (usize, usize),
    tile: &Tile<'_>,
    cells: [&Cells<T>; 2],
    before: &Line,
) -> Line {
    let mut line = find_line::<T, IS_FACTORED>(around, at, tile, cells, before);
    if line.is_elsewhere(before) {
        line = Line::UNKNOWN;
        for _ in 0..2 {
            line = find_line::<T, IS_FACTORED>(around, at, tile, cells, &line);
        }
    }
    line
}

/// The feet of a row or column of a tile: bits of a [`LaneTriangle`], the share `θ` of the diagonal neighbour, and the defect `ρ`.
pub(super) struct Line {
    pub(super) triangle: [u32; SIDE],
    pub(super) theta: Lanes,
    pub(super) defect: Lanes,
    /// See [`Minimum`](super::functional::Minimum).
    rejected: Lanes,
    length: Lanes,
}

impl Roughness {
    /// Adds the nodes of a line.
    #[inline(always)]
    fn add(&mut self, line: &Line) {
        for i in 0..SIDE {
            self.nodes += u32::from(line.rejected[i] > 0.0);
            self.rejected += line.rejected[i];
            self.lengths += line.length[i];
        }
    }
}

impl Line {
    /// No feet.
    const UNKNOWN: Self = Self {
        triangle: [LaneTriangle::NONE; SIDE],
        theta: [0.0; SIDE],
        defect: [0.0; SIDE],
        rejected: [0.0; SIDE],
        length: [0.0; SIDE],
    };

    /// Whether any foot is in another triangle.
    #[inline(always)]
    fn is_elsewhere(&self, before: &Self) -> bool {
        let mut moved = 0;
        for i in 0..SIDE {
            moved |= self.triangle[i] ^ before.triangle[i];
        }
        moved != 0
    }
}

/// Finds the feet of a row of a tile by a step of Newton's method: from the feet `before` that are in the same triangle, from those of first
/// order where there are none.
#[inline(always)]
fn find_line<const T: usize, const IS_FACTORED: bool>(
    Surroundings { g, e, metric: [xx, xy, yy] }: &Surroundings,
    at: (usize, usize),
    tile: &Tile<'_>,
    cells: [&Cells<T>; 2],
    before: &Line,
) -> Line {
    let row = at.1;
    let tensors = line_tensors(tile, row, false);
    let mut terms = [[0f32; SIDE]; 8];
    let (mut m0, mut origin) = ([1.0, 0.0, 1.0], [1.0, 0.0]);
    if let Some((factor, first)) = tile.factor {
        factoring_terms(tile, row, false, &tensors, &mut terms, &mut LaneLimits::default());
        let m = factor.metric;
        m0 = [m.xx as f32, m.xy as f32, m.yy as f32];
        origin = [(first.x - factor.at.x) as f32, (first.y + row as f64 - factor.at.y) as f32];
    }
    let ring = rises(g, e, at, RING);
    // The nodes that follow `b` on its line, two lines from that of the node; one for each place of `a`.
    let ahead = rises(g, e, at, [(1, -2), (-2, 1), (-1, -2), (-2, -1)]);
    let behind = rises(g, e, at, [(1, 2), (2, 1), (-1, 2), (2, -1)]);
    let Weights { costs, climb } = Weights::new(tile, row);
    let update = cells.map(|cells| &cells.update);
    let by_nodes = tile.prices.cells.is_none();
    let [_, _, dets] = tensors;
    let metrics = cells.map(|cells| &cells.metric);
    let nodes = [rings_of(xx, at), rings_of(xy, at), rings_of(yy, at)];
    let own = (0, 0);
    let (xx, xy, yy) = (at_offset(xx, at, own), at_offset(xy, at, own), at_offset(yy, at, own));
    let g = at_offset(g, at, own);
    let seeds = tile.seeds.map_or([UNREACHED; SIDE], |seeds| lanes(&seeds[..], row * SIDE));
    let ratios = cost_ratios(&costs);
    let mut line = Line { triangle: [0; SIDE], ..Line::UNKNOWN };
    // The triangles first: in one loop with the rest it was 2 % slower.
    let (mut slopes, mut on, mut shifted) = ([0.0; SIDE], [0.0; SIDE], ring);
    if IS_FACTORED {
        for k in 0..8 {
            for i in 0..SIDE {
                shifted[k][i] += terms[k][i];
                on[i] = choose(terms[k][i] < 0.0, 1.0, on[i]);
            }
        }
    }
    if by_nodes {
        for i in 0..SIDE {
            (line.triangle[i], slopes[i]) = LaneTriangle::best_by_node(
                ring_of(&shifted, i),
                [xx[i], xy[i], yy[i]],
                1.0 / dets[i],
            );
        }
    } else {
        for i in 0..SIDE {
            (line.triangle[i], slopes[i]) =
                LaneTriangle::best(ring_of(&shifted, i), update, &costs, i);
        }
    }
    let around = gather(&line.triangle, by_nodes, &metrics, &nodes, &[xx, xy, yy]);
    for i in 0..SIDE {
        let bits = line.triangle[i];
        let triangle = LaneTriangle::from_bits(bits);
        let ring = ring_of(&ring, i);
        let (costs_around, climb) = (ring_of(&costs.ring, i), ring_of(&climb, i));
        let [cost_b, _] = triangle.diagonals(costs_around);
        let [climb_b, climb_c] = triangle.diagonals(climb);
        let [beside, opposite] = triangle.diagonals(ring);
        let far_ahead = triangle.side(ahead[0][i], ahead[1][i], ahead[2][i], ahead[3][i]);
        let far_behind = triangle.side(behind[0][i], behind[1][i], behind[2][i], behind[3][i]);
        let functional = Functional {
            rise: [
                triangle.axis(ring),
                beside,
                opposite,
                triangle.backwards().choose(far_ahead, far_behind),
            ],
            slope: slopes[i],
            own: triangle.mirror(at_lane(&around.own, i)),
            beside: triangle.mirror(at_lane(&around.beside, i)),
            nodes: [
                triangle.mirror([xx[i], xy[i], yy[i]]),
                triangle.mirror(at_lane(&around.a, i)),
                triangle.mirror(at_lane(&around.b, i)),
            ],
            costs: [
                costs.own[i],
                open_or(triangle.axis(costs_around), costs.own[i]),
                open_or(cost_b, costs.own[i]),
            ],
            cost_ratio: ratios[i],
            climb: [triangle.axis(climb), climb_b, climb_c],
            is_by_nodes: tile.prices.is_by_nodes || by_nodes,
            factor: FactorAt::new(
                on[i],
                triangle.mirror(m0),
                triangle.mirror_vector([origin[0] + i as f32, origin[1]]),
            ),
            known: choose(before.triangle[i] == bits, before.theta[i], -1.0),
        };
        let minimum = if T == 1 {
            functional.minimise::<IS_FACTORED, false>()
        } else {
            functional.minimise::<IS_FACTORED, true>()
        };
        // Beyond the seam of a periodic grid a value can be read, but belongs to another tile.
        let fixed = (seeds[i] < UNREACHED) | (g[i] >= UNREACHED) | (dets[i] == 0.0);
        line.triangle[i] = if fixed { LaneTriangle::NONE } else { bits };
        line.theta[i] = choose(fixed, 0.0, minimum.theta);
        line.defect[i] = choose(fixed, 0.0, minimum.defect);
        line.rejected[i] = choose(fixed, 0.0, minimum.rejected);
        line.length[i] = choose(fixed, 0.0, minimum.length);
    }
    line
}

/// `M` as xx, xy, yy around the triangle of each node of a line: in its cell, in that on the other side of the edge to `a`, at `a` and at `b`.
struct Around {
    own: [Lanes; 3],
    beside: [Lanes; 3],
    a: [Lanes; 3],
    b: [Lanes; 3],
}

/// Chooses by the triangle of each node from what lies around it; for the metrics of the cells, those of the node where there are none.
#[inline(always)]
fn gather(
    triangles: &[u32; SIDE],
    by_nodes: bool,
    [north, south]: &[&[CellLanes; 3]; 2],
    rings: &[[Lanes; 8]; 3],
    own: &[Lanes; 3],
) -> Around {
    let none = [[0.0; SIDE]; 3];
    let mut around = Around { own: none, beside: none, a: none, b: none };
    for k in 0..3 {
        for i in 0..SIDE {
            let triangle = LaneTriangle::from_bits(triangles[i]);
            let cells = [north[k][i], north[k][i + 1], south[k][i], south[k][i + 1]];
            let [cell, beside] = triangle.cells(cells);
            around.own[k][i] = choose(by_nodes, own[k][i], cell);
            around.beside[k][i] = choose(by_nodes, own[k][i], beside);
            let ring = ring_of(&rings[k], i);
            around.a[k][i] = triangle.axis(ring);
            [around.b[k][i], _] = triangle.diagonals(ring);
        }
    }
    around
}

#[inline(always)]
fn at_lane(all: &[Lanes; 3], i: usize) -> [f32; 3] {
    [all[0][i], all[1][i], all[2][i]]
}

/// A cost; where it is infinite, since the node is closed, that of a neighbour.
#[inline(always)]
fn open_or(cost: f32, neighbour: f32) -> f32 {
    choose(cost < f32::INFINITY, cost, neighbour)
}

/// The largest cost by the smallest among each node of a line and its open neighbours.
#[inline(always)]
fn cost_ratios(costs: &LineCosts) -> Lanes {
    let (mut most, mut fewest) = (costs.own, costs.own);
    for ring in &costs.ring {
        for i in 0..SIDE {
            let open = ring[i] < f32::INFINITY;
            most[i] = choose(open & (ring[i] > most[i]), ring[i], most[i]);
            fewest[i] = choose(ring[i] < fewest[i], ring[i], fewest[i]);
        }
    }
    for i in 0..SIDE {
        most[i] /= fewest[i];
    }
    most
}

/// Which lines the rows and the columns of a tile read, and the sum of the directions from the nodes to their feet.
///
/// Aligned, which aligns all that [`Find`] keeps on the stack: where that lay across cache lines, high accuracy took 3 % longer.
#[derive(Default)]
#[repr(align(64))]
struct Dependencies {
    rows: [u8; SIDE],
    cols: [u32; SIDE],
    east: [i32; SIDE],
    south: [i32; SIDE],
}

impl Dependencies {
    /// Adds a row.
    #[inline(always)]
    fn add(&mut self, row: usize, line: &Line) {
        let (triangles, thetas) = (&line.triangle, &line.theta);
        let mut reads = 0;
        for i in 0..SIDE {
            let triangle = LaneTriangle::from_bits(triangles[i]);
            let (negative, along_y) = (triangle.negative.is_true(), triangle.along_y.is_true());
            let backwards = triangle.backwards().is_true();
            let fixed = triangles[i] == LaneTriangle::NONE;
            // Along the axis of `a`, the line that holds both neighbours; across it the own line, that of `b`, or both.
            let bit = |negative: bool| if negative { BEFORE } else { BEHIND };
            let own = if thetas[i] < 1.0 { ITSELF } else { 0 };
            let other = if thetas[i] > 0.0 { bit(backwards) } else { 0 };
            let (along, across) = (bit(negative), own | other);
            self.cols[i] |= if fixed {
                0
            } else if along_y {
                across
            } else {
                along
            };
            reads |= if fixed {
                0
            } else if along_y {
                along
            } else {
                across
            };
            let step = |negative: bool| if negative { -1 } else { 1 };
            let (along, across) =
                (step(negative), if thetas[i] < 0.5 { 0 } else { step(backwards) });
            self.east[i] += if fixed {
                0
            } else if along_y {
                across
            } else {
                along
            };
            self.south[i] += if fixed {
                0
            } else if along_y {
                along
            } else {
                across
            };
        }
        self.rows[row] = reads as u8;
    }

    /// Sets how the feet are to be swept; returns the neighbouring tiles that they read.
    #[inline(always)]
    fn set(&self, feet: &mut Feet, size: [usize; 2]) -> u8 {
        let mut cols = [0u8; SIDE];
        for i in 0..SIDE {
            cols[i] = self.cols[i] as u8;
        }
        let (east, south) = (self.east.iter().sum::<i32>(), self.south.iter().sum::<i32>());
        let reads = neighbours_read(size, feet, &self.rows, &cols);
        // By columns where most values come along the rows, beginning on the side they come from.
        feet.by_columns = east.abs() > south.abs();
        if feet.by_columns {
            (feet.descending, feet.reads) = (east > 0, cols);
            feet.transpose();
        } else {
            (feet.descending, feet.reads) = (south > 0, self.rows);
        }
        reads
    }
}

/// The neighbouring tiles that a tile reads, one bit each as in [`RING`]; perhaps one too many at a corner.
fn neighbours_read(
    [width, height]: [usize; 2],
    feet: &Feet,
    rows: &[u8; SIDE],
    cols: &[u8; SIDE],
) -> u8 {
    let (east, south) = (width - 1, height - 1);
    let corner = |place: usize, falling: bool, west: bool| {
        let bits = u32::from(feet.packed[place]) & LaneTriangle::ALL;
        let t = LaneTriangle::from_bits(bits);
        let to_west = if t.along_y.is_true() { t.backwards() } else { t.negative };
        bits != LaneTriangle::NONE && t.falling.is_true() == falling && to_west.is_true() == west
    };
    let bits = [
        u32::from(cols[east]) & BEHIND != 0,
        corner(south * SIDE + east, false, false),
        u32::from(rows[south]) & BEHIND != 0,
        corner(south * SIDE, true, true),
        u32::from(cols[0]) & BEFORE != 0,
        corner(0, false, true),
        u32::from(rows[0]) & BEFORE != 0,
        corner(east, true, false),
    ];
    bits.into_iter().enumerate().fold(0, |set, (k, bit)| set | u8::from(bit) << k)
}
