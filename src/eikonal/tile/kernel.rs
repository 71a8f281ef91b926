//! The tile kernel: sweeps over a tile until it converges.
//!
//! Semi-Lagrangian update on the eight triangles around a node `x` (index units, spacing 1): the distance
//! at `x` is the minimum, over the ring of its neighbours, of the distance on the ring plus the length of the
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
//! [`segment`](crate::eikonal::stencil::segment::segment) is that minimum over one segment in plain form,
//! [`NodeLine::best`] the closed form over all eight. A sweep updates a whole row (or column) of 16 nodes at a time, one in each lane,
//! and carries changes across the tile in the directions within 45° of its own. Lines none of whose neighbours changed are skipped.

#![allow(clippy::needless_range_loop, reason = "lanes of several arrays go together")]

use super::changes::{ROUNDING, for_neighbours, lines_next_to};
use super::coefficients::{
    CellLine, LaneLimits, LineCosts, NodeLine, factoring_terms, line_costs, line_tensors,
};
use super::transpose::transpose_block;
use super::{ALL, Limits, LineMask, Tile};
use crate::eikonal::stencil::UNREACHED;
use crate::eikonal::stencil::ring::{RING, ring_of, rings, without_cut_corners};
use crate::eikonal::tensor_field::CELLS;
use crate::grid::tiling::{PADDED, PaddedTile, SIDE};
use crate::linalg::lanes::{Lanes, choose, greatest, lanes, least};
use crate::linalg::simd::{self, Kernel};

/// Sweeps of a tile after which it is returned, though it may not have converged.
const MAX_SWEEPS: u32 = 16;

/// A tile to be solved; its values are in the [`Workspace`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Problem<'a> {
    pub(crate) tile: Tile<'a>,
    pub(crate) rule: Rule,
    /// Columns and rows that lie in the grid.
    pub(crate) size: [usize; 2],
    /// The neighbours with changes that the tile has not taken into account, one bit each in the order of [`RING`]; bit 8 is the tile itself.
    pub(crate) changed: u16,
    /// The one of them with the least change.
    pub(crate) first: u8,
    /// [`Limits::margin`] of each neighbour as far as it is known.
    pub(crate) margins: [f32; 8],
    /// Whether the tile is its own neighbour along x and along y, as in a periodic direction one tile wide.
    pub(crate) is_own_neighbour: [bool; 2],
}

/// What a sweep does to a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Rule {
    /// Lowers it to its best value over the ring.
    Lower,
    /// Makes it unreached if its ring no longer supports its value, that is, if the best value over the ring is higher.
    Forget,
}

/// What solving a tile brought, besides the values in the [`Workspace`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Solved {
    /// Whether any value changed.
    pub(crate) is_changed: bool,
    /// For each neighbour, in the order of [`RING`], the least changed value that could improve it; infinite if none.
    pub(crate) changes: [f32; 8],
    /// The least value of the tile if it has not converged yet; infinite if it has.
    pub(crate) unconverged: f32,
    /// Of the nodes that were updated.
    pub(crate) limits: Limits,
    pub(crate) sweeps: u32,
}

/// The memory in which a tile is solved; made once for many.
#[derive(Debug)]
pub(crate) struct Workspace {
    values: Oriented,
    /// The values before.
    before: PaddedTile,
    /// By rows and by columns.
    plain: [Prepared<1>; 2],
    /// The same where steps are weighted; made when first needed.
    weighted: Option<Box<[Prepared<4>; 2]>>,
    limits: LaneLimits,
}

impl Default for Workspace {
    fn default() -> Self {
        let unreached = [[UNREACHED; PADDED]; PADDED];
        Self {
            values: Oriented { block: unreached, by_columns: false },
            before: unreached,
            plain: Default::default(),
            weighted: None,
            limits: LaneLimits::default(),
        }
    }
}

/// Values of a tile and its halo, transposed while sweeps go by columns.
#[derive(Debug)]
struct Oriented {
    block: PaddedTile,
    by_columns: bool,
}

impl Oriented {
    #[inline(always)]
    fn orient(&mut self, by_columns: bool) {
        if self.by_columns != by_columns {
            self.by_columns = by_columns;
            transpose_block(&mut self.block);
        }
    }
}

/// What the update needs, line by line, made when first needed.
#[derive(Debug)]
struct Prepared<const T: usize> {
    cells: [CellLine<T>; CELLS],
    ready_cells: LineMask,
    nodes: [NodeLine; SIDE],
    /// What to add to each neighbour in the order of [`RING`]; only made by kernels that are `IS_FACTORED`.
    terms: [[Lanes; 8]; SIDE],
    ready: LineMask,
}

impl<const T: usize> Default for Prepared<T> {
    fn default() -> Self {
        Self {
            cells: [CellLine::CLOSED; CELLS],
            ready_cells: 0,
            nodes: [NodeLine::CLOSED; SIDE],
            terms: [[[0.0; SIDE]; 8]; SIDE],
            ready: 0,
        }
    }
}

/// Sweeps a tile until it converges. The values in the workspace are those of the tile and its halo, before and afterwards.
pub(crate) fn solve(workspace: &mut Workspace, problem: &Problem<'_>) -> Solved {
    workspace.values.orient(false);
    workspace.before = workspace.values.block;
    workspace.limits = LaneLimits::default();
    let Swept { sweeps, is_changed, is_converged } = sweep(workspace, problem);
    workspace.values.orient(false);
    let Workspace { values: Oriented { block: values, .. }, before, limits, .. } = &*workspace;
    let limits = limits.of_all();
    let nothing = [f32::INFINITY; 8];
    let changes = if is_changed {
        let margins = margins_with_own(problem.margins, problem.is_own_neighbour, limits.margin);
        for_neighbours(before, values, problem.size, margins)
    } else {
        nothing
    };
    let unconverged = if is_converged { f32::INFINITY } else { least_of(values) };
    Solved { is_changed, changes, unconverged, limits, sweeps }
}

/// What the sweeps over a tile came to.
struct Swept {
    sweeps: u32,
    is_changed: bool,
    is_converged: bool,
}

fn sweep(workspace: &mut Workspace, problem: &Problem<'_>) -> Swept {
    let Workspace { values, plain, weighted, limits, .. } = workspace;
    if problem.tile.prices.weights.is_some() {
        let prepared = weighted.get_or_insert_default();
        return sweep_prepared(&mut Sweeping::<4, false> { values, prepared, limits }, problem);
    }
    let prepared = plain;
    if problem.tile.prices.cells.is_some() {
        sweep_prepared(&mut Sweeping::<1, false> { values, prepared, limits }, problem)
    } else {
        sweep_prepared(&mut Sweeping::<1, true> { values, prepared, limits }, problem)
    }
}

/// The part of a [`Workspace`] that sweeps change; `BY_NODES` where there are no cells and steps are priced by nodes.
struct Sweeping<'a, const T: usize, const BY_NODES: bool> {
    values: &'a mut Oriented,
    prepared: &'a mut [Prepared<T>; 2],
    limits: &'a mut LaneLimits,
}

fn sweep_prepared<const T: usize, const BY_NODES: bool>(
    room: &mut Sweeping<'_, T, BY_NODES>,
    problem: &Problem<'_>,
) -> Swept {
    for prepared in &mut *room.prepared {
        (prepared.ready, prepared.ready_cells) = (0, 0);
    }
    // A kernel for each: one that chooses inside was 2 to 4 % slower. Weighted steps and `Forget` are less frequent, so that one with
    // factoring does for both.
    match (problem.rule, problem.tile.factor.is_some() || T > 1) {
        (Rule::Lower, false) => {
            simd::dispatch(Sweeps::<_, T, BY_NODES, false> { room, problem, update: Lower })
        }
        (Rule::Lower, true) => {
            simd::dispatch(Sweeps::<_, T, BY_NODES, true> { room, problem, update: Lower })
        }
        (Rule::Forget, _) => {
            simd::dispatch(Sweeps::<_, T, BY_NODES, true> { room, problem, update: Forget })
        }
    }
}

struct Sweeps<'a, 'b, U, const T: usize, const BY_NODES: bool, const IS_FACTORED: bool> {
    room: &'a mut Sweeping<'b, T, BY_NODES>,
    problem: &'a Problem<'a>,
    update: U,
}

impl<U: Update, const T: usize, const BY_NODES: bool, const IS_FACTORED: bool> Kernel
    for Sweeps<'_, '_, U, T, BY_NODES, IS_FACTORED>
{
    type Output = Swept;

    /// Sweeps away from the least change and back, then across and back.
    #[inline(always)]
    fn run(self) -> Swept {
        let Self { room, problem, update } = self;
        let &Problem { ref tile, size, changed, first, .. } = problem;
        let (dx, dy) = if usize::from(first) < 8 { RING[usize::from(first)] } else { (0, 0) };
        let mut descending = [dy > 0, dx > 0];
        let mut by_columns = dx != 0 && dy == 0;
        // Rows and columns next to changes in the neighbours, each of which has to be swept; and those next to changes of the last sweep,
        // of which sweeping either the rows or the columns is enough.
        let mut outside = lines_next_to(changed, size);
        let mut inside = [0; 2];
        let mut swept = Swept { sweeps: 0, is_changed: false, is_converged: false };
        loop {
            swept.is_converged = (outside, inside) == ([0; 2], [0; 2]);
            if swept.is_converged || swept.sweeps == MAX_SWEEPS {
                return swept;
            }
            let axis = usize::from(by_columns);
            let dirty = outside[axis] | inside[axis];
            if dirty != 0 {
                let descending = &mut descending[axis];
                inside = room.sweep::<IS_FACTORED>(&update, tile, by_columns, *descending, dirty);
                outside[axis] = 0;
                swept.sweeps += 1;
                swept.is_changed |= inside != [0; 2];
                *descending = !*descending;
            }
            by_columns ^= dirty == 0 || outside[1 - axis] != 0 || swept.sweeps.is_multiple_of(2);
        }
    }
}

/// The margins of the neighbours; where the tile is its own neighbour, no less than was found just now.
fn margins_with_own(mut margins: [f32; 8], is_own_neighbour: [bool; 2], own: f32) -> [f32; 8] {
    for k in 0..8 {
        let (dx, dy) = RING[k];
        if (dx == 0 || is_own_neighbour[0]) && (dy == 0 || is_own_neighbour[1]) {
            margins[k] = greatest(margins[k], own);
        }
    }
    margins
}

/// The least value of a tile.
fn least_of(values: &PaddedTile) -> f32 {
    let nodes = values[1..=SIDE].iter().flat_map(|line| &line[1..=SIDE]);
    nodes.fold(f32::INFINITY, |least, &value| least.min(value))
}

impl Workspace {
    /// The values of the tile and its halo: to be filled before it is solved, to be read afterwards.
    pub(crate) fn values(&mut self) -> &mut PaddedTile {
        self.values.orient(false);
        &mut self.values.block
    }
}

impl<const T: usize, const BY_NODES: bool> Sweeping<'_, T, BY_NODES> {
    /// One Gauss–Seidel sweep over the rows (or columns) in `dirty`, from the first to the last or the other way
    /// (`descending`), taking in those that become dirty ahead of it.
    ///
    /// Returns the rows and the columns next to which something changed: sweeping either all these rows or all these columns again is enough.
    #[inline(always)]
    fn sweep<const IS_FACTORED: bool>(
        &mut self,
        update: &impl Update,
        tile: &Tile<'_>,
        by_columns: bool,
        descending: bool,
        mut dirty: LineMask,
    ) -> [LineMask; 2] {
        let Self { values, prepared, limits } = self;
        values.orient(by_columns);
        let values = &mut values.block;
        let prepared = &mut prepared[usize::from(by_columns)];
        let mut changed = [0u32; SIDE];
        for step in 0..SIDE {
            let row = if descending { SIDE - 1 - step } else { step };
            if dirty & 1 << row == 0 {
                continue;
            }
            dirty &= !(1 << row);
            prepared.prepare::<BY_NODES, IS_FACTORED>(tile, row, by_columns, limits);
            let costs = line_costs(tile, row, by_columns);
            if update_line::<T, BY_NODES, IS_FACTORED>(
                update,
                values,
                row,
                prepared,
                &costs,
                &mut changed,
            ) {
                dirty |= around(row);
            }
        }
        let mut across = 0;
        for i in 0..SIDE {
            across |= if changed[i] == 0 { 0 } else { around(i) };
        }
        if by_columns { [across, dirty] } else { [dirty, across] }
    }
}

impl<const T: usize> Prepared<T> {
    /// The lines of cells before and behind a line of nodes.
    #[inline(always)]
    fn around<const BY_NODES: bool>(&self, line: usize) -> [&CellLine<T>; 2] {
        [&self.cells[line], &self.cells[if BY_NODES { line } else { line + 1 }]]
    }

    /// Computes what a line needs, unless it is ready.
    #[inline(always)]
    fn prepare<const BY_NODES: bool, const IS_FACTORED: bool>(
        &mut self,
        tile: &Tile<'_>,
        line: usize,
        by_columns: bool,
        limits: &mut LaneLimits,
    ) {
        if self.ready & 1 << line != 0 {
            return;
        }
        self.ready |= 1 << line;
        let tensors = line_tensors(tile, line, by_columns);
        if BY_NODES {
            self.cells[line].prepare_nodes(&tensors, &mut limits.cells);
        }
        for cells in [line, line + 1] {
            if !BY_NODES && self.ready_cells & 1 << cells == 0 {
                self.ready_cells |= 1 << cells;
                self.cells[cells].prepare(tile, cells, by_columns, &mut limits.cells);
            }
        }
        let cells = [&self.cells[line], &self.cells[if BY_NODES { line } else { line + 1 }]];
        let nodes = &mut self.nodes[line];
        nodes.prepare::<T, BY_NODES>(tile, line, by_columns, cells, &tensors[2], limits);
        if IS_FACTORED {
            factoring_terms(tile, line, by_columns, &tensors, &mut self.terms[line], limits);
        }
    }
}

/// Updates the nodes of a row; sets the bits of those that changed and says if any did.
#[inline(always)]
fn update_line<const T: usize, const BY_NODES: bool, const IS_FACTORED: bool>(
    update: &impl Update,
    values: &mut PaddedTile,
    row: usize,
    prepared: &Prepared<T>,
    costs: &LineCosts,
    changed: &mut [u32; SIDE],
) -> bool {
    let cells = prepared.around::<BY_NODES>(row);
    let (nodes, terms) = (&prepared.nodes[row], &prepared.terms[row]);
    let rings = rings([&values[row], &values[row + 1], &values[row + 2]], 1);
    let old = lanes(&values[row + 1], 1);
    let mut new = [0f32; SIDE];
    let mut any = 0;
    for i in 0..SIDE {
        let mut ring = without_cut_corners(ring_of(&rings, i));
        if IS_FACTORED {
            for k in 0..8 {
                ring[k] += terms[k][i];
            }
        }
        let best = nodes.best::<T, BY_NODES>(cells, ring, costs, i);
        let (value, is_change) = update.update(old[i], best, nodes, i);
        new[i] = value;
        changed[i] |= u32::from(is_change);
        any |= u32::from(is_change);
    }
    values[row + 1][1..=SIDE].copy_from_slice(&new);
    any != 0
}

/// A line and the ones next to it.
#[inline(always)]
fn around(line: usize) -> LineMask {
    ((0b111 << line) >> 1) & ALL
}

/// A [`Rule`].
trait Update {
    /// The new value of node `i` of a line, from the old one and the best over its ring; and whether the nodes around it have to be updated.
    fn update(&self, old: f32, best: f32, k: &NodeLine, i: usize) -> (f32, bool);
}

struct Lower;

impl Update for Lower {
    #[inline(always)]
    fn update(&self, old: f32, best: f32, k: &NodeLine, i: usize) -> (f32, bool) {
        let significant = greatest(k.tolerance[i], ROUNDING * best);
        let is_change = (old - best > significant) & (best < k.ceiling[i]);
        (choose(best < least(old, k.ceiling[i]), best, old), is_change)
    }
}

struct Forget;

impl Update for Forget {
    #[inline(always)]
    fn update(&self, old: f32, best: f32, k: &NodeLine, i: usize) -> (f32, bool) {
        let rounding = ROUNDING * old;
        // Where rounding is not far below the shortest step, two nodes could support each other.
        let is_small = rounding * rounding < 0.25 * k.least_square_of_steps[i];
        let is_supported = (best <= old + rounding) & is_small;
        // Start values need no support.
        let is_lost = !is_supported & (old < least(k.ceiling[i], UNREACHED));
        (choose(is_lost, UNREACHED, old), is_lost)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::Control;
    use crate::eikonal::stencil::foot::best_foot;
    use crate::eikonal::tensor_field::TensorField;
    use crate::grid::tiling::AREA;
    use crate::linalg::Sym2;

    /// Ratios up to 25 in turning directions, and a closed node here and there.
    fn tensor(place: usize) -> Option<Sym2> {
        let (sin, cos) = (0.03 * place as f64).sin_cos();
        let ratio = 1.0 + (place % 25) as f64;
        let along = Sym2::new(cos * cos, sin * cos, sin * sin) * ratio;
        (place % 29 != 3).then(|| along + Sym2::new(sin * sin, -sin * cos, cos * cos))
    }

    /// All values of a tile with one start node, cut off from any other.
    fn solve_alone(field: &TensorField, seeds: &[f32; AREA]) -> PaddedTile {
        let tile =
            Tile { prices: field.prices(0), factor: None, tolerance: 0.0, seeds: Some(seeds) };
        let mut workspace = Workspace::default();
        *workspace.values() = [[f32::INFINITY; PADDED]; PADDED];
        for place in 0..AREA {
            let open = field.is_open(place % SIDE, place / SIDE);
            let value = if open { seeds[place].min(UNREACHED) } else { f32::INFINITY };
            workspace.values()[place / SIDE + 1][place % SIDE + 1] = value;
        }
        let problem = Problem {
            tile,
            rule: Rule::Lower,
            size: [SIDE; 2],
            changed: 1 << 8,
            first: 8,
            margins: [0.0; 8],
            is_own_neighbour: [false; 2],
        };
        while solve(&mut workspace, &problem).unconverged < f32::INFINITY {}
        *workspace.values()
    }

    #[test]
    fn a_converged_tile_has_the_values_of_the_plain_update() {
        let tensor = |col: usize, row: usize| tensor(row * SIDE + col);
        let field = TensorField::from_fn(SIDE, SIDE, tensor, &Control::default()).unwrap();
        let mut seeds = [f32::INFINITY; AREA];
        seeds[100] = 0.0;
        let values = solve_alone(&field, &seeds);
        for place in (0..AREA).filter(|&place| place != 100) {
            if !field.is_open(place % SIDE, place / SIDE) {
                continue;
            }
            let (row, col) = (place / SIDE + 1, place % SIDE + 1);
            let ring = rings([&values[row - 1], &values[row], &values[row + 1]], 1);
            let steps = field.steps(col - 1, row - 1);
            let best = best_foot(ring_of(&ring, col - 1), [0.0; 8], &steps).unwrap().value;
            let value = f64::from(values[row][col]);
            assert!((value - best).abs() <= 1e-5 * best, "{place}: {value}, {best}");
        }
    }
}
