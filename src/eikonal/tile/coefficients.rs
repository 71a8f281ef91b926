//! The coefficients of the update: of cells, and of the nodes between them, line by line.

#![allow(clippy::needless_range_loop, reason = "lanes of several arrays go together")]

use glam::{DVec2, Vec2Swizzles as _};

use super::{Limits, Tile};
use crate::eikonal::stencil::UNREACHED;
use crate::eikonal::stencil::ring::{RING, Triangle, for_each_triangle, rings};
use crate::eikonal::stencil::segment::{ClosedForm, diagonal_cost};
use crate::eikonal::tensor_field::CELLS;
use crate::grid::tiling::{PADDED, PaddedTile, SIDE};
use crate::linalg::lanes::{Lanes, choose, greatest, lanes, least};

/// A number for each cell of a line of cells that touch a tile.
pub(crate) type CellLanes = [f32; CELLS];

/// The coefficients of the triangles in a line of cells, for each of its `T` tensors: one for all triangles of a cell or, with an aversion to
/// climb, one for each of the four half-cells, see [`Triangle::half`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct CellLine<const T: usize> {
    halves: [CellCoefficients; T],
}

/// [`ClosedForm`] has the equation. `D = [xx xy; xy yy]` is at the same time `[s β; β q]` for `a = (1, 0)`, `b = (1, 1)`. The
/// triangles along y have x and y exchanged; those with the other diagonal have `β` and `hi` with the other sign.
#[derive(Clone, Copy, Debug)]
struct CellCoefficients {
    /// Those of the triangles with the axis neighbour along x, and along y.
    along: [Along; 2],
    /// Lengths of the steps east, south, and along the rising and the falling diagonal.
    step: [CellLanes; 4],
}

/// [`ClosedForm`] of the four triangles along an axis.
#[derive(Clone, Copy, Debug)]
struct Along {
    inv_s: CellLanes,
    det_over_s2: CellLanes,
    /// Both with the other sign where the diagonal is falling.
    beta_over_s: CellLanes,
    hi: CellLanes,
    lo_rising: CellLanes,
    lo_falling: CellLanes,
}

impl Along {
    /// Sets the coefficients of cell `i` from `‖a‖`, and from `‖b‖` and `1/(det D ‖b‖)` of the rising diagonal and of the falling one. Returns
    /// how far the minimum over a segment may lie below the value at an end, see [`Limits::margin`].
    #[inline(always)]
    fn set(
        &mut self,
        i: usize,
        open: bool,
        [s, inv_s, inv_q]: [f32; 3],
        [beta, det]: [f32; 2],
        length_of_a: f32,
        [rising, inv_rising, falling, inv_falling]: [f32; 4],
    ) -> f32 {
        let hi = beta * length_of_a * inv_q;
        let (lo_rising, lo_falling) = ((beta - s) * inv_rising, -(s + beta) * inv_falling);
        self.inv_s[i] = choose(open, inv_s, f32::INFINITY);
        self.det_over_s2[i] = choose(open, det * inv_s * inv_s, 0.0);
        self.beta_over_s[i] = choose(open, beta * inv_s, 0.0);
        self.hi[i] = choose(open, hi, 0.0);
        self.lo_rising[i] = choose(open, lo_rising, 0.0);
        self.lo_falling[i] = choose(open, lo_falling, 0.0);
        greatest(hi.abs() - length_of_a, greatest(-lo_rising - rising, -lo_falling - falling))
    }
}

/// The speed tensors of a line of nodes or of cells: `xx`, `xy` and the determinant, 0 where closed. `xx·yy − xy²` would lose the
/// determinant of a very anisotropic tensor in rounding.
pub(crate) type LineTensors<const N: usize = SIDE> = [[f32; N]; 3];

impl<const T: usize> CellLine<T> {
    /// Closed cells: all steps are infinite.
    pub(crate) const CLOSED: Self = {
        let (none, infinite) = ([0.0; CELLS], [f32::INFINITY; CELLS]);
        let along = Along {
            inv_s: infinite,
            det_over_s2: none,
            beta_over_s: none,
            hi: none,
            lo_rising: none,
            lo_falling: none,
        };
        Self { halves: [CellCoefficients { along: [along; 2], step: [infinite; 4] }; T] }
    };

    /// Computes those of a line of cells of a tile, of a column where `by_columns`.
    #[inline(always)]
    pub(crate) fn prepare(
        &mut self,
        tile: &Tile<'_>,
        line: usize,
        by_columns: bool,
        limits: &mut CellLimits,
    ) {
        let tensors = cell_tensors(tile, line, by_columns);
        if T == 1 {
            self.halves[0].prepare::<false>(&tensors, &[1.0; CELLS], limits);
            return;
        }
        let Some(weights) = tile.prices.weights else { return };
        // Not `map`, as in `lanes`.
        let near = block_line(&weights.rise, line, by_columns);
        let far = block_line(&weights.rise, line + 1, by_columns);
        let cost = block_line(&weights.cost, line, by_columns);
        let next = block_line(&weights.cost, line + 1, by_columns);
        let mut most = [0.0; CELLS];
        for i in 0..CELLS {
            for corner in [cost[i], cost[i + 1], next[i], next[i + 1]] {
                most[i] = greatest(most[i], choose(corner < f32::INFINITY, corner, 0.0));
            }
        }
        for half in 0..T {
            let (bottom, right) = (half & 2 != 0, half & 1 != 0);
            let edge = if bottom { &far } else { &near };
            let mut averse = [[0.0; CELLS]; 3];
            for i in 0..CELLS {
                let side = if right { i + 1 } else { i };
                let (px, py) = (edge[i + 1] - edge[i], far[side] - near[side]);
                let d = [tensors[0][i], tensors[1][i], tensors[2][i]];
                [averse[0][i], averse[1][i], averse[2][i]] = averse_to_climb(d, px, py);
            }
            self.halves[half].prepare::<true>(&averse, &most, limits);
        }
    }

    /// Computes those by which the steps to a line of nodes are priced where there are no cells: in the place of a cell those of a node.
    #[inline(always)]
    pub(crate) fn prepare_nodes(&mut self, tensors: &LineTensors, limits: &mut CellLimits) {
        let mut padded = [[0.0; CELLS]; 3];
        for k in 0..3 {
            padded[k][..SIDE].copy_from_slice(&tensors[k]);
        }
        self.halves[0].prepare::<false>(&padded, &[1.0; CELLS], limits);
    }

    /// The coefficients of a triangle of a cell in this line.
    #[inline(always)]
    fn closed_form(&self, t: Triangle, cell: usize) -> ClosedForm {
        let along = &self.of_half(t).along[usize::from(t.along_y)];
        let (beta_over_s, hi) = (along.beta_over_s[cell], along.hi[cell]);
        ClosedForm {
            inv_s: along.inv_s[cell],
            det_over_s2: along.det_over_s2[cell],
            beta_over_s: if t.falling { -beta_over_s } else { beta_over_s },
            lo: if t.falling { along.lo_falling[cell] } else { along.lo_rising[cell] },
            hi: if t.falling { -hi } else { hi },
        }
    }

    /// The value through a triangle of a cell in this line, ends included.
    #[inline(always)]
    pub(crate) fn through(
        &self,
        t: Triangle,
        cell: usize,
        [ga, gb]: [f32; 2],
        costs: [f32; 3],
    ) -> f32 {
        let form = self.closed_form(t, cell);
        let step = &self.of_half(t).step;
        let diagonal = step[if t.falling { 3 } else { 2 }][cell];
        if T == 1 {
            // Clamped to the end `a`, the closed form gives the value through it.
            return choose(gb - ga < form.lo, gb + diagonal, form.through(ga, gb));
        }
        let [own, a, b] = costs;
        let axis = step[usize::from(t.along_y)][cell];
        let ends = least(ga + 0.5 * (own + a) * axis, gb + 0.5 * (own + b) * diagonal);
        least(ends, form.through_weighted(ga, gb, costs))
    }

    #[inline(always)]
    fn of_half(&self, t: Triangle) -> &CellCoefficients {
        &self.halves[if T == 1 { 0 } else { t.half() }]
    }
}

/// The tensor `D` as xx, xy, det with an aversion to climb: `(M + p pᵀ)⁻¹`, where `p` is the gradient of the weighted heights. See
/// [`averse_to_climb`](crate::metric) of metrics.
#[inline(always)]
pub(crate) fn averse_to_climb([xx, xy, det]: [f32; 3], px: f32, py: f32) -> [f32; 3] {
    let yy = (det + xy * xy) / xx;
    let form = px * (xx * px + xy * py) + py * (xy * px + yy * py);
    let inverse = 1.0 / (1.0 + form);
    [(xx + det * (py * py)) * inverse, (xy - det * (px * py)) * inverse, det * inverse]
}

impl CellCoefficients {
    /// Computes the coefficients of tensors under which steps cost at most `most` times their length.
    #[inline(always)]
    fn prepare<const IS_WEIGHTED: bool>(
        &mut self,
        tensors: &LineTensors<CELLS>,
        most: &CellLanes,
        limits: &mut CellLimits,
    ) {
        let [xxs, xys, dets] = tensors;
        let mut obtuse = [0f32; CELLS];
        for i in 0..CELLS {
            let (xx, xy, det) = (xxs[i], xys[i], dets[i]);
            let open = det > 0.0;
            let inv_xx = 1.0 / xx;
            let yy = (det + xy * xy) * inv_xx;
            let (inv_yy, inv_det) = (1.0 / yy, 1.0 / det);
            // M = D⁻¹ is [yy −xy; −xy xx]/det.
            let (east, south) = ((yy * inv_det).sqrt(), (xx * inv_det).sqrt());
            let rising = (greatest(xx + yy - 2.0 * xy, 1e-30) * inv_det).sqrt();
            let falling = (greatest(xx + yy + 2.0 * xy, 1e-30) * inv_det).sqrt();
            let (inv_rising, inv_falling) = (inv_det / rising, inv_det / falling);
            let [step_east, step_south, step_rising, step_falling] = &mut self.step;
            step_east[i] = choose(open, east, f32::INFINITY);
            step_south[i] = choose(open, south, f32::INFINITY);
            step_rising[i] = choose(open, rising, f32::INFINITY);
            step_falling[i] = choose(open, falling, f32::INFINITY);
            let [along_x, along_y] = &mut self.along;
            let diagonals = [rising, inv_rising, falling, inv_falling];
            let obtuse_x = along_x.set(i, open, [xx, inv_xx, inv_yy], [xy, det], east, diagonals);
            let obtuse_y = along_y.set(i, open, [yy, inv_yy, inv_xx], [xy, det], south, diagonals);
            // Where costs differ along a segment, Newton's method may end beside the minimum: by the length of a step then.
            let beside = if IS_WEIGHTED { 0.5 * greatest(rising, falling) } else { 0.0 };
            obtuse[i] = choose(open, (greatest(obtuse_x, obtuse_y) + beside) * most[i], 0.0);
        }
        // In a loop of its own, or the limits would be stored cell by cell.
        for i in 0..CELLS {
            limits.0[i] = greatest(limits.0[i], obtuse[i]);
        }
    }
}

/// What the update needs of the nodes of a line.
#[derive(Clone, Copy, Debug)]
pub(crate) struct NodeLine {
    /// What the steps to the [`RING`] cost, each along an edge or a diagonal: the least under the cells beside it.
    step: [Lanes; 8],
    /// A smaller change does not count.
    pub(crate) tolerance: Lanes,
    /// The node is only lowered to values below this: infinite except at nodes of the start, see [`ceiling()`], and closed nodes.
    pub(crate) ceiling: Lanes,
    /// No step costs less than the root of this.
    pub(crate) least_square_of_steps: Lanes,
}

impl NodeLine {
    /// Nodes that are never updated.
    pub(crate) const CLOSED: Self = {
        let infinite = [f32::INFINITY; SIDE];
        Self {
            step: [infinite; 8],
            tolerance: infinite,
            ceiling: infinite,
            least_square_of_steps: infinite,
        }
    };

    /// Computes those of a line of a tile between two lines of cells. `dets` are 0 where a node is closed.
    #[inline(always)]
    pub(crate) fn prepare<const T: usize, const BY_NODES: bool>(
        &mut self,
        tile: &Tile<'_>,
        line: usize,
        by_columns: bool,
        cells: [&CellLine<T>; 2],
        dets: &Lanes,
        limits: &mut LaneLimits,
    ) {
        let costs = line_costs(tile, line, by_columns);
        self.step = [[f32::INFINITY; SIDE]; 8];
        let mut square = [f32::INFINITY; SIDE];
        for_each_triangle!(t => {
            let (dx, dy) = RING[t.b];
            let cell = cells[if dy > 0 { 1 } else { 0 }].of_half(t);
            let axis = &cell.step[usize::from(t.along_y)];
            let diagonal = &cell.step[if t.falling { 3 } else { 2 }];
            let inv_s = &cell.along[usize::from(t.along_y)].inv_s;
            let east = if dx > 0 && !BY_NODES { 1 } else { 0 };
            for i in 0..SIDE {
                self.step[t.a][i] = least(self.step[t.a][i], axis[i + east]);
                self.step[t.b][i] = least(self.step[t.b][i], diagonal[i + east]);
                // The least of the form over the segment, 1/s, and of the costs on its ends.
                let cost = if T == 1 {
                    1.0
                } else {
                    0.5 * (costs.own[i] + least(costs.ring[t.a][i], costs.ring[t.b][i]))
                };
                square[i] = least(square[i], inv_s[i + east] * (cost * cost));
            }
        });
        if T > 1 {
            for k in 0..8 {
                for i in 0..SIDE {
                    let cost = 0.5 * (costs.own[i] + costs.ring[k][i]);
                    self.step[k][i] =
                        choose(cost < f32::INFINITY, self.step[k][i] * cost, f32::INFINITY);
                }
            }
        }
        let mut longest = [0f32; SIDE];
        for i in 0..SIDE {
            let mut shortest = f32::INFINITY;
            for k in 0..8 {
                let step = self.step[k][i];
                shortest = least(shortest, step);
                longest[i] = greatest(longest[i], choose(step < f32::INFINITY, step, 0.0));
            }
            let open = dets[i] > 0.0;
            self.tolerance[i] = choose(open, tile.tolerance * shortest, f32::INFINITY);
            // A closed node never changes: at the seam of a periodic grid it stands for one of another tile.
            self.ceiling[i] = choose(open, f32::INFINITY, f32::NEG_INFINITY);
            self.least_square_of_steps[i] = 0.5 * square[i];
            longest[i] = choose(open, longest[i], 0.0);
        }
        for i in 0..SIDE {
            limits.longest_step[i] = greatest(limits.longest_step[i], longest[i]);
        }
        let Some(seeds) = tile.seeds else { return };
        for i in 0..SIDE {
            let place = if by_columns { i * SIDE + line } else { line * SIDE + i };
            let mut shortest = f32::INFINITY;
            for k in 0..8 {
                shortest = least(shortest, self.step[k][i]);
            }
            self.ceiling[i] = least(self.ceiling[i], ceiling(seeds[place], shortest));
        }
    }

    /// The best value of node `i` over its ring: over the eight nodes, and between them over the eight segments.
    #[inline(always)]
    pub(crate) fn best<const T: usize, const BY_NODES: bool>(
        &self,
        cells: [&CellLine<T>; 2],
        ring: [f32; 8],
        costs: &LineCosts,
        i: usize,
    ) -> f32 {
        let mut best = f32::INFINITY;
        for k in 0..8 {
            best = least(best, ring[k] + self.step[k][i]);
        }
        for_each_triangle!(t => {
            let (dx, dy) = RING[t.b];
            let (line, cell) = cell_of::<BY_NODES>((dx, dy), i);
            let form = cells[line].closed_form(t, cell);
            let value = if T == 1 {
                form.through(ring[t.a], ring[t.b])
            } else {
                let weights = [costs.own[i], costs.ring[t.a][i], costs.ring[t.b][i]];
                form.through_weighted(ring[t.a], ring[t.b], weights)
            };
            best = least(best, value);
        });
        best
    }
}

/// The line, of the two around a line of nodes, and the place in it of the cell to a diagonal neighbour of node `i`. Where nodes stand for cells
/// it is the node itself.
#[inline(always)]
pub(crate) fn cell_of<const BY_NODES: bool>((dx, dy): (i32, i32), i: usize) -> (usize, usize) {
    (if dy > 0 { 1 } else { 0 }, if dx > 0 && !BY_NODES { i + 1 } else { i })
}

/// Costs at the nodes of a line and around them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LineCosts {
    pub(crate) own: Lanes,
    pub(crate) ring: [Lanes; 8],
}

impl LineCosts {
    /// Costs of 1.
    const ONE: Self = Self { own: [1.0; SIDE], ring: [[1.0; SIDE]; 8] };
}

/// The costs of a line of a tile.
#[inline(always)]
pub(crate) fn line_costs(tile: &Tile<'_>, line: usize, by_columns: bool) -> LineCosts {
    let Some(weights) = tile.prices.weights else { return LineCosts::ONE };
    let before = block_line(&weights.cost, line, by_columns);
    let at = block_line(&weights.cost, line + 1, by_columns);
    let after = block_line(&weights.cost, line + 2, by_columns);
    let own = lanes(&at, 1);
    let mut ring = rings([&before, &at, &after], 1);
    for b in [1, 3, 5, 7] {
        for i in 0..SIDE {
            ring[b][i] = diagonal_cost(own[i], ring[b - 1][i], ring[b][i], ring[(b + 1) % 8][i]);
        }
    }
    LineCosts { own, ring }
}

/// A row of a block, or a column.
#[inline(always)]
pub(crate) fn block_line(block: &PaddedTile, line: usize, by_columns: bool) -> [f32; PADDED] {
    if !by_columns {
        return block[line];
    }
    let mut column = [0.0; PADDED];
    for i in 0..PADDED {
        column[i] = block[i][line];
    }
    column
}

/// The largest causality margin of the cells in each place of a line; a running maximum over all cells would be one long chain of dependent
/// comparisons.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CellLimits(CellLanes);

impl Default for CellLimits {
    fn default() -> Self {
        Self([0.0; CELLS])
    }
}

/// [`Limits`] of the nodes in each lane.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct LaneLimits {
    pub(crate) cells: CellLimits,
    /// By how much factoring lowers a neighbour's value at most.
    term: Lanes,
    longest_step: Lanes,
}

impl LaneLimits {
    /// The greatest over all lanes.
    pub(crate) fn of_all(&self) -> Limits {
        let most = |lanes: &[f32]| lanes.iter().copied().fold(0.0, greatest);
        Limits {
            margin: most(&self.cells.0) + most(&self.term),
            longest_step: most(&self.longest_step),
        }
    }
}

/// The tensors of one line of nodes of a tile.
#[inline(always)]
pub(crate) fn line_tensors(tile: &Tile<'_>, line: usize, by_columns: bool) -> LineTensors {
    let all = tile.prices.nodes;
    if !by_columns {
        let first = line * SIDE;
        return [lanes(&all.xx, first), lanes(&all.xy, first), lanes(&all.det, first)];
    }
    let (mut xx, mut xy, mut det) = ([0f32; SIDE], [0f32; SIDE], [0f32; SIDE]);
    for i in 0..SIDE {
        let place = i * SIDE + line;
        (xx[i], xy[i], det[i]) = (all.xx[place], all.xy[place], all.det[place]);
    }
    // The `xx` of a column is the `yy` of rows.
    for i in 0..SIDE {
        xx[i] = (det[i] + xy[i] * xy[i]) / xx[i];
    }
    [xx, xy, det]
}

/// The tensors of one line of the cells that touch a tile.
#[inline(always)]
pub(crate) fn cell_tensors(tile: &Tile<'_>, line: usize, by_columns: bool) -> LineTensors<CELLS> {
    let (mut xx, mut xy, mut det) = ([0f32; CELLS], [0f32; CELLS], [0f32; CELLS]);
    let Some(all) = tile.prices.cells else { return [xx, xy, det] };
    for i in 0..CELLS {
        let place = if by_columns { i * CELLS + line } else { line * CELLS + i };
        (xx[i], xy[i], det[i]) = (all.xx[place], all.xy[place], all.det[place]);
    }
    if by_columns {
        for i in 0..CELLS {
            xx[i] = (det[i] + xy[i] * xy[i]) / xx[i];
        }
    }
    [xx, xy, det]
}

/// Computes the factoring terms at the nodes of one line of a tile: 0 without a factor.
#[inline(always)]
pub(crate) fn factoring_terms(
    tile: &Tile<'_>,
    line: usize,
    by_columns: bool,
    tensors: &LineTensors,
    terms: &mut [Lanes; 8],
    limits: &mut LaneLimits,
) {
    let Some((factor, first)) = tile.factor else {
        *terms = [[0.0; SIDE]; 8];
        return;
    };
    let (factor, first) =
        if by_columns { (factor.transposed(), first.yx()) } else { (*factor, first) };
    let from = (first - factor.at) + DVec2::new(0.0, line as f64);
    let largest = factor.terms_of_line(from, tensors, terms);
    for i in 0..SIDE {
        limits.term[i] = greatest(limits.term[i], largest[i]);
    }
}

/// The value below which a node of the start may be lowered; infinite for other nodes. Start values are of second order, while the
/// update is only of first order and may lie a little below them; one that is lower by half a step comes from another start.
#[inline(always)]
pub(crate) fn ceiling(seed: f32, shortest_step: f32) -> f32 {
    choose(seed < UNREACHED, seed - 0.5 * shortest_step, f32::INFINITY)
}
